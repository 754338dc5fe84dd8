//! Inputs that act late: between two samples, the parts of the interval in which they are smooth.

use super::Record;
use crate::interval::Hold;
use crate::scalar::Scalar;

/// A part of the interval between two samples in which no input jumps or bends. Where a dead time has slopes, begin and length have them, too:
/// so the slopes of the state contain what a jump does that comes later.
pub(crate) struct Part<S> {
    /// Begin (s).
    pub t0: S,
    /// Length (s).
    pub length: S,
    /// The inputs at the begin.
    pub u0: Vec<S>,
    /// The inputs at the end, as they are approached.
    pub u1: Vec<S>,
}

/// A part of the sample time by which a dead time may differ from a whole number of samples and is still that. Times are rounded to 2e-16 of
/// themselves, which is 2e-10 of the sample time after a million samples.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Whether a dead time (s) is one: zero or longer, and finite.
pub(crate) fn is_dead_time(delay: f64) -> bool {
    (0.0..f64::INFINITY).contains(&delay)
}

/// What to do about a dead time that is none.
pub(crate) const NO_DEAD_TIME: &str = "; a dead time is zero or longer, and finite: bound its parameter from below by zero \
                                       (.within(0.0, ..), or .log()), or correct its expression";

impl Record {
    /// The interval from sample `k` on, cut at each time at which a late input jumps (held) or bends (interpolated). `delays`: the dead time of
    /// each input (s), none of one that is not late. A jump just at the begin leaves a part of length zero before it, for its slopes. After the
    /// last sample there is a part of length zero.
    pub(crate) fn parts<S: Scalar>(&self, k: usize, delays: &[Option<S>]) -> Vec<Part<S>> {
        let begin = self.time(k);
        let end = if k + 1 < self.len() { self.time(k + 1) } else { begin };
        let (first, last) = (begin - self.soon(k), end - self.soon(k + 1));
        // Of each input the last sample that it has reached before the interval; it goes on to the next at a cut.
        let (mut reached, mut cuts) = (vec![Some(k); delays.len()], vec![]);
        for (i, delay) in delays.iter().enumerate() {
            let Some(delay) = *delay else { continue };
            let at = |j: usize| self.time(j) + delay.value();
            reached[i] = self.reached_before(first, delay.value());
            let next = reached[i].map_or(0, |before| before + 1);
            let here = (next..self.len()).take_while(|j| at(*j) < last).filter(|j| self.bends(i, *j));
            cuts.extend(here.map(|j| (delay + self.time(j), i, j)));
        }
        cuts.sort_by(|a, b| a.0.value().total_cmp(&b.0.value()));
        let (mut parts, mut t0) = (Vec::with_capacity(cuts.len() + 1), S::from(begin));
        let at = |t: S, reached: &[Option<usize>]| -> Vec<S> {
            (0..delays.len()).map(|i| self.late(i, delays[i], reached[i], t)).collect()
        };
        for (cut, i, j) in cuts {
            parts.push(Part { t0, length: cut - t0, u0: at(t0, &reached), u1: at(cut, &reached) });
            reached[i] = Some(j);
            t0 = cut;
        }
        let t1 = S::from(end);
        parts.push(Part { t0, length: t1 - t0, u0: at(t0, &reached), u1: at(t1, &reached) });
        parts
    }

    /// How much before sample `k` is still at it (s); at least what a time so large rounds off.
    fn soon(&self, k: usize) -> f64 {
        if k == 0 || k >= self.len() {
            return 0.0;
        }
        let rounding = 4.0 * f64::EPSILON * self.time(k).abs();
        rounding.max(ROUNDING * (self.time(k) - self.time(k - 1)))
    }

    /// The last sample that an input with this dead time (s) has reached before a time (s); none before the first.
    fn reached_before(&self, t: f64, delay: f64) -> Option<usize> {
        let mut last = self.sample_at(t - delay);
        while self.time(last) + delay >= t {
            last = last.checked_sub(1)?;
        }
        Some(last)
    }

    /// The inputs at sample `k`, late by their dead times.
    pub(crate) fn late_inputs<S: Scalar>(&self, k: usize, delays: &[Option<S>]) -> Vec<S> {
        let t = self.time(k);
        let late = |(i, delay): (usize, &Option<S>)| {
            let Some(delay) = *delay else { return S::from(self.inputs[i].values[k]) };
            // A held input has jumped, an interpolated one still has the slope of a longer dead time.
            let reached = match self.input_hold(i) {
                Hold::Zero => {
                    let at = t - delay.value() + self.soon(k);
                    let last = self.sample_at(at);
                    (self.time(last) <= at).then_some(last)
                }
                Hold::First => self.reached_before(t - self.soon(k), delay.value()),
            };
            self.late(i, Some(delay), reached, S::from(t))
        };
        delays.iter().enumerate().map(late).collect()
    }

    /// Input `i` at time `t`, where it has reached this sample; none before the first. Not a number for a dead time that is negative or none.
    fn late<S: Scalar>(&self, i: usize, delay: Option<S>, reached: Option<usize>, t: S) -> S {
        let (values, delay) = (&self.inputs[i].values, delay.unwrap_or(S::from(0.0)));
        if !is_dead_time(delay.value()) {
            return S::from(f64::NAN);
        }
        match (self.input_hold(i), reached) {
            (Hold::First, Some(j)) if j + 1 < self.len() && self.time(j + 1) > self.time(j) => {
                let position = (t - delay - self.time(j)) * (self.time(j + 1) - self.time(j)).recip();
                position * (values[j + 1] - values[j]) + values[j]
            }
            (_, reached) => S::from(values[reached.unwrap_or(0)]),
        }
    }

    /// Whether input `i` jumps at sample `j`, or its slope may.
    fn bends(&self, i: usize, j: usize) -> bool {
        let values = &self.inputs[i].values;
        let about = j.saturating_sub(1)..(j + 2).min(self.len());
        match self.input_hold(i) {
            Hold::Zero => j > 0 && values[j] != values[j - 1],
            Hold::First => values[about].iter().any(|value| *value != values[j]),
        }
    }

    /// The last sample that is not after a time (s); the first for an earlier time.
    fn sample_at(&self, t: f64) -> usize {
        let (mut low, mut high) = (0, self.len());
        if let super::Time::Uniform { start, step } = self.time {
            // Near enough that the search ends at once.
            let guess = ((t - start) / step).floor().clamp(0.0, (self.len() - 1) as f64) as usize;
            (low, high) = (guess.saturating_sub(1), (guess + 2).min(self.len()));
        }
        while high - low > 1 {
            let middle = low.midpoint(high);
            if self.time(middle) <= t { low = middle } else { high = middle }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::layout::Quantity;
    use crate::record::{Channel, Time};

    fn record(values: Vec<f64>, hold: Hold) -> Record {
        let state = Quantity { name: "x".to_owned(), unit: "1".to_owned() };
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        Record::new(vec![state], time, vec![Channel::new("u", "1", values)], vec![]).unwrap().hold(hold)
    }

    /// `(begin, slope of begin, length, u at begin, u at end)`
    fn parts(record: &Record, k: usize, delay: f64) -> Vec<[f64; 5]> {
        let found = record.parts::<Dual<1>>(k, &[Some(Dual::variable(delay, 0))]);
        found
            .iter()
            .map(|part| [part.t0.value, part.t0.slopes[0], part.length.value, part.u0[0].value, part.u1[0].value])
            .collect()
    }

    #[test]
    fn held_inputs_are_cut_where_they_jump() {
        let record = record(vec![5.0, 5.0, 7.0, 9.0], Hold::Zero);
        // Before the record the input is that of the first sample; what does not jump is not cut.
        assert_eq!(parts(&record, 0, 1.5), [[0.0, 0.0, 1.0, 5.0, 5.0]]);
        // From sample 2 on, at 3.25, which is in the last interval for a delay of 1.25, and after the record for one of 2.5.
        assert_eq!(parts(&record, 2, 0.25), [[2.0, 0.0, 0.25, 5.0, 5.0], [2.25, 1.0, 0.75, 7.0, 7.0]]);
        assert_eq!(parts(&record, 2, 1.25), [[2.0, 0.0, 1.0, 5.0, 5.0]]);
        // At a whole number of samples the part before the jump has no length, but slopes.
        assert_eq!(parts(&record, 2, 0.0), [[2.0, 0.0, 0.0, 5.0, 5.0], [2.0, 1.0, 1.0, 7.0, 7.0]]);
        assert_eq!(record.late_inputs(2, &[Some(0.0)]), [7.0]);
        assert_eq!(record.late_inputs(3, &[Some(1.0)]), [7.0]);
        assert_eq!(record.late_inputs(3, &[Some(1.01)]), [5.0]);
        assert!(record.late_inputs(3, &[Some(-0.1)])[0].is_nan());
        // What is not late is that of the sample.
        assert_eq!(record.parts::<f64>(2, &[None])[0].u0, [7.0]);
        assert_eq!(record.late_inputs::<f64>(2, &[None]), [7.0]);
        // After the last sample no time passes.
        assert_eq!(parts(&record, 3, 0.5).iter().map(|part| part[2]).sum::<f64>(), 0.0);
    }

    #[test]
    fn interpolated_inputs_are_cut_at_their_corners() {
        let record = record(vec![0.0, 4.0, 6.0, 6.0], Hold::First);
        // u(t - 0.25) from 1 to 2: from 3 to 4, then to 5.5.
        assert_eq!(parts(&record, 1, 0.25), [[1.0, 0.0, 0.25, 3.0, 4.0], [1.25, 1.0, 0.75, 4.0, 5.5]]);
        let at = record.late_inputs::<Dual<1>>(2, &[Some(Dual::variable(0.25, 0))])[0];
        assert_eq!((at.value, at.slopes[0]), (5.5, -2.0));
        // Before the record it stands still.
        assert_eq!(parts(&record, 0, 0.5), [[0.0, 0.0, 0.5, 0.0, 0.0], [0.5, 1.0, 0.5, 0.0, 2.0]]);
        assert_eq!(record.late_inputs(0, &[Some(0.5)]), [0.0]);
    }

    /// Rows of one instant, and times so large that a thousand-millionth of the step is less than they round off.
    #[test]
    fn times_that_are_equal_and_large() {
        let state = Quantity { name: "x".to_owned(), unit: "1".to_owned() };
        let of = |time: Time, values: Vec<f64>| {
            Record::new(vec![state.clone()], time, vec![Channel::new("u", "1", values)], vec![])
                .unwrap()
                .hold(Hold::Zero)
        };
        let twice = of(Time::Stamps(vec![0.0, 1.0, 1.0, 2.0, 3.0]), vec![5.0, 7.0, 7.0, 8.0, 9.0]);
        let at = |record: &Record, delay: f64| -> Vec<f64> {
            (0..record.len()).map(|k| record.late_inputs(k, &[Some(delay)])[0]).collect()
        };
        assert_eq!(at(&twice, 0.0), [5.0, 7.0, 7.0, 8.0, 9.0]);
        assert_eq!(at(&twice, 1.0), [5.0, 5.0, 5.0, 7.0, 8.0]);
        let large = of(Time::Uniform { start: 1.7e9, step: 1.0 }, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(at(&large, 3.0), [1.0, 1.0, 1.0, 1.0, 2.0, 3.0]);
        for (record, delay) in [(&twice, 0.0), (&twice, 1.0), (&large, 3.0)] {
            for k in 0..record.len() {
                let parts = record.parts::<f64>(k, &[Some(delay)]);
                assert!(parts.iter().all(|part| part.length >= 0.0), "{k} {delay}");
                let end = parts.last().unwrap();
                // The interval is covered, and ends with the input that its last part has.
                let step = if k + 1 < record.len() { record.time(k + 1) - record.time(k) } else { 0.0 };
                assert_eq!(parts.iter().map(|part| part.length).sum::<f64>(), step, "{k} {delay}");
                if step > 0.0 {
                    assert_eq!(end.u0[0], at(record, delay)[k], "{k} {delay}");
                }
            }
        }
    }
}
