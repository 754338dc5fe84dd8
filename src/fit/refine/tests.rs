//! Which of two answers is given, and what is said of the other.

use super::*;
use crate::estimate::Knowledge;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, Fit, Model, Scalar, Time, fixed, free};

/// An answer of this deviance, with a value that has a standard error of one.
pub fn answer(integrator: &str, deviance: f64, value: f64, converged: bool) -> Summary {
    let inputs: Vec<Voltage> = (0..8).map(|k| Voltage { u: f64::from(k) }).collect();
    let outputs = (0..8).map(|k| Current { i: f64::from(k % 3) }).collect();
    let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
    let mut found = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).run().unwrap().into_summary();
    (found.deviance, found.iterations, found.evaluations, found.warnings) = (Some(deviance), 3, 5, vec![]);
    found.method.integrator = integrator.to_owned();
    found.unknowns[0].value = value;
    found.unknowns[0].knowledge = Knowledge::Known { standard_error: 1.0, lower: value - 2.0, upper: value + 2.0 };
    if !converged {
        found.outcome = Outcome::TimeLimit;
    }
    found
}

/// A finer method begins at a minimum with which nothing but the step is wrong; a search goes on from the limit of its trial steps
/// while it makes progress, not far where the model explains nothing.
#[test]
fn where_a_search_goes_on() {
    let warned = |converged: bool, code: WarningCode, severity: Severity| {
        let about = if code == WarningCode::CoarseStep { About::Step } else { About::Output(0) };
        let warning = Warning::new(code, severity, String::new()).about(about);
        Summary { warnings: vec![warning], ..answer("coarse", 10.0, 1.0, converged) }
    };
    use WarningCode::{CoarseStep, Unexplained};
    let cases = [
        warned(true, CoarseStep, Severity::NotUsable),
        warned(true, Unexplained, Severity::UsableWithCare),
        warned(true, Unexplained, Severity::NotUsable),
        warned(false, CoarseStep, Severity::NotUsable),
    ];
    assert_eq!(cases.each_ref().map(is_only_coarse), [true, true, false, false]);
    let go_on = |cases: &[Summary; 4], before: Option<f64>, parts: u64| {
        cases.each_ref().map(|found| may_go_on(found, before, (parts, PARTS)))
    };
    assert_eq!(go_on(&cases, None, 1), [false; 4]);
    // After the first part, after one that lowered the deviance to 10 by more than 1 and by less, and after many parts.
    let limited = cases.map(|one| Summary { outcome: Outcome::IterationLimit { iterations: 3 }, ..one });
    assert_eq!(go_on(&limited, None, 1), [true; 4]);
    // By an adaptive method, one part where an output is left unexplained.
    assert_eq!(limited.each_ref().map(|found| may_go_on(found, None, (1, 1))), [true, true, false, true]);
    assert_eq!(go_on(&limited, Some(11.1), 4), [true; 4]);
    assert_eq!(go_on(&limited, Some(10.9), 4), [true, true, false, true]);
    assert_eq!(go_on(&limited, Some(10.9), 9), [true, true, false, true]);
    assert_eq!(go_on(&limited, Some(10.9), 10), [false; 4]);
    assert_eq!(go_on(&limited, Some(11.1), 5), [true, true, false, true]);
    // Where the loss has no deviance, no further than ten parts, and not where an output is left unexplained.
    let robust = limited.map(|one| Summary { deviance: None, ..one });
    assert_eq!(go_on(&robust, None, 4), [true, true, false, true]);
    assert_eq!(go_on(&robust, None, 10), [false; 4]);
}

/// A search that ended at a limit of trial steps goes on as long as any are left, and counts the work of all; one that ended at a
/// minimum does not, nor do searches from several starts.
#[test]
fn what_is_run_on() {
    let inputs: Vec<Voltage> = (0..8).map(|k| Voltage { u: f64::from(k) }).collect();
    let outputs = (0..8).map(|k| Current { i: f64::from(k % 3) }).collect();
    let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
    let limited = Outcome::IterationLimit { iterations: 3 };
    let evaluations = |outcome: Outcome, starts: usize, most: u64, control: &Control| {
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).starts(starts).problem().unwrap();
        let found = Summary { outcome, ..answer("fine", 10.0, 1.0, true) };
        let found = problem.run_on(Ok(found), most, Instant::now(), control).unwrap();
        (found.iterations, found.evaluations)
    };
    let never = Control::NEVER;
    let (iterations, some) = evaluations(limited, 1, 100, &never);
    assert!(iterations > 3 && some > 5, "{iterations} {some}");
    assert_eq!(evaluations(limited, 1, 3, &never), (3, 5));
    assert_eq!(evaluations(limited, 2, 100, &never), (3, 5));
    assert_eq!(evaluations(Outcome::TimeLimit, 1, 100, &never), (3, 5));
    assert_eq!(evaluations(limited, 1, 100, &Control { deadline: Some(Instant::now()), ..never }), (3, 5));
    let converged = answer("fine", 10.0, 1.0, true).outcome;
    assert!(converged.converged());
    assert_eq!(evaluations(converged, 1, 100, &Control::NEVER), (3, 5));
}

fn failure() -> Error {
    Error::Option("no answer".to_owned())
}

/// Of two answers that of the finer method, unless only the coarser one converged; the work of both is counted.
#[test]
fn the_finer_answer_is_preferred() {
    let coarse = |converged: bool| Attempt::new(Ok(answer("coarse", 10.0, 1.0, converged)));
    let fine = |converged: bool| Ok(answer("fine", 12.0, 1.0, converged));
    let name = |attempt: Attempt| attempt.answer().unwrap().method.integrator;
    for (before, again, expected) in
        [(true, true, "fine"), (true, false, "coarse"), (false, true, "fine"), (false, false, "fine")]
    {
        assert_eq!(name(coarse(before).or(fine(again), false)), expected, "{before} {again}");
    }
    assert_eq!(name(Attempt::new(Err(failure())).or(fine(false), false)), "fine");
    assert_eq!(name(coarse(false).or(Err(failure()), false)), "coarse");
    assert!(Attempt::new(Err(failure())).or(Err(failure()), false).answer().is_err());
    let both = coarse(true).or(fine(true), false).answer().unwrap();
    assert_eq!((both.iterations, both.evaluations), (6, 10));
}

/// A coarse minimum that leaves an output unexplained gives way to a search by a finer method that is lower, wherever that ended; one that
/// explains it does not.
#[test]
fn a_minimum_that_explains_nothing_gives_way() {
    let unexplained = Warning::new(WarningCode::Unexplained, Severity::NotUsable, String::new());
    for (deviance, warned, expected) in [(9.0, true, "fine"), (11.0, true, "coarse"), (9.0, false, "coarse")] {
        let warnings = if warned { vec![unexplained.clone()] } else { vec![] };
        let before = Summary { warnings: warnings.clone(), ..answer("coarse", 10.0, 1.0, true) };
        let again = Summary { warnings, ..answer("fine", deviance, 1.0, false) };
        let found = Attempt::new(Ok(before)).or(Ok(again), false).answer().unwrap();
        assert_eq!(found.method.integrator, expected, "{deviance} {warned}");
    }
}

/// Two steps whose minima leave an output unexplained and differ by less than 0.01 in deviance for each of 8 measurements: no adaptive method
/// follows. One follows where the finer step lowers the deviance, where it explains the output, and after one minimum only.
#[test]
fn no_step_is_the_reason() {
    let unexplained = Warning::new(WarningCode::Unexplained, Severity::NotUsable, String::new());
    let of = |deviance: f64, warned: bool, converged: bool| {
        let warnings = if warned { vec![unexplained.clone()] } else { vec![] };
        Summary { warnings, ..answer("steps", deviance, 1.0, converged) }
    };
    let after =
        |finer: Summary| Attempt::new(Ok(of(10.0, true, true))).or(Ok(finer), false).is_unexplained_by_any_step();
    assert!(after(of(10.07, true, true)) && after(of(9.93, true, true)));
    assert!(!after(of(9.91, true, true)) && !after(of(10.0, false, true)) && !after(of(9.95, true, false)));
    assert!(!Attempt::new(Ok(of(10.0, true, true))).is_unexplained_by_any_step());
}

/// Starts that could not be simulated are tried by finer methods. The estimate stays, unless they find a better minimum.
#[test]
fn lost_starts_are_tried_again() {
    use crate::estimate::{FailedStart, Minimum};
    let starts = |lost: bool| {
        let minimum = Minimum { cost_ratio: 1.0, searches: 1, undetermined: vec![], unknowns: vec![] };
        let failed = FailedStart { start: vec![], evaluated: false, reason: String::new() };
        let failed = if lost { vec![failed] } else { vec![] };
        Some(Starts { tried: 2, agreed: 1, minima: vec![minimum], declared: None, failed, evaluations: 5 })
    };
    let before = Summary { starts: starts(true), ..answer("coarse", 10.0, 1.0, true) };
    for (deviance, expected) in [(9.0, "coarse"), (5.0, "fine")] {
        let attempt = Attempt::new(Ok(before.clone()));
        assert!(attempt.is_coarse());
        let again = Summary { starts: starts(false), ..answer("fine", deviance, 2.0, true) };
        let attempt = attempt.or(Ok(again), false);
        assert!(!attempt.is_coarse());
        let found = attempt.answer().unwrap();
        assert_eq!((found.method.integrator.as_str(), found.iterations), (expected, 6));
        assert!(found.starts.unwrap().failed.is_empty());
    }
}

/// The warning about a coarser minimum: more than 15 lower in deviance is a warning, more than 4 a note; otherwise a note where
/// its value is more than a standard error away and it does not explain the data worse by 4. One that did not converge says
/// nothing.
#[test]
fn coarser_minima_are_said() {
    let said = |deviance: f64, value: f64, converged: bool| {
        let attempt = Attempt::new(Ok(answer("coarse", deviance, value, converged)));
        let found = attempt.or(Ok(answer("fine", 100.0, 7.0, true)), false).answer().unwrap();
        found.warnings.iter().map(|warning| (warning.severity, warning.text.clone())).next()
    };
    let severity = |deviance: f64, value: f64| said(deviance, value, true).map(|(severity, _)| severity);
    assert_eq!([severity(84.9, 7.0), severity(85.1, 7.0)], [Some(Severity::UsableWithCare), Some(Severity::Usable)]);
    assert_eq!([severity(95.9, 7.0), severity(96.1, 7.0)], [Some(Severity::Usable), None]);
    assert_eq!([severity(103.9, 8.1), severity(104.1, 8.1)], [Some(Severity::Usable), None]);
    assert_eq!([severity(100.0, 8.1), severity(100.0, 5.9)], [Some(Severity::Usable); 2]);
    assert_eq!([severity(100.0, 7.9), severity(100.0, 6.1)], [None; 2]);
    assert_eq!(said(80.0, 9.0, false), None);
    let (_, better) = said(80.0, 7.0, true).unwrap();
    assert!(better.starts_with("coarse explains the data better than fine, by 20 in"), "{better}");
    let (_, moved) = said(101.5, 9.5, true).unwrap();
    let words = ["the step decides `a`", "coarse gives 9.5 A/V, 2.5 standard errors away", "differs by 1.5)"];
    assert!(words.iter().all(|word| moved.contains(word)), "{moved}");
}

/// Methods are compared with the farthest of several coarser ones.
#[test]
fn the_farthest_of_several_is_said() {
    let attempt = Attempt::new(Ok(answer("first", 100.0, 9.0, true)));
    let attempt =
        attempt.or(Ok(answer("second", 101.0, 3.0, true)), false).or(Ok(answer("third", 102.0, 7.0, true)), false);
    let found = attempt.answer().unwrap();
    assert!(found.warnings[0].text.contains("second gives 3 A/V"), "{}", found.warnings[0].text);
}

/// An adaptive method that is too coarse, too, does not take the place of the steps before it, if these were converged and not useless;
/// the work of both is counted.
#[test]
fn an_adaptive_method_that_is_no_finer() {
    let of = |name: &str, refinement: usize, severity: Option<Severity>| {
        let coarse = |severity| Warning::new(WarningCode::CoarseStep, severity, String::new()).about(About::Step);
        let mut found = answer(name, 10.0, 1.0, true);
        found.method.refinement = refinement;
        Summary { warnings: severity.map(coarse).into_iter().collect(), ..found }
    };
    let care = Some(Severity::UsableWithCare);
    let taken = |before: Summary, again: Summary, adaptive: bool| {
        let found = Attempt::new(Ok(before)).or(Ok(again), adaptive).answer().unwrap();
        assert_eq!((found.iterations, found.evaluations), (6, 10));
        found.method.integrator
    };
    assert_eq!(taken(of("steps", 3, care), of("adaptive", 4, care), true), "steps");
    assert_eq!(taken(of("steps", 3, care), of("finer", 4, care), false), "finer");
    assert_eq!(taken(of("steps", 3, care), of("adaptive", 4, None), true), "adaptive");
    assert_eq!(taken(of("steps", 3, Some(Severity::NotUsable)), of("adaptive", 4, care), true), "adaptive");
    assert_eq!(taken(of("steps", 1, care), of("adaptive", 4, care), true), "adaptive");
    let lost = Summary { outcome: Outcome::TimeLimit, ..of("steps", 3, care) };
    assert_eq!(taken(lost, of("adaptive", 4, care), true), "adaptive");
}

/// What slopes say of a still finer step does not count where the finer one has left the unknown within a tenth of a standard error; it does where the
/// unknown has moved, and where the simulation with a finer step fails.
#[test]
fn a_search_with_a_finer_step_tells_more_than_slopes() {
    let coarse = || Warning::new(WarningCode::CoarseStep, Severity::NotUsable, String::new()).about(About::Step);
    let fails = || Warning::new(WarningCode::NotAtMinimum, Severity::NotUsable, String::new()).about(About::Search);
    let left = |value: f64, converged: bool, further: Option<Warning>| {
        let warned = |found: Summary, all: Vec<Warning>| Summary { warnings: all, ..found };
        let before = warned(answer("first", 10.0, 1.0, converged), vec![coarse()]);
        let again = warned(answer("second", 10.0, value, true), further.into_iter().chain([coarse()]).collect());
        Attempt::new(Ok(before)).or(Ok(again), false).is_coarse()
    };
    assert!(!left(1.05, true, None));
    assert!(left(1.2, true, None) && left(1.05, false, None) && left(1.05, true, Some(fails())));
}

/// A first-order lag.
#[derive(Clone)]
struct Lag;

impl Model for Lag {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Gain;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
        Current { i: (u.u - x.i) * p.a }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
        *x
    }
}

/// One step of Runge-Kutta's method damps the most at 1.596 times the inverse of the step, where the slope of every prediction is zero: the logarithm of a
/// decay of 1.8 with samples one second apart is not held there, and finer steps find it, to a percent by the errors of a hundredth.
#[test]
fn a_logarithm_without_slopes_at_a_coarse_step() {
    let (mut x, mut inputs, mut outputs) = (0.0, vec![], vec![]);
    for k in 0..300u32 {
        let u = f64::from(k / 6 * 37 % 21) / 10.0 - 1.0;
        outputs.push(Current { i: x + 0.01 * (f64::from(k * 11 % 17) / 8.0 - 1.0) });
        inputs.push(Voltage { u });
        x = u + (x - u) * f64::exp(-1.8);
    }
    let record = Experiment::new(&Lag, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let record = record.initial(Current { i: fixed(0.0) });
    let found = Fit::new(&Lag, &record).parameters(Gain { a: free(2.25).log() }).run().unwrap();
    assert!((found.parameters.a / 1.8 - 1.0).abs() < 0.02, "{found}");
    assert!(found.unknowns[0].knowledge.standard_error().is_some_and(|error| error < 0.05), "{found}");
}
