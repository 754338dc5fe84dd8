//! Every way in which a fit can be asked for nonsense: an error, outcome or warning that names the thing, the number and
//! the remedy. What is wrong with records alone stands in `bad_records.rs`.

use crate::common::{Coil, Current, Rl, Voltage};
use crate::refused::says;
use approx::assert_relative_eq;
use greybox::optimize::{GaussNewton, LevenbergMarquardt, Outcome, Stop};
use greybox::optimize::{JacobianColumns, Scaling, Seen};
use greybox::*;
use greybox::{
    loss::{Cauchy, SoftL1, Tukey},
    weighting::{BySignal, WeightFunction},
};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const H: f64 = 1e-3;
const EVEN: Time = Time::Uniform { start: 0.0, step: H };
const TRUE: Coil = Coil { r: 2.0, l: 0.02 };
const START: Coil<Parameter> = Coil { r: parameter(1.0), l: parameter(0.03) };

/// `free`, in a constant.
const fn parameter(start: f64) -> Parameter {
    Parameter {
        start,
        free: true,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        prior: None,
        transform: Transform::Identity,
        per_experiment: false,
        positive: false,
    }
}

fn voltage(k: usize) -> f64 {
    if k % 40 < 20 { 10.0 } else { -4.0 }
}

/// Between -1 and 1, the same each time.
fn noise(k: usize) -> f64 {
    let bits = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((bits ^ (bits >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The exact response of the coil, with noise.
fn response(samples: usize, amplitude: f64) -> Vec<f64> {
    let (mut i, decay) = (0.0, (-H * TRUE.r / TRUE.l).exp());
    (0..samples)
        .map(|k| {
            let y = i + amplitude * noise(k);
            let settled = voltage(k) / TRUE.r;
            i = settled + (i - settled) * decay;
            y
        })
        .collect()
}

fn record_of<M: Model<State = Current, Input = Voltage, Output = Current>>(model: &M, y: &[f64]) -> ExperimentOf<M> {
    let inputs = (0..y.len()).map(|k| Voltage { u: voltage(k) }).collect();
    Experiment::new(model, EVEN, inputs, y.iter().map(|&i| Current { i }).collect()).unwrap()
}

fn record() -> ExperimentOf<Rl> {
    record_of(&Rl, &response(200, 0.01)).named("bench")
}

/// The fit of the record above.
fn fit(record: &ExperimentOf<Rl>) -> Fit<'_, Rl> {
    Fit::new(&Rl, record).parameters(START)
}

/// No public number of an estimate is anything but a number, its report holds none, and it survives JSON.
#[track_caller]
fn sound<M: Model>(result: Result<Estimate<M>, Error>) -> Estimate<M> {
    let estimate = result.unwrap_or_else(|error| panic!("{error}"));
    println!("{estimate}\n");
    let text = estimate.to_string();
    assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    for unknown in &estimate.unknowns {
        assert!(unknown.value.is_finite(), "{unknown:?}");
        if let Knowledge::Known { standard_error, lower, upper } = unknown.knowledge {
            assert!(standard_error.is_finite() && lower <= unknown.value && unknown.value <= upper, "{unknown:?}");
            assert!(lower.is_finite() && upper.is_finite(), "{unknown:?}");
        }
        let indices = [unknown.error_index, unknown.error_index_held];
        assert!(indices.into_iter().flatten().all(f64::is_finite), "{unknown:?}");
    }
    let all: Vec<usize> = (0..estimate.unknowns.len()).collect();
    let (covariance, correlation) = (&estimate.covariance, estimate.correlation(&all));
    for i in 0..covariance.size() {
        for j in 0..covariance.size() {
            assert!(covariance.get(i, j).is_finite() && correlation[(i, j)].abs() <= 1.0 + 1e-9);
        }
    }
    for quality in M::Output::into_array(estimate.quality) {
        assert!(quality.rmse.is_finite() && quality.sigma.is_finite(), "{quality:?}");
        assert!(quality.fit_percent.is_none_or(f64::is_finite), "{quality:?}");
    }
    assert!(estimate.cost.is_finite());
    let criteria = [estimate.deviance, estimate.aic(), estimate.aicc(), estimate.bic(), estimate.fpe()];
    assert!(criteria.into_iter().flatten().all(f64::is_finite), "{criteria:?}");
    serde_json::to_string(&estimate).unwrap();
    estimate
}

/// The warnings of an estimate in one text, which must hold every one of `parts`.
#[track_caller]
fn warns(estimate: &Summary, parts: &[&str]) -> String {
    let text: Vec<&str> = estimate.warnings.iter().map(|warning| warning.text.as_str()).collect();
    let text = text.join("\n");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
    text
}

#[test]
fn the_fit_itself_is_fine() {
    let estimate = sound(fit(&record()).run());
    assert!(estimate.warnings.is_empty(), "{:?}", estimate.warnings);
    assert_eq!(estimate.severity(), Severity::Usable);
    // Five standard errors of 200 samples with noise of 0.0058 A rms on 4 A.
    assert_relative_eq!(estimate.parameters.r, TRUE.r, max_relative = 2e-3);
    assert_relative_eq!(estimate.parameters.l, TRUE.l, max_relative = 2e-2);
}

#[test]
fn parameters_without_sense() {
    let record = record();
    let run = |r: Parameter, parts: &[&str]| {
        let error = says(Fit::new(&Rl, &record).parameters(Coil { r, l: free(0.03) }).run(), parts);
        assert!(matches!(error, Error::Parameter { .. }));
    };
    run(free(0.001).within(0.01, 10.0), &["`r`", "0.001", "outside its bounds 0.01 to 10"]);
    run(free(1.0).within(10.0, 0.1), &["`r`", "10", "0.1", "lower must be below the upper"]);
    run(free(1.0).within(1.0, 1.0), &["`r`", "1 and 1", "use fixed"]);
    assert!(Fit::new(&Rl, &record).parameters(Coil { r: fixed(1.0).within(1.0, 1.0), l: free(0.03) }).run().is_ok());
    run(free(1.0).within(f64::NAN, 2.0), &["`r`", "not a number and 2"]);
    run(free(1.0).within(0.0, f64::NAN), &["`r`", "0 and not a number"]);
    run(free(f64::NAN), &["`r`", "not a number", "finite start"]);
    run(free(f64::INFINITY), &["`r`", "inf", "finite start"]);
    run(fixed(f64::NAN), &["`r`", "not a number", "finite"]);
    run(fixed(5.0).within(0.0, 1.0), &["`r`", "5", "outside its bounds 0 to 1"]);
    run(free(-1.0).log(), &["`r`", "-1", "no logarithm", ".log()"]);
    run(free(0.0).log(), &["`r`", "0", "no logarithm"]);
    for (std, text) in [(0.0, "0"), (-1.0, "-1"), (f64::NAN, "not a number"), (f64::INFINITY, "infinite")] {
        run(free(1.0).prior(1.0, std), &["`r`", "prior", &format!("1 +- {text}"), "positive"]);
    }
    run(free(1.0).prior(f64::NAN, 1.0), &["`r`", "prior", "not a number +- 1"]);
    let initial = |i: Parameter| fit(&record.clone().initial(Current { i })).run();
    says(initial(free(5.0).within(-1.0, 1.0)), &["`i(0)`", "5", "outside its bounds -1 to 1"]);
    says(initial(fixed(f64::NAN)), &["`i(0)`", "not a number"]);
    // It would have no effect.
    run(free(1.0).log().within(-1.0, 9.0), &["`r`", "lower bound -1", "no effect", ".log()"]);
}

#[test]
fn nothing_to_do() {
    let record = record();
    let known = record.clone().initial(Current { i: fixed(0.0) });
    let error = says(Fit::new(&Rl, &known).parameters(Coil { r: fixed(2.0), l: fixed(0.02) }).run(), &["free(start)"]);
    assert!(matches!(error, Error::NothingFree));
    let none: &[ExperimentOf<Rl>] = &[];
    let error = says(Fit::new(&Rl, none).parameters(START).run(), &["no experiment", "at least one"]);
    assert!(matches!(error, Error::NoExperiment));
    let weighted = Fit::new(&Rl, none).parameters(START).weighting(|_: &Sample<Rl>| 1.0).run();
    assert!(matches!(says(weighted, &[]), Error::NoExperiment));
    assert!(matches!(says(Fit::new(&Rl, none).parameters(START).problem(), &[]), Error::NoExperiment));
}

#[test]
fn settings_without_sense() {
    let record = record();
    for sigma in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let error = says(fit(&record).noise(Current { i: sigma }).run(), &["noise of output `i`", &sigma.to_string()]);
        assert!(matches!(error, Error::NotPositive { .. }));
    }
    for constant in [0.0, -1.345, f64::NAN] {
        let text = constant.to_string();
        says(fit(&record).loss(Huber(constant)).run(), &["Huber", &text, "positive"]);
        says(fit(&record).loss(SoftL1(constant)).run(), &["SoftL1", &text]);
        says(fit(&record).loss(Cauchy(constant)).run(), &["Cauchy", &text]);
        says(fit(&record).loss(Tukey(constant)).run(), &["Tukey", &text]);
    }
    for bad in [-1e-9, f64::NAN, f64::INFINITY] {
        let stop = Stop::default();
        for (what, stop) in [
            ("step", Stop { step: bad, ..stop }),
            ("gradient", Stop { gradient: bad, ..stop }),
            ("cost", Stop { cost: bad, ..stop }),
        ] {
            let parts = [&format!("Stop::{what}"), &bad.to_string() as &str, "not negative"];
            says(fit(&record).optimizer(LevenbergMarquardt::new(stop, JacobianColumns)).run(), &parts);
            says(fit(&record).optimizer(GaussNewton::new(stop)).run(), &parts);
        }
        let text = if bad.is_finite() { format!("{bad:e}") } else { bad.to_string() };
        says(fit(&record).integrator(Rk45 { relative: bad, absolute: 1e-9 }).run(), &["relative", "Rk45", &text]);
        says(
            fit(&record).integrator(Esdirk { relative: 1e-9, absolute: bad }).run(),
            &["absolute", "Esdirk", &bad.to_string()],
        );
    }
    says(fit(&record).integrator(Rk45 { relative: 0.0, absolute: 0.0 }).run(), &["relative", "Rk45", "0"]);
    // Weightings.
    let weighted = |signal: &str, law| fit(&record).weighting(BySignal::new(signal, law)).run();
    says(weighted("speed", WeightFunction::Absolute), &["`speed`", "it has: u"]);
    says(weighted("u", WeightFunction::Square { scale: 0.0 }), &["scale", "`u`", "0", "positive"]);
    says(
        weighted("u", WeightFunction::Above { threshold: 1e3 }),
        &["weighting", "|u| >= 1000", "zero at every sample"],
    );
    says(fit(&record).weighting(|_: &Sample<Rl>| f64::NAN).run(), &["sample 0", "t = 0 s", "`bench`", "not a number"]);
    says(fit(&record).weighting(|s: &Sample<Rl>| 0.1 - s.t).run(), &["sample 101", "`bench`", "not negative"]);
    // Pre-filters.
    says(Butterworth::low_pass(4, 600.0, H), &["600 Hz", "half the sampling rate, 500 Hz"]);
    says(Butterworth::low_pass(0, 60.0, H), &["order is 0", "1 to 20"]);
    says(Butterworth::low_pass(4, 60.0, f64::NAN), &["sample time of the filter", "NaN"]);
    let other = Butterworth::low_pass(4, 100.0, 1e-4).unwrap();
    says(fit(&record).prefilter(other).run(), &["every 0.0001 s", "`bench`", "0.001 s apart", "resample"]);
    // Horizons.
    for steps in [0, 200, usize::MAX] {
        says(
            fit(&record).predictor(Horizon::new(steps)).run(),
            &[&format!("{steps} sample(s)"), "`bench`", "200", "FreeRun"],
        );
    }
}

#[test]
fn stopped_before_or_soon_after_the_start() {
    let record = record();
    says(fit(&record).cancel(Arc::new(AtomicBool::new(true))).run(), &["cancelled before"]);
    says(fit(&record).time_limit(Duration::ZERO).run(), &["time limit of 0 s"]);
    let search = |iterations| LevenbergMarquardt::new(Stop { iterations, ..Stop::default() }, JacobianColumns);
    for iterations in [0, 1] {
        let stop = Stop { iterations, ..Stop::default() };
        let estimates = [
            sound(fit(&record).optimizer(search(iterations)).run()),
            sound(fit(&record).optimizer(GaussNewton::new(stop)).run()),
            sound(fit(&record).noise(Current { i: 0.01 }).optimizer(search(iterations)).run()),
        ];
        for estimate in estimates {
            assert_eq!(estimate.outcome, Outcome::IterationLimit { iterations });
            assert_eq!(estimate.iterations, iterations);
            assert_eq!(estimate.severity(), Severity::NotUsable);
        }
    }
    // As far as rounding allows.
    let stop = Stop { step: 0.0, gradient: 0.0, ..Stop::default() };
    assert!(sound(fit(&record).optimizer(LevenbergMarquardt::new(stop, JacobianColumns)).run()).outcome.converged());
    assert!(sound(fit(&record).optimizer(GaussNewton::new(stop)).run()).outcome.converged());
}

#[test]
fn missing_and_constant_outputs() {
    let parts = ["`record`", "output `i`", "missing in every sample"];
    says(fit(&record_of(&Rl, &[f64::NAN; 50])).run(), &parts);
    let unmeasured = record_of(&Rl, &[f64::NAN; 50]).initial(Current { i: fixed(0.0) });
    assert!(matches!(says(fit(&unmeasured).run(), &parts), Error::OutputMissing { .. }));
    // A prediction needs no measurement if the initial state is known.
    let estimate = sound(fit(&record()).run());
    let prediction = estimate.predict(&Rl, &unmeasured).unwrap();
    assert!(prediction.outputs.iter().all(|y| y.i.is_finite()) && prediction.residuals.iter().all(|y| y.i.is_nan()));
    let open = record_of(&Rl, &[f64::NAN; 50]).initial(Current { i: free(0.0) });
    says(estimate.predict(&Rl, &open), &parts);

    // Always at rest: neither parameter shows.
    let inputs = vec![Voltage { u: 0.0 }; 50];
    let rest = Experiment::new(&Rl, EVEN, inputs, vec![Current { i: 0.0 }; 50]).unwrap();
    let estimate = sound(fit(&rest).run());
    let unknown = estimate.knowledge;
    assert_eq!([unknown.r, unknown.l], [Knowledge::Unidentified; 2]);
    warns(&estimate, &["`r` has no influence", "`l` has no influence"]);
    let estimate = sound(fit(&rest.initial(Current { i: fixed(0.0) })).run());
    assert_eq!(estimate.severity(), Severity::NotUsable);
    warns(&estimate, &["determine none"]);
    // A constant that the model cannot reproduce.
    let flat = record_of(&Rl, &[7.0; 100]);
    assert!(sound(fit(&flat).run()).quality.i.fit_percent.is_none());
}

#[test]
fn more_unknowns_than_measurements() {
    let few = record_of(&Rl, &response(2, 0.01));
    let estimate = sound(fit(&few).run());
    assert_eq!(estimate.severity(), Severity::NotUsable);
    warns(&estimate, &["2 measurement(s) for 3 unknown(s)"]);
    assert!(estimate.unknowns.iter().all(|unknown| unknown.knowledge.standard_error().is_none()));
    // As many.
    let estimate = sound(fit(&record_of(&Rl, &response(3, 0.01))).run());
    assert_eq!(estimate.severity(), Severity::NotUsable);
    warns(&estimate, &["3 measurement(s) for 3 unknown(s)"]);
}

#[test]
fn names_that_experiments_share() {
    let pair = [record(), record()];
    let parameters = Coil { r: free(1.0).per_experiment(), l: free(0.03) };
    let estimate = sound(Fit::new(&Rl, &pair).parameters(parameters).run());
    let names: Vec<&str> = estimate.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
    assert_eq!(names, ["l", "i(0) [bench #1]", "r [bench #1]", "i(0) [bench #2]", "r [bench #2]"]);
    assert_eq!(estimate.summary().experiments[1].name, "bench #2");
    let bad = [record(), record().initial(Current { i: fixed(1e300) }), record().named("other")];
    says(Fit::new(&Rl, &bad).parameters(START).noise(Current { i: 1.0 }).run(), &["`bench #2`", "`i`"]);
    // One value per experiment, and one experiment: refused, but for a fleet, where it is the rule.
    let parts = ["`r`", "there is one experiment", "leave .per_experiment() out"];
    says(Fit::new(&Rl, &pair[0]).parameters(parameters).run(), &parts);
    says(Fit::new(&Rl, &pair[0]).parameters(parameters).problem(), &parts);
    let fleet = Fleet::new(&Rl).parameters(parameters).fleet().unwrap();
    let (alone, same) = (fleet.fit(&pair[0]).unwrap(), fit(&pair[0]).run().unwrap());
    assert_eq!((alone.unknowns[0].name.as_str(), alone.parameters.r), ("r", same.parameters.r));
}

#[test]
fn huge_residuals() {
    let mut y = response(200, 0.01);
    y[17] = 1e200;
    let parts = ["`record`, sample 17", "error of output `i`", "1e200", "square overflows", "units"];
    let record = record_of(&Rl, &y);
    says(fit(&record).run(), &parts);
    says(fit(&record).noise_covariance().loss(Huber::default()).run(), &parts);
    says(fit(&record).noise(Current { i: 1e-200 }).run(), &parts);
    y[17] = 1e100;
    sound(fit(&record_of(&Rl, &y)).run());
    // A prior that allows nothing else.
    let prior = Coil { r: free(1.0).prior(1.0, 1e-200), l: free(0.03) };
    sound(Fit::new(&Rl, &self::record()).parameters(prior).run());
}

#[test]
fn checkpoints_that_cannot_be() {
    let record = record();
    let folder = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("bad_input");
    std::fs::create_dir_all(&folder).unwrap();
    says(fit(&record).checkpoint(&folder, 1).run(), &["bad_input", "no regular file"]);
    says(fit(&record).checkpoint(folder.join("no/such/folder"), 1).run(), &["no/such/folder", "No such file"]);
    if std::path::Path::new("/dev/full").exists() {
        says(fit(&record).checkpoint("/dev/full", 1).run(), &["/dev/full", "no regular file"]);
        assert!(!std::path::Path::new("/dev/full").is_file(), "the device is still one");
        says(fit(&record).checkpoint("/dev/full/inside", 1).run(), &["/dev/full/inside"]);
    }
    if std::path::Path::new("/proc/self").exists() {
        says(fit(&record).checkpoint("/proc/self/checkpoint", 1).run(), &["/proc/self/checkpoint"]);
    }
    let text = folder.join("text.json");
    std::fs::write(&text, "hello").unwrap();
    says(fit(&record).checkpoint(&text, 1).run(), &["text.json", "cannot be read", "delete it"]);
    std::fs::write(&text, [0xff, 0xfe, 0x00]).unwrap();
    says(fit(&record).checkpoint(&text, 1).run(), &["text.json"]);
    // Another problem's.
    let place = folder.join("place.json");
    let _ = std::fs::remove_file(&place);
    fit(&record).checkpoint(&place, 1).run().unwrap();
    let other = fit(&record).noise(Current { i: 0.3 }).checkpoint(&place, 1).run();
    assert!(matches!(says(other, &["place.json", "another problem", "delete it"]), Error::Checkpoint { .. }));
    // The same goes on, and says how it ends.
    assert!(sound(fit(&record).checkpoint(&place, 1).run()).outcome.converged());
}

#[test]
fn scalings_that_return_rubbish() {
    #[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
    struct Rubbish(f64, usize);
    impl Scaling for Rubbish {
        fn scales(&self, _seen: &Seen) -> Vec<f64> {
            vec![self.0; self.1]
        }
    }
    let record = record();
    let right = fit(&record).run().unwrap().parameters;
    for scale in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e-300, 1e300, 1e-8, 1e8] {
        for count in [0, 1, 3, 9] {
            let search = LevenbergMarquardt::new(Stop::default(), Rubbish(scale, count));
            let estimate =
                fit(&record).optimizer(search).run().unwrap_or_else(|error| panic!("{scale} {count}: {error}"));
            println!("{scale} {count}: {}", estimate.outcome);
            if estimate.outcome.converged() {
                assert_relative_eq!(estimate.parameters.r, right.r, max_relative = 1e-7);
                assert_relative_eq!(estimate.parameters.l, right.l, max_relative = 1e-7);
            }
        }
    }
}

#[test]
fn records_of_one_sample_serve_static_models_only() {
    let one = Experiment::new(&Rl, EVEN, vec![Voltage { u: 1.0 }], vec![Current { i: 1.0 }]);
    says(one, &["1 sample", "2 or more"]);
}
