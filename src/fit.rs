//! [`Fit`]: from a model and its records to an estimate.

mod as_argmin;
mod checkpoint;
mod colored;
mod conclude;
mod covariance;
mod noise;
mod objective;
mod predict;
mod reproduce;
mod run;
mod search;
mod source;
mod unknowns;
mod warnings;

pub(crate) use conclude::held_or_unseen;
pub(crate) use covariance::classical;
pub use objective::Objective;
pub(crate) use objective::{Rows, each};
pub use run::FitProblem;

use crate::error::Error;
use crate::experiment::{ExperimentOf, Sample};
use crate::integrate::{Automatic, Integrator};
use crate::loss::Loss;
use crate::model::{Kind, Model};
use crate::numeral::exact;
use crate::optimize::{GaussNewton, LeastSquaresState, LevenbergMarquardt, Linearization, Outcome};
use crate::parameter::Parameter;
use crate::predict::{FreeRun, Predictor};
use crate::prefilter::Butterworth;
use crate::scaling::Scaling;
use crate::signals::{Of, Signals};
use crate::weighting::Weighting;
use argmin::core::Solver;
use argmin::core::observers::{Observe, ObserverMode};
use noise::{Noise, Whitening};
use objective::Control;
use serde::Serialize;
use serde::de::DeserializeOwned;
use source::{Simulated, Source};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use unknowns::Unknowns;

/// A search that a fit can run: one of argmin's solvers that says how it ended.
pub trait Search: Clone + Serialize + DeserializeOwned + for<'p> Solver<&'p Objective<'p>, LeastSquaresState> {
    /// How the search ended, if it was its own decision.
    fn outcome(&self) -> Option<Outcome>;

    /// Cost and slopes where the search stands.
    fn linearization(&self) -> Option<&Linearization>;

    /// The same search for a cost that is soon to change: it may stop three digits into the minimum.
    fn rough(&self) -> Self;

    /// Whether its settings make sense.
    ///
    /// # Errors
    /// The setting and its value.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }
}

impl<S: Scaling + Serialize + DeserializeOwned> Search for LevenbergMarquardt<S> {
    fn outcome(&self) -> Option<Outcome> {
        LevenbergMarquardt::outcome(self)
    }

    fn linearization(&self) -> Option<&Linearization> {
        LevenbergMarquardt::linearization(self)
    }

    fn rough(&self) -> Self {
        LevenbergMarquardt::new(self.stop.rough(), self.scaling.clone())
    }

    fn check(&self) -> Result<(), Error> {
        self.stop.check()
    }
}

impl Search for GaussNewton {
    fn outcome(&self) -> Option<Outcome> {
        GaussNewton::outcome(self)
    }

    fn linearization(&self) -> Option<&Linearization> {
        GaussNewton::linearization(self)
    }

    fn rough(&self) -> Self {
        GaussNewton::new(self.stop.rough())
    }

    fn check(&self) -> Result<(), Error> {
        self.stop.check()
    }
}

type Observer = Arc<Mutex<Box<dyn Observe<LeastSquaresState> + Send>>>;

/// A model and its records, still without a word on the parameters.
#[derive(Debug)]
pub struct Records<'a, M: Model> {
    model: &'a M,
    experiments: &'a [ExperimentOf<M>],
}

impl<'a, M: Model> Records<'a, M> {
    /// Says of each parameter whether it is `free` (from where, within which bounds, with what prior) or `fixed`.
    pub fn parameters(self, parameters: Of<M::Parameters, Parameter>) -> Fit<'a, M> {
        Fit {
            model: self.model,
            experiments: self.experiments,
            parameters,
            integrator: Automatic::default(),
            predictor: FreeRun,
            optimizer: LevenbergMarquardt::default(),
            weighting: None,
            terms: Terms {
                noise: Noise::PerOutput,
                loss: None,
                prefilter: None,
                control: Control::default(),
                time_limit: None,
                observers: vec![],
                checkpoint: None,
            },
        }
    }
}

/// A fit about to be run.
///
/// Left unsaid: simulation error, squared loss, no weighting, noise estimated per output, [`LevenbergMarquardt`], and the
/// step that the model's kind asks for.
pub struct Fit<'a, M: Model, I = Automatic, P = FreeRun, O = LevenbergMarquardt> {
    model: &'a M,
    experiments: &'a [ExperimentOf<M>],
    parameters: Of<M::Parameters, Parameter>,
    integrator: I,
    predictor: P,
    optimizer: O,
    weighting: Option<Box<dyn Weighting<M> + 'a>>,
    terms: Terms<'a>,
}

/// What is said of a fit whatever its model.
struct Terms<'a> {
    noise: Noise,
    loss: Option<Box<dyn Loss + 'a>>,
    prefilter: Option<Butterworth>,
    control: Control,
    time_limit: Option<Duration>,
    observers: Vec<(Observer, ObserverMode)>,
    checkpoint: Option<(PathBuf, u64)>,
}

impl<'a, M: Model> Fit<'a, M> {
    /// A fit of one record, or of several (`&[a, b]`, `&vec`) at once.
    #[expect(clippy::new_ret_no_self, reason = "a fit without parameters is not a fit yet")]
    pub fn new<R: AsRef<[ExperimentOf<M>]> + ?Sized>(model: &'a M, records: &'a R) -> Records<'a, M> {
        Records { model, experiments: records.as_ref() }
    }
}

impl<'a, M: Model, I, P, O> Fit<'a, M, I, P, O> {
    /// Steps the model by another method.
    pub fn integrator<J: Integrator>(self, integrator: J) -> Fit<'a, M, J, P, O> {
        let Fit { model, experiments, parameters, predictor, optimizer, weighting, terms, .. } = self;
        Fit { model, experiments, parameters, integrator, predictor, optimizer, weighting, terms }
    }

    /// Minimizes another prediction error.
    pub fn predictor<Q: Predictor<M>>(self, predictor: Q) -> Fit<'a, M, I, Q, O> {
        let Fit { model, experiments, parameters, integrator, optimizer, weighting, terms, .. } = self;
        Fit { model, experiments, parameters, integrator, predictor, optimizer, weighting, terms }
    }

    /// Searches by another method, or by the same with other settings.
    pub fn optimizer<S: Search>(self, optimizer: S) -> Fit<'a, M, I, P, S> {
        let Fit { model, experiments, parameters, integrator, predictor, weighting, terms, .. } = self;
        Fit { model, experiments, parameters, integrator, predictor, optimizer, weighting, terms }
    }

    /// The standard deviation of the noise of each output, in its unit (after the pre-filter, if there is one). Left out,
    /// it is estimated from the errors.
    pub fn noise(mut self, sigma: Of<M::Output, f64>) -> Self {
        self.terms.noise = Noise::Given(M::Output::into_array(sigma).as_ref().to_vec());
        self
    }

    /// Estimates the noise with its correlations between outputs.
    pub fn noise_covariance(mut self) -> Self {
        self.terms.noise = Noise::Covariance;
        self
    }

    /// Multiplies the cost of each sample by a weight (at least zero), any function of the sample. It is not an inverse
    /// variance: the covariance is that of the weighted estimate, whatever the noise (a sandwich).
    pub fn weighting(self, weighting: impl Weighting<M> + 'a) -> Self {
        Fit { weighting: Some(Box::new(weighting)), ..self }
    }

    /// Bends the cost of large standardized errors.
    pub fn loss(mut self, loss: impl Loss + 'a) -> Self {
        self.terms.loss = Some(Box::new(loss));
        self
    }

    /// Filters the prediction errors (and their slopes) before they count. A missing sample enters the filter as a zero.
    pub fn prefilter(mut self, filter: Butterworth) -> Self {
        self.terms.prefilter = Some(filter);
        self
    }

    /// Stops the search, with what it has found by then, when the flag is raised (from another thread, a signal handler).
    pub fn cancel(mut self, flag: Arc<AtomicBool>) -> Self {
        self.terms.control.cancel = Some(flag);
        self
    }

    /// Stops the search after this time, with what it has found by then.
    pub fn time_limit(mut self, limit: Duration) -> Self {
        self.terms.time_limit = Some(limit);
        self
    }

    /// Shows the progress to an observer of argmin.
    pub fn observe(mut self, observer: impl Observe<LeastSquaresState> + Send + 'static, mode: ObserverMode) -> Self {
        self.terms.observers.push((Arc::new(Mutex::new(Box::new(observer))), mode));
        self
    }

    /// Saves the place of the search into a file, every so many iterations, and goes on from there if the file exists. A
    /// file of another problem is refused.
    pub fn checkpoint(mut self, path: impl Into<PathBuf>, every: u64) -> Self {
        self.terms.checkpoint = Some((path.into(), every));
        self
    }
}

/// What a fit needs to be evaluated, prepared once.
struct Setting<R> {
    unknowns: Unknowns,
    /// What the predictor made of each record.
    prepared: Vec<R>,
}

impl<M: Model, I: Integrator, P: Predictor<M>, O> Fit<'_, M, I, P, O> {
    /// Checks all that was said, and looks at every record once.
    fn prepare(&self) -> Result<Setting<P::Prepared>, Error> {
        self.check()?;
        let unknowns = Unknowns::new(self.model, self.experiments, self.parameters)?;
        if unknowns.row.is_empty() {
            return Err(Error::NothingFree);
        }
        self.check_measured()?;
        self.prepared(unknowns)
    }

    fn prepared(&self, unknowns: Unknowns) -> Result<Setting<P::Prepared>, Error> {
        let start = M::Parameters::map(self.parameters, |p| p.start);
        let prepare = |experiment| self.predictor.prepare(self.model, experiment, &start);
        let prepared = self.experiments.iter().map(prepare).collect::<Result<_, _>>()?;
        Ok(Setting { unknowns, prepared })
    }

    fn check(&self) -> Result<(), Error> {
        if self.experiments.is_empty() {
            return Err(Error::NoExperiment);
        }
        if !self.integrator.serves(M::KIND) {
            let word = |kind| match kind {
                Kind::Continuous => "continuous",
                Kind::Discrete => "discrete",
                Kind::Static => "static",
            };
            let kinds = [Kind::Continuous, Kind::Discrete, Kind::Static];
            let serves = kinds.into_iter().find(|&kind| self.integrator.serves(kind)).map_or("no", word);
            return Err(Error::WrongIntegrator {
                model: word(M::KIND),
                integrator: self.integrator.describe(M::KIND),
                serves,
            });
        }
        if let Noise::Given(sigma) = &self.terms.noise
            && let Some(j) = sigma.iter().position(|s| !(*s > 0.0 && s.is_finite()))
        {
            let what = format!("the noise of output `{}`", M::Output::NAMES[j]);
            return Err(Error::NotPositive { what, value: sigma[j] });
        }
        self.integrator.check()?;
        self.terms.loss.as_ref().map_or(Ok(()), |loss| loss.check())?;
        if let Some(filter) = &self.terms.prefilter {
            self.experiments.iter().try_for_each(|record| filter.check(record))?;
        }
        self.check_weights()
    }

    /// Every output must have been measured somewhere.
    fn check_measured(&self) -> Result<(), Error> {
        for j in 0..M::Output::LEN {
            let measured =
                |e: &ExperimentOf<M>| e.outputs().iter().any(|y| !M::Output::into_array(*y).as_ref()[j].is_nan());
            if !self.experiments.iter().any(measured) {
                let names: Vec<&str> = self.experiments.iter().map(|e| e.name()).collect();
                let output = M::Output::NAMES[j].to_owned();
                return Err(Error::OutputMissing { experiment: names.join("`, `"), output });
            }
        }
        Ok(())
    }

    /// Weights must be finite, not negative, and not zero wherever something was measured.
    fn check_weights(&self) -> Result<(), Error> {
        let Some(weighting) = &self.weighting else { return Ok(()) };
        weighting.check()?;
        let mut counts = false;
        for record in self.experiments {
            for k in 0..record.len() {
                let (t, u, y) = (record.time(k), record.inputs()[k], record.outputs()[k]);
                let weight = weighting.weight(&Sample { t, u, y });
                if !(weight >= 0.0 && weight.is_finite()) {
                    let name = record.name();
                    return Err(Error::Option(format!(
                        "weighting: the weight of sample {k} (t = {} s) of experiment `{name}` is {weight}; weights must be \
                         finite and not negative",
                        exact(t)
                    )));
                }
                counts |= weight > 0.0 && M::Output::into_array(y).as_ref().iter().any(|y| !y.is_nan());
            }
        }
        if counts {
            return Ok(());
        }
        Err(Error::Option(format!(
            "weighting: `{}` is zero at every sample with a measured output; nothing is left to fit",
            weighting.describe()
        )))
    }

    fn source<'s>(&'s self, experiments: &'s [ExperimentOf<M>], prepared: &'s [P::Prepared]) -> Arc<dyn Source + 's> {
        Arc::new(Simulated {
            model: self.model,
            experiments,
            integrator: self.integrator.clone(),
            predictor: &self.predictor,
            prepared,
            weighting: self.weighting.as_deref().map(|weighting| weighting as &dyn Weighting<M>),
        })
    }

    /// The cost, with errors in the units of the outputs.
    fn objective<'s>(&'s self, setting: &'s Setting<P::Prepared>) -> Objective<'s> {
        Objective {
            source: self.source(self.experiments, &setting.prepared),
            unknowns: &setting.unknowns,
            loss: self.terms.loss.as_deref().map(|loss| loss as &dyn Loss),
            prefilter: self.terms.prefilter.as_ref(),
            whitening: Whitening::Diagonal(vec![1.0; M::Output::LEN]),
            control: &self.terms.control,
        }
    }
}
