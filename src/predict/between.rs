//! [`Between`]: an interval of a record, with its inputs.

use crate::interval::Hold;
use crate::record::{Channel, Part, Record};
use crate::scalar::Scalar;
use core::cell::Cell;
use core::ops::Deref;

/// From one sample of a record to the next.
pub(crate) struct Between<S> {
    /// Begin and length (s).
    pub(super) interval: (f64, f64),
    /// The length that its transition is computed for (s).
    pub(super) crossed: f64,
    u0: Vec<S>,
    /// The input at the end; `None` where it is held.
    pub(super) u1: Option<Vec<S>>,
    /// Where an input is late: between its jumps.
    pub(super) parts: Vec<Part<S>>,
    /// The part that is being crossed.
    pub(super) part: Cell<Option<usize>>,
}

/// The inputs at a position.
pub(crate) enum Input<'b, S> {
    Held(&'b [S]),
    Moving(Vec<S>),
}

impl<S> Deref for Input<'_, S> {
    type Target = [S];

    fn deref(&self) -> &[S] {
        match self {
            Input::Held(u) => u,
            Input::Moving(u) => u,
        }
    }
}

impl<S: Scalar> Between<S> {
    /// From sample `k` on, with the dead times of inputs, if any has one; after the last sample the input is held and no time passes.
    pub fn new(record: &Record, k: usize, delays: &[Option<S>]) -> Self {
        let t0 = record.time(k);
        let last = k + 1 >= record.len();
        let length = if last { 0.0 } else { record.time(k + 1) - t0 };
        let (interval, crossed, part) = ((t0, length), length, Cell::new(None));
        if !delays.is_empty() {
            let (u0, parts) = (record.late_inputs(k, delays), record.parts(k, delays));
            return Between { interval, crossed, u0, u1: None, parts, part };
        }
        let inputs = record.inputs().iter();
        let at_end = |(i, input): (usize, &Channel)| match record.input_hold(i) {
            Hold::Zero => S::from(input.values[k]),
            Hold::First => S::from(input.values[k + 1]),
        };
        let moves = !record.holds.all_zero() && !last;
        let u1 = moves.then(|| inputs.clone().enumerate().map(at_end).collect());
        let u0 = inputs.map(|input| S::from(input.values[k])).collect();
        Between { interval, crossed, u0, u1, parts: vec![], part }
    }

    /// The same interval, whose transition is computed for this length (s): lengths that differ by rounding have one transition.
    pub fn crossed_as(self, length: f64) -> Self {
        Between { crossed: length, ..self }
    }

    /// How long it is (s).
    pub fn length(&self) -> f64 {
        self.interval.1
    }

    /// Whether the next sample is at another instant.
    pub(super) fn passes(&self) -> bool {
        self.length() > 0.0
    }

    fn part(&self) -> Option<&Part<S>> {
        self.part.get().and_then(|i| self.parts.get(i))
    }

    /// Time at a fraction of the interval, or of the part that is being crossed (s).
    pub fn time(&self, position: f64) -> S {
        match self.part() {
            Some(part) => part.length * position + part.t0,
            None => S::from(self.interval.0 + position * self.interval.1),
        }
    }

    /// The input there.
    pub fn input(&self, position: f64) -> Input<'_, S> {
        let (u0, u1) = match self.part() {
            Some(part) => (&*part.u0, Some(&*part.u1)),
            None => (&*self.u0, self.u1.as_deref()),
        };
        match u1 {
            None => Input::Held(u0),
            Some(u1) => Input::Moving(u0.iter().zip(u1).map(|(u0, u1)| (*u1 - *u0) * position + *u0).collect()),
        }
    }
}
