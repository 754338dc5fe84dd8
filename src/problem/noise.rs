//! Noise levels from the prediction errors.

use super::{Accumulate, At, Memory, Noise, Objective, Whitening, gather_together, linearize_together};
use crate::information::SquareMatrix;
use crate::loss::{Huber, Loss};
use crate::optimize::Infeasible;
use crate::sweep::Window;
use crate::wide::{Terms, Wide, sums};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Noise below this fraction of the output's magnitude is round-off of the simulation.
const ROUNDING: f64 = 1e-15;
/// The smallest noise that errors can be divided by.
const SMALLEST: f64 = 1e-280;
/// Most steps for the noise of robust losses, and the relative change at which they end.
const ROBUST_STEPS: usize = 50;
const ROBUST_TOLERANCE: f64 = 1e-9;
/// Mean errors below this fraction of the output's magnitude are round-off, which accumulates along a record.
pub(crate) const REPRODUCED: f64 = 1e-12;

/// `E[psi^2]` of Huber's loss under the standard normal.
fn clipped_variance(&Huber(c): &Huber) -> f64 {
    let normal = Normal::standard();
    2.0 * (normal.cdf(c) - 0.5 - c * normal.pdf(c) + c * c * normal.sf(c))
}

/// The product of two errors.
#[derive(Clone, Copy)]
struct Product;

impl Terms<2, 1> for Product {
    #[inline(always)]
    fn of<W: Wide>(self, [a, b]: [W; 2]) -> [W; 1] {
        [a.mul(b)]
    }
}

/// Sums of the products of two outputs' errors, and how many there were: lower triangles.
struct Moments<'m> {
    objective: &'m Objective<'m>,
    experiment: usize,
    /// Noise levels in whose units errors are clipped, for robust estimates.
    clip: Option<&'m [f64]>,
    sums: SquareMatrix,
    pairs: SquareMatrix,
    /// The errors of a window, output by output.
    errors: Vec<f64>,
}

impl<'m> Moments<'m> {
    fn new(objective: &'m Objective<'m>, experiment: usize, clip: Option<&'m [f64]>) -> Self {
        let empty = SquareMatrix::zeros(objective.outputs());
        Moments { objective, experiment, clip, sums: empty.clone(), pairs: empty, errors: vec![] }
    }
}

impl Accumulate for Moments<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, samples) = (window.outputs(), window.samples[lane]);
        let huber = Huber::default();
        self.errors.clear();
        for j in 0..outputs {
            let clipped = |error: f64| self.clip.map_or(error, |sigma| huber.psi(error / sigma[j]) * sigma[j]);
            // In the unit of the output, also where they were divided by predicted deviations.
            let unit = |k: usize| if window.has_variances() { window.variance_root(k, j, lane) } else { 1.0 };
            self.errors.extend(window.errors(j, lane).enumerate().map(|(k, error)| clipped(error * unit(k))));
        }
        let of = |j: usize| &self.errors[j * samples..][..samples];
        let weighted = self.objective.is_weighted();
        let counts = |k: usize| !weighted || self.objective.weight(self.experiment, window.begin[lane] + k) > 0.0;
        for (i, j) in (0..outputs).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            if window.whole && !weighted {
                self.sums[(i, j)] += sums([of(i), of(j)], Product)[0];
                self.pairs[(i, j)] += samples as f64;
                continue;
            }
            let both = |k: usize| window.is_measured(k, i, lane) && window.is_measured(k, j, lane) && counts(k);
            for k in (0..samples).filter(|&k| both(k)) {
                self.sums[(i, j)] += of(i)[k] * of(j)[k];
                self.pairs[(i, j)] += 1.0;
            }
        }
    }

    fn append(&mut self, later: Self) {
        let n = self.sums.size();
        let added = |a: &SquareMatrix, b: &SquareMatrix| SquareMatrix::from_fn(n, |i, j| a[(i, j)] + b[(i, j)]);
        self.sums = added(&self.sums, &later.sums);
        self.pairs = added(&self.pairs, &later.pairs);
    }
}

/// An objective, a point, and the noise levels in whose units its errors are clipped.
type Asked<'o> = (At<'o>, Option<&'o [f64]>);

/// Second moments of the (filtered) errors in the units of the outputs.
fn moments(((objective, coordinates), clip): Asked<'_>) -> Result<SquareMatrix, Infeasible> {
    let plain = objective.in_units();
    covariance(&plain.gather(coordinates, false, |experiment| Moments::new(&plain, experiment, clip))?)
}

/// The root of the mean square error of each output at a point, in its unit.
pub(crate) fn errors(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Vec<f64>, Infeasible> {
    Ok(moments(((objective, coordinates), None))?.diagonal().iter().map(|variance| variance.sqrt()).collect())
}

/// The moments of several objectives of one record each. One that fails in lanes is asked alone.
fn moments_together(asked: &[Asked<'_>]) -> Vec<Result<SquareMatrix, Infeasible>> {
    let plain: Vec<Objective<'_>> = asked.iter().map(|((objective, _), _)| objective.in_units()).collect();
    let points: Vec<At<'_>> = plain.iter().zip(asked).map(|(plain, ((_, x), _))| (plain, *x)).collect();
    let all = gather_together(&points, |i| Moments::new(&plain[i], 0, asked[i].1));
    let found = |(found, asked): (Option<Moments<'_>>, &Asked<'_>)| match found {
        Some(found) => covariance(&[found]),
        None => moments(*asked),
    };
    all.into_iter().zip(asked).map(found).collect()
}

fn covariance(all: &[Moments<'_>]) -> Result<SquareMatrix, Infeasible> {
    let outputs = all.first().map_or(0, |one| one.sums.size());
    let sum = |part: &dyn Fn(&Moments<'_>) -> f64| all.iter().map(part).sum::<f64>();
    let covariance = SquareMatrix::from_fn(outputs, |i, j| {
        let at = (i.max(j), i.min(j));
        sum(&|moments| moments.sums[at]) / sum(&|moments| moments.pairs[at]).max(1.0)
    });
    if let Some(variance) = covariance.diagonal().iter().find(|variance| !variance.is_finite()) {
        return Err(Infeasible::Failed(format!("the variance of an output's errors is {variance}")));
    }
    Ok(covariance)
}

/// Whether the noise is a mere factor of the cost: one output, squared loss, no prior.
pub(crate) fn only_scales(objective: &Objective<'_>) -> bool {
    let settings = &objective.problem.settings;
    let priors = objective.problem.unknowns.row.iter().any(|unknown| unknown.parameter.prior.is_some());
    let estimated = matches!(settings.noise, Noise::PerOutput | Noise::Covariance);
    estimated && objective.outputs() == 1 && settings.loss.is_none() && !priors
}

/// Whether the noise is estimated between rounds of the search.
pub(crate) fn is_estimated(objective: &Objective<'_>) -> bool {
    let estimated =
        matches!(objective.problem.settings.noise, Noise::PerOutput | Noise::Covariance | Noise::SomeGiven(_));
    estimated && !only_scales(objective)
}

/// The noise as given, or estimated from the errors at a point, and the memory of the evaluation there.
pub(crate) fn first_whitening(
    objective: &Objective<'_>,
    coordinates: &[f64],
) -> Result<(Whitening, Memory), Infeasible> {
    if let Some(given) = given(objective) {
        return Ok((given, objective.memory.clone()));
    }
    let scaled = in_sizes(objective);
    // The search begins with an evaluation there, from which the errors follow; if it fails, the pass below returns the error.
    if scaled.keeps_outputs() {
        let _ = scaled.evaluate(coordinates);
    }
    Ok((estimate(&scaled, coordinates)?, scaled.memory))
}

/// [`first_whitening`] of several objectives of one record each.
pub(crate) fn first_together(points: &[At<'_>]) -> Vec<Result<(Whitening, Memory), Infeasible>> {
    let scaled: Vec<Objective<'_>> = points.iter().map(|(objective, _)| in_sizes(objective)).collect();
    let all = scaled.iter().zip(points);
    let asked: Vec<At<'_>> =
        all.filter(|(_, (objective, _))| given(objective).is_none()).map(|(scaled, (_, x))| (scaled, *x)).collect();
    let keeping: Vec<At<'_>> = asked.iter().copied().filter(|(objective, _)| objective.keeps_outputs()).collect();
    linearize_together(&keeping);
    let mut estimated = estimate_together(&asked).into_iter();
    let first = |(scaled, (objective, x)): (&Objective<'_>, &At<'_>)| {
        let whitening = match given(objective) {
            Some(given) => given,
            None => estimated.next().unwrap_or_else(|| estimate(scaled, x))?,
        };
        Ok((whitening, scaled.memory.clone()))
    };
    scaled.iter().zip(points).map(first).collect()
}

/// A copy, with its own memory, whose errors are divided by the root mean square of their output's measurements: outputs in any units then
/// weigh alike.
fn in_sizes<'p>(objective: &Objective<'p>) -> Objective<'p> {
    let samples = objective.problem.samples().max(1) as f64;
    let size = |squares: &f64| {
        let size = (squares / samples).sqrt();
        if size > SMALLEST && size.is_finite() { size } else { 1.0 }
    };
    objective.with(Whitening::Diagonal(objective.squares.iter().map(size).collect()))
}

/// The noise that the first round of a search has without an estimate.
fn given(objective: &Objective<'_>) -> Option<Whitening> {
    match &objective.problem.settings.noise {
        Noise::Given(sigma) => Some(Whitening::Diagonal(sigma.clone())),
        _ => (!is_estimated(objective)).then(|| objective.whitening.clone()),
    }
}

/// The noise estimated from the errors at a point: by their variance, or with a robust loss by Huber's proposal 2
/// (Huber, *Robust Statistics*, 1981, section 6.4).
pub(crate) fn estimate(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Whitening, Infeasible> {
    if let Some(known) = known_at(objective, coordinates) {
        return Ok(known);
    }
    let first = moments(((objective, coordinates), None))?;
    let mut level = Level::new(objective, first);
    while let Some(sigma) = level.clip() {
        let found = moments(((objective, coordinates), Some(&sigma)))?;
        level.tell(found);
    }
    Ok(level.whitening(objective))
}

/// The noise at a point at which the triangles of each output are known.
fn known_at(objective: &Objective<'_>, coordinates: &[f64]) -> Option<Whitening> {
    let variances = objective.memory.by_output_at(coordinates)?.variances();
    let moments = SquareMatrix::from_fn(variances.len(), |i, j| if i == j { variances[i] } else { 0.0 });
    Some(Level::new(objective, moments).whitening(objective))
}

/// The noise estimated at a point of each of several objectives of one record each, in parallel lanes.
pub(crate) fn estimate_together(points: &[At<'_>]) -> Vec<Result<Whitening, Infeasible>> {
    let mut known: Vec<Option<Whitening>> = points.iter().map(|(objective, x)| known_at(objective, x)).collect();
    let unknown = points.iter().zip(&known).filter(|(_, known)| known.is_none());
    let mut measured = measured_together(&unknown.map(|(point, _)| *point).collect::<Vec<_>>()).into_iter();
    let found = |(known, (objective, x)): (&mut Option<Whitening>, &At<'_>)| match known.take() {
        Some(known) => Ok(known),
        None => measured.next().unwrap_or_else(|| estimate(objective, x)),
    };
    known.iter_mut().zip(points).map(found).collect()
}

/// The noise estimated in passes over the records.
fn measured_together(points: &[At<'_>]) -> Vec<Result<Whitening, Infeasible>> {
    let plain: Vec<Asked<'_>> = points.iter().map(|point| (*point, None)).collect();
    let first = moments_together(&plain).into_iter().zip(points);
    let mut levels: Vec<Result<Level, Infeasible>> =
        first.map(|(found, (objective, _))| Ok(Level::new(objective, found?))).collect();
    loop {
        let clips: Vec<(usize, Vec<f64>)> =
            levels.iter().enumerate().filter_map(|(i, level)| Some((i, level.as_ref().ok()?.clip()?))).collect();
        if clips.is_empty() {
            break;
        }
        let asked: Vec<Asked<'_>> = clips.iter().map(|(i, sigma)| (points[*i], Some(&sigma[..]))).collect();
        for (found, (i, _)) in moments_together(&asked).into_iter().zip(&clips) {
            match (found, &mut levels[*i]) {
                (Ok(found), Ok(level)) => level.tell(found),
                (Err(error), level) => *level = Err(error),
                _ => {}
            }
        }
    }
    levels.into_iter().zip(points).map(|(level, (objective, _))| Ok(level?.whitening(objective))).collect()
}

/// The iteration for the noise: steps with clipped errors for robust losses; no step for others, whose noise follows from the first moments.
struct Level {
    moments: SquareMatrix,
    /// The noise of outputs for which it was given, in their units.
    given: Vec<Option<f64>>,
    /// The smallest noise of each output that is not round-off, in its unit.
    floor: Vec<f64>,
    /// Mean square of clipped normal errors.
    kappa: f64,
    /// Steps that are left.
    left: usize,
}

impl Level {
    fn new(objective: &Objective<'_>, moments: SquareMatrix) -> Self {
        let size = |size: f64| if size > 0.0 { size } else { 1.0 };
        let floor = magnitudes(objective).into_iter().map(|magnitude| ROUNDING * size(magnitude)).collect();
        let left = if objective.is_robust() { ROBUST_STEPS } else { 0 };
        let given = (0..objective.outputs()).map(|j| objective.problem.settings.noise.given(j)).collect();
        Level { moments, given, floor, kappa: clipped_variance(&Huber::default()), left }
    }

    fn sigma(&self) -> Vec<f64> {
        let levels = self.moments.diagonal().into_iter().zip(&self.floor).zip(&self.given);
        levels.map(|((variance, floor), given)| given.unwrap_or_else(|| variance.sqrt().max(*floor))).collect()
    }

    /// The noise levels in whose units errors are to be clipped for the next step; `None` where there is none.
    fn clip(&self) -> Option<Vec<f64>> {
        (self.left > 0).then(|| self.sigma())
    }

    /// Passes on the moments of the clipped errors.
    fn tell(&mut self, clipped: SquareMatrix) {
        let before = self.sigma();
        self.moments = SquareMatrix::from_fn(clipped.size(), |i, j| clipped[(i, j)] / self.kappa);
        let change = |(a, b): (f64, f64)| (a / b).ln().abs();
        let settled = self.sigma().into_iter().zip(before).map(change).fold(0.0, f64::max) < ROBUST_TOLERANCE;
        self.left = if settled { 0 } else { self.left - 1 };
    }

    fn whitening(self, objective: &Objective<'_>) -> Whitening {
        let diagonal = Whitening::Diagonal(self.sigma());
        match objective.problem.settings.noise {
            Noise::Covariance => Whitening::full(self.moments).unwrap_or(diagonal),
            _ => diagonal,
        }
    }
}

/// Whether the model reproduces the data up to round-off, from which no search direction follows.
pub(crate) fn reproduces(objective: &Objective<'_>, coordinates: &[f64]) -> bool {
    let reproduced = |moments: SquareMatrix| {
        let mut variances = moments.diagonal().into_iter().zip(magnitudes(objective));
        variances.all(|(variance, size)| variance.sqrt() <= REPRODUCED * size)
    };
    moments(((objective, coordinates), None)).is_ok_and(reproduced)
}

/// Noise of the first output below which errors are round-off of the simulation, in its unit; zero where the measurements
/// are so small that dividing by it overflows.
pub(crate) fn rounding(objective: &Objective<'_>) -> f64 {
    let noise = ROUNDING * magnitudes(objective).first().copied().unwrap_or(0.0);
    if noise > SMALLEST { noise } else { 0.0 }
}

/// Largest measured magnitude of each output.
fn magnitudes(objective: &Objective<'_>) -> Vec<f64> {
    let largest = |values: &[f64]| {
        // Eight of them, so that no comparison waits for the one before.
        let mut largest = [0.0f64; 8];
        for eight in values.chunks(8) {
            largest.iter_mut().zip(eight).for_each(|(largest, y)| *largest = largest.max(y.abs()));
        }
        largest.into_iter().fold(0.0, f64::max)
    };
    let of = |j: usize| {
        let records = objective.problem.records.iter();
        records.map(|record| largest(&record.outputs()[j].values)).fold(0.0, f64::max)
    };
    (0..objective.outputs()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::GivenNoise;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Kind, Model, Scalar, Time, free};

    /// Errors are reproduced to a part of 1e-12 of the largest measurement of all records, and are rounding to 1e-15.
    #[test]
    fn rounding_is_that_of_the_largest_measurement() {
        let record = |outputs: [f64; 3]| {
            let outputs = outputs.map(|i| Current { i }).to_vec();
            let time = Time::Uniform { start: 0.0, step: 1.0 };
            Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 3], outputs).unwrap()
        };
        let of = |size: f64, offset: f64| {
            let records = [record([2.0, -8.0, 2.0].map(|y| size * (y + offset))), record([size * (2.0 + offset); 3])];
            let problem = Fit::new(&Line, &records).parameters(Gain { a: free(1.0) }).problem().unwrap();
            let objective = problem.objective().unwrap();
            (rounding(&objective), reproduces(&objective, &[2.0 * size]))
        };
        assert_eq!([of(1.0, 0.0).0, of(4.0, 0.0).0, of(1e-270, 0.0).0], [8e-15, 3.2e-14, 0.0]);
        let level = |outputs: [f64; 3]| {
            let records = [record(outputs)];
            let problem = Fit::new(&Line, &records).parameters(Gain { a: free(1.0) }).problem().unwrap();
            reproduces(&problem.objective().unwrap(), &[2.0])
        };
        // Errors of about 1e-13 and 1e-11 of the largest.
        assert!(level([2.0; 3]) && level([2.0 + 2e-13; 3]) && !level([2.0 + 2e-11; 3]) && !of(1.0, 0.0).1);
    }

    /// `i[k+1] = a i[k] + u[k]`.
    #[derive(Clone)]
    struct Sum;

    impl Model for Sum {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;
        const KIND: Kind = Kind::Discrete;

        fn next<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: p.a * x.i + u.u }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    /// Also where the search divides errors by predicted deviations. The gain of a filter depends on the ratio of its two levels of noise only: the
    /// errors of a filter by hand, whatever the levels are.
    #[test]
    fn errors_are_in_the_unit_of_the_output() {
        let (inputs, outputs) = ([1.0, -2.0, 3.0, 0.5, 1.0, -1.0], [0.0, 1.5, -1.0, 2.0, 3.0, 2.0]);
        let record = Experiment::new(
            &Sum,
            Time::Uniform { start: 0.0, step: 1.0 },
            inputs.map(|u| Voltage { u }).to_vec(),
            outputs.map(|i| Current { i }).to_vec(),
        );
        let records = [record.unwrap()];
        let (mut x, mut variance, mut sum) = (0.0, 0.0, 0.0);
        for (u, y) in inputs.into_iter().zip(outputs) {
            let (error, gain) = (y - x, variance / (variance + 1.0));
            sum += error * error;
            x = 0.8 * (x + gain * error) + u;
            variance = 0.64 * (1.0 - gain) * variance + 4.0;
        }
        for level in [1e-3, 1.0, 1e3] {
            let noise = GivenNoise { states: vec![2.0 * level], outputs: vec![level] };
            let problem =
                Fit::new(&Sum, &records).parameters(Gain { a: free(0.8) }).predictor(noise).problem().unwrap();
            let found = errors(&problem.objective().unwrap(), &problem.unknowns.start()).unwrap();
            // Six samples of a few operations each.
            assert!((found[0] / (sum / 6.0_f64).sqrt() - 1.0).abs() < 1e-13, "{found:?} {sum}");
        }
    }

    /// The mean of `min(|z|, c)^2` over the standard normal density, by the trapezoidal rule: its error is that of the kinks at
    /// `c`, `c h^2 pdf(c) / 3` at most, and the tails beyond 10 hold less than 1e-20.
    #[test]
    fn variance_of_clipped_normal_errors() {
        let step = 1e-3;
        for c in [0.5, 1.345, 3.0] {
            let at = |k: i32| {
                let z = step * f64::from(k);
                z.abs().min(c).powi(2) * (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt()
            };
            let mean = step * (-10_000..=10_000).map(at).sum::<f64>();
            assert!((clipped_variance(&Huber(c)) - mean).abs() < 1e-6, "{c}: {mean}");
        }
    }

    /// Errors about a gain of two, every seventh an outlier: Huber's scale `s` solves `mean of min(|e / s|, c)^2 = kappa`.
    #[test]
    fn a_robust_scale_solves_its_equation() {
        let error = |k: usize| ((k * 37 % 21) as f64 - 10.0) * if k.is_multiple_of(7) { 30.0 } else { 0.1 };
        let inputs: Vec<Voltage> = (0..42).map(|k| Voltage { u: k as f64 }).collect();
        let outputs = (0..42).map(|k| Current { i: 2.0 * k as f64 + error(k) }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).loss(Huber::default());
        let problem = fit.problem().unwrap();
        let found = estimate(&problem.objective().unwrap(), &[2.0]).unwrap().sigma()[0];
        let Huber(c) = Huber::default();
        let mean = (0..42).map(|k| (error(k).abs() / found).min(c).powi(2)).sum::<f64>() / 42.0;
        // The scale is found to 1e-9 from step to step, which shrink by a half or more.
        assert!((mean / clipped_variance(&Huber(c)) - 1.0).abs() < 1e-7, "{mean} {found}");
    }

    /// Records of other lengths, scales and missing measurements have the noise that each has by itself, by variance and robustly.
    #[test]
    fn noise_of_several_records_is_that_of_each() {
        let record = |r: usize| {
            let error = |k: usize| ((k * 37 % 21) as f64 - 10.0) * if k.is_multiple_of(7) { 30.0 } else { r as f64 };
            let value = |k: usize| if k % 5 == r { f64::NAN } else { 2.0 * k as f64 + error(k) };
            let inputs: Vec<Voltage> = (0..90 + r).map(|k| Voltage { u: k as f64 }).collect();
            let outputs = (0..90 + r).map(|k| Current { i: value(k) }).collect();
            Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
        };
        let records: Vec<_> = (1..4).map(record).collect();
        for robust in [false, true] {
            let fit = |record| Fit::new(&Line, record).parameters(Gain { a: free(1.0) });
            let fit = |record| if robust { fit(record).loss(Huber::default()) } else { fit(record) };
            let problems: Vec<_> = records.iter().map(|record| fit(record).problem().unwrap()).collect();
            let objectives: Vec<_> = problems.iter().map(|problem| problem.objective().unwrap()).collect();
            let points: Vec<At<'_>> = objectives.iter().map(|objective| (objective, &[2.0][..])).collect();
            let together = estimate_together(&points).into_iter().map(|found| found.unwrap().sigma()[0]);
            for (one, (objective, x)) in together.zip(&points) {
                let alone = estimate(objective, x).unwrap().sigma()[0];
                // Lanes add in another order.
                assert!((one / alone - 1.0).abs() < 1e-14, "{one} {alone}");
            }
        }
    }
}
