//! Signals that have instants of their own: records of series, and files in which an input has empty cells.

use crate::refused::says;
use greybox::record::Series;
use greybox::{DataFile, Error, Experiment, ExperimentOf, Fit, Hold, Model, Scalar, Time, fixed, free, signals};

signals! {
    pub struct Level { x: "m" }
    pub struct Feed { u: "m/s", v: "m/s" }
    pub struct Gauges { y: "m", z: "m" }
    pub struct Tank { tau: "s", gain: "1" }
}

/// `dx/dt = u + gain v - x / tau`, seen by two gauges.
#[derive(Clone, Copy)]
struct Basin;

impl Model for Basin {
    type State = Level;
    type Input = Feed;
    type Output = Gauges;
    type Parameters = Tank;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Feed<S>, p: &Tank<S>) -> Level<S> {
        Level { x: u.u + p.gain * u.v - x.x / p.tau }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Feed<S>, _p: &Tank<S>) -> Gauges<S> {
        Gauges { y: x.x, z: x.x * 2.0 }
    }
}

fn series(times: &[f64], values: &[f64]) -> Series {
    Series::new(times.to_vec(), values.to_vec())
}

fn column(record: &ExperimentOf<Basin>, of: impl Fn(usize) -> f64) -> Vec<String> {
    (0..record.len()).map(|k| of(k).to_string()).collect()
}

/// The instants of all four, from 0.2 s, where `v` begins, to 0.8 s, where the straight lines of `v` end. `3 * 0.1` and `0.3` are one instant, and
/// at 0.5 s the second gauge has two samples.
#[test]
fn a_record_has_the_instants_of_all_signals() {
    let u = series(&[0.0, 0.3, 0.6], &[1.0, 2.0, 3.0]);
    let v = series(&[0.2, 0.4, 0.8], &[10.0, 20.0, 0.0]).hold(Hold::First);
    let y = series(&[0.1, 3.0 * 0.1, 0.7, 0.9], &[5.0, 6.0, 7.0, 8.0]);
    let z = series(&[0.3, 0.5, 0.5], &[f64::NAN, -1.0, -2.0]);
    let record = Experiment::from_series(&Basin, vec![u, v], vec![y, z]).unwrap();
    assert_eq!(record.times(), &Time::Stamps(vec![0.2, 0.3, 0.4, 0.5, 0.5, 0.6, 0.7, 0.8]));
    assert_eq!(column(&record, |k| record.input(k).u), ["1", "2", "2", "2", "2", "3", "3", "3"]);
    // At 0.3 s, half way from 10 to 20; at 0.5, 0.6 and 0.7 s quarters of the way from 20 to 0.
    let expected = [10.0, 15.0, 20.0, 15.0, 15.0, 10.0, 5.0, 0.0];
    for (k, expected) in expected.into_iter().enumerate() {
        assert!((record.input(k).v - expected).abs() < 1e-13, "{k}: {}", record.input(k).v);
    }
    assert_eq!(column(&record, |k| record.output(k).y), ["NaN", "6", "NaN", "NaN", "NaN", "NaN", "7", "NaN"]);
    assert_eq!(column(&record, |k| record.output(k).z), ["NaN", "NaN", "NaN", "-1", "-2", "NaN", "NaN", "NaN"]);
    assert_eq!([record.record().input_hold(0), record.record().input_hold(1)], [Hold::Zero, Hold::First]);
}

/// A command each 0.1 s, a second input of straight lines between samples 0.25 s apart, gauges each 0.05 and 0.4 s; the level by its exact solution in
/// each 0.05 s. Without noise the fit has the truth, to what its steps leave.
#[test]
fn a_fit_of_several_rates_has_the_truth() {
    let (tau, gain, step) = (1.5f64, 0.7, 0.05);
    let command = |k: usize| (k / 2 * 7 % 5) as f64; // each second of the steps
    let corner = |k: usize| (k * k % 4) as f64; // each fifth
    let line = |k: usize| corner(k / 5) + (corner(k / 5 + 1) - corner(k / 5)) * (k % 5) as f64 / 5.0;
    let mut level = vec![0.0];
    for k in 0..400 {
        let (force, slope) = (command(k) + gain * line(k), gain * (line(k + 1) - line(k)) / step);
        let decay = (-step / tau).exp();
        level.push(level[k] * decay + force * tau * (1.0 - decay) + slope * tau * (step - tau * (1.0 - decay)));
    }
    let of = |every: usize, value: &dyn Fn(usize) -> f64| {
        let places = (0..=400).step_by(every);
        Series::new(places.clone().map(|k| step * k as f64).collect(), places.map(value).collect())
    };
    let inputs = vec![of(2, &command), of(5, &line).hold(Hold::First)];
    let outputs = vec![of(1, &|k| level[k]), of(8, &|k| 2.0 * level[k])];
    let record = Experiment::from_series(&Basin, inputs, outputs).unwrap().initial(Level { x: fixed(0.0) });
    assert_eq!(record.len(), 401);
    let found = Fit::new(&Basin, &record).parameters(Tank { tau: free(1.0), gain: free(1.0) }).run().unwrap();
    let Tank { tau: a, gain: b } = found.parameters;
    assert!((a / tau - 1.0).abs() < 1e-6 && (b / gain - 1.0).abs() < 1e-6, "{a} {b}");
}

#[test]
fn series_that_make_no_record() {
    let good = || series(&[0.0, 1.0, 2.0], &[1.0, 2.0, 3.0]);
    let of = |u: Series, y: Series| Experiment::from_series(&Basin, vec![u, good()], vec![y, good()]);
    assert!(of(good(), good()).is_ok());
    says(Experiment::from_series(&Basin, vec![good()], vec![good(), good()]), &["1 series for the 2 input(s)"]);
    says(of(series(&[0.0, 1.0], &[1.0]), good()), &["`u`", "1", "2", "times of `u`"]);
    says(of(series(&[], &[]), good()), &["`u` has no sample"]);
    says(of(good(), series(&[0.0, f64::NAN], &[1.0, 2.0])), &["time of `y`", "NaN", "sample 1"]);
    says(of(good(), series(&[0.0, 2.0, 1.0], &[1.0; 3])), &["sample 2", "2 s is followed by 1 s"]);
    says(of(series(&[0.0, 1.0], &[1.0, f64::INFINITY]), good()), &["`u` is inf", "sample 1", "t = 1 s"]);
    says(of(good(), series(&[0.0, 1.0], &[1.0, f64::INFINITY])), &["`y` is inf"]);
    // No instant at which both inputs are known.
    let late = Experiment::from_series(
        &Basin,
        vec![series(&[5.0, 6.0], &[1.0, 1.0]), good().hold(Hold::First)],
        vec![good(), good()],
    );
    assert!(matches!(late, Err(Error::TooFewSamples { samples: 0, .. })), "{late:?}");
    // Two values of an input at one instant.
    says(of(series(&[0.0, 1.0, 1.0, 2.0], &[1.0, 2.0, 3.0, 4.0]), good()), &["one instant", "`u`"]);
}

/// Cells of `v` are empty where it was not sampled: filled in by its hold, from its first number on.
#[test]
fn a_file_whose_input_has_empty_cells() {
    let path = std::env::temp_dir().join(format!("greybox_rates_{}.csv", std::process::id()));
    std::fs::write(&path, "t,u,v,y,z\n0,1,,1,1\n1,2,4,1,\n2,3,NaN,1,1\n3,4,,1,\n4,5,10,1,1\n5,6,,1,\n").unwrap();
    says(
        DataFile::new(&path).read(&Basin),
        &["line 2", "`v` is NaN", "a rate of its own", "DataFile::fill", "Record::from_series"],
    );
    let held = DataFile::new(&path).fill("v", Hold::Zero).read(&Basin).unwrap();
    assert_eq!(column(&held, |k| held.input(k).v), ["4", "4", "4", "10", "10"]);
    assert_eq!(held.times(), &Time::Uniform { start: 1.0, step: 1.0 });
    assert_eq!(
        held.record().reading().unwrap().to_string(),
        "cells between \",\", time \"t\" in s; `v` filled in between 2 samples; 1 row left out at which it is not known"
    );
    let lines = DataFile::new(&path).fill("v", Hold::First).read(&Basin).unwrap();
    assert_eq!(column(&lines, |k| lines.input(k).v), ["4", "6", "8", "10"]);
    assert_eq!(column(&lines, |k| lines.input(k).u), ["2", "3", "4", "5"]);
    assert_eq!(lines.record().input_hold(1), Hold::First);
    assert!(lines.record().reading().unwrap().to_string().ends_with("2 rows left out at which it is not known"));
    says(DataFile::new(&path).fill("y", Hold::Zero).read(&Basin), &["`y`", "for inputs"]);
    std::fs::write(&path, "t,u,v,y,z\n0,1,,1,1\n1,2,,1,\n").unwrap();
    says(DataFile::new(&path).fill("v", Hold::Zero).read(&Basin), &["`v`", "no number"]);
    std::fs::remove_file(path).unwrap();
}
