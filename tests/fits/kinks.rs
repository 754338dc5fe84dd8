#![cfg(feature = "std")]
//! Limits in a condition of the model, at which the cost has kinks.

use crate::common::*;
use greybox::*;

signals! { pub struct Ramp { level: "A", slope: "A/V", limit: "V" } }

/// `i = level + slope max(u - limit, 0)`.
#[derive(Clone)]
struct Segmented;

impl Model for Segmented {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Ramp;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Ramp<S>) -> Current<S> {
        Current { i: p.level + p.slope * (u.u - p.limit).max(S::from(0.0)) }
    }
}

/// With respect to the limit, the slope of the cost jumps at each value of the input, and the cost may have its minimum there, where a search finds no step. No
/// place a little to either side has a smaller cost.
#[test]
fn a_minimum_at_a_kink_is_a_minimum() {
    let mut noise = Noise(41);
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let inputs: Vec<Voltage> = (0..20).map(|k| Voltage { u: 6.0 * f64::from(k) / 19.0 }).collect();
    for number in 0..200 {
        let one = |u: &Voltage| Current { i: 1.0 + 2.0 * (u.u - 2.5).max(0.0) + 0.3 * noise.gauss() };
        let outputs: Vec<Current> = inputs.iter().map(one).collect();
        let record = Experiment::new(&Segmented, time.clone(), inputs.clone(), outputs.clone()).unwrap();
        let start = Ramp { level: free(0.0), slope: free(1.0), limit: free(2.0) };
        let fit = Fit::new(&Segmented, &record).parameters(start).run().unwrap();
        assert!(fit.outcome.converged(), "{number}: {fit}");
        let Ramp { level, slope, limit } = fit.parameters;
        let cost = |limit: f64| {
            let error = |(u, y): (&Voltage, &Current)| y.i - level - slope * (u.u - limit).max(0.0);
            inputs.iter().zip(&outputs).map(error).map(|error| error * error).sum::<f64>()
        };
        let beside = cost(limit - 1e-4).min(cost(limit + 1e-4));
        assert!(cost(limit) <= beside, "{number}: {} {beside}", cost(limit));
    }
}
