//! Rows of a window that differ from sample to sample in their errors only, as two rows with the same sum of squares.

use crate::sweep::Window;
use crate::wide::{self, Task, Wide};
use std::f64::consts::FRAC_1_SQRT_2;

/// Joins the rows of the variances of each output, in lanes where they are the same at all samples: `n` rows `s x + e_k` become `sqrt(n) (s x + mean e)` and
/// the root of the sum of squares about that mean, in the rows of the first two samples. Returns how many samples have rows then: two where the rows of the
/// first sample stand for all, whose errors follow from the standardized ones; elsewhere all, with zeros after the first two.
pub(super) fn joined(window: &mut Window) -> usize {
    let (lanes, outputs, last) = (window.lanes(), window.outputs(), window.columns() - 1);
    let (len, repeated) = (window.len(), window.is_repeated());
    let (mut sums, mut squares) = (vec![0.0; outputs * lanes], vec![0.0; outputs * lanes]);
    for (k, output) in (0..len).flat_map(|k| (0..outputs).map(move |output| (k, output))) {
        let row = if repeated { window.row(k, output) } else { window.variance_row(k, output) };
        let of_output = output * lanes..(output + 1) * lanes;
        let (sums, squares) = (&mut sums[of_output.clone()], &mut squares[of_output]);
        wide::run(window.width, Sums { numbers: &row[last * lanes..], standardized: repeated, sums, squares });
    }
    let count = |lane: usize| match window.settled >> lane & 1 == 1 {
        _ if repeated => len,
        true => window.samples[lane],
        false => 0,
    };
    let counts: Vec<usize> = (0..lanes).map(count).collect();
    let samples = if repeated { len.min(2) } else { len };
    window.repeat(false);
    for (k, output) in (0..samples).flat_map(|k| (0..outputs).map(move |output| (k, output))) {
        let row = window.variance_row_mut(k, output);
        for (lane, n) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let (sum, square, n) = (sums[output * lanes + lane], squares[output * lanes + lane], *n as f64);
            let slopes = row[lane..last * lanes].iter_mut().step_by(lanes);
            match k {
                0 => slopes.for_each(|slope| *slope *= n.sqrt()),
                _ => slopes.for_each(|slope| *slope = 0.0),
            }
            row[last * lanes + lane] = match k {
                0 => sum / n.sqrt(),
                1 => (square - sum * sum / n).max(0.0).sqrt(),
                _ => 0.0,
            };
        }
    }
    samples
}

/// Adds the errors of a row, given as they are or by standardized ones, and their squares.
struct Sums<'s> {
    numbers: &'s [f64],
    standardized: bool,
    sums: &'s mut [f64],
    squares: &'s mut [f64],
}

impl Task for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Sums { numbers, standardized, sums, squares } = self;
        let whole = numbers.len() - numbers.len() % W::LANES;
        for first in (0..whole).step_by(W::LANES) {
            let number = W::load(&numbers[first..]);
            let error = match standardized {
                true => number.mul(number).sub(W::splat(1.0)).mul(W::splat(FRAC_1_SQRT_2)),
                false => number,
            };
            W::load(&sums[first..]).add(error).store(&mut sums[first..]);
            W::load(&squares[first..]).add(error.mul(error)).store(&mut squares[first..]);
        }
        for lane in whole..numbers.len() {
            let number = numbers[lane];
            let error = if standardized { (number * number - 1.0) * FRAC_1_SQRT_2 } else { number };
            sums[lane] += error;
            squares[lane] += error * error;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::Information;

    const SAMPLES: [usize; 3] = [5, 3, 5];

    /// Slope and error of a sample's output in a lane; slopes of settled lanes are the same at all samples.
    fn entries(k: usize, output: usize, lane: usize, settled: bool) -> [f64; 2] {
        let z = ((k * 7 + output * 3 + lane) % 5) as f64 / 2.0 - 0.3;
        [if settled { 1.5 } else { 0.7 * k as f64 } + (output + lane) as f64, z]
    }

    /// The triangle of the rows of the variances of a lane, the diagonal positive.
    fn triangle(window: &Window, samples: usize, lane: usize) -> [f64; 3] {
        let mut found = Information::new(1);
        for (k, output) in (0..samples).flat_map(|k| (0..2).map(move |output| (k, output))) {
            let row = window.variance_row(k, output);
            found.absorb_row(&[row[lane]], row[window.lanes() + lane]);
        }
        [found.at(0, 0).abs(), found.at(0, 0).signum() * found.at(0, 1), found.at(1, 1).abs()]
    }

    /// Two outputs and one unknown in three lanes: one settled, one settled that ends after three of five samples, one not settled. Their triangles are those of
    /// all rows, and those of a window whose rows repeat themselves are, to the last bit, those of the settled lane beside others.
    #[test]
    fn two_rows_say_the_same() {
        let second = |z: f64| (z * z - 1.0) * FRAC_1_SQRT_2;
        let mut window = Window::new(3, 2, 1, 5, true);
        (window.samples, window.settled) = (SAMPLES.to_vec(), 0b011);
        let places = || (0..5).flat_map(|k| (0..2).map(move |output| (k, output)));
        for (k, output) in places() {
            for lane in (0..3).filter(|lane| k < SAMPLES[*lane]) {
                let [slope, z] = entries(k, output, lane, lane < 2);
                let row = window.variance_row_mut(k, output);
                (row[lane], row[3 + lane]) = (slope, second(z));
            }
        }
        let right = [0, 1, 2].map(|lane| triangle(&window, 5, lane));
        assert_eq!(joined(&mut window), 5);
        for (lane, right) in right.iter().enumerate() {
            for (found, right) in triangle(&window, 5, lane).iter().zip(right) {
                // Rounding of ten squares of up to 30.
                assert!((found - right).abs() < 1e-13, "{lane}: {found} {right}");
            }
        }
        let mut alone = Window::new(1, 2, 1, 5, true);
        (alone.samples, alone.settled) = (vec![5], 1);
        // What stands in later rows is not read.
        alone.variance_rows_mut().fill(f64::NAN);
        alone.repeat(true);
        for (k, output) in places() {
            let [slope, z] = entries(k, output, 0, true);
            alone.row_mut(k, output).copy_from_slice(&[0.0, z]);
            alone.variance_row_mut(0, output).copy_from_slice(&[slope, 2.0]);
        }
        assert_eq!(joined(&mut alone), 2);
        assert_eq!(triangle(&alone, 2, 0), triangle(&window, 2, 0));
    }
}
