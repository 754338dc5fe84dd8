//! Units do not matter: with inputs, outputs and time in other units every number of an answer is that number in the other unit,
//! and what is said is the same. Nor does the order of the records.

use crate::common::*;
use greybox::diagnose::{Resampling, bands, bootstrap, identifiability, profile, residuals};
use greybox::*;
use serde_json::{Value, json};

/// Units of input, output and time, as parts of the first ones. Powers of two, so that rounding is the same.
#[derive(Clone, Copy)]
struct Units {
    u: f64,
    y: f64,
    t: f64,
}

const FIRST: Units = Units { u: 1.0, y: 1.0, t: 1.0 };
const OTHER: Units = Units { u: 8.0, y: 128.0, t: 1.0 / 32.0 };

/// How a record is disturbed, and how it is fitted.
#[derive(Clone, Copy, Debug)]
enum Case {
    White,
    Colored,
    Robust,
    Filtered,
}

fn record(units: Units, case: Case, seed: u64) -> ExperimentOf<Lag> {
    let inputs = levels(240, 12, seed).into_iter().map(|u| Voltage { u }).collect();
    let clean = simulated(&Lag, 0.015625, inputs, Current { i: 0.3 }, Branch { gain: 2.0, tau: 0.0625 });
    let (mut noise, mut error) = (Noise(seed), 0.0);
    let disturbed = |(k, y): (usize, Current)| {
        error = match case {
            Case::Colored => 0.8 * error + 0.1 * noise.gauss(),
            Case::Robust if k % 20 == 7 => noise.gauss(),
            _ => 0.1 * noise.gauss(),
        };
        Current { i: units.y * (y.i + error) }
    };
    let outputs = clean.outputs().enumerate().map(disturbed).collect();
    let inputs = clean.inputs().map(|u| Voltage { u: units.u * u.u }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.015625 * units.t };
    Experiment::new(&Lag, time, inputs, outputs).unwrap().named(format!("record {seed}"))
}

fn fit(units: Units, case: Case, records: &[ExperimentOf<Lag>]) -> Fit<'_, Lag> {
    let parameters = Branch { gain: free(1.5 * units.y / units.u), tau: free(0.125 * units.t) };
    let fit = Fit::new(&Lag, records).parameters(parameters);
    let sigma = Current { i: 0.125 * units.y };
    match case {
        Case::White | Case::Colored => fit,
        Case::Robust => fit.noise(sigma).loss(Huber(1.345)),
        Case::Filtered => {
            fit.noise(sigma).prefilter(Butterworth::low_pass(2, 8.0 / units.t, 0.015625 * units.t).unwrap())
        }
    }
}

/// All that is said of a fit, without words in which numbers are rounded to be read.
fn answer(units: Units, case: Case) -> Value {
    let records = [record(units, case, 1), record(units, case, 2)];
    let problem = fit(units, case, &records).problem().unwrap();
    let mut estimate = problem.run().unwrap();
    estimate.seconds = 0.0;
    // A density per unit of the output, whose logarithm is a sum.
    let deviance = estimate.deviance.take().map(|of| of - 2.0 * estimate.measurements as f64 * units.y.ln());
    let prediction = problem.predict(&estimate, &problem.records()[1]).unwrap();
    let deviance = deviance.map(|of| (of * 1e6).round());
    let log_likelihood = estimate.log_likelihood.take().map(|of| of + estimate.measurements as f64 * units.y.ln());
    let log_likelihood = log_likelihood.map(|of| (of * 1e6).round());
    let found = bands(&problem, &estimate, 1, 0.9).unwrap();
    json!({
        "deviance in millionths": deviance,
        "log-likelihood in millionths": log_likelihood,
        "estimate": estimate,
        "identifiability": identifiability(&problem, &estimate).unwrap(),
        "profile": [profile(&problem, &estimate, "gain", 0.9).unwrap(), profile(&problem, &estimate, "tau", 0.9).unwrap()],
        "bands": [found.outputs, found.confidence, found.prediction],
        "bootstrap": bootstrap(&problem, &estimate, Resampling::Blocks(0), 20, 1).unwrap(),
        "residuals": residuals::examine(&prediction, &problem.records()[1]).unwrap(),
    })
}

/// The places at which two answers differ by more than a power of two.
fn compare(place: String, one: &Value, other: &Value, found: &mut Vec<String>) {
    match (one, other) {
        (Value::Object(a), Value::Object(b)) if a.len() == b.len() => {
            a.iter().zip(b).for_each(|((key, a), (_, b))| compare(format!("{place}/{key}"), a, b, found));
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(i, (a, b))| compare(format!("{place}/{i}"), a, b, found));
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            let power = (b / a).log2();
            let same = a == b || (power.fract() == 0.0 && power.abs() <= 30.0);
            if !same {
                found.push(format!("{place}: {a} {b}"));
            }
        }
        (Value::String(a), Value::String(b)) => {
            let words = |text: &str| -> String { text.chars().filter(|c| c.is_alphabetic() && *c != 'e').collect() };
            if words(a) != words(b) {
                found.push(format!("{place}: {a} {b}"));
            }
        }
        (a, b) if a == b => {}
        (a, b) => found.push(format!("{place}: {a} {b}")),
    }
}

#[test]
fn every_number_follows_the_units() {
    for case in [Case::White, Case::Colored, Case::Robust, Case::Filtered] {
        let (first, other) = (answer(FIRST, case), answer(OTHER, case));
        let mut found = vec![];
        compare(String::new(), &first, &other, &mut found);
        assert!(found.is_empty(), "{case:?}: {found:#?}");
    }
}

fn numbers(value: &Value, found: &mut Vec<f64>) {
    match value {
        Value::Number(number) => found.extend(number.as_f64()),
        Value::Array(values) => values.iter().for_each(|value| numbers(value, found)),
        Value::Object(values) => values.values().for_each(|value| numbers(value, found)),
        _ => {}
    }
}

/// Sums over records in another order differ by rounding, and minima by the 1e-8 of a standard error to which they are found.
#[test]
fn the_order_of_records_does_not_matter() {
    for case in [Case::White, Case::Colored, Case::Robust, Case::Filtered] {
        let records = [1, 2, 3].map(|seed| record(FIRST, case, seed));
        let of = |order: [usize; 3]| {
            let records = order.map(|e| records[e].clone());
            let mut estimate = fit(FIRST, case, &records).run().unwrap().into_summary();
            estimate.seconds = 0.0;
            let mut found = vec![];
            numbers(&json!(estimate), &mut found);
            found.sort_by(f64::total_cmp);
            found
        };
        let (one, other) = (of([0, 1, 2]), of([2, 0, 1]));
        assert_eq!(one.len(), other.len());
        for (a, b) in one.iter().zip(&other) {
            assert!((a - b).abs() <= 1e-6 * a.abs() + 1e-9, "{case:?}: {a} {b}");
        }
    }
}
