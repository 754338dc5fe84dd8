//! Whether single measurements are missing and the one before stands in their place.

use super::*;

/// The fewest measurements that are equal to the one before, and the part of them all, that are looked at.
const FEWEST: usize = 4;
const PART: f64 = 0.005;
/// From this part on it is a sensor that measures less often, which the look at the columns names.
const MOST: f64 = 1.0 / 3.0;
/// Rounded measurements are equal to the last but one as well, nearly as often.
const ROUNDED: usize = 8;
/// Mean squared errors of such measurements beyond so many times those of the others confirm it.
const LARGER: f64 = 2.0;

/// Sums over measurements.
#[derive(Clone, Copy, Default)]
struct Errors {
    squares: f64,
    count: usize,
}

impl Errors {
    fn mean(&self) -> f64 {
        self.squares / self.count.max(1) as f64
    }
}

/// Measurements with their errors, in order of time, of those that are equal to the one before and of the others; `None`
/// where the former are few, a third or more, or rounded.
fn split(runs: &[Vec<(f64, f64)>]) -> Option<[Errors; 2]> {
    let (mut split, mut again) = ([Errors::default(); 2], 0);
    for run in runs {
        for (k, (y, error)) in run.iter().enumerate() {
            let equals = |back: usize| k >= back && run[k - back].0 == *y;
            let kind = &mut split[usize::from(!equals(1))];
            kind.squares += error * error;
            kind.count += 1;
            again += usize::from(equals(2) && !equals(1));
        }
    }
    let [held, others] = split;
    let part = held.count as f64 / (held.count + others.count) as f64;
    let single = held.count >= FEWEST && (PART..MOST).contains(&part);
    (single && again * ROUNDED <= held.count).then_some(split)
}

/// The warning about an output with these errors, one run per record, NaN where nothing was measured.
pub(crate) fn dropouts_of(evidence: &Evidence<'_>, j: usize, errors: &[Vec<f64>]) -> Option<Warning> {
    let problem = evidence.point.objective.problem;
    let run = |(record, errors): (&crate::record::Record, &Vec<f64>)| {
        let values = record.outputs()[j].values.iter().copied().zip(errors.iter().copied());
        values.filter(|(_, error)| !error.is_nan()).collect()
    };
    let runs: Vec<Vec<(f64, f64)>> = problem.records.iter().zip(errors).map(run).collect();
    let [held, others] = split(&runs)?;
    are_larger(held, others).then(|| {
        let output = &problem.layout().outputs[j];
        let text = format!(
            "{} of the measurements of `{}` are equal to the one before, and the model differs there by {}{unit}, elsewhere by \
             {}{unit}: the last value was held where none arrived; mark these samples as missing",
            percent(held.count as f64 / (held.count + others.count) as f64, 2),
            output.name,
            number(held.mean().sqrt(), 2),
            number(others.mean().sqrt(), 2),
            unit = unit_after(&output.unit)
        );
        with_care(WarningCode::Frozen, text).about(About::Output(j))
    })
}

/// Whether the errors of measurements that are equal to the one before are so much larger than the others that the last value was held.
fn are_larger(held: Errors, others: Errors) -> bool {
    held.mean() > LARGER * others.mean()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the mean square, whatever the unit.
    #[test]
    fn held_values_have_larger_errors() {
        for size in [1e-6, 1.0, 1e6] {
            let of = |mean: f64, count: usize| Errors { squares: mean * size * count as f64, count };
            assert!(are_larger(of(2.01, 3), of(1.0, 7)) && !are_larger(of(1.99, 3), of(1.0, 7)));
        }
    }

    /// The last of each four measurements is the one before, with an error of three instead of one.
    #[test]
    fn values_that_are_held() {
        let run = |count: usize, every: usize| -> Vec<(f64, f64)> {
            let again = |k: usize| k % every == every - 1;
            (0..count).map(|k| (if again(k) { k - 1 } else { k } as f64, if again(k) { 3.0 } else { 1.0 })).collect()
        };
        let [held, others] = split(&[run(20, 4)]).unwrap();
        assert_eq!((held.count, held.mean(), others.count, others.mean()), (5, 9.0, 15, 1.0));
        // Three are few, each third is a slow sensor, and of a rounded sensor each second value is the last but one.
        assert!(split(&[run(12, 4)]).is_none() && split(&[run(30, 3)]).is_none());
        let six_of = |count: usize| -> Vec<(f64, f64)> {
            (0..count).map(|k| (if k % 2 == 1 && k < 12 { k - 1 } else { k } as f64, 1.0)).collect()
        };
        assert!(split(&[six_of(1_200)]).is_some() && split(&[six_of(1_201)]).is_none());
        assert!(split(&[(0..40).map(|k| (f64::from([0, 0, 1, 0, 1, 1, 0, 1][k % 8]), 1.0)).collect()]).is_none());
    }
}
