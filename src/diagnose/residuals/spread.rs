//! Whether the residuals' spread depends on a signal (heteroscedasticity).

use super::{Series, SignalRole};
use crate::diagnose::Test;
use crate::whiteness::chi_squared_tail;
use serde::{Deserialize, Serialize};

/// Standard deviation of the residuals over the range of a signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Name of the signal.
    pub signal: String,
    /// Its role: an input, a predicted output or the time.
    pub role: SignalRole,
    /// Unit of the signal.
    pub unit: String,
    /// Middle of each part of the signal's range in which it was met.
    #[serde(with = "crate::real")]
    pub at: Vec<f64>,
    /// Standard deviation of the residuals there, in the output's unit.
    #[serde(with = "crate::real")]
    pub deviation: Vec<f64>,
    /// How many residuals there are.
    pub count: Vec<u64>,
    /// Part of the variance of the squared residuals that the signal explains.
    #[serde(with = "crate::real")]
    pub share: f64,
    /// The test's probability of such a part if the residuals are of one size.
    #[serde(with = "crate::real")]
    pub p_value: f64,
}

const PARTS: usize = 12;

/// The remedy: a weighting sees time and inputs, but not the outputs.
fn remedy(role: SignalRole, signal: &Series) -> String {
    match role {
        SignalRole::Input | SignalRole::Time => {
            format!("a weighting by `{}` makes the quieter part count for more", signal.name)
        }
        SignalRole::MeasuredOutput | SignalRole::PredictedOutput => {
            "fit a part of the record in which they are of one size (`Experiment::between`), and compare the estimates"
                .to_owned()
        }
    }
}

/// Koenker's form (J. Econometrics 17 (1981) 107) of Breusch and Pagan's test with the signal and its square, which does
/// not ask for normal residuals.
pub(super) fn over(residuals: &Series, effective: f64, role: SignalRole, signal: &Series) -> Option<(Spread, Test)> {
    let scale = signal.deviation.recip();
    let variance = residuals.deviation.powi(2);
    // Sums of products of (1, x, x^2) and the squared residuals.
    let mut moments = [0.0; 5];
    let mut products = [0.0; 3];
    let mut squares = 0.0;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let here = |k: usize| !residuals.is_missing(k) && !signal.is_missing(k);
    for (k, (e, s)) in residuals.values.iter().zip(&signal.values).enumerate() {
        if here(k) {
            let (x, q) = (s * scale, e * e / variance);
            let x2 = x * x;
            for (sum, value) in moments.iter_mut().zip([1.0, x, x2, x2 * x, x2 * x2]) {
                *sum += value;
            }
            for (sum, value) in products.iter_mut().zip([q, q * x, q * x2]) {
                *sum += value;
            }
            squares += q * q;
            (low, high) = (low.min(*s), high.max(*s));
        }
    }
    let n = moments[0];
    let total = squares - products[0] * products[0] / n;
    if total.is_nan() || total <= 0.0 || high <= low {
        return None;
    }
    // About the means: x and what of x^2 is not x.
    let mean = |i: usize| moments[i] / n;
    let (sxx, sxz) = (moments[2] - n * mean(1) * mean(1), moments[3] - n * mean(1) * mean(2));
    let szz = moments[4] - n * mean(2) * mean(2);
    let (sxq, szq) = (products[1] - mean(1) * products[0], products[2] - mean(2) * products[0]);
    let (slope, rest) = (sxz / sxx, szz - sxz * sxz / sxx);
    // A signal of two levels has no square of its own.
    let curved = rest > 1e-9 * moments[4];
    let own = if curved { (szq - slope * sxq).powi(2) / rest } else { 0.0 };
    let share = ((sxq * sxq / sxx + own) / total).clamp(0.0, 1.0);
    let statistic = effective * share;
    let p_value = chi_squared_tail(statistic, if curved { 2.0 } else { 1.0 });

    let width = (high - low) / PARTS as f64;
    let (mut sums, mut counts) = ([0.0; PARTS], [0u64; PARTS]);
    for (k, (e, s)) in residuals.values.iter().zip(&signal.values).enumerate() {
        if here(k) {
            let part = (((s - low) / width) as usize).min(PARTS - 1);
            sums[part] += e * e;
            counts[part] += 1;
        }
    }
    let met = || (0..PARTS).filter(|&part| counts[part] > 0);
    let spread = Spread {
        signal: signal.name.to_owned(),
        role,
        unit: signal.unit.to_owned(),
        at: met().map(|part| signal.mean + low + width * (part as f64 + 0.5)).collect(),
        deviation: met().map(|part| (sums[part] / counts[part] as f64).sqrt()).collect(),
        count: met().map(|part| counts[part]).collect(),
        share,
        p_value,
    };
    let failed = format!(
        "the size of the residuals changes with {role} `{}`: the noise does, or the model is wrong in part of its range; {}",
        signal.name,
        remedy(role, signal)
    );
    let name = format!("Breusch-Pagan-Koenker, {role} `{}`", signal.name);
    Some((spread, Test::new(name, statistic, p_value, "the residuals are of one size over its range", &failed)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(values: impl Iterator<Item = f64>) -> Series {
        Series::new("u", "V", &values.collect::<Vec<f64>>())
    }

    fn over_input(residuals: &Series, effective: f64, signal: &Series) -> Option<(Spread, Test)> {
        over(residuals, effective, SignalRole::Input, signal)
    }

    fn residuals(size: impl Fn(usize) -> f64) -> Series {
        series((0..40).map(|k| if k % 2 == 0 { size(k) } else { -size(k) }))
    }

    /// Errors of one size have no variance of their squares to explain, and a constant explains none.
    #[test]
    fn no_spread_without_change() {
        let moving = series((0..40).map(|k| k as f64));
        let levels = |k: usize| if k < 20 { 1.0 } else { 2.0 };
        assert!(over_input(&residuals(|_| 1.0), 40.0, &moving).is_none());
        assert!(over_input(&residuals(levels), 40.0, &series((0..40).map(|_| 3.0))).is_none());
        assert!(over_input(&residuals(levels), 40.0, &moving).is_some());
    }

    /// The square of a rare pulse is the pulse, but for the rounding of the fourth powers: one degree of freedom.
    #[test]
    fn a_pulse_has_no_square_of_its_own() {
        let errors = series((0..2000).map(|k| (1.0 - 2.0 * (k % 2) as f64) * (1.0 + (k % 7) as f64)));
        for period in [500, 1000, 1250] {
            let pulse = series((0..2000).map(|k| if k % period == 7 { 1.0 } else { 0.0 }));
            let (spread, test) = over_input(&errors, 2000.0, &pulse).unwrap();
            let expected = chi_squared_tail(2000.0 * spread.share, 1.0);
            assert!((test.p_value / expected - 1.0).abs() < 1e-9, "{period}: {test:?} {expected}");
        }
    }

    /// Errors of one size at each of two levels: the level explains all of it, with one degree of freedom. The parts are a twelfth
    /// of the range wide, and only the outermost were met.
    #[test]
    fn the_spread_at_two_levels() {
        // The squares of squares of the units are no numbers.
        for unit in [1e-90, 1.0, 1e90] {
            let level = |k: usize| if k < 16 { 0.0 } else { 6.0 * unit };
            let size = |k: usize| unit * if k < 16 { 1.0 } else { 2.0 };
            let (spread, test) = over_input(&residuals(size), 36.0, &series((0..40).map(level))).unwrap();
            assert!((spread.share - 1.0).abs() < 1e-12 && spread.count == [16, 24], "{spread:?}");
            let close = |found: &[f64], expected: [f64; 2]| {
                found.iter().zip(expected).all(|(a, b)| (a / unit - b).abs() < 1e-12)
            };
            assert!(close(&spread.at, [0.25, 5.75]) && close(&spread.deviation, [1.0, 2.0]), "{spread:?}");
            // A normal number beyond six standard deviations to either side.
            assert!((test.p_value / 1.973_175e-9 - 1.0).abs() < 1e-5 && !test.passed, "{test:?}");
        }
    }
}
