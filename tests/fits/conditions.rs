#![cfg(feature = "std")]
//! Parameters that stand in conditions of a model.

use crate::common::*;
use greybox::*;

signals! { pub struct Delayed { gain: "A/V", tau: "s", theta: "s" } }

/// `tau di/dt = gain u - i` with a step of `u` from 0 to 1 V at the time `theta`, or at none.
#[derive(Clone)]
struct Switched;

/// The same by an `if` among values, which is not read as a graph.
#[derive(Clone)]
struct SwitchedByValue;

impl Model for Switched {
    type State = Current;
    type Input = Nothing;
    type Output = Current;
    type Parameters = Delayed;

    fn derivative<S: Scalar>(&self, t: S, x: &Current<S>, _u: &Nothing, p: &Delayed<S>) -> Current<S> {
        let u = if t >= p.theta { S::from(1.0) } else { S::from(0.0) };
        Current { i: (p.gain * u - x.i) / p.tau }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Nothing, _p: &Delayed<S>) -> Current<S> {
        *x
    }
}

impl Model for SwitchedByValue {
    type State = Current;
    type Input = Nothing;
    type Output = Current;
    type Parameters = Delayed;

    fn derivative<S: Scalar>(&self, t: S, x: &Current<S>, _u: &Nothing, p: &Delayed<S>) -> Current<S> {
        let u = if t.value() >= p.theta.value() { 1.0 } else { 0.0 };
        Current { i: (p.gain * u - x.i) / p.tau }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Nothing, _p: &Delayed<S>) -> Current<S> {
        *x
    }
}

/// A step that came 12.4 s late, sampled for a hundred seconds.
fn outputs() -> Vec<Current> {
    let mut noise = Noise(7);
    let response = |t: f64| if t < 12.4 { 0.0 } else { 2.0 * (1.0 - (-(t - 12.4) / 20.0).exp()) };
    (0..100).map(|k| Current { i: response(f64::from(k)) + 0.01 * noise.gauss() }).collect()
}

fn found<M>(model: &M, theta: Parameter, starts: Option<usize>) -> Estimate<M>
where
    M: Model<State = Current, Input = Nothing, Output = Current, Parameters = Delayed> + Clone,
{
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record =
        Experiment::new(model, time, vec![Nothing; 100], outputs()).unwrap().initial(Current { i: fixed(0.0) });
    let fit = Fit::new(model, &record).parameters(Delayed { gain: free(1.0), tau: free(15.0), theta });
    if let Some(count) = starts { fit.starts(count) } else { fit }.run().unwrap()
}

fn text<M: Model>(estimate: &Estimate<M>) -> &str {
    let unidentified =
        |warning: &&Warning| warning.code == WarningCode::Unidentified && warning.text.contains("`theta`");
    let mut of = estimate.warnings.iter().filter(unidentified);
    &of.next().unwrap_or_else(|| panic!("{estimate}")).text
}

/// The time of a switch has no slope, which is not the same as no influence; by values it is found to the part of a sample by which the
/// integration steps.
#[test]
fn the_time_of_a_switch_is_said_to_stand_in_conditions() {
    let theta = free(8.0).within(0.0, 30.0);
    let traced = found(&Switched, theta, None);
    assert!(text(&traced).starts_with("`theta` stands only in conditions of the model"), "{}", text(&traced));
    assert!(text(&traced).contains("Fit::starts"), "{}", text(&traced));
    let by_value = found(&SwitchedByValue, theta, None);
    assert!(text(&by_value).starts_with("`theta` changes the cost, but without a slope"), "{}", text(&by_value));
    let searched = found(&Switched, theta, Some(40));
    assert!((searched.parameters.theta - 12.4).abs() < 1.0, "{searched}");
}

/// A switch behind the end of the record changes nothing, at twice the time and at half of it.
#[test]
fn a_condition_that_is_never_met_is_said() {
    let never = found(&Switched, free(1e3), Some(1));
    assert!(text(&never).contains("come out the same at every sample"), "{}", text(&never));
}
