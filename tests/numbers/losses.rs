//! Losses against their requirements and the published efficiencies; weightings against their formulas.

use approx::assert_relative_eq;
use greybox::*;
use greybox::{
    loss::{Cauchy, SoftL1, Tukey},
    weighting::{BySignal, WeightFunction},
};

fn losses() -> Vec<Box<dyn Loss>> {
    vec![
        Box::new(Huber::default()),
        Box::new(SoftL1::default()),
        Box::new(Cauchy::default()),
        Box::new(Tukey::default()),
    ]
}

#[test]
fn every_loss_meets_the_requirements() {
    for loss in losses() {
        check::loss(&*loss).unwrap_or_else(|why| panic!("{loss:?}: {why}"));
        loss.check().unwrap();
    }
}

#[test]
fn the_check_sees_a_wrong_derivative_and_a_wrong_scale() {
    #[derive(Debug)]
    struct Wrong(f64, f64);
    impl Loss for Wrong {
        fn rho(&self, z: f64) -> f64 {
            self.0 * z * z / 2.0
        }
        fn psi(&self, z: f64) -> f64 {
            self.1 * z
        }
    }
    check::loss(&Wrong(1.0, 1.0)).unwrap();
    let why = check::loss(&Wrong(2.0, 2.0)).unwrap_err().to_string();
    assert!(why.contains("z^2/2 near 0"), "{why}");
    #[derive(Debug)]
    struct Kinked;
    impl Loss for Kinked {
        fn rho(&self, z: f64) -> f64 {
            z * z / 2.0
        }
        fn psi(&self, z: f64) -> f64 {
            if z.abs() > 3.0 { 0.9 * z } else { z }
        }
    }
    let why = check::loss(&Kinked).unwrap_err().to_string();
    assert!(why.contains("psi is the derivative of rho: "), "{why}");
}

#[test]
fn known_points() {
    assert_eq!(Huber(1.5).rho(3.0), 1.5 * (3.0 - 0.75));
    assert_eq!(Huber(1.5).psi(-3.0), -1.5);
    assert_eq!(SoftL1(2.0).rho(2.0), 2.0 / (1.0 + 2f64.sqrt()) * 2.0);
    assert_relative_eq!(SoftL1(1.0).rho(1e-9), 0.5e-18, max_relative = 1e-12);
    assert_relative_eq!(Cauchy(2.0).rho(2.0), 2.0 * 2f64.ln(), max_relative = 1e-15);
    assert_relative_eq!(Tukey(3.0).rho(3.0 - 1e-9), 1.5, max_relative = 1e-15);
    assert_eq!((Tukey(3.0).rho(1e300), Tukey(3.0).psi(1e300), Tukey(3.0).weight(1e300)), (1.5, 0.0, 0.0));
}

#[test]
fn what_is_not_a_number_is_not_hidden() {
    for loss in losses() {
        assert!(loss.rho(f64::NAN).is_nan() && loss.psi(f64::NAN).is_nan(), "{loss:?}");
    }
}

#[test]
fn tuning_constants_are_checked() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let losses: [&dyn Loss; 4] = [&Huber(bad), &SoftL1(bad), &Cauchy(bad), &Tukey(bad)];
        for loss in losses {
            let why = loss.check().unwrap_err().to_string();
            assert!(why.contains(&bad.to_string()) && why.contains("must be positive"), "{why}");
        }
    }
}

#[test]
fn losses_round_trip() {
    let text = serde_json::to_string(&(Huber(1.2), SoftL1(1.1), Cauchy(2.0), Tukey(4.0))).unwrap();
    let back: (Huber, SoftL1, Cauchy, Tukey) = serde_json::from_str(&text).unwrap();
    assert_eq!(back, (Huber(1.2), SoftL1(1.1), Cauchy(2.0), Tukey(4.0)));
    assert_eq!(Huber(1.345).describe(), "Huber(1.345)");
}

signals! { pub struct Drive { u: "V", w: "rad/s" } }
signals! { pub struct Measured { i: "A" } }

struct Machine;
impl Model for Machine {
    type State = Nothing;
    type Input = Drive;
    type Output = Measured;
    type Parameters = Nothing;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, _p: &Nothing) -> Measured<S> {
        Measured { i: u.u }
    }
}

fn at(w: f64) -> Sample<Machine> {
    Sample { t: 0.0, u: Drive { u: 1.0, w }, y: Measured { i: 1.0 } }
}

fn weight(weighting: impl Weighting<Machine>, w: f64) -> f64 {
    weighting.weight(&at(w))
}

#[test]
fn weightings() {
    assert_eq!(weight(|s: &Sample<Machine>| s.u.w.abs(), -3.0), 3.0);
    assert_eq!(weight(BySignal::new("w", WeightFunction::Absolute), -3.0), 3.0);
    assert_eq!(weight(BySignal::new("w", WeightFunction::Square { scale: 100.0 }), -50.0), 0.25);
    let above = || BySignal::new("w", WeightFunction::Above { threshold: 20.0 });
    assert_eq!((weight(above(), -20.0), weight(above(), 19.9)), (1.0, 0.0));
    assert!(weight(above(), f64::NAN).is_nan());
}

#[test]
fn a_weighting_by_signal_is_checked() {
    let check = |weighting: BySignal| Weighting::<Machine>::check(&weighting).map_err(|why| why.to_string());
    check(BySignal::new("w", WeightFunction::Absolute)).unwrap();
    let why = check(BySignal::new("speed", WeightFunction::Absolute)).unwrap_err();
    assert!(why.contains("`speed`") && why.contains("u, w"), "{why}");
    assert!(weight(BySignal::new("speed", WeightFunction::Above { threshold: 1.0 }), 2.0).is_nan());
    let why = check(BySignal::new("w", WeightFunction::Square { scale: 0.0 })).unwrap_err();
    assert!(why.contains("the scale of the weighting by `w` is 0"), "{why}");
    check(BySignal::new("w", WeightFunction::Above { threshold: f64::NAN })).unwrap_err();
}

#[test]
fn a_weighting_by_signal_describes_itself_and_round_trips() {
    let weighting = BySignal::new("w", WeightFunction::Square { scale: 100.0 });
    assert_eq!(Weighting::<Machine>::describe(&weighting), "(w/100)^2");
    let back: BySignal = serde_json::from_str(&serde_json::to_string(&weighting).unwrap()).unwrap();
    assert_eq!(back, weighting);
}
