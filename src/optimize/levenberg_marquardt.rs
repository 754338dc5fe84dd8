//! [`LevenbergMarquardt`]: damped Gauss-Newton steps.

mod exploration;
mod solver;
mod stored;

use super::descent::{Descent, Reach, Trial, length};
use super::machine::{Domain, Machine, Request};
use super::point::Point;
use super::{Infeasible, Linearization, Outcome, SearchLimit, Stop};
use crate::scaling::{OwnSize, Scaling, Seen};
use exploration::Exploration;
use serde::{Deserialize, Serialize};
use stored::Stored;

/// The method of Levenberg (1944) and Marquardt (1963), in bounds, with steps measured by the unknowns' own sizes.
///
/// Each trial is the minimizer of the linearized sum of squares plus `lambda |D step|^2`, computed from the triangle; the
/// trial brings its slopes along. `D` is the [`Scaling`]. `lambda` is the least, not below the last one, with which the step
/// is no longer than allowed: a tenth of the unknowns' sizes at first, their sizes later, a quarter of the last step after
/// one that gained nothing (found as by More 1978). After a step that gained what was predicted `lambda` falls, ever faster; after one
/// that half did it stays (Nielsen 1999). Bounds are part of the minimization: an unknown that would cross one is put on it,
/// and the others are minimized again. Where the cost can no longer resolve a step, the slope along the step decides
/// instead. The undamped step decides when to stop, so that heavy damping never looks like a minimum.
///
/// In a curved valley, where steps are good and short, a step is bent by half the geodesic acceleration (Transtrum and
/// Sethna 2012) if the problem gives second derivatives; that costs an evaluation.
///
/// A search that ends without a minimum, or where unknowns have lost their influence, is tried once more from the start, with
/// steps that may be ten times the unknowns' sizes; the better end counts.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::optimize::{LevenbergMarquardt, Stop, OwnSize};
/// let quick = LevenbergMarquardt::new(Stop { iterations: 200, ..Stop::default() }, OwnSize);
/// let estimate = Fit::new(&model, &record).parameters(start).optimizer(quick).run()?;
/// assert!(estimate.outcome.converged() && estimate.iterations < 20);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(
    into = "Stored<S>",
    try_from = "Stored<S>",
    bound(serialize = "S: Clone + Serialize", deserialize = "S: Deserialize<'de>")
)]
pub struct LevenbergMarquardt<S = OwnSize> {
    /// When to stop.
    pub stop: Stop,
    /// Scale of each unknown: the length of a step is measured in it.
    pub scaling: S,
    x: Vec<f64>,
    seen: Seen,
    descent: Descent,
    /// The fewest directions without influence that were met.
    unseen: usize,
    /// Steps taken.
    steps: u64,
    /// Steps to points that were found by exploration, not by slopes.
    leaps: u64,
    first: Option<Try>,
    outcome: Option<Outcome>,
    /// Whether the problem may have second derivatives.
    curved: bool,
    domain: Domain,
    stage: Stage,
    point: Option<Point>,
}

/// A try that has ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Try {
    #[serde(with = "crate::real")]
    x: Vec<f64>,
    #[serde(with = "crate::real")]
    cost: f64,
    outcome: Outcome,
    trials: u64,
    #[serde(skip)]
    point: Option<Point>,
}

/// The evaluation that was asked for last.
#[derive(Clone, Debug, Default)]
enum Stage {
    /// The slopes at the point of a search that was read from a file.
    #[default]
    Resume,
    /// The slopes at the start of a try.
    Start,
    /// The slopes at a trial point.
    Step(Trial),
    /// The second derivative along a step.
    Accelerate(Trial),
    /// Evaluations at points around the start or the end, where slopes show nothing.
    Explore(Exploration),
    /// The slopes at the end of the first try, which was the better one.
    Return,
}

const FIRST: Reach = Reach { first: 0.1, later: 1.0 };
const SECOND: Reach = Reach { first: 30.0, later: 30.0 };
/// A first try that has not ended after so many trials is stopped.
const FIRST_TRIALS: u64 = 2500;
/// Number of times that a search goes on from a lower cost that exploration found beside its end.
const LEAPS: u64 = 5;
/// Half the geodesic acceleration is added to a step where the acceleration is no longer than this part of the step (Transtrum and
/// Sethna 2012 take half of this).
const ACCELERATION: f64 = 0.75;

impl<S: Scaling> LevenbergMarquardt<S> {
    /// A search with this rule to stop and this scaling.
    pub fn new(stop: Stop, scaling: S) -> Self {
        LevenbergMarquardt {
            stop,
            scaling,
            x: vec![],
            seen: Seen::default(),
            descent: Descent::new(FIRST),
            unseen: usize::MAX,
            steps: 0,
            leaps: 0,
            first: None,
            outcome: None,
            curved: true,
            domain: Domain::default(),
            stage: Stage::Resume,
            point: None,
        }
    }

    /// Whether a point that another search has found is a minimum, by this search's tests with a tolerance of 1e-4: what
    /// methods without slopes can reach.
    pub(crate) fn judge(&self, x: &[f64], linear: &Linearization, domain: &Domain) -> Outcome {
        const TOLERANCE: f64 = 1e-4;
        let stop = Stop { step: TOLERANCE, gradient: TOLERANCE, ..self.stop };
        let stalled = |gradient, step| Outcome::Stalled { gradient, step, failed: 0 };
        let point = Point::new(x.to_vec(), linear.clone(), domain, &Seen::default());
        point.map_or(stalled(0.0, 0.0), |point| {
            point.ended(&stop).unwrap_or(stalled(point.cosine(), point.relative_step()))
        })
    }

    /// Ends at the present point, or asks for the next evaluation.
    fn go_on(&mut self, point: Point) {
        let ended = point.ended(&self.stop).or_else(|| self.given_up(&point));
        let trial = match ended {
            Some(_) => None,
            None => self.descent.propose(&point, &self.scales(), &self.seen),
        };
        match trial {
            Some(trial) if self.curved && self.descent.is_slow(&trial) => self.stage = Stage::Accelerate(trial),
            Some(trial) => self.stage = Stage::Step(trial),
            None => {
                let outcome = ended
                    .unwrap_or_else(|| point.stuck(self.descent.failed, self.descent.noise, self.descent.is_rough()));
                return self.end(point, outcome);
            }
        }
        self.point = Some(point);
    }

    fn given_up(&mut self, point: &Point) -> Option<Outcome> {
        let (trials, all) = (self.descent.trials, self.trials());
        if all >= self.stop.iterations {
            return Some(Outcome::IterationLimit { iterations: all });
        }
        if self.first.is_none() && trials >= FIRST_TRIALS {
            return Some(Outcome::OwnLimit { iterations: all, limit: SearchLimit::FirstTry });
        }
        if !self.descent.creeps(point) {
            return None;
        }
        let (promised, stuck) = (point.potential / point.cost_size(), point.stuck(0, self.descent.noise, false));
        Some(if stuck.converged() { stuck } else { Outcome::Creeping { trials, promised } })
    }

    fn scales(&self) -> Vec<f64> {
        let mut scales = self.scaling.scales(&self.seen);
        scales.resize(self.x.len(), 1.0);
        for scale in &mut scales {
            if !(*scale > 0.0 && scale.is_finite()) {
                *scale = 1.0;
            }
        }
        scales
    }

    /// Ends here like this, unless there is something that slopes do not show.
    fn end(&mut self, point: Point, outcome: Outcome) {
        let mut exploration = Exploration::before_end(&point, outcome, &self.seen, self.unseen);
        if self.leaps >= LEAPS {
            exploration.stop();
        }
        self.explore(point, exploration);
    }

    fn explore(&mut self, point: Point, exploration: Exploration) {
        match exploration.next() {
            None => self.end_exploration(point, &exploration),
            Some(_) => (self.stage, self.point) = (Stage::Explore(exploration), Some(point)),
        }
    }

    /// The end of a try: of the search, unless another try may do better or the one before did.
    fn end_try(&mut self, point: Point, outcome: Outcome) {
        let trials = self.trials();
        match self.first.take() {
            None if !outcome.converged() && trials < self.stop.iterations => {
                let (x, cost) = (point.x.clone(), point.cost());
                self.first = Some(Try { x, cost, outcome, trials, point: Some(point) });
                self.begin_try(self.seen.start.clone(), SECOND);
            }
            Some(first) if first.cost < point.cost() => self.return_to(first),
            _ => (self.outcome, self.point) = (Some(outcome), Some(point)),
        }
    }

    /// Ends where the first try did.
    fn return_to(&mut self, mut first: Try) {
        self.x.clone_from(&first.x);
        self.point = first.point.take();
        match self.point {
            Some(_) => self.outcome = Some(first.outcome),
            None => (self.stage, self.first) = (Stage::Return, Some(first)),
        }
    }

    fn trials(&self) -> u64 {
        self.descent.trials + self.first.as_ref().map_or(0, |first| first.trials)
    }

    fn begin_try(&mut self, start: Vec<f64>, reach: Reach) {
        self.seen = Seen::new(&start, &self.domain.sizes);
        self.descent = Descent::new(reach);
        (self.leaps, self.x) = (0, start);
        self.point = None;
        self.stage = Stage::Start;
    }

    /// Goes on at a point that is not a trial's: `None` if it cannot be evaluated.
    fn arrive(&mut self, stage: Stage, point: Option<Point>, first: Option<Try>) {
        match (stage, point, first) {
            (Stage::Return, point, Some(first)) => (self.outcome, self.point) = (Some(first.outcome), point),
            (_, None, Some(first)) => self.return_to(first),
            (_, None, None) => self.outcome = Some(Outcome::Stalled { gradient: 0.0, step: 0.0, failed: 1 }),
            (stage, Some(point), first) => {
                self.first = first;
                if !matches!(stage, Stage::Start) {
                    return self.go_on(point);
                }
                (self.steps, self.unseen) = (0, usize::MAX);
                self.take(&point);
                let exploration = Exploration::at_start(&point, &self.seen);
                self.explore(point, exploration);
            }
        }
    }

    fn judge_trial(&mut self, point: Point, trial: &Trial, next: Option<Point>) {
        let accepted = self.descent.judge(&point, trial, next.as_ref());
        let Some(next) = next.filter(|_| accepted) else { return self.go_on(point) };
        self.take(&next);
        self.go_on(next);
    }

    /// Continues from an explored point if the cost is lower there.
    fn judge_explored(&mut self, point: Point, mut exploration: Exploration, next: Option<Point>) {
        match next.filter(|next| exploration.is_lower(&point, next)) {
            Some(next) => {
                self.leaps += 1;
                self.take(&next);
                self.go_on(next);
            }
            None => self.explore(point, exploration),
        }
    }

    /// Ends a try after its exploration, or continues it.
    fn end_exploration(&mut self, point: Point, exploration: &Exploration) {
        match exploration.outcome(&point, self.leaps >= LEAPS) {
            None => self.go_on(point),
            Some(outcome) => self.end_try(point, outcome),
        }
    }

    /// Adds half the geodesic acceleration to a step, unless it is too long to be trusted.
    fn accelerate(&self, trial: &mut Trial, second: &Linearization) {
        let Some(point) = &self.point else { return };
        let Some(acceleration) = second.step(&trial.damping, &point.held) else { return };
        if length(&self.scales(), &acceleration) <= ACCELERATION * trial.length {
            let step: Vec<f64> = trial.step.iter().zip(&acceleration).map(|(step, a)| step + 0.5 * a).collect();
            trial.x = point.towards(&step);
        }
    }

    /// Stops at the best point so far.
    fn cancel(&mut self) {
        let cost = self.point.as_ref().map_or(f64::INFINITY, Point::cost);
        if let Some(first) = self.first.take().filter(|first| first.cost < cost) {
            (self.x, self.point) = (first.x, first.point);
        }
        self.outcome = Some(Outcome::Cancelled);
    }

    /// Moves to a point.
    fn take(&mut self, point: &Point) {
        self.seen.add(&point.x, &point.norms);
        self.x.clone_from(&point.x);
        // Rank is determined at ever longer intervals: a decomposition at each step would cost too much with many unknowns.
        if self.steps == 0 || self.steps.is_power_of_two() {
            self.unseen = self.unseen.min(point.without_influence().len());
        }
        self.steps += 1;
    }
}

impl<S: Scaling> Machine for LevenbergMarquardt<S> {
    fn begin(&mut self, start: Vec<f64>, domain: Domain) {
        (self.domain, self.first, self.outcome, self.curved) = (domain, None, None, true);
        self.begin_try(start, FIRST);
    }

    fn resume(&mut self, domain: Domain) {
        (self.domain, self.stage, self.point) = (domain, Stage::Resume, None);
    }

    fn request(&self) -> Request<'_> {
        match (&self.stage, self.outcome) {
            (_, Some(outcome)) => Request::Ended(outcome),
            (Stage::Resume | Stage::Start | Stage::Return, None) => Request::Linearize(&self.x),
            (Stage::Step(trial), None) => Request::Linearize(&trial.x),
            (Stage::Explore(exploration), None) => Request::Linearize(exploration.next().unwrap_or(&self.x)),
            (Stage::Accelerate(trial), None) => Request::Curvature { x: &self.x, along: &trial.step },
        }
    }

    fn tell(&mut self, answer: Result<Linearization, Infeasible>) {
        let told = match answer {
            Err(Infeasible::Cancelled) => return self.cancel(),
            Err(Infeasible::Failed(_)) => None,
            Ok(linear) => Some(linear),
        };
        match (std::mem::take(&mut self.stage), self.point.take(), self.first.take()) {
            (Stage::Step(trial), Some(point), first) => {
                self.first = first;
                let next = told.and_then(|linear| Point::new(trial.x.clone(), linear, &self.domain, &self.seen));
                self.judge_trial(point, &trial, next);
            }
            (Stage::Explore(mut exploration), Some(point), first) => {
                self.first = first;
                let x = exploration.take();
                let next = told.and_then(|linear| Point::new(x, linear, &self.domain, &self.seen));
                self.judge_explored(point, exploration, next);
            }
            (stage, _, first) => {
                let point = told.and_then(|linear| Point::new(self.x.clone(), linear, &self.domain, &self.seen));
                self.arrive(stage, point, first);
            }
        }
    }

    fn tell_curvature(&mut self, answer: Option<Result<Linearization, Infeasible>>) {
        let Stage::Accelerate(mut trial) = std::mem::take(&mut self.stage) else { return };
        match answer {
            None => self.curved = false,
            Some(Err(Infeasible::Cancelled)) => return self.cancel(),
            Some(Err(Infeasible::Failed(_))) => {}
            Some(Ok(second)) => self.accelerate(&mut trial, &second),
        }
        self.stage = Stage::Step(trial);
    }

    fn place(&self) -> &[f64] {
        &self.x
    }

    fn linearization(&self) -> Option<&Linearization> {
        self.point.as_ref().map(|point| &point.linear)
    }

    fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        LevenbergMarquardt::new(Stop::default(), OwnSize)
    }
}

#[cfg(test)]
mod tests;
