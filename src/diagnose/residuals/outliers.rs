//! Residuals that no normal distribution accounts for.

use crate::outliers::center_and_deviation;
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

/// The residuals further from the median than the largest of as many normal ones is with 99 % probability, in units of
/// the median absolute deviation (Hampel, J. American Statistical Association 69 (1974) 383).
pub(super) fn find(residuals: &[f64], times: &[f64]) -> (Vec<Outlier>, u64) {
    let mut values: Vec<f64> = residuals.iter().copied().filter(|e| e.is_finite()).collect();
    let Some((median, sigma)) = center_and_deviation(&mut values).filter(|(_, sigma)| *sigma > 0.0) else {
        return (vec![], 0);
    };
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
