//! Whether the errors at suspicious samples are larger than elsewhere, or the prediction moves there: the output of a plant at rest
//! is constant, too, but so is its prediction, and its errors are no larger than elsewhere.

use crate::problem::{Accumulate, Objective};
use crate::record::{Record, Suspicion};
use crate::sweep::Window;

/// Samples of an output that may be wrong.
pub(crate) struct Suspect<'s> {
    pub experiment: usize,
    pub output: usize,
    pub suspicion: &'s Suspicion,
}

/// Sums of errors and of their squares, and how many there were.
#[derive(Clone, Copy, Default)]
struct Errors {
    sum: f64,
    squares: f64,
    count: u64,
}

/// The errors inside and outside the samples of a suspect.
#[derive(Clone, Copy, Default)]
pub(crate) struct Split {
    inside: Errors,
    outside: Errors,
}

impl Split {
    /// Root of the mean squared error inside.
    pub fn rms(&self) -> f64 {
        (self.inside.squares / self.inside.count.max(1) as f64).sqrt()
    }

    /// Mean squared error inside, relative to that outside.
    pub fn ratio(&self) -> f64 {
        let mean = |errors: Errors| errors.squares / errors.count.max(1) as f64;
        mean(self.inside) / mean(self.outside).max(f64::MIN_POSITIVE)
    }

    /// Standard deviation of the errors inside: of a value that stands still, that of its prediction.
    pub fn spread(&self) -> f64 {
        let Errors { sum, squares, count } = self.inside;
        let n = count.max(1) as f64;
        (squares / n - (sum / n).powi(2)).max(0.0).sqrt()
    }

    /// Part of the measurements that lies inside.
    pub fn part(&self) -> f64 {
        self.inside.count as f64 / (self.inside.count + self.outside.count).max(1) as f64
    }

    /// Part of the sum of squares that lies inside.
    pub fn share(&self) -> f64 {
        self.inside.squares / (self.inside.squares + self.outside.squares).max(f64::MIN_POSITIVE)
    }
}

struct Sums<'s> {
    record: &'s Record,
    suspects: Vec<&'s Suspect<'s>>,
    splits: Vec<Split>,
}

impl Accumulate for Sums<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for (suspect, split) in self.suspects.iter().zip(&mut self.splits) {
            let values = &self.record.outputs()[suspect.output].values;
            for k in (0..window.samples[lane]).filter(|k| window.is_measured(*k, suspect.output, lane)) {
                let sample = window.begin[lane] + k;
                let inside = suspect.suspicion.holds(values, sample);
                let errors = if inside { &mut split.inside } else { &mut split.outside };
                let error = window.error(k, suspect.output, lane);
                errors.sum += error;
                errors.squares += error * error;
                errors.count += 1;
            }
        }
    }

    fn append(&mut self, later: Self) {
        for (split, later) in self.splits.iter_mut().zip(later.splits) {
            for (errors, later) in [(&mut split.inside, later.inside), (&mut split.outside, later.outside)] {
                errors.sum += later.sum;
                errors.squares += later.squares;
                errors.count += later.count;
            }
        }
    }
}

/// The errors of each suspect, by one pass over the data; empty where they cannot be evaluated.
pub(crate) fn splits(objective: &Objective<'_>, coordinates: &[f64], suspects: &[Suspect<'_>]) -> Vec<Split> {
    let plain = objective.in_units();
    let of = |experiment: usize| suspects.iter().filter(move |suspect| suspect.experiment == experiment);
    let make = |experiment: usize| {
        let suspects: Vec<&Suspect<'_>> = of(experiment).collect();
        let splits = vec![Split::default(); suspects.len()];
        Sums { record: &objective.problem.records[experiment], suspects, splits }
    };
    let Ok(found) = plain.gather(coordinates, false, make) else { return vec![] };
    // In the order of the experiments, which is that of the suspects.
    found.into_iter().flat_map(|sums| sums.splits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Time;
    use crate::record::Channel;

    /// Of a piece that begins at the third of six samples: by its value the fourth is suspicious, by their places the third and the
    /// last; the fifth is not measured.
    #[test]
    fn errors_inside_and_outside() {
        let channel = Channel::new("y", "", vec![9.0, 1.0, 2.0, 9.0, f64::NAN, 3.0]);
        let record = Record::new(vec![], Time::Uniform { start: 0.0, step: 1.0 }, vec![], vec![channel]).unwrap();
        let suspicions = [
            Suspicion::Sentinel { value: 9.0, count: 2 },
            Suspicion::Frozen { value: 2.0, samples: 2..3 },
            Suspicion::Repeated { samples: 1..3, again: 4 },
        ];
        let suspects = suspicions.each_ref().map(|suspicion| Suspect { experiment: 0, output: 0, suspicion });
        let mut sums = Sums { record: &record, suspects: suspects.iter().collect(), splits: vec![Split::default(); 3] };
        let mut window = Window::new(1, 1, 0, 4, false);
        (window.begin, window.samples) = (vec![2], vec![4]);
        for (k, error) in [2.0, 3.0, 5.0, 7.0].into_iter().enumerate() {
            window.row_mut(k, 0)[0] = error;
            window.set_measured(k, 0, u32::from(k != 2));
        }
        sums.add(&window, 0);
        let numbers = |split: &Split| [split.inside, split.outside].map(|errors| (errors.squares, errors.count));
        let found: Vec<_> = sums.splits.iter().map(numbers).collect();
        assert_eq!(found, [[(9.0, 1), (53.0, 2)], [(4.0, 1), (58.0, 2)], [(49.0, 1), (13.0, 2)]]);
    }

    /// Values that equal the one before, in a piece that begins at the second sample.
    #[test]
    fn values_that_are_held() {
        let channel = Channel::new("y", "", vec![7.0, 7.0, 7.0, 8.0, 8.0, 9.0]);
        let record = Record::new(vec![], Time::Uniform { start: 0.0, step: 1.0 }, vec![], vec![channel]).unwrap();
        let suspects = [Suspect { experiment: 0, output: 0, suspicion: &Suspicion::Held { samples: 2 } }];
        let mut sums = Sums { record: &record, suspects: suspects.iter().collect(), splits: vec![Split::default()] };
        let mut window = Window::new(1, 1, 0, 5, false);
        (window.begin, window.samples) = (vec![1], vec![5]);
        for k in 0..5 {
            window.row_mut(k, 0)[0] = 10f64.powi(k as i32);
            window.set_measured(k, 0, 1);
        }
        sums.add(&window, 0);
        assert_eq!((sums.splits[0].inside.sum, sums.splits[0].outside.sum), (1011.0, 10_100.0));
    }

    /// Errors of 1 and 3 inside, and four whose squares add up to two outside, in two pieces of a record: mean squares of 5 and of a half.
    #[test]
    fn errors_of_pieces_add_up() {
        let channel = Channel::new("y", "", vec![1.0; 6]);
        let record = Record::new(vec![], Time::Uniform { start: 0.0, step: 1.0 }, vec![], vec![channel]).unwrap();
        let sums = |inside: (f64, u64), outside: (f64, u64)| {
            let errors = |(squares, count): (f64, u64)| Errors { sum: squares.sqrt() * count as f64, squares, count };
            let split = Split { inside: errors(inside), outside: errors(outside) };
            Sums { record: &record, suspects: vec![], splits: vec![split] }
        };
        let mut whole = sums((1.0, 1), (1.0, 1));
        whole.append(sums((9.0, 1), (1.0, 3)));
        let split = whole.splits[0];
        assert_eq!((split.inside.count, split.outside.count), (2, 4));
        assert_eq!((split.rms(), split.ratio(), split.share()), (5f64.sqrt(), 10.0, 10.0 / 12.0));
        // Of 1 and 3 the standard deviation is 1.
        assert_eq!((split.spread(), split.part()), (1.0, 2.0 / 6.0));
        let none = Split::default();
        assert_eq!([none.rms(), none.ratio(), none.share(), none.spread(), none.part()], [0.0; 5]);
    }
}
