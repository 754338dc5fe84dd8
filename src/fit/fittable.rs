//! [`Fittable`]: what a [`Fit`](crate::Fit) can be made of.

use crate::equations::Equations;
use crate::error::Error;
use crate::estimate::{Estimate, Summary};
use crate::experiment::ExperimentOf;
use crate::functions::Handle;
use crate::integrate::{Automatic, Integrator, Method, Rk4, automatic, exact, stiff};
use crate::layout::{Kind, Layout};
use crate::model::Model;
use crate::parameter::Parameter;
use crate::predict::{Prediction, Predictor, simulation};
use crate::problem::{FinerSweeps, SUBSTEPS};
use crate::record::Record;
use crate::signals::{Of, Signals};
use crate::sweep::{DualSweep, Loops, Sweep, Typed, compiled, of_equations};
use std::sync::{Arc, OnceLock};

/// What can be fitted: a Rust [`Model`], [`Equations`] that are known at run time, or a [`Sweep`] of one's own behind an `Arc`.
///
/// Of a model, the vectors are its own structs; of the others, they are in the order of the layout.
pub trait Fittable: Sized + Send + Sync {
    /// A record of it.
    type Record;
    /// A declaration for each parameter.
    type Declarations;
    /// A number for each output.
    type PerOutput;
    /// A number for each input.
    type PerInput;
    /// The result of a fit.
    type Estimate;
}

impl<M: Model> Fittable for M {
    type Record = ExperimentOf<M>;
    type Declarations = Of<M::Parameters, Parameter>;
    type PerOutput = Of<M::Output, f64>;
    type PerInput = Of<M::Input, f64>;
    type Estimate = Estimate<M>;
}

impl Fittable for Equations {
    type Record = Record;
    type Declarations = Vec<Parameter>;
    type PerOutput = Vec<f64>;
    type PerInput = Vec<f64>;
    type Estimate = Summary;
}

impl Fittable for Arc<dyn Sweep + '_> {
    type Record = Record;
    type Declarations = Vec<Parameter>;
    type PerOutput = Vec<f64>;
    type PerInput = Vec<f64>;
    type Estimate = Summary;
}

/// How a fit is made of it.
pub trait Made: Fittable {
    /// An integrator.
    type Stepping: Clone + Send + Sync;
    /// Whether other methods follow its default one where it is continuous.
    const REFINES: bool;

    fn layout(&self) -> Layout;
    /// What a fit that borrows it runs.
    fn lent(&self) -> Handle<'_, Self>;
    fn record(record: &Self::Record) -> &Record;
    fn declared(parameters: Self::Declarations) -> Vec<Parameter>;
    fn per_output(numbers: Self::PerOutput) -> Vec<f64>;
    fn per_input(numbers: Self::PerInput) -> Vec<f64>;
    fn estimate(summary: Summary) -> Result<Self::Estimate, Error>;
    fn stepping(integrator: impl Integrator) -> Self::Stepping;
    /// The transition of equations that are linear with constant coefficients.
    fn exact(&self) -> Option<Self::Stepping>;
    /// The methods that follow the default one of a continuous model, each with its steps per sample: [`exact`](Self::exact) where the model has it and
    /// `crosses` allows it, else shorter and shorter steps; at last a method for stiff models.
    fn finer(&self, crosses: bool) -> Vec<(usize, Self::Stepping)>;
    /// A sweep, by the default integrator and of the simulation error unless said otherwise.
    fn sweep<'a>(
        model: Handle<'a, Self>,
        stepping: Option<&Self::Stepping>,
        predictor: Option<&Predicting>,
    ) -> Result<Arc<dyn Sweep + 'a>, Error>
    where
        Self: 'a;
}

/// The integrator that was chosen; else, for a filter of linear equations, their transition. `None`: the default one.
pub(super) fn stepping<M: Made>(
    model: &M,
    chosen: Option<&M::Stepping>,
    predictor: Option<&Predicting>,
) -> Option<M::Stepping> {
    let is_filter = predictor.is_some_and(Predicting::is_filter);
    chosen.cloned().or_else(|| is_filter.then(|| model.exact()).flatten())
}

/// Whether a predictor, a simulation if there is none, takes the transition of linear equations where it is there.
pub(super) fn crosses(predictor: Option<&Predicting>) -> bool {
    let predictor = predicting(predictor);
    predictor.is_filter() || predictor.is_simulation()
}

/// The sweeps by the methods that follow a default one that is too coarse.
pub(super) fn finer<'a, M: Made + 'a>(
    model: Handle<'a, M>,
    stepping: Option<&M::Stepping>,
    predictor: Option<&Predicting>,
) -> Arc<FinerSweeps<'a>>
where
    M::Stepping: 'a,
{
    if stepping.is_some() || !M::REFINES || model.layout().kind != Kind::Continuous {
        return FinerSweeps::none();
    }
    let (predictor, methods) = (predictor.cloned(), OnceLock::new());
    FinerSweeps::new(Arc::new(move |number| {
        let all =
            methods.get_or_init(|| model.finer(crosses(predictor.as_ref()) && model.layout().states.len() <= WIDEST));
        let (steps, stepping) = all.get(number)?;
        Some((*steps, M::sweep(model.clone(), Some(stepping), predictor.as_ref()).ok()?))
    }))
}

/// Most states of equations whose exact transition is taken without being asked for: its matrices are full, and are computed anew for each set of parameters.
const WIDEST: usize = 32;

/// The methods that follow a default one, each with its steps per sample.
fn following<T>(exact: Option<T>, automatic: impl Fn(u32) -> T, stiff: T) -> Vec<(usize, T)> {
    let by_steps = || SUBSTEPS.map(|steps| (steps as usize, automatic(steps))).into_iter().collect();
    let mut methods: Vec<(usize, T)> = exact.map_or_else(by_steps, |exact| vec![(1, exact)]);
    methods.push((1, stiff));
    methods
}

/// A predictor.
#[derive(Clone)]
pub struct Predicting(Arc<dyn Prediction>);

impl Predicting {
    pub fn new(predictor: impl Predictor) -> Self {
        Predicting(Arc::new(predictor))
    }

    pub fn is_filter(&self) -> bool {
        self.0.is_filter()
    }
}

/// The predictor that was chosen, or the default.
fn predicting(chosen: Option<&Predicting>) -> Arc<dyn Prediction> {
    chosen.map_or_else(simulation, |Predicting(predictor)| predictor.clone())
}

/// An integrator of equations.
#[derive(Clone)]
pub struct AnyStepping(Arc<dyn Method>);

impl AnyStepping {
    pub fn is_exact(&self) -> bool {
        self.0.is_exact()
    }

    /// The method of what was chosen, or the default one.
    pub(super) fn method(chosen: Option<&AnyStepping>) -> Arc<dyn Method> {
        chosen.map_or_else(|| automatic(1), |stepping| stepping.0.clone())
    }
}

/// An integrator of a Rust model: as a trait object, and compiled into the loop over a model's samples. The implicit method that follows the others is a trait
/// object only: few fits use it, and the loop would be compiled for each model.
pub struct Stepping<M: Model> {
    loops: Option<Arc<dyn Loops<M>>>,
    method: Arc<dyn Method>,
}

impl<M: Model> Stepping<M> {
    /// The default, with this number of steps per sample.
    fn automatic(substeps: u32) -> Self {
        Stepping { loops: Some(Arc::new(Automatic { continuous: Rk4 { substeps } })), method: automatic(substeps) }
    }
}

impl<M: Model> Clone for Stepping<M> {
    fn clone(&self) -> Self {
        Stepping { loops: self.loops.clone(), method: self.method.clone() }
    }
}

impl<M: Model> Made for M {
    type Stepping = Stepping<M>;
    const REFINES: bool = true;

    fn layout(&self) -> Layout {
        Layout::of::<M>()
    }

    fn lent(&self) -> Handle<'_, M> {
        Handle::Borrowed(self)
    }

    fn record(record: &ExperimentOf<M>) -> &Record {
        record.record()
    }

    fn declared(parameters: Of<M::Parameters, Parameter>) -> Vec<Parameter> {
        <M as Model>::Parameters::into_array(parameters).as_ref().to_vec()
    }

    fn per_output(numbers: Of<M::Output, f64>) -> Vec<f64> {
        <M as Model>::Output::into_array(numbers).as_ref().to_vec()
    }

    fn per_input(numbers: Of<M::Input, f64>) -> Vec<f64> {
        <M as Model>::Input::into_array(numbers).as_ref().to_vec()
    }

    fn estimate(summary: Summary) -> Result<Estimate<M>, Error> {
        Estimate::of(summary)
    }

    fn stepping(integrator: impl Integrator) -> Stepping<M> {
        Stepping { loops: Some(Arc::new(integrator.clone())), method: Arc::new(integrator) }
    }

    fn exact(&self) -> Option<Stepping<M>> {
        Equations::trace(self).ok()?.linear()?;
        Some(Stepping { method: exact(), ..Stepping::automatic(1) })
    }

    fn finer(&self, crosses: bool) -> Vec<(usize, Stepping<M>)> {
        let stiff = Stepping { loops: None, method: stiff() };
        following(crosses.then(|| self.exact()).flatten(), Stepping::automatic, stiff)
    }

    /// A compiled program if the model can be traced, else dual numbers.
    fn sweep<'a>(
        model: Handle<'a, M>,
        stepping: Option<&Stepping<M>>,
        predictor: Option<&Predicting>,
    ) -> Result<Arc<dyn Sweep + 'a>, Error>
    where
        M: 'a,
    {
        let Stepping { loops, method } = stepping.cloned().unwrap_or_else(|| Stepping::automatic(1));
        let (layout, predictor) = (Arc::new(Layout::of::<M>()), predicting(predictor));
        method.check(layout.kind)?;
        predictor.check(&layout)?;
        let plain = |uncompiled| -> Arc<dyn Sweep + 'a> {
            let code = Arc::new(Typed { model: model.clone(), loops: loops.clone() });
            let (layout, method, predictor) = (layout.clone(), method.clone(), predictor.clone());
            Arc::new(DualSweep { layout, code, method, predictor, uncompiled })
        };
        Ok(compiled(&|| Equations::trace(&*model).map(Arc::new), &method, &predictor, &plain))
    }
}

impl Made for Equations {
    type Stepping = AnyStepping;
    const REFINES: bool = true;

    fn layout(&self) -> Layout {
        self.layout().clone()
    }

    fn lent(&self) -> Handle<'_, Equations> {
        Handle::Shared(Arc::new(self.clone()))
    }

    fn record(record: &Record) -> &Record {
        record
    }

    fn declared(parameters: Vec<Parameter>) -> Vec<Parameter> {
        parameters
    }

    fn per_output(numbers: Vec<f64>) -> Vec<f64> {
        numbers
    }

    fn per_input(numbers: Vec<f64>) -> Vec<f64> {
        numbers
    }

    fn estimate(summary: Summary) -> Result<Summary, Error> {
        Ok(summary)
    }

    fn stepping(integrator: impl Integrator) -> AnyStepping {
        AnyStepping(Arc::new(integrator))
    }

    fn exact(&self) -> Option<AnyStepping> {
        self.linear().map(|_| AnyStepping(exact()))
    }

    fn finer(&self, crosses: bool) -> Vec<(usize, AnyStepping)> {
        let exact = crosses.then(|| self.exact()).flatten();
        following(exact, |steps| AnyStepping(automatic(steps)), AnyStepping(stiff()))
    }

    fn sweep<'a>(
        model: Handle<'a, Equations>,
        stepping: Option<&AnyStepping>,
        predictor: Option<&Predicting>,
    ) -> Result<Arc<dyn Sweep + 'a>, Error>
    where
        Self: 'a,
    {
        let method = AnyStepping::method(stepping);
        let sweep = of_equations(&model.shared(), &method, &predicting(predictor))?;
        Ok(sweep)
    }
}

impl Made for Arc<dyn Sweep + '_> {
    type Stepping = AnyStepping;
    const REFINES: bool = false;

    fn layout(&self) -> Layout {
        (**self).layout().clone()
    }

    fn lent(&self) -> Handle<'_, Self> {
        Handle::Borrowed(self)
    }

    fn record(record: &Record) -> &Record {
        record
    }

    fn declared(parameters: Vec<Parameter>) -> Vec<Parameter> {
        parameters
    }

    fn per_output(numbers: Vec<f64>) -> Vec<f64> {
        numbers
    }

    fn per_input(numbers: Vec<f64>) -> Vec<f64> {
        numbers
    }

    fn estimate(summary: Summary) -> Result<Summary, Error> {
        Ok(summary)
    }

    fn stepping(integrator: impl Integrator) -> AnyStepping {
        AnyStepping(Arc::new(integrator))
    }

    fn exact(&self) -> Option<AnyStepping> {
        None
    }

    fn finer(&self, _crosses: bool) -> Vec<(usize, AnyStepping)> {
        vec![]
    }

    fn sweep<'a>(
        model: Handle<'a, Self>,
        stepping: Option<&AnyStepping>,
        predictor: Option<&Predicting>,
    ) -> Result<Arc<dyn Sweep + 'a>, Error>
    where
        Self: 'a,
    {
        match (stepping, predictor) {
            (None, None) => Ok((*model).clone()),
            (Some(_), _) => Err(has_its_own("an integrator")),
            (None, Some(_)) => Err(has_its_own("a predictor")),
        }
    }
}

fn has_its_own(what: &str) -> Error {
    Error::Option(format!("{what} was chosen for a sweep, which has its own; leave it out"))
}
