//! Fits that go from a far start in stages ([`Fit::staged`]).

use crate::common::Noise;
use greybox::*;

signals! { pub struct Flow { x: "1", y: "1", z: "1" } }
signals! { pub struct First { x: "1" } }
signals! { pub struct Constants { sigma: "1/s", rho: "1", beta: "1/s" } }

/// E. N. Lorenz, *Deterministic nonperiodic flow*, Journal of the Atmospheric Sciences 20 (1963) 130-141, of which `x` alone is measured.
#[derive(Clone)]
struct Lorenz;

impl Model for Lorenz {
    type State = Flow;
    type Input = Nothing;
    type Output = First;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, p: &Constants<S>) -> Flow<S> {
        Flow { x: p.sigma * (x.y - x.x), y: x.x * (p.rho - x.z) - x.y, z: x.x * x.y - p.beta * x.z }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> First<S> {
        First { x: x.x }
    }
}

/// Ten seconds, in which an error of the start grows by `exp(9)`, from parameters three times too large or too small. One search ends in
/// another minimum; in stages the parameters come back as well as noise of 5 % lets them, to some 0.2 %.
#[test]
fn a_chaotic_plant_is_found_from_one_output() {
    let truth = Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 };
    let (time, inputs) = (Time::Uniform { start: 0.0, step: 0.01 }, vec![Nothing; 1001]);
    let from = Flow { x: -6.0, y: -8.0, z: 22.0 };
    let record = simulate(&Lorenz, &truth, &from, time, &inputs).unwrap().with_noise(First { x: 0.4 }, 3);
    let record = record.experiment(&Lorenz).unwrap();
    for off in [[3.0, 0.4, 0.5], [0.4, 2.5, 2.0]] {
        let start = Constants { sigma: free(10.0 * off[0]), rho: free(28.0 * off[1]), beta: free(8.0 / 3.0 * off[2]) };
        let fit = || Fit::new(&Lorenz, &record).parameters(start);
        let wrong = |p: &Constants<f64>| ((p.sigma / 10.0 - 1.0).abs()).max((p.rho / 28.0 - 1.0).abs());
        assert!(wrong(&fit().starts(1).run().unwrap().parameters) > 0.1);
        // By itself, as one search explains nothing, and as asked for.
        for found in [fit().run().unwrap(), fit().staged().run().unwrap()] {
            assert!(wrong(&found.parameters) < 0.01, "{found}");
            assert!(found.outcome.converged() && found.severity() < Severity::NotUsable, "{found}");
        }
        let said = |warning: &Warning| warning.code == WarningCode::Unexplained && warning.text.contains("stages");
        assert!(fit().run().unwrap().warnings.iter().any(said));
    }
}

signals! { pub struct Motion { q: "m", v: "m/s" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Position { q: "m" } }
signals! { pub struct Axis { m: "kg", fv: "N s/m", offset: "N" } }

/// `m dv/dt = f - fv v - offset`, of which the position is measured.
#[derive(Clone)]
struct Pushed;

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
    assert!(
        found.warnings.iter().any(|warning| warning.code == WarningCode::Staged && warning.text.contains("stages"))
    );
    for (unknown, truth) in found.unknowns.iter().zip([95.0, 200.0, -3.0]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error && error < 0.05 * truth.abs(), "{found}");
    }
    let exact = Fit::new(&Pushed, &pushed(0.0)).parameters(start).run().unwrap().parameters;
    for (found, truth) in [(exact.m, 95.0), (exact.fv, 200.0), (exact.offset, -3.0)] {
        assert!((found / truth - 1.0).abs() < 1e-8, "{found} {truth}");
    }
}

/// Four starts, each in stages: all of them end in one minimum.
#[test]
fn several_starts_go_in_stages() {
    let start = Axis { m: free(20.0).within(1.0, 500.0), fv: free(20.0).within(1.0, 1000.0), offset: free(10.0) };
    let record = pushed(1e-3);
    let found = Fit::new(&Pushed, &record).parameters(start).starts(4).staged().run().unwrap();
    let starts = found.starts.as_ref().unwrap();
    assert_eq!((starts.tried, starts.agreed), (4, 4));
}
