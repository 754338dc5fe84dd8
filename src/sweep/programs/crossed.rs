//! [`Crossed`]: the transition of linear equations in the lanes of a program.

use crate::equations::Linear;
use crate::record::Time;
use crate::sweep::Piece;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Linear equations, and the numbers that were computed last: the pieces of a record share them.
pub(super) struct Crossed {
    linear: Linear,
    last: Mutex<Known>,
}

/// Parameters, the length of an interval (s), and the numbers that follow.
#[derive(Default)]
struct Known {
    parameters: Vec<f64>,
    step: f64,
    numbers: Arc<Vec<f64>>,
}

impl Known {
    /// The numbers, if they are those of these parameters and this interval.
    fn numbers_of(&self, parameters: &[f64], step: f64) -> Option<Arc<Vec<f64>>> {
        (self.step == step && self.parameters == parameters).then(|| self.numbers.clone())
    }
}

impl Crossed {
    pub fn new(linear: Linear) -> Self {
        Crossed { linear, last: Mutex::default() }
    }

    /// The parameters of a piece as its program has them: after them what follows from them and the time between two samples.
    pub fn parameters(&self, piece: &Piece<'_>) -> Arc<Vec<f64>> {
        let step = if let Time::Uniform { step, .. } = piece.record.times() { *step } else { f64::NAN };
        let known = self.last().numbers_of(piece.parameters, step);
        known.unwrap_or_else(|| {
            // Without the lock: other threads compute for other parameters.
            let numbers = Arc::new(self.linear.numbers(piece.parameters, step));
            *self.last() = Known { parameters: piece.parameters.to_vec(), step, numbers: numbers.clone() };
            numbers
        })
    }

    fn last(&self) -> MutexGuard<'_, Known> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
