//! From where a search ended to an [`Estimate`].

use super::covariance::classical;
use super::noise::{Noise, Whitening};
use super::objective::Objective;
use super::run::Found;
use super::{Fit, Setting};
use crate::dispatch::PORTABLE;
use crate::error::Error;
use crate::estimate::{Direction, Estimate, Knowledge, Method, Prediction, Quality, Share, Unknown, Warning, student};
use crate::information::{Information, SquareMatrix};
use crate::integrate::Integrator;
use crate::model::{Kind, Model};
use crate::optimize::{Linearization, Severity};
use crate::predict::{Predictor, Target, Trajectory, WINDOW, Walk, Window};
use crate::signals::Signals;
use crate::whiteness::{Autocorrelation, ljung_box};
use std::time::Instant;

/// Singular values below this part of the largest are rounding of a simulation: nothing is known along their directions.
const RANK: f64 = 1e-11;
/// What has less than this share in a direction that is not known is itself known.
const SHARE: f64 = 1e-3;
/// Lags, and the probability below which errors count as colored.
const COLOR_LAGS: usize = 20;
const COLOR_LEVEL: f64 = 0.01;
/// Below so many measurements a covariance that allows for colored errors is less sure than the classical one.
const COLOR_SAMPLES: u64 = 100;
/// Colored errors that widen an interval by more than this factor call for care.
const COLOR_MATTERS: f64 = 2.0;
/// A finer step may move a parameter by this part of its standard error without a word.
const STEP_SHIFT: f64 = 0.5;
/// Errors below this part of a given noise are no sample of it.
const ROUNDING: f64 = 0.1;

impl<M: Model, I: Integrator<M>, P: Predictor<M>, O> Fit<'_, M, I, P, O> {
    pub(super) fn conclude(
        &self,
        setting: &Setting<M, P>,
        found: Found,
        begin: Instant,
    ) -> Result<Estimate<M, I, P>, Error> {
        let Found { coordinates, whitening, linear, outcome, iterations, evaluations, name, trouble } = found;
        let coordinates = coordinates.as_slice();
        let unknowns = &setting.unknowns;
        let objective = self.objective(setting, whitening.clone());
        let fresh = if linear.is_none() { 1 } else { 0 };
        let linear = match linear {
            Some(linear) => linear,
            None => objective.evaluate(coordinates).map_err(|error| Error::Optimizer(error.to_string()))?,
        };
        let n = unknowns.row.len();
        let Reproduced { quality, measured, log_determinant, step_error, color } =
            self.reproduce(&objective, coordinates)?;

        // What is held or not determined has no interval.
        let (gradient, norms) = (linear.gradient(), linear.column_norms());
        let bounds = unknowns.bounds();
        let at_bound = |i: usize| {
            let ((lower, upper), x) = (bounds[i], coordinates[i]);
            if x <= lower && gradient[i] >= 0.0 {
                Some(unknowns.row[i].parameter.lower)
            } else if x >= upper && gradient[i] <= 0.0 {
                Some(unknowns.row[i].parameter.upper)
            } else {
                None
            }
        };
        let values = unknowns.values(coordinates);
        let slopes: Vec<f64> = (0..n).map(|i| unknowns.row[i].parameter.transform.slope(values[i])).collect();
        let held_at: Vec<Option<f64>> = (0..n).map(at_bound).collect();
        let mut free: Vec<bool> = held_at.iter().map(Option::is_none).collect();
        let unseen = unseen_directions(&linear, &free, &norms);
        let mut unidentified = vec![false; n];
        for direction in &unseen {
            let largest = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
            for i in 0..n {
                unidentified[i] |= direction[i].abs() > SHARE * largest;
            }
        }
        (0..n).for_each(|i| free[i] &= !unidentified[i]);
        let directions: Vec<Direction> =
            unseen.iter().map(|d| self.direction(setting, d, &norms, &values, &slopes)).collect();

        // The covariance in the optimizer's coordinates, then in the unknowns' own units.
        let held: Vec<bool> = free.iter().map(|free| !free).collect();
        let estimated = free.iter().filter(|free| **free).count() as f64;
        // With no more measurements than unknowns nothing is left to tell the noise from.
        let degrees = if measured <= n as u64 { 0.0 } else { measured as f64 - estimated };
        let sum_of_squares = linear.sum_of_squares();
        let widening = match self.noise {
            Noise::Given(_) => 1.0,
            _ if self.noise_is_no_matter() => (sum_of_squares / degrees.max(1.0)).sqrt(),
            _ => (measured as f64 / degrees.max(1.0)).sqrt(),
        };
        let unit = classical(&linear, &held);
        let sandwich = objective.needs_sandwich();
        let priors: f64 = unknowns.priors(coordinates).map(|(_, _, error)| error * error).sum();
        let small_sample = measured as f64 / degrees.max(1.0);
        // Errors far below a given noise are rounding: their color says nothing, and their size would promise too much.
        let sigma = whitening.sigma();
        let given = matches!(self.noise, Noise::Given(_));
        let rounding = given && quality.iter().zip(&sigma).all(|(quality, sigma)| quality.rmse < ROUNDING * sigma);
        let color = color.filter(|_| !rounding);
        let colored = color.as_ref().filter(|_| M::KIND != Kind::Static && measured >= COLOR_SAMPLES);
        let colored = colored.and_then(|_| objective.colored(coordinates, &linear, &held));
        let colored = colored.and_then(|found| Some((found.sandwich.covariance(&held)?, found.lags)));
        let (covariance, factor) = match (&colored, sandwich) {
            (Some((covariance, _)), _) => (Some(covariance.clone()), small_sample),
            (None, true) => (objective.sandwich(coordinates, &held).ok().flatten(), 1.0),
            // The noise is wider than the errors, the priors are not.
            (None, false) if widening != 1.0 && unknowns.priors(coordinates).next().is_some() => {
                let widened = self.objective(setting, whitening.widened(widening));
                (widened.evaluate(coordinates).ok().and_then(|linear| classical(&linear, &held)), 1.0)
            }
            (None, false) => (unit.clone(), widening * widening),
        };
        let singular = covariance.is_none();
        let covariance = covariance.unwrap_or_else(|| SquareMatrix::zeros(n));
        let covariance = SquareMatrix::from_fn(n, |i, j| covariance[(i, j)] * factor * slopes[i] * slopes[j]);
        let known = |i: usize| free[i] && !singular && degrees > 0.0;

        let rows: Vec<Unknown> = (0..n)
            .map(|i| {
                let (unknown, value) = (&unknowns.row[i], values[i]);
                let transform = unknown.parameter.transform;
                let knowledge = match held_at[i] {
                    Some(bound) => Knowledge::Held { bound },
                    None if !known(i) => Knowledge::Unidentified,
                    None => {
                        let standard_error = covariance[(i, i)].sqrt();
                        let (lower, upper) = student::interval(value, standard_error, transform, 0.95, degrees);
                        Knowledge::Known { standard_error, lower, upper }
                    }
                };
                let index = |change: f64| {
                    let percent = 100.0 * (sum_of_squares.sqrt() * change * slopes[i] / value).abs();
                    (known(i) && percent.is_finite()).then_some(percent)
                };
                Unknown {
                    name: unknown.name.clone(),
                    unit: unknown.unit.to_owned(),
                    value,
                    start: unknown.parameter.start,
                    knowledge,
                    error_index: unit.as_ref().and_then(|unit| index(unit[(i, i)].sqrt())),
                    error_index_held: index(1.0 / norms[i]),
                    transform,
                }
            })
            .collect();
        let knowledge = M::Parameters::from_fn(|j| {
            let mine = |i: &usize| unknowns.row[*i].target == Target::Parameter(j);
            (0..n).find(mine).map_or(Knowledge::Fixed, |i| rows[i].knowledge)
        });

        // The noise, where the errors were not divided by it.
        let step_error = step_error / widening;
        let mut warnings = self.warnings(&rows, &directions, measured, step_error, setting, &whitening, coordinates);
        if !outcome.converged() && rows.iter().any(|row| row.knowledge.standard_error().is_some()) {
            let text =
                "standard errors and intervals are those of a minimum, where the search did not arrive".to_owned();
            warnings.push(Warning { severity: Severity::NotUsable, text });
        }
        if let Some(trouble) = trouble {
            let text = format!("the checkpoint could not be written ({trouble}); the search went on without it");
            warnings.push(Warning { severity: Severity::Usable, text });
        }
        if let Some(color) = color {
            let white = |i: usize| unit.as_ref().map(|unit| unit[(i, i)].sqrt() * widening * slopes[i].abs());
            let widened = |i: usize| Some(covariance[(i, i)].sqrt() / white(i).filter(|error| *error > 0.0)?);
            let widest = (0..n).filter_map(widened).fold(0.0, f64::max);
            warnings.push(color.warning(colored.as_ref().map(|(_, lags)| (*lags, widest))));
        }
        let widened = match self.noise {
            // Weights are in the sum of squares, but no part of the noise.
            Noise::PerOutput | Noise::Covariance if self.weighting.is_some() && self.noise_is_no_matter() => objective
                .estimate_noise(coordinates, self.noise)
                .map_err(|error| Error::Optimizer(error.to_string()))?
                .widened((measured as f64 / degrees.max(1.0)).sqrt()),
            _ => whitening.widened(widening),
        };
        let ml = match self.noise {
            Noise::Given(_) => whitening.clone(),
            _ if self.noise_is_no_matter() => whitening.widened((sum_of_squares / measured as f64).sqrt()),
            _ => whitening.clone(),
        };
        let plain = self.loss.is_none() && self.weighting.is_none();
        let deviance = plain.then(|| {
            // Both differ by a factor at most.
            let scale = ml.sigma()[0] / whitening.sigma()[0];
            measured as f64 * ((2.0 * std::f64::consts::PI).ln() + 2.0 * scale.ln())
                + log_determinant
                + (sum_of_squares - priors) / (scale * scale)
        });
        // Without any error the likelihood has no bound.
        let deviance = deviance.filter(|deviance| deviance.is_finite());
        let sigma = widened.sigma();
        let quality = M::Output::from_fn(|j| Quality { sigma: sigma[j], ..quality[j] });
        Ok(Estimate {
            parameters: unknowns.place(0, coordinates).1,
            knowledge,
            declared: self.parameters,
            experiments: self
                .experiments
                .iter()
                .enumerate()
                .map(|(e, record)| {
                    let (initial_state, parameters) = unknowns.place(e, coordinates);
                    Share { name: unknowns.labels[e].clone(), samples: record.len(), parameters, initial_state }
                })
                .collect(),
            quality,
            unknowns: rows,
            covariance,
            noise_covariance: match &widened {
                Whitening::Full { covariance, .. } => Some(covariance.clone()),
                Whitening::Diagonal(_) => None,
            },
            directions,
            outcome,
            warnings,
            cost: linear.cost,
            measurements: measured,
            deviance,
            iterations,
            evaluations: evaluations + fresh,
            seconds: begin.elapsed().as_secs_f64(),
            method: self.method(name, sandwich, colored.map(|(_, lags)| lags)),
            integrator: self.integrator.clone(),
            predictor: self.predictor.clone(),
        })
    }

    fn method(&self, optimizer: String, sandwich: bool, colored: Option<usize>) -> Method {
        let noise = match self.noise {
            Noise::Given(_) => "given",
            Noise::PerOutput => "estimated per output",
            Noise::Covariance => "estimated as a full covariance",
        };
        let covariance = match (colored, sandwich, &self.prefilter) {
            (Some(lags), _, _) => format!("HAC (Newey-West over {lags} lag(s), prewhitened, for colored errors)"),
            (None, false, _) => "classical (white errors)".to_owned(),
            (None, true, None) => "sandwich (errors independent from sample to sample)".to_owned(),
            (None, true, Some(_)) => "sandwich (white errors before the pre-filter)".to_owned(),
        };
        Method {
            optimizer,
            integrator: self.integrator.describe(),
            predictor: self.predictor.describe(),
            loss: self.loss.as_ref().map_or("squared".to_owned(), |loss| loss.describe()),
            weighting: self.weighting.as_ref().map_or("none".to_owned(), |weighting| weighting.describe()),
            prefilter: self.prefilter.as_ref().map_or("none".to_owned(), |filter| filter.describe()),
            noise: noise.to_owned(),
            covariance,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// A direction of the scaled unknowns as relative changes by name.
    fn direction(
        &self,
        setting: &Setting<M, P>,
        direction: &[f64],
        norms: &[f64],
        values: &[f64],
        slopes: &[f64],
    ) -> Direction {
        let change = |i: usize| {
            let step = direction[i] / if norms[i] > 0.0 { norms[i] } else { 1.0 } * slopes[i];
            if values[i] == 0.0 { step } else { step / values[i].abs() }
        };
        let largest = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        let mut moves: Vec<(String, f64)> = (0..direction.len())
            .filter(|&i| direction[i].abs() > SHARE * largest)
            .map(|i| (setting.unknowns.row[i].name.clone(), change(i)))
            .collect();
        let unit = moves.iter().map(|(_, by)| *by).fold(0.0, |m: f64, by| if by.abs() > m.abs() { by } else { m });
        moves.iter_mut().for_each(|(_, by)| *by /= unit);
        Direction { moves }
    }

    #[expect(clippy::too_many_arguments, reason = "each is one thing that a warning may be about")]
    fn warnings(
        &self,
        rows: &[Unknown],
        directions: &[Direction],
        measured: u64,
        step_error: f64,
        setting: &Setting<M, P>,
        whitening: &Whitening,
        coordinates: &[f64],
    ) -> Vec<Warning> {
        let care = |text: String| Warning { severity: Severity::UsableWithCare, text };
        let mut warnings = vec![];
        let degrees = measured.saturating_sub(rows.len() as u64);
        if degrees == 0 {
            let text = format!(
                "{measured} measurement(s) for {} unknown(s) leave nothing to tell the accuracy by; fix some, or record more",
                rows.len()
            );
            warnings.push(Warning { severity: Severity::NotUsable, text });
        } else if rows.iter().all(|row| row.knowledge == Knowledge::Unidentified) {
            let text = "the data determine none of the unknowns".to_owned();
            warnings.push(Warning { severity: Severity::NotUsable, text });
        }
        for record in self.experiments.iter().filter(|_| M::KIND != Kind::Static) {
            let gaps = record.gaps();
            if let Some(first) = gaps.first() {
                warnings.push(care(format!(
                    "time jumps in experiment `{}` ({} gap(s), the first: {first}): the input is taken as held meanwhile, which is \
                     seldom what happened; fit the pieces between (Experiment::without_gaps)",
                    record.name(),
                    gaps.len()
                )));
            }
        }
        for row in rows {
            if let Knowledge::Held { bound } = row.knowledge {
                let text = format!("`{}` is held at its bound {bound} {}: the data want it beyond", row.name, row.unit);
                warnings.push(care(text));
            }
        }
        warnings.extend(
            directions.iter().map(|d| care(format!("{d}; fix one, add a prior, or excite the system differently"))),
        );
        // The bound first, which costs little; the shift itself only where the bound is not enough.
        if step_error > STEP_SHIFT
            && let Some(refined) = self.integrator.refined()
            && let Some((name, shift, part)) = self.shift(setting, whitening, coordinates, rows, &refined)
            && shift > STEP_SHIFT
        {
            warnings.push(care(format!(
                "the step is too coarse: with {} `{name}` would move by {:.1e} of itself ({shift:.1} standard errors); use a \
                 finer step",
                refined.describe(),
                part
            )));
        }
        warnings
    }

    /// By how many standard errors, and by which part of itself, a parameter would move at most with a refined integrator.
    fn shift(
        &self,
        setting: &Setting<M, P>,
        whitening: &Whitening,
        coordinates: &[f64],
        rows: &[Unknown],
        refined: &I,
    ) -> Option<(String, f64, f64)> {
        let objective = Objective { integrator: refined, ..self.objective(setting, whitening.clone()) };
        let linear = objective.evaluate(coordinates).ok()?;
        let held: Vec<bool> = rows.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
        let step = linear.step(&vec![0.0; rows.len()], &held)?;
        let shift = |i: usize| {
            let change = (step[i] * rows[i].transform.slope(rows[i].value)).abs();
            let error = rows[i].knowledge.standard_error().filter(|error| *error > 0.0)?;
            Some((rows[i].name.clone(), change / error, change / rows[i].value.abs()))
        };
        (0..rows.len()).filter_map(shift).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// One pass without slopes: how well the outputs are reproduced, how many measurements count, and a bound on how far (in
    /// standard errors) a finer step could move the unknowns.
    ///
    /// The bound is the norm of the change of all standardized predictions. It is taken on every eighth window, simulated
    /// once more with a finer step from the state at its begin, and extrapolated.
    fn reproduce(&self, objective: &Objective<'_, M, I, P>, coordinates: &[f64]) -> Result<Reproduced, Error> {
        const EVERY: usize = 8;
        let outputs = M::Output::LEN;
        let sigma = objective.whitening.sigma();
        let refined = self.integrator.refined();
        let mut sums = vec![Sums::default(); outputs];
        let (mut measured, mut log_determinant, mut bound) = (0u64, 0.0, 0.0);
        let mut here = Vec::with_capacity(outputs);
        let mut autocorrelations = vec![Autocorrelation::new(COLOR_LAGS); outputs];
        for (e, record) in self.experiments.iter().enumerate() {
            let (x, p) = objective.unknowns.place(e, coordinates);
            let trajectory = |integrator| {
                let (walk, prepared) = (Walk::new(self.model, integrator, record), &objective.prepared[e]);
                Trajectory::<M, I, P, 0, PORTABLE>::new(walk, &self.predictor, prepared, x, p, &[])
            };
            let (mut coarse, mut fine) = (trajectory(&self.integrator), refined.as_ref().map(trajectory));
            let (mut window, mut finer) = (Window::new(0, outputs), Window::new(0, outputs));
            let (mut change, mut seen) = (0.0, 0usize);
            autocorrelations.iter_mut().for_each(Autocorrelation::restart);
            for number in 0.. {
                let fine = fine.as_mut().filter(|_| number % EVERY == 0);
                let refilled = fine.is_some_and(|fine| {
                    fine.restart_at(&coarse);
                    matches!(fine.fill(&mut finer), Ok(true))
                });
                match coarse.fill(&mut window) {
                    Ok(true) => {}
                    Ok(false) => break,
                    Err(sample) => return Err(Error::Simulation(objective.locate(e, coordinates, sample))),
                }
                for k in 0..window.samples {
                    let y = M::Output::into_array(record.outputs()[window.begin + k]);
                    let counts = self.weighting.is_none() || objective.sample_weight(e, window.begin + k) > 0.0;
                    here.clear();
                    here.extend((0..outputs).filter(|j| window.measured[j * WINDOW + k]));
                    log_determinant += objective.whitening.log_determinant(&here);
                    for &j in &here {
                        sums[j].add(y.as_ref()[j], window.errors()[j * WINDOW + k]);
                        measured += u64::from(counts);
                    }
                }
                for (j, autocorrelation) in autocorrelations.iter_mut().enumerate() {
                    let rows = j * WINDOW..j * WINDOW + window.samples;
                    let here = window.measured[rows.clone()].iter().filter(|here| **here).count();
                    autocorrelation.add(&window.errors()[rows], here as u64);
                }
                if refilled {
                    let errors = window.errors().iter().zip(finer.errors()).enumerate();
                    change += errors.map(|(row, (a, b))| ((a - b) / sigma[row / WINDOW]).powi(2)).sum::<f64>();
                    seen += window.samples;
                }
            }
            bound += if seen > 0 { change * record.len() as f64 / seen as f64 } else { 0.0 };
        }
        let (quality, color) = (sums.iter().map(Sums::quality).collect(), Color::of::<M>(&autocorrelations));
        Ok(Reproduced { quality, measured, log_determinant, step_error: bound.sqrt(), color })
    }
}

/// See [`Fit::reproduce`].
struct Reproduced {
    quality: Vec<Quality>,
    measured: u64,
    /// Logarithm of the determinant of the covariance of all measurements.
    log_determinant: f64,
    step_error: f64,
    color: Option<Color>,
}

/// Errors that are not white.
struct Color {
    output: &'static str,
    /// Probability that white errors look like this.
    p_value: f64,
    /// Correlation of an error with the one before.
    first: f64,
}

impl Color {
    /// The output whose errors are least white, if the test of Ljung and Box refuses any.
    fn of<M: Model>(autocorrelations: &[Autocorrelation]) -> Option<Self> {
        let tested = autocorrelations.iter().enumerate().map(|(j, autocorrelation)| {
            let coefficients = autocorrelation.coefficients();
            let (_, p_value) = ljung_box(&coefficients, autocorrelation.count());
            let first = coefficients.first().copied().unwrap_or(0.0);
            Color { output: M::Output::NAMES[j], p_value: p_value * autocorrelations.len() as f64, first }
        });
        let strongest = |a: &Color, b: &Color| a.p_value.total_cmp(&b.p_value).then(b.first.total_cmp(&a.first));
        tested.min_by(strongest).filter(|color| color.p_value < COLOR_LEVEL)
    }

    /// What it means; `allowed` holds the lags that the covariance allows for, and by which factor that widens intervals.
    fn warning(&self, allowed: Option<(usize, f64)>) -> Warning {
        let Color { output, p_value, first } = self;
        let mut text = format!(
            "the errors of `{output}` are not white (Ljung-Box p = {:.1e}, correlation with the error before {first:.3}): the \
             model misses a part, or the noise is colored",
            p_value.min(1.0)
        );
        let Some((lags, widest)) = allowed else {
            text += "; the intervals take them as white and are too narrow if the order of the samples matters";
            return Warning { severity: Severity::UsableWithCare, text };
        };
        text += &format!(
            "; the intervals allow for it (HAC over {lags} lag(s), prewhitened), up to {widest:.2} times those for white errors"
        );
        let severity = if widest > COLOR_MATTERS { Severity::UsableWithCare } else { Severity::Usable };
        Warning { severity, text }
    }
}

impl<M: Model, I: Integrator<M>, P: Predictor<M>> Objective<'_, M, I, P> {
    /// What the model says of one record.
    pub(crate) fn prediction(&self, e: usize, coordinates: &[f64]) -> Result<Prediction<M>, Error> {
        let record = &self.experiments[e];
        let (initial_state, p) = self.unknowns.place(e, coordinates);
        let walk = self.step(e);
        let (mut x, mut memory) = (initial_state, I::Memory::default());
        let mut sums = vec![Sums::default(); M::Output::LEN];
        let mut outputs = Vec::with_capacity(record.len());
        let mut residuals = Vec::with_capacity(record.len());
        for k in 0..record.len() {
            let failed = || Error::Simulation(self.locate(e, coordinates, k));
            let state = self.predictor.state(&walk, &self.prepared[e], k, x, &p, &mut memory).map_err(|_| failed())?;
            let Some(state) = state else {
                outputs.push(M::Output::splat(f64::NAN));
                residuals.push(M::Output::splat(f64::NAN));
                continue;
            };
            if P::CARRIES {
                x = state;
            }
            let y = self.model.output(record.time(k), &state, &record.inputs()[k], &p);
            let (predicted, found) = (M::Output::into_array(y), M::Output::into_array(record.outputs()[k]));
            if predicted.as_ref().iter().any(|y| !y.is_finite()) {
                return Err(failed());
            }
            for (j, sums) in sums.iter_mut().enumerate() {
                if !found.as_ref()[j].is_nan() {
                    sums.add(found.as_ref()[j], found.as_ref()[j] - predicted.as_ref()[j]);
                }
            }
            outputs.push(y);
            residuals.push(M::Output::from_fn(|j| found.as_ref()[j] - predicted.as_ref()[j]));
        }
        let quality: Vec<Quality> = sums.iter().map(Sums::quality).collect();
        Ok(Prediction {
            t: (0..record.len()).map(|k| record.time(k)).collect(),
            outputs,
            residuals,
            initial_state,
            quality: M::Output::from_fn(|j| quality[j]),
        })
    }
}

/// Directions in the space of the scaled unknowns along which nothing is known.
fn unseen_directions(linear: &Linearization, free: &[bool], norms: &[f64]) -> Vec<Vec<f64>> {
    let n = free.len();
    let unit = |i: usize| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let mut unseen: Vec<Vec<f64>> = (0..n).filter(|&i| free[i] && norms[i] == 0.0).map(unit).collect();
    let seen: Vec<bool> = (0..n).map(|i| free[i] && norms[i] > 0.0).collect();
    let mut look = |information: &Information, unknowns: &[usize]| {
        let kept: Vec<usize> = (0..unknowns.len()).filter(|&c| seen[unknowns[c]]).collect();
        let scales: Vec<f64> = kept.iter().map(|&c| 1.0 / norms[unknowns[c]]).collect();
        if let Ok(spectrum) = information.select(&kept).decomposition(&scales) {
            for null in spectrum.null_directions(RANK) {
                let mut direction = vec![0.0; n];
                kept.iter().zip(null).for_each(|(&c, d)| direction[unknowns[c]] = *d);
                unseen.push(direction);
            }
        }
    };
    match linear.blocks() {
        // One block holds everything.
        [block] => {
            let columns: Vec<usize> = linear.columns().flat_map(|(_, columns)| columns).collect();
            look(block, &columns);
        }
        blocks => {
            for (block, columns) in blocks.iter().zip(linear.columns().map(|(_, columns)| columns)) {
                let own = columns.len() - linear.shared();
                look(&block.select(&(0..own).collect::<Vec<_>>()), &columns[..own]);
            }
            look(&linear.shared_information(), &(0..linear.shared()).collect::<Vec<_>>());
        }
    }
    unseen
}

/// Running sums of an output and its error.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: u64,
    first: f64,
    sum: f64,
    squares: f64,
    errors: f64,
}

impl Sums {
    fn add(&mut self, y: f64, error: f64) {
        if self.count == 0 {
            self.first = y;
        }
        // From the first value, so that a large mean costs no digits.
        let y = y - self.first;
        self.count += 1;
        self.sum += y;
        self.squares += y * y;
        self.errors += error * error;
    }

    fn quality(&self) -> Quality {
        let n = self.count as f64;
        let spread = self.squares - self.sum * self.sum / n;
        let fit_percent = (spread > 0.0).then(|| 100.0 * (1.0 - (self.errors / spread).sqrt()));
        Quality {
            samples: self.count,
            rmse: if self.count > 0 { (self.errors / n).sqrt() } else { 0.0 },
            fit_percent,
            sigma: 0.0,
        }
    }
}
