//! Physics that a simulated model lacks, while its errors look white.

use crate::common::{Noise, levels};
use greybox::*;

signals! { pub struct Speed { w: "rad/s" } }
signals! { pub struct Torque { u: "N m" } }
signals! { pub struct Shaft { j: "kg m^2", b: "N m s/rad" } }

/// `j dw/dt = u - b w`.
#[derive(Clone)]
struct Motor;

impl Model for Motor {
    type State = Speed;
    type Input = Torque;
    type Output = Speed;
    type Parameters = Shaft;

    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Torque<S>, p: &Shaft<S>) -> Speed<S> {
        Speed { w: (u.u - p.b * x.w) / p.j }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Torque<S>, _p: &Shaft<S>) -> Speed<S> {
        *x
    }
}

const SAMPLES: usize = 500;
const STEP: f64 = 0.02;
const FINE: usize = 20;
const RECORDS: u64 = 20;

/// A record with a friction torque `lacks(w)` beside `0.3 dw/dt = u - 0.4 w`, by Euler's steps of a twentieth of a sample, and noise that grows with the
/// speed by `grows`.
fn record(seed: u64, noise: f64, grows: f64, lacks: fn(f64) -> f64) -> ExperimentOf<Motor> {
    let mut random = Noise(seed);
    let torque: Vec<f64> = levels(SAMPLES, 25, seed + 1_000).iter().map(|level| 4.0 * level).collect();
    let mut w = 0.0;
    let outputs = torque.iter().map(|u| {
        let measured = w + noise * (1.0 + grows * f64::abs(w)) * random.gauss();
        for _ in 0..FINE {
            w += STEP / FINE as f64 * (u - 0.4 * w - lacks(w)) / 0.3;
        }
        Speed { w: measured }
    });
    let (outputs, inputs): (Vec<_>, Vec<_>) = (outputs.collect(), torque.iter().map(|&u| Torque { u }).collect());
    let made = Experiment::new(&Motor, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    made.initial(Speed { w: fixed(0.0) })
}

/// How many fits of records with such a friction are usable, and how many are told of a missing term of the speed.
fn said(noise: f64, grows: f64, lacks: fn(f64) -> f64) -> (u64, u64) {
    let (mut usable, mut told) = (0, 0);
    for seed in 1..=RECORDS {
        let record = record(seed, noise, grows, lacks);
        let found = Fit::new(&Motor, &record).parameters(Shaft { j: free(0.5), b: free(0.5) }).run().unwrap();
        usable += u64::from(found.severity() == Severity::Usable);
        let told_of =
            |warning: &&Warning| warning.code == WarningCode::MissingTerm && warning.text.contains("equation of `w`");
        told += u64::from(found.warnings.iter().any(|warning| told_of(&warning)));
    }
    (usable, told)
}

/// A dry friction of 0.06 N m or a quadratic drag, with which the errors look white, is told of in half of the records or more, and a fourth at the
/// most is usable: where the deviance falls by less than 14, the level of one in a thousand for eleven terms, other tests may see it, or none. Right models
/// are told nothing, also where noise grows with the speed.
#[test]
fn a_simulation_is_told_of_a_term() {
    assert_eq!(said(0.1, 0.0, |_| 0.0), (RECORDS, 0));
    assert_eq!(said(0.05, 1.0, |_| 0.0).1, 0);
    for (noise, lacks) in [(0.1, (|w| 0.06 * (w / 0.02).tanh()) as fn(f64) -> f64), (0.15, |w| 0.02 * w * w.abs())] {
        let (usable, told) = said(noise, 0.0, lacks);
        assert!(told >= RECORDS / 2 && usable <= RECORDS / 4, "{usable} {told}");
    }
}
