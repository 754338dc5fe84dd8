//! Inputs that act at other moments than the record says, which a filter takes for process noise.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Level { x: "m" } }
signals! { pub struct Flow { u: "m/s" } }
signals! { pub struct Tank { a: "1/s", b: "1", q: "m/s^0.5", r: "m" } }

/// `dx = (b u - a x) dt + q dw`.
#[derive(Clone)]
pub struct Leak;

impl Model for Leak {
    type State = Level;
    type Input = Flow;
    type Output = Level;
    type Parameters = Tank;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Flow<S>, p: &Tank<S>) -> Level<S> {
        Level { x: p.b * u.u - p.a * x.x }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Flow<S>, _p: &Tank<S>) -> Level<S> {
        *x
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Flow<S>, p: &Tank<S>) -> Level<S> {
        Level { x: p.q }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Flow<S>, p: &Tank<S>) -> Level<S> {
        Level { x: p.r }
    }
}

const SAMPLES: usize = 1_000;
const STEP: f64 = 0.1;
const FINE: usize = 20;
const A: f64 = 1.0;
const B: f64 = 2.0;
const Q: f64 = 0.3;
const R: f64 = 0.1;

/// What the plant had: inputs that are held, or straight lines; and what was recorded.
#[derive(Clone, Copy, PartialEq)]
pub enum Recorded {
    Right,
    Late,
    Early,
    Lines,
}

/// A record in a loop of this gain, by Euler's steps of a twentieth of a sample.
pub fn record(seed: u64, gain: f64, recorded: Recorded) -> ExperimentOf<Leak> {
    let mut random = Noise(seed);
    let mut level = 0.0;
    let reference: Vec<f64> = (0..SAMPLES + 2)
        .map(|k| {
            level = if k % 4 == 0 { random.gauss() } else { level };
            level
        })
        .collect();
    let (mut x, mut y, mut u) = (0.0, vec![], vec![]);
    for k in 0..=SAMPLES {
        y.push(Level { x: x + R * random.gauss() });
        u.push(reference[k] - gain * y[k].x);
        for fine in 0..FINE {
            let (h, part) = (STEP / FINE as f64, fine as f64 / FINE as f64);
            let along = if recorded == Recorded::Lines { part * (reference[k + 1] - reference[k]) } else { 0.0 };
            x += h * (B * (u[k] + along) - A * x) + Q * h.sqrt() * random.gauss();
        }
    }
    let at = |k: usize| match recorded {
        Recorded::Right | Recorded::Lines => u[k],
        Recorded::Late => u[k.saturating_sub(1)],
        Recorded::Early => u[k + 1],
    };
    let inputs = (0..SAMPLES).map(|k| Flow { u: at(k) }).collect();
    y.truncate(SAMPLES);
    Experiment::new(&Leak, Time::Uniform { start: 0.0, step: STEP }, inputs, y).unwrap().hold(Hold::Zero)
}

pub fn fit(record: &ExperimentOf<Leak>) -> Fit<'_, Leak> {
    let start = Tank { a: free(0.5), b: free(1.0), q: free(0.5).log(), r: free(0.05).log() };
    Fit::new(&Leak, record).parameters(start).predictor(Kalman)
}

fn said(estimate: &Estimate<Leak>) -> Option<&Warning> {
    estimate.warnings.iter().find(|warning| warning.code == WarningCode::InputTiming)
}

/// An input that is recorded a sample late or early, and straight lines that are taken as held, bias the rate by a tenth or more, with white
/// innovations: each is named as what it is, with care or more. Also in a loop.
#[test]
fn inputs_of_other_moments_are_named() {
    let kinds = [
        (Recorded::Late, "acts a sample before it is recorded"),
        (Recorded::Early, "acts a sample after it is recorded"),
        (Recorded::Lines, "is a straight line between its samples rather than held"),
    ];
    for (recorded, text) in kinds {
        for (seed, gain) in (1..=6).flat_map(|seed| [(seed, 0.0), (seed, 1.0)]) {
            if recorded == Recorded::Lines && gain > 0.0 {
                continue;
            }
            let found = fit(&record(seed, gain, recorded)).run().unwrap();
            let warning = said(&found).unwrap_or_else(|| panic!("{text}, {seed}, {gain}"));
            assert!(
                warning.text.contains(text) && warning.severity > Severity::Usable,
                "{seed} {gain}: {}",
                warning.text
            );
        }
    }
}

/// Nothing is said of right records, without a loop, and in loops of either sign, where the input follows the measurements.
#[test]
fn right_inputs_are_not() {
    for (seed, gain) in (1..=8).flat_map(|seed| [0.0, 1.0, 3.0, -0.4].map(|gain| (seed, gain))) {
        let found = fit(&record(seed, gain, Recorded::Right)).run().unwrap();
        assert!(said(&found).is_none(), "{seed} {gain}: {:?}", said(&found));
    }
}

signals! { pub struct Lags { x: "m", z: "m" } }
signals! { pub struct Inverse { a: "1/s", b: "1/s", q: "m/s^0.5", r: "m" } }

/// Two lags of one flow, of which 1.5 of the slow one and -0.7 of the fast one are measured: the output begins in the wrong direction.
#[derive(Clone)]
struct WrongWay;

impl Model for WrongWay {
    type State = Lags;
    type Input = Flow;
    type Output = Level;
    type Parameters = Inverse;

    fn derivative<S: Scalar>(&self, _t: S, x: &Lags<S>, u: &Flow<S>, p: &Inverse<S>) -> Lags<S> {
        Lags { x: p.a * (u.u - x.x), z: p.b * (u.u - x.z) }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Lags<S>, _u: &Flow<S>, _p: &Inverse<S>) -> Level<S> {
        Level { x: x.z * 1.5 - x.x * 0.7 }
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Lags<S>, _u: &Flow<S>, p: &Inverse<S>) -> Lags<S> {
        Lags { x: p.q, z: p.q }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Lags<S>, _u: &Flow<S>, p: &Inverse<S>) -> Level<S> {
        Level { x: p.r }
    }
}

/// In a loop its input acts with the measurement that it is computed from, as one that is recorded late does. Such a right record is not refused.
#[test]
fn an_inverse_response_in_a_loop_is_not_refused() {
    for seed in 1..=4 {
        let mut random = Noise(seed);
        let (mut x, mut reference, mut inputs, mut outputs) = ([0.0f64; 2], 0.0, vec![], vec![]);
        for k in 0..SAMPLES {
            reference = if k % 15 == 0 { random.gauss() } else { reference };
            let y = 1.5 * x[1] - 0.7 * x[0] + R * random.gauss();
            let u = reference - y;
            inputs.push(Flow { u });
            outputs.push(Level { x: y });
            for _ in 0..FINE {
                let h = STEP / FINE as f64;
                let steps = [2.0 * (u - x[0]), 0.5 * (u - x[1])];
                x = [0, 1].map(|i| x[i] + h * steps[i] + Q * h.sqrt() * random.gauss());
            }
        }
        let record = Experiment::new(&WrongWay, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
        let record = record.hold(Hold::Zero).initial(Lags { x: fixed(0.0), z: fixed(0.0) });
        let start = Inverse { a: free(1.5), b: free(0.7), q: free(0.3).log(), r: free(0.1).log() };
        let found = Fit::new(&WrongWay, &record).parameters(start).predictor(Kalman).run().unwrap();
        assert!(found.severity() < Severity::NotUsable, "{seed}: {found}");
    }
}
