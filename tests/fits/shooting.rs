//! Fits that begin at the end of multiple shooting ([`Fit::multiple_shooting`]).

use crate::common::Noise;
use crate::lorenz::{Constants, First, Flow, Lorenz as Hidden};
use crate::stages::{Axis, Force, Motion, Position, Pushed};
use greybox::optimize::Outcome;
use greybox::*;
use std::time::Duration;

/// The flow of [`Hidden`], of which all states are measured.
#[derive(Clone)]
struct Lorenz;

impl Model for Lorenz {
    type State = Flow;
    type Input = Nothing;
    type Output = Flow;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, t: S, x: &Flow<S>, u: &Nothing, p: &Constants<S>) -> Flow<S> {
        Hidden.derivative(t, x, u, p)
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> Flow<S> {
        *x
    }
}

const STEPS: Rk4 = Rk4 { substeps: 4 };

/// So many seconds with noise of 5 %.
fn lorenz(seconds: usize) -> ExperimentOf<Lorenz> {
    let truth = Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 };
    let time = Time::Uniform { start: 0.0, step: 0.01 };
    let from = Flow { x: -6.0, y: -8.0, z: 22.0 };
    let inputs = vec![Nothing; 100 * seconds + 1];
    let run = Simulator::new(&Lorenz).integrator(STEPS).run(&truth, &from, time, &inputs).unwrap();
    run.with_noise(Flow { x: 0.4, y: 0.45, z: 0.4 }, 3).experiment(&Lorenz).unwrap()
}

/// Parameters three times off.
fn off() -> Constants<Parameter> {
    Constants { sigma: free(29.0), rho: free(11.0), beta: free(1.3) }
}

fn said<M: Model>(found: &Estimate<M>) -> String {
    let told = found.warnings.iter().filter(|warning| warning.code == WarningCode::Staged);
    told.map(|warning| warning.text.clone()).collect::<Vec<_>>().join("; ")
}

/// Twenty seconds, in which an error of the start grows by `exp(18)`: the parameters come back within four standard errors, and the path is told, with
/// closed gaps and an rms error of the noise. One search alone ends elsewhere.
#[test]
fn a_chaotic_plant_is_found() {
    let record = lorenz(20);
    let fit = || Fit::new(&Lorenz, &record).parameters(off()).integrator(STEPS);
    let alone = fit().starts(1).run().unwrap();
    assert!((alone.parameters.sigma / 10.0 - 1.0).abs() > 0.1, "{alone}");
    let found = fit().multiple_shooting().run().unwrap();
    for (unknown, truth) in found.unknowns.iter().zip([10.0, 28.0, 8.0 / 3.0]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error && error < 0.01 * truth, "{found}");
    }
    assert!(found.severity() < Severity::NotUsable, "{found}");
    assert!(said(&found).contains("the search began at the end of multiple shooting ("), "{found}");
}

/// Sixty seconds, in which an error of the start grows by `exp(54)`, more than the digits of a number: no simulation follows the record. The parameters
/// are those of pieces all the same, 0.2 % being ten standard errors; the verdict is not usable, and the note has the numbers of the pieces and
/// the remedy, by which the verdict is another one.
#[test]
fn a_record_that_no_simulation_follows_is_fitted_in_pieces() {
    let record = lorenz(60);
    let found = Fit::new(&Lorenz, &record).parameters(off()).integrator(STEPS).multiple_shooting().run().unwrap();
    for (unknown, truth) in found.unknowns.iter().zip([10.0, 28.0, 8.0 / 3.0]) {
        assert!((unknown.value / truth - 1.0).abs() < 2e-3, "{found}");
    }
    assert_eq!(found.severity(), Severity::NotUsable);
    let note = said(&found);
    assert!(note.contains("with an initial state each") && note.contains("Experiment::slice"), "{note}");
    assert!(note.contains("`sigma` = ") && note.contains(" +- "), "{note}");
    let pieces: Vec<_> = (0..4).map(|k| record.slice(1500 * k..1500 * (k + 1)).unwrap()).collect();
    let known = found.parameters;
    let start = Constants { sigma: free(known.sigma), rho: free(known.rho), beta: free(known.beta) };
    let again = Fit::new(&Lorenz, &pieces).parameters(start).integrator(STEPS).multiple_shooting().run().unwrap();
    assert!(again.severity() < Severity::NotUsable, "{again}");
    assert!((again.parameters.sigma / 10.0 - 1.0).abs() < 2e-3, "{again}");
}

/// In stages: where the filter's predictions have led the parameters near, and no simulation follows, multiple shooting goes on, and the path has both.
/// So it is where the fit goes in stages by itself.
#[test]
fn stages_end_with_multiple_shooting() {
    let record = lorenz(60);
    let fit = || Fit::new(&Lorenz, &record).parameters(off()).integrator(STEPS);
    let (asked, by_itself) = (fit().staged().run().unwrap(), fit().run().unwrap());
    for found in [&asked, &by_itself] {
        assert!((found.parameters.rho / 28.0 - 1.0).abs() < 2e-3, "{found}");
        assert!(said(found).contains("with an initial state each"), "{found}");
    }
    assert!(said(&asked).contains("less in each stage), then of multiple shooting ("), "{asked}");
}

/// Weights have no unit: the same parameters come of them, and the same error in units of the noise, 0.9 to 1.2 of it.
#[test]
fn weights_do_not_change_what_the_noise_is() {
    let record = lorenz(20);
    for weight in [1e-4, 300.0] {
        let fit = Fit::new(&Lorenz, &record).parameters(off()).integrator(STEPS);
        let found = fit.weighting(move |_: &Sample<Lorenz>| weight).multiple_shooting().run().unwrap();
        assert!((found.parameters.sigma / 10.0 - 1.0).abs() < 0.01, "{found}");
        let note = said(&found);
        let misfit = note.split("the rms error ").nth(1).and_then(|rest| rest.split(')').next()).unwrap();
        assert!((0.9..1.2).contains(&misfit.parse().unwrap()), "{note}");
    }
}

signals! { struct Tilt { x: "rad" } }
signals! { struct Drive { u: "rad/s" } }
signals! { struct Growth { a: "1/s", b: "1" } }

/// A plant that falls over.
#[derive(Clone)]
struct Pole;

impl Model for Pole {
    type State = Tilt;
    type Input = Drive;
    type Output = Tilt;
    type Parameters = Growth;

    fn derivative<S: Scalar>(&self, _t: S, x: &Tilt<S>, u: &Drive<S>, p: &Growth<S>) -> Tilt<S> {
        Tilt { x: p.a * x.x + p.b * u.u }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Tilt<S>, _u: &Drive<S>, _p: &Growth<S>) -> Tilt<S> {
        *x
    }
}

/// A plant that grows by `exp(750)` in the record of its controlled course: no simulation of the whole with the right parameters is a number. The fit
/// goes on from its start, is not usable, and has a note with the parameters that pieces give, which its remedy confirms.
#[test]
fn a_plant_whose_simulation_overflows_is_known_by_pieces() {
    const H: f64 = 0.05;
    let (a, mut random, mut x) = (5.0f64, Noise(5), 0.0);
    let (mut inputs, mut outputs) = (vec![], vec![]);
    for k in 0..3000 {
        let y = x + 0.01 * random.gauss();
        let u = if k / 40 % 2 == 0 { 1.0 } else { -1.0 } - 8.0 * y;
        x = f64::exp(a * H) * x + f64::exp_m1(a * H) / a * u;
        inputs.push(Drive { u });
        outputs.push(Tilt { x: y });
    }
    let record = Experiment::new(&Pole, Time::Uniform { start: 0.0, step: H }, inputs, outputs).unwrap();
    let start = || Growth { a: free(-1.0), b: free(0.5) };
    let fit = Fit::new(&Pole, &record).parameters(start()).integrator(STEPS).multiple_shooting();
    let found = fit.run().unwrap();
    let note = said(&found);
    assert_eq!(found.severity(), Severity::NotUsable, "{found}");
    assert!(note.contains("no simulation can be run from the end of multiple shooting ("), "{note}");
    assert!(note.contains("one simulation of a whole record cannot be run"), "{note}");
    let value: f64 = note.split("`a` = ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
    assert!((value - a).abs() < 0.1, "{note}");
}

/// The flow with equations that are not read as a graph, so that there is no filter.
#[derive(Clone)]
struct Unread;

impl Model for Unread {
    type State = Flow;
    type Input = Nothing;
    type Output = Flow;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, t: S, x: &Flow<S>, u: &Nothing, p: &Constants<S>) -> Flow<S> {
        Hidden.derivative(t + 0.0 * x.x.value().floor(), x, u, p)
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> Flow<S> {
        *x
    }
}

/// Without a filter, multiple shooting is all there is of the stages.
#[test]
fn stages_without_a_filter_are_multiple_shooting() {
    let record = lorenz(6);
    let outputs = record.outputs().collect();
    let record = Experiment::new(&Unread, record.times().clone(), vec![Nothing; record.len()], outputs).unwrap();
    let found = Fit::new(&Unread, &record).parameters(off()).integrator(STEPS).staged().run().unwrap();
    assert!((found.parameters.rho / 28.0 - 1.0).abs() < 0.01, "{found}");
    assert!(said(&found).contains("the search began at the end of multiple shooting ("), "{found}");
}

fn pushed(seed: u64, samples: usize, fv: f64) -> ExperimentOf<Pushed> {
    let mut random = Noise(seed);
    let inputs: Vec<Force> = (0..samples).map(|k| Force { f: if k / 130 % 2 == 0 { 40.0 } else { -40.0 } }).collect();
    let (truth, from) = (Axis { m: 95.0, fv, offset: -3.0 }, Motion { q: 0.2, v: 0.1 });
    let time = Time::Uniform { start: 0.0, step: 0.005 };
    let run = simulate(&Pushed, &truth, &from, time.clone(), &inputs).unwrap();
    let outputs = run.outputs.iter().map(|y| Position { q: y.q + 1e-3 * random.gauss() }).collect();
    Experiment::new(&Pushed, time, inputs, outputs).unwrap()
}

fn unstable() -> Axis<Parameter> {
    Axis { m: free(0.2), fv: free(-10.0), offset: free(10.0) }
}

/// From a start whose simulation grows by `exp(500)`: the parameters come back within four standard errors, of one record with a hidden velocity, of
/// two with a friction each, in a fleet as alone, and with a mass by logarithm that is five times too small.
#[test]
fn a_start_that_cannot_be_simulated_is_led_to_the_data() {
    let records = [pushed(7, 2000, 200.0), pushed(8, 1500, 300.0)];
    let near = |found: &Summary, truths: &[f64]| {
        for (unknown, truth) in found.unknowns.iter().filter(|one| !one.name.contains("(0)")).zip(truths) {
            let error = unknown.knowledge.standard_error().unwrap();
            assert!((unknown.value - truth).abs() < 4.0 * error && error < 0.05 * truth.abs(), "{truth} {found}");
        }
    };
    let alone = Fit::new(&Pushed, &records[0]).parameters(unstable()).multiple_shooting().run().unwrap();
    near(&alone, &[95.0, 200.0, -3.0]);
    let each = Axis { fv: free(-10.0).per_experiment(), ..unstable() };
    let both = Fit::new(&Pushed, &records).parameters(each).multiple_shooting().run().unwrap();
    near(&both, &[95.0, -3.0, 200.0, 300.0]);
    let logarithm = Axis { m: free(20.0).log(), ..unstable() };
    near(
        &Fit::new(&Pushed, &records[0]).parameters(logarithm).multiple_shooting().run().unwrap(),
        &[95.0, 200.0, -3.0],
    );
    let fleet = Fleet::new(&Pushed).parameters(unstable()).multiple_shooting().fleet().unwrap();
    let together = fleet.run([records[0].clone()]).next().unwrap().unwrap();
    assert_eq!(together.evaluations, alone.evaluations);
}

/// The same model, with equations that are not read as a graph.
#[derive(Clone)]
struct Opaque;

impl Model for Opaque {
    type State = Motion;
    type Input = Force;
    type Output = Position;
    type Parameters = Axis;

    fn derivative<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Force<S>, p: &Axis<S>) -> Motion<S> {
        Pushed.derivative(t + 0.0 * x.q.value().floor(), x, u, p)
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Axis<S>) -> Position<S> {
        Position { q: x.q }
    }
}

/// Where there are no pieces, the fit goes on from its start and says why.
#[test]
fn what_has_no_pieces_says_so() {
    let near = Axis { m: free(80.0), fv: free(150.0), offset: free(0.0) };
    let record = pushed(7, 1000, 200.0);
    let told = |record: &ExperimentOf<Pushed>, change: &dyn Fn(Fit<'_, Pushed>) -> Fit<'_, Pushed>| {
        said(&change(Fit::new(&Pushed, record).parameters(near)).multiple_shooting().run().unwrap())
    };
    let short = told(&record.slice(..15).unwrap(), &|fit| fit);
    assert!(
        short.contains("no record has two pieces of eight samples; the search began at the declared start"),
        "{short}"
    );
    assert!(!told(&record.slice(..200).unwrap(), &|fit| fit).contains("asked for"));
    let filtered = told(&record, &|fit| fit.prefilter(Butterworth::low_pass(2, 20.0, 0.005).unwrap()));
    assert!(filtered.contains("the errors are filtered"), "{filtered}");
    let opaque =
        Experiment::new(&Opaque, record.times().clone(), record.inputs().collect(), record.outputs().collect());
    let opaque = Fit::new(&Opaque, &opaque.unwrap()).parameters(near).multiple_shooting().run().unwrap();
    assert!(said(&opaque).contains("outputs do not give the state where pieces begin"), "{opaque}");
}

/// A start from which pieces of eight samples overflow is an error with its sample, as without multiple shooting; so are bounds without width.
#[test]
fn starts_that_nobody_can_simulate_are_named() {
    let record = pushed(7, 1000, 200.0);
    let run = |start: Axis<Parameter>| Fit::new(&Pushed, &record).parameters(start).multiple_shooting().run();
    let error = run(Axis { m: free(1e-300), ..unstable() }).unwrap_err();
    assert!(matches!(error, Error::Start(_)), "{error}");
    let error = run(Axis { m: free(5.0).within(5.0, 5.0), ..unstable() }).unwrap_err();
    assert!(error.to_string().contains("its bounds are 5 and 5"), "{error}");
}

/// A time limit that ends multiple shooting leaves a point: not an error, and not a minimum.
#[test]
fn a_stop_leaves_a_point() {
    let record = lorenz(20);
    let fit = Fit::new(&Lorenz, &record).parameters(off()).multiple_shooting();
    let late = fit.time_limit(Duration::from_millis(1)).run().unwrap();
    assert!(matches!(late.outcome, Outcome::TimeLimit), "{late}");
}

/// Ten seconds of which one state of three is measured: the others begin with what a filter makes of wrong parameters.
#[test]
fn hidden_states_are_found() {
    let all = lorenz(10);
    let outputs = all.outputs().map(|y| First { x: y.x }).collect();
    let record = Experiment::new(&Hidden, all.times().clone(), vec![Nothing; all.len()], outputs).unwrap();
    let start = Constants { sigma: free(17.0), rho: free(20.0), beta: free(1.7) };
    let found = Fit::new(&Hidden, &record).parameters(start).integrator(STEPS).multiple_shooting().run().unwrap();
    assert!((found.parameters.sigma / 10.0 - 1.0).abs() < 0.02 && found.severity() < Severity::NotUsable, "{found}");
}
