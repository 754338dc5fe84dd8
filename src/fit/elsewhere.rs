//! Searches that a fit runs by itself after its estimate was judged, since another minimum may be the right one: on the other side of
//! half the frequency of sampling, and from further starts and in stages where an output is left unexplained.

use super::further::{Further, Reason, SAME, STARTS, Way, leaves_unexplained, with_work_of};
use super::moves::{EXPLAINS, Moves};
use super::refine::{Start, is_only_coarse, is_useless};
use super::staged::{is_stuck, noted};
use crate::estimate::{About, OutputEstimate, Summary, Warning, WarningCode};
use crate::optimize::Outcome;
use crate::problem::{Control, Lead, Noise, Problem, SearchPlan, Settings};
use crate::severity::Severity;
use std::time::Instant;

/// Most trial steps of a further search: so many, or so many times those of the search before, by where it begins.
const LEAST_TRIALS: u64 = 100;
const FROM_A_START: u64 = 1;
const FROM_THE_OTHER_SIDE: u64 = 3;

/// The most samples of all records with which a fit searches from further starts without being asked, so that this takes seconds: of models
/// that run in vector registers, and of others.
const LONGEST_IN_LANES: usize = 20_000;
const LONGEST: usize = 2_000;

/// The most trial steps of each further search, at least one, and whether the user's limit makes them fewer.
#[derive(Clone, Copy)]
pub(super) struct Trials {
    pub most: u64,
    pub short: bool,
}

impl Trials {
    /// A multiple of the trial steps of a search, at most as many as it left of the user's limit; `None` where it left none.
    fn of(times: u64, iterations: u64, limit: u64) -> Option<Self> {
        let wanted = LEAST_TRIALS.max(times * iterations);
        let most = wanted.min(limit.saturating_sub(iterations));
        (most > 0).then_some(Trials { most, short: most < wanted })
    }
}

impl Problem<'_> {
    /// The estimate after further searches from other starts, with their time and evaluations; `None` if it needs none, or if the fit's
    /// limits of time and trial steps are used up. `further` is what searches from further starts found before, if there were any.
    pub(super) fn searched_elsewhere(
        &self,
        found: &Summary,
        further: Option<&Further>,
        control: &Control,
    ) -> Option<Summary> {
        let searched = self.searched(found, further, control);
        let searched = self.compared_with_simulation(searched.as_ref().unwrap_or(found), control).or(searched);
        let local = self.may_be_local(searched.as_ref().unwrap_or(found), control);
        let searched = self.searched_nearby(searched.as_ref().unwrap_or(found), control).or(searched);
        match local {
            Some(note) => Some(noted(searched.unwrap_or_else(|| found.clone()), Some(note))),
            None => searched,
        }
    }

    /// A note that the minimum may be a local one: a single search led to it from a start whose simulation is far off, and its errors are colored, as
    /// those of a local minimum are.
    fn may_be_local(&self, found: &Summary, control: &Control) -> Option<Warning> {
        let searched = |warning: &Warning| {
            warning.code == WarningCode::Staged
                || warning.code == WarningCode::Unexplained && warning.about == About::Search
        };
        let is_noted = found.warnings.iter().any(searched) || !self.leads_to_color(found);
        if is_noted || self.start_explains(control) != Some(false) {
            return None;
        }
        let text = "a simulation from the declared start is off by more than a quarter of an output's range (rms), and the errors where the search \
                    ended are colored: a lower minimum may lie elsewhere; Fit::staged and Fit::starts look for it";
        Some(Warning::new(WarningCode::Staged, Severity::Usable, text.to_owned()).about(About::Search))
    }

    /// Whether the errors of a simulation are colored, where a single search from the declared start was asked for.
    fn leads_to_color(&self, found: &Summary) -> bool {
        let is_colored =
            |warning: &Warning| warning.code == WarningCode::ColoredErrors && warning.severity > Severity::Usable;
        self.settings.searches == SearchPlan::Single
            && self.settings.lead == Lead::Declared
            && self.sweep.restarts().is_none()
            && !self.sweep.predicts_variance()
            && !self.layout().states.is_empty()
            && found.warnings.iter().any(is_colored)
    }

    /// Why an estimate is to be followed by further searches; `None` if it is not.
    fn reason(&self, found: &Summary) -> Option<Reason> {
        let by_itself = is_stuck(found.outcome) || matches!(found.outcome, Outcome::OwnLimit { .. });
        if leaves_unexplained(found) {
            Some(Reason::Unexplained)
        } else if by_itself && found.severity() == Severity::NotUsable && self.leads_to_color(found) {
            Some(Reason::Stuck)
        } else {
            None
        }
    }

    fn searched(&self, found: &Summary, further: Option<&Further>, control: &Control) -> Option<Summary> {
        if self.reason(found).is_some() {
            return match further {
                Some(further) => Some(further.or(found)),
                None => {
                    let further = self.search_further(found, control)?;
                    Some(further.or(&with_work_of(found.clone(), Some(&further))))
                }
            };
        }
        if control.stops() {
            return None;
        }
        let (begin, limit) = (Instant::now(), self.settings.optimizer.most());
        let trials = Trials::of(FROM_THE_OTHER_SIDE, found.iterations, limit)?;
        let best = self.on_both_sides(found, trials, begin, control)?;
        Some(Summary { seconds: found.seconds + begin.elapsed().as_secs_f64(), ..best })
    }

    /// Further searches where an estimate leaves an output unexplained, or where its search is stuck: in stages, and from further starts where the minimum that the stages lead
    /// to is not usable, nor its errors near the noise, unless records are long. They run by the default method; the best minimum goes on by finer ones
    /// where only the step is wrong with it. After stages that were asked for they are from further starts. `None` where a number of starts was asked
    /// for, where the measurements tell nothing by any parameters, and where the variance is predicted: that likelihood has no bound at noise levels
    /// of zero, which some start would find.
    pub(super) fn search_further(&self, found: &Summary, control: &Control) -> Option<Further> {
        let untold = [WarningCode::ConstantOutput, WarningCode::TooFewMeasurements];
        let predicted = self.settings.noise == Noise::Predicted;
        if control.stops()
            || self.settings.searches != SearchPlan::Single
            || predicted
            || untold.into_iter().any(|code| is_useless(found, code))
        {
            return None;
        }
        let reason = self.reason(found)?;
        let trials = Trials::of(FROM_A_START, found.iterations, self.settings.optimizer.most())?.most;
        let begin = Instant::now();
        let further = |(best, way): (Summary, Way)| {
            let (best, stopped, time) = (Box::new(best), control.stops(), begin.elapsed());
            Further::Found { reason, best, way, stopped, time }
        };
        let in_stages = || self.searched_in_stages(begin, control).map(|(best, led)| (best, Way::Stages(led)));
        let staged = if self.settings.lead == Lead::Declared { in_stages() } else { None };
        let most = if self.runs_in_lanes() { LONGEST_IN_LANES } else { LONGEST };
        if self.samples() > most {
            return Some(staged.map_or(Further::TooLong(reason, most), further));
        }
        let is_usable = |best: &Summary| best.severity() < Severity::NotUsable;
        // Stages from which the search ends at no minimum do not suffice where the first search ended at none.
        let is_new = |best: &Summary| matches!(reason, Reason::Unexplained) || best.outcome.converged();
        let suffices =
            |best: &Summary| is_usable(best) || is_new(best) && !leaves_unexplained(best) && self.is_near_noise(best);
        // Pieces that are explained have the right parameters, though no simulation follows the record.
        let are_led =
            |(best, way): &(Summary, Way)| suffices(best) || matches!(way, Way::Stages(led) if led.explains());
        if control.stops() || staged.as_ref().is_some_and(are_led) {
            return staged.map(further);
        }
        let again = self.searched_from_starts(trials, begin, control).map(|best| (best, Way::Starts));
        match (staged, again) {
            (Some(staged), Some(again)) => {
                let work = [&staged.0, &again.0];
                let iterations = work.map(|found| found.iterations).iter().sum();
                let evaluations = work.map(|found| found.evaluations).iter().sum();
                let (best, way) = if is_found(&staged.0, &again.0) { staged } else { again };
                Some(further((Summary { iterations, evaluations, ..best }, way)))
            }
            (staged, again) => staged.or(again).map(further),
        }
    }

    /// Whether the errors of an estimate are near the noise of the measurements, those of each output that moves.
    fn is_near_noise(&self, found: &Summary) -> bool {
        let near = |(output, moves): (&OutputEstimate, &Moves)| {
            moves.half == 0.0 || output.fit.rmse <= EXPLAINS * moves.level()
        };
        self.movement().is_ok_and(|movement| found.outputs.iter().zip(&movement.outputs).all(near))
    }

    /// The best minimum from further starts, by finer methods where only the step is wrong with it.
    fn searched_from_starts(&self, trials: u64, begin: Instant, control: &Control) -> Option<Summary> {
        let (searches, lead) = (SearchPlan::Best(STARTS), Lead::Declared);
        let settings = Settings { checkpoint: None, searches, lead, ..self.settings.clone() };
        let problem = Problem { settings, finer: None, ..self.clone() };
        let start = Start { trials, ..Start::declared(&problem) };
        let again = problem.run_within(begin, control, start).ok()?;
        match is_only_coarse(&again) {
            true => self.refined(Ok(again), 0, begin, control).ok(),
            false => Some(again),
        }
    }

    /// Whether several pieces of records like the first one run together in vector registers.
    pub(crate) fn runs_in_lanes(&self) -> bool {
        self.records.first().is_some_and(|first| self.sweep.lanes(first, self.unknowns.seeds(0)) > 1)
    }
}

/// Whether the estimate from the end of stages replaces that of further starts. Of two usable ones, the lower one is taken, and a usable one before
/// another. Where neither is, it has to explain all outputs where the other does not, or have errors of half the size: a smaller difference may
/// come from the step of the integrator.
fn is_found(staged: &Summary, again: &Summary) -> bool {
    let usable = |found: &Summary| found.severity() < Severity::NotUsable;
    let halved = 4f64.ln() * staged.measurements as f64;
    let lower = |by: f64| staged.deviance.zip(again.deviance).is_some_and(|(staged, again)| staged <= again - by);
    match (usable(staged), usable(again)) {
        (true, true) => lower(-SAME),
        (false, false) => !leaves_unexplained(staged) && (leaves_unexplained(again) || lower(halved)),
        (staged, _) => staged,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Model, Nothing, Scalar, Time, free, signals};

    /// Of two usable minima the lower one is taken; a usable one is taken before another, whatever their deviances.
    #[test]
    fn the_better_one_of_stages_and_starts() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k * 37 % 21) - 10.0 }).collect();
        let noise = |k: usize| f64::from(k as u32 * 11 % 17) / 17.0 - 0.5;
        let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 2.0 * u.u + noise(k) }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let found = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).run().unwrap().summary().clone();
        assert!(found.severity() < Severity::NotUsable, "{found}");
        let of = |by: f64| Summary { deviance: found.deviance.map(|deviance| deviance + by), ..found.clone() };
        assert_eq!([-1.0, 0.0, 1.0].map(|by| is_found(&of(by), &found)), [true, true, false]);
        let text = "an output is not explained".to_owned();
        let wrong = Warning::new(WarningCode::Unexplained, Severity::NotUsable, text).about(About::Output(0));
        let unusable = |by: f64| Summary { warnings: vec![wrong.clone()], ..of(by) };
        assert!(is_found(&of(100.0), &unusable(0.0)) && !is_found(&unusable(-100.0), &found));
        assert!(!is_found(&unusable(-100.0), &unusable(0.0)));
    }

    /// At least 100 steps, three times 50 or 60, as far as 200 leave them: 150 after 50, 140 after 60, none after 200.
    #[test]
    fn further_searches_have_what_is_left() {
        let of = |times: u64, iterations: u64| Trials::of(times, iterations, 200).map(|left| (left.most, left.short));
        assert_eq!([of(1, 50), of(3, 50)], [Some((100, false)), Some((150, false))]);
        assert_eq!([of(3, 60), of(1, 200)], [Some((140, true)), None]);
    }

    /// A record of one sample more than the limit is not searched again, and says so.
    #[test]
    fn long_records_are_not_searched_again() {
        let of = |samples: usize| {
            let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: (k * 37 % 21) as f64 - 10.0 }).collect();
            let outputs = (0..samples).map(|k| Current { i: (k * 11 % 17) as f64 - 8.0 }).collect();
            let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
            let found = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).run().unwrap();
            let said = found
                .warnings
                .iter()
                .any(|warning| warning.text.contains("20,000 samples") && warning.text.contains("Fit::starts(32)"));
            (found.starts.as_ref().map(|starts| starts.tried), said)
        };
        assert_eq!([of(LONGEST_IN_LANES), of(LONGEST_IN_LANES + 1)], [(Some(32), false), (None, true)]);
    }

    signals! { struct Flow { x: "1", y: "1", z: "1" } }
    signals! { struct Constants { sigma: "1/s", rho: "1", beta: "1/s" } }

    /// E. N. Lorenz, Journal of the Atmospheric Sciences 20 (1963) 130-141.
    #[derive(Clone)]
    struct Lorenz;

    impl Model for Lorenz {
        type State = Flow;
        type Input = Nothing;
        type Output = Flow;
        type Parameters = Constants;

        fn derivative<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, p: &Constants<S>) -> Flow<S> {
            Flow { x: p.sigma * (x.y - x.x), y: x.x * (p.rho - x.z) - x.y, z: x.x * x.y - p.beta * x.z }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> Flow<S> {
            *x
        }
    }

    /// A chaotic plant from parameters three times off: the search ends in a minimum that explains nothing. With one sample more than searches from
    /// further starts are made of, stages lead to the right one, and a note says so.
    #[test]
    fn long_records_are_searched_in_stages() {
        let time = Time::Uniform { start: 0.0, step: 5e-4 };
        let (truth, from) = (Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 }, Flow { x: -6.0, y: -8.0, z: 22.0 });
        let run = crate::simulate(&Lorenz, &truth, &from, time, &[Nothing; LONGEST_IN_LANES + 1]).unwrap();
        let record = run.with_noise(Flow { x: 0.4, y: 0.4, z: 0.4 }, 3).experiment(&Lorenz).unwrap();
        let start = || Constants { sigma: free(30.0), rho: free(11.0), beta: free(1.3) };
        let fit = || Fit::new(&Lorenz, &record).parameters(start());
        let alone = fit().starts(1).run().unwrap();
        assert!(leaves_unexplained(&alone), "{alone}");
        let found = fit().run().unwrap();
        assert!((found.parameters.sigma / 10.0 - 1.0).abs() < 1e-2, "{found}");
        let said = found.warnings.iter().any(|warning| warning.text.contains("by itself from the end of"));
        assert!(said && found.severity() < Severity::NotUsable, "{found}");
    }

    /// A current that decays.
    #[derive(Clone)]
    struct Coil;

    impl Model for Coil {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: u.u - p.a * x.i }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    fn is_noted(found: &Summary) -> bool {
        assert!(found.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors), "{found}");
        found.warnings.iter().any(|warning| warning.text.contains("a lower minimum may lie elsewhere"))
    }

    /// Errors of the shape of a slow sine, a fifth of what the output moves: from a decay a hundred times too slow, whose simulation is off by many
    /// times the range, a note says that a lower minimum may lie elsewhere; from a decay that is nearly right there is none, nor of starts that were
    /// asked for.
    #[test]
    fn a_start_that_explains_nothing_is_told_where_errors_are_colored() {
        let time = Time::Uniform { start: 0.0, step: 0.1 };
        let inputs: Vec<Voltage> = (0..600).map(|k| Voltage { u: f64::from(u8::from(k / 40 % 2 == 0)) }).collect();
        let run = crate::simulate(&Coil, &Gain { a: 2.0 }, &Current { i: 0.0 }, time.clone(), &inputs).unwrap();
        let outputs = run.outputs.iter().enumerate();
        let outputs = outputs.map(|(k, y)| Current { i: y.i + 0.1 * (k as f64 * 0.05).sin() }).collect();
        let record = Experiment::new(&Coil, time, inputs, outputs).unwrap();
        let fit = |start: f64| Fit::new(&Coil, &record).parameters(Gain { a: free(start) });
        let noted = [fit(0.02), fit(1.9), fit(0.02).starts(4)].map(|fit| is_noted(&fit.run().unwrap()));
        assert_eq!(noted, [true, false, false]);
    }

    /// A model without states and linear in its parameter has one minimum: no note.
    #[test]
    fn a_line_has_one_minimum() {
        let inputs: Vec<Voltage> = (0..400).map(|k| Voltage { u: f64::from(k * 37 % 21) - 10.0 }).collect();
        let outputs = inputs.iter().enumerate();
        let outputs = outputs.map(|(k, u)| Current { i: 2.0 * u.u + 4.0 * (k as f64 * 0.05).sin() }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let found = Fit::new(&Line, &record).parameters(Gain { a: free(100.0) }).run().unwrap();
        assert!(!is_noted(&found), "{found}");
    }
}
