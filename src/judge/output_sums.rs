//! Running sums of an output and its errors.

use crate::estimate::OutputFit;
use crate::whiteness::dot;

/// Sums over the measurements of an output.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OutputSums {
    pub count: u64,
    first: f64,
    sum: f64,
    squares: f64,
    errors: f64,
    fourth: f64,
}

impl OutputSums {
    pub fn add(&mut self, y: f64, error: f64) {
        if self.count == 0 {
            self.first = y;
        }
        // Relative to the first value, so that a large mean loses no digits.
        let y = y - self.first;
        self.count += 1;
        self.sum += y;
        self.squares += y * y;
        self.errors += error * error;
        self.fourth += (error * error).powi(2);
    }

    /// Adds values, all of which were measured.
    pub fn add_all(&mut self, values: &[f64], errors: &[f64]) {
        let Some(first) = values.first() else { return };
        if self.count == 0 {
            self.first = *first;
        }
        let first = self.first;
        self.count += values.len() as u64;
        self.sum += total(values.iter().map(|y| y - first));
        self.squares += total(values.iter().map(|y| (y - first) * (y - first)));
        self.errors += dot(errors, errors);
        self.fourth += total(errors.iter().map(|error| (error * error) * (error * error)));
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

/// A sum in accumulators that the compiler may keep in vector lanes.
fn total(numbers: impl ExactSizeIterator<Item = f64>) -> f64 {
    let mut sums = [0.0; 4];
    numbers.enumerate().for_each(|(k, number)| sums[k % 4] += number);
    sums.iter().sum()
}

/// The fit of an output from its measured values and their errors; NaN where missing.
pub(crate) fn output_fit(measured: &[f64], residuals: &[f64]) -> OutputFit {
    let mut sums = OutputSums::default();
    for (&y, &error) in measured.iter().zip(residuals).filter(|(_, error)| !error.is_nan()) {
        sums.add(y, error);
    }
    sums.fit()
}
