//! Predictions that restart from measured states, against a simulation of the whole record.

use super::refine::{CERTAINLY_WORSE, Start, farthest, is_useless};
use crate::estimate::{About, Summary, Unknown, Warning, WarningCode};
use crate::numeral::{number, unit_after};
use crate::problem::{Control, Problem, SearchPlan, Settings};
use crate::severity::Severity;
use std::time::Instant;

/// Most trial steps of the simulation's search: from a start that led the predictions to a minimum, tens are usual.
const TRIALS: u64 = 200;
/// Standard errors of the predictions' estimate by which the simulation's must differ: chance exceeds three in 0.3 %.
const APART: f64 = 3.0;

impl Problem<'_> {
    /// The estimate with a warning, where a fit of the simulation has a certainly higher likelihood than that of the predictions from measured
    /// states, with other parameters. Disturbances of the plant would lower the likelihood of the simulation, so noise in the
    /// measurements is the cause. `None` where this is not so, the simulation has no minimum, or the two use different measurements.
    pub(super) fn compared_with_simulation(&self, found: &Summary, control: &Control) -> Option<Summary> {
        if !found.outcome.converged() || control.stops() || is_useless(found, WarningCode::RestartNoise) {
            return None;
        }
        let begin = Instant::now();
        let finest = self.by_number(found.method.refinement);
        let sweep = finest.sweep.simulating(usize::MAX).filter(|_| finest.sweep.restarts().is_some())?;
        let settings = Settings { checkpoint: None, searches: SearchPlan::Single, ..self.settings.clone() };
        let problem = Problem::new(sweep, self.records.clone(), &self.unknowns.parameters, settings).ok()?;
        let start = Start { trials: TRIALS.min(self.settings.optimizer.most()), ..Start::declared(&problem) };
        let simulated = problem.run_within(begin, control, start).ok()?;
        let better = found.deviance? - simulated.deviance?;
        let same = simulated.measurements == found.measurements && simulated.unknowns.len() == found.unknowns.len();
        if !simulated.outcome.converged() || !same || better <= CERTAINLY_WORSE {
            return None;
        }
        let values = simulated.unknowns.iter().map(|unknown| unknown.value);
        let (i, errors) = farthest(found, values).filter(|(_, errors)| *errors > APART)?;
        let Unknown { name, unit, value, .. } = &simulated.unknowns[i];
        let text = format!(
            "a simulation explains the outputs better than predictions from measured states do (-2 ln of the likelihood is less by {}), \
             with `{name}` = {}{}, {} standard errors away: these measurements are noisy, which biases what restarts from them; \
             simulate (FreeRun, the default), or use Kalman with Model::noise",
            number(better, 3),
            number(*value, 4),
            unit_after(unit),
            number(errors, 2)
        );
        let mut warned = found.clone();
        warned
            .warnings
            .push(Warning::new(WarningCode::RestartNoise, Severity::NotUsable, text).about(About::Unknown(i)));
        let (evaluations, seconds) =
            (found.evaluations + simulated.evaluations, found.seconds + begin.elapsed().as_secs_f64());
        Some(Summary { evaluations, seconds, ..warned })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::tests::{Current, Voltage};
    use crate::{Experiment, Fit, Horizon, Kind, Model, Scalar, Time, free, signals};

    signals! { pub struct Recursion { a: "1", b: "A/V" } }

    /// `i[k+1] = a i[k] + b u[k]`.
    #[derive(Clone)]
    struct Discrete;

    impl Model for Discrete {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Recursion;
        const KIND: Kind = Kind::Discrete;

        fn next<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Recursion<S>) -> Current<S> {
            Current { i: p.a * x.i + p.b * u.u }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Recursion<S>) -> Current<S> {
            *x
        }
    }

    /// `a` of 0.9 under steps of the input, which move the state by some 10 A, with these standard deviations of the measurements and of what
    /// disturbs the state.
    fn record(noise: f64, disturbance: f64) -> crate::ExperimentOf<Discrete> {
        let (mut random, mut x) = (Random::stream(3, 0), 0.0);
        let inputs: Vec<Voltage> = (0..300).map(|k| Voltage { u: f64::from(k / 12 * 7 % 5) - 2.0 }).collect();
        let measure = |u: &Voltage| {
            let y = Current { i: x + noise * random.normal() };
            x = 0.9 * x + u.u + disturbance * random.normal();
            y
        };
        let outputs = inputs.iter().map(measure).collect();
        Experiment::new(&Discrete, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
    }

    /// Noise in the measurements makes the simulation likelier, and the warning says by how much and where its parameter is; a disturbance of
    /// the state, or no minimum, says nothing, and what is not usable for this reason already is not simulated.
    #[test]
    fn noise_of_restarts_is_told_by_a_simulation() {
        let said = |record: &crate::ExperimentOf<Discrete>, change: fn(Summary) -> Summary, control: &Control| {
            let fit = Fit::new(&Discrete, record).parameters(Recursion { a: free(0.7), b: free(1.2) });
            let problem = fit.predictor(Horizon::new(1)).problem().unwrap();
            let found = problem.run_within(Instant::now(), &Control::NEVER, Start::declared(&problem)).unwrap();
            let found = change(Summary { warnings: vec![], ..found });
            (problem.compared_with_simulation(&found, control), found)
        };
        let (noisy, never) = (record(6.0, 0.0), Control::NEVER);
        let (warned, found) = said(&noisy, |found| found, &never);
        let warned = warned.unwrap();
        let simulated = Fit::new(&Discrete, &noisy).parameters(Recursion { a: free(0.7), b: free(1.2) }).run().unwrap();
        // 300 measurements predicted with errors of sqrt(1 + 0.9^2) times the noise: a deviance of 300 ln(1.81) = 178, with a scatter of
        // some 300 sqrt(2/300); less, as `a` takes a part of it.
        let better = found.deviance.unwrap() - simulated.deviance.unwrap();
        assert!((100.0..200.0).contains(&better), "{better}");
        let [warning] = &warned.warnings[..] else { panic!("{:?}", warned.warnings) };
        assert_eq!((warning.code, warning.severity), (WarningCode::RestartNoise, Severity::NotUsable));
        let (i, errors) = farthest(&found, simulated.unknowns.iter().map(|unknown| unknown.value)).unwrap();
        let words = [
            format!("is less by {})", number(better, 3)),
            format!("`{}` = {}", simulated.unknowns[i].name, number(simulated.unknowns[i].value, 4)),
            format!("{} standard errors away", number(errors, 2)),
        ];
        assert!(words.iter().all(|word| warning.text.contains(word)), "{words:?} {}", warning.text);
        assert_eq!(warned.evaluations, found.evaluations + simulated.evaluations);

        assert!(said(&record(0.0, 0.5), |found| found, &never).0.is_none());
        let unended = |found| Summary { outcome: crate::optimize::Outcome::TimeLimit, ..found };
        assert!(said(&noisy, unended, &never).0.is_none());
        let named = |mut found: Summary| {
            let (code, severity) = (WarningCode::RestartNoise, Severity::NotUsable);
            found.warnings.push(Warning::new(code, severity, String::new()));
            found
        };
        assert!(said(&noisy, named, &never).0.is_none());
        let over = Control { deadline: Some(Instant::now()), ..Control::NEVER };
        assert!(said(&noisy, |found| found, &over).0.is_none());
    }
}
