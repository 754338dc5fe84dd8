//! Parts of the inverse curvature and rows of one experiment.

use crate::information::Covariance;
use crate::problem::Objective;
use nalgebra::DMatrix;

/// One less the leverage of a measurement that alone determines an unknown: its error is rounding.
pub(crate) const ALONE: f64 = 1e-6;

/// The least that one less the leverage counts as where errors are divided by it: `1/26` for a measurement that the others predict with
/// five times its noise, rounded.
pub(crate) const LEAST: f64 = 0.04;

/// The rows and columns of one experiment.
pub(crate) fn of_experiment(objective: &Objective<'_>, covariance: &Covariance, e: usize) -> DMatrix<f64> {
    let columns: Vec<usize> = objective.problem.unknowns.columns(e).collect();
    DMatrix::from(&covariance.dense(&columns))
}

/// `v' m v`.
pub(crate) fn form(m: &DMatrix<f64>, v: &[f64]) -> f64 {
    let product =
        |(column, b): (nalgebra::DVectorView<'_, f64>, &f64)| column.iter().zip(v).map(|(m, a)| m * a).sum::<f64>() * b;
    m.column_iter().zip(v).map(product).sum()
}
