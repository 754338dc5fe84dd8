//! Plants that oscillate faster than the samples show.

use crate::records::*;
use approx::assert_relative_eq;
use greybox::estimate::WarningCode;
use greybox::optimize::{LevenbergMarquardt, OwnSize, Stop};
use greybox::pmsm::Surface;
use greybox::{Estimate, Fit, Fleet, Model, Parameter, Scalar, Severity, free, signals};

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

/// What is said has no line breaks here.
fn judged(step: f64, how: &How, seed: u64) -> Found {
    let car = car(step);
    let found = car.fit(&car.record(seed, 400).noisy(0.02, 0.0, seed), how, seed);
    Found { text: found.text.split_whitespace().collect::<Vec<_>>().join(" "), ..found }
}

/// At 20 samples a second the wheel is beyond half the frequency of sampling, and has a second minimum on the other side: of 200
/// starts 31 end there, as these do without a search from the other side, 6 to 10 standard errors off. That search finds the
/// better of the two (seeds 3 and 19), or that the data do not tell them apart.
#[test]
fn the_other_side_of_half_the_frequency_of_sampling_is_searched() {
    for seed in [0, 3, 9, 14, 15, 19, 54] {
        let found = judged(0.05, &How::default(), seed);
        let told = found.codes.contains(&WarningCode::Aliased) && found.text.contains("bounds or a prior must tell");
        assert_eq!(told, ![3, 19].contains(&seed), "seed {seed}: {}", found.text);
        assert!(told || found.severity == Severity::Usable && found.errors < 4.0, "seed {seed}: {}", found.text);
    }
}

/// At 1.24 and 1.5 times half the frequency of sampling the other minimum is far worse: the fit is usable, and says so.
#[test]
fn an_oscillation_far_beyond_is_usable() {
    for (step, seed) in [(0.06, 0), (0.06, 1), (0.0725, 0), (0.0725, 1)] {
        let found = judged(step, &How::default(), seed);
        assert_eq!(found.severity, Severity::Usable, "{}", found.text);
        assert!(found.errors < 4.0 && found.text.contains("in -2 ln of the"), "{}", found.text);
    }
}

/// Searches that the limit of trial steps stops before their end tell nothing for certain.
#[test]
fn a_limit_leaves_the_question_open() {
    let car = car(0.06);
    let record = car.experiment(&car.record(0, 400).noisy(0.02, 0.0, 0));
    let parameters = Suspension { ks: free(15_000.0), cs: free(1100.0), kt: free(150_000.0), mu: free(45.0) };
    let limited = |iterations: u64| {
        let optimizer = LevenbergMarquardt::new(Stop { iterations, ..Stop::default() }, OwnSize);
        Fit::new(&car.model, &record).parameters(parameters).optimizer(optimizer).run().unwrap()
    };
    let free = limited(1000);
    assert_eq!(free.severity(), Severity::Usable, "{free}");
    let least = (1..100).find(|&iterations| limited(iterations).outcome.converged()).unwrap();
    for (more, words) in [(0, "no search was started there"), (1, "limits of the fit stopped searches")] {
        let found = limited(least + more);
        let warning = found.warnings.iter().find(|warning| warning.code == WarningCode::Aliased).unwrap();
        assert!(warning.text.contains(words) && warning.severity == Severity::UsableWithCare, "{more}: {found}");
        assert!(found.outcome.converged() && found.iterations < free.iterations, "{found}");
    }
}

/// The fits of a fleet search there, too.
#[test]
fn fleets_search_the_other_side() {
    let car = car(0.05);
    let records = [3, 14].map(|seed| car.experiment(&car.record(seed, 400).noisy(0.02, 0.0, seed)));
    let parameters = Suspension { ks: free(15_000.0), cs: free(1100.0), kt: free(150_000.0), mu: free(45.0) };
    let fleet = Fleet::new(&car.model).parameters(parameters).fleet().unwrap();
    for (together, record) in fleet.run(records.clone()).zip(&records) {
        let (together, alone) = (together.unwrap(), Fit::new(&car.model, record).parameters(parameters).run().unwrap());
        let texts = |fit: &Estimate<QuarterCar>| {
            let texts = fit.warnings.iter().filter(|warning| warning.code == WarningCode::Aliased);
            texts.map(|warning| warning.text.clone()).collect::<Vec<_>>()
        };
        assert!(texts(&alone).len() == 1 && texts(&alone)[0].contains("rad/s"), "{alone}");
        assert_eq!(texts(&together), texts(&alone));
        // Lanes add in another order.
        assert_relative_eq!(together.parameters.mu, alone.parameters.mu, max_relative = 1e-6);
    }
}

/// Starts on both sides find both minima: the better one, or that the data do not tell them apart.
#[test]
fn searches_on_both_sides_find_the_other_oscillation() {
    for seed in [14, 15, 19] {
        let found = judged(0.05, &How { starts: 10, ..How::default() }, seed);
        let told = found.codes.contains(&WarningCode::RivalMinimum) && found.severity == Severity::UsableWithCare;
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
