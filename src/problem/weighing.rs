//! [`Weighing`]: weights and loss of each error.

use super::{Accumulate, Objective};
use crate::loss::Loss;
use crate::sweep::Window;

/// Weights and loss, and the cost that they sum up to.
pub(crate) struct Weighing<'o> {
    objective: &'o Objective<'o>,
    experiment: usize,
    loss: Option<&'o dyn Loss>,
    kappa: f64,
    pub cost: f64,
}

impl<'o> Weighing<'o> {
    pub fn new(objective: &'o Objective<'o>, experiment: usize) -> Self {
        let (loss, kappa) = (objective.loss(), objective.problem.kappa);
        Weighing { objective, experiment, loss, kappa, cost: 0.0 }
    }

    /// Adds the cost of a standardized error; returns, for its row and for that of its variance, the factor of the
    /// slopes and the weighted error.
    #[inline]
    pub(crate) fn rows(&mut self, window: &Window, k: usize, j: usize, lane: usize) -> [(f64, f64); 2] {
        let z = window.error(k, j, lane);
        let weight = if self.objective.is_weighted() {
            self.objective.weight(self.experiment, window.begin[lane] + k)
        } else {
            1.0
        };
        self.cost += weight * self.loss.map_or(0.5 * z * z, |loss| loss.rho(z));
        let root = (weight * self.loss.map_or(1.0, |loss| loss.weight(z))).sqrt();
        if !window.has_variances() {
            return [(root, root * z), (0.0, 0.0)];
        }
        self.cost += weight * 0.5 * self.kappa * window.log_variance(k, j, lane);
        let influence = self.loss.map_or(z * z, |loss| loss.psi(z) * z);
        let second = (weight * self.kappa).sqrt();
        [(root, root * z), (second, (influence - self.kappa) * (weight / (2.0 * self.kappa)).sqrt())]
    }
}

impl Accumulate for Weighing<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            for j in 0..window.outputs() {
                if window.is_measured(k, j, lane) {
                    self.rows(window, k, j, lane);
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.cost += later.cost;
    }
}
