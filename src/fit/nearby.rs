//! Searches from places near an estimate where the cost is not smooth, and may have several minima within the errors of each other.

mod dead_times;

use super::search::{at_end, settled};
use super::starts::search_from_many;
use crate::covariance::SearchEnd;
use crate::estimate::{About, Minimum, Starts, Summary, Warning, WarningCode, times_the_cost};
use crate::judge::conclude;
use crate::numeral::number;
use crate::problem::{Control, Lead, Problem, SearchPlan, Settings};
use crate::random::Random;
use crate::severity::Severity;
use std::time::Instant;

/// Places from which searches begin.
const PLACES: usize = 8;
const SEED: u64 = 0x4e45_4152;
/// Their distance from the estimate: the standard deviation in each unknown, in standard errors. Of an axis with dry friction 9 of 24 searches from such
/// places end in the better one of two minima, 6 of 24 from a third of the distance, none from a tenth.
const DISTANCE: f64 = 3.0;
/// The most samples of all records with which such searches are made without being asked, so that they take seconds: of models that run in vector
/// registers, and of others.
const LONGEST_IN_LANES: usize = 100_000;
const LONGEST: usize = 5_000;
const ROUGH: &str = "the errors are colored, and the cost does not rise as its slopes say beside";

/// Why searches begin near an estimate.
#[derive(Clone, Copy, PartialEq)]
enum Reason {
    Rough,
    DeadTime,
}

impl Problem<'_> {
    /// The estimate at the lowest minimum that searches from places near an estimate find; the same estimate where none is lower. Both with the
    /// evaluations of all searches. Searches are made where errors are colored and the cost does not rise as its slopes say, and where a dead time is an
    /// unknown. `None` elsewhere, for long records, for filters, and where no search finds a minimum that is as good as the end before.
    pub(super) fn searched_nearby(&self, found: &Summary, control: &Control) -> Option<Summary> {
        let longest = if self.runs_in_lanes() { LONGEST_IN_LANES } else { LONGEST };
        if self.settings.searches == SearchPlan::All(1)
            || self.sweep.predicts_variance()
            || self.samples() > longest
            || control.stops()
        {
            return None;
        }
        let begin = Instant::now();
        let method = self.by_number(found.method.refinement);
        let asked = matches!(self.settings.searches, SearchPlan::All(_));
        let (places, reason) = match is_rough(found) {
            true => (method.places_near(found)?, Reason::Rough),
            false if asked => return None,
            false => (method.beside_dead_times(found)?, Reason::DeadTime),
        };
        let tried = places.len();
        let ends = with_places(found, places);
        let searches = if asked { SearchPlan::All } else { SearchPlan::Best }(ends.minima.len());
        let settings = Settings { checkpoint: None, lead: Lead::Declared, searches, ..method.settings.clone() };
        let problem = Problem { settings, finer: None, ..method.clone() };
        let trials = self.settings.optimizer.most().saturating_sub(found.iterations);
        let (plain, optimizer) = (problem.in_units(control), problem.settings.optimizer.limited(trials));
        let end = search_from_many(&plain, &optimizer, ends.minima.len(), Some(&ends)).ok()?;
        let starts = end.starts.clone()?;
        let evaluations = found.evaluations + starts.evaluations - ends.evaluations;
        // The first minimum that was passed on is that of the estimate, if it is one.
        let before = starts.declared.and_then(|declared| starts.minima.get(declared));
        if reason == Reason::Rough && before.is_none() {
            return None;
        }
        let lower = starts.declared != Some(0) && end.outcome.converged();
        let mut best = found.clone();
        if lower {
            let end = settled(&plain, SearchEnd { starts: asked.then(|| starts.clone()), ..end });
            best = conclude(&at_end(&plain, &end), &end, 0.0).ok()?;
            // An end that is no minimum may still be lower than each minimum that was found.
            if before.is_none() && is_higher(&best, found) {
                return None;
            }
        }
        best.warnings.extend(match reason {
            Reason::Rough => Some(rough(&starts, before.filter(|_| lower))),
            Reason::DeadTime => dead_times::warning(&starts, before.filter(|_| lower), &best, tried),
        });
        let seconds = found.seconds + begin.elapsed().as_secs_f64();
        let iterations = found.iterations + if lower { best.iterations } else { 0 };
        Some(Summary { iterations, evaluations, seconds, ..best })
    }

    /// Coordinates of places near an estimate; `None` where an unknown has no standard error.
    fn places_near(&self, found: &Summary) -> Option<Vec<Vec<f64>>> {
        let unknowns = found.unknowns.iter().zip(self.unknowns.bounds()).enumerate();
        let columns = unknowns.map(|(i, (unknown, (lower, upper)))| {
            let error = unknown.knowledge.standard_error()? / unknown.transform.slope(unknown.value);
            let at = unknown.transform.to_coordinate(unknown.value);
            let mut random = Random::stream(SEED, i as u64);
            let place = |_| (at + DISTANCE * error * random.normal()).max(lower).min(upper);
            Some((0..PLACES).map(place).collect())
        });
        let columns: Vec<Vec<f64>> = columns.collect::<Option<_>>()?;
        Some((0..PLACES).map(|place| columns.iter().map(|column| column[place]).collect()).collect())
    }
}

/// Whether errors are colored, and the cost does not rise from an estimate as its slopes say.
fn is_rough(found: &Summary) -> bool {
    let is_warned =
        |code| found.warnings.iter().any(|warning| warning.code == code && warning.severity > Severity::Usable);
    is_warned(WarningCode::ColoredErrors) && is_warned(WarningCode::CurvedInterval) && found.outcome.converged()
}

/// Whether the data are explained less well: by `-2 ln` of the likelihood, or, with a loss or weights, by the cost.
fn is_higher(one: &Summary, other: &Summary) -> bool {
    match (one.deviance, other.deviance) {
        (Some(one), Some(other)) => one > other,
        _ => one.cost > other.cost,
    }
}

/// How much higher the cost is at a minimum, and where it lies.
fn at(minimum: &Minimum) -> String {
    let place = minimum.unknowns.iter().map(|(name, value)| format!("`{name}` = {}", number(*value, 5)));
    format!("{} at {}", times_the_cost(minimum.cost_ratio), place.collect::<Vec<_>>().join(", "))
}

/// How many of the searches led to the best minimum.
fn led(starts: &Starts) -> String {
    if starts.agreed == 1 { "one led".to_owned() } else { format!("{} led", starts.agreed) }
}

/// What is said of searches where the cost is rough, with the minimum before if theirs is lower.
fn rough(starts: &Starts, before: Option<&Minimum>) -> Warning {
    let (severity, text) = match before {
        Some(before) => (
            Severity::UsableWithCare,
            format!(
                "{ROUGH} the minimum that was found first, with {}: of {PLACES} searches from places near it {} to this one",
                at(before),
                led(starts)
            ),
        ),
        None => (
            Severity::Usable,
            format!("{ROUGH} this minimum: none of {PLACES} searches from places near it ended in a lower one"),
        ),
    };
    Warning::new(WarningCode::DeclaredStartElsewhere, severity, text).about(About::Minimum)
}

/// Minima from which searches go on: that of an estimate, others that were found with it, and these places.
fn with_places(found: &Summary, places: Vec<Vec<f64>>) -> Starts {
    let minimum = |values: Vec<f64>| {
        let names = found.unknowns.iter().map(|unknown| unknown.name.clone());
        Minimum { cost_ratio: 1.0, searches: 1, undetermined: vec![], unknowns: names.zip(values).collect() }
    };
    let values = |place: Vec<f64>| {
        let values = place.iter().zip(&found.unknowns).map(|(x, unknown)| unknown.transform.to_value(*x));
        minimum(values.collect())
    };
    let estimate = || minimum(found.unknowns.iter().map(|unknown| unknown.value).collect());
    let none =
        || Starts { tried: 1, agreed: 1, minima: vec![estimate()], declared: Some(0), failed: vec![], evaluations: 0 };
    let mut starts = found.starts.clone().unwrap_or_else(none);
    starts.tried += places.len() as u64;
    starts.minima.extend(places.into_iter().map(values));
    starts.declared = Some(0);
    starts
}

#[cfg(test)]
mod tests {
    use crate::models::{AxisMotion, AxisParameters, Command, Positioning};
    use crate::{Experiment, Fit, Severity, Simulator, Summary, Time, fixed, free};

    /// A fit of an axis with dry friction under two sines, number `n`, with a slow sine of 2 mm in its errors, from this mass, viscous and dry friction.
    fn fitted(n: u32, m: f64, fv: f64, fc: f64) -> Summary {
        let (truth, n) = (AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 }, f64::from(n));
        let force = |t: f64| 1.2 * ((1.0 + 0.13 * n) * t).sin() + 0.8 * (3.1 * t + n).sin();
        let inputs: Vec<Command> = (0..2000).map(|k| Command { vir: force(0.004 * f64::from(k)) }).collect();
        let time = Time::Uniform { start: 0.0, step: 0.004 };
        let (axis, rest) = (Positioning::EMPS, AxisMotion { q: 0.0, v: 0.0 });
        let mut run = Simulator::new(&axis).run(&truth, &rest, time.clone(), &inputs).unwrap();
        run.outputs.iter_mut().enumerate().for_each(|(k, y)| y.qm += 0.002 * (0.01 * k as f64 + n).sin());
        let record = Experiment::new(&axis, time, inputs, run.outputs).unwrap();
        let record = record.initial(AxisMotion { q: free(0.0), v: fixed(0.0) });
        let parameters = AxisParameters { m: free(m), fv: free(fv), fc: free(fc), offset: free(-3.0) };
        Fit::new(&axis, &record).parameters(parameters).run().unwrap().summary().clone()
    }

    fn says(found: &Summary, what: &str) -> bool {
        found.warnings.iter().any(|warning| warning.text.contains(what))
    }

    /// From a mass that is too small and too much dry friction the search is stuck where the axis hardly moves; stages lead to the minimum at which
    /// a start near the truth ends.
    #[test]
    fn a_search_that_is_stuck_is_followed_by_others() {
        for n in [21, 66] {
            let (far, near) = (fitted(n, 20.0, 50.0, 60.0), fitted(n, 95.0, 200.0, 20.0));
            assert!(says(&far, "ended at no minimum") && far.severity() < Severity::NotUsable, "{far}");
            let part = far.outputs[0].fit.rmse / near.outputs[0].fit.rmse;
            assert!((part - 1.0).abs() < 1e-6, "{part} {far}");
        }
    }

    /// Beside the minimum to which a start near the truth leads there is a lower one. Of 8 searches 4 end there, none from a thirtieth of the distance.
    #[test]
    fn a_lower_minimum_within_some_standard_errors_is_found() {
        let found = fitted(130, 90.0, 230.0, 18.0);
        let text = "found first, with 1.03 times the cost at `m` = 111.28";
        assert!(says(&found, text) && says(&found, "4 led to this one"), "{found}");
        assert!(found.severity() == Severity::UsableWithCare && found.starts.is_none(), "{found}");
    }
}
