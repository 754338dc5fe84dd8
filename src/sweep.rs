//! [`Sweep`]: runs pieces of records through a model, with slopes, and shows the prediction errors window by window.
//!
//! Everything that depends on the model's type, or on how its equations are evaluated, is behind this trait. What asks for
//! passes over the data (search, noise, covariance, diagnoses) is compiled once and sees quantities by position.

mod duals;
mod filtered;
mod loops;
mod programs;
mod window;

pub(crate) use duals::{DualSweep, OVERFLOW};
pub(crate) use loops::Loops;
pub(crate) use programs::{Derived, ProgramSweep};
pub use window::Window;

pub use crate::graph::Seed;

use crate::error::{Error, Failure};
use crate::layout::Layout;
use crate::record::Record;
use std::ops::Range;
use std::sync::Arc;

/// What a sweep made of a record before the search.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// The measured state at each sample, sample by sample, where predictions restart from it; NaN where there is none.
    pub restarts: Vec<f64>,
    /// What programs compute from the record alone.
    pub(crate) derived: Derived,
}

/// A run of samples of a record and what it starts from.
#[derive(Clone, Debug)]
pub struct Piece<'a> {
    /// The record.
    pub record: &'a Record,
    /// What was made of it.
    pub prepared: &'a Prepared,
    /// Its samples.
    pub samples: Range<usize>,
    /// The carry at the first of them.
    pub carry: Vec<f64>,
    /// Slopes of the carry there with respect to the seeds, row by row.
    pub slopes: Vec<f64>,
    /// The parameters.
    pub parameters: &'a [f64],
}

/// Where a piece ended: the carry at the sample after its last one, where there is one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reached {
    /// The carry.
    pub carry: Vec<f64>,
    /// Its slopes with respect to the seeds, row by row.
    pub slopes: Vec<f64>,
}

/// Why a piece was not run to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunError {
    /// The sample that could not be reached or predicted.
    Failed {
        /// Its number.
        sample: usize,
    },
    /// What was shown a window said to stop.
    Stopped,
}

/// How the pieces of one record hang together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joints {
    /// The record must be run as a whole.
    Uncut,
    /// Each sample is predicted from measurements: nothing is carried from piece to piece.
    Restarted,
    /// The carry at the end of a piece is an affine function of that at its begin.
    Affine,
    /// It is some function of it.
    Nonlinear,
}

/// Shown each window; false to stop.
pub type Visit<'v> = &'v mut dyn FnMut(&mut Window) -> bool;

/// What went wrong in an experiment.
pub enum Located {
    /// The simulation broke there.
    Broken(Failure),
    /// It did not break; there its error is largest.
    Largest(Failure),
}

/// A model on its way through records.
pub trait Sweep: Send + Sync {
    /// The model's quantities.
    fn layout(&self) -> &Layout;

    /// How many numbers are carried from sample to sample; the states come first.
    fn carry(&self) -> usize {
        self.layout().states.len()
    }

    /// Whether windows hold variances.
    fn predicts_variance(&self) -> bool {
        false
    }

    /// How many pieces of records like this one it runs side by side; [`run`](Sweep::run) is never given more, nor pieces
    /// of records with different holds or with even and uneven time.
    fn lanes(&self, record: &Record, seeds: &[Seed]) -> usize {
        let _ = (record, seeds);
        1
    }

    /// How the pieces of a record hang together.
    fn joints(&self) -> Joints {
        Joints::Uncut
    }

    /// Looks at a record once, with the parameters at their start.
    ///
    /// # Errors
    /// A record that the predictor cannot serve.
    fn prepare(&self, record: &Record, parameters: &[f64]) -> Result<Prepared, Error> {
        let _ = (record, parameters);
        Ok(Prepared::default())
    }

    /// The carry at the first sample from the initial state, and its slopes with respect to states, then parameters, row by
    /// row.
    fn start(&self, record: &Record, state: &[f64], parameters: &[f64]) -> Reached {
        let _ = record;
        let (n, width) = (state.len(), state.len() + parameters.len());
        let slopes = (0..n * width).map(|at| if at % width == at / width { 1.0 } else { 0.0 }).collect();
        Reached { carry: state.to_vec(), slopes }
    }

    /// Runs pieces side by side and shows each window of them.
    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>>;

    /// The carry at some samples, which rise, of a record that is run from its begin.
    ///
    /// # Errors
    /// Where it could not be run.
    fn follow(&self, piece: &Piece<'_>, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        let mut from = Piece { slopes: vec![], ..piece.clone() };
        let mut found = Vec::with_capacity(at.len());
        for &sample in at {
            from.samples.end = sample;
            if !from.samples.is_empty() {
                let reached = self.run(std::slice::from_ref(&from), &[], &mut |_| true);
                from.carry = reached.into_iter().next().ok_or(RunError::Stopped)??.carry;
            }
            from.samples.start = sample;
            found.push(from.carry.clone());
        }
        Ok(found)
    }

    /// The state that the outputs of a sample give; why not, where there is none. With `alone`, they must not depend on
    /// the parameters besides.
    ///
    /// # Errors
    /// Why the outputs do not give it.
    fn measured_state(
        &self,
        record: &Record,
        sample: usize,
        parameters: &[f64],
        alone: bool,
    ) -> Result<Vec<f64>, String> {
        let _ = (record, sample, parameters, alone);
        Err("the sweep does not solve outputs for states".to_owned())
    }

    /// What exactly fails in a record that cannot be run; `sample` is where it was noticed. The noise levels tell which
    /// error is largest, where nothing fails. It is given up where `stops` says so.
    fn locate(
        &self,
        record: &Record,
        state: &[f64],
        parameters: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Option<Located> {
        let _ = (record, state, parameters, sample, sigma, stops);
        None
    }

    /// The same with a finer step, if there is one.
    fn refined<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> {
        None
    }

    /// The integrator and its settings, in words.
    fn integrator(&self) -> String;

    /// The predictor and its settings, in words.
    fn predictor(&self) -> String;

    /// How the equations are evaluated, and why, in words.
    fn engine(&self) -> String;

    /// Words that tell these equations from others: part of what a checkpoint belongs to.
    fn identity(&self) -> String;
}
