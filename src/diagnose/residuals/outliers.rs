//! Residuals that no normal distribution accounts for.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// One sample far off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outlier {
    /// Index of the sample, from zero.
    pub sample: u64,
    /// Its time (s).
    #[serde(with = "crate::real")]
    pub time: f64,
    /// The residual, in the output's unit.
    #[serde(with = "crate::real")]
    pub residual: f64,
    /// Its distance from the median in robust standard deviations.
    #[serde(with = "crate::real")]
    pub sigmas: f64,
}

const KEPT: usize = 20;
/// Ratio of the standard deviation of a normal distribution to the median absolute deviation.
const NORMAL_SPREAD: f64 = 1.4826;

/// The residuals further from the median than the largest of as many normal ones is with 99 % probability, in units of
/// the median absolute deviation (Hampel, J. American Statistical Association 69 (1974) 383).
pub(super) fn find(residuals: &[f64], times: &[f64]) -> (Vec<Outlier>, u64) {
    let mut values: Vec<f64> = residuals.iter().copied().filter(|e| e.is_finite()).collect();
    let median = middle(&mut values);
    values.iter_mut().for_each(|value| *value = (*value - median).abs());
    let sigma = NORMAL_SPREAD * middle(&mut values);
    if sigma == 0.0 {
        return (vec![], 0);
    }
    let limit = -Normal::standard().inverse_cdf(0.005 / values.len() as f64);
    let far = |(k, e): (usize, &f64)| {
        let sigmas = (e - median) / sigma;
        (sigmas.abs() > limit).then(|| Outlier { sample: k as u64, time: times[k], residual: *e, sigmas })
    };
    let mut found: Vec<Outlier> = residuals.iter().enumerate().filter_map(far).collect();
    let count = found.len() as u64;
    found.sort_by(|a, b| b.sigmas.abs().total_cmp(&a.sigmas.abs()));
    found.truncate(KEPT);
    (found, count)
}

fn middle(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}
