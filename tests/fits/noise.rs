#![cfg(feature = "std")]
//! The noise that a fit reports, and what autocorrelated noise does to the standard errors.

use crate::common::*;
use crate::judgements::{Drive, Factor, Twice, moving};
use greybox::estimate::{CovarianceMethod, Unknown};
use greybox::*;

const STEP: f64 = 5e-3;
const LAG: Branch = Branch { gain: 2.0, tau: 0.05 };

/// A lag with errors of standard deviation `sigma`, each with the correlation `rho` to the one before.
fn lag(samples: usize, sigma: f64, rho: f64, seed: u64) -> ExperimentOf<Lag> {
    let inputs = levels(samples, 12, seed).into_iter().map(|u| Voltage { u }).collect();
    let record = simulated(&Lag, STEP, inputs, Current { i: 0.0 }, LAG);
    let (mut noise, mut error) = (Noise(seed), 0.0);
    let disturbed = |y: Current| {
        error = rho * error + (1.0 - rho * rho).sqrt() * sigma * noise.gauss();
        Current { i: y.i + error }
    };
    let outputs = record.outputs().map(disturbed).collect();
    with_outputs(&Lag, &record, outputs)
}

fn lag_free() -> Branch<Parameter> {
    Branch { gain: free(1.5), tau: free(0.08) }
}

/// Root of the mean square over `n`, and noise over `n - p`: of each output, where they are two.
#[test]
fn unknowns_are_taken_from_the_degrees_of_freedom_of_each_output() {
    let inputs = levels(40, 1, 5).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Line, 1.0, inputs, Nothing, Affine { slope: 1.5, offset: -0.7 });
    let record = noisy(&Line, &exact, Pair { y: 0.3, z: 0.2 }, &mut Noise(1));
    let fit = || Fit::new(&Line, &record).parameters(Affine { slope: free(1.0), offset: free(0.5) });
    let estimate = fit().run().unwrap();
    let (y, z) = (estimate.quality.y, estimate.quality.z);
    let wider = (80.0f64 / 78.0).sqrt();
    // Rounds end where the noise changes by less than 1e-6 of itself; ten times that.
    for output in [y, z] {
        assert!((output.sigma / output.rmse / wider - 1.0).abs() < 1e-5, "{output:?}");
    }
    // The standard errors are those of that noise.
    let given = fit().noise(Pair { y: y.sigma, z: z.sigma }).run().unwrap();
    for (found, expected) in estimate.unknowns.iter().zip(&given.unknowns) {
        let errors = [found, expected].map(|unknown| unknown.knowledge.standard_error().unwrap());
        assert!((errors[0] / errors[1] - 1.0).abs() < 1e-7, "{errors:?}");
    }
}

/// Weights are no part of the noise: the errors' mean square over `n - 2`, whatever the weights.
#[test]
fn weights_leave_the_noise_its_degrees_of_freedom() {
    let record = lag(60, 0.05, 0.0, 4);
    let fit = Fit::new(&Lag, &record).parameters(lag_free()).weighting(|s: &Sample<Lag>| 1.0 + s.u.u.abs());
    let found = fit.run().unwrap().quality.i;
    assert!((found.sigma / found.rmse / (60.0f64 / 58.0).sqrt() - 1.0).abs() < 1e-12, "{found:?}");
}

/// Under Gaussian noise a robust scale is the standard deviation: of 2,000 errors within 5 %, three of its standard errors,
/// `1 / sqrt(2 * 2000)` over an efficiency of 0.9.
#[test]
fn a_robust_loss_keeps_the_size_of_gaussian_noise() {
    let record = lag(2000, 0.05, 0.0, 1);
    let fit = Fit::new(&Lag, &record).parameters(lag_free()).loss(Huber::default());
    let found = fit.run().unwrap().quality.i;
    assert!((found.sigma / 0.05 - 1.0).abs() < 0.05, "{found:?}");
}

/// Errors that white noise would show once in some thousands of times (p = 1.5e-4) are autocorrelated: the level is 1 %.
#[test]
fn weak_autocorrelation_is_seen() {
    let covariance = |rho: f64| {
        let estimate = Fit::new(&Lag, &lag(400, 0.05, rho, 2)).parameters(lag_free()).run().unwrap();
        println!("{rho}: {:?} {:?}", estimate.method.covariance, estimate.warnings);
        estimate.method.covariance
    };
    assert_eq!(covariance(0.0), CovarianceMethod::Classical);
    assert!(matches!(covariance(0.35), CovarianceMethod::Hac { .. }));
}

/// Two records that share no unknown are fitted as each alone: errors are divided by one less their own leverage, which the
/// other record does not change.
#[test]
fn autocorrelated_errors_of_a_record_do_not_depend_on_another() {
    let records = [lag(100, 0.05, 0.9, 3).named("short"), lag(400, 0.05, 0.9, 7).named("long")];
    let own = Branch { gain: free(1.5).per_experiment(), tau: free(0.08).per_experiment() };
    let alone = Fit::new(&Lag, &records[0]).parameters(lag_free()).run().unwrap();
    let together = Fit::new(&Lag, &records).parameters(own).run().unwrap();
    for estimate in [&alone.method, &together.method] {
        assert!(matches!(estimate.covariance, CovarianceMethod::Hac { .. }), "{estimate:?}");
    }
    for name in ["gain", "tau"] {
        let variance = |unknowns: &[Unknown]| {
            let own =
                unknowns.iter().find(|u| u.name.starts_with(name) && u.experiment.is_none_or(|e| e == 0)).unwrap();
            own.knowledge.standard_error().unwrap().powi(2)
        };
        let ratio = variance(&alone.unknowns) / variance(&together.unknowns);
        // The searches end within 1e-6 of a standard error of each other.
        assert!((ratio - 1.0).abs() < 1e-5, "{name}: {ratio}");
    }
}

/// What is said of two outputs: their errors are autoregressions with this correlation from sample to sample, which share this
/// part of their variance, beside white noise that is another part of it; measured are multiples of `every` samples.
fn said(rho: f64, [shared, white]: [f64; 2], samples: usize, every: [usize; 2], seed: u64) -> Vec<WarningCode> {
    let inputs = levels(samples, 5, seed).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Line, 1.0, inputs, Nothing, Affine { slope: 1.5, offset: -0.7 });
    let mut random = Noise(1000 + seed);
    let mut errors = [0.0; 3];
    let disturbed = |y: Pair| {
        errors = errors.map(|e| rho * e + (1.0 - rho * rho).sqrt() * random.gauss());
        let mut with = |own: f64| {
            let drawn = shared.sqrt() * errors[2] + (1.0 - shared - white).sqrt() * own;
            0.1 * (drawn + if white > 0.0 { white.sqrt() * random.gauss() } else { 0.0 })
        };
        Pair { y: y.y + with(errors[0]), z: y.z + with(errors[1]) }
    };
    let measured = |(k, y): (usize, Pair)| {
        let at = |j: usize, y: f64| if k % every[j] == 0 { y } else { f64::NAN };
        Pair { y: at(0, y.y), z: at(1, y.z) }
    };
    let outputs = exact.outputs().map(disturbed).enumerate().map(measured).collect();
    let record = with_outputs(&Line, &exact, outputs);
    let estimate = Fit::new(&Line, &record).parameters(Affine { slope: free(1.0), offset: free(0.5) }).run().unwrap();
    estimate.warnings.iter().map(|warning| warning.code).collect()
}

/// Of 40 records, how many are called so.
fn called(code: WarningCode, said: impl Fn(u64) -> Vec<WarningCode>) -> usize {
    (0..40).filter(|seed| said(*seed).contains(&code)).count()
}

/// Outputs whose errors are independent of each other but correlated over time are not called correlated: the level is 1 %, so
/// that three or more of 40 happen to one set of seeds in a hundred; also where white noise hides how long they are correlated,
/// beyond the lags that are known. Errors that share a half of their variance are: of 500 white
/// ones, and of 3,000 that are worth 150, by some six standard deviations.
#[test]
fn autocorrelated_outputs_are_correlated_only_if_they_share_noise() {
    let called =
        |rho, shared, samples| called(WarningCode::CorrelatedOutputs, |seed| said(rho, shared, samples, [1, 1], seed));
    assert!(called(0.95, [0.0, 0.0], 500) <= 2);
    assert!(called(0.7, [0.0, 0.0], 500) <= 2);
    let drifts = called(0.99, [0.0, 0.5], 5000);
    assert!(drifts <= 2, "{drifts}");
    assert_eq!(called(0.0, [0.5, 0.0], 500), 40);
    assert_eq!(called(0.95, [0.5, 0.0], 3000), 40);
}

/// Measurements that lie more samples apart than lags are known are neighbors, too: of 80 errors with a correlation of
/// `0.99^25 = 0.78` from one to the next all are called colored (white ones not: the level is 1 %), and independent ones not
/// correlated (before, all were taken for white and a sixth for correlated).
#[test]
fn slow_measurements_are_neighbors() {
    for every in [[25, 25], [1, 25]] {
        let slow = |seed| said(0.99, [0.0, 0.0], 2000, every, seed);
        let (colored, correlated) =
            (called(WarningCode::ColoredErrors, slow), called(WarningCode::CorrelatedOutputs, slow));
        assert!(colored == 40 && correlated <= 2, "{every:?}: {colored} {correlated}");
        let white = called(WarningCode::ColoredErrors, |seed| said(0.0, [0.0, 0.0], 2000, every, seed));
        assert!(white <= 2, "{every:?}: {white}");
    }
    let shared = called(WarningCode::CorrelatedOutputs, |seed| said(0.0, [0.5, 0.0], 10_000, [5, 25], seed));
    // 400 pairs with a correlation of a half: eight standard deviations, of which the level takes less than three.
    assert_eq!(shared, 40);
}

/// One error of eight standard deviations among 20,000, of which the largest normal one is above five in one record of hundred:
/// the sample is named, and nothing without it.
#[test]
fn a_single_outlier_is_named_by_its_time() {
    let inputs = levels(20_000, 5, 3).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Line, 0.5, inputs, Nothing, Affine { slope: 1.5, offset: -0.7 });
    let named = |outlier: f64| {
        let mut random = Noise(12);
        let disturbed = |(k, y): (usize, Pair)| {
            let more = if k == 12_346 { outlier } else { 0.0 };
            Pair { y: y.y + 0.1 * random.gauss(), z: y.z + 0.1 * random.gauss() + more }
        };
        let outputs = exact.outputs().enumerate().map(disturbed).collect();
        let record = with_outputs(&Line, &exact, outputs).named("bench");
        let estimate =
            Fit::new(&Line, &record).parameters(Affine { slope: free(1.0), offset: free(0.5) }).run().unwrap();
        let outliers = estimate.warnings.iter().filter(|warning| warning.code == WarningCode::Outliers);
        outliers.map(|warning| warning.text.clone()).collect::<Vec<_>>()
    };
    assert_eq!(named(0.0), Vec::<String>::new());
    let found = named(0.8);
    assert!(found.len() == 1 && found[0].contains("`z` at t = 6173 s of `bench`"), "{found:?}");
}

/// The unit of the outputs changes no weight of one against the other: in tens of teravolts the noise is far smaller than the
/// rounding of a number near one.
#[test]
fn noise_is_as_small_as_the_outputs_let_it_be() {
    let fit = |unit: f64| {
        let mut noise = Noise(21);
        let inputs: Vec<Drive> = (0..100).map(moving).map(|u| Drive { u: u.u * unit, w: u.w * unit }).collect();
        let measured =
            |u: &Drive| Pair { y: u.u + unit * 1e-4 * noise.gauss(), z: 1.1 * u.w + unit * 1e-2 * noise.gauss() };
        let outputs = inputs.iter().map(measured).collect();
        let record = Experiment::new(&Twice, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        Fit::new(&Twice, &record).parameters(Factor { a: free(1.0) }).run().unwrap().parameters.a
    };
    assert!((fit(1e-13) / fit(1.0) - 1.0).abs() < 1e-9, "{} {}", fit(1e-13), fit(1.0));
}

/// What is said of errors does not depend on the unit of the output.
#[test]
fn units_change_no_verdict() {
    let said = |unit: f64| {
        let record = lag(600, 0.2, 0.7, 5);
        let outputs = record.outputs().map(|y| Current { i: unit * y.i }).collect();
        let record = with_outputs(&Lag, &record, outputs);
        let parameters = Branch { gain: free(1.5 * unit), tau: free(0.08) };
        let estimate = Fit::new(&Lag, &record).parameters(parameters).run().unwrap();
        let of = |code: WarningCode| estimate.warnings.iter().find(|warning| warning.code == code).cloned();
        (of(WarningCode::ColoredErrors).unwrap(), estimate.warnings.len(), estimate.severity())
    };
    let (plain, _, _) = said(1.0);
    // 0.7 of errors of 0.2 in an output whose steps of -1 to 1 come out twice as large.
    assert!(plain.text.contains("the colored part is ") && plain.text.contains("times as wide"), "{}", plain.text);
    assert_eq!([said(1e-4), said(1e4)], [said(1.0), said(1.0)]);
}

signals! { pub struct Root { a: "A^2/V" } }

/// `i = sqrt(a u)`, whose slope is infinite where the input is zero.
struct Diode;

impl Model for Diode {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Root;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Root<S>) -> Current<S> {
        Current { i: (p.a * u.u).sqrt() }
    }
}

/// A weight of zero leaves a sample out, also where its slopes are no numbers.
#[test]
fn a_weight_of_zero_leaves_infinite_slopes_out() {
    let fit = |first: usize| {
        let mut noise = Noise(3);
        let inputs: Vec<Voltage> = (first..20).map(|k| Voltage { u: 0.5 * k as f64 }).collect();
        let outputs = (0..20).map(|k| Current { i: k as f64 + 0.1 * noise.gauss() }).skip(first).collect();
        let record = Experiment::new(&Diode, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Diode, &record).parameters(Root { a: free(1.0) });
        fit.weighting(|s: &Sample<Diode>| if s.u.u == 0.0 { 0.0 } else { 1.0 }).run().unwrap().parameters.a
    };
    assert!((fit(0) / fit(1) - 1.0).abs() < 1e-9, "{} {}", fit(0), fit(1));
}
