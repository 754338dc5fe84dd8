//! Correlation of errors a horizon apart, of predictions that restart from measured states.
//!
//! Noise in a measured state is in the error at that sample, and with the opposite sign in the error of the prediction that restarts there.
//! The unknowns take a part of what follows from one error to the next, since predictions are made from the same measurements: the
//! plain autocorrelation is small where they are drawn off most. The error a horizon before is therefore one more unknown beside all
//! others (Breusch, Australian Economic Papers 17 (1978) 334; Godfrey, Econometrica 46 (1978) 1293).

use super::*;
use crate::covariance::directions::undetermined;
use crate::information::{Gathering, Information};
use crate::optimize::Linearization;
use crate::problem::Accumulate;
use crate::sweep::Window;
use std::collections::VecDeque;

/// Longest horizon over which errors are correlated.
const LONGEST: usize = 100;

/// The rows of an experiment, each with the error of the same output a horizon before behind the slopes.
struct Rows<'r> {
    objective: &'r Objective<'r>,
    experiment: usize,
    steps: usize,
    /// The last errors of each output, a horizon long; missing ones are not numbers.
    before: Vec<VecDeque<f64>>,
    rows: Gathering,
    row: Vec<f64>,
}

impl<'r> Rows<'r> {
    fn new(objective: &'r Objective<'r>, experiment: usize, steps: usize) -> Self {
        let (outputs, unknowns) = (objective.outputs(), objective.problem.unknowns.columns(experiment).count());
        let columns = unknowns + outputs;
        let before = vec![VecDeque::with_capacity(steps + 1); outputs];
        Rows { objective, experiment, steps, before, rows: Gathering::new(columns), row: vec![0.0; columns] }
    }
}

impl Accumulate for Rows<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let outputs = window.outputs();
        let unknowns = self.row.len() - outputs;
        for (k, j) in (0..window.samples[lane]).flat_map(|k| (0..outputs).map(move |j| (k, j))) {
            let error = if window.is_measured(k, j, lane) { window.error(k, j, lane) } else { f64::NAN };
            let before = &mut self.before[j];
            before.push_back(error);
            let Some(last) = (before.len() > self.steps).then(|| before.pop_front()).flatten() else { continue };
            // As in iteratively reweighted least squares, whose minimum is that of the loss.
            let by_loss = self.objective.loss().map_or(1.0, |loss| loss.weight(error));
            let root = (self.objective.weight(self.experiment, window.begin[lane] + k) * by_loss).sqrt();
            if error.is_nan() || last.is_nan() || root == 0.0 {
                continue;
            }
            let (of_unknowns, of_errors) = self.row.split_at_mut(unknowns);
            of_unknowns.iter_mut().enumerate().for_each(|(c, to)| *to = root * window.at(k, j, c, lane));
            of_errors.fill(0.0);
            of_errors[j] = root * last;
            self.rows.take(&self.row, root * error);
        }
    }

    fn append(&mut self, later: Self) {
        self.rows.append(later.rows);
        self.before = later.before;
    }
}

/// Of each output the coefficient of the error a horizon before, and that over its standard error; `None` where predictions do not restart, or
/// from too far, and where it is not determined beside the unknowns.
pub(crate) fn correlations(evidence: &Evidence<'_>, steps: usize) -> Option<Vec<(f64, f64)>> {
    let objective = evidence.point.objective;
    let (unknowns, outputs) = (&objective.problem.unknowns, objective.outputs());
    if steps > LONGEST {
        return None;
    }
    let all = objective.gather(&evidence.point.end.coordinates, true, |e| Rows::new(objective, e, steps)).ok()?;
    let mut triangles: Vec<Information> = all.into_iter().map(|one| one.rows.triangle()).collect();
    unknowns.add_priors(&evidence.point.end.coordinates, 1.0, &mut triangles);
    let linear = Linearization::new(0.0, unknowns.shared() + outputs, triangles);
    // The coefficients stand behind the shared unknowns.
    let mut held = evidence.point.undetermined.held.clone();
    held.splice(unknowns.shared()..unknowns.shared(), vec![false; outputs]);
    let held = undetermined(&linear, &held).held;
    let (step, unit) = (linear.step(&vec![0.0; held.len()], &held)?, linear.covariance(&held)?);
    let free = held.iter().filter(|held| !**held).count() as f64;
    let left = linear.sum_of_squares() - 2.0 * linear.predicted_reduction(&step);
    let deviation = (left / (linear.rows() as f64 - free)).sqrt();
    let one = |j: usize| {
        let place = unknowns.shared() + j;
        let found = (step[place], step[place] / (unit.standard_error(place) * deviation));
        if !held[place] && found.1.is_finite() { found } else { (0.0, 0.0) }
    };
    Some((0..outputs).map(one).collect())
}
