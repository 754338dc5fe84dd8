use super::Spans;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::model::Model;
use crate::pmsm::{CompensatedDrive, Currents};
use crate::record::Time;

impl Spans {
    /// The record as a [`Compensated`](crate::pmsm::Compensated) motor in exact steps needs it, for a fit of simulated to
    /// measured currents (thesis 5.2.3): `i0` (A) is the current at which the dead time turns over.
    ///
    /// # Errors
    /// As [`Experiment::new`].
    pub fn grey_box<M>(&self, model: &M, i0: f64) -> Result<Experiment<Currents, CompensatedDrive, Currents>, Error>
    where
        M: Model<State = Currents, Input = CompensatedDrive, Output = Currents>,
    {
        let (inputs, outputs) = self
            .spans
            .iter()
            .map(|span| {
                let (lost_d, lost_q) = span.mean().dead_time(i0, self.pole_pairs.electrical(span.theta));
                let u = CompensatedDrive { ud: span.ud, uq: span.uq, w: span.w, theta: span.theta, lost_d, lost_q };
                (u, span.i0)
            })
            .unzip();
        Experiment::new(model, Time::Uniform { start: 0.0, step: self.ts }, inputs, outputs)
    }
}
