#![cfg(feature = "std")]
//! What contradicts the model, and what it does not explain: outputs, halves and shapes that differ, noise of another size.

use crate::common::*;
use crate::interval_limits::{Gains, Mixer};
use crate::judgements::{Drive, Factor, Gain, Twice, edited, fit, moving, record, said};
use greybox::optimize::{JacobianColumns, LevenbergMarquardt, Stop};
use greybox::*;

/// Outputs with gains that differ by 30 %: the parameter of each alone is named, by its regression, and how far they are apart.
#[test]
fn outputs_that_contradict_each_other_are_named() {
    let record = record(300, (2.0, 2.6), 0.05, moving);
    let (mut y, mut z, mut uu, mut ww) = (0.0, 0.0, 0.0, 0.0);
    for (u, out) in record.inputs().zip(record.outputs()) {
        (y, z, uu, ww) = (y + u.u * out.y, z + u.w * out.z, uu + u.u * u.u, ww + u.w * u.w);
    }
    let estimate = fit(std::slice::from_ref(&record)).run().unwrap();
    let warning = said(&estimate, WarningCode::OutputsContradict).unwrap();
    assert_eq!(warning.severity, Severity::NotUsable);
    let (one, two) = (y / uu, z / ww);
    println!("{}", warning.text);
    assert!(warning.text.starts_with(&format!("`a` is {one:.3} +- ")), "{one} {}", warning.text);
    assert!(warning.text.contains("by `y` alone and") && warning.text.contains("by `z` alone ("), "{}", warning.text);
    assert!(warning.text.contains(&format!("and {two:.3} +- ")), "{two} {}", warning.text);
    let apart = 100.0 * (two - one) / estimate.parameters.a;
    assert!(warning.text.contains(&format!("({apart:.0} % apart;")), "{apart} {}", warning.text);
    let agreed = self::record(300, (2.0, 2.0), 0.05, moving);
    assert!(said(&fit(&[agreed]).run().unwrap(), WarningCode::OutputsContradict).is_none());
    let records = [record];
    // A loss that no error is large for, and weights of one, say the same of it.
    for fit in [fit(&records).loss(Huber(9.0)), fit(&records).weighting(|_: &Sample<Twice>| 1.0)] {
        let estimate = fit.run().unwrap();
        assert_eq!(said(&estimate, WarningCode::OutputsContradict).unwrap().text, warning.text);
    }
    // The chances hold for errors that are white before a filter.
    let filter = Butterworth::low_pass(1, 0.4, 1.0).unwrap();
    let other = [
        fit(&records).prefilter(filter),
        // Parts are compared at a minimum.
        fit(&records).optimizer(LevenbergMarquardt::new(Stop { iterations: 0, ..Stop::default() }, JacobianColumns)),
    ];
    for fit in other {
        assert!(said(&fit.run().unwrap(), WarningCode::OutputsContradict).is_none());
    }
}

/// Of two gains and three records, the gain and the records that differ most are named.
#[test]
fn the_gain_that_contradicts_is_named() {
    let of = |w: f64, seed: u64| {
        let inputs: Vec<Drive> = (0..100).map(moving).collect();
        let outputs = inputs.iter().map(|u| Current { i: u.u + w * u.w }).collect();
        let clean = Experiment::new(&Mixer, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        noisy(&Mixer, &clean, Current { i: 0.1 }, &mut Noise(seed)).named(format!("record {seed}"))
    };
    let records = [of(2.0, 1), of(2.2, 2), of(3.0, 3)];
    let parameters = Gains { u: free(0.5), w: free(0.5) };
    let estimate = Fit::new(&Mixer, &records).parameters(parameters).run().unwrap();
    let found = estimate.warnings.iter().find(|warning| warning.code == WarningCode::RecordsContradict);
    let text = &found.unwrap_or_else(|| panic!("{estimate}")).text;
    assert!(text.starts_with("`w` is ") && text.contains("record 1") && text.contains("record 3"), "{text}");
}

/// A gain that changes in the middle of the record is named with its value in each half.
#[test]
fn halves_that_contradict_each_other_are_named() {
    let inputs: Vec<Voltage> = levels(800, 20, 3).into_iter().map(|u| Voltage { u }).collect();
    let run = |gain: f64, start: f64, half: std::ops::Range<usize>| {
        simulated(&Lag, 5e-3, inputs[half].to_vec(), Current { i: start }, Branch { gain, tau: 0.05 })
    };
    let first = run(2.0, 0.0, 0..401);
    let border = first.outputs().last().unwrap().i;
    let second = run(2.4, border, 400..800);
    let mut noise = Noise(5);
    let outputs = first.outputs().take(400).chain(second.outputs());
    let outputs = outputs.map(|y| Current { i: y.i + 0.01 * noise.gauss() }).collect();
    let record = Experiment::new(&Lag, Time::Uniform { start: 0.0, step: 5e-3 }, inputs.clone(), outputs).unwrap();
    let parameters = Branch { gain: free(1.5), tau: free(0.08) };
    let estimate = Fit::new(&Lag, &record).parameters(parameters).run().unwrap();
    let warning = estimate.warnings.iter().find(|warning| warning.code == WarningCode::HalvesContradict);
    let warning = warning.unwrap_or_else(|| panic!("{estimate}"));
    let value = |by: &str| -> f64 {
        let before = warning.text.split(by).next().unwrap();
        let number = before.rsplit(" +- ").nth(1).unwrap().rsplit(' ').next().unwrap();
        number.parse().unwrap()
    };
    // Of 400 samples with errors of 0.01 each: far below a hundredth; the other half's initial state is the model's.
    assert!((value(" by the first half") - 2.0).abs() < 0.05, "{}", warning.text);
    assert!((value(" by the second half") - 2.4).abs() < 0.05, "{}", warning.text);
    assert_eq!(warning.severity, Severity::UsableWithCare, "{}", warning.text);
}

/// Two outputs, each known by eighty errors of 0.1 across its input of one: their gains differ by five standard errors of the
/// difference, `0.1 sqrt(2 / 79)`. The chance of as much, Fisher's F of 25 with 1 and 79 degrees of freedom, is 3.4e-6.
#[test]
fn outputs_contradict_by_their_difference() {
    let (u, e) = ([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0]);
    let apart = 5.0 * 0.1 * (2.0f64 / 79.0).sqrt();
    let inputs = (0..80).map(|k| Drive { u: u[k % 8], w: u[k % 8] }).collect();
    let output = |k: usize| {
        let (u, e) = (u[k % 8], 0.1 * e[k % 8]);
        Pair { y: 2.0 * u + e, z: (2.0 + apart) * u - e }
    };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&Twice, time, inputs, (0..80).map(output).collect()).unwrap();
    let estimate = fit(std::slice::from_ref(&record)).run().unwrap();
    let warning = said(&estimate, WarningCode::OutputsContradict).unwrap();
    assert!(warning.text.contains("Chow's test p = 3.4e-6"), "{}", warning.text);
}

/// `y = a u`, `z = a w`, of samples in an order.
#[derive(Clone)]
struct Ordered;

impl Model for Ordered {
    type State = Nothing;
    type Input = Drive;
    type Output = Pair;
    type Parameters = Factor;
    const KIND: Kind = Kind::Discrete;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, p: &Factor<S>) -> Pair<S> {
        Pair { y: p.a * u.u, z: p.a * u.w }
    }
}

/// Outputs whose gains differ are named, whether the inputs leave errors that are correlated over time or not; equal ones are not.
#[test]
fn outputs_contradict_by_colored_and_by_white_errors() {
    let contradicts = |hold: usize, gain: f64| {
        let (u, w) = (levels(400, hold, 1), levels(400, hold, 2));
        let mut noise = Noise(3);
        let mut output =
            |k: usize| Pair { y: 2.0 * u[k] + 0.05 * noise.gauss(), z: gain * w[k] + 0.05 * noise.gauss() };
        let outputs = (0..400).map(&mut output).collect();
        let inputs = (0..400).map(|k| Drive { u: u[k], w: w[k] }).collect();
        let record = Experiment::new(&Ordered, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let estimate = Fit::new(&Ordered, &record).parameters(Factor { a: free(1.0) }).run().unwrap();
        estimate.warnings.iter().any(|warning| warning.code == WarningCode::OutputsContradict)
    };
    assert!(contradicts(20, 2.6) && contradicts(1, 2.6));
    assert!(!contradicts(20, 2.0) && !contradicts(1, 2.0));
}

/// The same of two records, one of which is noisier: each counts by its own noise, `(0.1^2 + 0.3^2) / 79` for the difference,
/// in whatever coordinate the gain is sought; the chance is as above.
#[test]
fn records_contradict_by_their_own_noise() {
    let (u, e) = ([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0]);
    let apart = 5.0 * (0.1f64 / 79.0).sqrt();
    let record = |gain: f64, size: f64| {
        let inputs = (0..80).map(|k| Voltage { u: u[k % 8] }).collect();
        let outputs = (0..80).map(|k| Current { i: gain * u[k % 8] + size * e[k % 8] }).collect();
        Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
    };
    let records = [record(2.0, 0.1).named("one"), record(2.0 + apart, 0.3).named("two")];
    for a in [free(1.0), free(1.0).log()] {
        let estimate = Fit::new(&Gain, &records).parameters(Factor { a }).run().unwrap();
        let warning = estimate.warnings.iter().find(|warning| warning.code == WarningCode::RecordsContradict);
        let text = &warning.unwrap_or_else(|| panic!("{estimate}")).text;
        // By a regression of each, with `apart` = 0.178, `0.1 / sqrt(79)` = 0.0113 and three times that.
        for words in ["Chow's test p = 3.4e-6", "2 +- 0.011 by `one` alone", "2.178 +- 0.034 by `two` alone"] {
            assert!(text.contains(words), "{text}");
        }
    }
}

/// Intervals by a noise that was given too small are too narrow, by one that was given too large too wide.
#[test]
fn intervals_of_a_wrong_noise() {
    let record = record(200, (2.0, 2.0), 0.1, moving);
    for (sigma, word) in [(0.03, "too narrow"), (0.3, "too wide")] {
        let estimate = fit(std::slice::from_ref(&record)).noise(Pair { y: sigma, z: sigma }).run().unwrap();
        let warning = said(&estimate, WarningCode::GivenNoise).unwrap();
        assert!(warning.text.contains(word), "{warning:?}");
    }
}

/// The output whose errors follow an input, and that input.
#[test]
fn a_wrong_shape_is_named() {
    let good = record(400, (2.0, 2.0), 0.05, moving);
    let bent = |k: usize, y: Pair| Pair { z: y.z + 0.3 * moving(k).u * moving(k).u, ..y };
    let estimate = fit(&[edited(&good, bent)]).run().unwrap();
    let warning = said(&estimate, WarningCode::WrongShape).unwrap();
    assert!(warning.text.starts_with("the errors of `z` follow from the input `u`"), "{warning:?}");
    assert_eq!(said(&fit(&[good]).run().unwrap(), WarningCode::WrongShape), None);
}

/// A constant that the model does not have: its errors are larger than those of the mean, and said to be.
#[test]
fn worse_than_the_mean() {
    let mut noise = Noise(4);
    let inputs: Vec<Voltage> = (0..100).map(|k| Voltage { u: (0.7 * k as f64).sin() }).collect();
    let outputs = inputs.iter().map(|u| Current { i: 5.0 + 2.0 * u.u + noise.gauss() }).collect();
    let record = Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let estimate = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).run().unwrap();
    let warning = estimate.warnings.iter().find(|warning| warning.code == WarningCode::Unexplained).unwrap();
    assert!(warning.text.contains("worse than its mean"), "{warning:?}");
    assert_eq!(warning.severity, Severity::NotUsable);
}

/// An input and errors across it, eight samples again and again, of which the input explains three tenths: chance with 16 samples
/// (F of 1 and 14 degrees of freedom is 6, at a level of 3 %), and none with 80 (F of 1 and 78 is 33).
#[test]
fn what_chance_explains_is_not_explained() {
    let u = [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0];
    let e = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0];
    let of = |samples: usize| {
        let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: u[k % 8] }).collect();
        let y = |k: usize| Current { i: 0.3f64.sqrt() * u[k % 8] + 0.7f64.sqrt() * e[k % 8] };
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Gain, time, inputs, (0..samples).map(y).collect()).unwrap();
        let estimate = Fit::new(&Gain, &record).parameters(Factor { a: free(1.0) }).run().unwrap();
        assert!((estimate.parameters.a - 0.3f64.sqrt()).abs() < 1e-9, "{estimate}");
        estimate.warnings.iter().find(|warning| warning.code == WarningCode::Unexplained).map(|one| one.severity)
    };
    assert_eq!((of(16), of(80)), (Some(Severity::NotUsable), None));
}
