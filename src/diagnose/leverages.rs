//! The leverage of each measurement: how much of its own value its prediction takes over.

use crate::covariance::leverage::{form, of_experiment};
use crate::covariance::sandwich::Bread;
use crate::problem::{Accumulate, Objective, Whitening};
use crate::sweep::Window;
use nalgebra::DMatrix;

/// The leverage of each measurement in a weighted fit, by experiment: sample by sample, output by output; zero where nothing was measured.
/// `None` if the curvature has no inverse. Unknowns that are `held` have no part in it; noise that outputs share is left out.
pub(super) fn leverages(objective: &Objective<'_>, coordinates: &[f64], held: &[bool]) -> Option<Vec<Vec<f64>>> {
    let objective = &objective.with(Whitening::Diagonal(objective.whitening.sigma()));
    let bread = Bread::weighted(objective, coordinates)?;
    let inverse = bread.linear.covariance(held)?;
    let make = |experiment: usize| {
        let inverse = of_experiment(objective, &inverse, experiment);
        Leverages { objective, experiment, slopes: vec![0.0; inverse.nrows()], inverse, found: vec![] }
    };
    Some(objective.gather(coordinates, true, make).ok()?.into_iter().map(|one| one.found).collect())
}

/// Those of one experiment.
struct Leverages<'l> {
    objective: &'l Objective<'l>,
    experiment: usize,
    inverse: DMatrix<f64>,
    slopes: Vec<f64>,
    found: Vec<f64>,
}

impl Accumulate for Leverages<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            for j in 0..window.outputs() {
                let row = window.row(k, j).iter().skip(lane).step_by(window.lanes());
                self.slopes.iter_mut().zip(row).for_each(|(to, from)| *to = *from);
                let measured = weight > 0.0 && window.is_measured(k, j, lane);
                self.found.push(if measured { weight * form(&self.inverse, &self.slopes) } else { 0.0 });
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.found.extend(later.found);
    }
}
