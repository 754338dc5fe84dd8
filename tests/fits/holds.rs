//! Inputs that behave differently between samples: one held, one a straight line.

use approx::assert_relative_eq;
use greybox::equations::Equations;
use greybox::*;

signals! {
    pub struct Sum { x: "V s" }
    pub struct Sources { held: "V", line: "V" }
    pub struct Gains { a: "1", b: "1" }
}

#[derive(Clone)]
struct Integral;

#[rustfmt::skip]
impl Model for Integral {
    type State = Sum; type Input = Sources; type Output = Sum; type Parameters = Gains;
    fn derivative<S: Scalar>(&self, _t: S, _x: &Sum<S>, u: &Sources<S>, p: &Gains<S>) -> Sum<S> {
        Sum { x: p.a * u.held + p.b * u.line }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Sum<S>, _u: &Sources<S>, _p: &Gains<S>) -> Sum<S> { *x }
}

const STEP: f64 = 0.1;

fn inputs() -> Vec<Sources> {
    (0..300).map(|k| Sources { held: (0.9 * f64::from(k)).sin(), line: (0.7 * f64::from(k)).cos() }).collect()
}

/// Rectangles under what is held, trapezoids under what is a straight line.
fn record(a: f64, b: f64) -> ExperimentOf<Integral> {
    let (mut x, inputs) = (0.0, inputs());
    let outputs = inputs.iter().enumerate().map(|(k, u)| {
        let before = Sum { x };
        let next = inputs.get(k + 1).unwrap_or(u);
        x += STEP * (a * u.held + b * 0.5 * (u.line + next.line));
        before
    });
    let outputs = outputs.collect();
    let record = Experiment::new(&Integral, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    record.holds(Sources { held: Hold::Zero, line: Hold::First }).initial(Sum { x: fixed(0.0) })
}

/// Compiled, in the loop over a model's own code, and node by node. Runge and Kutta's methods integrate straight lines exactly.
#[test]
fn each_input_has_a_hold_of_its_own() {
    let (record, equations) = (record(2.0, -3.0), Equations::trace(&Integral).unwrap());
    let start = Gains { a: free(1.0), b: free(1.0) };
    let compiled = Fit::new(&Integral, &record).parameters(start).run().unwrap();
    assert!(compiled.method.engine.contains("graph"), "{compiled}");
    let own = Fit::new(&Integral, &record).parameters(start).integrator(Rk45::default()).run().unwrap();
    assert!(own.method.engine.contains("dual"), "{own}");
    let nodes = Fit::new(&equations, record.record()).parameters(vec![start.a, start.b]);
    let nodes = nodes.integrator(Rk45::default()).run().unwrap();
    for found in [compiled.summary(), own.summary(), &nodes] {
        // Nothing but rounding is between model and record.
        assert_relative_eq!(found.parameters[0].value, 2.0, max_relative = 1e-9);
        assert_relative_eq!(found.parameters[1].value, -3.0, max_relative = 1e-9);
    }
    let alike = record.clone().hold(Hold::First);
    let wrong = Fit::new(&Integral, &alike).parameters(start).run().unwrap();
    // The sums of trapezoids and of rectangles differ by half of a step times the input's way since the first sample: by up to 0.1.
    assert!(wrong.quality.x.rmse > 0.02, "{wrong}");
}

/// Holds are part of a record: they are stored by name, join and thin out with it, and stand in the report.
#[test]
fn holds_stay_with_the_record() {
    let record = record(2.0, -3.0);
    let expected = Sources { held: Hold::Zero, line: Hold::First };
    assert_eq!(record.input_holds(), expected);
    let text = serde_json::to_string(&record).unwrap();
    assert!(text.contains(r#""hold":{"held":"Zero","line":"First"}"#), "{}", &text[..200]);
    let read: ExperimentOf<Integral> = serde_json::from_str(&text).unwrap();
    assert_eq!(read.input_holds(), expected);
    let same = record.record().clone().hold(Hold::Zero).hold_of("line", Hold::First).unwrap();
    assert_eq!([same.input_hold(0), same.input_hold(1)], [Hold::Zero, Hold::First]);
    crate::refused::says(same.hold_of("lines", Hold::First), &["no input `lines` (`line` is near)", "held"]);

    // What is held becomes its mean, an instant stays.
    let thinned = record.decimate(2).unwrap();
    let (u, v) = (inputs(), thinned.input(5));
    assert_eq!(thinned.input_holds(), expected);
    assert_relative_eq!(v.held, 0.5 * (u[10].held + u[11].held), max_relative = 1e-12);
    assert_eq!(v.line, u[10].line);

    let (first, second) = record.split(0.5).unwrap();
    let other = second.clone().hold(Hold::Zero);
    crate::refused::says(first.clone().join(&other), &["`line`", "First", "Zero"]);
    assert_eq!(first.join(&second).unwrap().input_holds(), expected);

    let problem = Fit::new(&Integral, &record).parameters(Gains { a: free(1.0), b: free(1.0) }).problem().unwrap();
    let report = Report::new(&problem, &problem.run().unwrap()).unwrap();
    assert!(report.to_markdown().contains("inputs hold from sample to sample, but line are straight lines"));
}
