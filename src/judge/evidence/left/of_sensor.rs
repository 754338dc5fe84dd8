//! The test of one regressor that allows for errors of changing variance and for autocorrelated ones.

use crate::estimate::student::two_sided;
use crate::judge::evidence::extended::{Extended, Released};
use crate::rows::of_pieces::Run;
use crate::rows::of_sensor::{OfSensor, Steps};
use crate::rows::sensors::KINDS;

/// Level below which errors that are left are taken as colored.
const COLORED: f64 = 0.01;
/// Level of the heteroscedasticity-consistent test, which is a check of the other one: few rows may decide it.
const OWN: f64 = 1e-3;

/// The steps beside a regressor.
pub(super) fn steps(extended: &Extended<'_>, found: &Released) -> Option<Steps> {
    let (objective, without) = (extended.evidence.point.objective, extended.without()?);
    let of = |e: usize| {
        let columns = objective.problem.unknowns.columns(e).map(|i| extended.place_of(i));
        columns.map(|i| (found.step[i], (without[i] - found.step[i]) / found.value)).collect()
    };
    let of = (0..objective.experiments()).map(of).collect();
    Some(Steps { output: found.number / KINDS, kind: found.number % KINDS, value: found.value, of })
}

/// Standard error and probability of a regressor, with fewer degrees of freedom for autocorrelated errors; `None` where it is not significant
/// by the heteroscedasticity-consistent variance.
pub(super) fn confirm(extended: &Extended<'_>, found: &Released, all: Vec<OfSensor>) -> Option<(f64, f64)> {
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
    let inflation = colored.map(|white| white.variance_inflation).fold(1.0, f64::max);
    let error = |variance: f64| (variance * inflation).sqrt() / squares;
    // The effective number of rows, by the fourth powers of `z`.
    let degrees = (squares * squares / fourths - 1.0).min(free) / inflation;
    let by_own = two_sided(found.value / error(own), degrees);
    let chance = two_sided(found.value / error(plain), free / inflation);
    (by_own < OWN).then(|| (error(own.max(plain)), chance))
}
