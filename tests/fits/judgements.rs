#![cfg(feature = "std")]
//! Where a verdict turns: errors, noise levels, sensors and records on either side of what is said of them.

use crate::common::*;
use crate::interval_limits::{Gains, Mixer};
use greybox::optimize::Outcome;
use greybox::*;

signals! { pub struct Factor { a: "1" } }
signals! { pub struct Drive { u: "V", w: "V" } }

/// `y = a u`, `z = a w`.
#[derive(Clone)]
pub struct Twice;

impl Model for Twice {
    type State = Nothing;
    type Input = Drive;
    type Output = Pair;
    type Parameters = Factor;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, p: &Factor<S>) -> Pair<S> {
        Pair { y: p.a * u.u, z: p.a * u.w }
    }
}

/// `y = a u`.
#[derive(Clone)]
pub struct Gain;

impl Model for Gain {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Factor;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Factor<S>) -> Current<S> {
        Current { i: p.a * u.u }
    }
}

/// Samples of inputs, and outputs of these gains with white errors of this size.
pub fn record(samples: usize, gains: (f64, f64), size: f64, drive: impl Fn(usize) -> Drive) -> ExperimentOf<Twice> {
    let mut noise = Noise(21);
    let inputs: Vec<Drive> = (0..samples).map(drive).collect();
    let outputs = inputs
        .iter()
        .map(|u| Pair { y: gains.0 * u.u + size * noise.gauss(), z: gains.1 * u.w + size * noise.gauss() });
    let outputs = outputs.collect();
    Experiment::new(&Twice, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

pub fn moving(k: usize) -> Drive {
    Drive { u: (0.7 * k as f64).sin(), w: (1.9 * k as f64).cos() }
}

pub fn edited(record: &ExperimentOf<Twice>, edit: impl Fn(usize, Pair) -> Pair) -> ExperimentOf<Twice> {
    with_outputs(&Twice, record, record.outputs().enumerate().map(|(k, y)| edit(k, y)).collect())
}

pub fn fit(records: &[ExperimentOf<Twice>]) -> Fit<'_, Twice> {
    Fit::new(&Twice, records).parameters(Factor { a: free(1.0) })
}

pub fn said(estimate: &Estimate<Twice>, code: WarningCode) -> Option<&Warning> {
    estimate.warnings.iter().find(|warning| warning.code == code)
}

pub fn severity(estimate: &Estimate<Twice>, code: WarningCode) -> Option<Severity> {
    said(estimate, code).map(|warning| warning.severity)
}

/// Fifty errors about nothing: no larger than the given noise by three standard deviations of a standard deviation, which is
/// `1 + 3 / sqrt(2 * 50) = 1.3`, they are that noise; above it they are what the model does not explain. No parameter is known.
#[test]
fn errors_as_large_as_their_noise_are_explained() {
    let mut noise = Noise(8);
    let inputs: Vec<f64> = (0..50).map(|k| (0.7 * k as f64).sin()).collect();
    let errors: Vec<f64> = (0..50).map(|_| noise.gauss()).collect();
    let along = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let gain = along(&inputs, &errors) / along(&inputs, &inputs);
    let left: Vec<f64> = inputs.iter().zip(&errors).map(|(u, e)| e - gain * u).collect();
    let rms = (along(&left, &left) / 50.0).sqrt();
    // The rest is 1 rms; of the gain, 0.1 is left.
    let outputs: Vec<Current> = inputs.iter().zip(&left).map(|(u, e)| Current { i: 0.1 * u + e / rms }).collect();
    let inputs = inputs.into_iter().map(|u| Voltage { u }).collect();
    let record = Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let found = |sigma: f64, code: WarningCode| {
        let fit = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).noise(Current { i: sigma });
        let estimate = fit.run().unwrap();
        estimate.warnings.iter().find(|warning| warning.code == code).map(|warning| warning.severity)
    };
    assert_eq!(found(1.0 / 1.2, WarningCode::Unexplained), None);
    assert_eq!(found(1.0 / 1.35, WarningCode::Unexplained), Some(Severity::NotUsable));
    assert_eq!(found(1.0, WarningCode::HoldsZero), Some(Severity::NotUsable));
    // Errors of 1.2 and ten times the noise, and noise beyond all that the output moves.
    assert_eq!(found(1.0, WarningCode::GivenNoise), None);
    assert_eq!(found(1.0 / 1.6, WarningCode::GivenNoise), Some(Severity::UsableWithCare));
    assert_eq!(found(1.0 / 3.0, WarningCode::GivenNoise), Some(Severity::UsableWithCare));
    assert_eq!(found(1.0 / 20.0, WarningCode::GivenNoise), Some(Severity::NotUsable));
    assert_eq!(found(3.0, WarningCode::GivenNoise), Some(Severity::UsableWithCare));
    assert_eq!(found(200.0, WarningCode::GivenNoise), Some(Severity::NotUsable));
    // Outliers, which a robust loss expects, are larger than the noise, but do not make errors smaller.
    let robust = |sigma: f64| {
        let fit = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).noise(Current { i: sigma });
        let estimate = fit.loss(Huber::default()).run().unwrap();
        estimate.warnings.iter().find(|warning| warning.code == WarningCode::GivenNoise).map(|warning| warning.severity)
    };
    assert_eq!([robust(1.0 / 3.0), robust(1.0), robust(3.0)], [None, None, Some(Severity::UsableWithCare)]);
    // What a pre-filter leaves of the errors is not of the size of the noise.
    let filter = Butterworth::low_pass(1, 0.1, 1.0).unwrap();
    let fit = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).noise(Current { i: 1.0 / 3.0 });
    let filtered = fit.prefilter(filter).run().unwrap();
    assert!(filtered.warnings.iter().all(|warning| warning.code != WarningCode::GivenNoise), "{:?}", filtered.warnings);
}

/// A constant input is said with care where a gain of its own may be taken for an offset; one that moves in a second record is none, nor
/// one whose gain another input tells, too. A note tells of one that is zero.
#[test]
fn constant_inputs_are_said() {
    let with = |w: f64| {
        let inputs: Vec<Drive> = (0..40).map(|k| Drive { w, ..moving(k) }).collect();
        let outputs = inputs.iter().map(|u| Current { i: 2.0 * u.u + 3.0 * u.w }).collect();
        let clean = Experiment::new(&Mixer, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        noisy(&Mixer, &clean, Current { i: 0.01 }, &mut Noise(3))
    };
    let of = |records: &[ExperimentOf<Mixer>]| {
        let parameters = Gains { u: free(1.0), w: free(1.0) };
        let estimate = Fit::new(&Mixer, records).parameters(parameters).run().unwrap();
        let mut found = estimate.warnings.iter().filter(|warning| warning.code == WarningCode::ConstantInput);
        found.next().map(|warning| (warning.severity, warning.text.clone()))
    };
    let text = "the input `w` is 1.5 V throughout: if an output had an offset, `w`, which acts by way of it, would be unknown; vary it";
    assert_eq!(of(&[with(1.5)]), Some((Severity::UsableWithCare, text.to_owned())));
    assert!(of(&[with(1.5), with(1.5).named("again")]).is_some());
    assert_eq!(of(&[with(1.5), with(2.5).named("other")]), None);
    assert_eq!(of(&[with(0.0)]).map(|(severity, _)| severity), Some(Severity::Usable));
    let with = |w: f64| record(40, (2.0, 2.0), 0.01, move |k| Drive { w, ..moving(k) });
    assert_eq!(severity(&fit(&[with(1.5)]).run().unwrap(), WarningCode::ConstantInput), None);
}

/// An output of which more than half is missing is said, with what is left of it in all records.
#[test]
fn missing_measurements_are_counted() {
    let good = record(40, (2.0, 2.0), 0.01, moving);
    let without = |missing: usize| edited(&good, |k, y| Pair { z: if k < missing { f64::NAN } else { y.z }, ..y });
    let of = |records: &[ExperimentOf<Twice>]| {
        let estimate = fit(records).run().unwrap();
        said(&estimate, WarningCode::MissingMeasurements).map(|warning| (warning.severity, warning.text.clone()))
    };
    assert_eq!(of(&[without(20)]), None);
    let text = "75 % of the measurements of `z` are missing (10 measurements are left)";
    assert_eq!(of(&[without(30)]), Some((Severity::Usable, text.to_owned())));
    let (_, text) = of(&[without(30), without(14).named("again")]).unwrap();
    assert!(text.starts_with("55 % of the measurements of `z`") && text.contains("36 measurements"), "{text}");
}

/// A value that stands for a missing measurement: said with the size of the errors there, of the record if there are several.
#[test]
fn sentinels_are_said_of_their_record() {
    let good = record(400, (2.0, 2.0), 0.01, moving);
    let bad = edited(&good, |k, y| Pair { y: if k % 80 == 7 { -999.0 } else { y.y }, ..y });
    let sample = |k: usize| 80 * k + 7;
    let alone = fit(std::slice::from_ref(&bad)).run().unwrap();
    let warning = said(&alone, WarningCode::Sentinel).unwrap();
    assert_eq!(warning.severity, Severity::NotUsable);
    let squares = (0..5).map(|k| (999.0 + alone.parameters.a * moving(sample(k)).u).powi(2)).sum::<f64>();
    let rms = (squares / 5.0).sqrt();
    assert!(warning.text.contains(&format!("differs there by {rms:.0} V")), "{rms} {warning:?}");
    assert!(!warning.text.contains("of experiment"), "{warning:?}");
    // A robust loss leaves them little weight: they do not decide the estimate.
    let robust = fit(std::slice::from_ref(&bad)).loss(Huber::default()).run().unwrap();
    assert_eq!(severity(&robust, WarningCode::Sentinel), Some(Severity::UsableWithCare));
    let both = fit(&[good.named("good"), bad.named("bad")]).run().unwrap();
    let warning = said(&both, WarningCode::Sentinel).unwrap();
    assert!(warning.text.contains("`y` of experiment `bad`"), "{warning:?}");
}

/// The same of an input, which acted on the plant with some other value.
#[test]
fn sentinels_of_inputs_are_said() {
    let good = record(400, (2.0, 2.0), 0.01, moving);
    let inputs = |k: usize, u: Drive| Drive { w: if k % 80 == 7 { -999.0 } else { u.w }, ..u };
    let inputs = good.inputs().enumerate().map(|(k, u)| inputs(k, u)).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let bad = Experiment::new(&Twice, time, inputs, good.outputs().collect()).unwrap();
    let said_of = |records: &[ExperimentOf<Twice>]| {
        let estimate = fit(records).run().unwrap();
        said(&estimate, WarningCode::Sentinel).map(|warning| (warning.severity, warning.text.clone()))
    };
    assert_eq!(said_of(std::slice::from_ref(&good)), None);
    let (severity, text) = said_of(std::slice::from_ref(&bad)).unwrap();
    assert!(severity == Severity::UsableWithCare && text.starts_with("the input `w` "), "{text}");
    assert!(text.contains("-999") && !text.contains("of experiment"), "{text}");
    let (_, text) = said_of(&[good.named("good"), bad.named("bad")]).unwrap();
    assert!(text.starts_with("the input `w` of experiment `bad` "), "{text}");
}

/// As many unknowns as measurements leave nothing to judge them by.
#[test]
fn nothing_is_known_without_degrees_of_freedom() {
    let exact = simulated(&Line, 1.0, vec![Voltage { u: 0.5 }], Nothing, Affine { slope: 1.5, offset: -0.7 });
    let record = with_outputs(&Line, &exact, exact.outputs().map(|y| Pair { y: y.y + 0.1, ..y }).collect());
    let parameters = Affine { slope: free(1.0), offset: free(0.5) };
    let estimate = Fit::new(&Line, &record).parameters(parameters).noise(Pair { y: 0.1, z: 0.1 }).run().unwrap();
    for unknown in &estimate.unknowns {
        assert_eq!(unknown.knowledge, Knowledge::Unidentified, "{unknown:?}");
    }
}

/// An effect that is certain and next to nothing: 2 % of the variance of 2,000 measurements, 1 % of the fit.
#[test]
fn an_effect_of_next_to_nothing_explains_nothing() {
    let mut noise = Noise(2);
    let inputs: Vec<Voltage> = (0..2000).map(|k| Voltage { u: (0.7 * f64::from(k)).sin() }).collect();
    let outputs = inputs.iter().map(|u| Current { i: 0.2 * u.u + noise.gauss() }).collect();
    let record = Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = || Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) });
    let of = |fit: Fit<'_, Gain>| {
        let estimate = fit.run().unwrap();
        let unknown = &estimate.unknowns[0];
        assert!(unknown.value > 5.0 * unknown.knowledge.standard_error().unwrap(), "{estimate}");
        let found = estimate.warnings.iter().find(|warning| warning.code == WarningCode::Unexplained);
        found.map(|warning| warning.severity)
    };
    assert_eq!(of(fit()), Some(Severity::NotUsable));
    // What is weighted or cut off is not what the fit was to explain.
    assert_eq!(of(fit().loss(Huber::default())), Some(Severity::UsableWithCare));
    assert_eq!(of(fit().weighting(|s: &Sample<Gain>| 1.0 + s.u.u * s.u.u)), Some(Severity::UsableWithCare));
}

/// A sensor that is stuck for a tenth of a record of millivolts.
#[test]
fn a_stuck_sensor_is_said() {
    let small = |k: usize| Drive { u: 1e-3 * moving(k).u, w: 1e-3 * moving(k).w };
    let good = record(400, (2.0, 2.0), 1e-6, small);
    let held = good.outputs().nth(200).unwrap().y;
    let stuck = edited(&good, |k, y| Pair { y: if (200..240).contains(&k) { held } else { y.y }, ..y });
    let of = |record: ExperimentOf<Twice>| severity(&fit(&[record]).run().unwrap(), WarningCode::Frozen);
    assert_eq!((of(good), of(stuck)), (None, Some(Severity::NotUsable)));
}

/// Single errors far out, with how many they are and what part of the sum of squares: a warning above half of it, else a note.
#[test]
fn outliers_are_said_with_their_share() {
    let good = record(400, (2.0, 2.0), 0.01, moving);
    for (by, every, part, expected) in
        [(0.5, 80, "1.2 %", Severity::UsableWithCare), (0.085, 160, "0.75 %", Severity::Usable)]
    {
        let is_far = |k: usize| k % every == 7;
        let record = edited(&good, |k, y| Pair { y: if is_far(k) { y.y + by } else { y.y }, ..y });
        let estimate = fit(std::slice::from_ref(&record)).run().unwrap();
        let pairs = record.outputs().zip(record.inputs());
        let squares: Vec<f64> = pairs.map(|(y, u)| (y.y - estimate.parameters.a * u.u).powi(2)).collect();
        let far: f64 = (0..400).filter(|k| is_far(*k)).map(|k| squares[k]).sum();
        let share = far / squares.iter().sum::<f64>();
        let warning = said(&estimate, WarningCode::Outliers).unwrap();
        assert_eq!((warning.severity, share > 0.5), (expected, expected == Severity::UsableWithCare), "{warning:?}");
        assert!(warning.text.contains(&format!("make {:.0} % of", 100.0 * share)), "{share} {warning:?}");
        assert!(warning.text.starts_with(part), "{warning:?}");
    }
    assert_eq!(said(&fit(&[good]).run().unwrap(), WarningCode::Outliers), None);
}

/// Five values of an output are coarse if each stands there four times on average.
#[test]
fn coarse_outputs_are_said() {
    let of = |samples: usize| {
        let rounded = edited(&record(samples, (2.0, 2.0), 1e-3, moving), |_, y| Pair { y: y.y.round(), ..y });
        severity(&fit(&[rounded]).run().unwrap(), WarningCode::CoarseOutput)
    };
    assert_eq!((of(15), of(40)), (None, Some(Severity::UsableWithCare)));
}

/// Eleven values are coarse where the errors are those of rounding alone, 0.29 of a step, not where noise of half a step spreads them evenly; 41 values are
/// not.
#[test]
fn rounding_without_noise_is_said() {
    let of = |samples: usize, noise: f64, step: f64| {
        let rounded = |y: Pair| Pair { y: (y.y / step).round() * step, ..y };
        let rounded = edited(&record(samples, (2.0, 2.0), noise, moving), |_, y| rounded(y));
        let values: std::collections::BTreeSet<i64> = rounded.outputs().map(|y| (y.y / step).round() as i64).collect();
        (values.len(), severity(&fit(&[rounded]).run().unwrap(), WarningCode::CoarseOutput))
    };
    assert_eq!([of(400, 1e-3, 0.4), of(400, 1e-3, 0.1)], [(11, Some(Severity::UsableWithCare)), (41, None)]);
    assert_eq!(of(400, 0.2, 0.4).1, None);
}

/// The deviance is that of the measurements: `sum of ln(2 pi s^2) + e^2 / s^2`, without what a prior adds to the cost.
#[test]
fn a_prior_is_no_part_of_the_deviance() {
    let record = record(30, (2.0, 2.0), 0.1, moving);
    let fit = Fit::new(&Twice, &record).parameters(Factor { a: free(1.0).prior(1.5, 0.02) });
    let estimate = fit.noise(Pair { y: 0.1, z: 0.2 }).run().unwrap();
    let a = estimate.parameters.a;
    let term = |error: f64, sigma: f64| (core::f64::consts::TAU * sigma * sigma).ln() + (error / sigma).powi(2);
    let pairs = record.outputs().zip(record.inputs());
    let expected: f64 = pairs.map(|(y, u)| term(y.y - a * u.u, 0.1) + term(y.z - a * u.w, 0.2)).sum();
    assert!((estimate.deviance.unwrap() / expected - 1.0).abs() < 1e-10, "{:?} {expected}", estimate.deviance);
}

/// Of one output, whose noise only scales the cost: `n (ln(2 pi s^2) + 1)` with `s^2` the mean square of the errors. A weighting
/// or a loss has no likelihood.
#[test]
fn the_deviance_of_one_output() {
    let mut noise = Noise(3);
    let inputs: Vec<Voltage> = levels(30, 1, 2).into_iter().map(|u| Voltage { u }).collect();
    let outputs = inputs.iter().map(|u| Current { i: 2.0 * u.u + 0.03 * noise.gauss() }).collect();
    let record = Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = || Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) });
    let estimate = fit().run().unwrap();
    let error = |(y, u): (Current, Voltage)| (y.i - estimate.parameters.a * u.u).powi(2);
    let square = record.outputs().zip(record.inputs()).map(error).sum::<f64>() / 30.0;
    let expected = 30.0 * ((core::f64::consts::TAU * square).ln() + 1.0);
    assert!((estimate.deviance.unwrap() / expected - 1.0).abs() < 1e-12, "{:?} {expected}", estimate.deviance);
    let weighted = fit().weighting(|s: &Sample<Gain>| 1.0 + s.u.u * s.u.u).run().unwrap();
    assert_eq!((weighted.deviance, fit().loss(Huber(1.345)).run().unwrap().deviance), (None, None));
}

/// With a full covariance, an output that is missing takes its row and column of it along: the estimate solves the normal
/// equations of what was measured.
#[test]
fn a_full_covariance_of_what_was_measured() {
    let mut noise = Noise(6);
    let good = record(200, (2.0, 2.0), 0.0, moving);
    let errors: Vec<(f64, f64)> = (0..200).map(|_| (0.1 * noise.gauss(), 0.2 * noise.gauss())).collect();
    let record = edited(&good, |k, y| Pair {
        y: if k % 5 == 0 { f64::NAN } else { y.y + errors[k].0 },
        z: if k % 7 == 1 { f64::NAN } else { y.z + errors[k].1 + errors[k].0 },
    });
    let estimate = fit(std::slice::from_ref(&record)).noise_covariance().run().unwrap();
    let covariance = estimate.noise_covariance.as_ref().unwrap();
    let inverse = |here: &[usize]| {
        nalgebra::DMatrix::from_fn(here.len(), here.len(), |i, j| covariance[(here[i], here[j])]).try_inverse().unwrap()
    };
    let (mut slope, mut size) = (0.0, 0.0f64);
    for (y, u) in record.outputs().zip(record.inputs()) {
        let all = [(y.y, u.u), (y.z, u.w)];
        let here: Vec<usize> = (0..2).filter(|&j| !all[j].0.is_nan()).collect();
        let e = nalgebra::DVector::from_iterator(
            here.len(),
            here.iter().map(|&j| all[j].0 - estimate.parameters.a * all[j].1),
        );
        let g = nalgebra::DVector::from_iterator(here.len(), here.iter().map(|&j| all[j].1));
        let weighted = inverse(&here) * &e;
        slope += g.dot(&weighted);
        size += g.dot(&(inverse(&here) * &g));
    }
    // In standard errors. Noise levels settle to 1e-6.
    assert!((slope / size.sqrt()).abs() < 1e-3, "{slope} {size}");
}

/// Data without noise: the start, the minimum, and slopes once more with the noise levels found there; not if they are given.
#[test]
fn evaluations_are_counted() {
    let record = record(40, (2.0, 2.0), 0.0, moving);
    let evaluations = |fit: Fit<'_, Twice>| {
        let estimate = fit.run().unwrap();
        assert_eq!(estimate.outcome, Outcome::Exact, "{estimate}");
        estimate.evaluations
    };
    let fit = || fit(std::slice::from_ref(&record));
    assert_eq!(evaluations(fit()), evaluations(fit().noise(Pair { y: 1.0, z: 1.0 })) + 1);
}

/// An output that never moves is that of a dead sensor, unless the model gives the same value beside an output that moves.
#[test]
fn a_constant_output_is_said() {
    let of = |z: f64, w: f64, size: f64| {
        let constant = record(100, (2.0, 2.0), size, |k| Drive { w, ..moving(k) });
        let constant = edited(&constant, |_, y| Pair { z, ..y });
        let fit = fit(std::slice::from_ref(&constant)).noise(Pair { y: 0.01, z: 0.01 });
        severity(&fit.run().unwrap(), WarningCode::ConstantOutput)
    };
    // The model gives 0.2 or so instead of 3; and 3, to 1e-9.
    assert_eq!((of(3.0, 0.1, 0.01), of(3.0, 1.5, 1e-9)), (Some(Severity::NotUsable), Some(Severity::Usable)));
    let plain = record(100, (2.0, 2.0), 0.01, moving);
    assert_eq!(severity(&fit(&[plain]).run().unwrap(), WarningCode::ConstantOutput), None);
}

/// The errors of a record that is cut into segments, each with the logarithm of its noise.
#[test]
fn the_deviance_of_a_long_record() {
    let inputs = levels(2_000, 12, 7).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, Branch { gain: 2.0, tau: 0.05 });
    let record = noisy(&Lag, &exact, Current { i: 0.1 }, &mut Noise(3));
    let parameters = Branch { gain: free(1.0), tau: free(0.1) };
    let estimate = Fit::new(&Lag, &record).parameters(parameters).noise(Current { i: 0.1 }).run().unwrap();
    let ratio = estimate.quality.i.rmse / 0.1;
    let expected = 2_000.0 * ((core::f64::consts::TAU * 0.01).ln() + ratio * ratio);
    assert!((estimate.deviance.unwrap() / expected - 1.0).abs() < 1e-9, "{:?} {expected}", estimate.deviance);
}

/// Priors so many standard errors of the data from what these say. The difference has the variance of both: four are 3.98 with a prior of a
/// tenth of a standard error, less 1 % because the errors grow with it, and twelve are 3.62 with one of the root of ten. A prior that
/// decides alone says nothing of itself.
#[test]
fn a_prior_that_the_data_contradict_is_said() {
    let record = record(400, (2.0, 2.0), 0.5, moving);
    let alone = Fit::new(&Twice, &record).parameters(Factor { a: free(1.0) }).run().unwrap();
    let (a, error) = (alone.parameters.a, alone.unknowns[0].knowledge.standard_error().unwrap());
    let said = |far: f64, std: f64| {
        let prior = free(1.0).prior(a + far * error, std * error);
        let fit = Fit::new(&Twice, &record).parameters(Factor { a: prior }).run().unwrap();
        let warning = fit.warnings.iter().find(|warning| warning.code == WarningCode::PriorContradicts);
        warning.map(|warning| (warning.severity, warning.text.clone()))
    };
    let (narrow, wide) = (0.1, 10f64.sqrt());
    assert_eq!(said(3.0, narrow), None);
    let (severity, text) = said(4.0, narrow).unwrap();
    assert_eq!(severity, Severity::UsableWithCare);
    assert!(text.contains("3.9 standard deviations of"), "{text}");
    assert_eq!(said(6.0, narrow).map(|said| said.0), Some(Severity::NotUsable));
    assert_eq!(said(-6.0, wide), None);
    let (severity, text) = said(-12.0, wide).unwrap();
    assert_eq!(severity, Severity::UsableWithCare);
    assert!(text.contains("3.6 standard deviations of"), "{text}");
    assert_eq!(said(6.0, 0.01), None);
}

/// A common factor of all weights leaves the distance of two independent numbers as it is: of ten and eleven standard errors, with a prior of three,
/// 3.16 and 3.48 of the root of ten.
#[test]
fn weights_do_not_contradict_a_prior() {
    let record = record(400, (2.0, 2.0), 0.5, moving);
    let alone = Fit::new(&Twice, &record).parameters(Factor { a: free(1.0) }).run().unwrap();
    let (a, error) = (alone.parameters.a, alone.unknowns[0].knowledge.standard_error().unwrap());
    for weight in [1.0, 100.0] {
        let said = |far: f64| {
            let prior = free(1.0).prior(a + far * error, 3.0 * error);
            let fit = Fit::new(&Twice, &record).parameters(Factor { a: prior });
            let fit = fit.weighting(move |_: &Sample<Twice>| weight).run().unwrap();
            let warning = fit.warnings.iter().find(|warning| warning.code == WarningCode::PriorContradicts);
            warning.map(|warning| warning.text.clone())
        };
        assert_eq!(said(10.0), None, "{weight}");
        let text = said(11.0).unwrap();
        assert!(text.contains("3.5 standard deviations of"), "{weight} {text}");
    }
}
