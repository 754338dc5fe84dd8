//! Records that hold the same measurements: copies, also ones that are shorter, have fewer rows, are rounded, or overlap.

use super::copies::are_same;
use super::*;
use crate::record::Record;
use rustc_hash::{FxBuildHasher, FxHashMap};

pub(crate) const TWICE: Check = Check::new(
    "no record counts twice",
    "Do two records hold the same measurements, whole or in part, some rows left out, or rounded?",
    &[WarningCode::Repeated],
    |evidence, _| {
        let experiments = evidence.point.objective.experiments();
        let left_out = match experiments > COMPARED {
            true => Some("records beyond the first 300, ones with fewer rows or rounded beyond the first 100"),
            false => {
                (experiments > COMPARED_BY_TIME).then_some("records with fewer rows or rounded, beyond the first 100")
            }
        };
        Examined::from(twice(evidence)).without(left_out)
    },
)
.levels(&[level(
    "changes of the outputs in what two records have in common",
    CHANGES as f64,
    "noise repeats none of them",
)]);

/// Of so many records each is compared with each other.
const COMPARED: usize = 300;
/// The same at equal times, where the digits of numbers are looked at.
const COMPARED_BY_TIME: usize = 100;
/// Parts of records that are equal are named if their first output changes at least so often from sample to sample.
const CHANGES: usize = 10;
/// Samples of two records whose times differ by less than this part of the interval are of the same time.
const SAME_TIME: f64 = 1e-6;
/// A number that is kept in 32 bits differs by less than this part of it.
const SINGLE: f64 = 1.2e-7;

/// Two records with the same measurements.
struct Same {
    records: (usize, usize),
    /// How many samples, where it is not all of both.
    samples: Option<usize>,
}

/// Whether two records hold the same measurements.
fn twice(evidence: &Evidence<'_>) -> Option<Warning> {
    let problem = evidence.point.objective.problem;
    let records = &problem.records[..problem.records.len().min(COMPARED)];
    let pairs = |most: usize| (1..records.len().min(most)).flat_map(|b| (0..b).map(move |a| (a, b)));
    let copies = pairs(COMPARED).find(|&(a, b)| copied(&records[a], &records[b]));
    let copies = copies.map(|records| Same { records, samples: None });
    let by_time =
        || pairs(COMPARED_BY_TIME).find_map(|(a, b)| at_the_same_times(&records[a], &records[b]).map(|n| ((a, b), n)));
    let in_part = || by_time().or_else(|| overlapping(records)).map(|(records, n)| Same { records, samples: Some(n) });
    let Same { records: (a, b), samples } = copies.or_else(in_part)?;
    let [first, second] = [a, b].map(|e| &problem.unknowns.labels[e]);
    let shared = match samples {
        None => "hold the same measurements, which count twice: intervals are too narrow; leave one out".to_owned(),
        Some(samples) => format!(
            "hold the same measurements, rounded or not, at {}, which count twice: intervals are too narrow; leave one out, or cut it \
             where the other begins",
            counted(samples as u64, "sample")
        ),
    };
    Some(with_care(WarningCode::Repeated, format!("the experiments `{first}` and `{second}` {shared}")))
}

/// Whether all measurements are the same.
fn copied(a: &Record, b: &Record) -> bool {
    are_same(a.outputs().iter().zip(b.outputs()).map(|(a, b)| (&a.values[..], &b.values[..])))
}

/// The measurements at a sample, one for each output.
fn measured(record: &Record, k: usize) -> impl Iterator<Item = f64> + '_ {
    record.outputs().iter().map(move |output| output.values[k])
}

/// Counts samples at which both records have the same measurements, and how often these change from sample to sample in both: noise around a number
/// is, rounded, that number.
#[derive(Default)]
struct Common {
    samples: usize,
    changes: usize,
    before: Option<(f64, f64)>,
}

impl Common {
    /// Takes a sample of each; whether all measurements that both have are the same by `same`.
    fn take(&mut self, (a, i): (&Record, usize), (b, k): (&Record, usize), same: impl Fn(f64, f64) -> bool) -> bool {
        let both = measured(a, i).zip(measured(b, k)).filter(|(a, b)| !a.is_nan() && !b.is_nan());
        let mut any = None;
        for (a, b) in both {
            if !same(a, b) {
                return false;
            }
            any = any.or(Some((a, b)));
        }
        if let Some(here) = any {
            self.samples += 1;
            let both_change = |before: (f64, f64)| before.0 != here.0 && before.1 != here.1;
            self.changes += usize::from(self.before.is_some_and(both_change));
            self.before = Some(here);
        }
        true
    }

    fn found(self) -> Option<usize> {
        (self.changes >= CHANGES).then_some(self.samples)
    }
}

/// How many samples of the same times have the same measurements, rounded or not, if all of them have.
fn at_the_same_times(a: &Record, b: &Record) -> Option<usize> {
    let mut common = Common::default();
    let (mut i, mut k) = (0, 0);
    let interval = |record: &Record| (record.time(record.len() - 1) - record.time(0)) / record.len() as f64;
    let same_time = SAME_TIME * interval(a).max(interval(b));
    while i < a.len() && k < b.len() {
        let (here, there) = (a.time(i), b.time(k));
        if (here - there).abs() <= same_time {
            if !common.take((a, i), (b, k), rounds_to) {
                return None;
            }
            (i, k) = (i + 1, k + 1);
        } else if here < there {
            i += 1;
        } else {
            k += 1;
        }
    }
    common.found()
}

/// Whether two numbers are the same, or one of them is the other rounded: to the digits that it is written with, or to 32 bits.
fn rounds_to(a: f64, b: f64) -> bool {
    // Rounding of a half goes either way.
    let within = |rounded: f64| (a - b).abs() <= 0.5 * (1.0 + SAME_TIME) * last_digit(rounded);
    a == b || (a - b).abs() <= SINGLE * a.abs() || within(a) || within(b)
}

/// The unit of the last digit of a number.
fn last_digit(value: f64) -> f64 {
    let text = format!("{value:e}");
    let Some((digits, exponent)) = text.split_once('e') else { return 0.0 };
    let behind = digits.split_once('.').map_or(0, |(_, behind)| behind.len());
    let exponent: i32 = exponent.parse().unwrap_or(0);
    10f64.powi(exponent - behind as i32)
}

/// Two records of which one begins within the other, bit by bit, and the number of samples that are the same. The begin of a record is recognized by the first two
/// samples between which its first output changes.
fn overlapping(records: &[Record]) -> Option<((usize, usize), usize)> {
    let first = |record: &Record| record.outputs().first().map(|output| output.values.clone());
    let bits = |from: f64, to: f64| (from.to_bits(), to.to_bits());
    let mut begins: FxHashMap<(u64, u64), Vec<(usize, usize)>> =
        FxHashMap::with_capacity_and_hasher(records.len(), FxBuildHasher);
    for (e, record) in records.iter().enumerate() {
        let Some(values) = first(record) else { continue };
        let changes = |pair: &[f64]| pair[0] != pair[1] && !pair[0].is_nan() && !pair[1].is_nan();
        if let Some(k) = values.windows(2).position(changes) {
            begins.entry(bits(values[k], values[k + 1])).or_default().push((e, k));
        }
    }
    for (a, record) in records.iter().enumerate() {
        let Some(values) = first(record) else { continue };
        for (i, pair) in values.windows(2).enumerate() {
            for &(b, k) in begins.get(&bits(pair[0], pair[1])).into_iter().flatten().filter(|(b, _)| *b != a) {
                let mut common = Common::default();
                let back = i.min(k);
                let same = (record.len() - i).min(records[b].len() - k) + back;
                let mut all = (0..same).map(|n| (i - back + n, k - back + n));
                if all.all(|(i, k)| common.take((record, i), (&records[b], k), |a, b| a == b))
                    && let Some(samples) = common.found()
                {
                    return Some(((a.min(b), a.max(b)), samples));
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Channel, Time};

    fn record(begin: f64, step: f64, y: Vec<f64>) -> Record {
        let time = Time::Uniform { start: begin, step };
        Record::new(vec![], time, vec![], vec![Channel::new("y", "1", y)]).unwrap()
    }

    /// Irrational numbers that never repeat.
    fn values(range: core::ops::Range<u32>) -> Vec<f64> {
        range.map(|k| (f64::from(k) * 0.618_033_988_749_895).sin()).collect()
    }

    #[test]
    fn the_last_digit_of_a_number() {
        for (value, digit) in [(0.25, 0.01), (-1200.0, 100.0), (7.0, 1.0), (1.5e-7, 1e-8)] {
            assert!((last_digit(value) / digit - 1.0).abs() < 1e-12, "{value}");
        }
        assert!(rounds_to(0.123_456, 0.1235) && rounds_to(0.1235, 0.123_456) && !rounds_to(0.123_44, 0.1235));
        assert!(rounds_to(0.1, f64::from(0.1f32)) && !rounds_to(0.100_000_03, f64::from(0.1f32)));
    }

    #[test]
    fn rows_of_the_same_times() {
        let all = record(0.0, 0.1, values(0..40));
        let rounded: Vec<f64> = values(0..40).iter().map(|y| (y * 100.0).round() / 100.0).collect();
        assert_eq!(at_the_same_times(&all, &record(0.0, 0.1, rounded)), Some(40));
        let second: Vec<f64> = values(0..40).into_iter().step_by(2).collect();
        assert_eq!(at_the_same_times(&all, &record(0.0, 0.2, second)), Some(20));
        assert_eq!(at_the_same_times(&record(0.3, 0.1, values(3..30)), &all), Some(27));
        // Ten samples change nine times; another number; no time in common.
        assert_eq!(at_the_same_times(&all, &record(0.0, 0.1, values(0..10))), None);
        let mut other = values(0..40);
        other[39] = 0.5;
        assert_eq!(at_the_same_times(&all, &record(0.0, 0.1, other)), None);
        assert_eq!(at_the_same_times(&all, &record(9.0, 0.1, values(0..40))), None);
        // Noise around a whole number, and a coarse sensor that shows that number.
        let steady: Vec<f64> = values(0..40).iter().map(|y| 21.0 + 0.3 * y).collect();
        assert_eq!(at_the_same_times(&record(0.0, 0.1, steady), &record(0.0, 0.1, vec![21.0; 40])), None);
    }

    #[test]
    fn records_that_overlap() {
        let of = |range| record(0.0, 0.1, values(range));
        assert_eq!(overlapping(&[of(0..40), of(100..140), of(25..65)]), Some(((0, 2), 15)));
        assert_eq!(overlapping(&[of(25..65), of(0..40)]), Some(((0, 1), 15)));
        assert_eq!(overlapping(&[of(0..40), of(1..40)]), Some(((0, 1), 39)));
        assert_eq!(overlapping(&[of(0..40), of(35..65)]), None);
        // At rest at the begin and at the end.
        let rests = |moves| [vec![0.0; 30], values(moves), vec![0.0; 30]].concat();
        assert_eq!(overlapping(&[record(0.0, 0.1, rests(1..40)), record(0.0, 0.1, rests(50..90))]), None);
    }
}
