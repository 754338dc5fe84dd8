//! [`Kalman`] where a measurement is far more precise than what is known before it: two sensors of one position.

use crate::common::Noise;
use argmin::core::{CostFunction, Gradient};
use core::f64::consts::{PI, TAU};
use greybox::*;

signals! { pub struct Motion { x: "m", v: "m" } }
signals! { pub struct Sensors { y: "m", z: "m" } }
signals! { pub struct Sensor { y: "m" } }
signals! { pub struct Levels { q: "m", r: "m" } }

/// `x[k+1] = x[k] + v[k] + w`, `v[k+1] = v[k] + w`, seen by two sensors of one noise.
#[derive(Clone)]
struct Twice;

/// The same, seen by one sensor.
#[derive(Clone)]
struct Once;

impl Model for Twice {
    type State = Motion;
    type Input = Nothing;
    type Output = Sensors;
    type Parameters = Levels;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Nothing, _p: &Levels<S>) -> Motion<S> {
        Motion { x: x.x + x.v, v: x.v }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Nothing, p: &Levels<S>) -> Motion<S> {
        Motion { x: p.q, v: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Nothing, p: &Levels<S>) -> Sensors<S> {
        Sensors { y: p.r, z: p.r }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Nothing, _p: &Levels<S>) -> Sensors<S> {
        Sensors { y: x.x, z: x.x }
    }
}

impl Model for Once {
    type State = Motion;
    type Input = Nothing;
    type Output = Sensor;
    type Parameters = Levels;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Nothing, p: &Levels<S>) -> Motion<S> {
        Twice.next(t, x, u, p)
    }
    fn diffusion<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Nothing, p: &Levels<S>) -> Motion<S> {
        Twice.diffusion(t, x, u, p)
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Nothing, p: &Levels<S>) -> Sensor<S> {
        Sensor { y: p.r }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Nothing, _p: &Levels<S>) -> Sensor<S> {
        Sensor { y: x.x }
    }
}

const SAMPLES: usize = 12;

/// `-ln` of the likelihood and its gradient by the logarithms of the levels.
fn likelihood<M: Model<State = Motion, Parameters = Levels> + Clone>(
    model: &M,
    record: ExperimentOf<M>,
    [q, r]: [f64; 2],
) -> (f64, Vec<f64>) {
    let measured = SAMPLES * M::Output::LEN;
    let record = record.initial(Motion { x: fixed(0.0), v: fixed(0.0) });
    let levels = Levels { q: free(1.0).log(), r: free(1.0).log() };
    let problem = Fit::new(model, &record).parameters(levels).predictor(Kalman).problem().unwrap();
    let (objective, at) = (problem.objective().unwrap(), vec![f64::ln(q), f64::ln(r)]);
    let cost = objective.cost(&at).unwrap() + 0.5 * measured as f64 * TAU.ln();
    (cost, objective.gradient(&at).unwrap())
}

/// Mean and difference of the two are independent: the likelihood is that of one sensor of the mean, with `r / sqrt(2)`, times that of the differences,
/// whose variance is `2 r^2`. The second sensor is taken in where the first one has reduced a variance by up to 1e16, as a difference of two
/// numbers; what is left of it is right, to the 1e-16 by which positions are rounded, in units of the noise.
#[test]
fn two_sensors_of_one_position_are_one_of_their_mean() {
    for r in [1.0, 1e-2, 1e-4, 1e-6, 1e-7, 1e-8] {
        for q in [1.0, 1e-8] {
            let mut random = Noise(11);
            let (mut x, mut v, mut sensors) = (0.0, 0.0, vec![]);
            for _ in 0..SAMPLES {
                sensors.push(Sensors { y: x + r * random.gauss(), z: x + r * random.gauss() });
                (x, v) = (x + v + q * random.gauss(), v + q * random.gauss());
            }
            let means = sensors.iter().map(|both| Sensor { y: 0.5 * (both.y + both.z) }).collect();
            let squares = sensors.iter().map(|both| (both.y - both.z).powi(2)).sum::<f64>() / (4.0 * r * r);
            let count = SAMPLES as f64;
            let differences = squares + 0.5 * count * (4.0 * PI * r * r).ln();
            let (time, inputs) = (|| Time::Uniform { start: 0.0, step: 1.0 }, || vec![Nothing; SAMPLES]);
            let twice = Experiment::new(&Twice, time(), inputs(), sensors).unwrap();
            let once = Experiment::new(&Once, time(), inputs(), means).unwrap();
            let (found, slopes) = likelihood(&Twice, twice, [q, r]);
            let (mean, of_mean) = likelihood(&Once, once, [q, r / 2f64.sqrt()]);
            // Of positions of up to 100 q or r.
            let digits = 1e-12 + 1e-14 * q.max(r) / r;
            println!("{q} {r}: {found} {}", mean + differences);
            assert!((found - mean - differences).abs() < digits * count, "{q} {r}: {found} {}", mean + differences);
            let exact = [of_mean[0], of_mean[1] - 2.0 * squares + count];
            for (found, exact) in slopes.iter().zip(exact) {
                assert!((found - exact).abs() < digits * count, "{q} {r}: {found} {exact}");
            }
        }
    }
}
