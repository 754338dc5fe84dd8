//! [`Likelihood`]: the sum over errors that were standardized by predicted variances, without loss and weights.

use crate::wide::{Task, Wide};
use std::f64::consts::FRAC_1_SQRT_2;

/// Rows whose variances are multiplied before a logarithm is taken.
const ROWS: usize = 8;
/// The product of eight variances between this and its inverse is between 1e-296 and 1e296; logarithms of others are summed one by one.
const SAFE: f64 = 1e-37;

/// For standardized errors `z` and their predicted variances `v`, zero where nothing was measured: adds `z^2 + ln v` to the sum of each lane, and
/// writes `(z^2 - 1) / sqrt(2)`, the error of the variance's row, over `v`. Where variances repeat themselves there is a row for each output,
/// which is left as it is.
pub(super) struct Likelihood<'l> {
    pub rows: &'l [f64],
    pub variances: &'l mut [f64],
    pub columns: usize,
    pub sums: &'l mut [f64],
}

impl Task for Likelihood<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Likelihood { rows, variances, columns, sums } = self;
        let lanes = sums.len();
        let (width, last) = (columns * lanes, (columns - 1) * lanes);
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let (all, there) = (rows.len(), variances.len());
        let variance_of = |at: usize| if there == all { at } else { at % there };
        for begin in (0..all).step_by(ROWS * width) {
            let end = all.min(begin + ROWS * width);
            for first in (0..lanes - lanes % W::LANES).step_by(W::LANES) {
                let places = (begin + last + first..end).step_by(width);
                let (mut sum, mut product, mut least, mut largest) = (zero, one, one, one);
                for at in places.clone() {
                    let (z, v) = (W::load(&rows[at..]), W::load(&variances[variance_of(at)..]));
                    let measured = v.select_eq(zero, one, v);
                    (sum, product) = (z.mul_add(z, sum), product.mul(measured));
                    least = measured.select_lt(least, measured, least);
                    largest = largest.select_lt(measured, measured, largest);
                }
                if W::splat(SAFE).sub(least).all_below(0.0) && largest.all_below(1.0 / SAFE) {
                    sum = sum.add(product.map(f64::ln));
                } else {
                    for at in places.clone() {
                        let v = W::load(&variances[variance_of(at)..]);
                        sum = sum.add(v.select_eq(zero, one, v).map(f64::ln));
                    }
                }
                W::load(&sums[first..]).add(sum).store(&mut sums[first..]);
                for at in places.filter(|_| there == all) {
                    let (z, v) = (W::load(&rows[at..]), W::load(&variances[at..]));
                    let error = z.mul(z).sub(one).mul(W::splat(FRAC_1_SQRT_2));
                    v.select_eq(zero, zero, error).store(&mut variances[at..]);
                }
            }
            for (lane, sum) in sums.iter_mut().enumerate().skip(lanes - lanes % W::LANES) {
                for at in (begin + last + lane..end).step_by(width) {
                    let (square, v) = (rows[at] * rows[at], variances[variance_of(at)]);
                    if v != 0.0 {
                        *sum += square + v.ln();
                        if there == all {
                            variances[at] = (square - 1.0) * FRAC_1_SQRT_2;
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wide::{self, Width};

    /// Errors of 0.5 to 12 with variances of 1e-60 to 1e60, one of them not measured, in nine lanes of twenty samples: the sums and errors of each by
    /// hand, to rounding.
    #[test]
    fn sums_are_those_of_each_measurement() {
        let (lanes, columns, samples) = (9, 2, 20);
        for wide in [1.0, 60.0] {
            let z = |k: usize, lane: usize| 0.5 + (k * lane % 24) as f64 / 2.0;
            let v = |k: usize, lane: usize| match k == 7 && lane.is_multiple_of(2) {
                true => 0.0,
                false => 10f64.powf(wide * ((k + 3 * lane) % 11) as f64 / 5.0 - wide),
            };
            let rows = |last: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
                let entry = |at: usize| match at / lanes % columns {
                    0 => 77.0,
                    _ => last(at / lanes / columns, at % lanes),
                };
                (0..samples * columns * lanes).map(entry).collect()
            };
            // Nothing was measured: no error.
            let errors = rows(&|k, lane| if v(k, lane) == 0.0 { 0.0 } else { z(k, lane) });
            for width in [Width::widest(), Width::portable(), Width::single()] {
                let (mut variances, mut sums) = (rows(&v), vec![1.0; lanes]);
                wide::run(width, Likelihood { rows: &errors, variances: &mut variances, columns, sums: &mut sums });
                for lane in 0..lanes {
                    let measured = (0..samples).filter(|k| v(*k, lane) != 0.0);
                    let right: f64 = measured.map(|k| z(k, lane).powi(2) + v(k, lane).ln()).sum::<f64>() + 1.0;
                    assert!((sums[lane] / right - 1.0).abs() < 1e-13, "{lane} {} {right}", sums[lane]);
                    for k in 0..samples {
                        let square = z(k, lane).powi(2);
                        let right = if v(k, lane) == 0.0 { 0.0 } else { (square - 1.0) / 2f64.sqrt() };
                        let found = variances[(k * columns + 1) * lanes + lane];
                        assert!((found - right).abs() <= 1e-14 * square, "{found} {right}");
                        assert_eq!(variances[k * columns * lanes + lane], 77.0);
                    }
                }
            }
        }
    }
}
