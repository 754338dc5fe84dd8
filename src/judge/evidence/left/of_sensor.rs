//! The test of one regressor that allows for errors of changing variance and for autocorrelated ones.

use super::of_pieces::Run;
use crate::estimate::student::two_sided;
use crate::judge::evidence::extended::{Extended, Released};
use crate::judge::evidence::sensors::{KINDS, Measurement, Measurements};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;

/// Level below which errors that are left are taken as colored.
const COLORED: f64 = 0.01;
/// Level of the heteroscedasticity-consistent test, which is a check of the other one: few rows may decide it.
const OWN: f64 = 1e-3;

/// The step beside a regressor.
pub(super) struct Steps {
    output: usize,
    kind: usize,
    value: f64,
    /// For each unknown of each experiment: its step beside the regressor, and its coefficient in the regression of the regressor on the slopes.
    of: Vec<Vec<(f64, f64)>>,
}

impl Steps {
    pub fn of(extended: &Extended<'_>, found: &Released) -> Option<Self> {
        let (objective, without) = (extended.evidence.point.objective, extended.without()?);
        let of = |e: usize| {
            let columns = objective.problem.unknowns.columns(e).map(|i| extended.place_of(i));
            columns.map(|i| (found.step[i], (without[i] - found.step[i]) / found.value)).collect()
        };
        let of = (0..objective.experiments()).map(of).collect();
        Some(Steps { output: found.number / KINDS, kind: found.number % KINDS, value: found.value, of })
    }
}

/// Sums over the errors `e` that remain with the regressor, and the part `z` of the regressor that is orthogonal to the unknowns' slopes.
pub(super) struct OfSensor<'s> {
    measurements: Measurements<'s>,
    steps: &'s Steps,
    experiment: usize,
    /// Of `z^2`, `z^4`, `e^2 z^2` and `e^2`.
    sums: [f64; 4],
    errors: Vec<Run>,
    runs: Vec<Vec<f64>>,
}

impl<'s> OfSensor<'s> {
    pub fn new(objective: &'s Objective<'s>, steps: &'s Steps, experiment: usize) -> Self {
        let (measurements, outputs) = (Measurements::new(objective, experiment), objective.outputs());
        let (errors, runs) = (vec![Run::new(); outputs], vec![vec![]; outputs]);
        OfSensor { measurements, steps, experiment, sums: [0.0; 4], errors, runs }
    }
}

impl Accumulate for OfSensor<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let OfSensor { measurements, steps: Steps { output, kind, value, of }, experiment, sums, errors, runs } = self;
        runs.iter_mut().for_each(Vec::clear);
        measurements.visit(window, lane, |Measurement { k, output: j, root, slopes }| {
            let own = if j == *output { slopes[*kind] } else { 0.0 };
            let (mut error, mut z) = (window.error(k, j, lane) - own * *value, own);
            for (c, (step, replaced)) in of[*experiment].iter().enumerate() {
                let slope = window.at(k, j, c, lane);
                error -= slope * step;
                z -= slope * replaced;
            }
            let (error, square) = (root * error, (root * z) * (root * z));
            let terms = [square, square * square, error * error * square, error * error];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            runs[j].push(error);
        });
        errors.iter_mut().zip(runs).for_each(|(errors, run)| errors.add(run));
    }

    fn append(&mut self, later: Self) {
        self.sums.iter_mut().zip(later.sums).for_each(|(sum, later)| *sum += later);
        self.errors.iter_mut().zip(&later.errors).for_each(|(errors, later)| errors.follow(later));
        self.measurements.append(later.measurements);
    }
}

/// Standard error and probability of a regressor, with fewer degrees of freedom for autocorrelated errors; `None` where it is not significant
/// by the heteroscedasticity-consistent variance.
pub(super) fn confirm(extended: &Extended<'_>, found: &Released, all: Vec<OfSensor<'_>>) -> Option<(f64, f64)> {
    let mut all = all.into_iter();
    let OfSensor { mut sums, mut errors, .. } = all.next()?;
    for one in all {
        sums.iter_mut().zip(one.sums).for_each(|(sum, own)| *sum += own);
        errors.iter_mut().zip(&one.errors).for_each(|(errors, own)| errors.append(own));
    }
    let ([squares, fourths, products, of_errors], free) = (sums, extended.degrees());
    let count = errors.iter().map(|run| run.count).sum::<u64>() as f64;
    let (plain, own) = (of_errors / free * squares, products * count / free);
    let colored = errors.iter().map(Run::whiteness);
    let colored = colored.filter(|white| white.p_value < COLORED && !extended.evidence.point.is_static());
    let dependence = colored.map(|white| white.dependence).fold(1.0, f64::max);
    let error = |variance: f64| (variance * dependence).sqrt() / squares;
    // The effective number of rows, by the fourth powers of `z`.
    let degrees = (squares * squares / fourths - 1.0).min(free) / dependence;
    let by_own = two_sided(found.value / error(own), degrees);
    let chance = two_sided(found.value / error(plain), free / dependence);
    (by_own < OWN).then(|| (error(own.max(plain)), chance))
}
