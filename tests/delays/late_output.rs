//! One output of two that is late: the plant twice, the second time behind a late input with the same column.

use crate::common::Noise;
use greybox::record::{Channel, Record};
use greybox::*;

const MODEL: &str = r#"
greybox = 1
[inputs]
u = { unit = "%", hold = "zero" }
u_line = { unit = "%", hold = "zero", delay = "line" }
[parameters]
k = { unit = "K/%", start = 1 }
tau = { unit = "s", start = 20, positive = true }
line = { unit = "s", start = 5, within = [0, 60] }
[states]
x = { unit = "K", derivative = "(k*u - x)/tau", initial = 0 }
x_line = { unit = "K", derivative = "(k*u_line - x_line)/tau", initial = 0 }
[outputs]
thermocouple = { value = "x", unit = "K" }
analyzer = { value = "x_line", unit = "K" }
"#;

/// Steps of 40 s into a lag of 30 s with a gain of 2; the closed form at a time that need not be a sample.
fn lag(u: &[f64], t: f64) -> f64 {
    let mut x = 0.0;
    for (k, u) in (0..).zip(u) {
        let passed = (t - f64::from(k)).clamp(0.0, 1.0);
        x = 2.0 * u + (x - 2.0 * u) * (-passed / 30.0).exp();
    }
    x
}

/// Two columns that are the same are no copies where one of them is late; without the dead time they are. All parameters come out within
/// three standard errors.
#[test]
fn one_output_of_two_is_late() {
    let mut noise = Noise(7);
    let u: Vec<f64> = (0..400).map(|k| if k < 40 { 0.0 } else { f64::from((k / 40 * 7) % 4) * 10.0 }).collect();
    let seen = |at: f64, noise: &mut Noise| lag(&u, at) + 0.2 * noise.gauss();
    let thermocouple: Vec<f64> = (0..400).map(|k| seen(f64::from(k), &mut noise)).collect();
    let analyzer: Vec<f64> = (0..400).map(|k| seen(f64::from(k) - 11.7, &mut noise)).collect();
    let fitted = |text: &str| {
        let model = text::Model::named("vessel.toml", text).unwrap();
        let inputs = ["u", "u_line"].map(|name| Channel::new(name, "%", u.clone()));
        let outputs = [("thermocouple", &thermocouple), ("analyzer", &analyzer)];
        let outputs = outputs.map(|(name, values)| Channel::new(name, "K", values.clone()));
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let states = model.equations().layout().states.clone();
        let record = Record::new(states, time, inputs.to_vec(), outputs.to_vec()).unwrap();
        model.fit(&[model.prepare(record).unwrap()]).unwrap().run().unwrap()
    };
    let is_copy =
        |found: &estimate::Summary| found.warnings.iter().any(|one| one.code == WarningCode::IdenticalColumns);
    let found = fitted(MODEL);
    assert!(found.severity() == Severity::Usable && !is_copy(&found), "{found}");
    for (unknown, truth) in found.unknowns.iter().zip([2.0, 30.0, 11.7]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 3.0 * error, "{} {} +- {error}", unknown.name, unknown.value);
    }
    let at_once = MODEL.replace(", delay = \"line\"", "").replace("\"x_line\"", "\"x_line + k/tau*line\"");
    assert!(is_copy(&fitted(&at_once)));
}
