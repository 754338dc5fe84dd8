//! Warnings about what the estimate rests on: enough measurements, the end of the search, searches from other starts, the checkpoint, and time
//! for all checks.

use super::*;
use crate::estimate::{Minimum, Starts, times_the_cost};
use crate::problem::SearchPlan;

pub(crate) const MINIMUM: Check = Check::new(
    "the search ended at a minimum",
    "Are intervals given where the search did not arrive at a minimum?",
    &[WarningCode::NotAtMinimum],
    |evidence, intervals| not_at_minimum(evidence, &intervals.unknowns).into(),
);

pub(crate) const STARTS: Check = Check::new(
    "searches from other starts agree",
    "Did other starts lead to the estimate, to another minimum that explains the data as well, or the declared \
     start elsewhere?",
    &[WarningCode::MinimumFoundOnce, WarningCode::RivalMinimum, WarningCode::DeclaredStartElsewhere],
    |evidence, _| starts(evidence).into(),
)
.levels(&[
    level("the difference of deviances that tells two minima apart", INDISTINGUISHABLE, "one of 150 records"),
    level("searches of which a minimum is found more than once", MANY as f64, "one of twenty cases"),
]);

pub(crate) const CHECKPOINT: Check = Check::new(
    "the checkpoint was written",
    "Was there an error in writing the checkpoint?",
    &[WarningCode::CheckpointNotWritten],
    |evidence, _| checkpoint(evidence).into(),
);

/// Minima whose deviances differ by less cannot be told apart: if both had the same number of fixed parameters, the wrong one would
/// be better by more in less than `exp(-10 / 2)`, one of 150 records.
pub(crate) const INDISTINGUISHABLE: f64 = 10.0;

/// The largest ratio of the costs of a minimum and its mirror image, which differ by rounding and the tolerance of searches.
const MIRRORED: f64 = 1.0 + 1e-6;

/// A minimum that half of all searches lead to is found at most once by so many in less than one of twenty cases: `(8 + 1) / 2^8`.
const MANY: u64 = 8;

/// Intervals of a search that did not end at a minimum.
fn not_at_minimum(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let known = unknowns.iter().any(|row| row.knowledge.standard_error().is_some());
    let text = "standard errors and intervals are those of a minimum, where the search did not arrive";
    (known && !evidence.point.end.outcome.converged())
        .then(|| not_usable(WarningCode::NotAtMinimum, text.to_owned()).about(About::Search))
}

/// A checkpoint that could not be written.
fn checkpoint(evidence: &Evidence<'_>) -> Option<Warning> {
    let write_error = evidence.point.end.write_error.as_ref()?;
    let text = format!("the checkpoint could not be written ({write_error}); the search went on without it");
    Some(note(WarningCode::CheckpointNotWritten, text).about(About::Search))
}

/// Searches from other starts, if there were any.
fn starts(evidence: &Evidence<'_>) -> Vec<Warning> {
    let asked = matches!(evidence.point.objective.problem.settings.searches, SearchPlan::All(_));
    let unknowns = &evidence.point.objective.problem.unknowns;
    let has_signs = |minimum: &Minimum| unknowns.have_declared_signs(minimum.unknowns.iter().map(|(_, value)| *value));
    let of_step = |minimum: &Minimum| {
        let values = minimum.unknowns.iter().map(|(_, value)| *value);
        let at: Vec<f64> = values.zip(&unknowns.row).map(|(x, row)| row.parameter.transform.to_coordinate(x)).collect();
        evidence.point.objective.step_decides(&at) != Some(false)
    };
    let of = |starts| {
        warnings(starts, evidence.residuals.measured, asked, evidence.color_dominates(), (&has_signs, &of_step))
    };
    evidence.point.end.starts.as_ref().map_or(vec![], of)
}

/// A question about a minimum.
type OfMinimum<'a> = &'a dyn Fn(&Minimum) -> bool;

/// Warnings about an estimate that is the best end of these searches, with errors that are colored or not. Where searches were not asked
/// for, a minimum that is found once lowers the verdict no more than one that is found without other searches does. But one that is found
/// once by many searches and leaves colored errors is seldom the right one: what is colored there is what the model does not explain.
/// A minimum of the same cost where a finer step changes it, as at the edge of an integrator's stability, is no rival.
/// A mirror image of the estimate that does not have the declared signs, where the estimate has them, is no rival; another minimum is, since a
/// value just below zero may be a small positive one.
fn warnings(
    starts: &Starts,
    measurements: u64,
    asked: bool,
    colored: bool,
    (has_signs, of_step): (OfMinimum<'_>, OfMinimum<'_>),
) -> Vec<Warning> {
    let Starts { tried, agreed, minima, declared, failed, .. } = starts;
    let mut warnings = vec![];
    if *agreed == 1 && *tried > 1 {
        let (others, none) = (minima.len() - 1, failed.len());
        let (left, severity) = match (colored && *tried >= MANY, asked) {
            (true, _) => (", and it leaves errors that are correlated over time", Severity::NotUsable),
            (_, true) => ("", Severity::UsableWithCare),
            _ => ("", Severity::Usable),
        };
        let text = format!(
            "only one of {tried} starts led to this minimum (others found: {others}; searches without one: {none}){left}: there may be \
             a better one; try more starts, or give bounds"
        );
        warnings.push(Warning::new(WarningCode::MinimumFoundOnce, severity, text).about(About::Minimum));
    }
    let at = |minimum: &Minimum| {
        let places = minimum.unknowns.iter().map(|(name, value)| format!("`{name}` = {}", number(*value, 5)));
        places.collect::<Vec<_>>().join(", ")
    };
    let rival = |minimum: &&Minimum| measurements as f64 * minimum.cost_ratio.ln() < INDISTINGUISHABLE;
    let signed = minima.first().is_some_and(has_signs);
    let mirrored = |minimum: &Minimum| signed && minimum.cost_ratio <= MIRRORED && !has_signs(minimum);
    let rivals = minima.iter().skip(1).filter(|one| !mirrored(one)).filter(rival).filter(|_| *agreed > 0);
    let (of_step, rivals): (Vec<&Minimum>, Vec<&Minimum>) = rivals.partition(|one| of_step(one));
    if let Some(rival) = rivals.first() {
        let text = format!(
            "another minimum explains the data as well, with {}, at {}: bounds or a prior must tell which one is meant",
            times_the_cost(rival.cost_ratio),
            at(rival)
        );
        warnings.push(with_care(WarningCode::RivalMinimum, text).about(About::Minimum));
    } else if let Some(rival) = of_step.first() {
        let text = format!(
            "another minimum, with {}, at {}, is one of the integrator's step: a finer one changes its cost",
            times_the_cost(rival.cost_ratio),
            at(rival)
        );
        warnings.push(note(WarningCode::RivalMinimum, text).about(About::Minimum));
    }
    if let Some(declared) = declared.filter(|declared| *declared > 0).and_then(|declared| minima.get(declared)) {
        let text = format!(
            "the declared start leads to another minimum, with {}, at {}",
            times_the_cost(declared.cost_ratio),
            at(declared)
        );
        warnings.push(note(WarningCode::DeclaredStartElsewhere, text).about(About::Minimum));
    }
    warnings
}

pub(crate) const ENOUGH: Check = Check::new(
    "measurements determine the unknowns",
    "Are there more measurements than unknowns, and does one parameter at least have an interval?",
    &[WarningCode::TooFewMeasurements, WarningCode::NothingDetermined],
    |evidence, intervals| of_the_data(evidence, &intervals.unknowns).into(),
);

/// Whether there are too few measurements, or none that determine an unknown.
fn of_the_data(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let measured = evidence.residuals.measured;
    if measured <= unknowns.len() as u64 {
        let text = format!(
            "{measured} measurement(s) for {} unknown(s) leave nothing to tell the accuracy by; fix some, or record more",
            unknowns.len()
        );
        return Some(not_usable(WarningCode::TooFewMeasurements, text));
    }
    let parameters = || unknowns.iter().filter(|row| matches!(row.role, Role::Parameter(_)));
    let (sought, what): (Vec<&Unknown>, &str) = match parameters().next() {
        Some(_) => (parameters().collect(), "parameters"),
        None => (unknowns.iter().collect(), "unknowns"),
    };
    let none = sought.iter().all(|row| row.knowledge == Knowledge::Unidentified);
    let text = || {
        format!(
            "the data determine none of the {what}; fix some that are known from elsewhere, or excite the system differently"
        )
    };
    none.then(|| not_usable(WarningCode::NothingDetermined, text()))
}

pub(crate) const TIME: Check = Check::new(
    "there was time for all checks",
    "Did the time limit or a flag end passes before all checks had been made?",
    &[WarningCode::NotExamined],
    |evidence, intervals| not_examined(evidence, intervals.stopped).into(),
);

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
    Some(Warning::new(WarningCode::NotExamined, severity, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::SearchEnd;
    use crate::judge::conclude;
    use crate::optimize::Outcome;
    use crate::problem::{Control, Memory};
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Huber, Time, free};
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    fn codes(tried: u64, agreed: u64, rival: f64, declared: usize) -> Vec<WarningCode> {
        let minimum = |cost_ratio| Minimum { cost_ratio, searches: 1, undetermined: vec![], unknowns: vec![] };
        let minima = vec![minimum(1.0), minimum(rival)];
        let starts = Starts { tried, agreed, minima, declared: Some(declared), failed: vec![], evaluations: 1 };
        let has_signs = |minimum: &Minimum| minimum.cost_ratio == 1.0;
        warnings(&starts, 100, true, false, (&has_signs, &|_| false)).iter().map(|warning| warning.code).collect()
    }

    /// A deviance of `100 ln(ratio)` above 10 is another: at a ratio of 1.1052. A minimum found by one of several searches, and
    /// a declared start that leads elsewhere, are said. The other minimum does not have the declared signs: it is no rival where its cost is the same.
    #[test]
    fn what_is_said_of_searches() {
        use WarningCode::{DeclaredStartElsewhere, MinimumFoundOnce, RivalMinimum};
        assert_eq!(codes(8, 3, 1.106, 0), []);
        assert_eq!(codes(8, 3, 1.104, 0), [RivalMinimum]);
        assert_eq!(codes(8, 1, 1.106, 0), [MinimumFoundOnce]);
        assert_eq!(codes(1, 1, 1.106, 0), []);
        assert_eq!(codes(8, 3, 1.106, 1), [DeclaredStartElsewhere]);
        assert_eq!(codes(8, 0, 1.104, 0), []);
        assert_eq!(codes(8, 3, 1.0 + 0.9e-6, 0), []);
        assert_eq!(codes(8, 3, 1.0 + 1.1e-6, 0), [RivalMinimum]);
    }

    /// A minimum that one of eight searches led to is not usable where it leaves colored errors. Where it leaves white ones, or one of
    /// seven led to it, a fit that searched by itself is not judged worse for it, and one that was asked to with care.
    #[test]
    fn a_minimum_that_is_found_once() {
        let said = |tried: u64, agreed: u64, asked: bool, colored: bool| {
            let minimum = Minimum { cost_ratio: 1.0, searches: agreed, undetermined: vec![], unknowns: vec![] };
            let starts =
                Starts { tried, agreed, minima: vec![minimum], declared: None, failed: vec![], evaluations: 1 };
            warnings(&starts, 100, asked, colored, (&|_| true, &|_| false))
        };
        let text = &said(8, 1, true, false)[0].text;
        assert!(
            text.contains("only one of 8 starts") && text.contains("others found: 0; searches without one: 0): there"),
            "{text}"
        );
        assert!(said(8, 1, true, true)[0].text.contains("searches without one: 0), and it leaves errors"));
        use Severity::{NotUsable, Usable, UsableWithCare};
        let severity = |tried, asked, colored| said(tried, 1, asked, colored)[0].severity;
        let white = [(8, true), (8, false)].map(|(tried, asked)| severity(tried, asked, false));
        assert_eq!(white, [UsableWithCare, Usable]);
        let colored = [(8, true), (8, false), (7, true), (7, false)];
        let colored = colored.map(|(tried, asked)| severity(tried, asked, true));
        assert_eq!(colored, [NotUsable, NotUsable, UsableWithCare, Usable]);
        assert!(said(8, 2, true, true).is_empty());
    }

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
