//! The main loop of a fit, and what else it can be asked for.

use super::checkpoint::CheckpointFile;
use super::noise::{Noise, Whitening};
use super::objective::{Halt, Objective};
use super::unknowns::Unknowns;
use super::{Fit, Observer, Search, Setting};
use crate::error::Error;
use crate::estimate::{Estimate, Prediction};
use crate::experiment::Initial;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::optimize::{Infeasible, LeastSquares, LeastSquaresState, LevenbergMarquardt, Linearization, Outcome};
use crate::parameter::Parameter;
use crate::predict::Predictor;
use crate::signals::Signals;
use argmin::core::observers::Observe;
use argmin::core::{Executor, KV, Solver, State, TerminationReason, TerminationStatus};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::time::Instant;

/// Where a search ended.
pub(super) struct Found {
    pub coordinates: Vec<f64>,
    pub whitening: Whitening,
    /// The slopes there, if they are still those of this whitening.
    pub linear: Option<Linearization>,
    pub outcome: Outcome,
    pub iterations: u64,
    pub evaluations: u64,
    pub name: String,
    pub trouble: Option<String>,
}

/// The noise is known well enough when a round changes it by less than this part.
const NOISE_TOLERANCE: f64 = 1e-8;
const NOISE_ROUNDS: u32 = 100;

impl<M, I, P, O> Fit<'_, M, I, P, O>
where
    M: Model,
    I: Integrator<M>,
    P: Predictor<M>,
    O: Search + Clone + Serialize + DeserializeOwned,
    O: for<'p> Solver<&'p Objective<'p, M, I, P>, LeastSquaresState>,
{
    /// Searches for the parameters, and says how well they are known.
    ///
    /// A search that does not converge is an outcome of the estimate, not an error.
    ///
    /// # Errors
    /// What makes no sense ([`Error`] names it), a start that cannot be simulated, a checkpoint that cannot be read.
    pub fn run(mut self) -> Result<Estimate<M, I, P>, Error> {
        let begin = Instant::now();
        self.control.deadline = self.time_limit.map(|limit| begin + limit);
        self.optimizer.check()?;
        let setting = self.prepare()?;
        let found = self.search(&setting)?;
        // What was found is concluded even if the time is over.
        let control = std::mem::take(&mut self.control);
        let estimate = self.conclude(&setting, found, begin);
        self.control = control;
        estimate
    }

    fn search(&self, setting: &Setting<M, P>) -> Result<Found, Error> {
        let mut coordinates = setting.unknowns.start();
        let mut solver = self.optimizer.clone();
        let mut file = None;
        let mut before = 0;
        if let Some((path, every)) = &self.checkpoint {
            let (path, every, fingerprint) = (path.clone(), *every, self.fingerprint(&coordinates));
            let settings = serde_json::to_string(&solver).map_err(|error| Error::Optimizer(error.to_string()))?;
            let mut checkpoint = CheckpointFile { path, every, fingerprint, settings, before, trouble: Arc::default() };
            match checkpoint.load::<O>()? {
                Some((place, iterations, saved)) if place.len() == coordinates.len() => {
                    (coordinates, before) = (place, iterations);
                    // The settings are those of this run; only a search with the same that has not ended goes on as it was.
                    solver = saved.filter(|saved| saved.outcome().is_none()).unwrap_or(solver);
                }
                // Written at once: a place that cannot be written to is better known now.
                _ => checkpoint.write(&coordinates, 0, &solver)?,
            }
            checkpoint.before = before;
            file = Some(checkpoint);
        }
        let mut whitening = self.first_whitening(setting, &coordinates)?;
        let known = matches!(self.noise, Noise::Given(_)) || self.noise_is_no_matter();
        let (mut iterations, mut evaluations) = (before, 0);
        let mut name = String::new();
        for round in 1.. {
            let objective = self.objective(setting, whitening.clone());
            let result = self.round(&objective, coordinates, solver, &file)?;
            name.clone_from(&result.name);
            iterations += result.iterations;
            evaluations += result.evaluations;
            coordinates = result.coordinates;
            let (mut outcome, mut linear) = (result.outcome, result.linear);
            let lost = matches!(outcome, Outcome::Stalled { .. } | Outcome::LimitOfPrecision { .. });
            if lost && objective.reproduces(&coordinates) {
                outcome = Outcome::Exact;
            }
            let mut settled = known || !outcome.converged();
            if !settled {
                let next = objective.estimate_noise(&coordinates, self.noise).unwrap_or_else(|_| whitening.clone());
                let changes = next.sigma().into_iter().zip(whitening.sigma()).map(|(a, b)| (a / b).ln().abs());
                // Rounding is another at every point.
                settled = outcome == Outcome::Exact || changes.fold(0.0, f64::max) < NOISE_TOLERANCE;
                (whitening, linear) = (next, None);
                if !settled && round == NOISE_ROUNDS {
                    outcome = Outcome::IterationLimit { iterations };
                    settled = true;
                }
            }
            if settled {
                let trouble = file.and_then(|file| file.trouble.lock().ok().and_then(|trouble| trouble.clone()));
                return Ok(Found { coordinates, whitening, linear, outcome, iterations, evaluations, name, trouble });
            }
            solver = self.optimizer.clone();
        }
        Err(Error::Option("the noise cannot be estimated; give it with Fit::noise".to_owned()))
    }

    /// One search with the noise as it stands.
    fn round(
        &self,
        objective: &Objective<'_, M, I, P>,
        start: Vec<f64>,
        solver: O,
        file: &Option<CheckpointFile>,
    ) -> Result<Round, Error> {
        let counting = |state: LeastSquaresState| state.param(start.clone()).counting(true);
        let mut executor = Executor::new(objective, solver).configure(counting).ctrlc(false);
        for (observer, mode) in &self.observers {
            executor = executor.add_observer(Shared(observer.clone()), *mode);
        }
        if let Some(file) = file {
            executor = executor.checkpointing(file.clone());
        }
        let result = executor.run().map_err(|error| match error.downcast::<Infeasible>() {
            Ok(Infeasible::Failed(_)) => self.start_failure(objective, &start),
            Ok(Infeasible::Cancelled) => self.stopped(),
            Err(other) => Error::Optimizer(other.to_string()),
        })?;
        let state = result.state();
        let outcome = result.solver().outcome().unwrap_or(match state.get_termination_status() {
            TerminationStatus::Terminated(TerminationReason::MaxItersReached) => {
                Outcome::IterationLimit { iterations: state.get_iter() }
            }
            _ => Outcome::Cancelled,
        });
        let outcome = match outcome {
            Outcome::Cancelled if self.control.expired() => Outcome::TimeLimit,
            outcome => outcome,
        };
        let evaluations = state.get_func_counts().get("linearization_count").copied().unwrap_or(0);
        if let Some(file) = file
            && let Some(place) = state.get_param()
            && let Err(error) = file.write(place, state.get_iter(), result.solver())
            && let Ok(mut trouble) = file.trouble.lock()
        {
            *trouble = Some(error.to_string());
        }
        Ok(Round {
            coordinates: state.get_param().cloned().unwrap_or(start),
            linear: result.solver().linearization().cloned(),
            outcome,
            iterations: state.get_iter(),
            evaluations,
            name: Solver::<&Objective<'_, M, I, P>, LeastSquaresState>::name(result.solver()).to_owned(),
        })
    }
}

struct Round {
    coordinates: Vec<f64>,
    linear: Option<Linearization>,
    outcome: Outcome,
    iterations: u64,
    evaluations: u64,
    name: String,
}

impl<'a, M: Model, I: Integrator<M>, P: Predictor<M>, O> Fit<'a, M, I, P, O> {
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
        let objective = fit.objective(&setting, Whitening::Diagonal(vec![1.0; M::Output::LEN]));
        objective.prediction(0, &coordinates)
    }

    /// The fit as a problem for argmin's own solvers.
    ///
    /// # Errors
    /// As [`run`](Fit::run).
    pub fn problem(self) -> Result<FitProblem<'a, M, I, P, O>, Error> {
        let setting = self.prepare()?;
        let whitening = self.first_whitening(&setting, &setting.unknowns.start())?;
        Ok(FitProblem { fit: self, setting, whitening })
    }

    /// The noise as given, or as the errors at the start show it.
    fn first_whitening(&self, setting: &Setting<M, P>, coordinates: &[f64]) -> Result<Whitening, Error> {
        let unit = Whitening::Diagonal(vec![1.0; M::Output::LEN]);
        match self.noise {
            Noise::Given(sigma) => Ok(Whitening::Diagonal(M::Output::into_array(sigma).as_ref().to_vec())),
            _ if self.noise_is_no_matter() => Ok(unit),
            noise => {
                let objective = self.objective(setting, unit);
                objective.estimate_noise(coordinates, noise).map_err(|_| self.start_failure(&objective, coordinates))
            }
        }
    }

    /// With one output, squared loss and no prior the noise scales the cost and nothing else.
    pub(super) fn noise_is_no_matter(&self) -> bool {
        let prior = |parameter: &Parameter| parameter.free && parameter.prior.is_some();
        let declared = M::Parameters::into_array(self.parameters);
        let initial = self.experiments.iter().any(|e| match e.initial_state() {
            Initial::Given(state) => M::State::into_array(*state).as_ref().iter().any(prior),
            _ => false,
        });
        let estimated = !matches!(self.noise, Noise::Given(_));
        estimated && M::Output::LEN == 1 && self.loss.is_none() && !initial && !declared.as_ref().iter().any(prior)
    }

    fn start_failure(&self, objective: &Objective<'_, M, I, P>, coordinates: &[f64]) -> Error {
        for e in 0..self.experiments.len() {
            match objective.experiment(e, coordinates) {
                Err(Halt::Failed { sample }) => return Error::Start(objective.locate(e, coordinates, sample)),
                Err(Halt::Cancelled) => return self.stopped(),
                Ok(_) => {}
            }
        }
        Error::Start(objective.locate(0, coordinates, 0))
    }

    fn stopped(&self) -> Error {
        Error::Option(match self.time_limit {
            Some(limit) if self.control.expired() => format!(
                "the time limit of {} s was over before the start had been evaluated; allow more time",
                limit.as_secs_f64()
            ),
            _ => "the fit was cancelled before its start had been evaluated; lower the flag to run it".to_owned(),
        })
    }

    /// What a checkpoint belongs to: the data, and everything that shapes the cost.
    fn fingerprint(&self, start: &[f64]) -> String {
        let mut hash = DefaultHasher::new();
        (env!("CARGO_PKG_VERSION"), std::any::type_name::<M>(), start.len()).hash(&mut hash);
        (M::Parameters::NAMES, M::State::NAMES, M::Input::NAMES, M::Output::NAMES).hash(&mut hash);
        let bits = |value: f64, hash: &mut DefaultHasher| value.to_bits().hash(hash);
        for parameter in M::Parameters::into_array(self.parameters) {
            format!("{parameter:?}").hash(&mut hash);
        }
        for record in self.experiments {
            (record.name(), record.len(), format!("{:?}{:?}", record.input_hold(), record.initial_state()))
                .hash(&mut hash);
            for k in 0..record.len() {
                bits(record.time(k), &mut hash);
                M::Input::into_array(record.inputs()[k]).into_iter().for_each(|v| bits(v, &mut hash));
                M::Output::into_array(record.outputs()[k]).into_iter().for_each(|v| bits(v, &mut hash));
            }
        }
        let loss = self.loss.as_ref().map(|loss| loss.describe());
        let weighting = self.weighting.as_ref().map(|weighting| weighting.describe());
        (loss, weighting, self.integrator.describe(), self.predictor.describe()).hash(&mut hash);
        format!("{:?}{:?}", self.prefilter, self.noise).hash(&mut hash);
        format!("{:016x}", hash.finish())
    }
}

/// A fit prepared for argmin's own solvers.
pub struct FitProblem<'a, M: Model, I: Integrator<M>, P: Predictor<M>, O> {
    fit: Fit<'a, M, I, P, O>,
    setting: Setting<M, P>,
    whitening: Whitening,
}

impl<M, I, P, O> FitProblem<'_, M, I, P, O>
where
    M: Model,
    I: Integrator<M>,
    P: Predictor<M>,
    O: Search + Clone + Serialize + DeserializeOwned,
    O: for<'p> Solver<&'p Objective<'p, M, I, P>, LeastSquaresState>,
{
    /// As [`Fit::run`], keeping the problem for what is to be asked of the estimate ([`diagnose`](crate::diagnose)).
    ///
    /// # Errors
    /// As [`Fit::run`].
    pub fn run(&mut self) -> Result<Estimate<M, I, P>, Error> {
        let begin = Instant::now();
        self.fit.control.deadline = self.fit.time_limit.map(|limit| begin + limit);
        let found = self.fit.search(&self.setting);
        // What was found is concluded even if the time is over.
        self.fit.control.deadline = None;
        self.fit.conclude(&self.setting, found?, begin)
    }
}

/// A cost and a place in its coordinates.
type Placed<'s, M, I, P> = (Objective<'s, M, I, P>, Vec<f64>);

impl<M: Model, I: Integrator<M>, P: Predictor<M>, O> FitProblem<'_, M, I, P, O> {
    /// The cost with the noise that an estimate of this problem has found, and the coordinates of that estimate.
    ///
    /// # Errors
    /// An estimate of another problem.
    pub(crate) fn at<'s>(&'s self, estimate: &Estimate<M, I, P>) -> Result<Placed<'s, M, I, P>, Error> {
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
        let sigma = M::Output::map(estimate.quality, |quality| quality.sigma);
        let diagonal = Whitening::Diagonal(M::Output::into_array(sigma).as_ref().to_vec());
        let full = estimate.noise_covariance.clone().and_then(Whitening::full);
        let objective = self.fit.objective(&self.setting, full.unwrap_or(diagonal));
        let coordinates = estimate.unknowns.iter().map(|u| u.transform.to_coordinate(u.value)).collect();
        Ok((objective, coordinates))
    }
    /// The cost to minimize. Noise that was not given is what the errors at the start show.
    pub fn objective(&self) -> Objective<'_, M, I, P> {
        self.fit.objective(&self.setting, self.whitening.clone())
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
        let linear = objective.evaluate(coordinates).map_err(|_| self.fit.start_failure(&objective, coordinates))?;
        let outcome = LevenbergMarquardt::default().judge(coordinates, &linear, &objective.bounds());
        let whitening = match self.fit.noise {
            Noise::Given(_) => self.whitening.clone(),
            _ if self.fit.noise_is_no_matter() => self.whitening.clone(),
            noise => objective.estimate_noise(coordinates, noise).unwrap_or_else(|_| self.whitening.clone()),
        };
        let name = "search by argmin".to_owned();
        let coordinates = coordinates.to_vec();
        let found =
            Found { coordinates, whitening, linear: None, outcome, iterations: 0, evaluations: 1, name, trouble: None };
        self.fit.conclude(&self.setting, found, begin)
    }
}

/// An observer that several rounds of one fit share.
struct Shared(Observer);

impl Observe<LeastSquaresState> for Shared {
    fn observe_init(&mut self, name: &str, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_init(name, state, kv))
    }

    fn observe_iter(&mut self, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_iter(state, kv))
    }

    fn observe_final(&mut self, state: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_final(state))
    }
}
