//! Cost and triangles of an objective.

use super::pass::Job;
use super::{Accumulate, Objective, each};
use crate::information::{Block, Information};
use crate::loss::Loss;
use crate::optimize::{Infeasible, Linearization};
use crate::sweep::{RunError, Window};

/// Rows that are absorbed together.
const ROWS: usize = 256;

impl Objective<'_> {
    /// Cost and triangles of all experiments and the priors.
    pub(crate) fn evaluate(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let values = self.values(coordinates);
        let one = |e: usize| {
            let job = self.job(e, &values[e], coordinates, true);
            self.triangle(&job).map_err(|error| self.infeasible(e, coordinates, error))
        };
        let (mut cost, mut blocks) = (0.0, Vec::with_capacity(self.experiments()));
        for result in each(self.experiments(), one) {
            let (part, information) = result?;
            cost += part;
            blocks.push(information);
        }
        for (i, slope, error) in self.problem.unknowns.priors(coordinates) {
            let e = self.problem.unknowns.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = self.problem.unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect();
            blocks[e].absorb_row(&row, error);
            cost += 0.5 * error * error;
        }
        Ok(Linearization::new(cost, self.problem.unknowns.shared(), blocks))
    }

    /// Cost and triangle of one experiment, priors left out.
    fn triangle(&self, job: &Job<'_>) -> Result<(f64, Information), RunError> {
        let columns = job.seeds.len();
        let mut information = Information::new(columns);
        let mut block = Block::new(columns, ROWS);
        let mut weighing = Weighing::new(self, job.experiment);
        let mut row = vec![0.0; columns];
        self.run(std::slice::from_ref(job), &mut |window| {
            for k in 0..window.samples[0] {
                for j in 0..window.outputs() {
                    if !window.is_measured(k, j, 0) {
                        continue;
                    }
                    let [(root, error), second] = weighing.rows(window, k, j, 0);
                    let values = window.row(k, j);
                    row.iter_mut().zip(values).for_each(|(to, from)| *to = from * root);
                    information.gather(&mut block, &row, error);
                    if window.has_variances() {
                        let (root, error) = second;
                        let values = window.variance_row(k, j);
                        row.iter_mut().zip(values).for_each(|(to, from)| *to = from * root);
                        information.gather(&mut block, &row, error);
                    }
                }
            }
        })?;
        information.absorb(&mut block);
        let cost = weighing.cost;
        if !cost.is_finite() || information.column_norms().iter().any(|norm| !norm.is_finite()) {
            return Err(RunError::Failed { sample: job.piece.samples.start });
        }
        Ok((cost, information))
    }

    /// The cost of one experiment alone, priors left out.
    pub(crate) fn cost_of(&self, e: usize, coordinates: &[f64]) -> Result<f64, Infeasible> {
        self.gather_one(coordinates, e, Weighing::new(self, e)).map(|weighing| weighing.cost)
    }

    /// The cost alone.
    pub(crate) fn cost_at(&self, coordinates: &[f64]) -> Result<f64, Infeasible> {
        let found = self.gather(coordinates, false, |experiment| Weighing::new(self, experiment))?;
        let priors = self.problem.unknowns.priors(coordinates).map(|(_, _, error)| 0.5 * error * error);
        Ok(found.iter().map(|weighing| weighing.cost).sum::<f64>() + priors.sum::<f64>())
    }
}

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

    /// Counts the cost of a standardized error; for its row, and for that of its variance, the factor of the slopes and
    /// the weighted error.
    #[inline]
    pub(super) fn rows(&mut self, window: &Window, k: usize, j: usize, lane: usize) -> [(f64, f64); 2] {
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
        let number = (k * window.outputs() + j) * window.lanes() + lane;
        self.cost += weight * 0.5 * self.kappa * window.log_variances[number];
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
}
