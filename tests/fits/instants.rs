//! Several measurements at one instant.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Amount { a: "mol/l" } }
signals! { pub struct Twice { a: "mol/l", b: "mol/l" } }
signals! { pub struct Rate { k: "l/(mol min)" } }

/// A reaction of second order, `da/dt = -k a^2`.
#[derive(Clone)]
struct Second;

impl Model for Second {
    type State = Amount;
    type Input = Nothing;
    type Output = Amount;
    type Parameters = Rate;
    fn derivative<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Nothing, p: &Rate<S>) -> Amount<S> {
        Amount { a: -p.k * x.a.powi(2) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Nothing, _p: &Rate<S>) -> Amount<S> {
        *x
    }
}

/// The same, seen by a second sensor, too.
#[derive(Clone)]
struct SeenTwice;

impl Model for SeenTwice {
    type State = Amount;
    type Input = Nothing;
    type Output = Twice;
    type Parameters = Rate;
    fn derivative<S: Scalar>(&self, t: S, x: &Amount<S>, u: &Nothing, p: &Rate<S>) -> Amount<S> {
        Second.derivative(t, x, u, p)
    }
    fn output<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Nothing, _p: &Rate<S>) -> Twice<S> {
        Twice { a: x.a, b: x.a }
    }
}

/// One step of Euler's method per sample.
#[derive(Clone)]
struct Stepped;

impl Model for Stepped {
    type State = Amount;
    type Input = Nothing;
    type Output = Amount;
    type Parameters = Rate;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Nothing, p: &Rate<S>) -> Amount<S> {
        Amount { a: x.a - p.k * x.a.powi(2) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Nothing, _p: &Rate<S>) -> Amount<S> {
        *x
    }
}

/// Seven measurements from the field, two of them at the begin.
const TIMES: [f64; 7] = [0.0, 0.0, 10.0, 26.0, 44.0, 70.0, 120.0];
const AMOUNTS: [f64; 7] = [0.054, 0.054, 0.044, 0.034, 0.027, 0.02, 0.014];

fn measured<M: Model<Input = Nothing, Output = Amount>>(model: &M) -> ExperimentOf<M> {
    let outputs = AMOUNTS.map(|a| Amount { a }).to_vec();
    Experiment::new(model, Time::Stamps(TIMES.to_vec()), vec![Nothing; 7], outputs).unwrap()
}

/// The values of a nonlinear regression of the closed form `a(0) / (1 + k a(0) t)`, to their digits, by methods of fixed steps and by those
/// that choose them.
#[test]
fn two_measurements_at_the_begin() {
    let record = measured(&Second);
    let fit = || Fit::new(&Second, &record).parameters(Rate { k: free(1.0) });
    for fit in [fit(), fit().integrator(Rk45::default()), fit().integrator(Esdirk::default())] {
        let found = fit.run().unwrap();
        let (k, initial) = (&found.unknowns[0], &found.unknowns[1]);
        assert!((k.value - 0.43128).abs() < 5e-5 && (initial.value - 0.054098).abs() < 5e-6, "{found}");
        let errors = [k, initial].map(|unknown| unknown.knowledge.standard_error().unwrap());
        assert!((errors[0] - 0.006124).abs() < 5e-6 && (errors[1] - 2.277e-4).abs() < 5e-7, "{found}");
        assert_eq!(found.severity(), Severity::Usable, "{found}");
    }
}

/// The sum of squares of two measurements of an instant is that of their mean, twice, and a constant.
#[test]
fn two_measurements_are_their_mean_with_a_weight_of_two() {
    let mut noise = Noise(3);
    let exact = |t: f64| 0.06 / (1.0 + 0.5 * 0.06 * t);
    let instants: Vec<f64> = (0..20).map(|k| 5.0 * f64::from(k)).collect();
    let pairs: Vec<[f64; 2]> = instants.iter().map(|t| [0; 2].map(|_| exact(*t) + 1e-3 * noise.gauss())).collect();
    let experiment = |times: Vec<f64>, amounts: Vec<f64>| {
        let (inputs, outputs) = (vec![Nothing; times.len()], amounts.into_iter().map(|a| Amount { a }).collect());
        Experiment::new(&Second, Time::Stamps(times), inputs, outputs).unwrap()
    };
    let each = experiment(instants.iter().flat_map(|t| [*t; 2]).collect(), pairs.concat());
    let means = experiment(instants, pairs.iter().map(|pair| 0.5 * (pair[0] + pair[1])).collect());
    let values = |record: &ExperimentOf<Second>| {
        let fit = Fit::new(&Second, record).parameters(Rate { k: free(1.0) }).noise(Amount { a: 1e-3 });
        let found = fit.integrator(Rk4 { substeps: 4 }).run().unwrap();
        (found.unknowns[0].value, found.unknowns[0].knowledge.standard_error().unwrap())
    };
    let (each, means) = (values(&each), values(&means));
    // To the tolerance of the search; two measurements tell as much as one with the root of a half of its noise.
    assert!((each.0 / means.0 - 1.0).abs() < 1e-6, "{each:?} {means:?}");
    assert!((each.1 / means.1 - 0.5f64.sqrt()).abs() < 1e-4, "{each:?} {means:?}");
}

/// An output that was measured once, or at one instant, does not stand still.
#[test]
fn an_output_of_one_instant_is_not_constant() {
    for several in [false, true] {
        let rows =
            (0..7).map(|k| Twice { a: AMOUNTS[k], b: if k == 0 || several && k == 1 { 0.0543 } else { f64::NAN } });
        let (time, inputs) = (Time::Stamps(TIMES.to_vec()), vec![Nothing; 7]);
        let record = Experiment::new(&SeenTwice, time, inputs, rows.collect()).unwrap();
        let fit = Fit::new(&SeenTwice, &record).parameters(Rate { k: free(1.0) });
        let found = fit.noise(Twice { a: 5e-4, b: 5e-4 }).run().unwrap();
        assert!(found.warnings.iter().all(|warning| warning.code != WarningCode::ConstantOutput), "{found}");
        assert_eq!(found.severity(), Severity::Usable, "{found}");
    }
}

/// A discrete model would step between the two.
#[test]
fn a_discrete_model_steps_between_instants_only() {
    let record = measured(&Stepped);
    let error = Fit::new(&Stepped, &record).parameters(Rate { k: free(1.0) }).run().unwrap_err();
    assert!(error.to_string().contains("samples 0 and 1 are at one instant"), "{error}");
}
