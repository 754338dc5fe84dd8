//! Whether a column holds each of its values for some samples, as that of a sensor which measures less often.

use super::Suspicion;
use core::ops::Range;

/// The fewest values that are looked at, and the part of them that stand for several samples.
const FEWEST: usize = 20;
const PART: f64 = 0.95;
/// Changes of up to so many times the smallest one are single steps of a rounded value. A slow movement that is rounded changes by single
/// steps, each after some samples, without a slow sensor.
const STEP: f64 = 1.5;

/// Values that stand for several samples each, nearly all of them, and change by more than single steps.
pub(super) fn held(values: &[f64], pieces: &[Range<usize>]) -> Option<Suspicion> {
    let (mut lengths, mut changes) = (vec![], vec![]);
    for piece in pieces {
        // The first and the last may go on outside of the piece.
        let runs: Vec<&[f64]> = values[piece.clone()].chunk_by(|a, b| a == b).collect();
        let inner = runs.get(1..runs.len().saturating_sub(1)).unwrap_or(&[]);
        lengths.extend(inner.iter().filter(|run| !run[0].is_nan()).map(|run| run.len()));
        changes.extend(runs.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs()).filter(|change| change.is_finite()));
    }
    let several = lengths.iter().filter(|length| **length > 1).count();
    if lengths.len() < FEWEST || (several as f64) < PART * lengths.len() as f64 {
        return None;
    }
    let least = changes.iter().copied().fold(f64::INFINITY, f64::min);
    let single = changes.iter().filter(|change| **change <= STEP * least).count();
    lengths.sort_unstable();
    (2 * single < changes.len()).then(|| Suspicion::Held { samples: lengths[lengths.len() / 2] })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between -1 and 1, no two alike.
    fn measured(k: usize) -> f64 {
        (1.7 * k as f64).sin() + 1e-3 * (k as f64 * 0.618).fract()
    }

    fn of(count: usize, value: impl Fn(usize) -> f64) -> Option<usize> {
        let values: Vec<f64> = (0..count).map(value).collect();
        let whole = 0..count;
        held(&values, std::slice::from_ref(&whole)).map(|found| match found {
            Suspicion::Held { samples } => samples,
            other => panic!("{other}"),
        })
    }

    /// Every second, every fourth, and as often as a clock of its own gives; not one that measures at every sample, nor one that holds
    /// each tenth value for one sample only.
    #[test]
    fn slow_sensors_hold_their_values() {
        assert_eq!(of(400, |k| measured(k / 2)), Some(2));
        assert_eq!(of(400, |k| measured(k / 4)), Some(4));
        assert_eq!(of(400, |k| measured((k as f64 / 3.4) as usize)), Some(3));
        assert_eq!(of(400, measured), None);
        assert_eq!(of(400, |k| measured(if k % 21 < 2 { 500 + k } else { k / 2 })), None);
        // 20 values between the first and the last.
        assert_eq!((of(44, |k| measured(k / 2)), of(42, |k| measured(k / 2))), (Some(2), None));
    }

    /// A rounded slow movement stands still as long, but changes by one step.
    #[test]
    fn rounded_values_are_no_slow_sensor() {
        assert_eq!(of(4_000, |k| (30.0 * (k as f64 / 300.0).sin()).round()), None);
        // Missing measurements between those of every fourth sample are none that were held.
        assert_eq!(of(400, |k| if k % 4 == 0 { measured(k) } else { f64::NAN }), None);
    }
}
