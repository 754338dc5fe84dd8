//! The second derivative of the errors along a direction.

use super::{Accumulate, Objective, Weighing};
use crate::information::{Gathering, Information};
use crate::optimize::{Infeasible, Linearization};
use crate::sweep::Window;

/// Step of the finite difference, as a fraction of the direction (Transtrum and Sethna 2012, section 4).
const FAR: f64 = 0.1;

/// Standardized errors of an experiment, sample by sample, output by output.
struct Errors(Vec<f64>);

impl Accumulate for Errors {
    fn add(&mut self, window: &Window, lane: usize) {
        let entries = (0..window.samples[lane]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j)));
        self.0.extend(entries.map(|(k, j)| window.error(k, j, lane)));
    }

    fn append(&mut self, later: Self) {
        self.0.extend(later.0);
    }
}

/// Rows of slopes and second derivatives of an experiment.
struct SecondRows<'o> {
    weighing: Weighing<'o>,
    along: Vec<f64>,
    beyond: &'o [f64],
    outputs: usize,
    row: Vec<f64>,
    rows: Gathering,
}

impl Accumulate for SecondRows<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane)) {
                let [(root, _), _] = self.weighing.rows(window, k, j, lane);
                let slopes = window.row(k, j).iter().skip(lane).step_by(window.lanes());
                self.row.iter_mut().zip(slopes).for_each(|(to, slope)| *to = *slope);
                let beyond = self.beyond[(window.begin[lane] + k) * self.outputs + j];
                let second = second(window.error(k, j, lane), beyond, &self.row, &self.along);
                self.row.iter_mut().for_each(|slope| *slope *= root);
                self.rows.take(&self.row, root * second);
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.rows.append(later.rows);
    }
}

/// The second derivative of an error along a direction, by the error there and further along, and the slopes of the
/// prediction.
fn second(here: f64, beyond: f64, slopes: &[f64], along: &[f64]) -> f64 {
    let slope: f64 = slopes.iter().zip(along).map(|(slope, along)| slope * along).sum();
    2.0 / (FAR * FAR) * (beyond - here + FAR * slope)
}

impl Objective<'_> {
    /// Slopes at a point, and in the place of the errors their second derivatives along a direction: by the errors a
    /// tenth of the direction away, with the slopes. Not for predicted variances.
    pub(crate) fn second_along(&self, x: &[f64], along: &[f64]) -> Result<Linearization, Infeasible> {
        let unknowns = &self.problem.unknowns;
        let far: Vec<f64> = x.iter().zip(along).map(|(x, along)| x + FAR * along).collect();
        let beyond = self.gather(&far, false, |_| Errors(vec![]))?;
        let make = |e: usize| {
            let along: Vec<f64> = unknowns.columns(e).map(|i| along[i]).collect();
            let columns = along.len();
            SecondRows {
                weighing: Weighing::new(self, e),
                along,
                beyond: &beyond[e].0,
                outputs: self.outputs(),
                row: vec![0.0; columns],
                rows: Gathering::new(columns),
            }
        };
        let all = self.gather(x, true, make)?.into_iter();
        let mut blocks: Vec<Information> = all.map(|one| one.rows.triangle()).collect();
        for ((i, slope, error), (_, _, beyond)) in unknowns.priors(x).zip(unknowns.priors(&far)) {
            let e = unknowns.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect();
            blocks[e].absorb_row(&row, second(error, beyond, &[slope], &along[i..=i]));
        }
        let cost = blocks.iter().map(|block| 0.5 * block.residual_at_zero()).sum();
        Ok(Linearization::new(cost, unknowns.shared(), blocks))
    }
}
