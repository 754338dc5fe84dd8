//! The verdict of a report is that of its estimate, whatever the tests of the residuals show.

use crate::random::Random;
use greybox::estimate::About;
use greybox::{Experiment, Fit, Huber, Kind, Model, Report, Scalar, Severity, Time, WarningCode, free, signals};

signals! { struct Level { y: "V" } }
signals! { struct Drive { u: "V" } }
signals! { struct Poles { a: "1", b: "1" } }

/// `x+ = a x + b u`.
#[derive(Clone)]
struct Recursion;

impl Model for Recursion {
    type State = Level;
    type Input = Drive;
    type Output = Level;
    type Parameters = Poles;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Drive<S>, p: &Poles<S>) -> Level<S> {
        Level { y: p.a * x.y + p.b * u.u }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Drive<S>, _p: &Poles<S>) -> Level<S> {
        *x
    }
}

/// A record with white noise of the measurements, one in so many of them an outlier, and an input that a controller of this gain computes
/// from the measurement of the same sample.
fn record(seed: u64, gain: f64, outlier: usize) -> Experiment<Level, Drive, Level> {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x9d);
    let (mut x, mut reference, mut inputs, mut outputs) = (0.0, 0.0, vec![], vec![]);
    for k in 0..600 {
        if k % 15 == 0 {
            reference = 2.0 * random.uniform() - 1.0;
        }
        let spoiled = if k % outlier == 7 { 1.0 } else { 0.0 };
        let y = x + 0.05 * random.normal() + spoiled;
        let u = reference - gain * y;
        inputs.push(Drive { u });
        outputs.push(Level { y });
        x = 0.8 * x + 0.3 * u;
    }
    Experiment::new(&Recursion, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

/// Estimate and report, which give the same reasons.
fn judged(record: &Experiment<Level, Drive, Level>, robust: bool) -> (Severity, Report) {
    let fit = Fit::new(&Recursion, record).parameters(Poles { a: free(0.5), b: free(0.5) });
    let fit = if robust { fit.loss(Huber::default()) } else { fit };
    let problem = fit.problem().unwrap();
    let estimate = problem.run().unwrap();
    let report = Report::new(&problem, &estimate).unwrap();
    let mut warnings: Vec<(Severity, &str)> =
        report.estimate.warnings.iter().map(|warning| (warning.severity, &*warning.text)).collect();
    warnings.sort_by_key(|(severity, _)| std::cmp::Reverse(*severity));
    assert_eq!(report.reasons(), warnings);
    assert_eq!(report.severity, estimate.severity(), "{report}");
    (estimate.severity(), report)
}

/// A controller makes the input of a sample follow the error of its measurement. The right model is usable, and the report says where
/// that correlation may come from: all 20 records fail the test, none is downgraded.
#[test]
fn feedback_is_no_reason_against_the_model() {
    for seed in 0..20 {
        let (severity, report) = judged(&record(seed, 1.5, usize::MAX), false);
        assert_eq!(severity, Severity::Usable, "{report}");
        let section = report.sections.iter().find(|section| section.id == "residuals").unwrap();
        let said = section.sentences.join(" ");
        assert!(said.contains("a controller computed it from the measurement of `y`"), "{said}");
        assert!(!said.contains("missing or wrong in the model"), "{said}");
    }
}

/// Outliers under a robust loss fail the tests of normality; the loss is there for them.
#[test]
fn outliers_are_no_reason_against_a_robust_loss() {
    for seed in 0..8 {
        let (severity, report) = judged(&record(seed, 0.0, 40), true);
        assert_eq!(severity, Severity::Usable, "{report}");
        let said = report.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains("the residuals are not normal") && !said.contains("use a robust loss"), "{said}");
    }
}

/// What makes an estimate not usable makes its report so.
#[test]
fn a_bad_record_has_one_verdict() {
    let mut columns = record(3, 0.0, usize::MAX);
    let inputs: Vec<Drive> = columns.inputs().collect();
    let mut random = Random(5);
    let outputs = (0..600).map(|_| Level { y: random.normal() }).collect();
    columns = Experiment::new(&Recursion, columns.times().clone(), inputs, outputs).unwrap();
    assert_eq!(judged(&columns, false).0, Severity::NotUsable);
}

/// A bound that the cost falls beyond, an input that never moves, a jump of time in the second of two records, and a start of another sign:
/// programs read which unknown, input and record these are.
#[test]
fn warnings_say_what_they_are_about() {
    let first = record(1, 0.0, usize::MAX);
    let still = vec![Drive { u: 0.0 }; 600];
    let outputs: Vec<Level> = first.outputs().collect();
    let stamps = (0..600).map(|k| f64::from(k) + if k < 300 { 0.0 } else { 50.0 }).collect();
    let second = Experiment::new(&Recursion, Time::Stamps(stamps), first.inputs().collect(), outputs.clone()).unwrap();
    let of = |records: &[Experiment<Level, Drive, Level>], b: f64, most: f64| {
        let start = Poles { a: free(0.5), b: free(b).within(-1.0, most) };
        Fit::new(&Recursion, records).parameters(start).run().unwrap()
    };
    let about = |found: &greybox::Estimate<Recursion>, code: WarningCode| {
        found.warnings.iter().find(|warning| warning.code == code).map(|warning| warning.about)
    };
    let held = of(&[first.clone(), second], 0.1, 0.2);
    assert_eq!(about(&held, WarningCode::HeldAtBound), Some(About::Unknown(1)), "{held}");
    assert_eq!(about(&held, WarningCode::TimeGaps), Some(About::Experiment(1)), "{held}");
    let turned = of(std::slice::from_ref(&first), -0.1, 1.0);
    assert_eq!(about(&turned, WarningCode::SignChanged), Some(About::Unknown(1)), "{turned}");
    let undriven = Experiment::new(&Recursion, first.times().clone(), still, outputs).unwrap();
    let unknown = of(&[undriven], 0.1, 1.0);
    assert_eq!(about(&unknown, WarningCode::ConstantInput), Some(About::Input(0)), "{unknown}");
    let direction = |warning: &greybox::Warning| warning.about == About::Direction(0) && warning.text.contains("`b`");
    assert!(unknown.directions.len() == 1 && unknown.warnings.iter().any(direction), "{unknown}");
}
