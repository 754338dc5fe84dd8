//! Plants that oscillate faster than the samples show.

use crate::records::*;
use greybox::estimate::WarningCode;
use greybox::optimize::Severity;
use greybox::pmsm::Surface;
use greybox::{Model, Parameter, Scalar, signals};

signals! { pub struct Car { xs: "m", vs: "m/s", xu: "m", vu: "m/s" } }
signals! { pub struct Road { z: "m" } }
signals! { pub struct Heights { xs: "m", xu: "m" } }
signals! { pub struct Suspension { ks: "N/m", cs: "N s/m", kt: "N/m", mu: "kg" } }

/// A quarter of a car of 300 kg: the wheel oscillates at 65 rad/s.
struct QuarterCar;

impl Model for QuarterCar {
    type State = Car;
    type Input = Road;
    type Output = Heights;
    type Parameters = Suspension;
    fn derivative<S: Scalar>(&self, _t: S, x: &Car<S>, u: &Road<S>, p: &Suspension<S>) -> Car<S> {
        let force = p.ks * (x.xu - x.xs) + p.cs * (x.vu - x.vs);
        Car { xs: x.vs, vs: force / 300.0, xu: x.vu, vu: (p.kt * (u.z - x.xu) - force) / p.mu }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Car<S>, _u: &Road<S>, _p: &Suspension<S>) -> Heights<S> {
        Heights { xs: x.xs, xu: x.xu }
    }
}

fn car(step: f64) -> Bench<QuarterCar> {
    bench(QuarterCar, &[16000.0, 1000.0, 160_000.0, 40.0], step, &[(0.0, 0.05, 13)], &[0.0; 4])
}

fn judged(step: f64, how: &How, seed: u64) -> Found {
    let car = car(step);
    car.fit(&car.record(seed, 400).noisy(0.02, 0.0, seed), how, seed)
}

/// At 20 samples a second the wheel is beyond half the frequency of sampling, and has a second minimum on the other side:
/// 31 of 200 starts end there, as these three do, 8 to 10 standard errors off.
#[test]
fn an_oscillation_beyond_half_the_frequency_of_sampling_is_named() {
    for seed in [14, 15, 19] {
        let found = judged(0.05, &How::default(), seed);
        assert!(found.errors > 5.0, "seed {seed}: {}", found.text);
        assert_eq!(found.severity, Severity::UsableWithCare, "{}", found.text);
        assert_eq!(found.codes, [WarningCode::Aliased], "{}", found.text);
        assert!(found.text.contains("take 2.1 a period"), "{}", found.text);
    }
}

/// Starts on both sides find both minima: the better one, or that the data do not tell them apart.
#[test]
fn searches_on_both_sides_find_the_other_oscillation() {
    for seed in [14, 15, 19] {
        let found = judged(0.05, &How { starts: 10, ..How::default() }, seed);
        let told = found.codes == [WarningCode::RivalMinimum];
        assert!(told || found.severity == Severity::Usable && found.errors < 4.0, "seed {seed}: {}", found.text);
    }
}

/// Bounds that leave one of the two frequencies only: `sqrt(kt/mu)` changes by less than the 7 % between them.
#[test]
fn bounds_decide_between_two_oscillations() {
    fn near(i: usize, parameter: Parameter) -> Parameter {
        let truth = [16000.0, 1000.0, 160_000.0, 40.0][i];
        Parameter { start: truth, ..parameter }.within(0.97 * truth, 1.03 * truth)
    }
    let found = judged(0.05, &How { declare: Some(near), ..How::default() }, 14);
    assert_eq!(found.severity, Severity::Usable, "{}", found.text);
    assert!(found.errors < 4.0, "{}", found.text);
}

/// 3.2 samples a period are enough, and so are fewer of a frequency that the measured speed alone decides: currents in the rotor
/// frame turn by more than half a turn from sample to sample.
#[test]
fn frequencies_that_are_known_are_not_named() {
    let found = judged(0.03, &How::default(), 14);
    assert_eq!(found.severity, Severity::Usable, "{}", found.text);
    let model = Surface::new(4).unwrap();
    let motor = bench(model, &[0.6, 4e-3, 0.8], 1e-3, &[(0.0, 5.0, 7), (0.0, 60.0, 9), (900.0, 30.0, 50)], &[0.0, 0.0]);
    let found = motor.fit(&motor.record(1, 400).noisy(0.01, 0.0, 1), &How::default(), 1);
    assert_eq!(found.severity, Severity::Usable, "{}", found.text);
}
