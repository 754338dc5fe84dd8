//! What the examination of residuals says, on records whose trouble is known.

use crate::random::Random;
use greybox::diagnose::residuals::{Residuals, examine};
use greybox::problem::Simulated;
use greybox::{Error, Experiment, ExperimentOf, Hold, Model, Nothing, Scalar, Time, signals, simulate};
use std::f64::consts::TAU;

signals! { struct Drive { u: "V", w: "rad/s" } }
signals! { struct Reading { y: "V" } }
signals! { struct Gain { k: "1" } }

/// `y = k u`, whatever `w`.
struct Amplifier;

impl Model for Amplifier {
    type State = Nothing;
    type Input = Drive;
    type Output = Reading;
    type Parameters = Gain;
    const KIND: greybox::Kind = greybox::Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, p: &Gain<S>) -> Reading<S> {
        Reading { y: p.k * u.u }
    }
}

const STEP: f64 = 0.01;

/// What `y = 2 u` says of a record.
fn predicted(record: &ExperimentOf<Amplifier>) -> Simulated {
    let inputs: Vec<Drive> = record.inputs().collect();
    let run = simulate(&Amplifier, &Gain { k: 2.0 }, &Nothing, record.times().clone(), &inputs).unwrap();
    let residuals = record.outputs().zip(&run.outputs).map(|(measured, y)| measured.y - y.y).collect();
    let outputs = run.outputs.iter().map(|y| y.y).collect();
    Simulated { outputs: vec![outputs], residuals: vec![residuals], initial_state: vec![] }
}

/// The examination of `y = 2 u + disturbance(k, u, w, e)`, `e` a normal number.
fn examined(samples: usize, seed: u64, mut disturbance: impl FnMut(usize, Drive, f64) -> f64) -> Residuals {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (mut inputs, mut outputs) = (vec![], vec![]);
    for k in 0..samples {
        let u = Drive { u: 2.0 * random.uniform() - 1.0, w: 100.0 * random.uniform() };
        inputs.push(u);
        outputs.push(Reading { y: 2.0 * u.u + disturbance(k, u, random.normal()) });
    }
    let record = Experiment::new(&Amplifier, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let record = record.hold(Hold::Zero);
    examine(&predicted(&record), record.record()).unwrap().remove(0)
}

fn failed(residuals: &Residuals) -> Vec<&str> {
    residuals.tests.iter().filter(|test| !test.passed).map(|test| test.name.as_str()).collect()
}

/// Each test refuses white normal noise once in a hundred times: over 400 records at most 2.5 % of the tests of a kind
/// (1 % and three binomial deviations).
#[test]
fn noise_passes() {
    let mut refused = std::collections::BTreeMap::<String, u32>::new();
    for seed in 0..400 {
        for name in failed(&examined(1000, seed, |_, _, e| 0.1 * e)) {
            *refused.entry(name.to_owned()).or_default() += 1;
        }
    }
    println!("{refused:?}");
    assert!(refused.values().all(|count| *count <= 10), "{refused:?}");
}

/// Of white residuals as SciPy 1.17's `jarque_bera` gives it, though lag 1 happens to be positive (0.109); of their running sum,
/// which is colored, with the effective number of residuals in the place of 30, and a name that says so.
#[test]
fn jarque_bera_is_that_of_scipy() {
    let white = [
        0.02, -0.63, 0.64, -1.22, 0.79, 0.38, -0.13, -1.43, -3.0, -2.71, 1.08, 0.33, 0.42, -0.78, 2.2, -2.24, 0.79,
        0.72, 1.97, 1.65, -0.21, -0.02, 0.68, -0.39, -0.16, 4.29, 0.53, 2.49, 3.17, -1.31,
    ];
    let test =
        |residuals: &Residuals| residuals.tests.iter().find(|t| t.name.starts_with("Jarque-Bera")).unwrap().clone();
    let found = test(&examined(30, 1, |k, _, _| white[k]));
    assert_eq!(found.name, "Jarque-Bera");
    // SciPy prints 17 digits; the residuals carry the rounding of the outputs they come from.
    assert!((found.statistic / 0.318_450_228_757_759_7 - 1.0).abs() < 1e-9, "{found:?}");
    assert!((found.p_value / 0.852_804_358_835_401_7 - 1.0).abs() < 1e-9, "{found:?}");

    let mut sum = 0.0;
    let colored = examined(30, 1, |k, _, _| {
        sum += white[k];
        sum
    });
    let found = test(&colored);
    assert_eq!(found.name, "Jarque-Bera, effective number of residuals");
    let expected = 3.645_078_766_892_085_7 * 4.881_091_973_303_236 / 30.0;
    assert!((found.statistic / expected - 1.0).abs() < 1e-9, "{found:?}");
}

/// A coloring is no period, however strong.
#[test]
fn colored_noise_has_no_period() {
    for rho in [0.5, 0.9, 0.99, 1.0] {
        let found = (0..200).filter(|&seed| {
            let mut noise = 0.0;
            let residuals = examined(2000, seed, |_, _, e| {
                noise = rho * noise + e;
                noise
            });
            residuals.period.is_some()
        });
        let found = found.count();
        println!("{rho}: {found}");
        assert!(found <= 8, "{rho}: {found} of 200");
    }
}

/// A ripple of a tenth of the noise is found in 20,000 samples, with its period and amplitude.
#[test]
fn ripple_is_found() {
    let residuals = examined(20_000, 3, |k, _, e| e + 0.1 * (TAU * k as f64 * STEP / 0.137).sin());
    let period = residuals.period.unwrap();
    // A hundredth of a period over the record; the amplitude by its standard error sqrt(2 / n) of the noise.
    assert!((period.seconds / 0.137 - 1.0).abs() < 1e-4, "{period:?}");
    assert!((period.amplitude - 0.1).abs() < 0.03, "{period:?}");
    assert!(
        residuals.tests.iter().any(|t| t.name == "periodogram" && t.meaning.contains("every 0.13699 s (7.300 Hz)")),
        "{:?}",
        residuals.tests
    );
}

/// What each trouble fails.
#[test]
fn each_trouble_has_its_test() {
    let growing = examined(2000, 1, |_, u, e| 0.1 * e * (0.5 + u.w / 50.0));
    assert!(failed(&growing).iter().any(|name| name.contains("Koenker, input `w`")), "{:?}", failed(&growing));
    let spread = growing.spreads.iter().find(|spread| spread.signal == "w").unwrap();
    assert!(spread.deviation.last().unwrap() > &(3.0 * spread.deviation[0]), "{spread:?}");

    let mut before = 0.0;
    let late = examined(2000, 2, |_, u, e| 0.1 * e + 0.1 * std::mem::replace(&mut before, u.u));
    assert!(failed(&late).contains(&"cross-correlation with input `u`"), "{:?}", failed(&late));
    let correlation = late.correlations.iter().find(|c| c.signal == "u").unwrap();
    let largest = (0..correlation.values.len())
        .max_by(|&a, &b| correlation.values[a].abs().total_cmp(&correlation.values[b].abs()));
    assert_eq!(largest.unwrap() as i64 + correlation.first_lag, 1);

    assert_eq!(failed(&examined(2000, 3, |_, _, e| 0.1 * e + 0.02)), ["zero mean"]);

    let spiked = examined(2000, 4, |k, _, e| if k % 500 == 99 { 3.0 } else { 0.1 * e });
    assert_eq!(spiked.outlier_count, 4);
    let mut samples: Vec<u64> = spiked.outliers.iter().map(|outlier| outlier.sample).collect();
    samples.sort_unstable();
    assert_eq!(samples, [99, 599, 1099, 1599]);
    assert!(failed(&spiked).contains(&"Jarque-Bera"));

    let mut noise = 0.0;
    let colored = examined(2000, 5, |_, _, e| {
        noise = 0.8 * noise + 0.1 * e;
        noise
    });
    assert!(failed(&colored).contains(&"Ljung-Box, 25 lags"));
    assert!((colored.autocorrelation[0] - 0.8).abs() < 0.05, "{}", colored.autocorrelation[0]);
    // (1 - rho) / (1 + rho) of the samples are worth as much as independent ones.
    assert!((colored.effective_samples / 2000.0 * 9.0 - 1.0).abs() < 0.25, "{}", colored.effective_samples);
}

/// Too few residuals, none that vary, and inputs that are constant: no test, no number that is not one.
#[test]
fn little_is_said_of_little() {
    assert!(examined(10, 1, |_, _, e| e).tests.is_empty());
    let exact = examined(100, 1, |_, _, _| 0.0);
    assert!(exact.tests.is_empty() && exact.standard_deviation == 0.0);
    let json = format!("{exact:?}");
    assert!(!json.contains("NaN") && !json.contains("inf"), "{json}");

    let inputs = vec![Drive { u: 1.0, w: 5.0 }; 50];
    let outputs = (0..50).map(|k| Reading { y: 2.0 + ((k * k) as f64).sin() }).collect();
    let record = Experiment::new(&Amplifier, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let residuals = examine(&predicted(&record), record.record()).unwrap().remove(0);
    assert_eq!(residuals.constant_inputs, ["u", "w"]);
    assert!(residuals.correlations.iter().all(|c| c.signal == "y"));
}

/// A prediction that is infinite is refused with its place; one that is missing is left out.
#[test]
fn an_infinite_prediction_is_refused() {
    let inputs: Vec<Drive> = (0..60).map(|k| Drive { u: (0.3 * k as f64).sin(), w: 0.1 * k as f64 }).collect();
    let outputs = inputs.iter().enumerate().map(|(k, u)| Reading { y: 2.0 * u.u + ((k * k) as f64).sin() }).collect();
    let record = Experiment::new(&Amplifier, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let (mut prediction, record) = (predicted(&record), record.record());
    prediction.residuals[0][7] = f64::NAN;
    assert_eq!(examine(&prediction, record).unwrap()[0].samples, 59);
    prediction.residuals[0][8] = f64::NEG_INFINITY;
    let error = examine(&prediction, record).unwrap_err();
    let named = matches!(&error, Error::NotFinite { sample: 8, signal, .. } if signal == "residual of y");
    assert!(named && error.to_string().contains("0.08"), "{error}");
    prediction.residuals[0].pop();
    assert!(matches!(examine(&prediction, record), Err(Error::Lengths { found: 59, expected: 60, .. })));
}
