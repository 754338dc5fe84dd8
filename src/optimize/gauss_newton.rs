//! [`GaussNewton`]: full steps, shortened by a line search.

use super::search::{Point, linearize};
use super::{Infeasible, LeastSquares, LeastSquaresState, Linearization, Outcome, Stop};
use crate::scaling::JacobianColumns;
use argmin::core::{Error, KV, Problem, Solver, State, TerminationReason, TerminationStatus};
use serde::{Deserialize, Serialize};

/// The method of Gauss and Newton with a backtracking line search (Nocedal and Wright, *Numerical Optimization*, 2006,
/// sections 3.1 and 10.3), in bounds.
///
/// Each iteration takes the minimizer of the linearized sum of squares and halves it until the cost falls by a part of
/// what was promised (Armijo). Fast near a well-determined minimum; [`LevenbergMarquardt`](super::LevenbergMarquardt) is
/// the safer choice elsewhere. Directions that the data do not determine are damped by 1e-8. Bounds are part of the
/// linearized minimization.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GaussNewton {
    /// When to stop.
    pub stop: Stop,
    outcome: Option<Outcome>,
    #[serde(skip)]
    point: Option<Point>,
}

const SUFFICIENT: f64 = 1e-4;
const HALVINGS: u32 = 60;
/// Fewer are enough where the cost has no digits left.
const LAST_HALVINGS: u32 = 10;

impl GaussNewton {
    /// A search with this rule to stop.
    pub fn new(stop: Stop) -> Self {
        GaussNewton { stop, outcome: None, point: None }
    }

    /// How the search ended; `None` while it runs, or if argmin stopped it (iterations, time, target cost).
    pub fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }

    /// Cost and slopes where the search stands; `None` before it began.
    pub fn linearization(&self) -> Option<&Linearization> {
        self.point.as_ref().map(|point| &point.linear)
    }
}

impl Default for GaussNewton {
    fn default() -> Self {
        GaussNewton::new(Stop::default())
    }
}

impl<O: LeastSquares> Solver<O, LeastSquaresState> for GaussNewton {
    fn name(&self) -> &str {
        "Gauss-Newton"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: LeastSquaresState,
    ) -> Result<(LeastSquaresState, Option<KV>), Error> {
        let x = state.take_param().ok_or_else(|| Error::msg("Gauss-Newton needs an initial parameter vector"))?;
        let linear = linearize(problem, &x)??;
        let bounds = problem.problem("bounds_count", |problem| Ok(problem.bounds()))?;
        let point = Point::new(x.clone(), linear, &JacobianColumns, &[], &bounds);
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
            None => {
                let x = state.get_param().cloned().unwrap_or_default();
                let linear = linearize(problem, &x)??;
                Point::new(x, linear, &JacobianColumns, &[], &bounds)
            }
        };
        self.outcome = point.exact().or_else(|| point.converged(&self.stop));
        let next = if self.outcome.is_none() { self.search(problem, &point, &bounds)? } else { None };
        let point = next.unwrap_or(point);
        let log = argmin::kv!("gradient" => point.cosine(););
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

impl GaussNewton {
    /// The first point along the step that lowers the cost enough; `None` once the search has ended.
    fn search<O: LeastSquares>(
        &mut self,
        problem: &mut Problem<O>,
        point: &Point,
        bounds: &[(f64, f64)],
    ) -> Result<Option<Point>, Error> {
        let (cost, size) = (point.linear.cost, point.cost_size());
        let mut step = point.full.clone().unwrap_or_default();
        let mut failed = 0;
        let mut blind = 0;
        for _ in 0..HALVINGS {
            let x = point.towards(&step);
            let slope = point.slope(&step);
            let unresolved = point.cannot_resolve(-slope);
            blind += u32::from(unresolved);
            if x == point.x || blind > LAST_HALVINGS {
                break;
            }
            match linearize(problem, &x)? {
                Err(Infeasible::Cancelled) => {
                    self.outcome = Some(Outcome::Cancelled);
                    return Ok(None);
                }
                Err(Infeasible::Failed(_)) => failed += 1,
                Ok(linear) => {
                    let decrease = cost - linear.cost;
                    let next = Point::new(x, linear, &JacobianColumns, &[], bounds);
                    // Where the cost decides nothing, what the full step would still gain does.
                    let enough = match unresolved {
                        true => next.potential < point.potential,
                        false => decrease > 0.0 && decrease >= -SUFFICIENT * slope,
                    };
                    if enough && !point.loses_influence(&next) {
                        if decrease <= self.stop.cost * size && next.potential <= self.stop.cost * size {
                            self.outcome = Some(Outcome::CostUnchanged { decrease: decrease / size });
                        }
                        return Ok(Some(next));
                    }
                }
            }
            step.iter_mut().for_each(|d| *d *= 0.5);
        }
        self.outcome = Some(point.stuck(&self.stop, failed));
        Ok(None)
    }
}
