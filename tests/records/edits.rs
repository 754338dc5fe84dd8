//! Cutting, thinning and describing records; and records in JSON that are none.

use crate::refused::says;
use approx::assert_relative_eq;
use greybox::{
    Error, Experiment, ExperimentOf, Hold, Initial, Model, Sample, Scalar, Time, fixed, free, record::Gap, signals,
};

signals! {
    pub struct Level { x: "m" }
    pub struct Flow { u: "m/s" }
    pub struct Gauges { y: "m", z: "m" }
    pub struct Tank { tau: "s" }
}

#[derive(Clone, Copy)]
struct Basin;

impl Model for Basin {
    type State = Level;
    type Input = Flow;
    type Output = Gauges;
    type Parameters = Tank;

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Flow<S>, _p: &Tank<S>) -> Gauges<S> {
        Gauges { y: x.x, z: x.x }
    }
}

type Record = ExperimentOf<Basin>;

fn record(time: Time, samples: usize) -> Record {
    let inputs = (0..samples).map(|k| Flow { u: k as f64 }).collect();
    let outputs = (0..samples).map(|k| Gauges { y: -(k as f64), z: if k % 4 == 0 { 1.0 } else { f64::NAN } }).collect();
    Experiment::new(&Basin, time, inputs, outputs).unwrap()
}

fn even(samples: usize) -> Record {
    record(Time::Uniform { start: 0.0, step: 0.1 }, samples)
}

fn u(record: &Record) -> Vec<f64> {
    record.inputs().map(|u| u.u).collect()
}

#[test]
fn slices_by_sample() {
    let record = even(10);
    let piece = record.slice(3..6).unwrap();
    assert_eq!((piece.name(), piece.time(0), u(&piece)), ("record[3..6]", 3.0 * 0.1, vec![3.0, 4.0, 5.0]));
    assert_eq!(piece.output(0).y, -3.0);
    assert_eq!(u(&record.slice(..=1).unwrap()), [0.0, 1.0]);
    assert_eq!(u(&record.slice(8..).unwrap()), [8.0, 9.0]);
    assert_eq!(record.slice(..).unwrap().len(), 10);
    says(record.slice(5..11), &["`record` has 10 samples", "5..11"]);
    let (begin, end) = (6, 5);
    says(record.slice(begin..end), &["6..5"]);
    says(record.slice(..=usize::MAX), &["10 samples"]);
    says(record.slice(4..5), &["`record[4..5]`", "1 sample", "2 or more"]);
}

/// A bound is met although `3 * 0.1` is above and `0.7` below its decimal reading in binary.
#[test]
fn slices_by_time() {
    let record = even(10);
    assert_eq!(u(&record.between(0.3..0.7).unwrap()), [3.0, 4.0, 5.0, 6.0]);
    assert_eq!(u(&record.between(0.3..=0.7).unwrap()), [3.0, 4.0, 5.0, 6.0, 7.0]);
    assert_eq!(u(&record.between(..0.2).unwrap()), [0.0, 1.0]);
    assert_eq!(u(&record.between(0.75..).unwrap()), [8.0, 9.0]);
    assert_eq!(record.between(-1e9..1e9).unwrap().len(), 10);
    let stamps = self::record(Time::Stamps(vec![0.0, 1.0, 4.0, 9.0]), 4);
    assert_eq!(u(&stamps.between(1.0..9.0).unwrap()), [1.0, 2.0]);
    assert_eq!(stamps.between(1.0..9.0).unwrap().times(), &Time::Stamps(vec![1.0, 4.0]));
    says(record.between(f64::NAN..1.0), &["`record`", "NaN"]);
    says(record.between(5.0..6.0), &["0 sample"]);
    let (begin, end) = (0.7, 0.3);
    says(record.between(begin..end), &["0 sample"]);
}

#[test]
fn splits() {
    let record = even(10);
    let (train, validation) = record.split(0.7).unwrap();
    assert_eq!((train.name(), train.len()), ("record, part 1", 7));
    assert_eq!((validation.name(), u(&validation)), ("record, part 2", vec![7.0, 8.0, 9.0]));
    assert_eq!(record.split_at(0.3).unwrap().0.len(), 3);
    for fraction in [-0.1, 1.1, f64::NAN] {
        says(record.split(fraction), &["`record`", &fraction.to_string()]);
    }
    says(record.split(0.0), &["part 1", "0 sample"]);
    says(record.split(0.95), &["part 2", "0 sample"]);
    says(record.split_at(0.85), &["part 2", "1 sample"]);
    says(record.split_at(f64::NAN), &["NaN"]);
}

#[test]
fn pieces_keep_the_hold_and_only_the_first_keeps_the_initial_state() {
    let given = even(10).hold(Hold::First).initial(Level { x: free(2.0) });
    let (first, second) = given.split(0.5).unwrap();
    assert_eq!((first.record().input_hold(0), second.record().input_hold(0)), (Hold::First, Hold::First));
    assert!(matches!(first.initial_state(), Initial::Given(given) if given[0].start == 2.0));
    assert!(matches!(second.initial_state(), Initial::Free));
    assert!(matches!(given.decimate(2).unwrap().initial_state(), Initial::Given(_)));
    let measured = even(10).initial_from_first_sample();
    assert!(matches!(measured.slice(5..).unwrap().initial_state(), Initial::FirstSample));
}

#[test]
fn joins() {
    let (first, second) = even(10).split(0.5).unwrap();
    let joined = first.clone().join(&second).unwrap();
    assert_eq!(u(&joined), u(&even(10)));
    assert!(matches!(joined.times(), Time::Uniform { start: 0.0, .. }));
    assert_relative_eq!(joined.sample_time(), 0.1, max_relative = 1e-15);
    says(second.clone().join(&first), &["part 2", "sample 5", "0.9 s is followed by 0 s"]);
    says(first.clone().hold(Hold::First).join(&second), &["part 1", "part 2", "First and Zero"]);
    let apart = first.join(&second.slice(2..).unwrap()).unwrap();
    assert_eq!(apart.gaps().len(), 1);
}

#[test]
fn thins_out() {
    let record = even(10);
    let thin = record.decimate(4).unwrap();
    assert_eq!(thin.times(), &Time::Uniform { start: 0.0, step: 0.4 });
    // The mean of 0 to 3, of 4 to 7, and of what is left: the interval after sample 8.
    assert_eq!(u(&thin), [1.5, 5.5, 8.0]);
    assert_eq!(thin.outputs().map(|y| y.y).collect::<Vec<_>>(), [0.0, -4.0, -8.0]);
    assert_eq!(u(&record.clone().hold(Hold::First).decimate(4).unwrap()), [0.0, 4.0, 8.0]);
    assert_eq!(u(&record.decimate(1).unwrap()), u(&record));
    let stamps = self::record(Time::Stamps(vec![0.0, 1.0, 4.0, 9.0]), 4).decimate(2).unwrap();
    assert_eq!(stamps.times(), &Time::Stamps(vec![0.0, 4.0]));
    // Held for 1 s at 0 and for 3 s at 1.
    assert_eq!(u(&stamps), [0.75, 2.0]);
    says(record.decimate(0), &["`record`", "0"]);
    says(record.decimate(10), &["1 sample", "2 or more"]);
    says(record.decimate(usize::MAX), &["1 sample"]);
}

/// `dx/dt = (u - x) / tau` under a held input, in closed form: with the mean the error at a kept sample falls with the
/// square of the interval, with the kept input alone only in proportion.
#[test]
fn thinned_input_is_right_to_second_order() {
    let (step, samples, tau) = (1e-4, 8193, 0.2_f64);
    let inputs = (0..samples).map(|k| Flow { u: (6.0 * k as f64 * step).sin() }).collect();
    let outputs = vec![Gauges { y: 0.0, z: 0.0 }; samples];
    let fine = Experiment::new(&Basin, Time::Uniform { start: 0.0, step }, inputs, outputs).unwrap();
    let last = |record: &Record| {
        let decay = (-record.sample_time() / tau).exp();
        record.inputs().take(record.len() - 1).fold(0.0, |x, u| decay * x + (1.0 - decay) * u.u)
    };
    let error = |n: usize, hold: Hold| {
        let thin = fine.clone().hold(hold).decimate(n).unwrap();
        assert_eq!(thin.time(thin.len() - 1), 8192.0 * step);
        (last(&thin) - last(&fine)).abs()
    };
    let order = |hold| (error(128, hold) / error(64, hold)).log2();
    assert_relative_eq!(order(Hold::Zero), 2.0, epsilon = 0.05);
    // A first-order hold keeps the instants; read as held, they are what picking would give.
    assert_relative_eq!(order(Hold::First), 1.0, epsilon = 0.05);
}

#[test]
fn a_constant_input_stays_constant() {
    let value = 0.1 + 0.2;
    let time = Time::Stamps((0..100).map(|k| (k as f64).powf(1.1)).collect());
    let record =
        Experiment::new(&Basin, time, vec![Flow { u: value }; 100], vec![Gauges { y: 0.0, z: 0.0 }; 100]).unwrap();
    assert!(record.decimate(7).unwrap().inputs().all(|u| u.u == value));
}

#[test]
fn cuts_into_cycles() {
    let record = even(12);
    let cycles = record.cycles(3, |s: &Sample<Basin>| s.u.u % 5.0 != 0.0);
    let names: Vec<_> = cycles.iter().map(|cycle| cycle.name()).collect();
    assert_eq!(names, ["record, cycle 1", "record, cycle 2"]);
    assert_eq!(u(&cycles[1]), [6.0, 7.0, 8.0, 9.0]);
    // A run up to the last sample is a cycle too; a single sample never is.
    assert_eq!(u(&record.cycles(0, |s: &Sample<Basin>| s.t > 0.95)[0]), [10.0, 11.0]);
    assert!(record.cycles(0, |s: &Sample<Basin>| s.t > 1.05).is_empty());
    assert_eq!(record.cycles(0, |_: &Sample<Basin>| true)[0].len(), 12);
    assert!(record.cycles(13, |_: &Sample<Basin>| true).is_empty());
}

#[test]
fn finds_gaps() {
    let jitter = [0.0, 1.0, 2.1, 3.0, 5.0, 6.0, 9.0, 12.0, 12.9, 14.0, 15.0, 16.0];
    let record = record(Time::Stamps(jitter.to_vec()), 12);
    let gaps = record.gaps();
    let gap = |(sample, from, to)| Gap { sample, from: f64::into(from), to: f64::into(to) };
    let all = [(4, 3.0, 5.0), (6, 6.0, 9.0), (7, 9.0, 12.0)].map(gap);
    assert_eq!(gaps, all);
    assert_eq!(gaps[0].to_string(), "no sample from 3 s to 5 s (before sample 4)");
    let pieces: Vec<_> = record.without_gaps().iter().map(u).collect();
    // Sample 6 stands alone.
    assert_eq!(pieces, [vec![0.0, 1.0, 2.0, 3.0], vec![4.0, 5.0], vec![7.0, 8.0, 9.0, 10.0, 11.0]]);
    assert!(even(10).gaps().is_empty());
    assert_eq!(even(10).without_gaps()[0].len(), 10);
}

#[test]
fn knows_what_was_measured() {
    assert_eq!(even(8).coverage(), Gauges { y: 1.0, z: 0.25 });
}

fn json() -> serde_json::Value {
    serde_json::to_value(even(3).initial(Level { x: free(1.0).within(0.0, 9.0).prior(1.0, 0.5).log() })).unwrap()
}

#[test]
fn json_is_readable() {
    let initial = serde_json::json!({"Given": {"x": {
        "start": 1.0, "free": true, "lower": 0.0, "upper": 9.0, "prior": {"mean": 1.0, "std": 0.5},
        "transform": "log", "per_experiment": false, "positive": false,
    }}});
    let expected = serde_json::json!({
        "name": "record", "hold": "Zero", "initial": initial,
        "time": {"Uniform": {"start": 0.0, "step": 0.1}}, "time_unit": {"name": "s", "size": 1.0},
        "inputs": {"u": [0.0, 1.0, 2.0]},
        "outputs": {"y": [-0.0, -1.0, -2.0], "z": [1.0, null, null]},
    });
    assert_eq!(json(), expected);
    let read: Record = serde_json::from_value(json()).unwrap();
    let given = free(1.0).within(0.0, 9.0).prior(1.0, 0.5).log();
    assert_eq!(read.initial_state(), &Initial::Given(vec![given]));
    for initial in ["Estimated", "FirstSample"] {
        let mut text = json();
        text["initial"] = initial.into();
        assert_eq!(serde_json::to_value(serde_json::from_value::<Record>(text.clone()).unwrap()).unwrap(), text);
    }
    let unbounded = even(3).initial(Level { x: fixed(1.0) });
    let text = serde_json::to_string(&unbounded).unwrap();
    assert!(text.contains(r#""lower":"-Infinity""#));
    let read: Record = serde_json::from_str(&text).unwrap();
    assert_eq!(read.initial_state(), &Initial::Given(vec![fixed(1.0)]));
}

#[test]
fn json_that_is_no_record() {
    let refused = |pointer: &str, value: serde_json::Value, parts: &[&str]| {
        let mut text = json();
        *text.pointer_mut(pointer).unwrap() = value;
        says(serde_json::from_value::<Record>(text), parts);
    };
    refused("/inputs/u/1", serde_json::Value::Null, &["`record`", "`u` is NaN at sample 1", "0.1 s"]);
    refused("/inputs/u", vec![1.0].into(), &["`y` has 3 rows", "`u` has 1"]);
    refused("/inputs", serde_json::json!({"v": [1, 2, 3]}), &["unknown field `v`", "`u`"]);
    refused("/outputs", serde_json::json!({"y": [1, 2, 3]}), &["missing field `z`"]);
    refused("/outputs", 3.into(), &["a map of values by name"]);
    refused("/time/Uniform/step", 0.into(), &["sample time", "0"]);
    refused("/time", serde_json::json!({"Stamps": [0, 2, 1]}), &["sample 2", "2 s is followed by 1 s"]);
    refused("/time", serde_json::json!({"Stamps": [0, 2]}), &["time has 2 rows", "3"]);
    refused("/initial/Given/x/start", "one".into(), &["expected a number, null, \"Infinity\""]);
    refused("/hold", "Second".into(), &["Second"]);
    let twice = json().to_string().replace(r#""u":["#, r#""u":[1],"u":["#);
    says(serde_json::from_str::<Record>(&twice), &["duplicate field `u`"]);
    let empty = serde_json::json!({"u": []});
    let mut text = json();
    text["inputs"] = empty;
    text["outputs"] = serde_json::json!({"y": [], "z": []});
    says(serde_json::from_value::<Record>(text), &["0 sample"]);
}

#[test]
fn errors_are_typed() {
    assert!(matches!(even(10).slice(3..4), Err(Error::TooFewSamples { samples: 1, needed: 2, .. })));
    assert!(matches!(even(10).decimate(0), Err(Error::Option(_))));
}
