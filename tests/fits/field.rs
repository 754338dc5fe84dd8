//! Default fits of records from the field, whose search has to find the right minimum by itself.

use crate::common::Noise;
use crate::shared::shared;
use greybox::*;

signals! { pub struct Sugars { x: "g", f: "g" } }
signals! { pub struct Rates { a: "1/min", b: "1/min", c: "1/min" } }

/// Xylose that reacts to furfural, and to something else.
#[derive(Clone)]
struct Xylose;

impl Model for Xylose {
    type State = Sugars;
    type Input = Nothing;
    type Output = Sugars;
    type Parameters = Rates;
    fn derivative<S: Scalar>(&self, _t: S, x: &Sugars<S>, _u: &Nothing, p: &Rates<S>) -> Sugars<S> {
        Sugars { x: -p.a * x.x - p.b * x.x, f: p.a * x.x - p.c * x.f }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Sugars<S>, _u: &Nothing, _p: &Rates<S>) -> Sugars<S> {
        *x
    }
}

/// From rates of 1, with which Runge-Kutta's method is unstable up to 16 steps per sample, and where it has a minimum of its own at
/// 0.042 and 0.286. The values are those of SciPy's regression by an implicit method, to their digits.
#[test]
fn rates_a_hundred_times_too_large() {
    let times = vec![0.0, 1.0, 5.0, 10.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0];
    let x = [182.115, 166.486, 136.178, 112.277, 111.448, 81.5446, 73.6962, 62.9892, 50.7161, 45.2139];
    let f = [0.0, 1.87153, 9.76618, 19.1688, 27.2978, 43.3609, 56.2542, 62.6874, 68.5274, 79.0054];
    let outputs = x.into_iter().zip(f).map(|(x, f)| Sugars { x, f }).collect();
    let record = Experiment::new(&Xylose, Time::Stamps(times), vec![Nothing; 10], outputs).unwrap();
    let record = record.initial(Sugars { x: fixed(182.115), f: fixed(0.0) });
    let parameters = Rates { a: free(1.0), b: free(1.0), c: free(1.0) };
    let found = Fit::new(&Xylose, &record).parameters(parameters).run().unwrap();
    let Rates { a, b, .. } = found.parameters;
    assert!((a - 0.01235).abs() < 1e-5 && (b - 0.01524).abs() < 1e-5, "{found}");
    assert!(found.severity() < Severity::NotUsable, "{found}");
}

signals! { pub struct Crane { x: "m", th: "rad", v: "m/s", om: "rad/s" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Seen { x: "m", th: "rad" } }
signals! { pub struct Masses { mc: "kg", mp: "kg", l: "m", b: "N s/m", cd: "1/s" } }

/// A cart with a pendulum.
#[derive(Clone)]
struct Cart;

impl Model for Cart {
    type State = Crane;
    type Input = Force;
    type Output = Seen;
    type Parameters = Masses;
    fn derivative<S: Scalar>(&self, _t: S, x: &Crane<S>, u: &Force<S>, p: &Masses<S>) -> Crane<S> {
        let (sin, cos) = (x.th.sin(), x.th.cos());
        let pull = p.mp * sin * (p.l * x.om * x.om + cos * 9.81);
        let a = (u.f - p.b * x.v + pull) / (p.mc + p.mp * sin * sin);
        Crane { x: x.v, th: x.om, v: a, om: -(a * cos + sin * 9.81) / p.l - p.cd * x.om }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Crane<S>, _u: &Force<S>, _p: &Masses<S>) -> Seen<S> {
        Seen { x: x.x, th: x.th }
    }
}

/// The first search ends where it explains the position, but not the angle; multiple shooting leads on, and 32 starts are not needed.
#[cfg(feature = "csv")]
#[test]
fn one_output_left_unexplained() {
    let Some(path) = shared("../field/good_crane_prbs_not_usable.csv") else { return };
    let record = Experiment::from_file(&Cart, path).unwrap();
    let record = record.initial(Crane { x: fixed(0.0), th: fixed(0.0), v: fixed(0.0), om: fixed(0.0) });
    let parameters = Masses { mc: free(0.7), mp: free(0.27), l: free(0.31), b: free(0.85), cd: free(0.21) };
    let found = Fit::new(&Cart, &record).parameters(parameters).run().unwrap();
    let truth = [0.958, 0.289, 0.389, 1.180, 0.176];
    for (unknown, truth) in found.unknowns.iter().zip(truth) {
        // The digits that are known of the truth, and four standard errors.
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error + 5e-4, "{found}");
    }
    assert_eq!(found.severity(), Severity::Usable, "{found}");
    let said = |warning: &Warning| warning.text.contains("by itself from the end of");
    assert!(found.starts.is_none() && found.warnings.iter().any(said), "{found}");
}

signals! { pub struct Level { x: "m" } }
signals! { pub struct Inflow { u: "m/s" } }
signals! { pub struct Outflow { k: "1/(m^2 s)" } }

/// `dx/dt = u - k x^3`: an explicit method with too long a step overflows.
#[derive(Clone)]
struct Cubic;

impl Model for Cubic {
    type State = Level;
    type Input = Inflow;
    type Output = Level;
    type Parameters = Outflow;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Inflow<S>, p: &Outflow<S>) -> Level<S> {
        Level { x: u.u - p.k * x.x.powi(3) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Inflow<S>, _p: &Outflow<S>) -> Level<S> {
        *x
    }
}

/// Of starts over five decades many cannot be simulated by one step per sample. All are searched, by finer methods.
#[test]
fn starts_that_one_step_cannot_simulate() {
    let inputs: Vec<Inflow> = (0..80).map(|k| Inflow { u: if k / 8 % 2 == 0 { 1.0 } else { 0.2 } }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.5 };
    let exact = Simulator::new(&Cubic)
        .integrator(Rk4 { substeps: 16 })
        .run(&Outflow { k: 0.5 }, &Level { x: 1.0 }, time.clone(), &inputs)
        .unwrap();
    let mut noise = Noise(5);
    let outputs = exact.outputs.iter().map(|y| Level { x: y.x + 0.01 * noise.gauss() }).collect();
    let record = Experiment::new(&Cubic, time, inputs, outputs).unwrap().initial(Level { x: fixed(1.0) });
    let parameters = Outflow { k: free(1.0).within(0.1, 1e4).log() };
    let found = Fit::new(&Cubic, &record).parameters(parameters).starts(20).run().unwrap();
    let starts = found.starts.as_ref().unwrap();
    assert!(starts.failed.iter().all(|failed| failed.evaluated), "{:?}", starts.failed);
    let error = found.unknowns[0].knowledge.standard_error().unwrap();
    assert!((found.parameters.k - 0.5).abs() < 4.0 * error, "{found}");
}
