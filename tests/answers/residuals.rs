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
    Simulated {
        names: vec!["y".to_owned()],
        outputs: vec![outputs],
        residuals: vec![residuals],
        deviations: vec![],
        initial_state: vec![],
    }
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
    let residuals = examined(30, 1, |k, _, _| white[k]);
    // 99 % of the correlations of so many white errors are within this.
    assert!((residuals.autocorrelation_band - 2.576 / 30f64.sqrt()).abs() < 1e-12);
    // SciPy's `skew` and `kurtosis`.
    assert!((residuals.skewness / 0.209_815_786_117_013_96 - 1.0).abs() < 1e-9, "{}", residuals.skewness);
    assert!((residuals.excess_kurtosis / 0.280_480_884_536_906_67 - 1.0).abs() < 1e-9, "{}", residuals.excess_kurtosis);

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

/// Standardized: less the mean, over the root of the mean square; missing ones are zero.
fn standardized(values: &[f64]) -> Vec<f64> {
    let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let mean = present.iter().sum::<f64>() / present.len() as f64;
    let deviation = (present.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / present.len() as f64).sqrt();
    values.iter().map(|v| if v.is_finite() { (v - mean) / deviation } else { 0.0 }).collect()
}

/// Part of the variance of `y` that a polynomial in `x` of this degree explains, by a regression of its own.
fn explained(x: &[f64], y: &[f64], degree: i32) -> f64 {
    let columns = degree as usize + 1;
    let x = nalgebra::DMatrix::from_fn(x.len(), columns, |i, j| x[i].powi(j as i32));
    let y = nalgebra::DVector::from_column_slice(y);
    let rest = &y - &x * x.clone().svd(true, true).solve(&y, 1e-12).unwrap();
    1.0 - rest.norm_squared() / y.add_scalar(-y.mean()).norm_squared()
}

/// The test of Breusch, Pagan and Koenker is the effective number of residuals times the part of the variance of their squares
/// that signal and square explain: chi-square with two degrees of freedom, `exp(-x / 2)`; with one for a signal of two levels.
/// The spread is that of twelve parts of the range.
#[test]
fn spread_is_that_of_a_regression() {
    let (mut errors, mut speeds) = (vec![], vec![]);
    // What is missing counts nowhere.
    let residuals = examined(105, 7, |k, u, e| {
        let error = 0.1 * e * (0.6 + u.w / 100.0) + 0.03;
        if k % 7 == 3 {
            return f64::NAN;
        }
        errors.push(error);
        speeds.push(u.w);
        error
    });
    let squares: Vec<f64> = standardized(&errors).iter().map(|e| e * e).collect();
    let found = |residuals: &Residuals, name: &str| residuals.tests.iter().find(|t| t.name == name).unwrap().clone();
    let test = found(&residuals, "Breusch-Pagan-Koenker, input `w`");
    let share = explained(&standardized(&speeds), &squares, 2);
    let spread = residuals.spreads.iter().find(|spread| spread.signal == "w").unwrap();
    // Outputs are read less predictions of the size one: residuals to 1e-15 of 0.1.
    assert!((spread.share / share - 1.0).abs() < 1e-9, "{spread:?} {share}");
    let expected = residuals.effective_samples * share;
    assert!((test.statistic / expected - 1.0).abs() < 1e-9, "{test:?}");
    assert!((test.p_value / (-expected / 2.0).exp() - 1.0).abs() < 1e-8, "{test:?}");

    let (low, high) = speeds.iter().fold((f64::MAX, f64::MIN), |(low, high), w| (low.min(*w), high.max(*w)));
    let width = (high - low) / 12.0;
    let mean = errors.iter().sum::<f64>() / 90.0;
    let parts: Vec<(f64, f64, u64)> = (0..12)
        .filter_map(|part| {
            let here = |w: f64| ((w - low) / width).floor().min(11.0) == f64::from(part);
            let own: Vec<f64> = (0..90).filter(|&k| here(speeds[k])).map(|k| (errors[k] - mean).powi(2)).collect();
            let root = (own.iter().sum::<f64>() / own.len() as f64).sqrt();
            (!own.is_empty()).then(|| (low + width * (f64::from(part) + 0.5), root, own.len() as u64))
        })
        .collect();
    assert_eq!(spread.count, parts.iter().map(|part| part.2).collect::<Vec<_>>());
    for ((at, deviation), part) in spread.at.iter().zip(&spread.deviation).zip(&parts) {
        assert!((at / part.0 - 1.0).abs() < 1e-9 && (deviation / part.1 - 1.0).abs() < 1e-9, "{spread:?} {parts:?}");
    }

    let (mut errors, mut levels) = (vec![], vec![]);
    let inputs = (0..60).map(|k| Drive { u: (k as f64).sin(), w: if k % 3 == 0 { -40.0 } else { 60.0 } });
    let inputs: Vec<Drive> = inputs.collect();
    let mut random = Random(99);
    let outputs = inputs.iter().map(|u| {
        errors.push(random.normal() * (1.0 + u.w / 200.0));
        levels.push(u.w);
        Reading { y: 2.0 * u.u + errors.last().unwrap() }
    });
    let outputs = outputs.collect();
    let record = Experiment::new(&Amplifier, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let residuals = examine(&predicted(&record), record.record()).unwrap().remove(0);
    let test = found(&residuals, "Breusch-Pagan-Koenker, input `w`");
    let squares: Vec<f64> = standardized(&errors).iter().map(|e| e * e).collect();
    let expected = residuals.effective_samples * explained(&levels, &squares, 1);
    assert!((test.statistic / expected - 1.0).abs() < 1e-8, "{test:?} {expected}");
    let p_value = statrs::function::erf::erfc((expected / 2.0f64).sqrt());
    assert!((test.p_value / p_value - 1.0).abs() < 1e-7, "{test:?} {p_value}");
}

/// A weighting sees inputs and time; of a predicted output it is not advised.
#[test]
fn the_remedy_for_a_spread_is_one_that_can_be_taken() {
    let by_input = examined(1000, 1, |_, u, e| 0.1 * e * (0.5 + u.w / 50.0));
    let by_output = examined(1000, 1, |_, u, e| 0.1 * e * (1.2 + u.u));
    let meaning = |residuals: &Residuals, signal: &str| {
        let test = residuals.tests.iter().find(|t| t.name.contains("Koenker") && t.name.contains(signal)).unwrap();
        test.meaning.clone()
    };
    assert!(meaning(&by_input, "input `w`").contains("a weighting by `w`"));
    assert!(meaning(&by_output, "predicted output `y`").contains("fit a part of the record"));
}

/// Correlations with what went in and was measured: the definition, sample by sample, where some are missing, with the band of
/// Bartlett from both autocorrelations at 25 lags.
#[test]
fn correlations_are_the_definition() {
    let (mut errors, mut inputs, mut noise) = (vec![], vec![], 0.0);
    let residuals = examined(300, 5, |k, u, e| {
        noise = 0.6 * noise + 0.1 * e;
        errors.push(if k % 7 == 3 { f64::NAN } else { noise + 0.02 * u.u });
        inputs.push(u.u);
        errors[k]
    });
    let measured: Vec<f64> = errors.iter().zip(&inputs).map(|(e, u)| 2.0 * u + e).collect();
    let e = standardized(&errors);
    let present = errors.iter().filter(|e| e.is_finite()).count() as f64;
    let lagged = |a: &[f64], b: &[f64], lag: i64| -> f64 {
        let at = |t: i64| usize::try_from(t - lag).ok().and_then(|before| b.get(before)).copied().unwrap_or(0.0);
        a.iter().enumerate().map(|(t, a)| a * at(t as i64)).sum()
    };
    for (name, signal, first) in [("u", &inputs, 0), ("y", &measured, 1)] {
        let s = standardized(signal);
        let found = residuals.correlations.iter().find(|c| c.signal == name).unwrap();
        assert_eq!((found.first_lag, found.values.len(), found.tested_from), (-25, 51, first));
        for (lag, value) in (-25..=25).zip(&found.values) {
            assert!((value - lagged(&e, &s, lag) / present).abs() < 1e-9, "{name} {lag} {value}");
        }
        let own = |x: &[f64], lag: i64| lagged(x, x, lag) / lagged(x, x, 0);
        let both: f64 = (1..=25).map(|lag| own(&e, lag) * own(&s, lag)).sum();
        let deviation = ((1.0 + 2.0 * both) / present).sqrt();
        let largest = (first..=25).map(|lag| (lagged(&e, &s, lag) / present).abs()).fold(0.0, f64::max) / deviation;
        let test = residuals.tests.iter().find(|t| t.name.contains("cross") && t.name.ends_with(&format!("`{name}`")));
        let test = test.unwrap();
        assert!((test.statistic / largest - 1.0).abs() < 1e-9, "{test:?} {largest}");
        // The largest of `count` independent normal numbers; at the band it has the probability 0.01.
        let count = (26 - first) as i32;
        let none_beyond = |z: f64| statrs::function::erf::erf(z / std::f64::consts::SQRT_2).powi(count);
        assert!((test.p_value - (1.0 - none_beyond(largest))).abs() < 1e-9, "{test:?}");
        assert!((none_beyond(found.band / deviation) - 0.99).abs() < 1e-9, "{}", found.band);
    }
}

/// A quarter as many lags as residuals, 25 at most; a few thousand of many residuals for the test of Anderson and Darling.
#[test]
fn lags_and_samples_are_enough() {
    let normal = |samples: usize| examined(samples, 3, |_, _, e| 0.1 * e);
    assert_eq!([24, 2_000].map(|samples| normal(samples).autocorrelation.len()), [6, 25]);
    for samples in [4_000, 12_000] {
        assert!(normal(samples).tests.iter().any(|test| test.name == "Anderson-Darling"), "{samples}");
    }
}
