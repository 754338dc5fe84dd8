//! Running sums of an output and its errors.

use crate::estimate::OutputFit;
use crate::wide::{Terms, Wide, sums};

/// Sums over the measurements of an output.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OutputSums {
    pub count: u64,
    first: f64,
    sum: f64,
    squares: f64,
    errors: f64,
    fourth: f64,
}

impl OutputSums {
    /// Adds measured values and their errors. Relative to the first value, so that a large mean loses no digits.
    pub fn add(&mut self, values: &[f64], errors: &[f64]) {
        let Some(first) = values.first() else { return };
        if self.count == 0 {
            self.first = *first;
        }
        let first = self.first;
        self.count += values.len() as u64;
        let [sum, squares, of_errors, fourth] = sums([values, errors], Moments { first });
        self.sum += sum;
        self.squares += squares;
        self.errors += of_errors;
        self.fourth += fourth;
    }

    /// As if the other's values had been added after its own.
    pub fn append(&mut self, other: &OutputSums) {
        if other.count == 0 {
            return;
        }
        if self.count == 0 {
            *self = *other;
            return;
        }
        let (shift, n) = (other.first - self.first, other.count as f64);
        self.squares += other.squares + 2.0 * shift * other.sum + n * shift * shift;
        self.sum += other.sum + n * shift;
        self.errors += other.errors;
        self.fourth += other.fourth;
        self.count += other.count;
    }

    /// Mean and standard deviation of the values.
    pub fn level(&self) -> (f64, f64) {
        let n = self.count.max(1) as f64;
        let spread = (self.squares - self.sum * self.sum / n).max(0.0);
        (self.first + self.sum / n, (spread / n).sqrt())
    }

    /// Of errors that are none, zero.
    pub fn kurtosis(&self) -> f64 {
        let square = self.errors * self.errors;
        if square > 0.0 { self.count as f64 * self.fourth / square } else { 0.0 }
    }

    pub fn fit(&self) -> OutputFit {
        let n = self.count as f64;
        let spread = self.squares - self.sum * self.sum / n;
        let fit_percent = (spread > 0.0).then(|| 100.0 * (1.0 - (self.errors / spread).sqrt()));
        OutputFit {
            samples: self.count,
            rmse: if self.count > 0 { (self.errors / n).sqrt() } else { 0.0 },
            fit_percent,
            sigma: 0.0,
        }
    }
}

/// A value relative to `first`, its square, and the second and the fourth power of its error.
#[derive(Clone, Copy)]
struct Moments {
    first: f64,
}

impl Terms<2, 4> for Moments {
    #[inline(always)]
    fn of<W: Wide>(self, [y, error]: [W; 2]) -> [W; 4] {
        let (y, square) = (y.sub(W::splat(self.first)), error.mul(error));
        [y, y.mul(y), square, square.mul(square)]
    }
}

/// The fit of an output from its measured values and their errors; NaN where missing.
pub(crate) fn output_fit(measured: &[f64], residuals: &[f64]) -> OutputFit {
    let pairs = measured.iter().zip(residuals).filter(|(_, error)| !error.is_nan());
    let (values, errors): (Vec<f64>, Vec<f64>) = pairs.unzip();
    let mut sums = OutputSums::default();
    sums.add(&values, &errors);
    sums.fit()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Without a measurement the errors have no size, and there is nothing to fit.
    #[test]
    fn no_measurements() {
        let OutputFit { samples, rmse, fit_percent, .. } = output_fit(&[f64::NAN; 2], &[f64::NAN; 2]);
        assert_eq!((samples, rmse, fit_percent), (0, 0.0, None));
        assert_eq!((OutputSums::default().level(), OutputSums::default().kurtosis()), ((0.0, 0.0), 0.0));
    }

    /// One by one, all at once and in pieces: mean, deviation, kurtosis `n sum e^4 / (sum e^2)^2`, rms and fit of the definitions.
    #[test]
    fn sums_are_the_definitions() {
        let values: Vec<f64> = (0..21).map(|k| 1000.0 + f64::from(k * k % 13)).collect();
        let errors: Vec<f64> = (0..21).map(|k| f64::from(k * 7 % 5) - 1.5).collect();
        let mut one_by_one = OutputSums::default();
        values.iter().zip(&errors).for_each(|(y, e)| one_by_one.add(&[*y], &[*e]));
        let all = |from: usize, to: usize| {
            let mut sums = OutputSums::default();
            sums.add(&values[from..to], &errors[from..to]);
            sums
        };
        let mut pieces = OutputSums::default();
        for piece in [all(0, 0), all(0, 2), all(2, 12), all(12, 21)] {
            pieces.append(&piece);
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / 21.0;
        let power = |by: i32, from: f64, values: &[f64]| values.iter().map(|v| (v - from).powi(by)).sum::<f64>();
        let (level, squares) = (mean(&values), power(2, 0.0, &errors));
        let spread = power(2, level, &values);
        for sums in [one_by_one, all(0, 21), pieces] {
            // Values of 1000 leave 13 digits of differences of 1.
            let (found, deviation) = sums.level();
            assert!((found - level).abs() < 1e-9 && (deviation - (spread / 21.0).sqrt()).abs() < 1e-9, "{sums:?}");
            assert!((sums.kurtosis() - 21.0 * power(4, 0.0, &errors) / squares.powi(2)).abs() < 1e-12, "{sums:?}");
            let fit = sums.fit();
            assert_eq!(fit.samples, 21);
            assert!((fit.rmse - (squares / 21.0).sqrt()).abs() < 1e-12, "{fit:?}");
            assert!((fit.fit_percent.unwrap() - 100.0 * (1.0 - (squares / spread).sqrt())).abs() < 1e-9, "{fit:?}");
        }
        assert_eq!(all(0, 0).kurtosis(), 0.0);
        let still = output_fit(&[5.0; 4], &[1.0, -1.0, f64::NAN, 1.0]);
        assert_eq!((still.samples, still.rmse, still.fit_percent), (3, 1.0, None));
    }
}
