//! What is stored as JSON: estimates, experiments and checkpoints are read as they were written.

use greybox::optimize::Outcome;
use greybox::{
    Estimate, Experiment, ExperimentOf, Fit, Kind, Knowledge, Loss, Model, Nothing, Sample, Scalar, Summary, Time,
    fixed, free, signals, simulate,
};
use serde_json::Value;

signals! {
    pub struct Voltage { u: "V" }
    pub struct Current { i: "A" }
    pub struct Coil { r: "ohm", l: "H", i0: "A" }
}

/// `l di/dt = u - r i`, measured by a sensor of known gain with an offset `i0`
#[derive(Clone, Debug)]
struct Winding {
    gain: f64,
}

const WINDING: Winding = Winding { gain: 1.0 };

#[rustfmt::skip]
impl Model for Winding {
    type State = Current; type Input = Voltage; type Output = Current; type Parameters = Coil;
    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: (u.u - p.r * x.i) / p.l }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: x.i * self.gain + p.i0 }
    }
}

fn record() -> ExperimentOf<Winding> {
    let time = Time::Uniform { start: 0.0, step: 1e-3 };
    let inputs: Vec<Voltage> = (0..300).map(|k| Voltage { u: if k / 25 % 2 == 0 { 5.0 } else { -3.0 } }).collect();
    let truth = Coil { r: 2.0, l: 0.02, i0: 0.0 };
    let run = simulate(&WINDING, &truth, &Current { i: 0.0 }, time.clone(), &inputs).unwrap();
    let noisy = run.with_noise(Current { i: 0.02 }, 7);
    Experiment::new(&WINDING, time, inputs, noisy.outputs).unwrap().initial(Current { i: fixed(0.0) })
}

fn estimate() -> Estimate<Winding> {
    let parameters = Coil { r: free(1.0).within(0.0, 10.0), l: free(0.05).log(), i0: fixed(0.0) };
    Fit::new(&WINDING, &record()).parameters(parameters).run().unwrap()
}

/// Fields of an estimate that hold numbers, set to `value`.
fn spoiled(estimate: &Summary, value: f64) -> Summary {
    let mut spoiled = estimate.clone();
    (spoiled.cost, spoiled.seconds, spoiled.deviance) = (value, value, Some(value));
    spoiled.outcome = Outcome::Rough { noise: value, errors: value };
    spoiled.unknowns[0].knowledge = Knowledge::Held { bound: value, end: None };
    spoiled.unknowns[1].knowledge = Knowledge::Known { standard_error: value, lower: value, upper: value };
    spoiled.unknowns[1].error_index = Some(value);
    spoiled.parameters[0].value = value;
    spoiled.parameters[0].declared = free(value).within(value, value).prior(value, value);
    spoiled.experiments[0].parameters[0] = value;
    spoiled.experiments[0].initial_state[0] = value;
    spoiled.outputs[0].fit.rmse = value;
    spoiled.outputs[0].fit.fit_percent = Some(value);
    spoiled
}

/// What `to_json` writes, `from_json` reads and writes alike.
#[test]
fn estimates_are_read_as_they_were_written() {
    let estimate = estimate();
    let mut all = vec![estimate.summary().clone()];
    all.extend([f64::INFINITY, f64::NEG_INFINITY, 5e-324, -0.0, f64::MAX].map(|value| spoiled(&estimate, value)));
    for summary in &all {
        let text = summary.to_json().unwrap();
        assert_eq!(&Summary::from_json(&text).unwrap(), summary);
        assert_eq!(Estimate::<Winding>::from_json(&text).unwrap().to_json().unwrap(), text);
    }
    // What is not a number equals nothing; its text does.
    let text = spoiled(&estimate, f64::NAN).to_json().unwrap();
    let read = Summary::from_json(&text).unwrap();
    assert_eq!(read.to_json().unwrap(), text);
    assert!(read.cost.is_nan() && read.unknowns[1].knowledge.standard_error().unwrap().is_nan());
}

/// Other programs find codes, and the covariance as a matrix.
#[test]
fn programs_find_codes_and_the_covariance() {
    let estimate = estimate();
    let value: Value = serde_json::from_str(&estimate.to_json().unwrap()).unwrap();
    let codes: Vec<&Value> = value["parameters"].as_array().unwrap().iter().map(|p| &p["knowledge"]["code"]).collect();
    assert_eq!(codes, ["known", "known", "fixed"]);
    assert_eq!(value["outcome"]["code"], "converged");
    assert_eq!(value["method"]["covariance"]["code"], "classical");
    assert_eq!(value["method"]["refinement"], 0);
    assert_eq!(value["unknowns"][1]["role"], serde_json::json!({ "code": "parameter", "number": 1 }));
    assert_eq!(value["parameters"][1]["declared"]["upper"], "Infinity");
    let matrix = &value["covariance"]["matrix"];
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        assert_eq!(matrix[i][j].as_f64().unwrap().to_bits(), estimate.covariance.get(i, j).to_bits());
    }
}

/// Another format, another version and contradictions are refused with what is wrong, wherever the entry stands.
#[test]
fn other_files_are_refused() {
    let text = estimate().to_json().unwrap();
    let refused = |text: &str| Estimate::<Winding>::from_json(text).unwrap_err().to_string();
    let newer = refused(&text.replacen("\"version\": 2", "\"something\": 0, \"version\": 3", 1));
    assert!(newer.contains("version 3 of the format \"greybox estimate\"") && newer.contains("reads 2"), "{newer}");
    let other = refused(&text.replacen("greybox estimate", "greybox report", 1));
    assert!(other.contains("the format is \"greybox report\""), "{other}");
    assert!(refused("{}").contains("missing field `format`"), "{}", refused("{}"));
    let changed = |change: fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&text).unwrap();
        change(&mut value);
        refused(&value.to_string())
    };
    let fewer = changed(|value| drop(value["parameters"].as_array_mut().unwrap().pop()));
    assert!(fewer.contains("its parameters are [\"r\", \"l\"], but its layout has [\"r\", \"l\", \"i0\"]"), "{fewer}");
    let shorter = changed(|value| drop(value["experiments"][0]["initial_state"].as_array_mut().unwrap().pop()));
    assert!(shorter.contains("values of other quantities than its layout"), "{shorter}");
    let unknown = changed(|value| drop(value["unknowns"].as_array_mut().unwrap().pop()));
    assert!(unknown.contains("its covariance is of 2 unknowns, but it has 1"), "{unknown}");
}

/// A missing output is null and an infinite bound a text, as everywhere else.
#[test]
fn experiments_follow_the_same_rule() {
    let record = record();
    let mut outputs: Vec<Current> = record.outputs().collect();
    outputs[3].i = f64::NAN;
    let record = Experiment::new(&WINDING, record.times().clone(), record.inputs().collect(), outputs).unwrap();
    let record = record.initial(Current { i: free(0.0).within(-1.0, f64::INFINITY) });
    let text = serde_json::to_string(&record).unwrap();
    assert!(text.contains(",null,") && text.contains("\"upper\":\"Infinity\""), "{text}");
    let read: ExperimentOf<Winding> = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string(&read).unwrap(), text);
    let wrong = serde_json::from_str::<ExperimentOf<Winding>>(&text.replace("\"Infinity\"", "\"inf\"")).unwrap_err();
    assert!(wrong.to_string().contains("expected a number, null, \"Infinity\" or \"-Infinity\""), "{wrong}");
}

/// Least squares in other units: nothing but its values tells one from another.
#[derive(Clone)]
struct Scaled(f64);

impl std::fmt::Debug for Scaled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Scaled")
    }
}

impl Loss for Scaled {
    fn rho(&self, z: f64) -> f64 {
        self.0 * z * z / 2.0
    }
    fn psi(&self, z: f64) -> f64 {
        self.0 * z
    }
}

/// A model of the same type with another constant, another weighting of the same form and another loss of the same name
/// are other problems; the same ones are not.
#[test]
fn a_checkpoint_knows_constants_and_closures() {
    let path = std::env::temp_dir().join(format!("greybox_checkpoint_{}.json", std::process::id()));
    let record = record();
    let run = |gain: f64, power: i32, loss: f64| {
        let model = Winding { gain };
        let parameters = Coil { r: free(1.0), l: free(0.05).log(), i0: fixed(0.0) };
        let weighting = move |s: &Sample<Winding>| s.u.u.abs().powi(power);
        Fit::new(&model, &record)
            .parameters(parameters)
            .weighting(weighting)
            .loss(Scaled(loss))
            .checkpoint(&path, 1)
            .run()
    };
    let _ = std::fs::remove_file(&path);
    let first = run(1.0, 1, 1.0).unwrap();
    let again = run(1.0, 1, 1.0).unwrap();
    assert!((again.parameters.r / first.parameters.r - 1.0).abs() < 1e-9, "the same problem goes on");
    for (gain, power, loss) in [(1.001, 1, 1.0), (1.0, 2, 1.0), (1.0, 1, 0.5)] {
        let refused = run(gain, power, loss).unwrap_err().to_string();
        assert!(refused.contains("another problem") && refused.contains("constants"), "{refused}");
    }
    std::fs::remove_file(&path).unwrap();
}

signals! { pub struct Gain { a: "A/V" } }

/// `i = a u`, from the last second on times a constant.
struct Late {
    factor: f64,
}

impl Model for Late {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Gain;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, t: S, _x: &Nothing, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
        Current { i: if t < S::from(19.0) { p.a * u.u } else { p.a * u.u * self.factor } }
    }
}

/// The whole of a long record tells one model from another, not its first samples.
#[test]
fn a_checkpoint_knows_the_end_of_a_record() {
    let path = std::env::temp_dir().join(format!("greybox_checkpoint_late_{}.json", std::process::id()));
    let time = Time::Uniform { start: 0.0, step: 1e-3 };
    let inputs: Vec<Voltage> = (0..20_000).map(|k| Voltage { u: (0.1 * k as f64).sin() }).collect();
    let outputs = inputs.iter().map(|u| Current { i: 2.0 * u.u }).collect();
    let record = Experiment::new(&Late { factor: 1.0 }, time, inputs, outputs).unwrap();
    let run =
        |factor: f64| Fit::new(&Late { factor }, &record).parameters(Gain { a: free(1.0) }).checkpoint(&path, 1).run();
    let _ = std::fs::remove_file(&path);
    run(1.0).unwrap();
    let refused = run(1.5).unwrap_err().to_string();
    assert!(refused.contains("another problem"), "{refused}");
    std::fs::remove_file(&path).unwrap();
}
