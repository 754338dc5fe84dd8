//! A sensor so accurate that the first measurement alone determines the initial state.

use crate::common::{Noise, levels};
use greybox::estimate::CovarianceMethod;
use greybox::*;

signals! { pub struct Level { x: "V" } }
signals! { pub struct Pair { x: "V", y: "V" } }
signals! { pub struct Supply { u: "V" } }
signals! { pub struct Lag { a: "1/s", b: "1/s", q: "V" } }

/// `dx = (b u - a x) dt + q dw`, measured to a hundred-thousandth and by a second sensor to a half.
#[derive(Clone)]
struct Measured;

impl Model for Measured {
    type State = Level;
    type Input = Supply;
    type Output = Pair;
    type Parameters = Lag;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Supply<S>, p: &Lag<S>) -> Level<S> {
        Level { x: p.b * u.u - p.a * x.x }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Supply<S>, p: &Lag<S>) -> Level<S> {
        Level { x: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Supply<S>, _p: &Lag<S>) -> Pair<S> {
        Pair { x: S::from(1e-5), y: S::from(0.5) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Supply<S>, _p: &Lag<S>) -> Pair<S> {
        Pair { x: x.x, y: x.x }
    }
}

const STEP: f64 = 0.25;

/// A filter that begins with the diffusion of the first interval predicts the first measurement with the variance `q^2 (1 - exp(-2 a h)) / (2 a)`; the error is rounding.
/// With colored disturbances, with a loss and without, the standard error of the initial state is the root of that variance. Other standard errors and
/// their degrees of freedom are those with the initial state known. The second sensor is read at every tenth sample.
#[test]
fn an_initial_state_that_one_measurement_determines() {
    let (mut noise, mut x, mut before, mut sample) = (Noise(5), 1.0, 0.0, 0);
    let inputs: Vec<Supply> = levels(4_000, 20, 3).into_iter().map(|u| Supply { u }).collect();
    let mut seen = |u: &Supply| {
        let slow = if sample % 10 == 5 { x + 0.5 * noise.gauss() } else { f64::NAN };
        sample += 1;
        let (now, next) = (Pair { x, y: slow }, 0.15 * noise.gauss());
        x += STEP * (u.u - 0.4 * x) + next - 0.3 * before;
        before = next;
        now
    };
    let outputs: Vec<Pair> = inputs.iter().map(&mut seen).collect();
    let record = Experiment::new(&Measured, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let parameters = Lag { a: free(0.5).log(), b: free(0.5).log(), q: free(0.5).log() };
    for loss in [false, true] {
        let fit = |initial: Parameter| {
            let record = record.clone().initial(Level { x: initial });
            let predictor = Kalman::starting(InitialCovariance::FirstInterval);
            let fit = Fit::new(&Measured, &record).parameters(parameters).predictor(predictor);
            if loss { fit.loss(Huber(3.0)) } else { fit }.run().unwrap()
        };
        let found = fit(free(1.0));
        assert!(matches!(found.method.covariance, CovarianceMethod::Hac { .. }), "{found}");
        let [.., initial] = &found.unknowns[..] else { panic!("{found}") };
        let Lag { a, q, .. } = found.parameters;
        let expected = (q * q * (1.0 - (-2.0 * a * STEP).exp()) / (2.0 * a)).sqrt();
        // The mean square of standardized errors is 1 at the maximum of the likelihood; Huber's loss takes a percent from it.
        let error = initial.knowledge.standard_error().unwrap();
        assert!((error / expected - 1.0).abs() < 0.02, "{error} {expected}: {found}");
        let known = fit(fixed(initial.value));
        for (free, known) in found.unknowns.iter().zip(&known.unknowns) {
            let errors = [free, known].map(|one| one.knowledge.standard_error().unwrap());
            assert!((errors[0] / errors[1] - 1.0).abs() < 0.01, "{errors:?}: {found}");
            assert!((free.degrees_of_freedom / known.degrees_of_freedom - 1.0).abs() < 0.05, "{found}");
            assert!(free.degrees_of_freedom > 30.0, "{found}");
        }
    }
}
