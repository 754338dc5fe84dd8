//! [`GaussNewton`]: full steps, shortened by a line search.

use super::machine::{self, Domain, Machine, Request};
use super::point::Point;
use super::{Infeasible, LeastSquares, LeastSquaresState, Linearization, Outcome, Stop};
use crate::scaling::Seen;
use argmin::core::{Error, KV, Problem, Solver, TerminationStatus};
use serde::{Deserialize, Serialize};

/// The method of Gauss and Newton with a backtracking line search (Nocedal and Wright, *Numerical Optimization*, 2006,
/// sections 3.1 and 10.3), in bounds.
///
/// Each step is the minimizer of the linearized sum of squares, halved until the cost falls by a part of the predicted decrease
/// (Armijo). Fast near a well-determined minimum; [`LevenbergMarquardt`](super::LevenbergMarquardt) is the safer choice
/// elsewhere. Directions that the data do not determine are damped by 1e-8. Bounds are part of the linearized minimization.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::optimize::GaussNewton;
/// let near = Winding { rs: free(0.6), ls: free(3.8e-3), ke: free(0.9) };
/// let estimate = Fit::new(&model, &record).parameters(near).optimizer(GaussNewton::default()).run()?;
/// assert!(estimate.outcome.converged());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GaussNewton {
    /// When to stop.
    pub stop: Stop,
    #[serde(with = "crate::real")]
    x: Vec<f64>,
    trials: u64,
    outcome: Option<Outcome>,
    #[serde(skip)]
    domain: Domain,
    #[serde(skip)]
    point: Option<Point>,
    #[serde(skip)]
    line: Line,
}

/// Where a line search stands.
#[derive(Clone, Debug, Default)]
struct Line {
    step: Vec<f64>,
    trial: Vec<f64>,
    halvings: u32,
    /// Trials that the cost could not resolve.
    unresolved: u32,
    failed: u64,
    /// How far, as a part of the cost, the trials were off the predicted decrease.
    noise: f64,
}

const SUFFICIENT: f64 = 1e-4;
const HALVINGS: u32 = 60;
/// Fewer are enough where the differences of cost are rounding.
const UNRESOLVED: u32 = 10;
/// A step that shrinks a column of the Jacobian to less than this part went too far.
const LOST: f64 = 1e-10;

impl GaussNewton {
    /// A search with this rule to stop.
    pub fn new(stop: Stop) -> Self {
        GaussNewton {
            stop,
            x: vec![],
            trials: 0,
            outcome: None,
            domain: Domain::default(),
            point: None,
            line: Line::default(),
        }
    }

    /// Begins a line search, or ends.
    fn go_on(&mut self, point: Point) {
        let limit = Outcome::IterationLimit { iterations: self.trials };
        let ended = point.ended(&self.stop).or((self.trials >= self.stop.iterations).then_some(limit));
        self.x.clone_from(&point.x);
        if let Some(outcome) = ended {
            return self.end(point, outcome);
        }
        let none = || vec![0.0; point.x.len()];
        self.line = Line { step: point.full.clone().unwrap_or_else(none), ..Line::default() };
        self.shorten(point);
    }

    /// The next trial of the line search, if there is one.
    fn shorten(&mut self, point: Point) {
        let line = &mut self.line;
        line.trial = point.towards(&line.step);
        line.unresolved += u32::from(-point.slope(&line.step) <= point.resolution());
        if line.trial == point.x || line.unresolved > UNRESOLVED || line.halvings > HALVINGS {
            let outcome = point.stuck(line.failed, line.noise, false);
            return self.end(point, outcome);
        }
        self.point = Some(point);
    }

    fn end(&mut self, point: Point, outcome: Outcome) {
        (self.outcome, self.point) = (Some(outcome), Some(point));
    }

    /// Whether a trial lowers the cost enough.
    fn accepts(&mut self, point: &Point, next: &Point) -> bool {
        let slope = point.slope(&self.line.step);
        let decrease = point.cost() - next.cost();
        // Where the cost decides nothing, what the full step would still gain does.
        let enough = match -slope <= point.resolution() {
            true => next.potential < point.potential,
            false => decrease > 0.0 && decrease >= -SUFFICIENT * slope,
        };
        self.line.noise = ((decrease + slope).abs() / point.cost_size()).max(0.125 * self.line.noise);
        // A plateau, where slopes are zero.
        let lost = point.norms.iter().zip(&next.norms).any(|(before, after)| *after < LOST * before);
        enough && !lost
    }
}

impl Default for GaussNewton {
    fn default() -> Self {
        GaussNewton::new(Stop::default())
    }
}

impl Machine for GaussNewton {
    fn begin(&mut self, start: Vec<f64>, domain: Domain) {
        *self = GaussNewton { x: start, domain, ..GaussNewton::new(self.stop) };
    }

    fn resume(&mut self, domain: Domain) {
        (self.domain, self.point) = (domain, None);
    }

    fn request(&self) -> Request<'_> {
        match (self.outcome, &self.point) {
            (Some(outcome), _) => Request::Ended(outcome),
            (None, Some(_)) => Request::Linearize(&self.line.trial),
            (None, None) => Request::Linearize(&self.x),
        }
    }

    fn tell(&mut self, answer: Result<Linearization, Infeasible>) {
        let told = match answer {
            Err(Infeasible::Cancelled) => return self.outcome = Some(Outcome::Cancelled),
            Err(Infeasible::Failed(_)) => None,
            Ok(linear) => Some(linear),
        };
        let Some(point) = self.point.take() else {
            match told.and_then(|linear| Point::new(self.x.clone(), linear, &self.domain, &Seen::default())) {
                None => self.outcome = Some(Outcome::Stalled { gradient: 0.0, step: 0.0, failed: 1 }),
                Some(point) => self.go_on(point),
            }
            return;
        };
        self.trials += 1;
        match told.and_then(|linear| Point::new(self.line.trial.clone(), linear, &self.domain, &Seen::default())) {
            Some(next) if self.accepts(&point, &next) => self.go_on(next),
            next => {
                self.line.failed += u64::from(next.is_none());
                self.line.step.iter_mut().for_each(|step| *step *= 0.5);
                self.line.halvings += 1;
                self.shorten(point);
            }
        }
    }

    fn tell_curvature(&mut self, _answer: Option<Result<Linearization, Infeasible>>) {}

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

machine::solver!([] GaussNewton, "Gauss-Newton", |search| {
    argmin::kv!("gradient" => search.point.as_ref().map_or(0.0, Point::cosine);)
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::point::tests::{at, linear};

    /// The minimum of `(x - 3)^2` below a bound at 2: a search that was read back asks for its start again, and keeps the bound.
    #[test]
    fn a_search_goes_on_in_its_bounds() {
        let domain = Domain { bounds: vec![(f64::NEG_INFINITY, 2.0)], ..Domain::default() };
        let mut search = GaussNewton::default();
        search.begin(vec![0.0], domain.clone());
        search.tell(Ok(linear(&[(1.0, 3.0), (0.0, 4.0)])));
        assert_eq!(search.request(), Request::Linearize(&[2.0]));
        let stored = serde_json::to_string(&search).unwrap();
        for mut search in [serde_json::from_str(&stored).unwrap(), search] {
            GaussNewton::resume(&mut search, domain.clone());
            assert_eq!(search.request(), Request::Linearize(&[0.0]));
            search.tell(Ok(linear(&[(1.0, 3.0), (0.0, 4.0)])));
            assert_eq!(search.request(), Request::Linearize(&[2.0]));
        }
    }

    /// Trials that cannot be evaluated are counted, from the one that halves the step for the first time.
    #[test]
    fn trials_that_fail_are_counted() {
        let mut search = GaussNewton::default();
        search.begin(vec![6.0], Domain::default());
        search.tell(Ok(linear(&[(1.0, 3.0), (0.0, 4.0)])));
        let mut trials = 0;
        while let Request::Linearize(_) = search.request() {
            search.tell(Err(Infeasible::Failed(String::new())));
            trials += 1;
        }
        assert!(matches!(search.outcome(), Some(Outcome::Stalled { failed, .. }) if failed == trials && trials > 10));
    }

    /// From the cost 12.5 along a step of 3 whose slope is -9: enough is 9e-4, and a column that vanishes went too far.
    #[test]
    fn a_trial_is_accepted_for_what_it_gains() {
        let point = at(0.0, linear(&[(1.0, 3.0), (0.0, 4.0)]));
        let mut search = GaussNewton::default();
        search.line.step = vec![3.0];
        let mut accepts = |decrease: f64, norm: f64| {
            let residual = (25.0f64 - 2.0 * decrease).sqrt();
            search.accepts(&point, &at(3.0, linear(&[(norm, 0.0), (0.0, residual)])))
        };
        assert!(accepts(9.1e-4, 1.0) && !accepts(8.9e-4, 1.0) && !accepts(-1.0, 1.0));
        assert!(accepts(1.0, 1.1e-10) && !accepts(1.0, 0.9e-10) && !accepts(1.0, 0.0));
        // How far the decrease was off the predicted one, as a part of 12.5, decays by an eighth from trial to trial.
        accepts(5.0, 1.0);
        assert!((search.line.noise - 4.0 / 12.5).abs() < 1e-12, "{}", search.line.noise);
        let mut exactly = |decrease: f64| {
            let residual = (25.0f64 - 2.0 * decrease).sqrt();
            search.accepts(&point, &at(3.0, linear(&[(1.0, 0.0), (0.0, residual)])));
            search.line.noise
        };
        assert!((exactly(9.0) - 0.125 * 4.0 / 12.5).abs() < 1e-12);
    }
}
