//! Numbers near the ends of what an `f64` can hold: an answer or an error, and nothing known that is not finite.

use greybox::optimize::{GaussNewton, LevenbergMarquardt, Outcome};
use greybox::*;

signals! {
    pub struct In { u: "V" }
    pub struct Out { y: "m" }
    pub struct Line { a: "m/V", b: "m" }
}

/// `y = a u + b`
#[derive(Clone)]
struct Straight;

#[rustfmt::skip]
impl Model for Straight {
    type State = Nothing; type Input = In; type Output = Out; type Parameters = Line;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &In<S>, p: &Line<S>) -> Out<S> { Out { y: p.a * u.u + p.b } }
}

/// Errors are autocorrelated by 0.9, a tenth of the input at first.
fn record(input: f64, output: f64) -> ExperimentOf<Straight> {
    let inputs: Vec<In> = (0..300).map(|k| In { u: input * (0.1 * k as f64).sin() }).collect();
    let mut error = 0.0;
    let outputs = (0..300).map(|k| {
        error = 0.9 * error + 0.04 * (2.399 * (k * k % 97) as f64).sin();
        Out { y: output * ((0.1 * k as f64).sin() + error) }
    });
    Experiment::new(&Straight, Time::Uniform { start: 0.0, step: 0.01 }, inputs, outputs.collect()).unwrap()
}

fn assert_finite(what: &str, estimate: &Estimate<Straight>) {
    for unknown in &estimate.unknowns {
        if let Knowledge::Known { standard_error, lower, upper } = unknown.knowledge {
            let finite = standard_error.is_finite() && lower.is_finite() && upper.is_finite();
            assert!(finite && unknown.value.is_finite(), "{what}: {unknown:?}");
        }
    }
}

/// Inputs and outputs of any size: squares of them, and products of slopes and errors, under- and overflow.
#[test]
fn records_of_any_size() {
    let mut answers = 0;
    for exponent in [-320, -310, -200, -160, -100, 0, 100, 150, 160, 200, 290, 300] {
        for (output, given) in [(0, false), (exponent, false), (exponent, true), (150, true)] {
            let record = record(10f64.powi(exponent), 10f64.powi(output));
            let fit = || {
                let fit = Fit::new(&Straight, &record).parameters(Line { a: free(1.0), b: free(0.0) });
                if given { fit.noise(Out { y: 1.0 }) } else { fit }
            };
            for (name, fit) in [
                ("Levenberg-Marquardt", fit().optimizer(LevenbergMarquardt::default())),
                ("Gauss-Newton", fit().optimizer(GaussNewton::default())),
            ] {
                let what = format!("inputs of 1e{exponent}, outputs of 1e{output}, {name}");
                let problem = fit.problem().unwrap();
                let Ok(summary) = problem.run() else { continue };
                let estimate = Estimate::of(summary).unwrap();
                assert_finite(&what, &estimate);
                let text = estimate.to_json().unwrap();
                assert_eq!(Summary::from_json(&text).unwrap().to_json().unwrap(), text, "{what}");
                let report = Report::new(&problem, &estimate).unwrap_or_else(|error| panic!("{what}: {error}"));
                assert!(!report.to_html().contains("\"NaN"), "{what}");
                answers += 1;
            }
        }
    }
    // Without overflow there is an answer.
    assert!(answers >= 48, "{answers} of 96");
}

/// A logarithm about which nothing is known: its interval would be from zero to infinity.
#[test]
fn an_interval_without_an_end_is_no_knowledge() {
    let inputs: Vec<In> = (0..100).map(|k| In { u: f64::from(k % 2) }).collect();
    let outputs = (0..100).map(|k| Out { y: [0.1, -0.1, -0.1, 0.1][k % 4] - 0.1 * f64::from(k as u32 % 2) }).collect();
    let record = Experiment::new(&Straight, Time::Uniform { start: 0.0, step: 0.01 }, inputs, outputs).unwrap();
    let parameters = Line { a: free(1.0).log(), b: fixed(0.0) };
    let estimate = Fit::new(&Straight, &record).parameters(parameters).run().unwrap();
    // The best value is below zero, and a logarithm ends where the output no longer feels it.
    assert!(estimate.parameters.a < 1e-4, "{estimate}");
    assert_finite("a logarithm at zero", &estimate);
    assert!(matches!(estimate.knowledge.a, Knowledge::Unidentified | Knowledge::Held { .. }), "{estimate}");
}

/// Of outputs that are all zero the errors, and so the standard error, are zero: nothing is known, and that is said. With
/// ordinary numbers it is not.
#[test]
fn a_standard_error_of_zero_is_named() {
    for (output, named) in [(0.0, true), (1.0, false)] {
        let parameters = Line { a: free(1.0), b: fixed(0.0) };
        let fit = Fit::new(&Straight, &record(1.0, output)).parameters(parameters).run().unwrap();
        let found = fit.warnings.iter().find(|warning| warning.code == WarningCode::NoStandardError);
        assert_eq!(found.is_some(), named, "{fit}");
        if let Some(warning) = found {
            assert_eq!(warning.severity, Severity::NotUsable);
            assert!(warning.text.starts_with("the standard error of `a` is 0: "), "{}", warning.text);
            assert!(!matches!(fit.unknowns[0].knowledge, Knowledge::Known { .. }), "{fit}");
        }
    }
}

/// Measurements of weight zero have no part in the test of whiteness: errors of the others that are correlated by 0.9 are named,
/// and those of measurements without weight are not, however correlated.
#[test]
fn whiteness_is_that_of_measurements_with_weight() {
    let colored = record(1.0, 1.0);
    let white: Vec<Out> = (0..300).map(|k| Out { y: 0.05 * (2.399 * (k * k % 97) as f64).sin() }).collect();
    for (from, named) in [(0u8, true), (150, false)] {
        // The first half has colored errors, the second white ones.
        let outputs = (0..300).map(|k| match k < 150 {
            true => Out { y: colored.output(k).y },
            false => Out { y: (0.1 * k as f64).sin() + white[k].y },
        });
        let inputs = (0..300).map(|k| In { u: (0.1 * k as f64).sin() }).collect();
        let time = Time::Uniform { start: 0.0, step: 0.01 };
        let record = Experiment::new(&Straight, time, inputs, outputs.collect()).unwrap();
        let weight = move |sample: &Sample<Straight>| {
            f64::from(u8::from((sample.t / 0.01 - f64::from(from) - 74.5).abs() < 75.0))
        };
        let fit = Fit::new(&Straight, &record).parameters(Line { a: free(1.0), b: free(0.0) }).weighting(weight);
        let fit = fit.run().unwrap();
        assert_eq!(fit.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors), named, "{fit}");
    }
}

/// Errors that are a part of 1e-14 of the output are rounding, whatever their color: nothing is said of it, with noise that is estimated.
/// Errors a million times larger are colored.
#[test]
fn the_color_of_rounding_is_not_named() {
    for (size, named) in [(1e-14, false), (1e-8, true)] {
        let input = |k: usize| (0.1 * k as f64).sin();
        let outputs = (0..300).map(|k| Out { y: 1.0 + 0.5 * input(k) + size * (0.37 * k as f64).sin() }).collect();
        let inputs = (0..300).map(|k| In { u: input(k) }).collect();
        let record = Experiment::new(&Straight, Time::Uniform { start: 0.0, step: 0.01 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Straight, &record).parameters(Line { a: free(1.0), b: free(0.0) }).run().unwrap();
        assert_eq!(fit.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors), named, "{fit}");
        assert_eq!(fit.outcome == Outcome::Exact, !named, "{fit}");
    }
}
