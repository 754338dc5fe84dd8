#![cfg(feature = "std")]
//! Sensors with a gain, an offset or a delay of their own, of which the unknowns absorb a part.

use crate::common::*;
use crate::dc_motor::{Armature, DcMotor, Feed, Rotation};
use crate::judgements::{Drive, Twice, fit};
use greybox::optimize::Severity;
use greybox::*;

fn said<M: Model>(estimate: &Estimate<M>) -> Option<&Warning> {
    estimate.warnings.iter().find(|warning| warning.code == WarningCode::SensorContradicts)
}

/// The numbers between some words, with `+-` between them.
fn numbers(text: &str, after: &str, before: &str) -> Option<(f64, f64)> {
    let (_, rest) = text.split_once(after)?;
    let (value, error) = rest.split_once(before)?.0.split_once(" +- ")?;
    Some((value.parse().ok()?, error.parse().ok()?))
}

/// Outputs `2 u` and `(2 + d) u` with errors of 0.1 that are orthogonal to `u`, 80 of each. With a gain of its own for `y`, `a` is what `z`
/// alone says and the gain is `1 - d/a`, of the squares `160 0.1^2` that are left with 158 degrees of freedom.
#[test]
fn a_gain_is_that_of_a_regression() {
    let (u, e) = ([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0]);
    let d = 0.1;
    let inputs = (0..80).map(|k| Drive { u: u[k % 8], w: u[k % 8] }).collect();
    let output = |k: usize| Pair { y: 2.0 * u[k % 8] + 0.1 * e[k % 8], z: (2.0 + d) * u[k % 8] - 0.1 * e[k % 8] };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&Twice, time, inputs, (0..80).map(output).collect()).unwrap();
    let estimate = fit(std::slice::from_ref(&record)).run().unwrap();
    let warning = said(&estimate).unwrap_or_else(|| panic!("{estimate}"));
    let a = 2.0 + 0.5 * d;
    let error = (160.0 * 0.01 / 158.0 * 2.0 / 80.0f64).sqrt() / a;
    let (value, said_error) = numbers(&warning.text, "`y` is ", " times what the model").unwrap();
    assert!(warning.text.starts_with("`y` is "), "{}", warning.text);
    // Four and two digits are said.
    assert!((value - (1.0 - d / a)).abs() < 1e-4 && (said_error / error - 1.0).abs() < 0.05, "{}", warning.text);
    // `a` moves by `d/2`, which is a part of 2.4 %; its error is that of 160 errors of 0.1 and of `d/2`, with 159 degrees of freedom.
    let moved = 0.5 * d / (160.0 * (0.01 + 0.25 * d * d) / 159.0 / 160.0f64).sqrt();
    assert!(warning.text.contains(&format!("`a` 2.4 % ({moved:.1} standard errors) away")), "{moved} {}", warning.text);
    assert_eq!(warning.severity, Severity::UsableWithCare);
}

/// A current that a controller holds at zero: its prediction is rounding, which the errors happen to follow. A gain of 5e15 is none.
#[test]
fn an_output_that_is_not_predicted_has_no_gain() {
    let (u, e) = ([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0]);
    let mut noise = Noise(2);
    let inputs = (0..80).map(|k| Drive { u: u[k % 8], w: 1e-17 * e[k % 8] }).collect();
    let mut output =
        |k: usize| Pair { y: 2.0 * u[k % 8] + 0.1 * noise.gauss(), z: 0.1 * e[k % 8] + 0.02 * noise.gauss() };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&Twice, time, inputs, (0..80).map(&mut output).collect()).unwrap();
    let estimate = fit(std::slice::from_ref(&record)).run().unwrap();
    assert!(said(&estimate).is_none(), "{estimate}");
}

const STEP: f64 = 1e-3;

/// A motor of known inertia that is switched every 15 samples, without noise.
fn motor(samples: usize, seed: u64) -> ExperimentOf<DcMotor> {
    let inputs = levels(samples, 15, seed).into_iter().map(|u| Feed { u: 12.0 * u, tau_l: 0.0 }).collect();
    let truth = Armature { r: 1.7, l: 5e-3, k: 0.08, j: 2e-4, b: 3e-4 };
    simulated(&DcMotor, STEP, inputs, Rotation { i: 0.0, w: 0.0 }, truth)
}

fn fitted(records: &[ExperimentOf<DcMotor>]) -> Estimate<DcMotor> {
    let start = Armature { r: free(1.5), l: free(6e-3), k: free(0.07), j: fixed(2e-4), b: free(4e-4) };
    Fit::new(&DcMotor, records).parameters(start).run().unwrap()
}

/// Noise of two percent of what the outputs move, and then what a sensor makes of it, by the two measurements and those of the sample before.
fn sensed(
    clean: &ExperimentOf<DcMotor>,
    seed: u64,
    sensor: impl Fn(Rotation, Rotation) -> Rotation,
) -> ExperimentOf<DcMotor> {
    let clean_outputs: Vec<Rotation> = clean.outputs().collect();
    let mut noise = Noise(seed);
    let at = |k: usize| {
        let y = sensor(clean_outputs[k], clean_outputs[k.saturating_sub(1)]);
        Rotation { i: y.i + 0.05 * noise.gauss(), w: y.w + noise.gauss() }
    };
    with_outputs(&DcMotor, clean, (0..clean_outputs.len()).map(at).collect())
}

/// Each fault of a sensor is named with its size. By small ones the linear steps hold, to a tenth of the fault and four of the standard errors that
/// are said; a record without a fault says nothing.
#[test]
fn faults_are_named_with_their_size() {
    type Sensor = fn(Rotation, Rotation) -> Rotation;
    let faults: [(&str, &str, f64, Sensor); 6] = [
        ("`i` is ", " times what", 1.05, |y, _| Rotation { i: 1.05 * y.i, ..y }),
        ("`w` is ", " times what", 0.95, |y, _| Rotation { w: 0.95 * y.w, ..y }),
        ("`i` lies ", " A beside", 0.2, |y, _| Rotation { i: y.i + 0.2, ..y }),
        ("`w` lies ", " rad/s beside", -4.0, |y, _| Rotation { w: y.w - 4.0, ..y }),
        ("`i` comes ", " samples after", 0.3, |y, z| Rotation { i: 0.7 * y.i + 0.3 * z.i, ..y }),
        ("`w` comes ", " samples after", 0.3, |y, z| Rotation { w: 0.7 * y.w + 0.3 * z.w, ..y }),
    ];
    for seed in 1..=4 {
        let clean = motor(600, seed);
        let none = fitted(&[sensed(&clean, seed, |y, _| y)]);
        assert!(said(&none).is_none() && none.severity() == Severity::Usable, "{none}");
        for (begin, unit, fault, sensor) in faults {
            let estimate = fitted(&[sensed(&clean, seed, sensor)]);
            let warning = said(&estimate).unwrap_or_else(|| panic!("{begin} {seed} {estimate}"));
            let (value, error) =
                numbers(&warning.text, begin, unit).unwrap_or_else(|| panic!("{begin} {}", warning.text));
            let from = if unit.contains("times") { 1.0 } else { 0.0 };
            let off = (value - fault).abs();
            assert!(off < 0.1 * (fault - from).abs() + 4.0 * error, "{begin} {fault} {}", warning.text);
            assert!(warning.severity >= Severity::UsableWithCare, "{}", warning.text);
            // Of two gains only the ratio shows; each offset and delay shows by itself.
            assert_eq!(warning.text.contains(", or `"), unit.contains("times"), "{}", warning.text);
        }
    }
}

/// Two records that share the fault, with measurements missing: one gain, with the error that both leave. Without a noise that was given the
/// residual of the fault counts as noise at first.
#[test]
fn records_share_the_gain_of_their_sensor() {
    let of = |seed: u64| {
        let clean = motor(300, seed);
        let record = sensed(&clean, seed, |y, _| Rotation { i: 1.1 * y.i, ..y });
        let mut noise = Noise(seed + 50);
        let missing = |y: Rotation| Rotation { i: if noise.uniform() < 0.3 { f64::NAN } else { y.i }, ..y };
        let outputs = record.outputs().map(missing).collect();
        with_outputs(&DcMotor, &record, outputs).named(format!("record {seed}"))
    };
    let (one, both) = (fitted(&[of(1)]), fitted(&[of(1), of(2)]));
    let [(_, single), (gain, error)] =
        [&one, &both].map(|fit| numbers(&said(fit).unwrap().text, "`i` is ", " times what").unwrap());
    assert!((gain - 1.1).abs() < 4.0 * error && error < single, "{gain} {error} {single}");
}

/// The unknowns absorb a wrong gain of the only output: nothing is to be seen, and nothing is said.
#[test]
fn what_unknowns_replace_is_not_named() {
    let inputs: Vec<Voltage> = levels(400, 20, 3).into_iter().map(|u| Voltage { u }).collect();
    let clean = simulated(&Lag, 5e-3, inputs, Current { i: 0.0 }, Branch { gain: 2.0, tau: 0.05 });
    let mut noise = Noise(4);
    let outputs = clean.outputs().map(|y| Current { i: 1.3 * y.i + 0.02 * noise.gauss() }).collect();
    let record = with_outputs(&Lag, &clean, outputs);
    let estimate = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.08) }).run().unwrap();
    assert!(said(&estimate).is_none() && estimate.severity() == Severity::Usable, "{estimate}");
    assert!((estimate.parameters.gain - 2.6).abs() < 0.02, "{estimate}");
}

/// Of 300 records of 200 samples without a fault, with such noise, those of which one is named.
fn named_of_300(noise: impl Fn(usize, f64, f64) -> f64) -> usize {
    let named = |seed: u64| {
        let inputs: Vec<Voltage> = levels(200, 10, seed).into_iter().map(|u| Voltage { u: 1.0 + u }).collect();
        let clean = simulated(&Lag, 5e-3, inputs, Current { i: 0.0 }, Branch { gain: 2.0, tau: 0.02 });
        let (mut random, mut error) = (Noise(seed), 0.0);
        let mut disturbed = |(k, y): (usize, Current)| {
            error = noise(k, error, random.gauss());
            Current { i: y.i + error }
        };
        let measured = clean.outputs().enumerate().map(&mut disturbed).collect();
        let record = with_outputs(&Lag, &clean, measured);
        let estimate = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.03) }).run().unwrap();
        usize::from(said(&estimate).is_some())
    };
    (1..=300).map(named).sum()
}

/// Noise that is ten times as large in the three samples after each step of the input, which decide the delay: the second test, at 1e-3, may
/// pass it by chance; four would be one chance in 300. By the errors' mean square alone there are more.
#[test]
fn noise_of_changing_size_is_no_fault() {
    let count = named_of_300(|k, _, normal| if k % 10 < 3 { 0.05 * normal } else { 0.005 * normal });
    assert!(count <= 3, "{count}");
}

/// First-order autoregressive noise with coefficient 0.9. Taken as white there are more.
#[test]
fn colored_noise_is_no_fault() {
    let count = named_of_300(|_, before, normal| 0.9 * before + 0.02 * normal);
    assert!(count <= 3, "{count}");
}

fn coarse(estimate: &Estimate<Straight>) -> Option<&Warning> {
    estimate.warnings.iter().find(|warning| warning.code == WarningCode::CoarseOutput)
}

/// A sensor with steps of 0.1, which may round or cut off: the offset replaces half a step, and moves by exactly that. What no offset replaces
/// tells one from the other.
#[test]
fn half_a_step_that_may_have_been_cut_off_is_said() {
    let step = 0.1;
    let fit = |size: f64, low: f64, offset: Parameter| {
        let mut noise = Noise(8);
        let inputs: Vec<Voltage> = (0..400).map(|k| Voltage { u: low + 0.0037 * f64::from(k % 397) }).collect();
        let measured = |u: &Voltage| 2.0 * u.u + 1.0 + 0.03 * noise.gauss();
        let outputs = inputs.iter().map(measured).map(|y| Current { i: (y / size).floor() * size }).collect();
        let record = Experiment::new(&Straight, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        Fit::new(&Straight, &record).parameters(Affine { slope: free(1.5), offset }).run().unwrap()
    };
    let estimate = fit(step, 0.0, free(0.5));
    let [slope, offset] = &estimate.unknowns[..] else { panic!("{estimate}") };
    assert!((slope.value - 2.0).abs() < 0.02 && (offset.value - 0.95).abs() < 0.02, "{estimate}");
    let warning = coarse(&estimate).unwrap_or_else(|| panic!("{estimate}"));
    let error = offset.knowledge.standard_error().unwrap();
    let said = format!("`offset` is {:.1} % ({:.0} standard errors) away", 5.0 / offset.value, 0.05 / error);
    assert!(warning.text.starts_with("the output `i` has ") && warning.text.contains(&said), "{said} {}", warning.text);
    assert!(warning.text.contains(" values, 0.1 A apart") && warning.severity == Severity::UsableWithCare);
    // Beyond 64 values, half a step counts for little.
    let finer = fit(0.1 * step, 0.0, free(0.5));
    assert!(coarse(&finer).is_none(), "{finer}");
    // With inputs of both signs the slope replaces no offset, which is known here, or by a prior: it is found where it was cut off.
    for known in [fixed(1.0), free(1.0).prior(1.0, 1e-3)] {
        let known = fit(step, -0.7, known);
        let (value, error) = numbers(&said_of(&known).text, "`i` lies ", " A beside").unwrap();
        assert!((value + 0.05).abs() < 4.0 * error && coarse(&known).is_none(), "{known}");
    }
    let rounded = fit(step, -0.7, fixed(0.95));
    assert!(coarse(&rounded).is_none() && rounded.severity() == Severity::Usable, "{rounded}");
}

fn said_of(estimate: &Estimate<Straight>) -> &Warning {
    said(estimate).unwrap_or_else(|| panic!("{estimate}"))
}
