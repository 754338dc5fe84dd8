//! Fits of plants that oscillate faster than the samples show: a search on the other side of half the frequency of sampling.

use super::elsewhere::Trials;
use super::refine::{Start, farthest};
use crate::estimate::{About, Summary, Unknown, Warning, WarningCode};
use crate::judge::{Aliases, INDISTINGUISHABLE};
use crate::numeral::{number, unit_after};
use crate::optimize::Outcome;
use crate::problem::{Control, Problem, Settings};
use crate::severity::Severity;
use std::time::Instant;

/// Ends whose unknowns differ by less than this part of a standard error are the same.
const SAME: f64 = 0.1;
/// An estimate, after its deviance.
type End = (f64, Summary);

/// Limits of the fit that may have ended searches early.
#[derive(Clone, Copy)]
struct Limits {
    /// They had fewer trial steps than they may take: those that ended at a minimum did not need more.
    fewer: bool,
    /// The clock or a flag ended them.
    stop: bool,
}

impl Problem<'_> {
    /// Compares an estimate that is warned of an alias with the ends of searches that begin where its oscillation has another frequency
    /// with the same samples. Returns the best end, with a note or a warning about the others and the evaluations of all searches; the
    /// estimate itself if it explains the data as well as the best. `None` where there is nothing to compare.
    pub(super) fn on_both_sides(
        &self,
        found: &Summary,
        Trials { most: trials, short }: Trials,
        begin: Instant,
        control: &Control,
    ) -> Option<Summary> {
        if !has_rivals(found) {
            return None;
        }
        let finest = self.by_number(found.method.refinement);
        let settings = Settings { checkpoint: None, ..finest.settings.clone() };
        let problem = Problem { settings, ..finest.clone() };
        let (objective, x) = problem.at_within(found, control).ok()?;
        let Aliases { frequency, others } = Aliases::at(&objective, &x)?;
        let mut frequencies = vec![number(frequency, 3)];
        frequencies.extend(others.iter().map(|(frequency, _)| number(*frequency, 3)));
        frequencies.dedup();
        let search = |(_, coordinates): (f64, Vec<f64>)| {
            let start = Start { coordinates, trials, ends: None, stages: None };
            let end = problem.run_on(problem.run_within(begin, control, start), trials, begin, control);
            self.refined(end, finest.method, begin, control).ok()
        };
        let ends = std::iter::once(found.clone()).chain(others.into_iter().filter_map(search));
        let ends: Vec<End> = ends.filter_map(|end| Some((end.deviance?, end))).collect();
        let limits = Limits { fewer: short, stop: control.stops() };
        let per = self.records[0].time_unit().angular_frequency();
        best(ends, &format!("{} {per}", frequencies.join(" or ")), limits)
    }
}

/// Whether an estimate leaves open which of two frequencies is right, and can be compared with others: not without a likelihood,
/// nor where the cost is too rough for a minimum, nor where another frequency would not make it usable.
fn has_rivals(found: &Summary) -> bool {
    let useless = |warning: &Warning| {
        let cured =
            matches!(warning.code, WarningCode::NotAtMinimum | WarningCode::CoarseStep | WarningCode::WrongShape);
        warning.severity == Severity::NotUsable && !cured
    };
    let rough = matches!(found.outcome, Outcome::Rough { .. }) && !found.outcome.converged();
    let warned = found.warnings.iter().any(is_open) && !found.warnings.iter().any(useless);
    warned && !rough && found.deviance.is_some()
}

/// Whether a warning leaves open which of two frequencies is right.
fn is_open(warning: &Warning) -> bool {
    warning.about == About::Frequency
}

/// Chooses among the ends of searches that began where the model has these frequencies: the first minimum whose deviance is
/// within [`INDISTINGUISHABLE`] of the least. `None` if there is one end only, or no minimum. Where limits of the fit ended a
/// search early, a better minimum may have been missed, which is said.
fn best(mut ends: Vec<End>, frequencies: &str, limits: Limits) -> Option<Summary> {
    let stopped = limits.stop || limits.fewer && ends.iter().any(|(_, end)| !end.outcome.converged());
    let (iterations, evaluations) =
        ends.iter().fold((0, 0), |(i, e), (_, end)| (i + end.iterations, e + end.evaluations));
    let distance = |one: &Summary, other: &End| farthest(one, other.1.unknowns.iter().map(|unknown| unknown.value));
    let is_at = |one: &Summary, other: &End| distance(one, other).is_none_or(|(_, errors)| errors <= SAME);
    let minima = ends.iter().filter(|(_, end)| end.outcome.converged());
    let least = minima.map(|(deviance, _)| *deviance).min_by(f64::total_cmp).filter(|_| ends.len() > 1)?;
    let is_best = |(deviance, end): &End| end.outcome.converged() && *deviance <= least + INDISTINGUISHABLE;
    let kept = ends.iter().position(is_best)?;
    let (deviance, mut best) = ends.remove(kept);
    let rival = ends.iter().filter(|end| !is_at(&best, end)).min_by(|a, b| a.0.total_cmp(&b.0));
    let rival = rival.and_then(|rival| Some((rival, distance(&best, rival)?.0)));
    let begun = format!("the samples do not show whether the plant oscillates at {frequencies}");
    let (severity, text) = match rival {
        None => (Severity::Usable, format!("{begun}: searches begun at each of them ended in one minimum")),
        Some((other, i)) => {
            let Unknown { name, unit, value, .. } = &other.1.unknowns[i];
            let place = format!("`{name}` = {}{}", number(*value, 5), unit_after(unit));
            let better = number((other.0 - deviance).abs(), 2);
            if other.0 - deviance > INDISTINGUISHABLE {
                let text = format!(
                    "{begun}: of the ends of searches begun at each of them, this minimum is the best by {better} in -2 ln of the \
                     likelihood; the next end is at {place}"
                );
                (Severity::Usable, text)
            } else {
                let rival = if other.1.outcome.converged() { "minimum" } else { "end of a search, no minimum," };
                let text = format!(
                    "{begun}, and another {rival} explains the data as well, at {place} (-2 ln of the likelihood differs by \
                     {better}): bounds or a prior must tell which one is meant; or sample faster"
                );
                (Severity::UsableWithCare, text)
            }
        }
    };
    let (severity, text) = match stopped {
        true => (Severity::UsableWithCare, format!("{text}; limits of the fit stopped searches before their end")),
        false => (severity, text),
    };
    best.warnings.retain(|warning| !is_open(warning));
    best.warnings.push(Warning::new(WarningCode::Aliased, severity, text).about(About::Minimum));
    Some(Summary { iterations, evaluations, ..best })
}

#[cfg(test)]
mod tests {
    use super::super::refine::tests::answer;
    use super::*;
    use crate::{Experiment, Fit, Model, Rk4, Scalar, Simulator, Time, free, signals};

    const NONE: Limits = Limits { fewer: false, stop: false };

    /// Ends of these deviances, values (of a standard error of one) and convergence: the deviance of the best, with what is said.
    fn judged(ends: &[(f64, f64, bool)], limits: Limits) -> Option<(f64, Severity, String)> {
        let open = Warning::new(WarningCode::Aliased, Severity::UsableWithCare, String::new()).about(About::Frequency);
        let end = |&(deviance, value, converged): &(f64, f64, bool)| {
            let end = answer("fine", deviance, value, converged);
            (deviance, Summary { warnings: vec![open.clone()], ..end })
        };
        let best = best(ends.iter().map(end).collect(), "5 or 6", limits)?;
        let count = ends.len() as u64;
        assert_eq!((best.iterations, best.evaluations, best.warnings.len()), (3 * count, 5 * count, 1));
        let Warning { severity, text, .. } = best.warnings[0].clone();
        Some((best.deviance?, severity, text))
    }

    #[test]
    fn what_has_rivals() {
        let with = |codes: &[(WarningCode, Severity)]| {
            let about = |code| if code == WarningCode::Aliased { About::Frequency } else { About::Estimate };
            let warning = |&(code, severity)| Warning::new(code, severity, String::new()).about(about(code));
            Summary { warnings: codes.iter().map(warning).collect(), ..answer("fine", 100.0, 1.0, true) }
        };
        let open = (WarningCode::Aliased, Severity::UsableWithCare);
        let cured = (WarningCode::CoarseStep, Severity::NotUsable);
        let useless = (WarningCode::Unexplained, Severity::NotUsable);
        let harmless = (WarningCode::Unexplained, Severity::UsableWithCare);
        let found = [&[open][..], &[open, cured], &[open, harmless], &[open, useless], &[cured], &[]].map(with);
        assert_eq!(found.each_ref().map(has_rivals), [true, true, true, false, false, false]);
        let [one, ..] = found;
        assert!(!has_rivals(&Summary { deviance: None, ..one.clone() }));
        let rough = |errors: f64| Summary { outcome: Outcome::Rough { noise: 1.0, errors }, ..one.clone() };
        assert_eq!([rough(0.0), rough(10.0)].map(|one| has_rivals(&one)), [true, false]);
    }

    /// A minimum that is better by more than 10 in deviance is told from the others; of those within 10 the first is taken, and the
    /// difference is said without a sign.
    #[test]
    fn minima_on_both_sides() {
        use Severity::{Usable, UsableWithCare};
        let verdict =
            |ends: &[(f64, f64, bool)]| judged(ends, NONE).map(|(deviance, severity, _)| (deviance, severity));
        assert_eq!(verdict(&[(100.0, 1.0, true), (110.1, 7.0, true)]), Some((100.0, Usable)));
        assert_eq!(verdict(&[(110.1, 1.0, true), (100.0, 7.0, true)]), Some((100.0, Usable)));
        assert_eq!(verdict(&[(109.9, 1.0, true), (100.0, 7.0, true)]), Some((109.9, UsableWithCare)));
        let (_, _, text) = judged(&[(105.0, 1.0, true), (100.0, 7.0, true)], NONE).unwrap();
        assert!(text.contains("at `a` = 7 A/V (-2 ln of the likelihood differs by 5)"), "{text}");
        let (_, severity, text) = judged(&[(100.0, 1.0, true), (100.0, 1.09, true)], NONE).unwrap();
        assert!(severity == Usable && text.ends_with("at each of them ended in one minimum"), "{text}");
        assert_eq!(verdict(&[(100.0, 1.0, true), (100.0, 1.11, true)]), Some((100.0, UsableWithCare)));
    }

    /// An end that is no minimum is never the best, and searches that were stopped tell nothing for certain.
    #[test]
    fn ends_that_are_no_minima() {
        assert_eq!(judged(&[(100.0, 1.0, true)], NONE), None);
        assert_eq!(judged(&[(100.0, 1.0, false), (90.0, 1.0, false)], NONE), None);
        let (deviance, severity, _) = judged(&[(100.0, 1.0, false), (150.0, 7.0, true)], NONE).unwrap();
        assert_eq!((deviance, severity), (150.0, Severity::UsableWithCare));
        let (_, _, text) = judged(&[(105.0, 1.0, true), (100.0, 7.0, false)], NONE).unwrap();
        assert!(
            text.contains("another end of a search, no minimum, explains the data as well, at `a` = 7 A/V"),
            "{text}"
        );
        let (deviance, severity, text) =
            judged(&[(100.0, 1.0, true), (150.0, 7.0, false)], Limits { stop: true, ..NONE }).unwrap();
        assert_eq!((deviance, severity), (100.0, Severity::UsableWithCare));
        assert!(text.ends_with("limits of the fit stopped searches before their end"), "{text}");
        // Too few trial steps for one of the searches, or enough for all.
        let few = Limits { fewer: true, ..NONE };
        let (_, severity, few_text) = judged(&[(100.0, 1.0, true), (150.0, 7.0, false)], few).unwrap();
        assert_eq!((severity, few_text), (Severity::UsableWithCare, text));
        let ended = [(100.0, 1.0, true), (150.0, 7.0, true)];
        assert_eq!(judged(&ended, few), judged(&ended, NONE));
    }

    signals! { struct Motion { x: "m", v: "m/s" } }
    signals! { struct Force { f: "N" } }
    signals! { struct Place { x: "m" } }
    signals! { struct Spring { k: "N/m" } }

    /// A mass of 1 kg on a spring: 7 rad/s with `k` = 49 N/m.
    #[derive(Clone)]
    struct Oscillator;

    impl Model for Oscillator {
        type State = Motion;
        type Input = Force;
        type Output = Place;
        type Parameters = Spring;

        fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
            Motion { x: x.v, v: u.f - p.k * x.x - x.v * 0.2 }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Place<S> {
            Place { x: x.x }
        }
    }

    /// The time of the searches is added to that of the estimate, here so long that no search takes a thousandth of it.
    #[test]
    fn the_time_of_all_searches_counts() {
        let inputs: Vec<Force> = (0..60).map(|k| Force { f: f64::from(k * k % 7) - 3.0 }).collect();
        let time = Time::Uniform { start: 0.0, step: 0.4 };
        let initial = Motion { x: 0.0, v: 0.0 };
        let simulator = Simulator::new(&Oscillator).integrator(Rk4::default());
        let exact = simulator.run(&Spring { k: 49.0 }, &initial, time.clone(), &inputs).unwrap().outputs;
        let outputs =
            exact.iter().zip(0..).map(|(y, k)| Place { x: y.x + 1e-3 * (f64::from(k * k % 11) - 5.0) }).collect();
        let record = Experiment::new(&Oscillator, time, inputs, outputs).unwrap();
        let problem = Fit::new(&Oscillator, &record).parameters(Spring { k: free(45.0) }).problem().unwrap();
        let never = Control::NEVER;
        let found = problem.run_within(Instant::now(), &never, Start::declared(&problem)).unwrap();
        let long = Summary { seconds: 1e9, ..found };
        let found = problem.searched_elsewhere(&long, None, &never).unwrap();
        assert!((found.seconds / 1e9 - 1.0).abs() < 1e-3 && found.seconds > 1e9, "{}", found.seconds);
        assert!(found.evaluations > long.evaluations, "{found}");
    }
}
