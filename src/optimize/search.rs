//! [`Point`]: where a search stands, and the tests that both solvers share.

use super::{Infeasible, LeastSquares, Linearization, Outcome, Stop};
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
}

/// A cost cannot tell apart points that differ by less than this part of it.
const RESOLUTION: f64 = 1e-13;

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
        // Held: what has no influence, and what sits on a bound that it would cross.
        let held = (0..x.len())
            .map(|i| {
                let (lower, upper) = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
                norms[i] == 0.0 || (x[i] <= lower && gradient[i] >= 0.0) || (x[i] >= upper && gradient[i] <= 0.0)
            })
            .collect();
        Point { x, linear, gradient, norms, scales, held }
    }

    /// Largest cosine between the residual and a free column of the Jacobian.
    pub fn cosine(&self) -> f64 {
        let residual = self.linear.sum_of_squares().sqrt();
        let free = (0..self.x.len()).filter(|&i| !self.held[i]);
        free.map(|i| self.gradient[i].abs() / (self.norms[i] * residual)).fold(0.0, f64::max)
    }

    /// Norm of the free gradient, each component by its scale.
    pub fn scaled_gradient(&self) -> f64 {
        let free = (0..self.x.len()).filter(|&i| !self.held[i]);
        free.map(|i| (self.gradient[i] / self.scales[i]).powi(2)).sum::<f64>().sqrt()
    }

    /// Largest part of itself, or of the standard error it has at least, by which an unknown moves along a step.
    pub fn relative_size(&self, step: &[f64]) -> f64 {
        let rows: u64 = self.linear.blocks().iter().map(|block| block.rows()).sum();
        let sigma = (self.linear.sum_of_squares() / rows.max(1) as f64).sqrt();
        let free = (0..self.x.len()).filter(|&i| !self.held[i] && step[i] != 0.0);
        free.map(|i| step[i].abs() / (self.x[i].abs() + sigma / self.norms[i])).fold(0.0, f64::max)
    }

    /// The step towards `x + step`, cut at the bounds.
    pub fn towards(&self, step: &[f64], bounds: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = (0..self.x.len())
            .map(|i| {
                let (lower, upper) = bounds.get(i).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
                (self.x[i] + step[i]).max(lower).min(upper)
            })
            .collect();
        let step = x.iter().zip(&self.x).map(|(new, old)| new - old).collect();
        (x, step)
    }

    /// Whether a decrease of this size drowns in the rounding of the cost.
    pub fn cannot_resolve(&self, decrease: f64) -> bool {
        decrease <= RESOLUTION * self.linear.cost
    }

    /// Whether there is anything left to do.
    pub fn exact(&self) -> Option<Outcome> {
        let nothing_left = self.linear.cost == 0.0 || self.held.iter().all(|&held| held) && !self.held.is_empty();
        match nothing_left {
            true if self.linear.cost == 0.0 => Some(Outcome::Exact),
            true => Some(Outcome::Converged { step: 0.0, gradient: 0.0 }),
            false => None,
        }
    }

    /// Whether a step this small, from here, ends the search.
    pub fn converged(&self, step: &[f64], stop: &Stop) -> Option<Outcome> {
        let (step, gradient) = (self.relative_size(step), self.cosine());
        (step <= stop.step && gradient <= stop.gradient).then_some(Outcome::Converged { step, gradient })
    }
}
