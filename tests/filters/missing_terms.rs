//! Physics that a model lacks and a filter takes for process noise.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Motion { x: "m", v: "m/s" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Position { x: "m" } }
signals! { pub struct Axis { c: "1/s^2", d: "1/s", e: "1", b: "1/kg", q: "m/s^1.5", r: "m" } }

/// `dv = (b f - c x - d v - e v sqrt(v^2 + s^2)) dt + q dw`, of which the position is measured: damping that is quadratic at speeds beyond `s`.
#[derive(Clone)]
struct Damped;

impl Model for Damped {
    type State = Motion;
    type Input = Force;
    type Output = Position;
    type Parameters = Axis;

    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Axis<S>) -> Motion<S> {
        Motion { x: x.v, v: p.b * u.f - p.c * x.x - p.d * x.v - p.e * x.v * (x.v * x.v + SLOW * SLOW).sqrt() }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Axis<S>) -> Position<S> {
        Position { x: x.x }
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, p: &Axis<S>) -> Motion<S> {
        Motion { x: S::from(0.0), v: p.q }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, p: &Axis<S>) -> Position<S> {
        Position { x: p.r }
    }
}

const SLOW: f64 = 0.05;
/// The samples of a record, and how many of a kind are fitted.
const SAMPLES: usize = 500;
const RECORDS: u64 = 40;

/// A record of the spring with this quadratic damping, driven by a force with a dead zone; by Euler's steps of a fiftieth of a sample.
fn record(seed: u64, e: f64, zone: f64) -> ExperimentOf<Damped> {
    let mut random = Noise(seed);
    let (mut x, mut v, mut level, mut inputs, mut outputs) = (0.0f64, 0.0f64, 0.0, vec![], vec![]);
    for k in 0..SAMPLES {
        if k % 15 == 0 {
            level = 2.0 * random.gauss();
        }
        let f: f64 = level + (0.9 * k as f64).sin();
        inputs.push(Force { f });
        outputs.push(Position { x: x + 0.02 * random.gauss() });
        let f = f - f.clamp(-zone, zone);
        for _ in 0..50 {
            let h = 0.1 / 50.0;
            let a = f - 2.0 * x - 0.5 * v - e * v * (v * v + SLOW * SLOW).sqrt();
            (x, v) = (x + h * v, v + h * a + 0.2 * h.sqrt() * random.gauss());
        }
    }
    let made = Experiment::new(&Damped, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
    made.initial(Motion { x: fixed(0.0), v: fixed(0.0) })
}

/// What the fits of records of a kind say.
#[derive(Default, Debug)]
struct Said {
    usable: u64,
    not_usable: u64,
    /// Usable, with a parameter that is more than three standard errors off.
    usable_and_wrong: u64,
    /// The terms that are named.
    terms: Vec<String>,
}

/// The fits of records with a quadratic damping and a dead zone, by a model in which the damping is as declared.
fn said(damping: f64, zone: f64, e: Parameter) -> Said {
    let mut said = Said::default();
    for seed in 1..=RECORDS {
        let record = record(seed, damping, zone);
        let start = Axis { c: free(1.5), d: free(0.7), e, b: free(0.8), q: free(0.5).log(), r: free(0.05).log() };
        let found = Fit::new(&Damped, &record).parameters(start).predictor(Kalman).run().unwrap();
        let off = found
            .unknowns
            .iter()
            .zip([2.0, 0.5, 1.0])
            .map(|(unknown, truth)| ((unknown.value - truth) / unknown.knowledge.standard_error().unwrap()).abs());
        let is_usable = found.severity() == Severity::Usable;
        said.usable += u64::from(is_usable);
        said.not_usable += u64::from(found.severity() == Severity::NotUsable);
        said.usable_and_wrong += u64::from(is_usable && !e.free && off.fold(0.0, f64::max) > 3.0);
        let of = found.warnings.iter().filter(|warning| warning.code == WarningCode::MissingTerm);
        said.terms.extend(of.map(|warning| warning.text.clone()));
    }
    said
}

/// A right model is warned of in a hundredth of the records. One without a damping that is half of the linear one at 1 m/s, or without a dead zone of
/// half the force's deviation, is never usable, with innovations that look white; the term is named, as a power of the speed or of the force.
#[test]
fn physics_that_a_model_lacks() {
    for right in [said(0.0, 0.0, fixed(0.0)), said(0.6, 0.0, free(0.3))] {
        assert!(right.terms.len() <= 1 && right.usable >= RECORDS - 1, "{right:?}");
    }
    for (damping, zone, name) in [(0.3, 0.0, "`v`"), (0.6, 0.0, "`v`"), (0.0, 1.0, "`f`")] {
        let lacking = said(damping, zone, fixed(0.0));
        let named = |term: &String| term.contains(&format!("process noise of `v` follows {name}"));
        assert_eq!((lacking.not_usable, lacking.usable_and_wrong), (RECORDS, 0), "{lacking:?}");
        assert!(lacking.terms.iter().filter(|term| named(term)).count() as u64 >= RECORDS - 2, "{lacking:?}");
    }
    // Of small ones more than half are found.
    let small = said(0.1, 0.0, fixed(0.0));
    assert!(2 * small.usable_and_wrong <= RECORDS, "{small:?}");
}
