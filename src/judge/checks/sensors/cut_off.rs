//! Quantized outputs whose values may have been truncated instead of rounded.
//!
//! Truncation puts an offset of half a quantization step, on average, into an output, of which the unknowns take a part. The fit with that
//! offset is compared with the fit without it, by the slopes at the estimate.

use crate::judge::checks::data::{PART_OF_STEP, TIMES, distinct, steps};
use crate::judge::checks::*;
use crate::judge::evidence::extended::Extended;
use crate::optimize::Linearization;
use crate::rows::sensors::{KINDS, Kind};

/// With more values than these (6 bits) the offset of half a step is below a hundredth of the range.
const MOST: usize = 64;
/// Truncation is excluded where its offset raises the sum of squares by more than this many variances: three standard deviations.
const CERTAIN: f64 = 9.0;
/// Standard errors by which a parameter must move: the reach of a 95 % interval.
const FAR: f64 = 2.0;
/// Weight of the row that fixes the offset, relative to the norm of the offset's column: what the data say of it adds 1e-12.
const HELD: f64 = 1e6;

/// Outputs that may have been truncated, where that moves a parameter.
pub(super) fn cut_off(extended: &Extended<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let residuals = &extended.evidence.residuals.outputs;
    let coarse = |j: usize| {
        let (count, step) = steps(&distinct(&extended.evidence.point.objective.problem.records, j, MOST)?)?;
        let often = residuals[j].samples >= (TIMES * count) as u64;
        (often && residuals[j].rmse > PART_OF_STEP * step && !extended.evidence.rounded[j]).then_some((j, count, step))
    };
    let found = (0..extended.evidence.point.objective.outputs()).filter_map(coarse);
    found.filter_map(|(j, count, step)| if_cut_off(extended, unknowns, (j, count, step))).collect()
}

fn if_cut_off(extended: &Extended<'_>, unknowns: &[Unknown], (j, count, size): (usize, usize, f64)) -> Option<Warning> {
    let regressor = j * KINDS + Kind::ALL.iter().position(|kind| *kind == Kind::Offset)?;
    let place = extended.place(regressor);
    let held = extended.held(Some(regressor));
    let weight = HELD * extended.linear.column_norms()[place];
    let mut triangles: Vec<_> = extended.linear.columns().map(|(triangle, _)| triangle.clone()).collect();
    let (_, columns) = extended.linear.columns().next()?;
    let row: Vec<f64> = columns.iter().map(|column| if *column == place { weight } else { 0.0 }).collect();
    triangles[0].absorb_row(&row, -0.5 * weight * size);
    let shared = extended.place(extended.evidence.point.objective.outputs() * KINDS);
    let step = Linearization::new(0.0, shared, triangles).step(&vec![0.0; held.len()], &held)?;
    let without = extended.without()?;
    let gain = |step: &[f64]| 2.0 * extended.linear.predicted_reduction(step);
    let variance = (extended.linear.sum_of_squares() - gain(&without)) / extended.evidence.point.degrees;
    if gain(&without) - gain(&step) > CERTAIN * variance {
        return None;
    }
    let (name, part, errors) = extended.furthest(&step, unknowns).filter(|(.., errors)| *errors > FAR)?;
    let output = &extended.evidence.point.objective.problem.layout().outputs[j];
    let text = format!(
        "the output `{}` has {count} values, {}{} apart: if the sensor truncates instead of rounding, which the record does not \
         exclude, `{name}` is {} ({} standard errors) away from this estimate; add half a step to truncated values, or measure it finer",
        output.name,
        number(size, 3),
        unit_after(&output.unit),
        percent(part, 2),
        number(errors, 2)
    );
    Some(with_care(WarningCode::CoarseOutput, text).about(About::Output(j)))
}

#[cfg(test)]
mod tests {
    use super::{MOST, distinct, steps};
    use crate::Time;
    use crate::record::{Channel, Record};

    /// Values a multiple of a quarter apart, with gaps; others have no step. Few and many values are left out.
    #[test]
    fn steps_of_a_sensor() {
        let of = |count: usize, value: fn(usize) -> f64| {
            let channel = Channel::new("y", "", (0..count).map(value).collect::<Vec<f64>>());
            let record = Record::new(vec![], Time::Uniform { start: 0.0, step: 1.0 }, vec![], vec![channel]).unwrap();
            steps(&distinct(&[record], 0, MOST)?)
        };
        assert_eq!(of(40, |k| 3.0 + 0.25 * (k * k % 23) as f64), Some((12, 0.25)));
        assert_eq!(of(40, |k| (k % 12) as f64 + if k % 12 == 5 { 0.1 } else { 0.0 }), None);
        assert_eq!([64, 65].map(|count| of(count, |k| k as f64)), [Some((64, 1.0)), None]);
        assert_eq!(of(20, |k| (k % 8) as f64), None);
        assert_eq!(of(20, |k| if k % 2 == 0 { f64::NAN } else { k as f64 }), Some((10, 2.0)));
    }
}
