//! [`LateInputs`]: inputs with dead times, in symbols.
//!
//! Where samples are evenly spaced, a dead time is a whole number of samples and a rest shorter than one. In each interval a late input then goes
//! on to its next sample once, at the rest after the sample. With several dead times an interval has one part more than dead times that differ,
//! in the order of their rests.

use crate::equations::{DeadTimes, Equations};
use crate::graph::{Leaf, Symbol};
use crate::interval::Hold;
use crate::record::ROUNDING;
use crate::scalar::{Comparison, Scalar};

/// What lies between two cuts.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub number: usize,
    /// After the sample (s).
    pub begin: Symbol,
    /// In s.
    pub length: Symbol,
}

/// The late inputs of equations, in one trace.
pub(super) struct LateInputs {
    /// Of each input the number of its dead time, if it is late.
    of: Vec<Option<usize>>,
    /// Where each dead time cuts, after the sample (s).
    cuts: Vec<Symbol>,
    /// How many cuts come before that of each dead time.
    ranks: Vec<Symbol>,
}

fn number(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

impl LateInputs {
    pub fn of(equations: &Equations) -> Self {
        let DeadTimes { roots, of } = equations.dead_times();
        if roots.is_empty() {
            return LateInputs { of, cuts: vec![], ranks: vec![] };
        }
        let parameters = equations.layout().parameters.len();
        let whole = |i: usize| Symbol::leaf(Leaf::Parameter(number(parameters + i)));
        let times = equations.graph().evaluate(&roots, Symbol::leaf);
        let cuts: Vec<Symbol> = times.into_iter().enumerate().map(|(i, time)| time - whole(i)).collect();
        // Of two at one place the first of the list comes first.
        let before = |i: usize, j: usize| match j < i {
            true => Symbol::select(Comparison::LessOrEqual, cuts[j], cuts[i], Symbol::from(1.0), Symbol::from(0.0)),
            false => Symbol::select(Comparison::Less, cuts[j], cuts[i], Symbol::from(1.0), Symbol::from(0.0)),
        };
        let rank =
            |i: usize| (0..cuts.len()).filter(|j| *j != i).fold(Symbol::from(0.0), |rank, j| rank + before(i, j));
        let ranks = (0..cuts.len()).map(rank).collect();
        LateInputs { of, cuts, ranks }
    }

    /// The parts of an interval; none where nothing is late.
    pub fn parts(&self) -> Vec<Part> {
        if self.cuts.is_empty() {
            return vec![];
        }
        let zero = Symbol::from(0.0);
        let cut = |rank: usize| {
            let one = |(cut, of): (&Symbol, &Symbol)| {
                Symbol::select(Comparison::Equal, *of, Symbol::from(rank as f64), *cut, zero)
            };
            self.cuts.iter().zip(&self.ranks).map(one).reduce(|sum, one| sum + one).unwrap_or(zero)
        };
        let mut ends: Vec<Symbol> = (0..self.cuts.len()).map(cut).collect();
        ends.push(Symbol::leaf(Leaf::Step));
        let mut begin = zero;
        let part = |(number, end): (usize, Symbol)| {
            let part = Part { number, begin, length: end - begin };
            begin = end;
            part
        };
        ends.into_iter().enumerate().map(part).collect()
    }

    /// An input that is late, in a part of the interval, or at the sample itself without one; `None` of an input that is not late. `after` gives the
    /// time after the sample (s).
    pub fn input(&self, i: u32, hold: Hold, part: Option<usize>, after: impl FnOnce() -> Symbol) -> Option<Symbol> {
        let of = (*self.of.get(i as usize)?)?;
        let (cut, rank) = (self.cuts[of], self.ranks[of]);
        let at = |after: u32| Symbol::leaf(Leaf::Late { input: i, after });
        let if_passed = |then: Symbol, or: Symbol| match part {
            Some(part) => Symbol::select(Comparison::Less, rank, Symbol::from(part as f64), then, or),
            None => Symbol::select(Comparison::LessOrEqual, cut, Symbol::leaf(Leaf::Step) * ROUNDING, then, or),
        };
        Some(match hold {
            Hold::Zero => if_passed(at(1), at(0)),
            Hold::First => {
                let rise = match part {
                    Some(_) => if_passed(at(2) - at(1), at(1) - at(0)),
                    None => at(1) - at(0),
                };
                at(1) + rise * ((after() - cut) / Symbol::leaf(Leaf::Step))
            }
        })
    }
}
