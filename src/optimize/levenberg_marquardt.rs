//! [`LevenbergMarquardt`]: damped Gauss-Newton steps.

use super::search::{Point, linearize};
use super::{Infeasible, LeastSquares, LeastSquaresState, Linearization, Outcome, Stop};
use crate::scaling::{JacobianColumns, Scaling};
use argmin::core::{Error, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use serde::{Deserialize, Serialize};

/// The method of Levenberg (1944) and Marquardt (1963) with the column scaling of More (1978), in bounds.
///
/// Each iteration tries one step, the minimizer of the linearized sum of squares plus `lambda |D step|^2`, computed from
/// the triangle; the trial brings its slopes along. The step is cut at the bounds; an unknown on a bound that it
/// would cross is held there. `lambda` falls by up to 10 after a step that kept its promise and grows, ever faster, after
/// one that did not. Where the cost can no longer resolve a step, a smaller gradient decides instead.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LevenbergMarquardt<S = JacobianColumns> {
    /// When to stop.
    pub stop: Stop,
    /// What a unit step of each unknown counts.
    pub scaling: S,
    lambda: f64,
    growth: f64,
    failed: u64,
    outcome: Option<Outcome>,
    #[serde(skip)]
    point: Option<Point>,
}

const FIRST_LAMBDA: f64 = 1e-4;
const LEAST_LAMBDA: f64 = 1e-20;
const LARGEST_LAMBDA: f64 = 1e20;
const FIRST_GROWTH: f64 = 4.0;
const ACCEPT: f64 = 1e-4;

impl<S: Scaling> LevenbergMarquardt<S> {
    /// A search with this rule to stop and this scaling.
    pub fn new(stop: Stop, scaling: S) -> Self {
        let (lambda, growth) = (FIRST_LAMBDA, FIRST_GROWTH);
        LevenbergMarquardt { stop, scaling, lambda, growth, failed: 0, outcome: None, point: None }
    }

    /// How the search ended; `None` while it runs, or if argmin stopped it (iterations, time, target cost).
    pub fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }

    /// Cost and slopes where the search stands; `None` before it began.
    pub fn linearization(&self) -> Option<&Linearization> {
        self.point.as_ref().map(|point| &point.linear)
    }

    /// Whether a point that another search has found is a minimum, by this search's tests with a tolerance of 1e-4: what
    /// methods without slopes can reach.
    pub(crate) fn judge(&self, x: &[f64], linear: &Linearization, bounds: &[(f64, f64)]) -> Outcome {
        const TOLERANCE: f64 = 1e-4;
        let point = Point::new(x.to_vec(), linear.clone(), &self.scaling, &[], bounds);
        let stop = Stop { step: TOLERANCE, gradient: TOLERANCE, ..self.stop };
        let damping: Vec<f64> = point.norms.iter().map(|norm| 1e-8 * norm).collect();
        let step = linear.step(&damping, &point.held);
        let ended = point.exact().or_else(|| step.and_then(|step| point.converged(&step, &stop)));
        ended.unwrap_or(Outcome::Stalled { gradient: point.cosine(), failed: 0 })
    }

    fn ended(&mut self, outcome: Outcome) {
        self.outcome = Some(outcome);
    }

    fn longer(&mut self, gain: f64) {
        // Nielsen (1999): smooth between no change at half the promised gain and a tenth at the full one.
        self.lambda = (self.lambda * (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(0.1, 2.0)).max(LEAST_LAMBDA);
        self.growth = FIRST_GROWTH;
        self.failed = 0;
    }

    fn shorter(&mut self) {
        self.lambda *= self.growth;
        self.growth *= 2.0;
    }
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        LevenbergMarquardt::new(Stop::default(), JacobianColumns)
    }
}

impl<O: LeastSquares, S: Scaling> Solver<O, LeastSquaresState> for LevenbergMarquardt<S> {
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: LeastSquaresState,
    ) -> Result<(LeastSquaresState, Option<KV>), Error> {
        let x =
            state.take_param().ok_or_else(|| Error::msg("Levenberg-Marquardt needs an initial parameter vector"))?;
        let linear = linearize(problem, &x)??;
        let bounds = problem.problem("bounds_count", |problem| Ok(problem.bounds()))?;
        let point = Point::new(x.clone(), linear, &self.scaling, &[], &bounds);
        let state = state.param(x).cost(point.linear.cost).gradient(point.gradient.clone());
        self.point = Some(point);
        Ok((state.max_iters(self.stop.iterations), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        state: LeastSquaresState,
    ) -> Result<(LeastSquaresState, Option<KV>), Error> {
        let bounds = problem.problem("bounds_count", |problem| Ok(problem.bounds()))?;
        let point = match self.point.take() {
            Some(point) => point,
            // Resumed from a checkpoint, which keeps the place but not the slopes.
            None => {
                let x = state.get_param().cloned().unwrap_or_default();
                let linear = linearize(problem, &x)??;
                Point::new(x, linear, &self.scaling, &[], &bounds)
            }
        };
        let cost = point.linear.cost;
        let mut next = None;
        if let Some(outcome) = point.exact() {
            self.ended(outcome);
        } else {
            let damping: Vec<f64> = point.scales.iter().map(|scale| self.lambda.sqrt() * scale).collect();
            match point.linear.step(&damping, &point.held) {
                None => self.shorter(),
                Some(step) => next = self.attempt(problem, &point, &step, &bounds)?,
            }
            if self.outcome.is_none() && self.lambda > LARGEST_LAMBDA {
                let (gradient, failed) = (point.cosine(), self.failed);
                self.ended(Outcome::Stalled { gradient, failed });
            }
        }
        let point = next.unwrap_or(point);
        let log =
            argmin::kv!("lambda" => self.lambda; "gradient" => point.cosine(); "decrease" => cost - point.linear.cost;);
        let state = state.param(point.x.clone()).cost(point.linear.cost).gradient(point.gradient.clone());
        self.point = Some(point);
        Ok((state, Some(log)))
    }

    fn terminate(&mut self, _state: &LeastSquaresState) -> TerminationStatus {
        match self.outcome {
            None => TerminationStatus::NotTerminated,
            Some(Outcome::Cancelled) => TerminationStatus::Terminated(TerminationReason::Interrupt),
            Some(outcome) if outcome.converged() => TerminationStatus::Terminated(TerminationReason::SolverConverged),
            Some(outcome) => TerminationStatus::Terminated(TerminationReason::SolverExit(outcome.to_string())),
        }
    }
}

impl<S: Scaling> LevenbergMarquardt<S> {
    /// Tries one step; the new point, if it is taken.
    fn attempt<O: LeastSquares>(
        &mut self,
        problem: &mut Problem<O>,
        point: &Point,
        step: &[f64],
        bounds: &[(f64, f64)],
    ) -> Result<Option<Point>, Error> {
        let (x, cut) = point.towards(step, bounds);
        // Damping shortens steps as well: only a step that it hardly shortened tells how near the minimum is.
        if self.lambda <= 1e-3
            && let Some(outcome) = point.converged(&cut, &self.stop)
        {
            self.ended(outcome);
            return Ok(None);
        }
        let promised = point.linear.predicted_reduction(&cut);
        if promised <= 0.0 || x == point.x {
            if x == point.x && self.lambda <= 1.0 {
                let gradient = point.cosine();
                self.ended(Outcome::LimitOfPrecision { gradient });
            } else {
                self.shorter();
            }
            return Ok(None);
        }
        let linear = match linearize(problem, &x)? {
            Ok(linear) => linear,
            Err(Infeasible::Cancelled) => {
                self.ended(Outcome::Cancelled);
                return Ok(None);
            }
            Err(Infeasible::Failed(_)) => {
                self.failed += 1;
                self.shorter();
                return Ok(None);
            }
        };
        let (cost, new_cost) = (point.linear.cost, linear.cost);
        let gain = (cost - new_cost) / promised;
        let next = Point::new(x, linear, &self.scaling, &point.scales, bounds);
        if point.cannot_resolve(promised) {
            // The larger of the two sets of scales makes the gradients comparable.
            let before = Point { scales: next.scales.clone(), ..point.clone() }.scaled_gradient();
            if next.scaled_gradient() < 0.5 * before && new_cost <= cost * (1.0 + 1e-10) {
                self.longer(1.0);
                return Ok(Some(next));
            }
            let better = if next.scaled_gradient() < before { Some(next) } else { None };
            let gradient = better.as_ref().unwrap_or(point).cosine();
            self.ended(Outcome::LimitOfPrecision { gradient });
            return Ok(better);
        }
        if gain <= ACCEPT {
            self.shorter();
            return Ok(None);
        }
        self.longer(gain);
        let decrease = (cost - new_cost) / cost;
        if decrease <= self.stop.cost {
            self.ended(Outcome::CostUnchanged { decrease });
        }
        Ok(Some(next))
    }
}
