//! What a fit can be asked for.

use super::conclude::Conclusion;
use super::noise::{Noise, Whitening};
use super::objective::{Control, Objective};
use super::reproduce::Sums;
use super::search::Found;
use super::unknowns::Unknowns;
use super::{Fit, Search, Setting};
use crate::error::Error;
use crate::estimate::{Estimate, Knowledge, Method, Prediction, Quality, Share};
use crate::experiment::ExperimentOf;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::optimize::{LeastSquares, LevenbergMarquardt};
use crate::predict::{Predictor, Target, Walk};
use crate::signals::{Of, Signals};
use std::time::Instant;

impl<M: Model, I: Integrator, P: Predictor<M>, O: Search> Fit<'_, M, I, P, O> {
    /// Searches for the parameters, and says how well they are known.
    ///
    /// A search that does not converge is an outcome of the estimate, not an error.
    ///
    /// # Errors
    /// What makes no sense ([`Error`] names it), a start that cannot be simulated, a checkpoint that cannot be read.
    pub fn run(mut self) -> Result<Estimate<M, I, P>, Error> {
        let begin = Instant::now();
        self.terms.control.deadline = self.terms.time_limit.map(|limit| begin + limit);
        self.optimizer.check()?;
        let setting = self.prepare()?;
        let found = self.search(&setting)?;
        // What was found is concluded even if the time is over.
        self.terms.control = Control::default();
        self.conclude(&setting, found, begin)
    }

    fn search(&self, setting: &Setting<P::Prepared>) -> Result<Found, Error> {
        self.objective(setting).search(&self.terms, &self.optimizer)
    }
}

impl<'a, M: Model, I: Integrator, P: Predictor<M>, O> Fit<'a, M, I, P, O> {
    /// Simulates (or predicts) the first record with the parameters at their start; only what is free of its initial
    /// state is estimated from it.
    ///
    /// # Errors
    /// As [`run`](Fit::run), and a simulation that fails.
    pub fn simulate(self) -> Result<Prediction<M>, Error> {
        let parameters = M::Parameters::map(self.parameters, |p| crate::parameter::fixed(p.start));
        let fit = Fit { parameters, ..self.optimizer(LevenbergMarquardt::default()) };
        fit.check()?;
        let unknowns = Unknowns::new(fit.model, fit.experiments, fit.parameters)?;
        if !unknowns.row.is_empty() {
            fit.check_measured()?;
        }
        let setting = fit.prepared(unknowns)?;
        let coordinates = match setting.unknowns.row.is_empty() {
            true => vec![],
            false => fit.search(&setting)?.coordinates,
        };
        fit.prediction(&fit.objective(&setting), &setting, 0, &coordinates)
    }

    /// The fit as a problem for argmin's own solvers.
    ///
    /// # Errors
    /// As [`run`](Fit::run).
    pub fn problem(self) -> Result<FitProblem<'a, M, I, P, O>, Error> {
        let setting = self.prepare()?;
        let whitening = self.objective(&setting).first_whitening(&self.terms, &setting.unknowns.start())?;
        Ok(FitProblem { fit: self, setting, whitening })
    }

    /// What the model says of one record.
    fn prediction(
        &self,
        objective: &Objective<'_>,
        setting: &Setting<P::Prepared>,
        e: usize,
        coordinates: &[f64],
    ) -> Result<Prediction<M>, Error> {
        let record = &self.experiments[e];
        let place = setting.unknowns.place(e, coordinates);
        let (initial_state, p) = (M::State::from_fn(|i| place.x[i]), M::Parameters::from_fn(|j| place.p[j]));
        let walk = Walk::new(self.model, &self.integrator, record);
        let (mut x, mut memory) = (initial_state, I::Memory::default());
        let mut sums = vec![Sums::default(); M::Output::LEN];
        let mut outputs = Vec::with_capacity(record.len());
        let mut residuals = Vec::with_capacity(record.len());
        for k in 0..record.len() {
            let failed = || Error::Simulation(objective.locate(e, coordinates, k));
            let state =
                self.predictor.state(&walk, &setting.prepared[e], k, x, &p, &mut memory).map_err(|_| failed())?;
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

    fn conclude(
        &self,
        setting: &Setting<P::Prepared>,
        found: Found,
        begin: Instant,
    ) -> Result<Estimate<M, I, P>, Error> {
        let objective = self.objective(setting).with(found.whitening.clone());
        let said = objective.conclude(&self.terms.noise, &found)?;
        let Conclusion { unknowns, covariance, noise_covariance, quality, directions, warnings, .. } = said;
        let share = |e: usize| {
            let place = setting.unknowns.place(e, &found.coordinates);
            Share {
                name: setting.unknowns.labels[e].clone(),
                samples: self.experiments[e].len(),
                parameters: M::Parameters::from_fn(|j| place.p[j]),
                initial_state: M::State::from_fn(|i| place.x[i]),
            }
        };
        let experiments: Vec<Share<M>> = (0..self.experiments.len()).map(share).collect();
        let knowledge = M::Parameters::from_fn(|j| {
            let mut rows = setting.unknowns.row.iter().zip(&unknowns);
            let mine = rows.find(|(row, _)| row.target == Target::Parameter(j));
            mine.map_or(Knowledge::Fixed, |(_, unknown)| unknown.knowledge)
        });
        let noise = match self.terms.noise {
            Noise::Given(_) => "given",
            Noise::PerOutput => "estimated per output",
            Noise::Covariance => "estimated as a full covariance",
        };
        let or = |said: Option<String>, other: &str| said.unwrap_or_else(|| other.to_owned());
        let method = Method {
            optimizer: found.name,
            integrator: self.integrator.describe(M::KIND),
            predictor: self.predictor.describe(),
            loss: or(self.terms.loss.as_ref().map(|loss| loss.describe()), "squared"),
            weighting: or(self.weighting.as_ref().map(|weighting| weighting.describe()), "none"),
            prefilter: or(self.terms.prefilter.as_ref().map(|filter| filter.describe()), "none"),
            noise: noise.to_owned(),
            covariance: said.method,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        Ok(Estimate {
            parameters: experiments[0].parameters,
            knowledge,
            declared: self.parameters,
            experiments,
            quality: M::Output::from_fn(|j| quality[j]),
            unknowns,
            covariance,
            noise_covariance,
            directions,
            outcome: found.outcome,
            warnings,
            cost: said.cost,
            measurements: said.measurements,
            deviance: said.deviance,
            iterations: found.iterations,
            evaluations: found.evaluations + u64::from(found.linear.is_none()),
            seconds: begin.elapsed().as_secs_f64(),
            method,
            integrator: self.integrator.clone(),
            predictor: self.predictor.clone(),
        })
    }
}

/// A fit prepared for argmin's own solvers.
pub struct FitProblem<'a, M: Model, I: Integrator, P: Predictor<M>, O> {
    fit: Fit<'a, M, I, P, O>,
    setting: Setting<P::Prepared>,
    whitening: Whitening,
}

impl<M: Model, I: Integrator, P: Predictor<M>, O: Search> FitProblem<'_, M, I, P, O> {
    /// As [`Fit::run`], keeping the problem for what is to be asked of the estimate ([`diagnose`](crate::diagnose)).
    ///
    /// # Errors
    /// As [`Fit::run`].
    pub fn run(&mut self) -> Result<Estimate<M, I, P>, Error> {
        let begin = Instant::now();
        self.fit.terms.control.deadline = self.fit.terms.time_limit.map(|limit| begin + limit);
        let found = self.fit.search(&self.setting);
        // What was found is concluded even if the time is over.
        self.fit.terms.control.deadline = None;
        self.fit.conclude(&self.setting, found?, begin)
    }
}

impl<M: Model, I: Integrator, P: Predictor<M>, O> FitProblem<'_, M, I, P, O> {
    /// The cost with the noise that an estimate of this problem has found, and the coordinates of that estimate.
    ///
    /// # Errors
    /// An estimate of another problem.
    pub(crate) fn at(&self, estimate: &Estimate<M, I, P>) -> Result<(Objective<'_>, Vec<f64>), Error> {
        let row = &self.setting.unknowns.row;
        let same = row.len() == estimate.unknowns.len()
            && row.iter().zip(&estimate.unknowns).all(|(mine, its)| mine.name == its.name);
        if !same {
            let names: Vec<&str> = estimate.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
            let mine: Vec<&str> = row.iter().map(|unknown| unknown.name.as_str()).collect();
            return Err(Error::Option(format!(
                "the estimate is of another problem: it has the unknowns {}, the problem has {}",
                names.join(", "),
                mine.join(", ")
            )));
        }
        let records = self.fit.experiments;
        let shares = &estimate.experiments;
        if records.len() != shares.len() || records.iter().zip(shares).any(|(r, share)| r.len() != share.samples) {
            let samples = |lengths: Vec<usize>| format!("{lengths:?} samples");
            return Err(Error::Option(format!(
                "the estimate is of other records: it has {}, the problem has {}",
                samples(shares.iter().map(|share| share.samples).collect()),
                samples(records.iter().map(|record| record.len()).collect())
            )));
        }
        let sigma = M::Output::map(estimate.quality, |quality| quality.sigma);
        let diagonal = Whitening::Diagonal(M::Output::into_array(sigma).as_ref().to_vec());
        let full = estimate.noise_covariance.clone().and_then(Whitening::full);
        // An output without any error tells no noise.
        let noisy = M::Output::into_array(sigma).as_ref().iter().all(|sigma| *sigma > 0.0);
        let whitening = if noisy { full.unwrap_or(diagonal) } else { self.whitening.clone() };
        // What stopped the search does not stop what is asked of its result.
        static NEVER: Control = Control { cancel: None, deadline: None };
        let objective = Objective { control: &NEVER, ..self.fit.objective(&self.setting).with(whitening) };
        let coordinates = estimate.unknowns.iter().map(|u| u.transform.to_coordinate(u.value)).collect();
        Ok((objective, coordinates))
    }

    /// The records of the fit.
    pub(crate) fn experiments(&self) -> &[ExperimentOf<M>] {
        self.fit.experiments
    }

    /// What the model says of one record at a point.
    pub(crate) fn prediction(
        &self,
        objective: &Objective<'_>,
        e: usize,
        coordinates: &[f64],
    ) -> Result<Prediction<M>, Error> {
        self.fit.prediction(objective, &self.setting, e, coordinates)
    }

    /// What a record that replaces one of the fit's is prepared to.
    ///
    /// # Errors
    /// A record that the predictor cannot serve.
    pub(crate) fn prepared(&self, record: &ExperimentOf<M>, p: &Of<M::Parameters, f64>) -> Result<P::Prepared, Error> {
        self.fit.predictor.prepare(self.fit.model, record, p)
    }

    /// The same cost of other records.
    pub(crate) fn of_records<'s>(
        &'s self,
        objective: &Objective<'s>,
        experiments: &'s [ExperimentOf<M>],
        prepared: &'s [P::Prepared],
    ) -> Objective<'s> {
        Objective { source: self.fit.source(experiments, prepared), ..objective.clone() }
    }

    /// The cost to minimize. Noise that was not given is what the errors at the start show.
    pub fn objective(&self) -> Objective<'_> {
        self.fit.objective(&self.setting).with(self.whitening.clone())
    }

    /// The estimate at a point that some search has found; it says for itself whether that is a minimum.
    ///
    /// # Errors
    /// A point of another length, or one that cannot be simulated.
    pub fn estimate(&self, coordinates: &[f64]) -> Result<Estimate<M, I, P>, Error> {
        let begin = Instant::now();
        let expected = self.setting.unknowns.row.len();
        if coordinates.len() != expected {
            let found = coordinates.len();
            return Err(Error::Option(format!(
                "the point has {found} coordinates, but the fit has {expected} unknowns"
            )));
        }
        let objective = self.objective();
        let linear =
            objective.evaluate(coordinates).map_err(|_| objective.start_failure(&self.fit.terms, coordinates))?;
        let outcome = LevenbergMarquardt::default().judge(coordinates, &linear, &objective.bounds());
        let whitening = match &self.fit.terms.noise {
            Noise::Given(_) => self.whitening.clone(),
            noise if objective.noise_is_no_matter(noise) => self.whitening.clone(),
            noise => objective.estimate_noise(coordinates, noise).unwrap_or_else(|_| self.whitening.clone()),
        };
        let name = "search by argmin".to_owned();
        let coordinates = coordinates.to_vec();
        let found =
            Found { coordinates, whitening, linear: None, outcome, iterations: 0, evaluations: 1, name, trouble: None };
        self.fit.conclude(&self.setting, found, begin)
    }
}
