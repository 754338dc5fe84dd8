//! Records survive files, cuts and joints.
#![cfg(feature = "csv")]

use greybox::{Experiment, ExperimentOf, Model, Scalar, Time, signals};
use proptest::prelude::*;
use std::path::PathBuf;

signals! {
    pub struct Currents { id: "A", iq: "A" }
    pub struct Drive { ud: "V", w: "rad/s" }
    pub struct Winding { rs: "ohm" }
}

struct Pmsm;

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn output<S: Scalar>(&self, _t: f64, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

type Record = ExperimentOf<Pmsm>;

fn finite() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3, proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO]
}

fn time(samples: usize) -> impl Strategy<Value = Time> {
    let uniform = (-1e3..1e3, 1e-6..1e3).prop_map(|(start, step)| Time::Uniform { start, step });
    let stamps = (-1e3..1e3, prop::collection::vec(1e-6..1e3, samples)).prop_map(|(start, steps)| {
        let stamps = steps.iter().scan(start, |t: &mut f64, step| {
            *t += step;
            Some(*t)
        });
        Time::Stamps(stamps.collect())
    });
    prop_oneof![uniform, stamps]
}

fn record() -> impl Strategy<Value = Record> {
    let row = (finite(), finite(), prop::option::of(finite()), prop::option::of(finite()));
    prop::collection::vec(row, 2..40).prop_flat_map(|rows| {
        time(rows.len()).prop_map(move |time| {
            let u = rows.iter().map(|row| Drive { ud: row.0, w: row.1 }).collect();
            let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
            let y = rows.iter().map(|row| Currents { id: or_nan(row.2), iq: or_nan(row.3) }).collect();
            Experiment::new(&Pmsm, time, u, y).unwrap()
        })
    })
}

/// Equal to the last bit, missing outputs included.
fn same_signals(a: &Record, b: &Record) -> bool {
    let bits = |r: &Record| r.outputs().iter().map(|y| [y.id.to_bits(), y.iq.to_bits()]).collect::<Vec<_>>();
    a.inputs() == b.inputs() && bits(a) == bits(b)
}

/// Equal up to what rounding an even grid costs: as far as a [`Time::Uniform`] may be from the stamps that it replaces.
fn same_time(a: &Record, b: &Record) -> bool {
    let span = a.time(a.len() - 1).abs().max(a.time(0).abs());
    (0..a.len()).all(|k| (a.time(k) - b.time(k)).abs() <= 2.0 * f64::EPSILON * span)
}

proptest! {
    #[test]
    fn csv_gives_a_record_back(record in record(), id in any::<u32>()) {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("round_trip_{id}.csv"));
        record.to_csv(&path).unwrap();
        let read = Experiment::from_csv(&Pmsm, &path);
        std::fs::remove_file(&path).unwrap();
        let read = read.unwrap();
        prop_assert!(same_signals(&record, &read));
        prop_assert!(same_time(&record, &read), "{:?} {:?}", record.times(), read.times());
    }
}
