//! [`Late`]: the dead times of inputs in the lanes of a program.

use crate::equations::{DeadTimes, Equations};
use crate::functions::Functions;
use crate::record::{ROUNDING, Time, is_dead_time};
use crate::sweep::Piece;
use std::sync::Arc;

/// The dead times of equations.
pub(super) struct Late {
    equations: Arc<Equations>,
    times: DeadTimes,
}

/// A dead time as a whole number of samples and a rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Whole {
    pub samples: isize,
    /// The same in s.
    pub seconds: f64,
}

impl Whole {
    /// None of a dead time that cannot be. One that is longer than the record is all whole.
    fn of(time: f64, step: f64, samples: usize) -> Option<Self> {
        let whole = (time / step + ROUNDING).floor();
        match whole {
            _ if !is_dead_time(time) => None,
            _ if whole > samples as f64 => Some(Whole { samples: samples as isize, seconds: time }),
            _ => Some(Whole { samples: whole as isize, seconds: whole * step }),
        }
    }
}

impl Late {
    pub fn new(equations: Arc<Equations>) -> Self {
        let times = equations.dead_times();
        Late { equations, times }
    }

    /// Those of a piece, each once.
    pub fn whole(&self, piece: &Piece<'_>) -> Vec<Option<Whole>> {
        let Time::Uniform { step, .. } = *piece.record.times() else { return vec![None; self.times.roots.len()] };
        let mut of_inputs = vec![0.0; self.times.of.len()];
        Functions::delay(&*self.equations, piece.parameters, &mut of_inputs);
        let input = |number: usize| self.times.of.iter().position(|of| *of == Some(number)).unwrap_or(0);
        let whole = |number: usize| Whole::of(of_inputs[input(number)], step, piece.record.len());
        (0..self.times.roots.len()).map(whole).collect()
    }

    /// The parameters of a piece as its program has them: after them the whole samples of each dead time (s).
    pub fn parameters(&self, piece: &Piece<'_>) -> Vec<f64> {
        let whole = self.whole(piece).into_iter().map(|whole| whole.map_or(f64::NAN, |whole| whole.seconds));
        piece.parameters.iter().copied().chain(whole).collect()
    }

    /// How many samples before the present one (negative: after it) the value stands that [`Leaf::Late`](crate::graph::Leaf::Late) reads; `None`
    /// for an input that is not late, and a dead time that cannot be.
    pub fn behind(&self, whole: &[Option<Whole>], input: usize, after: usize) -> Option<isize> {
        let number = (*self.times.of.get(input)?)?;
        whole.get(number).copied().flatten().map(|whole| whole.samples + 1 - after as isize)
    }
}

#[cfg(test)]
mod tests {
    use super::Whole;

    #[test]
    fn whole_samples() {
        let of = |time| Whole::of(time, 0.1, 50);
        assert_eq!(of(0.0), Some(Whole { samples: 0, seconds: 0.0 }));
        assert_eq!(of(0.25), Some(Whole { samples: 2, seconds: 0.2 }));
        // 0.3 / 0.1 is less than 3.
        assert_eq!(of(0.3).map(|whole| whole.samples), Some(3));
        assert_eq!(of(1e300), Some(Whole { samples: 50, seconds: 1e300 }));
        assert_eq!([of(-0.1), of(f64::NAN), of(f64::INFINITY)], [None; 3]);
    }
}
