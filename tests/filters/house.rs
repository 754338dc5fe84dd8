//! A house with a sensor of a minute in the air, sampled each quarter of an hour.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Rooms { ti: "K", te: "K", th: "K", ts: "K" } }
signals! { pub struct Weather { ta: "K", heat: "kW" } }
signals! { pub struct Thermometer { y: "K" } }
signals! {
    pub struct Thermal { sensor: "s", heater: "s", air: "s", envelope: "s", outside: "s", gain: "K/(kW s)", q: "K/s^0.5", r: "K" }
}

pub const TRUTH: Thermal =
    Thermal { sensor: 60.0, heater: 700.0, air: 3600.0, envelope: 4e4, outside: 1e5, gain: 3e-3, q: 4e-3, r: 0.03 };
/// A quarter of an hour (s).
pub const QUARTER: f64 = 900.0;

#[derive(Clone)]
pub struct House;

impl Model for House {
    type State = Rooms;
    type Input = Weather;
    type Output = Thermometer;
    type Parameters = Thermal;
    fn derivative<S: Scalar>(&self, _t: S, x: &Rooms<S>, u: &Weather<S>, p: &Thermal<S>) -> Rooms<S> {
        Rooms {
            ti: (x.te - x.ti) / p.air + (x.th - x.ti) / p.heater,
            te: (x.ti - x.te) / p.envelope + (u.ta - x.te) / p.outside,
            th: (x.ti - x.th) / p.heater + p.gain * u.heat,
            ts: (x.ti - x.ts) / p.sensor,
        }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Rooms<S>, _u: &Weather<S>, _p: &Thermal<S>) -> Thermometer<S> {
        Thermometer { y: x.ts }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Rooms<S>, _u: &Weather<S>, p: &Thermal<S>) -> Rooms<S> {
        Rooms { ti: p.q, te: p.q * 0.3, th: S::from(0.0), ts: S::from(0.0) }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Rooms<S>, _u: &Weather<S>, p: &Thermal<S>) -> Thermometer<S> {
        Thermometer { y: p.r }
    }
}

/// By Euler's steps of 15 s.
pub fn record(stamps: Vec<f64>) -> ExperimentOf<House> {
    const STEP: f64 = 15.0;
    let (mut noise, mut x, mut t) = (Noise(11), [20.0, 15.0, 20.0, 20.0], stamps[0]);
    let p = &TRUTH;
    let (mut inputs, mut outputs) = (vec![], vec![]);
    for (k, stamp) in stamps.iter().enumerate() {
        let day = (stamp / 86_400.0 * core::f64::consts::TAU).sin();
        let u = Weather {
            ta: 5.0 + 4.0 * day,
            heat: if ((stamp / 14_400.0) as u64).is_multiple_of(3) { 4.0 } else { 0.5 },
        };
        outputs.push(Thermometer { y: x[3] + p.r * noise.gauss() });
        let end = stamps.get(k + 1).copied().unwrap_or(*stamp);
        while t < end {
            let h = STEP.min(end - t);
            let rate = House.derivative(t, &Rooms { ti: x[0], te: x[1], th: x[2], ts: x[3] }, &u, p);
            let (a, b) = (p.q * h.sqrt() * noise.gauss(), 0.3 * p.q * h.sqrt() * noise.gauss());
            x = [x[0] + h * rate.ti + a, x[1] + h * rate.te + b, x[2] + h * rate.th, x[3] + h * rate.ts];
            t += h;
        }
        inputs.push(u);
    }
    Experiment::new(&House, Time::from_stamps(stamps), inputs, outputs).unwrap()
}

pub fn start() -> Thermal<Parameter> {
    let near = |truth: f64, factor: f64| free(truth * factor).log();
    Thermal {
        sensor: fixed(60.0),
        heater: near(TRUTH.heater, 1.3),
        air: near(TRUTH.air, 0.8),
        envelope: near(TRUTH.envelope, 1.2),
        outside: near(TRUTH.outside, 0.9),
        gain: near(TRUTH.gain, 1.1),
        q: near(TRUTH.q, 2.0),
        r: near(TRUTH.r, 1.5),
    }
}
