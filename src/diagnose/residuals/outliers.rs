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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 101 residuals -50 to 50 the median is zero and the deviation 1.4826 times 25; the limit is the quantile of which each side has
    /// 0.005 in 101: 3.89301. Moved by 7, with a missing one that does not count.
    #[test]
    fn residuals_beyond_the_limit() {
        let sigma = 1.4826 * 25.0;
        let found = |last: f64| {
            let mut residuals: Vec<f64> = (-50..=49).map(|k| 7.0 + f64::from(k)).collect();
            residuals.extend([f64::NAN, 7.0 + last * sigma]);
            let times: Vec<f64> = (0..102).map(|k| 0.5 * f64::from(k)).collect();
            find(&residuals, &times)
        };
        assert!(found(3.8929).0.is_empty());
        let (outliers, count) = found(3.8931);
        assert_eq!((count, outliers[0].sample, outliers[0].time), (1, 101, 50.5));
        assert!((outliers[0].residual - (7.0 + 3.8931 * sigma)).abs() < 1e-12);
        assert!((outliers[0].sigmas - 3.8931).abs() < 1e-12, "{outliers:?}");
    }

    /// The largest twenty are kept, the largest first, and all are counted; residuals of which more than half are one number have no
    /// deviation.
    #[test]
    fn many_outliers() {
        let mut residuals: Vec<f64> = (0..100).map(|k| f64::from(k % 5)).collect();
        residuals.extend((1..=25).map(|k| 1e3 * f64::from(k) * if k % 2 == 0 { 1.0 } else { -1.0 }));
        let (outliers, count) = find(&residuals, &[0.0; 125]);
        let kept: Vec<f64> = outliers.iter().map(|outlier| outlier.residual.abs()).collect();
        assert_eq!((count, kept), (25, (6..=25).rev().map(|k| 1e3 * f64::from(k)).collect()));
        assert_eq!(find(&[1.0, 1.0, 1.0, 9.0], &[0.0; 4]), (vec![], 0));
    }
}
