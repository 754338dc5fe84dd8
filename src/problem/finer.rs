//! [`Finer`]: the same problem by ever finer methods, for fits whose integrator was not chosen.

use super::{Cuts, Objective, Problem, Settings};
use crate::error::Error;
use crate::sweep::Sweep;
use std::sync::{Arc, OnceLock};

/// A sweep by a method, and its steps per sample: one, where the method chooses them or takes none.
pub(crate) type Stepped<'a> = (usize, Arc<dyn Sweep + 'a>);

/// Makes the sweep by a method, numbered from the first one that follows the default one; `None` after the last.
pub(crate) type MakeSweep<'a> = Arc<dyn Fn(usize) -> Option<Stepped<'a>> + Send + Sync + 'a>;

/// A problem by finer methods.
pub(crate) trait Finer: Send + Sync {
    /// The problem by one of the methods; `None` after the last, and for a method that does not serve it.
    fn by(&self, number: usize) -> Option<&Problem<'_>>;
}

/// Sweeps by finer and finer methods. Each is made when it is first needed, once for all problems that share these.
pub(crate) struct FinerSweeps<'a> {
    make: Option<MakeSweep<'a>>,
    made: [OnceLock<Option<Stepped<'a>>>; MOST],
}

impl<'a> FinerSweeps<'a> {
    pub fn new(make: MakeSweep<'a>) -> Arc<Self> {
        Arc::new(FinerSweeps { make: Some(make), made: Default::default() })
    }

    /// Of a method that was chosen, and of models that are not integrated.
    pub fn none() -> Arc<Self> {
        Arc::new(FinerSweeps { make: None, made: Default::default() })
    }

    fn get(&self, number: usize) -> Option<Stepped<'a>> {
        let (make, made) = (self.make.as_ref()?, self.made.get(number)?);
        made.get_or_init(|| make(number)).clone()
    }

    /// The sweep by the method of this number, as an estimate has it: from one on.
    pub fn by_number(&self, number: usize) -> Option<Arc<dyn Sweep + 'a>> {
        Some(self.get(number.checked_sub(1)?)?.1)
    }
}

/// Trial steps of each part of a search by a finer method, and the most parts. A search that begins near its minimum takes some
/// ten. A search after whose first part the model is no better than a constant is not continued: finer methods are expensive,
/// and more steps were not seen to help there.
const TRIALS: u64 = 20;
pub(crate) const PARTS: u64 = 5;

/// Steps per sample of the methods that follow the default one where there is no exact transition; after them comes a method for stiff models.
pub(crate) const SUBSTEPS: [u32; 4] = [4, 16, 64, 256];
/// Methods that follow a default one at most.
const MOST: usize = SUBSTEPS.len() + 1;

/// The problem by each method is made when it is first needed.
struct ByMethods<'a> {
    base: Problem<'a>,
    sweeps: Arc<FinerSweeps<'a>>,
    made: [OnceLock<Option<Problem<'a>>>; MOST],
}

impl Finer for ByMethods<'_> {
    fn by(&self, number: usize) -> Option<&Problem<'_>> {
        let make = || self.base.with_sweep(self.sweeps.get(number)?, number + 1).ok();
        self.made.get(number)?.get_or_init(make).as_ref()
    }
}

impl<'a> Problem<'a> {
    /// This problem with finer methods. A run continues with the next of them as long as a finer step would move an unknown.
    pub(crate) fn refining(self, sweeps: Arc<FinerSweeps<'a>>) -> Self {
        if sweeps.make.is_none() {
            return self;
        }
        // Prepared records and checkpoints depend on the method.
        let trials = if self.settings.searches.count() > 1 { TRIALS * PARTS } else { TRIALS };
        let optimizer = self.settings.optimizer.limited(trials);
        let settings = Settings { checkpoint: None, optimizer, ..self.settings.clone() };
        let base = Problem { prepared: vec![], refines: true, settings, ..self.clone() };
        let made = Default::default();
        Problem { refines: true, finer: Some(Arc::new(ByMethods { base, sweeps, made })), ..self }
    }

    /// Whether a search of so many trial steps has the limit of a finer method, and not what is left of the user's.
    pub(crate) fn limits_search_to(&self, most: u64) -> bool {
        self.method > 0 && (most == TRIALS || most == TRIALS * PARTS)
    }

    fn with_sweep(&self, (steps, sweep): Stepped<'a>, method: usize) -> Result<Self, Error> {
        let prepared = Problem::prepared(&*sweep, &self.records, &self.unknowns.parameters)?;
        let cuts = Cuts::new(&*sweep, &self.records, self.settings.prefilter.is_some());
        Ok(Problem { sweep, prepared, cuts, method, steps, ..self.clone() })
    }

    /// Steps of all samples; with many, compiling a program pays.
    pub(crate) fn all_steps(&self) -> usize {
        self.samples() * self.steps
    }

    /// The problem by a finer method, numbered from the coarsest; `None` after the last.
    pub(crate) fn finer(&self, number: usize) -> Option<&Problem<'_>> {
        self.finer.as_ref()?.by(number)
    }

    /// The problem by each method in turn, this one first.
    pub(crate) fn by_method(&self) -> impl Iterator<Item = &Problem<'_>> {
        std::iter::once::<&Problem<'_>>(self).chain((0..).map_while(|number| self.finer(number)))
    }

    /// The problem by the method of this number, as an estimate has it; this one if there is none.
    pub(crate) fn by_number(&self, method: usize) -> &Problem<'_> {
        method.checked_sub(1).filter(|_| method != self.method).and_then(|number| self.finer(number)).unwrap_or(self)
    }
}

impl Objective<'_> {
    /// Whether a finer step changes the cost at a point by a tenth; not where there is none. `None` if either cannot be evaluated there.
    pub(crate) fn step_decides(&self, coordinates: &[f64]) -> Option<bool> {
        let Some(finer) = self.sweep.refined(self.problem.all_steps()) else { return Some(false) };
        let finer = self.of(self.problem, &*finer).cost_at(coordinates).ok()?;
        let this = self.cost_at(coordinates).ok()?;
        Some(differ(this, finer))
    }
}

/// Whether costs differ by a tenth of the smaller one.
fn differ(this: f64, finer: f64) -> bool {
    const CHANGED: f64 = 0.1;
    (this - finer).abs() > CHANGED * this.abs().min(finer.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::SearchPlan;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Horizon, Model, Rk4, Scalar, Time, free};

    /// `di/dt = a u`.
    #[derive(Clone)]
    struct Charge;

    impl Model for Charge {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, _x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: p.a * u.u }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    /// `di/dt = -a i^2 + u`.
    #[derive(Clone)]
    struct Bent;

    impl Model for Bent {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: u.u - p.a * x.i * x.i }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    /// The transition of linear equations follows the default method, or four finer steps, and a method for stiff models; nothing follows a method that
    /// was chosen, a predictor that does not cross intervals exactly takes steps, and a static model has no method.
    #[test]
    fn what_follows_a_default_method() {
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let inputs = || vec![Voltage { u: 1.0 }; 4];
        let outputs = || (0..4).map(|k| Current { i: f64::from(k) }).collect::<Vec<_>>();
        let charge = Experiment::new(&Charge, time.clone(), inputs(), outputs()).unwrap();
        let line = Experiment::new(&Line, time.clone(), inputs(), outputs()).unwrap();
        let gain = || Gain { a: free(1.0) };
        let methods = |problem: &Problem<'_>| {
            problem.by_method().skip(1).map(|finer| finer.sweep.integrator()).collect::<Vec<_>>()
        };
        let (exact, stiff) = (
            "exact transition of linear equations",
            "implicit Runge-Kutta 4(3), adaptive, relative 1e-8, absolute 1e-12",
        );
        assert_eq!(methods(&Fit::new(&Charge, &charge).parameters(gain()).problem().unwrap()), [exact, stiff]);
        let bent = Experiment::new(&Bent, time.clone(), inputs(), outputs()).unwrap();
        let by_steps = methods(&Fit::new(&Bent, &bent).parameters(gain()).problem().unwrap());
        assert!(
            by_steps.len() == 5 && by_steps[3] == "Runge-Kutta 4, 256 steps per sample" && by_steps[4] == stiff,
            "{by_steps:?}"
        );
        let restarts = Fit::new(&Charge, &charge).parameters(gain()).predictor(Horizon { steps: 2, filter: None });
        assert_eq!(methods(&restarts.problem().unwrap()).len(), 5);
        let chosen = Fit::new(&Charge, &charge).parameters(gain()).integrator(Rk4::default());
        assert!(methods(&chosen.problem().unwrap()).is_empty());
        assert!(methods(&Fit::new(&Line, &line).parameters(gain()).problem().unwrap()).is_empty());
    }

    /// Searches by finer methods have 20 trial steps at a time, five times as many from several starts; a search that is limited more
    /// keeps its own limit. Methods are found by their number.
    #[test]
    fn finer_methods_search_within_limits() {
        let outputs = (0..4).map(|k| Current { i: f64::from(k) }).collect();
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 4], outputs).unwrap();
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let made = problem.sweep.clone();
        let sweeps = || FinerSweeps::new(Arc::new(|number| (number == 0).then(|| (4, made.clone()))));
        for (starts, trials) in [(1, 20), (2, 100)] {
            let settings = Settings { searches: SearchPlan::All(starts), ..problem.settings.clone() };
            let refined = Problem { settings, ..problem.clone() }.refining(sweeps());
            let finer = refined.finer(0).unwrap();
            assert_eq!(finer.settings.optimizer.most(), trials);
            assert_eq!([trials, trials - 1].map(|most| finer.limits_search_to(most)), [true, false]);
            assert!(!refined.limits_search_to(trials));
            assert!(refined.finer(1).is_none() && refined.refines && refined.by_method().count() == 2);
            assert_eq!([0, 1, 2].map(|number| refined.by_number(number).method), [0, 1, 0]);
            assert_eq!([0, 1].map(|number| refined.by_number(number).all_steps()), [4, 16]);
        }
        assert_eq!([0, 1, 2].map(|number| sweeps().by_number(number).is_some()), [false, true, false]);
    }

    #[test]
    fn costs_differ_by_a_tenth_of_the_smaller_one() {
        assert!(differ(1.11, 1.0) && differ(1.0, 1.11) && !differ(1.09, 1.0) && !differ(1.0, 1.09));
        // Costs of likelihoods may be negative; two that are zero do not differ.
        assert!(differ(-1.11, -1.0) && !differ(-1.09, -1.0) && differ(1e-3, -1e-3) && !differ(0.0, 0.0));
    }
}
