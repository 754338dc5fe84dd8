//! The test of one regressor that allows for errors of changing variance and for autocorrelated ones.

use super::{Extended, Released};
use crate::estimate::student::two_sided;
use crate::judge::evidence::sensors::{KINDS, Measurement, Measurements};
use crate::judge::evidence::whiteness::{LAGS, Whiteness};
use crate::problem::Accumulate;
use crate::sweep::Window;
use crate::whiteness::Portmanteau;

/// Level below which errors that are left are taken as colored.
const COLORED: f64 = 0.01;
/// Level of the heteroscedasticity-consistent test, which is a check of the other one: few rows may decide it.
const OWN: f64 = 1e-3;

/// Sums over the errors `e` that remain with the regressor, and the part `z` of the regressor that is orthogonal to the unknowns' slopes.
struct Left<'s> {
    measurements: Measurements<'s>,
    /// For each unknown of the experiment: its step beside the regressor, and its coefficient in the regression of the regressor on the slopes.
    steps: &'s [(f64, f64)],
    output: usize,
    kind: usize,
    value: f64,
    sums: Sums,
    errors: Vec<Portmanteau>,
    runs: Vec<Vec<f64>>,
}

/// Of `z^2`, `z^4`, `e^2 z^2` and `e^2`; and the number of errors of each output.
#[derive(Clone)]
struct Sums {
    squares: f64,
    fourths: f64,
    products: f64,
    errors: f64,
    counts: Vec<u64>,
}

impl Sums {
    fn append(&mut self, other: &Sums) {
        self.squares += other.squares;
        self.fourths += other.fourths;
        self.products += other.products;
        self.errors += other.errors;
        self.counts.iter_mut().zip(&other.counts).for_each(|(count, other)| *count += other);
    }
}

impl Accumulate for Left<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let Left { measurements, steps, output, kind, value, sums, errors, runs } = self;
        runs.iter_mut().for_each(Vec::clear);
        measurements.visit(window, lane, |Measurement { k, output: j, root, slopes }| {
            let own = if j == *output { slopes[*kind] } else { 0.0 };
            let (mut error, mut z) = (window.error(k, j, lane) - own * *value, own);
            for (c, (step, replaced)) in steps.iter().enumerate() {
                let slope = window.at(k, j, c, lane);
                error -= slope * step;
                z -= slope * replaced;
            }
            let (error, z) = (root * error, root * z);
            let square = z * z;
            sums.squares += square;
            sums.fourths += square * square;
            sums.products += error * error * square;
            sums.errors += error * error;
            sums.counts[j] += 1;
            runs[j].push(error);
        });
        errors.iter_mut().zip(runs).for_each(|(errors, run)| errors.add(run));
    }

    fn append(&mut self, later: Self) {
        self.sums.append(&later.sums);
        self.errors.iter_mut().zip(&later.errors).for_each(|(errors, later)| errors.follow(later));
        self.measurements.append(later.measurements);
    }
}

impl Extended<'_> {
    /// Standard error and probability of a regressor, with fewer degrees of freedom for autocorrelated errors; `None` where it is not significant
    /// by the heteroscedasticity-consistent variance (White, Econometrica 48 (1980) 817).
    pub(crate) fn confirm(&self, found: &Released) -> Option<(f64, f64)> {
        let (objective, outputs) = (&self.objective, self.objective.outputs());
        let without = self.linear.step(&vec![0.0; self.linear.unknowns()], &self.held(None))?;
        let steps = |e: usize| -> Vec<(f64, f64)> {
            let columns = objective.problem.unknowns.columns(e).map(|i| self.place_of(i));
            columns.map(|i| (found.step[i], (without[i] - found.step[i]) / found.value)).collect()
        };
        let steps: Vec<Vec<(f64, f64)>> = (0..objective.experiments()).map(steps).collect();
        let make = |e: usize| Left {
            measurements: Measurements::new(objective, e),
            steps: &steps[e],
            output: found.number / KINDS,
            kind: found.number % KINDS,
            value: found.value,
            sums: Sums { squares: 0.0, fourths: 0.0, products: 0.0, errors: 0.0, counts: vec![0; outputs] },
            errors: vec![Portmanteau::new(LAGS); outputs],
            runs: vec![vec![]; outputs],
        };
        let mut all = objective.gather(&self.evidence.point.end.coordinates, true, make).ok()?.into_iter();
        let first = all.next()?;
        let (mut sums, mut errors) = (first.sums, first.errors);
        for one in all {
            sums.append(&one.sums);
            errors.iter_mut().zip(&one.errors).for_each(|(errors, own)| errors.append(own));
        }
        let free = self.degrees();
        let count = sums.counts.iter().sum::<u64>() as f64;
        let plain = sums.errors / free * sums.squares;
        let own = sums.products * count / free;
        let white = errors.iter().zip(&sums.counts).map(|(errors, count)| Whiteness::of(errors, *count));
        let colored = white.filter(|white| white.p_value < COLORED && !self.evidence.point.is_static());
        let dependence = colored.map(|white| white.dependence).fold(1.0, f64::max);
        let error = |variance: f64| (variance * dependence).sqrt() / sums.squares;
        // The effective number of rows, by the fourth powers of `z`.
        let degrees = (sums.squares * sums.squares / sums.fourths - 1.0).min(free) / dependence;
        let by_own = two_sided(found.value / error(own), degrees);
        let chance = two_sided(found.value / error(plain), free / dependence);
        (by_own < OWN).then(|| (error(own.max(plain)), chance))
    }
}
