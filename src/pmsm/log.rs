//! The record of a run of a drive.

use super::{Currents, Drive, MachineState, Surface};
use crate::experiment::Experiment;
use crate::record::Time;
use serde::{Deserialize, Serialize};

/// One sample of a drive's log, with the plant's true state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Commanded voltage along the flux that acts from this sample to the next (V).
    pub ud: f64,
    /// Commanded voltage 90 electrical degrees ahead, likewise (V).
    pub uq: f64,
    /// Speed: the angle's difference from the sample before, over the sample time (rad/s, mechanical).
    pub w: f64,
    /// Measured current along the flux (A).
    pub id: f64,
    /// Measured current 90 electrical degrees ahead (A).
    pub iq: f64,
    /// Measured angle (rad, mechanical, not wrapped).
    pub theta: f64,
    /// Reference of iq (A).
    pub iq_ref: f64,
    /// Reference of the speed (rad/s).
    pub w_ref: f64,
    /// The plant's true motion.
    pub truth: MachineState,
}

/// The record of a run of a drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// Sample time (s).
    pub ts: f64,
    /// One row per sample.
    pub rows: Vec<Row>,
    /// Samples in which the voltage was at its limit.
    pub voltage_limited: usize,
    /// Samples in which the current reference was at its limit.
    pub current_limited: usize,
}

impl Log {
    /// The record for identification: voltages held from sample to sample, the *mean* speed of the same interval
    /// (the difference of the angles at its two ends), currents at its begin. The last row, which has no interval, is left
    /// out.
    ///
    /// # Errors
    /// Fewer than two rows; rows that are not finite.
    pub fn experiment(&self, model: &Surface) -> Result<Experiment<Currents, Drive, Currents>, crate::Error> {
        let (inputs, outputs) = self
            .rows
            .windows(2)
            .map(|pair| {
                (Drive { ud: pair[0].ud, uq: pair[0].uq, w: pair[1].w }, Currents { id: pair[0].id, iq: pair[0].iq })
            })
            .unzip();
        Experiment::new(model, Time::Uniform { start: 0.0, step: self.ts }, inputs, outputs)
    }

    /// Causes why the drive did not follow its references, a sentence each. The record stays good for identification: it holds
    /// what acted.
    pub fn warnings(&self) -> Vec<String> {
        let of = self.rows.len();
        let mut warnings = vec![];
        if self.voltage_limited > 0 {
            warnings.push(format!(
                "the voltage was at its limit in {} of {of} samples: the EMF leaves too little for the current asked for; \
                 go slower, weaken the field or raise the direct voltage",
                self.voltage_limited
            ));
        }
        if self.current_limited > 0 {
            warnings.push(format!(
                "the current reference was at its limit in {} of {of} samples: the torque asked for cannot be made; \
                 accelerate less",
                self.current_limited
            ));
        }
        warnings
    }
}
