//! Fits through the adaptive integrators, and of a model without generic equations.

use approx::assert_relative_eq;
use greybox::*;

signals! { pub struct Source { u: "V" } }
signals! { pub struct Circuit { i: "A", stray: "A" } }
signals! { pub struct Measured { i: "A" } }
signals! { pub struct Coil { r: "ohm", l: "H" } }

/// A coil with a stray branch whose time constant (10 ns) is far below the sample time (1 ms).
struct Stiff;

fn currents<S: Scalar>(x: &Circuit<S>, u: &Source<S>, p: &Coil<S>) -> Circuit<S> {
    Circuit { i: (u.u - p.r * (x.i + x.stray)) / p.l, stray: (u.u - x.stray * 100.0) / 1e-6 }
}

impl Model for Stiff {
    type State = Circuit;
    type Input = Source;
    type Output = Measured;
    type Parameters = Coil;
    fn derivative<S: Scalar>(&self, _t: S, x: &Circuit<S>, u: &Source<S>, p: &Coil<S>) -> Circuit<S> {
        currents(x, u, p)
    }
    fn output<S: Scalar>(&self, _t: S, x: &Circuit<S>, _u: &Source<S>, _p: &Coil<S>) -> Measured<S> {
        Measured { i: x.i }
    }
}

/// The stray current follows at once: `i' = (u - r (i + u / 100)) / l`, exactly from sample to sample.
fn record<M: Model<State = Circuit, Input = Source, Output = Measured>>(model: &M, r: f64, l: f64) -> ExperimentOf<M> {
    let (h, samples) = (1e-3, 300);
    let u = |k: usize| if k % 18 < 9 { 1.0 } else { -0.4 };
    let mut i = 0.0;
    let mut outputs = Vec::new();
    for k in 0..samples {
        outputs.push(Measured { i });
        let settled = u(k) * (1.0 / r - 0.01);
        i = settled + (i - settled) * (-h * r / l).exp();
    }
    let inputs = (0..samples).map(|k| Source { u: u(k) }).collect();
    Experiment::new(model, Time::Uniform { start: 0.0, step: h }, inputs, outputs)
        .unwrap()
        .initial(Circuit { i: fixed(0.0), stray: fixed(0.01) })
}

#[test]
fn a_stiff_model_is_fitted() {
    let estimate = Fit::new(&Stiff, &record(&Stiff, 0.7, 5e-3))
        .parameters(Coil { r: free(1.0), l: free(3e-3) })
        .integrator(Esdirk::default())
        .run()
        .unwrap();
    println!("{estimate}");
    // The jumps of the stray current, some 10 ns long, are no part of the reference: 1e-8 s of 5e-3 s.
    assert_relative_eq!(estimate.parameters.r, 0.7, max_relative = 1e-5);
    assert_relative_eq!(estimate.parameters.l, 5e-3, max_relative = 1e-5);
}

#[test]
fn a_numeric_model_is_fitted() {
    let model = Numeric::<Circuit, Source, Measured, Coil>::continuous(
        |_t, x, u, p| Circuit { stray: 0.0, ..currents(&Circuit { stray: u.u / 100.0, ..*x }, u, p) },
        |_t, x, _u, _p| Measured { i: x.i },
    );
    let estimate = Fit::new(&model, &record(&model, 0.7, 5e-3))
        .parameters(Coil { r: free(1.0), l: free(3e-3) })
        .integrator(Rk45::default())
        .run()
        .unwrap();
    println!("{estimate}");
    assert_relative_eq!(estimate.parameters.r, 0.7, max_relative = 1e-7);
    assert_relative_eq!(estimate.parameters.l, 5e-3, max_relative = 1e-7);
}

signals! { pub struct Growth { rate: "1/(A s)" } }

/// `i' = rate i^2`, which is infinite at `1 / (rate i(0))`.
struct Explosive;

impl Model for Explosive {
    type State = Measured;
    type Input = Source;
    type Output = Measured;
    type Parameters = Growth;
    fn derivative<S: Scalar>(&self, _t: S, x: &Measured<S>, _u: &Source<S>, p: &Growth<S>) -> Measured<S> {
        Measured { i: p.rate * x.i * x.i }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Measured<S>, _u: &Source<S>, _p: &Growth<S>) -> Measured<S> {
        *x
    }
}

/// A prediction that an adaptive integrator cannot bring to its end is an error that says when.
#[test]
fn a_prediction_that_ends_early_is_refused() {
    let record = |start: f64| {
        let time = Time::Uniform { start: 0.0, step: 0.01 };
        let outputs = (0..50).map(|k| Measured { i: 0.1 / (1.0 - 0.1 * 0.01 * f64::from(k)) }).collect();
        let record = Experiment::new(&Explosive, time, vec![Source { u: 0.0 }; 50], outputs).unwrap();
        record.initial(Measured { i: fixed(start) })
    };
    let (near, far) = (record(0.1), record(5.0));
    let fit = |record| Fit::new(&Explosive, record).parameters(Growth { rate: free(1.1) }).integrator(Rk45::default());
    let estimate = fit(&near).run().unwrap();
    assert_relative_eq!(estimate.parameters.rate, 1.0, max_relative = 1e-6);
    let Err(Error::Simulation(failure)) = fit(&far).predict(&estimate, &far) else { panic!("a prediction") };
    // Infinite at 0.2 s.
    assert!((19..=21).contains(&failure.sample), "{failure:?}");
}
