//! Records survive files, cuts and joints.
#![cfg(feature = "csv")]

use crate::pmsm::{Currents, Drive, Pmsm};
use greybox::{DataFile, Experiment, ExperimentOf, Hold, Sample, Time};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::path::PathBuf;

type Record = ExperimentOf<Pmsm>;

fn finite() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    prop_oneof![-1e3..1e3, POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO]
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
    prop::collection::vec(row, 4..40).prop_flat_map(|rows| {
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
    let bits = |r: &Record| {
        let rows = r.inputs().zip(r.outputs());
        rows.map(|(u, y)| [u.ud, u.w, y.id, y.iq].map(f64::to_bits)).collect::<Vec<_>>()
    };
    bits(a) == bits(b)
}

/// Equal up to what rounding an even grid costs: half a unit in the last place for a stamp, the product and the sum in
/// either record, and for the two stamps that the step is taken from.
fn same_time(a: &Record, b: &Record) -> bool {
    let span = a.time(a.len() - 1).abs() + a.time(0).abs();
    (0..a.len()).all(|k| (a.time(k) - b.time(k)).abs() <= 4.0 * f64::EPSILON * span)
}

const NUMBERS: &[&str] = &["1", "-2.5", " 3e2 ", "\"4\"", "-0"];
const OTHERS: &[&str] = &["", "nan", "1,5", "1e400", "x"];
const NOISE: &[u8] = b"\n\r\"#,;.-\0\xef\xfe ";

fn cell() -> impl Strategy<Value = &'static str> {
    prop_oneof![30 => prop::sample::select(NUMBERS), 1 => prop::sample::select(OTHERS)]
}

/// The same cases in every run.
fn seeded() -> ProptestConfig {
    ProptestConfig { rng_seed: RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn csv_gives_a_record_back(record in record(), id in any::<u32>()) {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("round_trip_{id}.csv"));
        record.to_csv(&path).unwrap();
        let read = Experiment::from_file(&Pmsm, &path);
        std::fs::remove_file(&path).unwrap();
        let read = read.unwrap();
        prop_assert!(same_signals(&record, &read));
        prop_assert!(same_time(&record, &read), "{:?} {:?}", record.times(), read.times());
    }
}

proptest! {
    #![proptest_config(seeded())]

    /// Whatever a file holds: a record that keeps its promises, or an error; never a panic.
    #[test]
    fn any_file_is_read_or_refused(
        rows in prop::collection::vec(prop::collection::vec(cell(), 4), 0..6),
        noise in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(NOISE)), 0..3),
        header in prop::sample::select(&["t,ud,w,id,iq\n", "# t,ud,w,id,iq\n", "t;ud;w;id;iq\n"][..]),
        settings in any::<[bool; 3]>(),
        id in any::<u32>(),
    ) {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("any_{id}.csv"));
        let mut text = header.as_bytes().to_vec();
        let comma = if header.contains(';') { ";" } else { "," };
        for (t, row) in rows.iter().enumerate() {
            text.extend(format!("{t}{comma}{}\n", row.join(comma)).bytes());
        }
        for (place, noise) in noise {
            text.insert(place.index(text.len() + 1), noise);
        }
        std::fs::write(&path, text).unwrap();
        let mut file = DataFile::new(&path);
        if settings[0] {
            file = file.decimal_comma();
        }
        if settings[1] {
            file = file.units_row();
        }
        if settings[2] {
            file = file.sample_time(0.1);
        }
        let read = file.read(&Pmsm);
        std::fs::remove_file(&path).unwrap();
        match read {
            Ok(record) => {
                prop_assert!(record.len() >= 2 && (1..record.len()).all(|k| record.time(k) > record.time(k - 1)));
                prop_assert!(record.inputs().all(|u| u.ud.is_finite() && u.w.is_finite()));
                prop_assert!(record.outputs().all(|y| !y.id.is_infinite() && !y.iq.is_infinite()));
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn json_gives_a_record_back(record in record(), first in any::<bool>()) {
        let hold = if first { Hold::First } else { Hold::Zero };
        let record = record.hold(hold).named("a \"b\" ü");
        let text = serde_json::to_string(&record).unwrap();
        let read: Record = serde_json::from_str(&text).unwrap();
        prop_assert!(same_signals(&record, &read));
        prop_assert_eq!(record.times(), read.times());
        prop_assert_eq!((record.name(), record.input_holds()), (read.name(), read.input_holds()));
        prop_assert_eq!(serde_json::to_string(&read).unwrap(), text);
    }

    #[test]
    fn a_split_record_joins_again(record in record(), at in 0.0..1.0_f64) {
        let cut = 2 + (at * (record.len() as f64 - 3.0)) as usize;
        let (first, second) = record.split_at(record.time(cut)).unwrap();
        prop_assert_eq!((first.len(), second.len()), (cut, record.len() - cut));
        let joined = first.join(&second).unwrap();
        prop_assert!(same_signals(&record, &joined));
        prop_assert!(same_time(&record, &joined), "{:?} {:?}", record.times(), joined.times());
    }

    #[test]
    fn cycles_are_the_runs(record in record(), level in -1e3..1e3_f64) {
        let running = |s: &Sample<Pmsm>| s.u.w > level;
        let cycles = record.cycles(2, running);
        for cycle in &cycles {
            prop_assert!(cycle.len() >= 2 && cycle.samples().all(|s| running(&s)));
        }
        // No pair of running neighbors is lost, and none is counted twice.
        let above = |u: Drive| u.w > level;
        let pairs = |r: &Record| r.inputs().zip(r.inputs().skip(1)).filter(|&(a, b)| above(a) && above(b)).count();
        prop_assert_eq!(pairs(&record), cycles.iter().map(|cycle| cycle.len() - 1).sum::<usize>());
    }
}
