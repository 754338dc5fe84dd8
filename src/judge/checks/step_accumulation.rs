//! Over how many windows the errors of steps add up.
//!
//! The step of a method is compared with a finer one in windows that begin where the coarse simulation stands. The difference at the
//! end of a window persists in the next ones until the state has decayed: the phase errors of a resonator of high quality add up over the
//! whole record.

use crate::judge::evidence::Evidence;
use crate::judge::evidence::modes::{eigenvalues, some};
use crate::record::{Record, Time};

/// Samples of the shortest windows that are compared.
const WINDOW: f64 = 64.0;

/// An upper bound of the ratio of the whole record's differences to those within windows, from the slowest decay of the state at some
/// points along the records. One for predictions that restart.
pub(crate) fn windows_add_up(evidence: &Evidence<'_>) -> f64 {
    let objective = evidence.point.objective;
    if objective.sweep.restarts().is_some() {
        return 1.0;
    }
    let of = |point| eigenvalues(objective, &evidence.point.end.coordinates, point);
    let slowest = some(&evidence.residuals.points).filter_map(of).flatten().map(|value| value.re).reduce(f64::max);
    let Some(decay) = slowest else { return 1.0 };
    let records = objective.problem.records.iter();
    records.map(|record| sum(decay * WINDOW * interval(record), record.len() as f64 / WINDOW)).fold(1.0, f64::max)
}

/// The sum of a geometric series with so many terms, one per window; `exponent` is the logarithm of the decay over a window.
fn sum(exponent: f64, windows: f64) -> f64 {
    if exponent >= 0.0 {
        return windows.max(1.0);
    }
    (exponent * windows).exp_m1() / exponent.exp_m1()
}

/// The mean time between samples (s).
fn interval(record: &Record) -> f64 {
    match record.times() {
        Time::Uniform { step, .. } => *step,
        Time::Stamps(stamps) => match stamps.as_slice() {
            [first, .., last] => (last - first) / (stamps.len() - 1) as f64,
            _ => 0.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::sum;

    /// Ten windows without decay, ten with a decay by half each, and infinitely many with a decay to a third each.
    #[test]
    fn changes_of_windows_by_hand() {
        assert_eq!([sum(0.0, 10.0), sum(0.1, 10.0), sum(0.0, 0.5)], [10.0, 10.0, 1.0]);
        let halves: f64 = (0..10).map(|k| 0.5f64.powi(k)).sum();
        assert!((sum(-std::f64::consts::LN_2, 10.0) - halves).abs() < 1e-14);
        assert!((sum(-3f64.ln(), 1e6) - 1.5).abs() < 1e-14);
    }
}
