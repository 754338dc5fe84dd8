//! [`Fit`]: from a model and its records to an estimate.

mod alias_search;
mod by_name;
mod elsewhere;
mod fittable;
mod fleet;
mod further;
mod kink;
mod lockstep;
mod moves;
mod nearby;
mod noisy;
mod pieces;
mod predict;
#[cfg(feature = "parallel")]
mod prefetch;
mod refine;
mod run;
mod search;
mod shooting;
mod simulate;
mod simulated;
mod slower;
mod staged;
mod stages;
mod start_error;
mod starts;
mod weights;

pub use fittable::Fittable;
pub use fleet::Fleet;

use crate::error::Error;
use crate::functions::Handle;
use crate::graph::{Graph, Id};
use crate::integrate::Integrator;
use crate::loss::Loss;
use crate::model::Model;
use crate::optimize::LeastSquaresState;
use crate::parameter::Parameter;
use crate::predict::Predictor;
use crate::prefilter::Butterworth;
use crate::problem::{Lead, Noise, Problem, Search, SearchPlan, Settings};
use crate::record::Record;
use crate::weighting::Weighting;
use argmin::core::observers::{Observe, ObserverMode};
use core::marker::PhantomData;
use fittable::{Made, Predicting};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use weights::{ByExpression, ByModel};

/// A model and its records, before the parameters are declared.
pub struct Records<'a, M> {
    model: &'a M,
    records: Vec<Record>,
}

impl<'a, M: Made> Records<'a, M> {
    /// Declares each parameter `free` (with its start, bounds and prior) or `fixed`: as the model's own struct, or, of
    /// equations, in the order of their layout.
    pub fn parameters(self, parameters: M::Declarations) -> Fit<'a, M> {
        self.declared(M::declared(parameters))
    }

    fn declared(self, parameters: Vec<Parameter>) -> Fit<'a, M> {
        let Records { model, records } = self;
        Fit { model, records, parameters, stepping: None, predictor: None, settings: Settings::default() }
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
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
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
///
/// What is fitted may also be [`Equations`](crate::equations::Equations) that were read from a file or made at run time; then
/// records are untyped, parameters and noise levels stand in the order of the layout or go by name, and the estimate is a
/// [`Summary`](crate::Summary). Search, judgement, [`diagnose`](crate::diagnose) and [`Report`](crate::Report) are the same, and so
/// are the answers. Equations are compiled where they can be; an integrator whose steps depend on the state evaluates them node by
/// node, which is several times slower than a Rust model's own code.
///
/// ```
/// use greybox::equations::Equations;
/// use greybox::graph::{Graph, Leaf};
/// use greybox::layout::{Layout, Quantity};
/// use greybox::record::{Channel, Record};
/// use greybox::{Fit, Kind, Time, free};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // dx/dt = (u - x) / tau, y = x
/// let named = |name: &str, unit: &str| Quantity { name: name.to_owned(), unit: unit.to_owned() };
/// let layout = Layout {
///     kind: Kind::Continuous,
///     states: vec![named("x", "V")],
///     inputs: vec![named("u", "V")],
///     outputs: vec![named("y", "V")],
///     parameters: vec![named("tau", "s")],
/// };
/// let mut graph = Graph::default();
/// let [x, u, tau] = [Leaf::State(0), Leaf::Input(0), Leaf::Parameter(0)].map(|leaf| graph.leaf(leaf));
/// let rest = graph.sub(u, x);
/// let slope = graph.div(rest, tau);
/// let equations = Equations::new(layout, &graph, &[slope], &[x])?;
///
/// // A step response of 0.5 s, sampled every 10 ms.
/// let y: Vec<f64> = (0..200).map(|k| 1.0 - (-0.01 * f64::from(k) / 0.5).exp()).collect();
/// let (time, states) = (Time::Uniform { start: 0.0, step: 0.01 }, equations.layout().states.clone());
/// let inputs = vec![Channel::new("u", "V", vec![1.0; 200])];
/// let record = Record::new(states, time, inputs, vec![Channel::new("y", "V", y)])?;
///
/// let found = Fit::new(&equations, &record).parameters_by_name([("tau", free(1.0))])?.run()?;
/// assert!((found.parameters[0].value - 0.5).abs() < 1e-6);
/// # Ok(())
/// # }
/// ```
pub struct Fit<'a, M: Made> {
    model: &'a M,
    records: Vec<Record>,
    parameters: Vec<Parameter>,
    /// `None` if it was not chosen.
    stepping: Option<M::Stepping>,
    /// `None` if it was not chosen.
    predictor: Option<Predicting>,
    settings: Settings,
}

impl<'a, M: Made> Fit<'a, M> {
    /// A fit of one record, or of several (`&[a, b]`, `&vec`) at once.
    #[expect(clippy::new_ret_no_self, reason = "a fit without parameters is not a fit yet")]
    pub fn new<R: AsRef<[M::Record]> + ?Sized>(model: &'a M, records: &R) -> Records<'a, M> {
        Records { model, records: records.as_ref().iter().map(|record| M::record(record).clone()).collect() }
    }

    /// Sets the integrator. It is kept, with a warning if its step moves the answer.
    ///
    /// Without it, a fit of a continuous model begins with [`Rk4`](crate::Rk4), one step per sample (a filter of linear equations takes their
    /// exact transition, [`Kalman`](crate::Kalman)). While a finer step would move an
    /// unknown by more than a tenth of its standard error, where the start cannot be simulated, or where a search that did not
    /// converge had a cost that a finer step changes, it takes 4, 16, 64 and 256 steps per sample, then [`Esdirk`](crate::Esdirk); of linear equations
    /// with constant coefficients, of up to 32 states and without dead time, their exact transition in place of these steps, from the first
    /// search on if a finer step changes the cost at the start by a tenth. The estimate names the method
    /// ([`Method::integrator`](crate::estimate::Method)), and is not usable if none is fine enough. A finer step
    /// stays where a coarser one explains the data better, or as well with other values, which is said. `Esdirk` is stopped where it
    /// needs 3,000 steps for a sample, or 1,000 for each: such a model is not stiff, but fast, or its state grows without bound. It is not
    /// tried where two steps leave an output unexplained at the same deviance. A
    /// search by one of the finer methods goes on while each 20 trial steps lower `-2 ln` of the likelihood by 1 (from several starts, 100
    /// steps), and begins at the minima found, where there are several starts; a limit of the search's own holds for all methods together.
    pub fn integrator(self, integrator: impl Integrator) -> Self {
        Fit { stepping: Some(M::stepping(integrator)), ..self }
    }

    /// Sets the predictor, whose prediction error is minimized.
    pub fn predictor(self, predictor: impl Predictor) -> Self {
        Fit { predictor: Some(Predicting::new(predictor)), ..self }
    }

    /// Sets the search and its settings.
    pub fn optimizer(self, optimizer: impl Search) -> Self {
        self.set(|settings| settings.optimizer = Arc::new(optimizer))
    }

    /// Sets the standard deviation of the noise of each output, in its unit (after the pre-filter, if there is one).
    /// Without it, the noise is estimated from the errors.
    pub fn noise(self, sigma: M::PerOutput) -> Self {
        self.set(|settings| settings.noise = Noise::Given(M::per_output(sigma)))
    }

    /// Declares the standard deviation of the noise of each input, in its unit; zero for none. It changes neither the
    /// estimate nor its intervals: the bias that it causes is estimated (Cook and Stefanski 1994), and named by a warning
    /// where it is above a quarter of a standard error.
    pub fn input_noise(self, sigma: M::PerInput) -> Self {
        self.set(|settings| settings.input_noise = Some(M::per_input(sigma)))
    }

    /// Estimates the covariance of the noise of all outputs, instead of a standard deviation per output.
    pub fn noise_covariance(self) -> Self {
        self.set(|settings| settings.noise = Noise::Covariance)
    }

    /// Sets the loss, a function of the standardized errors.
    pub fn loss(self, loss: impl Loss + 'static) -> Self {
        self.set(|settings| settings.loss = Some(Arc::new(loss)))
    }

    /// Filters the prediction errors and their slopes before the cost is computed. A missing sample enters the filter
    /// as zero.
    pub fn prefilter(self, filter: Butterworth) -> Self {
        self.set(|settings| settings.prefilter = Some(filter))
    }

    /// Searches from `count` starts and keeps the best end. [`Summary::starts`](crate::Summary::starts) reports the minima that were
    /// found.
    ///
    /// Unless set, a fit searches from the declared start. If it is not usable and the model leaves one of the
    /// outputs unexplained ([`WarningCode::Unexplained`](crate::WarningCode::Unexplained)), or if the search is stuck at no minimum and the errors are
    /// colored, it goes on by itself: in stages ([`staged`](Fit::staged)), and,
    /// where these lead to nothing usable, nor to errors near the noise, from 32 starts, after 150 evaluations of each from the best four only. It says so; with
    /// `starts(1)` it does not, and with more than 20,000 samples (2,000 where the model does not run in vector registers) in stages only.
    ///
    /// Where errors are colored and the cost does not rise from the minimum as its slopes say
    /// ([`WarningCode::CurvedInterval`](crate::WarningCode::CurvedInterval)), minima may lie side by side, as with dry friction. Eight searches from places a few
    /// standard errors away follow then, with one start or several, up to 100,000 samples (5,000), and the lowest minimum is taken.
    ///
    /// The first start is the declared one. Half of the others are a Latin hypercube (McKay, Beckman and Conover, Technometrics 21
    /// (1979) 239), the same in every run. The rest are the best by their costs of 40 times as many places, half of which lie up to a factor of 100 off
    /// where the list says 10, with those unknowns at their least squares that the predictions are affine in; places near a better one are left out.
    /// With stages, or with one or two starts, all others are of the hypercube. Of each unknown it spans
    /// - its prior, where it has one, cut off at its bounds;
    /// - else its bounds, if both are finite: evenly in the logarithm if that is estimated, or if the bounds have one sign and
    ///   span a decade;
    /// - else a factor of 10 to either side of its declared start, evenly in the logarithm, cut off at its bounds. A parameter
    ///   that starts at zero moves to either side by as much as changes the prediction by the errors at the declared start; an
    ///   initial state keeps its start.
    ///
    /// The searches advance together, in parallel lanes where the model is compiled and in threads; the result is the same
    /// for any number of threads. A search is stopped when it is still above the best minimum found after many times the
    /// steps that those which found a minimum took, unless it is that from the declared start.
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
        self.set(|settings| settings.searches = SearchPlan::All(count))
    }

    /// Improves each start by a continuation before the search: a sequence of fits (stages) of one-step predictions by an extended filter
    /// ([`GivenNoise`](crate::predict::GivenNoise)), each from the estimate of the one before. The filter corrects the state at each sample, in the
    /// first stage so much that the influence of a measurement decays within a small part of the time in which the outputs change, in each
    /// further one four times more slowly. The last stage is the first one after which a simulation follows the measurements as well. Predictions
    /// with a short memory are nearly linear in the parameters, where a simulation would leave the measurements, diverge, or end in one of
    /// many minima.
    ///
    /// A fit goes in stages without being asked where the declared start cannot be simulated by any of its methods. It does so, too, where its search
    /// leaves an output unexplained or is stuck with colored errors: it searches from further starts after that only if the minimum that the stages lead to is not usable, with errors
    /// above 1.5 times the noise, and records are not long. After `starts(1)` it does neither. A fit that was asked for stages searches from no further
    /// starts by itself.
    ///
    /// Where no simulation follows the measurements after the last stage, multiple shooting goes on from there
    /// ([`multiple_shooting`](Fit::multiple_shooting)), or from the start where its gaps stay open or its errors large. It does so, too, where the search after the last
    /// stage is stuck, as on the rough cost of a chaotic plant. A start is kept where a simulation from their end is no nearer to the measurements, nor
    /// are the pieces near them. Stages need a simulation to be predicted ([`FreeRun`](crate::FreeRun), the default), and no pre-filter; where the
    /// model cannot be read as a graph, has more than six states, or its integrator chooses its steps, they are multiple shooting alone. The estimate says
    /// what came of them ([`WarningCode::Staged`](crate::WarningCode::Staged)). The evaluations of stages that led somewhere are counted, their
    /// trial steps are not. Where the search from their end leaves an output unexplained, searches from 32 starts follow, as without them.
    ///
    /// ```
    /// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let model = Surface::new(4)?;
    /// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
    /// let start = Winding { rs: free(6.0), ls: free(4e-2), ke: free(-9.0) }; // truth: 0.63 ohm, 4 mH, 0.95 V s/rad
    /// let estimate = Fit::new(&model, &record).parameters(start).staged().run()?;
    /// assert!((estimate.parameters.ls / 4e-3 - 1.0).abs() < 0.01);
    /// # Ok(())
    /// # }
    /// ```
    pub fn staged(self) -> Self {
        self.set(|settings| settings.lead = Lead::Stages)
    }

    /// Improves each start by multiple shooting alone before the search (H. G. Bock and K. J. Plitt, IFAC Proceedings 17 (1984) 1603): the
    /// records are cut into pieces, at first with the states of a filter, or the measured ones, at their begins. These states are unknowns, too, and an
    /// augmented Lagrangian closes the gaps between the end of each piece and the begin of the next. A piece is so short that an error of the
    /// parameters does not take its end far from the measurements, so that starts serve from which a simulation diverges. Time and memory are linear
    /// in the length of the records. From the end, the fit goes on with the simulation of whole records as always, and says so
    /// ([`WarningCode::Staged`](crate::WarningCode::Staged)), with the largest gap and the rms error of the pieces in units of the noise. Pieces whose gaps
    /// are closed may stand at a wrong minimum: where the error is not near the noise, shorter ones are tried.
    ///
    /// [`staged`](Fit::staged) fits do so after their other stages. The later of the two calls counts.
    ///
    /// Where the pieces explain the measurements and one simulation of a whole record does not (a chaotic plant, over many times the time in which errors
    /// double), the parameters are those of pieces as long as possible, each with an initial state of its own. The verdict is that of the
    /// whole record, not usable; the note has the standard errors of the pieces. Fit these ([`Experiment::slice`](crate::Experiment::slice)) for a verdict
    /// of their own. Not so with [`starts`](Fit::starts), nor with parameters per experiment. Where a simulation of a whole record cannot even be run
    /// with the right parameters (it overflows), the search begins at the declared start, and the note has the pieces.
    ///
    /// Errors of pieces are squared and divided by the noise, whatever the loss of the fit; weights count, and outputs that do not move do not.
    ///
    /// A start is kept where there are no pieces: no record of 16 samples, pieces of eight samples that cannot be simulated,
    /// outputs that do not give the state where the model has no filter (it cannot be read as a graph, or has more than six states), a predictor that corrects
    /// the state, a pre-filter. The note says so. Where the search from its end leaves an output unexplained, searches from 32 starts follow, as without it.
    ///
    /// ```
    /// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let model = Surface::new(4)?;
    /// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
    /// let start = Winding { rs: free(6.0), ls: free(4e-2), ke: free(-9.0) }; // truth: 0.63 ohm, 4 mH, 0.95 V s/rad
    /// let estimate = Fit::new(&model, &record).parameters(start).multiple_shooting().run()?;
    /// assert!((estimate.parameters.ls / 4e-3 - 1.0).abs() < 0.01);
    /// # Ok(())
    /// # }
    /// ```
    pub fn multiple_shooting(self) -> Self {
        self.set(|settings| settings.lead = Lead::Shooting)
    }

    /// Stops the search at its best point so far when the flag is set (by another thread, a signal handler).
    pub fn cancel(self, flag: Arc<AtomicBool>) -> Self {
        self.set(|settings| settings.cancel = Some(flag))
    }

    /// Adds one to the counter whenever a refit of [`bootstrap`](crate::diagnose::bootstrap) has ended, for a display of
    /// progress by another thread.
    pub fn counter(self, counter: Arc<AtomicU64>) -> Self {
        self.set(|settings| settings.counter = Some(counter))
    }

    /// Stops the search at its best point so far after this time. Of the tests that follow, those are left out that
    /// were not made by then, which a warning says ([`NotExamined`](crate::WarningCode::NotExamined)).
    pub fn time_limit(self, limit: Duration) -> Self {
        self.set(|settings| settings.time_limit = Some(limit))
    }

    /// Calls an observer of argmin with the state of the search.
    pub fn observe(self, observer: impl Observe<LeastSquaresState> + Send + 'static, mode: ObserverMode) -> Self {
        self.set(|settings| settings.observers.push((Arc::new(Mutex::new(Box::new(observer))), mode)))
    }

    /// Saves the state of the search into a file every `every` iterations, and resumes from the file if it exists; a
    /// search with other settings, or of another kind, begins at the point that was reached. A file of another problem is refused.
    pub fn checkpoint(self, path: impl Into<PathBuf>, every: u64) -> Self {
        self.set(|settings| settings.checkpoint = Some((path.into(), every)))
    }

    /// Multiplies the cost of each sample by a weight (at least zero): the root of a graph of time ([`Leaf::Time`](crate::graph::Leaf)),
    /// inputs and measured outputs. Otherwise as [`weighting`](Fit::weighting).
    pub fn weighting_by(self, graph: &Graph, root: Id) -> Self {
        let weights = ByExpression::new(&self.model.layout(), graph, root);
        self.set(|settings| settings.weights = Some(Arc::new(weights)))
    }

    fn set(mut self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self.settings);
        self
    }

    /// Estimates the parameters and their uncertainty.
    ///
    /// A search that does not converge is an outcome of the estimate, not an error. Where samples leave open at which of two
    /// frequencies the model oscillates ([`WarningCode::Aliased`](crate::WarningCode::Aliased)), further searches begin at the other
    /// one; where an output is left unexplained, they begin at further [`starts`](Fit::starts). Each has the
    /// trial steps that the first one left of its limit, or a few times those it took; all of them end within the time limit.
    ///
    /// # Errors
    /// Invalid settings or records ([`Error`] names them), a start that cannot be simulated and that stages do not lead to where it can, a
    /// checkpoint that cannot be read.
    pub fn run(self) -> Result<M::Estimate, Error> {
        let begin = std::time::Instant::now();
        let model = self.model.lent();
        M::estimate(self.problem_of(model)?.run_since(begin)?)
    }

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
        self.problem_of(model)
    }

    fn problem_of<'m>(self, model: Handle<'m, M>) -> Result<Problem<'m>, Error>
    where
        M: 'm,
    {
        let (chosen, predictor) = (self.stepping.as_ref(), self.predictor.as_ref());
        let stepping = fittable::stepping(&*model, chosen, predictor);
        let sweep = M::sweep(model.clone(), stepping.as_ref(), predictor)?;
        let problem = Problem::new(sweep, self.records, &self.parameters, self.settings)?;
        Ok(problem.refining(fittable::finer(model, stepping.as_ref(), predictor)))
    }
}

impl<M: Model> Fit<'_, M> {
    /// Multiplies the cost of each sample by a weight (at least zero), any function of the sample. It is not an inverse
    /// variance: the covariance is that of the weighted estimate, whatever the noise (a sandwich).
    ///
    /// It is owned: a closure that captures takes its variables by `move`.
    pub fn weighting(self, weighting: impl Weighting<M> + 'static) -> Self
    where
        M: 'static,
    {
        self.set(|settings| settings.weights = Some(Arc::new(ByModel { weighting, model: PhantomData::<fn(&M)> })))
    }
}
