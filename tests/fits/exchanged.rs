//! Two lags in series, whose times can be exchanged.

use crate::common::{Noise, levels};
use greybox::*;

signals! { pub struct Lags { a: "V", b: "V" } }
signals! { pub struct Command { u: "V" } }
signals! { pub struct Measured { y: "V" } }
signals! { pub struct Times { first: "s", second: "s", gain: "1" } }

/// `first da/dt = gain u - a`, `second db/dt = a - b`, of which `b` is measured; or half of each.
#[derive(Clone)]
struct Series {
    both: bool,
}

impl Model for Series {
    type State = Lags;
    type Input = Command;
    type Output = Measured;
    type Parameters = Times;

    fn derivative<S: Scalar>(&self, _t: S, x: &Lags<S>, u: &Command<S>, p: &Times<S>) -> Lags<S> {
        Lags { a: (p.gain * u.u - x.a) / p.first, b: (x.a - x.b) / p.second }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Lags<S>, _u: &Command<S>, _p: &Times<S>) -> Measured<S> {
        Measured { y: if self.both { (x.a + x.b) * 0.5 } else { x.b } }
    }
}

/// The fit of a record with times of 1 and 0.3 s, from starts in the other order; the second one at most so long.
fn fitted(both: bool, most: f64) -> Estimate<Series> {
    let model = Series { both };
    let inputs: Vec<Command> = levels(600, 15, 7).into_iter().map(|u| Command { u }).collect();
    let truth = Times { first: 1.0, second: 0.3, gain: 2.0 };
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let mut run = Simulator::new(&model).run(&truth, &Lags { a: 0.0, b: 0.0 }, time.clone(), &inputs).unwrap();
    let mut random = Noise(3);
    run.outputs.iter_mut().for_each(|y| y.y += 0.02 * random.gauss());
    let record = Experiment::new(&model, time, inputs, run.outputs).unwrap();
    let record = record.initial(Lags { a: fixed(0.0), b: fixed(0.0) });
    let start = Times { first: free(0.2), second: free(0.4).within(0.05, most), gain: free(1.0) };
    Fit::new(&model, &record).parameters(start).run().unwrap()
}

fn said(found: &Estimate<Series>) -> Option<&Warning> {
    found.warnings.iter().find(|warning| warning.code == WarningCode::RivalMinimum)
}

/// The data do not tell which lag is first; a bound does, and so does an output that has both.
#[test]
fn times_of_lags_in_series_can_be_exchanged() {
    let found = fitted(false, 10.0);
    let Times { first, second, .. } = found.parameters;
    let warning = said(&found).unwrap();
    assert!(warning.severity == Severity::UsableWithCare && found.severity() == Severity::UsableWithCare, "{found}");
    let other = warning.text.split("`first` = ").nth(1).unwrap().split(',').next().unwrap().parse::<f64>().unwrap();
    assert!((other / second - 1.0).abs() < 1e-4 && (first / second).ln().abs() > 1.0, "{}", warning.text);
    assert!((first * second / 0.3 - 1.0).abs() < 0.1, "{first} {second}");
    let bounded = fitted(false, 0.5);
    assert!(said(&bounded).is_none() && bounded.severity() == Severity::Usable, "{bounded}");
    let told = fitted(true, 10.0);
    assert!(said(&told).is_none() && told.severity() == Severity::Usable, "{told}");
    assert!((told.parameters.first - 1.0).abs() < 0.1, "{told}");
}
