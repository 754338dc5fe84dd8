//! Running sums of an output and its errors.

use crate::estimate::OutputFit;
use crate::wide::{self, Task, Wide, Width};

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
        let [sum, squares, of_errors, fourth] = wide::run(Width::widest(), Moments { values, errors, first });
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

/// Numbers of a block of the sums below, so that their bits do not depend on the registers.
const BLOCK: usize = 8;

/// Sums of the values relative to `first`, of their squares, and of the second and the fourth powers of as many errors.
struct Moments<'m> {
    values: &'m [f64],
    errors: &'m [f64],
    first: f64,
}

impl Task for Moments<'_> {
    type Output = [f64; 4];

    #[inline(always)]
    fn run<W: Wide>(self) -> [f64; 4] {
        let Moments { values, errors, first } = self;
        let whole = values.len() - values.len() % BLOCK;
        let mut totals = [[0.0; BLOCK]; 4];
        let mut begin = 0;
        while begin < BLOCK {
            let mut sums = [W::splat(0.0); 4];
            let mut k = begin;
            while k < whole {
                let (y, error) = (W::load(&values[k..]).sub(W::splat(first)), W::load(&errors[k..]));
                let square = error.mul(error);
                let terms = [y, y.mul(y), square, square.mul(square)];
                let mut i = 0;
                while i < 4 {
                    sums[i] = sums[i].add(terms[i]);
                    i += 1;
                }
                k += BLOCK;
            }
            let mut i = 0;
            while i < 4 {
                sums[i].store(&mut totals[i][begin..]);
                i += 1;
            }
            begin += W::LANES;
        }
        let mut k = whole;
        while k < values.len() {
            let (y, square) = (values[k] - first, errors[k] * errors[k]);
            let terms = [y, y * y, square, square * square];
            let mut i = 0;
            while i < 4 {
                totals[i][k - whole] += terms[i];
                i += 1;
            }
            k += 1;
        }
        totals.map(|parts| parts.iter().sum())
    }
}

/// The fit of an output from its measured values and their errors; NaN where missing.
pub(crate) fn output_fit(measured: &[f64], residuals: &[f64]) -> OutputFit {
    let mut sums = OutputSums::default();
    for (&y, &error) in measured.iter().zip(residuals).filter(|(_, error)| !error.is_nan()) {
        sums.add(y, error);
    }
    sums.fit()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One by one, all at once and in pieces: mean, deviation, kurtosis `n sum e^4 / (sum e^2)^2`, rms and fit of the definitions.
    #[test]
    fn sums_are_the_definitions() {
        let values: Vec<f64> = (0..21).map(|k| 1000.0 + f64::from(k * k % 13)).collect();
        let errors: Vec<f64> = (0..21).map(|k| f64::from(k * 7 % 5) - 1.5).collect();
        let mut one_by_one = OutputSums::default();
        values.iter().zip(&errors).for_each(|(y, e)| one_by_one.add(*y, *e));
        let all = |from: usize, to: usize| {
            let mut sums = OutputSums::default();
            sums.add_all(&values[from..to], &errors[from..to]);
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
