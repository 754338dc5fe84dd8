//! [`Residuals`]: what is left unexplained, in a few numbers and two pictures.

use serde::{Deserialize, Serialize};

/// Residuals of one output over one record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Residuals {
    /// Samples both measured and predicted.
    pub count: u64,
    /// Mean, in the output's unit.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// The largest in size, with its sign.
    pub largest: f64,
    /// Time of that one (s).
    pub largest_at: f64,
    /// How often which size occurs.
    pub histogram: Histogram,
    /// Autocorrelation at lag 1, 2, ... samples; empty if the residuals are too few or constant.
    pub autocorrelation: Vec<f64>,
}

/// Counts in bins of equal width.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Histogram {
    /// Lower edge of the first bin, in the output's unit.
    pub from: f64,
    /// Width of a bin.
    pub width: f64,
    /// Residuals in each bin.
    pub counts: Vec<u64>,
}

const LAGS: usize = 40;
const BINS: usize = 41;

impl Residuals {
    /// From the residuals and their times; what is not a number is left out.
    pub(super) fn new(t: &[f64], residuals: &[f64]) -> Residuals {
        let finite = || residuals.iter().copied().filter(|e| e.is_finite());
        let n = finite().count() as f64;
        let mean = if n > 0.0 { finite().sum::<f64>() / n } else { 0.0 };
        let rms = if n > 0.0 { (finite().map(|e| e * e).sum::<f64>() / n).sqrt() } else { 0.0 };
        let (largest, largest_at) = match largest(residuals) {
            Some(k) => (residuals[k], t[k]),
            None => (0.0, t.first().copied().unwrap_or(0.0)),
        };
        Residuals {
            count: n as u64,
            mean,
            rms,
            largest,
            largest_at,
            histogram: Histogram::new(residuals),
            autocorrelation: autocorrelation(residuals, mean),
        }
    }

    /// Where the autocorrelation of white residuals stays in 95 % of all lags: `1.96 / sqrt(N)`.
    pub fn white_bound(&self) -> f64 {
        1.96 / (self.count as f64).sqrt()
    }
}

/// Index of the largest residual in size.
pub(super) fn largest(residuals: &[f64]) -> Option<usize> {
    let finite = residuals.iter().enumerate().filter(|(_, e)| e.is_finite());
    finite.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map(|(k, _)| k)
}

impl Histogram {
    fn new(residuals: &[f64]) -> Histogram {
        let finite = || residuals.iter().copied().filter(|e| e.is_finite());
        let reach = finite().fold(0.0f64, |reach, e| reach.max(e.abs()));
        let width = 2.0 * reach / BINS as f64;
        if !(width > 0.0 && width.is_finite()) {
            return Histogram::default();
        }
        let mut counts = vec![0; BINS];
        for e in finite() {
            counts[(((e + reach) / width) as usize).min(BINS - 1)] += 1;
        }
        Histogram { from: -reach, width, counts }
    }
}

/// Sums over the pairs that are there (Box, Jenkins and Reinsel, *Time Series Analysis*, 1994, section 2.1.5).
fn autocorrelation(residuals: &[f64], mean: f64) -> Vec<f64> {
    let deviation = |e: f64| if e.is_finite() { e - mean } else { 0.0 };
    let variance: f64 = residuals.iter().map(|&e| deviation(e).powi(2)).sum();
    if !(variance > 0.0 && variance.is_finite()) {
        return vec![];
    }
    let lags = LAGS.min(residuals.len() / 4);
    let at = |lag: usize| {
        let pairs = residuals.iter().zip(&residuals[lag..]);
        pairs.map(|(&a, &b)| deviation(a) * deviation(b)).sum::<f64>() / variance
    };
    (1..=lags).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a cosine of period 8 over whole periods: mean 0, rms 1/sqrt 2, autocorrelation `(1 - lag/N) cos(lag pi/4)`
    /// but for the ends, which are below one period of N.
    #[test]
    fn a_cosine_by_hand() {
        let n = 8000;
        let t: Vec<f64> = (0..n).map(|k| k as f64).collect();
        let e: Vec<f64> = t.iter().map(|t| (t * core::f64::consts::FRAC_PI_4).cos()).collect();
        let found = Residuals::new(&t, &e);
        assert!(found.mean.abs() < 1e-12 && (found.rms - 0.5f64.sqrt()).abs() < 1e-12, "{found:?}");
        assert_eq!((found.largest, found.largest_at), (e[largest(&e).unwrap()], largest(&e).unwrap() as f64));
        assert_eq!(found.histogram.counts.iter().sum::<u64>(), n as u64);
        for (i, r) in found.autocorrelation.iter().enumerate() {
            let lag = (i + 1) as f64;
            let expected = (1.0 - lag / n as f64) * (lag * core::f64::consts::FRAC_PI_4).cos();
            assert!((r - expected).abs() < 8.0 / n as f64, "lag {lag}: {r} {expected}");
        }
    }

    #[test]
    fn nothing_measured_makes_no_nan() {
        for e in [vec![], vec![f64::NAN; 5], vec![0.0; 5]] {
            let found = Residuals::new(&vec![0.0; e.len()], &e);
            assert_eq!((found.mean, found.rms, found.largest), (0.0, 0.0, 0.0));
            assert!(found.autocorrelation.is_empty() && found.histogram.counts.is_empty());
        }
    }
}
