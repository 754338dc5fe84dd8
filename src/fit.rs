//! [`Fit`]: from a model and its records to an estimate.

#[cfg(feature = "parallel")]
mod ahead;
mod elsewhere;
mod fleet;
mod lockstep;
mod predict;
mod refine;
mod run;
mod search;
mod sides;
mod simulated;
mod start_error;
mod starts;

pub use fleet::Fleet;

use crate::equations::Equations;
use crate::error::Error;
use crate::estimate::Estimate;
use crate::experiment::{ExperimentOf, Sample};
use crate::functions::Handle;
use crate::integrate::{Automatic, Integrator, Method, Rk4, Stiff, automatic, stiff};
use crate::layout::{Kind, Layout};
use crate::loss::Loss;
use crate::model::Model;
use crate::optimize::LeastSquaresState;
use crate::parameter::Parameter;
use crate::predict::{Prediction, Predictor, simulation};
use crate::prefilter::Butterworth;
use crate::problem::{FinerSweeps, MakeSweep, Problem, SUBSTEPS, Search, Settings, Weights};
use crate::record::Record;
use crate::signals::{Of, Signals};
use crate::sweep::{DualSweep, Loops, Narrow, Sweep, Typed, compiled};
use crate::weighting::Weighting;
use argmin::core::observers::{Observe, ObserverMode};
use core::marker::PhantomData;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::Duration;

/// A model and its records, before the parameters are declared.
#[derive(Debug)]
pub struct Records<'a, M: Model> {
    model: &'a M,
    experiments: &'a [ExperimentOf<M>],
}

impl<'a, M: Model> Records<'a, M> {
    /// Declares each parameter `free` (with its start, bounds and prior) or `fixed`.
    pub fn parameters(self, parameters: Of<M::Parameters, Parameter>) -> Fit<'a, M> {
        Fit {
            model: self.model,
            experiments: self.experiments,
            parameters,
            stepping: Stepping::automatic(1),
            is_default: true,
            predictor: simulation(),
            settings: Settings::default(),
        }
    }
}

/// An integrator: compiled into the loop over a model's samples, and as a trait object.
pub(crate) struct Stepping<M: Model> {
    loops: Arc<dyn Loops<M>>,
    method: Arc<dyn Method>,
}

impl<M: Model> Stepping<M> {
    pub fn new(integrator: impl Integrator) -> Self {
        Stepping { loops: Arc::new(integrator.clone()), method: Arc::new(integrator) }
    }

    /// The default, with this number of steps per sample.
    fn automatic(substeps: u32) -> Self {
        Stepping { loops: Arc::new(Automatic { continuous: Rk4 { substeps } }), method: automatic(substeps) }
    }
}

impl<M: Model> Clone for Stepping<M> {
    fn clone(&self) -> Self {
        Stepping { loops: self.loops.clone(), method: self.method.clone() }
    }
}

/// A fit with its settings, before it is run.
///
/// Defaults: simulation error, squared loss, no weighting, noise estimated per output,
/// [`LevenbergMarquardt`](crate::optimize::LevenbergMarquardt), and the default integrator of the model's kind.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_csv(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::{Huber, Rk4};
/// let estimate = Fit::new(&model, &record)
///     .parameters(Winding { rs: free(1.0).within(0.01, 10.0), ls: free(2e-3).log(), ke: free(0.7) })
///     .loss(Huber::default())
///     .integrator(Rk4 { substeps: 2 })
///     .run()?;
/// assert!((estimate.parameters.ke / 0.95 - 1.0).abs() < 0.001);
/// # Ok(())
/// # }
/// ```
pub struct Fit<'a, M: Model> {
    model: &'a M,
    experiments: &'a [ExperimentOf<M>],
    parameters: Of<M::Parameters, Parameter>,
    stepping: Stepping<M>,
    /// Whether the integrator was not chosen.
    is_default: bool,
    predictor: Arc<dyn Prediction>,
    settings: Settings,
}

impl<'a, M: Model> Fit<'a, M> {
    /// A fit of one record, or of several (`&[a, b]`, `&vec`) at once.
    #[expect(clippy::new_ret_no_self, reason = "a fit without parameters is not a fit yet")]
    pub fn new<R: AsRef<[ExperimentOf<M>]> + ?Sized>(model: &'a M, records: &'a R) -> Records<'a, M> {
        Records { model, experiments: records.as_ref() }
    }

    /// Sets the integrator. It is kept, with a warning if its step moves the answer.
    ///
    /// Without it, a fit of a continuous model begins with [`Rk4`], one step per sample. While a finer step would move an
    /// unknown by more than a tenth of its standard error, where the start cannot be simulated, or where a search that did not
    /// converge had a cost that a finer step changes, it takes 4, 16 and 64 steps per sample, then [`Esdirk`](crate::Esdirk); the estimate
    /// names the method ([`Method::integrator`](crate::estimate::Method)), and is not usable if none is fine enough. A finer step
    /// stays where a coarser one explains the data better, or as well with other values, which is said. `Esdirk` is stopped where it
    /// needs 3,000 steps for a sample, or 1,000 for each: such a model is not stiff, but fast, or its state grows without bound. A
    /// search by one of the finer methods has at most 100 trial steps, and begins at the minima found, where there are several
    /// starts; a limit of the search's own holds for all methods together.
    pub fn integrator(self, integrator: impl Integrator) -> Self {
        Fit { stepping: Stepping::new(integrator), is_default: false, ..self }
    }

    /// Sets the predictor, whose prediction error is minimized.
    pub fn predictor(self, predictor: impl Predictor) -> Self {
        Fit { predictor: Arc::new(predictor), ..self }
    }

    /// Sets the search and its settings.
    pub fn optimizer(self, optimizer: impl Search) -> Self {
        self.set(|settings| settings.optimizer(optimizer))
    }

    /// Sets the standard deviation of the noise of each output, in its unit (after the pre-filter, if there is one).
    /// Without it, the noise is estimated from the errors.
    pub fn noise(self, sigma: Of<M::Output, f64>) -> Self {
        self.set(|settings| settings.noise(M::Output::into_array(sigma).as_ref().to_vec()))
    }

    /// Declares the standard deviation of the noise of each input, in its unit; zero for none. It changes neither the
    /// estimate nor its intervals: the bias that it causes is estimated (Cook and Stefanski 1994), and named by a warning
    /// where it is above a quarter of a standard error.
    pub fn input_noise(self, sigma: Of<M::Input, f64>) -> Self {
        self.set(|settings| settings.input_noise(M::Input::into_array(sigma).as_ref().to_vec()))
    }

    /// Estimates the covariance of the noise of all outputs, instead of a standard deviation per output.
    pub fn noise_covariance(self) -> Self {
        self.set(Settings::noise_covariance)
    }

    /// Multiplies the cost of each sample by a weight (at least zero), any function of the sample. It is not an inverse
    /// variance: the covariance is that of the weighted estimate, whatever the noise (a sandwich).
    ///
    /// It is owned: a closure that captures takes its variables by `move`.
    pub fn weighting(mut self, weighting: impl Weighting<M> + 'static) -> Self
    where
        M: 'static,
    {
        self.settings.weights = Some(Arc::new(ByModel { weighting, model: PhantomData::<fn(&M)> }));
        self
    }

    /// Sets the loss, a function of the standardized errors.
    pub fn loss(self, loss: impl Loss + 'static) -> Self {
        self.set(|settings| settings.loss(loss))
    }

    /// Filters the prediction errors and their slopes before the cost is computed. A missing sample enters the filter
    /// as zero.
    pub fn prefilter(self, filter: Butterworth) -> Self {
        self.set(|settings| settings.prefilter(filter))
    }

    /// Searches from `count` starts and keeps the best end. [`Summary::starts`](crate::Summary::starts) reports the minima that were
    /// found.
    ///
    /// Unless set, a fit searches from the declared start. If it is not usable and the model explains none of the
    /// outputs ([`WarningCode::Unexplained`](crate::WarningCode::Unexplained)), it goes on to search from 32 starts by itself, after
    /// 75 evaluations of each from the best four only, and says so; with `starts(1)` it does not, nor with more than 20,000 samples
    /// (2,000 where the model does not run in vector registers).
    ///
    /// The first start is the declared one. The others are a Latin hypercube (McKay, Beckman and Conover, Technometrics 21
    /// (1979) 239), the same in every run. Of each unknown they span
    /// - its prior, where it has one, cut off at its bounds;
    /// - else its bounds, if both are finite: evenly in the logarithm if that is estimated, or if the bounds have one sign and
    ///   span a decade;
    /// - else a factor of 10 to either side of its declared start, evenly in the logarithm, cut off at its bounds. A parameter
    ///   that starts at zero moves to either side by as much as changes the prediction by the errors at the declared start; an
    ///   initial state keeps its start.
    ///
    /// The searches advance together, in parallel lanes where the model is compiled and in threads; the result is the same
    /// for any number of threads. A search is stopped when it is still above the best minimum found after many times the
    /// steps that those which found a minimum took.
    /// A time limit, a flag and a checkpoint hold for all searches together; an observer sees the best point so far.
    ///
    /// ```
    /// # use greybox::*;
    /// # use greybox::pmsm::{Surface, Winding};
    /// # fn example(model: &Surface, record: &ExperimentOf<Surface>) -> Result<(), Error> {
    /// let parameters = Winding { rs: free(1.0).within(0.01, 10.0), ls: free(2e-3).log(), ke: free(0.7).prior(0.7, 0.1) };
    /// let estimate = Fit::new(model, record).parameters(parameters).starts(20).run()?;
    /// if let Some(starts) = &estimate.starts {
    ///     println!("{} of {} searches agree", starts.agreed, starts.tried);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn starts(self, count: usize) -> Self {
        self.set(|settings| settings.starts(count))
    }

    /// Stops the search at its best point so far when the flag is set (by another thread, a signal handler).
    pub fn cancel(self, flag: Arc<AtomicBool>) -> Self {
        self.set(|settings| settings.cancel(flag))
    }

    /// Adds one to the counter whenever a refit of [`bootstrap`](crate::diagnose::bootstrap) has ended, for a display of
    /// progress by another thread.
    pub fn counter(self, counter: Arc<AtomicU64>) -> Self {
        self.set(|settings| settings.counter(counter))
    }

    /// Stops the search at its best point so far after this time. Of the tests that follow, those are left out that
    /// were not made by then, which a warning says ([`NotExamined`](crate::WarningCode::NotExamined)).
    pub fn time_limit(self, limit: Duration) -> Self {
        self.set(|settings| settings.time_limit(limit))
    }

    /// Calls an observer of argmin with the state of the search.
    pub fn observe(self, observer: impl Observe<LeastSquaresState> + Send + 'static, mode: ObserverMode) -> Self {
        self.set(|settings| settings.observe(observer, mode))
    }

    /// Saves the state of the search into a file every `every` iterations, and resumes from the file if it exists; a
    /// search with other settings, or of another kind, begins at the point that was reached. A file of another problem is refused.
    pub fn checkpoint(self, path: impl Into<PathBuf>, every: u64) -> Self {
        self.set(|settings| settings.checkpoint(path, every))
    }

    fn set(self, change: impl FnOnce(Settings) -> Settings) -> Self {
        Fit { settings: change(self.settings), ..self }
    }

    /// Estimates the parameters and their uncertainty.
    ///
    /// A search that does not converge is an outcome of the estimate, not an error. Where samples leave open at which of two
    /// frequencies the model oscillates ([`WarningCode::Aliased`](crate::WarningCode::Aliased)), further searches begin at the other
    /// one; where the model explains nothing, they begin at further [`starts`](Fit::starts). Each has the
    /// trial steps that the first one left of its limit, or a few times those it took; all of them end within the time limit.
    ///
    /// # Errors
    /// Invalid settings or records ([`Error`] names them), a start that cannot be simulated, a checkpoint that cannot
    /// be read.
    pub fn run(self) -> Result<Estimate<M>, Error> {
        let begin = std::time::Instant::now();
        let sweep = sweep(Handle::Borrowed(self.model), &self.stepping, &self.predictor)?;
        let (records, parameters) = (records::<M>(self.experiments), declared::<M>(self.parameters));
        let finer = finer(Handle::Borrowed(self.model), self.is_default, &self.predictor);
        let problem = Problem::new(sweep, records, &parameters, self.settings)?.refining(finer);
        Estimate::of(problem.run_since(begin)?)
    }
}

impl<M: Model> Fit<'_, M> {
    /// The fit as an untyped [`Problem`]: for [`diagnose`](crate::diagnose), for [`Report`](crate::Report), for
    /// argmin's solvers, or to be run. It holds a copy of the model and shares the records' columns, so that it outlives both; `'m` is
    /// `'static` unless the model's type itself borrows.
    ///
    /// # Errors
    /// As [`run`](Fit::run).
    pub fn problem<'m>(self) -> Result<Problem<'m>, Error>
    where
        M: Clone + 'm,
    {
        let model = Handle::Shared(Arc::new(self.model.clone()));
        let sweep = sweep(model.clone(), &self.stepping, &self.predictor)?;
        let (records, parameters) = (records::<M>(self.experiments), declared::<M>(self.parameters));
        let problem = Problem::new(sweep, records, &parameters, self.settings)?;
        Ok(problem.refining(finer(model, self.is_default, &self.predictor)))
    }
}

/// The untyped records of experiments; columns are shared, not copied.
fn records<M: Model>(experiments: &[ExperimentOf<M>]) -> Vec<Record> {
    experiments.iter().map(|experiment| experiment.record().clone()).collect()
}

/// The declared parameters, in the model's order.
fn declared<M: Model>(parameters: Of<M::Parameters, Parameter>) -> Vec<Parameter> {
    M::Parameters::into_array(parameters).as_ref().to_vec()
}

/// The sweep of a model: a compiled program if the model can be traced, else dual numbers.
pub(crate) fn sweep<'a, M: Model + 'a>(
    model: Handle<'a, M>,
    stepping: &Stepping<M>,
    predictor: &Arc<dyn Prediction>,
) -> Result<Arc<dyn Sweep + 'a>, Error> {
    let Stepping { loops, method } = stepping.clone();
    let layout = Arc::new(Layout::of::<M>());
    method.check(layout.kind)?;
    predictor.check(&layout)?;
    let plain = |uncompiled| -> Arc<dyn Sweep + 'a> {
        let code = Arc::new(Typed { model: model.clone(), loops: loops.clone() });
        let (layout, method, predictor) = (layout.clone(), method.clone(), predictor.clone());
        Arc::new(DualSweep { layout, code, method, predictor, uncompiled })
    };
    compiled(&|| Equations::trace(&*model).map(Arc::new), &method, predictor, &plain)
}

/// The sweeps by the methods that follow a default one that is too coarse.
fn finer<'a, M: Model + 'a>(
    model: Handle<'a, M>,
    is_default: bool,
    predictor: &Arc<dyn Prediction>,
) -> Arc<FinerSweeps<'a>> {
    if !is_default || M::KIND != Kind::Continuous {
        return FinerSweeps::new(vec![]);
    }
    let by = |stepping: Stepping<M>| -> MakeSweep<'a> {
        let (model, predictor) = (model.clone(), predictor.clone());
        Arc::new(move || sweep(model.clone(), &stepping, &predictor))
    };
    let steps = SUBSTEPS.map(|substeps| by(Stepping::automatic(substeps)));
    let stiff = by(Stepping { loops: Arc::new(Narrow(Stiff::default())), method: stiff() });
    FinerSweeps::new(steps.into_iter().chain([stiff]).collect())
}

/// A typed weighting as untyped [`Weights`].
struct ByModel<W, M> {
    weighting: W,
    model: PhantomData<fn(&M)>,
}

impl<M: Model, W: Weighting<M>> Weights for ByModel<W, M> {
    fn weight(&self, record: &Record, k: usize) -> f64 {
        let (t, inputs, outputs) = (record.time(k), record.inputs(), record.outputs());
        let u = M::Input::from_fn(|i| inputs[i].values[k]);
        let y = M::Output::from_fn(|j| outputs[j].values[k]);
        self.weighting.weight(&Sample { t, u, y })
    }

    fn check(&self) -> Result<(), Error> {
        self.weighting.check()
    }

    fn describe(&self) -> String {
        self.weighting.describe()
    }
}
