//! [`SecondOrder`]: against a filter that is written out for its plant, against [`Kalman`], and where the order of the filter decides.

use crate::common::Noise;
use crate::hardening::{Hardening, STRONG, Spring, TRUTH, disturbed, driven, start};
use argmin::core::{CostFunction, Gradient};
use core::f64::consts::TAU;
use greybox::optimize::Severity;
use greybox::*;

/// `-ln` of the likelihood by moments of a Gaussian state, by hand: `E x^3 = m^3 + 3 m P`, `E 3 x^2 = 3 (m^2 + P)`, `E x^2 = m^2 + P`, of
/// variance `4 m^2 P + 2 P^2`; by Runge-Kutta's method with so many steps per sample.
fn written_out(record: &ExperimentOf<Hardening>, [a, b, c, q, r, mut x]: [f64; 6], steps: u32) -> f64 {
    let (q, r) = ((q * 2.0).exp(), (r * 2.0).exp());
    let (mut p, mut sum) = (0.0, 0.0);
    for (k, (u, gauges)) in record.inputs().zip(record.outputs()).enumerate() {
        for (second, y) in [(false, gauges.y), (true, gauges.z)] {
            if y.is_nan() {
                continue;
            }
            let (mean, slope, noise) = match second {
                false => (x, 1.0, r),
                true => (x + (x * x + p) / 2.0, 1.0 + x, 4.0 * r + p * p / 2.0),
            };
            let (error, variance): (f64, f64) = (y - mean, slope * slope * p + noise);
            sum += (error * error / variance + (variance * TAU).ln()) / 2.0;
            (x, p) = (x + p * slope * error / variance, p * noise / variance);
        }
        if k + 1 == record.len() {
            break;
        }
        let h = (record.time(k + 1) - record.time(k)) / f64::from(steps);
        let rate = |[x, p]: [f64; 2]| {
            [c * u.u - a * x - b * (x * x * x + 3.0 * x * p), 2.0 * (-a - 3.0 * b * (x * x + p)) * p + q]
        };
        for _ in 0..steps {
            let along = |k: [f64; 2], h: f64| [x + k[0] * h, p + k[1] * h];
            let k1 = rate([x, p]);
            let k2 = rate(along(k1, h / 2.0));
            let k3 = rate(along(k2, h / 2.0));
            let k4 = rate(along(k3, h));
            let sum = |i: usize| (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (h / 6.0);
            (x, p) = (x + sum(0), p + sum(1));
        }
    }
    sum
}

const AT: [f64; 6] = [0.9, 0.6, 1.1, -0.1, -1.2, 0.0];

fn even(step: f64) -> Time {
    Time::Uniform { start: 0.0, step }
}

/// The same arithmetic in another order: 12 digits are left of the likelihood of 260 measurements, by programs. Node by node, by an adaptive
/// method of tolerance 1e-10, nine are left; the extended filter's differs in the third.
#[test]
fn likelihood_of_a_filter_written_out() {
    let record = disturbed(even(0.3), 200, 3, &mut Noise(3));
    let measured = record.outputs().flat_map(|y| [y.y, y.z]).filter(|y| !y.is_nan()).count();
    let constant = 0.5 * measured as f64 * TAU.ln();
    let of = |fit: Fit<'_, Hardening>| {
        fit.problem().unwrap().objective().unwrap().cost(&AT[..5].to_vec()).unwrap() + constant
    };
    let fit = || Fit::new(&Hardening, &record).parameters(start()).integrator(Rk4 { substeps: 4 });
    let (found, exact) = (of(fit().predictor(SecondOrder)), written_out(&record, AT, 4));
    assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
    assert!((of(fit().predictor(Kalman)) / exact - 1.0).abs() > 1e-3);
    let adaptive = fit().predictor(SecondOrder).integrator(Rk45 { relative: 1e-10, absolute: 1e-12 });
    let (found, exact) = (of(adaptive), written_out(&record, AT, 64));
    assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
}

/// Slopes against central differences of fourth order, whose steps of 1e-3 leave nine digits.
#[test]
fn its_slopes_are_exact() {
    let record = disturbed(even(0.3), 200, 3, &mut Noise(3));
    let problem = Fit::new(&Hardening, &record).parameters(start()).predictor(SecondOrder).problem().unwrap();
    let objective = problem.objective().unwrap();
    let slopes = objective.gradient(&AT[..5].to_vec()).unwrap();
    for i in 0..5 {
        let cost = |by: f64| {
            let mut at = AT[..5].to_vec();
            at[i] += by;
            objective.cost(&at).unwrap()
        };
        let h = 1e-3;
        let difference = (8.0 * (cost(h) - cost(-h)) - (cost(2.0 * h) - cost(-2.0 * h))) / (12.0 * h);
        assert!((slopes[i] - difference).abs() < 1e-7 * (1.0 + difference.abs()), "{i}: {} {difference}", slopes[i]);
    }
}

/// Of an affine model it is the Kalman filter, to the roundings of another order of sums.
#[test]
fn affine_models_are_filtered_exactly() {
    let record = disturbed(even(0.1), 200, usize::MAX, &mut Noise(4));
    let start = Spring { b: fixed(0.0), ..start() };
    let cost = |fit: Fit<'_, Hardening>| {
        fit.problem().unwrap().objective().unwrap().cost(&vec![0.9, 1.1, -0.1, -1.2]).unwrap()
    };
    let fit = || Fit::new(&Hardening, &record).parameters(start);
    let (first, second) = (cost(fit().predictor(Kalman)), cost(fit().predictor(SecondOrder)));
    assert!((second / first - 1.0).abs() < 1e-13, "{first} {second}");
}

/// Where the state strays as far as the spring bends, the extended filter is biased, which its fits say; those of second order are usable and
/// right. Where it does not, neither says anything.
#[test]
fn the_order_is_said_where_it_decides() {
    let severity = |truth: &Spring, step: f64, seed: u64, second: bool| {
        let record = driven(truth, even(step), 1000, usize::MAX, &mut Noise(seed));
        let fit = Fit::new(&Hardening, &record).parameters(start());
        let fit = if second { fit.predictor(SecondOrder) } else { fit.predictor(Kalman) };
        let estimate = fit.run().unwrap();
        let said = estimate.warnings.iter().any(|warning| warning.code == WarningCode::FilterOrder);
        (said, estimate.severity())
    };
    for seed in 1..=10 {
        let (said, found) = severity(&STRONG, 0.3, seed, false);
        assert!(said && found > Severity::Usable);
        assert!(!severity(&STRONG, 0.3, seed, true).0);
        assert!(!severity(&TRUTH, 0.1, seed, false).0);
    }
}
