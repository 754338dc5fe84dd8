//! The states of a record at given values of its unknowns.

use super::{Objective, Values};
use crate::error::Error;
use crate::sweep::{Reached, States};

impl Objective<'_> {
    /// The states of one record, filtered or smoothed.
    pub(crate) fn states(&self, e: usize, coordinates: &[f64], smoothed: bool) -> Result<States, Error> {
        let record = &self.problem.records[e];
        let Values { x, p } = self.problem.unknowns.of_experiment(e, coordinates);
        let refused = |none| self.problem.unknowns.no_start(self.sweep.layout(), record, e, none);
        let Reached { carry, .. } = self.sweep.start(record, &x, &p).map_err(refused)?;
        match self.sweep.states(record, &carry, &p, smoothed) {
            Some(found) => found.map_err(|sample| Error::Simulation(self.locate(e, coordinates, sample))),
            None => Err(Error::NotFiltered { predictor: self.sweep.predictor() }),
        }
    }
}
