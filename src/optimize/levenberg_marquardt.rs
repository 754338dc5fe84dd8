//! [`LevenbergMarquardt`]: damped Gauss-Newton steps.

use super::search::{Point, linearize};
use super::{Infeasible, LeastSquares, LeastSquaresState, Linearization, Outcome, Stop};
use crate::scaling::{JacobianColumns, Scaling};
use argmin::core::{Error, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use serde::{Deserialize, Serialize};

/// The method of Levenberg (1944) and Marquardt (1963) with the column scaling of More (1978), in bounds.
///
/// Each iteration tries one step, the minimizer of the linearized sum of squares plus `lambda |D step|^2`, computed from
/// the triangle; the trial brings its slopes along. Bounds are part of that minimization: an unknown that would cross one
/// is put on it, and the others are minimized again. `lambda` falls by up to 10 after a step that kept its promise and
/// grows, ever faster, after one that did not. Where the cost can no longer resolve a step, the slope along the step
/// decides instead. The undamped step decides when to stop, so that heavy damping never looks like a minimum.
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
/// Five trials in a row are enough where the cost has no digits left.
const LAST_GROWTH: f64 = 16.0 * FIRST_GROWTH;
const COST_ROUNDING: f64 = 1e-10;

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
        let ended = point.exact().or_else(|| point.converged(&stop));
        ended.unwrap_or(Outcome::Stalled { gradient: point.cosine(), failed: 0 })
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
        self.outcome = point.exact().or_else(|| point.converged(&self.stop));
        let next = if self.outcome.is_none() { self.attempt(problem, &point, &bounds)? } else { None };
        if self.outcome.is_none() && self.lambda > LARGEST_LAMBDA {
            self.outcome = Some(point.stuck(&self.stop, self.failed));
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
        bounds: &[(f64, f64)],
    ) -> Result<Option<Point>, Error> {
        let damping: Vec<f64> = point.scales.iter().map(|scale| self.lambda.sqrt() * scale).collect();
        let Some(step) = point.linear.step_within(&damping, &point.held, &point.room) else {
            self.shorter();
            return Ok(None);
        };
        let x = point.towards(&step);
        let promised = point.linear.predicted_reduction(&step);
        let unresolved = point.cannot_resolve(promised);
        if x == point.x || unresolved && self.growth > LAST_GROWTH {
            self.outcome = Some(point.stuck(&self.stop, self.failed));
            return Ok(None);
        }
        let linear = match linearize(problem, &x)? {
            Ok(linear) => linear,
            Err(Infeasible::Cancelled) => {
                self.outcome = Some(Outcome::Cancelled);
                return Ok(None);
            }
            Err(Infeasible::Failed(_)) => {
                self.failed += 1;
                self.shorter();
                return Ok(None);
            }
        };
        let (cost, new_cost, size) = (point.linear.cost, linear.cost, point.cost_size());
        let next = Point::new(x, linear, &self.scaling, &point.scales, bounds);
        // Where the cost decides nothing, the slope along the step does: in the metric of the damped step the gradient of
        // a convergent iteration shrinks steadily.
        let (accept, gain) = if unresolved {
            let again = next.linear.step_within(&damping, &next.held, &next.room);
            let part = again.map_or(f64::INFINITY, |again| next.slope(&again) / point.slope(&step));
            (part < 1.0 && new_cost <= cost + COST_ROUNDING * size, if part < 0.25 { 1.0 } else { 0.9 })
        } else {
            let gain = (cost - new_cost) / promised;
            (gain > ACCEPT, gain)
        };
        if !accept || point.loses_influence(&next) {
            self.shorter();
            return Ok(None);
        }
        self.longer(gain);
        let decrease = (cost - new_cost) / size;
        // A step that was short for its damping says nothing of the cost to come.
        if decrease <= self.stop.cost && next.potential <= self.stop.cost * size {
            self.outcome = Some(Outcome::CostUnchanged { decrease });
        }
        Ok(Some(next))
    }
}
