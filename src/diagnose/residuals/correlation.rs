//! Correlation of residuals with what went in and what was measured before.

use super::{Series, SignalRole};
use crate::diagnose::{LEVEL, Test};
use crate::whiteness::dot;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// Correlation of residuals with another signal over lags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correlation {
    /// Name of the signal.
    pub signal: String,
    /// Its role: an input or a measured output.
    pub role: SignalRole,
    /// The first lag (samples): the signal this much before the residual; negative where it comes after.
    pub first_lag: i64,
    /// Correlation at that lag and the following ones.
    #[serde(with = "crate::real")]
    pub values: Vec<f64>,
    /// The first lag that the test looks at; it looks at all lags from there on.
    pub tested_from: i64,
    /// Without correlation all tested lags stay within plus and minus this with 99 % probability: the test fails where one
    /// does not. It allows for the two signals' own autocorrelations (Bartlett; Ljung, *System Identification*, 1999, eq.
    /// 16.65).
    #[serde(with = "crate::real")]
    pub band: f64,
    /// The test's probability of correlations so large if there is none.
    #[serde(with = "crate::real")]
    pub p_value: f64,
}

/// Sum of `a[t] b[t - k]` for `k = 0..=lags`, in pieces that stay close to the processor for all lags.
pub(super) fn lagged(a: &[f64], b: &[f64], lags: usize) -> Vec<f64> {
    const PIECE: usize = 1024;
    let n = a.len().min(b.len());
    let mut sums = vec![0.0; lags + 1];
    for begin in (0..n).step_by(PIECE) {
        let end = (begin + PIECE).min(n);
        for (k, sum) in sums.iter_mut().enumerate() {
            let first = begin.max(k).min(end);
            *sum += dot(&a[first..end], &b[first.saturating_sub(k)..]);
        }
    }
    sums
}

pub(super) fn between(residuals: &Series, own: &[f64], role: SignalRole, signal: &Series) -> (Correlation, Test) {
    let lags = residuals.lags();
    let (e, s) = (&residuals.values, &signal.values);
    let common = match residuals.missing.is_empty() && signal.missing.is_empty() {
        true => e.len() as f64,
        false => (0..e.len()).filter(|&k| !residuals.is_missing(k) && !signal.is_missing(k)).count() as f64,
    }
    .max(1.0);
    let scale = (common * residuals.deviation * signal.deviation).recip();
    let (before, after) = (lagged(s, e, lags), lagged(e, s, lags));
    let values: Vec<f64> = before[1..].iter().rev().chain(&after).map(|sum| sum * scale).collect();
    let both: f64 = own.iter().zip(signal.autocorrelation()).map(|(a, b)| a * b).sum();
    let deviation = ((1.0 + 2.0 * both).max(0.1) / common).sqrt();

    // Residuals go with their own output of the same sample by construction: only its past is tested.
    let is_output = role == SignalRole::MeasuredOutput;
    let tested_from = i64::from(is_output);
    let tested = &values[lags + usize::from(is_output)..];
    let largest = tested.iter().fold(0.0f64, |m, r| m.max(r.abs())) / deviation;
    // The largest of many, as if they were independent: on the safe side where they are not.
    let count = tested.len() as f64;
    let single = 2.0 * Normal::standard().sf(largest);
    let p_value = -(count * (-single).ln_1p()).exp_m1();
    // Where the largest of so many has the probability of the level.
    let one_lag = -((-LEVEL).ln_1p() / count.max(1.0)).exp_m1();
    let band = -Normal::standard().inverse_cdf(one_lag / 2.0) * deviation;
    // An input that only goes with the residuals of its own sample may have been computed from the measurement.
    let before = tested[usize::from(!is_output)..].iter().any(|r| r.abs() > band);
    let failed = match (is_output, before) {
        (false, true) => format!(
            "the residuals follow from the input `{0}` of the samples before: what it does to `{1}` is missing or wrong in the model (a \
             term, a delay, a nonlinearity), or colored noise is fed back to it",
            signal.name, residuals.name
        ),
        (false, false) => format!(
            "the residuals go with the input `{0}` of the same sample: a controller computed it from the measurement of `{1}`, or it acts \
             on `{1}` without delay otherwise than the model says",
            signal.name, residuals.name
        ),
        (true, _) => format!(
            "the residuals follow from `{}` measured before: the model misses dynamics of `{}`, or its noise is colored",
            signal.name, residuals.name
        ),
    };
    let test = Test::new(
        format!("cross-correlation with {role} `{}`", signal.name),
        largest,
        p_value,
        "nothing of it is left in the residuals",
        &failed,
    );
    let correlation = Correlation {
        signal: signal.name.to_owned(),
        role,
        first_lag: -(lags as i64),
        values,
        tested_from,
        band,
        p_value,
    };
    (correlation, test)
}

#[cfg(test)]
mod tests {
    use super::lagged;

    /// The definition, over more than one piece and fewer samples than lags.
    #[test]
    fn pieces_make_the_whole() {
        for n in [3, 1500] {
            let (a, b): (Vec<f64>, Vec<f64>) = (0..n).map(|k| ((k as f64 * 0.37).sin(), (k as f64).sqrt())).unzip();
            for (k, found) in lagged(&a, &b, 5).into_iter().enumerate() {
                let expected: f64 = (k..n).map(|t| a[t] * b[t - k]).sum();
                assert!((found - expected).abs() < 1e-9, "{n} samples, lag {k}: {found} {expected}");
            }
        }
    }
}
