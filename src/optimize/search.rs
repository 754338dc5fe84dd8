//! [`Point`]: where a search stands, and the tests that both solvers share.
//!
//! Near a minimum the cost has half the digits of the unknowns: it cannot tell points apart that differ by 1e-8 of what
//! the data resolve. There the length of the residual's projection on the Jacobian's columns decides, which is what Bates
//! and Watts (Technometrics 23 (1981) 179) call the relative offset; unlike the gradient it weighs all directions alike.

use super::{Infeasible, LeastSquares, Linearization, Outcome, PRECISION_GRADIENT, Stop};
use crate::scaling::Scaling;
use argmin::core::{Error, Problem};

/// Where a search stands.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub x: Vec<f64>,
    pub linear: Linearization,
    pub gradient: Vec<f64>,
    pub norms: Vec<f64>,
    pub scales: Vec<f64>,
    pub held: Vec<bool>,
    /// How far each unknown may move, down and up.
    pub room: Vec<(f64, f64)>,
    bounds: Vec<(f64, f64)>,
    /// The undamped step; damped by 1e-8 where the data do not determine it.
    pub full: Option<Vec<f64>>,
    /// By how much the full step would lower the cost, if the slopes held.
    pub potential: f64,
}

/// A cost cannot tell apart points that differ by less than this part of it.
const RESOLUTION: f64 = 1e-13;
/// A step that shrinks a column of the Jacobian to less than this part went too far.
const LOST: f64 = 1e-10;
/// Damping of undetermined directions, relative to the column norms.
const RANK_DAMPING: f64 = 1e-8;

/// Evaluates a point, counting the evaluation. The outer error is the optimizer's, the inner one the problem's.
pub(super) fn linearize<O: LeastSquares>(
    problem: &mut Problem<O>,
    x: &[f64],
) -> Result<Result<Linearization, Infeasible>, Error> {
    problem.problem("linearization_count", |problem| Ok(problem.linearize(x)))
}

impl Point {
    pub fn new(
        x: Vec<f64>,
        linear: Linearization,
        scaling: &impl Scaling,
        before: &[f64],
        bounds: &[(f64, f64)],
    ) -> Self {
        let (gradient, norms) = (linear.gradient(), linear.column_norms());
        let mut scales = scaling.scales(before, &x, &norms);
        scales.resize(x.len(), 1.0);
        for scale in &mut scales {
            if !(*scale > 0.0 && scale.is_finite()) {
                *scale = 1.0;
            }
        }
        let mut bounds = bounds.to_vec();
        bounds.resize(x.len(), (f64::NEG_INFINITY, f64::INFINITY));
        let room: Vec<(f64, f64)> = bounds.iter().zip(&x).map(|(bound, x)| (bound.0 - x, bound.1 - x)).collect();
        // Held: what has no influence, and what sits on a bound that it would cross.
        let on_bound = |i: usize| room[i].0 >= 0.0 && gradient[i] >= 0.0 || room[i].1 <= 0.0 && gradient[i] <= 0.0;
        let held: Vec<bool> = (0..x.len()).map(|i| norms[i] == 0.0 || on_bound(i)).collect();
        let damping: Vec<f64> = norms.iter().map(|norm| RANK_DAMPING * norm).collect();
        let undamped = linear.step_within(&vec![0.0; x.len()], &held, &room);
        let full = undamped.or_else(|| linear.step_within(&damping, &held, &room));
        let potential = full.as_ref().map_or(f64::INFINITY, |step| linear.predicted_reduction(step));
        Point { x, linear, gradient, norms, scales, held, room, bounds, full, potential }
    }

    /// Largest cosine between the residual and a free column of the Jacobian.
    pub fn cosine(&self) -> f64 {
        let residual = self.linear.sum_of_squares().sqrt();
        let free = (0..self.x.len()).filter(|&i| !self.held[i]);
        free.map(|i| self.gradient[i].abs() / (self.norms[i] * residual)).fold(0.0, f64::max)
    }

    /// Largest part of itself, or of the standard error it has at least, by which the full step moves an unknown.
    fn relative_step(&self) -> f64 {
        let rows = self.linear.rows();
        let sigma = (self.linear.sum_of_squares() / rows.max(1) as f64).sqrt();
        let size = |step: &Vec<f64>| {
            let free = (0..self.x.len()).filter(|&i| !self.held[i] && step[i] != 0.0);
            free.map(|i| step[i].abs() / (self.x[i].abs() + sigma / self.norms[i])).fold(0.0, f64::max)
        };
        self.full.as_ref().map_or(f64::INFINITY, size)
    }

    /// Slope of the cost along a step; negative downhill.
    pub fn slope(&self, step: &[f64]) -> f64 {
        self.gradient.iter().zip(step).map(|(g, d)| g * d).sum()
    }

    /// `x + step`, exactly on the bound where the step uses up the room.
    pub fn towards(&self, step: &[f64]) -> Vec<f64> {
        let along = |i: usize| {
            let ((down, up), (lower, upper)) = (self.room[i], self.bounds[i]);
            match step[i] {
                step if step <= down => lower,
                step if step >= up => upper,
                // Not `clamp`, which panics where the bounds are out of order.
                step => (self.x[i] + step).max(lower).min(upper),
            }
        };
        (0..self.x.len()).map(along).collect()
    }

    /// Size of the terms of the cost, by which its changes are measured. Where variances are predicted, their logarithms
    /// may leave a sum that is negative or next to zero.
    pub fn cost_size(&self) -> f64 {
        self.linear.cost.abs().max(0.5 * self.linear.sum_of_squares())
    }

    /// Whether a decrease of this size drowns in the rounding of the cost.
    pub fn cannot_resolve(&self, decrease: f64) -> bool {
        decrease <= RESOLUTION * self.cost_size()
    }

    /// Whether an unknown that had influence here has none there: a plateau that no slope leads back from.
    pub fn loses_influence(&self, next: &Point) -> bool {
        self.norms.iter().zip(&next.norms).any(|(before, after)| *after < LOST * before)
    }

    /// Whether there is anything left to do.
    pub fn exact(&self) -> Option<Outcome> {
        // How far the rounding of the unknowns moves the prediction; the square of it, to be exact.
        let rounding: f64 = self.x.iter().zip(&self.norms).map(|(x, norm)| (f64::EPSILON * x * norm).powi(2)).sum();
        let left = self.linear.sum_of_squares();
        if self.linear.cost == 0.0 || left > 0.0 && left <= rounding {
            return Some(Outcome::Exact);
        }
        if self.norms.iter().all(|&norm| norm == 0.0) {
            return Some(Outcome::Stalled { gradient: 0.0, failed: 0 });
        }
        self.held.iter().all(|&held| held).then_some(Outcome::Converged { step: 0.0, gradient: 0.0 })
    }

    /// Whether the full step, from here, is negligible. (A damped one may be short for its damping alone.)
    pub fn converged(&self, stop: &Stop) -> Option<Outcome> {
        let (step, gradient) = (self.relative_step(), self.cosine());
        (step <= stop.step && gradient <= stop.gradient).then_some(Outcome::Converged { step, gradient })
    }

    /// How a search ends here that no step leads away from. Where the residual is next to rounding, its cosine is
    /// arbitrary, and the step alone tells.
    pub fn stuck(&self, stop: &Stop, failed: u64) -> Outcome {
        let (step, gradient) = (self.relative_step(), self.cosine());
        if step <= stop.step {
            Outcome::Converged { step, gradient }
        } else if gradient <= PRECISION_GRADIENT {
            Outcome::LimitOfPrecision { gradient }
        } else {
            Outcome::Stalled { gradient, failed }
        }
    }
}
