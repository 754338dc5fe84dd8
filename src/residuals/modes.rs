//! Eigenvalues of the model about some points along the records.

use crate::problem::Objective;
use nalgebra::{Complex, DMatrix, Schur};

/// Number of points that are examined.
const POINTS: usize = 8;
const ITERATIONS: usize = 10_000;

/// The state at a sample of an experiment.
pub(crate) struct StateAt {
    pub experiment: usize,
    pub sample: usize,
    pub state: Vec<f64>,
}

/// Those of the points that are examined.
pub(crate) fn some(points: &[StateAt]) -> impl Iterator<Item = &StateAt> {
    points.iter().step_by(points.len().div_ceil(POINTS).max(1))
}

/// The eigenvalues of the state's Jacobian at a point (1/s).
pub(crate) fn eigenvalues(objective: &Objective<'_>, coordinates: &[f64], at: &StateAt) -> Option<Vec<Complex<f64>>> {
    let StateAt { experiment, sample, state } = at;
    let (record, n) = (&objective.problem.records[*experiment], state.len());
    let parameters = objective.problem.unknowns.of_experiment(*experiment, coordinates).p;
    let slopes = objective.sweep.state_slopes(record, *sample, state, &parameters)?;
    if !slopes.iter().all(|slope| slope.is_finite()) {
        return None;
    }
    let schur = Schur::try_new(DMatrix::from_row_slice(n, n, &slopes), f64::EPSILON, ITERATIONS)?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}
