//! Settings and values at the limits of numbers: nothing is known with a standard error that is none.

use crate::plants::*;
use greybox::{
    Experiment, ExperimentOf, Fit, Knowledge, Report, Severity, Signals, Summary, Time, WarningCode, fixed, free,
    loss::Tukey,
};

fn record() -> ExperimentOf<FirstOrder> {
    let plant = lag();
    let columns = plant.record(1, 300).noisy(0.05, 0.0, 1);
    let inputs = columns.u[0].iter().map(|&u| Force { u }).collect();
    let outputs = columns.y[0].iter().map(|&y| Level { y }).collect();
    Experiment::new(&FirstOrder, Time::Uniform { start: 0.0, step: plant.step }, inputs, outputs).unwrap()
}

fn start() -> Lag<greybox::Parameter> {
    Lag { k: free(1.5), tau: free(0.4) }
}

#[track_caller]
fn nothing_known_without_an_error(summary: &Summary) {
    for unknown in &summary.unknowns {
        if let Knowledge::Known { standard_error, .. } = unknown.knowledge {
            assert!(standard_error > 0.0 && standard_error.is_finite(), "{summary}");
        }
    }
}

/// Standard errors of 1e160 and more overflow when squared, and those of a loss without weight are zero.
#[test]
fn an_absurd_noise_or_loss_is_not_usable() {
    let record = record();
    let estimate = Fit::new(&FirstOrder, &record).parameters(start()).noise(Level { y: 1e160 }).run().unwrap();
    nothing_known_without_an_error(&estimate);
    assert_eq!(estimate.severity(), Severity::NotUsable, "{estimate}");
    if let Ok(estimate) = Fit::new(&FirstOrder, &record).parameters(start()).loss(Tukey(1e-9)).run() {
        nothing_known_without_an_error(&estimate);
        assert_eq!(estimate.severity(), Severity::NotUsable, "{estimate}");
    }
}

/// Without noise the estimate is right to eight digits, and usable.
#[test]
fn without_noise_the_answer_is_usable() {
    let time = Time::Uniform { start: 0.0, step: 0.02 };
    let inputs: Vec<Force> = lag().inputs(3, 400)[0].iter().map(|&u| Force { u }).collect();
    let truth = Lag { k: 2.0, tau: 0.3 };
    let run = greybox::simulate(&FirstOrder, &truth, &Level { y: 0.0 }, time, &inputs).unwrap();
    let record = run.experiment(&FirstOrder).unwrap().initial(Level { y: fixed(0.0) });
    let estimate = Fit::new(&FirstOrder, &record).parameters(start()).run().unwrap();
    nothing_known_without_an_error(&estimate);
    let error = (estimate.parameters.k / 2.0 - 1.0).abs().max((estimate.parameters.tau / 0.3 - 1.0).abs());
    assert!(error < 1e-8, "{estimate}");
    assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
}

/// `y = a b u`: a step along the direction that changes nothing raises one factor by the percentage that it lowers the
/// other by, whatever their signs. The report says it once.
#[test]
fn percentages_keep_the_sign_of_the_value() {
    let inputs: Vec<Force> = lag().inputs(5, 200)[0].iter().map(|&u| Force { u }).collect();
    let output = |(k, u): (usize, &Force)| Level { y: -3.0 * u.u + 0.01 * (k as f64 * 0.754_877).fract() };
    let outputs = inputs.iter().enumerate().map(output).collect();
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let record = Experiment::new(&Product, time, inputs, outputs).unwrap();
    let problem = Fit::new(&Product, &record).parameters(Factors { a: free(-1.2), b: free(2.0) }).problem().unwrap();
    let estimate = problem.run().unwrap();
    let moves = &estimate.directions[0].moves;
    assert!(estimate.unknowns[0].value < 0.0 && estimate.unknowns[1].value > 0.0, "{estimate}");
    // In percent of the values, signs included; exact but for rounding.
    assert!((moves[0].1 + moves[1].1).abs() < 1e-9, "{moves:?}");
    let text = Report::new(&problem, &estimate).unwrap().to_string();
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(text.matches("known only as their product").count(), 1, "{text}");
    assert!(!text.contains("as their ratio"), "{text}");
}

/// Where a record has no input, none is held over a gap in time.
#[test]
fn a_model_without_inputs_is_not_warned_of_held_inputs() {
    let plant = ringing();
    let columns = plant.simulated(vec![], &plant.truth()).noisy(0.01, 0.0, 1);
    let kept = |k: &usize| !(150..170).contains(k);
    let times = (0..400).filter(kept).map(|k| k as f64 * plant.step).collect();
    let outputs: Vec<_> = (0..400).filter(kept).map(|k| Motion::from_fn(|j| columns.y[j][k])).collect();
    let inputs = vec![greybox::Nothing; outputs.len()];
    let record = Experiment::new(&Free, Time::Stamps(times), inputs, outputs).unwrap();
    assert_eq!(record.gaps().len(), 1);
    let estimate = Fit::new(&Free, &record).parameters(Ringing { d: free(0.4), c: free(8.0) }).run().unwrap();
    assert!(estimate.warnings.iter().all(|warning| warning.code != WarningCode::TimeGaps), "{estimate}");
}
