//! [`Crossed`]: the transition of linear equations in the lanes of a program.

use crate::equations::Linear;
use crate::record::Time;
use crate::sweep::Piece;
use std::sync::{Arc, Mutex, PoisonError};

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

impl Crossed {
    pub fn new(linear: Linear) -> Self {
        Crossed { linear, last: Mutex::default() }
    }

    /// The parameters of a piece as its program has them: after them what follows from them and the time between two samples.
    pub fn parameters(&self, piece: &Piece<'_>) -> Arc<Vec<f64>> {
        let step = if let Time::Uniform { step, .. } = piece.record.times() { *step } else { f64::NAN };
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let same = last.step == step && last.parameters == piece.parameters;
        if !same {
            let numbers = Arc::new(self.linear.numbers(piece.parameters, step));
            *last = Known { parameters: piece.parameters.to_vec(), step, numbers };
        }
        last.numbers.clone()
    }
}
