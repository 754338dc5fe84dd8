//! Mean and shape of the residuals' distribution.

use super::{Residuals, Series};
use crate::diagnose::Test;
use crate::whiteness::chi_squared_tail;
use statrs::distribution::{ContinuousCDF, Normal};

/// Whether the mean is zero, by its standard error from the effective number of residuals.
pub(super) fn mean(residuals: &Series, effective: f64) -> Test {
    let z = residuals.mean / (residuals.deviation / effective.sqrt());
    Test::new(
        "zero mean",
        z,
        2.0 * Normal::standard().sf(z.abs()),
        "the model is right on average",
        "the model is off on average: an offset of a sensor, or a constant load, is missing as a parameter",
    )
}

const NORMAL: &str = "the residuals may be normal, as least squares wants them for its best";
const NOT_NORMAL: &str = "the residuals are not normal: outliers (whose influence a robust loss bounds), switching between \
                          regimes, or steps of a converter; estimates stand, but squared errors do not give the most precise ones";

/// Jarque and Bera's test (International Statistical Review 55 (1987) 163) and Anderson and Darling's with Stephens'
/// p-values (D'Agostino and Stephens, *Goodness-of-Fit Techniques*, 1986, table 4.9). Both take the residuals to be
/// independent. White ones are taken as they are; else Jarque and Bera's test counts the effective number, which its name
/// says, and Anderson and Darling's takes so many of them, evenly.
pub(super) fn shape(residuals: &Series, white: bool, result: &mut Residuals) {
    let n = residuals.count as f64;
    let independent = if white { n } else { result.effective_samples };
    let (mut third, mut fourth) = (0.0, 0.0);
    for e in &residuals.values {
        let square = e * e;
        third += square * e;
        fourth += square * square;
    }
    let sigma = residuals.deviation;
    result.skewness = third / n / sigma.powi(3);
    result.excess_kurtosis = fourth / n / sigma.powi(4) - 3.0;
    let statistic = independent / 6.0 * (result.skewness.powi(2) + result.excess_kurtosis.powi(2) / 4.0);
    let p_value = chi_squared_tail(statistic, 2.0);
    let name = if independent < n { "Jarque-Bera, effective number of residuals" } else { "Jarque-Bera" };
    result.tests.push(Test::new(name, statistic, p_value, NORMAL, NOT_NORMAL));

    // More than a few thousand tell nothing new, and every distribution is not normal in the tenth digit.
    let wanted = independent.clamp(8.0, 5000.0);
    let every = (n / wanted).ceil().max(1.0) as usize;
    let present = (0..residuals.values.len()).filter(|&k| !residuals.is_missing(k));
    let mut sample: Vec<f64> = present.step_by(every).map(|k| residuals.values[k]).collect();
    if sample.len() >= 8 {
        let (statistic, p_value) = anderson_darling(&mut sample);
        result.tests.push(Test::new("Anderson-Darling", statistic, p_value, NORMAL, NOT_NORMAL));
    }
}

/// Statistic (corrected for the estimated mean and deviation) and p-value.
fn anderson_darling(sample: &mut [f64]) -> (f64, f64) {
    sample.sort_unstable_by(f64::total_cmp);
    let n = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / n;
    let sigma = (sample.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    if sigma == 0.0 {
        return (f64::MAX, 0.0);
    }
    let normal = Normal::standard();
    let log = |p: f64| p.max(f64::MIN_POSITIVE).ln();
    let below: Vec<f64> = sample.iter().map(|v| log(normal.cdf((v - mean) / sigma))).collect();
    let above: Vec<f64> = sample.iter().map(|v| log(normal.sf((v - mean) / sigma))).collect();
    let sum: f64 = (0..sample.len()).map(|i| (2.0 * i as f64 + 1.0) * (below[i] + above[sample.len() - 1 - i])).sum();
    let a = (-n - sum / n) * (1.0 + 0.75 / n + 2.25 / (n * n));
    let p = match a {
        a if a < 0.2 => 1.0 - (-13.436 + 101.14 * a - 223.73 * a * a).exp(),
        a if a < 0.34 => 1.0 - (-8.318 + 42.796 * a - 59.938 * a * a).exp(),
        a if a < 0.6 => (0.9177 - 4.279 * a - 1.38 * a * a).exp(),
        a if a < 153.0 => (1.2937 - 5.709 * a + 0.0186 * a * a).exp(),
        _ => 0.0,
    };
    (a, p.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::anderson_darling;

    /// Quantiles of a normal distribution at 0.525, 0.575, ..., to two digits.
    const QUANTILES: [f64; 10] = [0.06, 0.19, 0.32, 0.45, 0.6, 0.76, 0.93, 1.15, 1.44, 1.96];

    /// Twenty quantiles with so much of their square added: the more, the less normal.
    fn bent(by: f64) -> Vec<f64> {
        QUANTILES.iter().flat_map(|q| [*q, -q]).map(|q| q + by * q * q).collect()
    }

    /// Statistic and p-value are those of statsmodels 0.14 (`normal_ad`, which gives the statistic without the correction for
    /// n), one sample for each part of the table of p-values, and one that is not in order.
    #[test]
    fn anderson_darling_is_that_of_statsmodels() {
        let even: Vec<f64> = (0..20).map(|k| f64::from(k * 7 % 20)).collect();
        let cases = [
            (bent(0.1), 0.117_941_395_262_413_1, 0.987_466_097_262_446_5),
            (even, 0.220_737_841_656_301_73, 0.806_355_061_328_374_4),
            (bent(0.2), 0.337_968_502_484_116_6, 0.466_569_154_112_353_6),
            (bent(0.3), 0.698_013_745_779_430_6, 0.057_656_570_751_536_27),
            (bent(1.0), 1.597_308_979_814_400_2, 2.838_802_295_283_163_6e-4),
        ];
        for (mut sample, statistic, p_value) in cases {
            let (found, p) = anderson_darling(&mut sample);
            // statrs has the normal distribution to 1e-10.
            let expected = statistic * (1.0 + 0.75 / 20.0 + 2.25 / 400.0);
            assert!(
                (found / expected - 1.0).abs() < 1e-8 && (p / p_value - 1.0).abs() < 1e-7,
                "{found} {expected} {p}"
            );
        }
        assert_eq!(anderson_darling(&mut [3.0; 9]), (f64::MAX, 0.0));
    }
}
