//! Fits that go from a far start in stages ([`Fit::staged`]).

use crate::common::Noise;
use crate::lorenz::{Constants, First, Flow, Lorenz};
use greybox::optimize::Outcome;
use greybox::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Ten seconds with noise of 5 %.
fn lorenz() -> ExperimentOf<Lorenz> {
    let truth = Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 };
    let (time, inputs) = (Time::Uniform { start: 0.0, step: 0.01 }, vec![Nothing; 1001]);
    let from = Flow { x: -6.0, y: -8.0, z: 22.0 };
    let run = simulate(&Lorenz, &truth, &from, time, &inputs).unwrap();
    run.with_noise(First { x: 0.4 }, 3).experiment(&Lorenz).unwrap()
}

/// Ten seconds, in which an error of the start grows by `exp(9)`, from parameters three times too large or too small. One search ends in
/// another minimum; in stages the parameters come back as well as noise of 5 % lets them, to some 0.2 %.
#[test]
fn a_chaotic_plant_is_found_from_one_output() {
    let record = lorenz();
    for off in [[3.0, 0.4, 0.5], [0.4, 2.5, 2.0]] {
        let start = Constants { sigma: free(10.0 * off[0]), rho: free(28.0 * off[1]), beta: free(8.0 / 3.0 * off[2]) };
        let fit = || Fit::new(&Lorenz, &record).parameters(start);
        let wrong = |p: &Constants<f64>| ((p.sigma / 10.0 - 1.0).abs()).max((p.rho / 28.0 - 1.0).abs());
        assert!(wrong(&fit().starts(1).run().unwrap().parameters) > 0.1);
        let found = fit().staged().run().unwrap();
        assert!(wrong(&found.parameters) < 0.01, "{found}");
        assert!(found.outcome.converged() && found.severity() < Severity::NotUsable, "{found}");
    }
}

signals! { pub struct Motion { q: "m", v: "m/s" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Position { q: "m" } }
signals! { pub struct Axis { m: "kg", fv: "N s/m", offset: "N" } }

/// `m dv/dt = f - fv v - offset`, of which the position is measured.
#[derive(Clone)]
pub struct Pushed;

impl Model for Pushed {
    type State = Motion;
    type Input = Force;
    type Output = Position;
    type Parameters = Axis;

    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Axis<S>) -> Motion<S> {
        Motion { q: x.v, v: (u.f - p.fv * x.v - p.offset) / p.m }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Axis<S>) -> Position<S> {
        Position { q: x.q }
    }
}

fn pushed(noise: f64) -> ExperimentOf<Pushed> {
    let mut random = Noise(7);
    let inputs: Vec<Force> = (0..2000).map(|k| Force { f: if k / 130 % 2 == 0 { 40.0 } else { -40.0 } }).collect();
    let (truth, from) = (Axis { m: 95.0, fv: 200.0, offset: -3.0 }, Motion { q: 0.2, v: 0.1 });
    let time = Time::Uniform { start: 0.0, step: 0.005 };
    let run = simulate(&Pushed, &truth, &from, time.clone(), &inputs).unwrap();
    let outputs = run.outputs.iter().map(|y| Position { q: y.q + noise * random.gauss() }).collect();
    Experiment::new(&Pushed, time, inputs, outputs).unwrap()
}

/// With a friction of the wrong sign the simulation from the start grows by `exp(500)` in the record: the error of a fit that begins there
/// alone, and a note where stages lead the start. The parameters come back within four standard errors, and without noise to eight digits.
#[test]
fn a_start_that_cannot_be_simulated_is_led_to_the_data() {
    let start = Axis { m: free(0.2), fv: free(-10.0), offset: free(10.0) };
    let record = pushed(1e-3);
    let alone = Fit::new(&Pushed, &record).parameters(start).starts(1).run().unwrap_err();
    assert!(matches!(alone, Error::Start(_)), "{alone}");
    let found = Fit::new(&Pushed, &record).parameters(start).run().unwrap();
    assert!(found.warnings.iter().any(|warning| warning.code == WarningCode::Staged && warning.text.contains("stage")));
    for (unknown, truth) in found.unknowns.iter().zip([95.0, 200.0, -3.0]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error && error < 0.05 * truth.abs(), "{found}");
    }
    let exact = Fit::new(&Pushed, &pushed(0.0)).parameters(start).run().unwrap().parameters;
    for (found, truth) in [(exact.m, 95.0), (exact.fv, 200.0), (exact.offset, -3.0)] {
        assert!((found / truth - 1.0).abs() < 1e-8, "{found} {truth}");
    }
}

/// From a start at which the speed decays ten million times in a second, 50,000 times in a sample, stages alone lead nowhere: a step of
/// Runge and Kutta explodes. In other proportions (mass and friction moved by equal parts) they lead to the minimum.
#[test]
fn a_start_that_is_too_fast_is_slowed() {
    let start = Axis { m: free(0.01).log(), fv: free(1e5).log(), offset: free(0.0) };
    let found = Fit::new(&Pushed, &pushed(1e-3)).parameters(start).staged().run().unwrap();
    for (unknown, truth) in found.unknowns.iter().zip([95.0, 200.0, -3.0]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error && error < 0.05 * truth.abs(), "{found}");
    }
    let told = found.warnings.iter().filter(|warning| warning.code == WarningCode::Staged);
    assert!(
        told.map(|warning| &warning.text).any(|text| text.contains("no state decays in less than a sample")),
        "{found}"
    );
}

/// Where a fit is stopped, resumed or watched, and where outputs are missing or do not move, a start that cannot be simulated is led all the same.
#[test]
fn stages_hold_with_other_settings() {
    let start = Axis { m: free(0.2), fv: free(-10.0), offset: free(10.0) };
    let record = pushed(1e-3);
    let near = |found: &Estimate<Pushed>| (found.parameters.m / 95.0 - 1.0).abs() < 0.05;
    let fit = |record: &ExperimentOf<Pushed>| Fit::new(&Pushed, record).parameters(start).run().unwrap();
    // A checkpoint is that of the search from the declared start, which it cannot begin.
    let path = std::env::temp_dir().join(format!("stages-{}.json", std::process::id()));
    let saved = Fit::new(&Pushed, &record).parameters(start).checkpoint(&path, 1).run().unwrap();
    let _ = std::fs::remove_file(&path);
    assert!(near(&saved), "{saved}");
    // Measured at every third sample alone.
    let sparse = record.outputs().enumerate();
    let sparse = sparse.map(|(k, y)| if k % 3 == 0 { y } else { Position { q: f64::NAN } }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.005 };
    let sparse = Experiment::new(&Pushed, time.clone(), record.inputs().collect(), sparse).unwrap();
    assert!(near(&fit(&sparse)));
    // Beside a record at rest, which comes first.
    let (rest, still) = (vec![Force { f: -3.0 }; 50], vec![Position { q: 1.0 }; 50]);
    let rest = Experiment::new(&Pushed, time, rest, still).unwrap();
    let both = Fit::new(&Pushed, &[rest, record.clone()]).parameters(start).run().unwrap();
    assert!(near(&both), "{both}");
    // Robust losses and weights.
    let robust = Fit::new(&Pushed, &record).parameters(start).loss(Huber::default()).run().unwrap();
    assert!(near(&robust), "{robust}");
}

/// What is said of stages that were asked for: that there were some, or why not.
#[test]
fn the_path_is_told() {
    let record = pushed(1e-3);
    let start = Axis { m: free(50.0), fv: free(100.0), offset: free(0.0) };
    let fit = || Fit::new(&Pushed, &record).parameters(start).staged();
    let said = |found: &Estimate<Pushed>| {
        let told = found.warnings.iter().filter(|warning| warning.code == WarningCode::Staged);
        told.map(|warning| warning.text.clone()).collect::<Vec<_>>().join("; ")
    };
    let found = fit().run().unwrap();
    assert!(said(&found).contains("the search began at the end of"), "{found}");
    let filtered = fit().prefilter(Butterworth::low_pass(2, 20.0, 0.005).unwrap()).run().unwrap();
    assert!(said(&filtered).contains("there are none: the errors are filtered"), "{filtered}");
    let adaptive = fit().integrator(Rk45::default()).run().unwrap();
    assert!(said(&adaptive).contains("there is no filter that does"), "{adaptive}");
}

/// A time limit or a flag that ends the stages leaves a point, of one start and of several: not an error, and not a minimum.
#[test]
fn a_stop_in_the_stages_leaves_a_point() {
    let record = lorenz();
    let start = Constants { sigma: free(30.0), rho: free(11.0), beta: free(1.3) };
    let fit = |starts: usize| Fit::new(&Lorenz, &record).parameters(start).starts(starts).staged();
    for starts in [1, 3] {
        let late = fit(starts).time_limit(Duration::from_millis(1)).run().unwrap();
        assert!(matches!(late.outcome, Outcome::TimeLimit), "{late}");
        let flagged = fit(starts).cancel(Arc::new(AtomicBool::new(true))).run().unwrap();
        assert_eq!(flagged.outcome, Outcome::Cancelled, "{flagged}");
    }
}

/// A fleet in which each record goes in stages gives what single fits give, the evaluations of the stages among them.
#[test]
fn a_fleet_goes_in_stages_as_single_fits_do() {
    let records = [pushed(1e-3), pushed(2e-3)];
    let start = Axis { m: free(20.0), fv: free(20.0), offset: free(10.0) };
    let alone = records.each_ref().map(|record| Fit::new(&Pushed, record).parameters(start).staged().run().unwrap());
    let fleet = Fleet::new(&Pushed).parameters(start).staged().fleet().unwrap();
    for (alone, together) in alone.iter().zip(fleet.run(records)) {
        let together = together.unwrap();
        assert_eq!(together.evaluations, alone.evaluations);
        // Lanes add in another order.
        assert!((together.parameters.m / alone.parameters.m - 1.0).abs() < 1e-6);
        assert!(together.warnings.iter().any(|warning| warning.code == WarningCode::Staged));
    }
}

/// Six starts in stages end in the right minimum more often than the same without.
#[test]
fn several_starts_go_in_stages() {
    let record = lorenz();
    let start = Constants { sigma: free(20.0).log(), rho: free(14.0).log(), beta: free(2.0).log() };
    let fit = || Fit::new(&Lorenz, &record).parameters(start).starts(6);
    let right = |found: &Estimate<Lorenz>| {
        let starts = found.starts.as_ref().unwrap();
        if (found.parameters.sigma / 10.0 - 1.0).abs() < 0.01 { starts.agreed } else { 0 }
    };
    let (plain, staged) = (fit().run().unwrap(), fit().staged().run().unwrap());
    assert!(right(&staged) >= 4 && right(&plain) < 2, "{} {}", right(&staged), right(&plain));
}
