//! What was left out of a verdict because a time limit was over or a flag was set.

use crate::estimate::{Warning, WarningCode};
use crate::judge::check::Check;
use crate::judge::evidence::Evidence;
use crate::optimize::Severity;

pub(crate) const TIME: Check = Check {
    name: "there was time for all checks",
    asks: "Did the time limit or a flag end passes before all checks had been made?",
    codes: &[WarningCode::NotExamined],
    costs: &[],
    levels: &[],
    examine: |evidence, intervals| not_examined(evidence, intervals.stopped).into(),
};

/// Whether stop conditions ended passes over the data before all tests had been made; `early` if already those for the intervals.
fn not_examined(evidence: &Evidence<'_>, early: bool) -> Option<Warning> {
    let control = evidence.point.objective.control;
    if !control.stops() {
        return None;
    }
    let stop = control.reason();
    let (text, severity) = match early {
        true => (
            format!(
                "{stop} before intervals had been examined: they are those of white errors of one size, and tests of errors, of the \
                 step and of parts of the data were left out; allow more time"
            ),
            Severity::NotUsable,
        ),
        false => (
            format!(
                "{stop} before all tests of the estimate had been made: what the others would find is not said; allow more time"
            ),
            Severity::UsableWithCare,
        ),
    };
    Some(Warning { code: WarningCode::NotExamined, severity, text })
}

#[cfg(test)]
mod tests {
    use crate::estimate::WarningCode;
    use crate::judge::{SearchEnd, conclude};
    use crate::optimize::{Outcome, Severity};
    use crate::problem::{Control, Memory};
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Huber, Time, free};
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    /// A minimum that is judged after the flag was set: cost, noise and value are those of the whole evidence, the intervals are classical
    /// instead of a sandwich, and it is said. A flag that is not set changes nothing.
    #[test]
    fn a_minimum_that_is_not_examined() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k) }).collect();
        let outputs = (0..40).map(|k| Current { i: 2.0 * f64::from(k) + f64::from(k * 37 % 21) - 10.0 }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).loss(Huber::default());
        let problem = fit.problem().unwrap();
        let whole = problem.run().unwrap();
        let judged = |flag: bool| {
            let control = Control { cancel: Some(Arc::new(AtomicBool::new(flag))), deadline: None };
            let (objective, coordinates) = problem.at_within(&whole, &control).unwrap();
            let end = SearchEnd {
                coordinates,
                whitening: objective.whitening.clone(),
                linear: None,
                outcome: Outcome::CostUnchanged { decrease: 0.0 },
                iterations: 1,
                evaluations: 1,
                name: String::new(),
                write_error: None,
                memory: Memory::default(),
                starts: None,
            };
            conclude(&objective, &end, 0.0).unwrap()
        };
        let (stopped, complete) = (judged(true), judged(false));
        assert_eq!((stopped.cost, &stopped.outputs), (complete.cost, &complete.outputs));
        assert_eq!(stopped.unknowns[0].value, complete.unknowns[0].value);
        assert!(stopped.unknowns[0].knowledge.standard_error().is_some());
        assert_ne!(stopped.method.covariance, complete.method.covariance);
        let said = |code: WarningCode| stopped.warnings.iter().any(|warning| warning.code == code);
        assert!(said(WarningCode::NotExamined) && !said(WarningCode::NothingDetermined), "{:?}", stopped.warnings);
        assert_eq!(stopped.severity(), Severity::NotUsable);
        assert!(complete.warnings.iter().all(|warning| warning.code != WarningCode::NotExamined));
    }
}
