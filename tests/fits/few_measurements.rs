#![cfg(feature = "std")]
//! Intervals that rest on one or two measurements.

use crate::common::*;
use crate::sandwiches::{Factor, Gain};
use greybox::estimate::CovarianceMethod;
use greybox::*;

/// Inputs of -1 and 1 in turn, but for these; errors are autoregressive with `rho`.
fn disturbed(samples: usize, far: &[(usize, f64)], rho: f64) -> ExperimentOf<Gain> {
    let (mut noise, mut error) = (Noise(8), 0.0);
    let mut next = || {
        error = rho * error + 0.1 * noise.gauss();
        error
    };
    let plain = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let far = |k: usize| far.iter().find(|(sample, _)| *sample == k).map_or(plain(k), |(_, u)| *u);
    let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: far(k) }).collect();
    let outputs = inputs.iter().map(|u| Current { i: 2.0 * u.u + next() }).collect();
    Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 0.5 }, inputs, outputs).unwrap().named("run")
}

fn record(samples: usize, far: &[(usize, f64)]) -> ExperimentOf<Gain> {
    disturbed(samples, far, 0.0)
}

fn said(summary: &Summary) -> Option<&Warning> {
    summary.warnings.iter().find(|warning| warning.code == WarningCode::DecidedByFew)
}

fn fitted(record: &ExperimentOf<Gain>, weighted: bool) -> Summary {
    let fit = Fit::new(&Gain, record).parameters(Factor { a: free(1.0) });
    let fit = if weighted { fit.weighting(|_: &Sample<Gain>| 1.0) } else { fit };
    fit.run().unwrap().into_summary()
}

/// The share of a measurement at `u` beside 50 at 1 or -1 is `u^2 / (u^2 + 50)`: 91 % at 22.48, 89 % at 20.11.
#[test]
fn one_measurement_that_decides_is_named() {
    for weighted in [false, true] {
        let (above, below) = (record(51, &[(7, 22.48)]), record(51, &[(7, 20.11)]));
        let summary = fitted(&above, weighted);
        let warning = said(&summary).unwrap();
        assert_eq!((warning.severity, summary.severity()), (Severity::Usable, Severity::Usable));
        let place = "the interval of `a` rests by 91 % on `i` at t = 3.5 s of `run`, ";
        assert!(warning.text.starts_with(place), "{}", warning.text);
        assert_eq!(warning.text.contains("up to some three times that of all"), weighted, "{}", warning.text);
        assert_eq!(said(&fitted(&below, weighted)), None);
    }
}

/// Two measurements at 15.5 beside 49 at 1 or -1 have 45 % each, `15.5^2 / (2 15.5^2 + 49)`; at 14.5 they have 89.6 % together.
#[test]
fn two_measurements_that_decide_are_named() {
    let summary = fitted(&record(51, &[(7, 15.5), (40, -15.5)]), false);
    let text = &said(&summary).unwrap().text;
    assert!(text.contains("rests by 91 % on `i` at t = 3.5 s of `run` and `i` at t = 20 s of `run`, "), "{text}");
    assert_eq!(said(&fitted(&record(51, &[(7, 14.5), (40, -14.5)]), false)), None);
}

/// Whether there are more than 200 measurements or not: with estimated noise, given noise, a sandwich and colored errors.
#[test]
fn long_records() {
    let found = |samples: usize, weighted: bool| said(&fitted(&record(samples, &[(7, 200.0)]), weighted)).is_some();
    assert_eq!([found(200, false), found(201, false), found(201, true)], [true; 3]);
    let given = |samples: usize| {
        let record = record(samples, &[(7, 200.0)]);
        let fit = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).noise(Current { i: 1.0 });
        said(&fit.run().unwrap().into_summary()).is_some()
    };
    assert_eq!([given(200), given(201)], [true; 2]);
    let colored = fitted(&disturbed(500, &[(7, 200.0)], 0.9), false);
    assert!(matches!(colored.method.covariance, CovarianceMethod::Hac { .. }), "{:?}", colored.method.covariance);
    // 200^2 / (200^2 + 499).
    assert!(said(&colored).unwrap().text.contains("rests by 99 % on `i` at t = 3.5 s of `run`, whose noise is taken"));
}

/// An initial state that the first measurement determines (three time constants lie between two, so that the share of the second is
/// `exp(-6)`, 0.25 % of its own): with squares it is taken for
/// granted; with a robust loss its interval is wider for it, and the note says so.
#[test]
fn initial_states_only_with_a_sandwich() {
    let samples = 15 * 100;
    let inputs: Vec<Voltage> = levels(samples, 20, 3).into_iter().map(|u| Voltage { u: 1.5 + 0.5 * u }).collect();
    let exact = simulated(&Lag, 0.01, inputs, Current { i: 1.0 }, Branch { gain: 2.0, tau: 0.05 });
    let mut noise = Noise(6);
    let outputs = exact.outputs().enumerate().map(|(k, y)| {
        let error = 0.1 * noise.gauss();
        Current { i: if k % 15 == 0 { y.i + error } else { f64::NAN } }
    });
    let record = with_outputs(&Lag, &exact, outputs.collect()).initial(Current { i: free(0.8) });
    let fit = || Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.08) });
    assert_eq!(said(&fit().run().unwrap()), None);
    let robust = fit().loss(Huber(1.345)).run().unwrap();
    let text = &said(&robust).unwrap().text;
    assert!(text.contains(&format!("the interval of `{}` rests by 100 % ", robust.unknowns[2].name)), "{text}");
    assert!(text.contains("on `i` at t = 0 s"), "{text}");
    // Where the others say nothing of that measurement, its noise counts as the root of `0.4 / 0.04`, 3.2 times that of all, and a part of its
    // own error; it was 25 times. The noise by Huber's clipped errors is theirs to a few percent.
    let classical = fit().run().unwrap().unknowns[2].knowledge.standard_error().unwrap();
    let ratio = robust.unknowns[2].knowledge.standard_error().unwrap() / classical;
    assert!((2.8..4.5).contains(&ratio), "{ratio} {robust}");
}

/// A logarithm whose interval is as wide as its value is known to a factor; that it might be zero is not said of it.
#[test]
fn a_logarithm_is_known_to_a_factor() {
    let summary = |a: Parameter| {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: (0.7 * f64::from(k)).sin() }).collect();
        let mut noise = Noise(4);
        let outputs = inputs.iter().map(|u| Current { i: 0.3 * u.u + noise.gauss() }).collect();
        let record = Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Gain, &record).parameters(Factor { a }).noise(Current { i: 1.0 });
        fit.run().unwrap().into_summary()
    };
    let text = |summary: &Summary| {
        let found = summary.warnings.iter().find(|warning| warning.code == WarningCode::HoldsZero);
        found.unwrap_or_else(|| panic!("{summary}")).text.clone()
    };
    let (plain, logarithm) = (summary(free(1.0)), summary(free(1.0).log()));
    assert!(text(&plain).contains("`a` cannot be told from zero"), "{plain}");
    let Knowledge::Known { lower, upper, .. } = logarithm.unknowns[0].knowledge else { panic!("{logarithm}") };
    let factor: f64 =
        text(&logarithm).split("to a factor of ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // Two digits are written.
    assert!((factor / (upper / lower).sqrt() - 1.0).abs() < 0.05 && !text(&logarithm).contains("zero"), "{logarithm}");
}
