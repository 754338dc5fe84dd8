//! Weights that follow the measurements.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Output { y: "V" } }
signals! { pub struct Input { u: "A" } }
signals! { pub struct Gain { a: "ohm" } }

/// `y = a u`.
#[derive(Clone)]
struct Line;

impl Model for Line {
    type State = Nothing;
    type Input = Input;
    type Output = Output;
    type Parameters = Gain;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Input<S>, p: &Gain<S>) -> Output<S> {
        Output { y: p.a * u.u }
    }
}

/// With inputs between 1 and 2, noise of 0.3 and weights of `y^2` the estimate is `sum y^3 u / sum y^2 u^2`, 6.5 % too large: twice the noise's square times
/// the mean of `u^2` (7/3), over that of `y^2 u^2` (6.41). The warning says it to a fifth; weights by the input have none.
#[test]
fn weights_of_measurements_bias() {
    let mut random = Noise(4);
    let inputs: Vec<Input> = (0..400).map(|k| Input { u: 1.0 + f64::from(k) / 400.0 }).collect();
    let outputs: Vec<Output> = inputs.iter().map(|u| Output { y: u.u + 0.3 * random.gauss() }).collect();
    let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = || Fit::new(&Line, &record).parameters(Gain { a: free(0.5) });
    let found = fit().weighting(|sample: &Sample<Line>| sample.y.y * sample.y.y).run().unwrap();
    let warning = found.warnings.iter().find(|warning| warning.code == WarningCode::InputNoise).unwrap();
    let said: f64 = warning.text.split("about ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((found.parameters.a - 1.065).abs() < 0.02, "{}", found.parameters.a);
    assert!((said / 0.065 - 1.0).abs() < 0.2, "{}", warning.text);
    let found = fit().weighting(|sample: &Sample<Line>| sample.u.u * sample.u.u).run().unwrap();
    assert!(found.warnings.iter().all(|warning| warning.code != WarningCode::InputNoise), "{found}");
}
