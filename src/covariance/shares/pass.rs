//! A pass over all measurements that takes eight at a time, in vector registers.

use super::{ALONE, Share, Shares};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use crate::wide::{self, Task, Wide, Width};
use nalgebra::DMatrix;

/// Number of measurements side by side, the same for registers of any width, so that the bits of a result do not depend on the
/// processor.
const BLOCK: usize = 8;
type Row = [f64; BLOCK];

/// Measurements side by side: slopes, weights, errors, and one where there is a measurement.
struct Rows {
    slopes: Vec<Row>,
    weights: Row,
    errors: Row,
    present: Row,
    places: [(usize, usize); BLOCK],
    filled: usize,
}

impl Rows {
    fn new(columns: usize) -> Self {
        let none = [0.0; BLOCK];
        let slopes = vec![none; columns];
        Rows { slopes, weights: none, errors: none, present: none, places: [(0, 0); BLOCK], filled: 0 }
    }

    fn push(&mut self, weight: f64, slopes: impl Iterator<Item = f64>, error: f64, place: (usize, usize)) {
        let at = self.filled;
        self.slopes.iter_mut().zip(slopes).for_each(|(row, slope)| row[at] = slope);
        (self.weights[at], self.errors[at], self.present[at], self.places[at]) = (weight, error, 1.0, place);
        self.filled += 1;
    }

    /// Fills the rest with measurements that count nothing.
    fn pad(&mut self) {
        let rest = self.filled..;
        self.slopes.iter_mut().for_each(|row| row[rest.clone()].fill(0.0));
        for row in [&mut self.weights, &mut self.errors, &mut self.present] {
            row[rest.clone()].fill(0.0);
        }
    }
}

/// What is summed of measurements side by side.
struct Totals {
    /// Their shares in each unknown's variance.
    parts: Vec<Row>,
    /// Of each unknown the sums of shares, of their squares, and of shares times squared errors.
    of: Vec<[Row; 3]>,
    /// The number, and the sums of squared errors and of their squares.
    all: [Row; 3],
}

impl Totals {
    fn new(columns: usize) -> Self {
        let none = [0.0; BLOCK];
        Totals { parts: vec![none; columns], of: vec![[none; 3]; columns], all: [none; 3] }
    }
}

/// Adds measurements to the totals.
struct Add<'a> {
    inverse: &'a DMatrix<f64>,
    rows: &'a Rows,
    totals: &'a mut Totals,
}

impl Task for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Add { inverse, rows, totals: Totals { parts, of, all } } = self;
        let (n, inverse, zero, alone) = (rows.slopes.len(), inverse.as_slice(), W::splat(0.0), W::splat(ALONE));
        let mut at = 0;
        while at < BLOCK {
            let (weight, error) = (W::load(&rows.weights[at..]), W::load(&rows.errors[at..]));
            let mut leverage = zero;
            let mut i = 0;
            while i < n {
                let mut moved = zero;
                let mut c = 0;
                while c < n {
                    moved = moved.add(W::splat(inverse[c * n + i]).mul(W::load(&rows.slopes[c][at..])));
                    c += 1;
                }
                leverage = leverage.add(moved.mul(W::load(&rows.slopes[i][at..])));
                weight.mul(moved).mul(moved).div(W::splat(inverse[i * n + i])).store(&mut parts[i][at..]);
                i += 1;
            }
            let rest = W::splat(1.0).sub(weight.mul(leverage));
            // The error of a measurement that alone determines an unknown is rounding.
            let square = alone.select_lt(rest, weight.mul(error).mul(error).div(rest), zero);
            add(&mut all[0][at..], alone.select_lt(rest, W::load(&rows.present[at..]), zero));
            add(&mut all[1][at..], square);
            add(&mut all[2][at..], square.mul(square));
            i = 0;
            while i < n {
                let part = alone.select_lt(rest, W::load(&parts[i][at..]), zero);
                add(&mut of[i][0][at..], part);
                add(&mut of[i][1][at..], part.mul(part));
                add(&mut of[i][2][at..], part.mul(square));
                i += 1;
            }
            at += W::LANES;
        }
    }
}

#[inline(always)]
fn add<W: Wide>(to: &mut [f64], x: W) {
    W::load(to).add(x).store(to);
}

/// A pass over all measurements of an experiment.
pub(crate) struct Pass<'p> {
    objective: &'p Objective<'p>,
    pub shares: Shares,
    rows: Rows,
    totals: Totals,
}

impl<'p> Pass<'p> {
    pub fn new(objective: &'p Objective<'p>, shares: Shares) -> Self {
        let columns = shares.columns();
        Pass { objective, shares, rows: Rows::new(columns), totals: Totals::new(columns) }
    }

    /// Takes the measurements that are side by side.
    fn take(&mut self) {
        let Pass { shares, rows, totals, .. } = self;
        rows.pad();
        wide::run(Width::widest(), Add { inverse: &shares.inverse, rows, totals });
        for (parts, largest) in totals.parts.iter().zip(&mut shares.largest) {
            for (part, (output, sample)) in parts.iter().zip(rows.places).take(rows.filled) {
                largest.take(Share { part: *part, experiment: shares.experiment, output, sample });
            }
        }
        rows.filled = 0;
    }

    /// Takes the last measurements, and moves all sums to the shares.
    fn flush(&mut self) {
        if self.rows.filled > 0 {
            self.take();
        }
        let sum = |row: &mut Row| std::mem::take(row).iter().sum::<f64>();
        let Totals { of, all, .. } = &mut self.totals;
        let all = all.each_mut().map(sum);
        self.shares.sizes.add_sums(all, of.iter_mut().map(|of| of.each_mut().map(sum)));
    }
}

impl Accumulate for Pass<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            let sample = window.begin[lane] + k;
            let weight = self.objective.weight(self.shares.experiment, sample);
            for j in (0..window.outputs()).filter(|&j| weight > 0.0 && window.is_measured(k, j, lane)) {
                let slopes = window.row(k, j).iter().skip(lane).step_by(window.lanes()).copied();
                self.rows.push(weight, slopes, window.error(k, j, lane), (j, sample));
                if self.rows.filled == BLOCK {
                    self.take();
                }
            }
        }
        self.flush();
    }

    fn append(&mut self, later: Self) {
        self.shares.append(&later.shares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// Eight measurements at a time, and some that are left, give the sums of one at a time, to the rounding of sums of 30 numbers; one
    /// that alone determines an unknown has the largest share, but no error.
    #[test]
    fn measurements_side_by_side() {
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 2], vec![Current { i: 1.0 }; 2]).unwrap();
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let objective = problem.objective().unwrap();
        let inverse = DMatrix::from_row_slice(3, 3, &[0.05, 0.01, 0.0, 0.01, 0.04, 0.0, 0.0, 0.0, 0.25]);
        let mut random = Random::stream(26, 0);
        let mut pass = Pass::new(&objective, Shares::new(0, inverse.clone()));
        let mut single = Shares::new(0, inverse);
        for k in 0..29 {
            let alone = if k == 17 { 2.0 } else { 0.0 };
            let (weight, slopes) = (if k == 17 { 1.0 } else { 0.7 }, [random.normal(), random.normal(), alone]);
            let slopes = if k == 17 { [0.0, 0.0, alone] } else { slopes };
            let error = random.normal();
            single.take(weight, &slopes, error, (k % 2, k));
            pass.rows.push(weight, slopes.into_iter(), error, (k % 2, k));
            if pass.rows.filled == BLOCK {
                pass.take();
            }
        }
        pass.flush();
        let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-13 * b.abs(), "{a} {b}");
        for (a, b) in pass.shares.sizes.sums().into_iter().zip(single.sizes.sums()) {
            near(a, b);
        }
        assert_eq!(single.sizes.sums()[0], 28.0);
        for (a, b) in pass.shares.largest.iter().zip(&single.largest) {
            for (a, b) in a.0.iter().zip(b.0) {
                near(a.part, b.part);
                assert_eq!((a.output, a.sample), (b.output, b.sample));
            }
        }
        assert_eq!(single.largest[2].0[0].sample, 17);
    }
}
