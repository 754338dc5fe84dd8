//! Why a start cannot be evaluated.

use crate::error::{Error, Failure};
use crate::optimize::Infeasible;
use crate::problem::{Objective, Role};
use crate::record::Initial;

/// Why the start could not be evaluated.
pub(super) fn start_error(objective: &Objective<'_>, coordinates: &[f64], error: Infeasible) -> Error {
    if error == Infeasible::Cancelled {
        return stopped(objective);
    }
    let locate = |e: usize, sample: usize| {
        let failure = objective.locate(e, coordinates, sample);
        let failure = taken_from_outputs(objective, e, coordinates).unwrap_or(failure);
        if objective.control.stops() { stopped(objective) } else { Error::Start(failure) }
    };
    for e in 0..objective.experiments() {
        let mut last = 0;
        let failed = objective.run_alone(e, coordinates, true, &mut |window| {
            last = window.begin[0];
            let errors = (0..window.samples[0]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j)));
            let mut bad = errors.clone().filter(|&(k, j)| !window.error(k, j, 0).is_finite());
            match bad.next() {
                Some((k, _)) => {
                    last += k;
                    false
                }
                None => true,
            }
        });
        if failed.is_err() {
            return locate(e, last);
        }
    }
    let failing = (0..objective.experiments()).find(|&e| {
        let alone = objective.cost_of(e, coordinates);
        !alone.is_ok_and(f64::is_finite)
    });
    locate(failing.unwrap_or(0), 0)
}

/// The initial state that an experiment fails by: one that was taken from the outputs, where the experiment can be evaluated with its other
/// sign, such as a quantity that cannot be negative but was measured so.
fn taken_from_outputs(objective: &Objective<'_>, e: usize, coordinates: &[f64]) -> Option<Failure> {
    let problem = objective.problem;
    let fails = |x: &[f64]| !objective.cost_of(e, x).is_ok_and(f64::is_finite);
    let estimated = matches!(problem.records[e].initial_state(), Initial::Estimated | Initial::Free);
    if !estimated || !fails(coordinates) {
        return None;
    }
    let taken = |i: &usize| {
        let unknown = &problem.unknowns.row[*i];
        matches!(unknown.role, Role::InitialState(_)) && !unknown.guessed
    };
    let succeeds = |i: &usize| {
        let mut other = coordinates.to_vec();
        other[*i] = -other[*i];
        !fails(&other)
    };
    let i = problem.unknowns.columns(e).filter(taken).find(succeeds)?;
    Some(Failure {
        experiment: problem.unknowns.labels[e].clone(),
        sample: 0,
        time: problem.records[e].moment(0),
        signal: format!("`{}`", problem.unknowns.row[i].name),
        value: coordinates[i],
        hint: TAKEN,
    })
}

const TAKEN: &str = "; it was taken from the first measurements, and the simulation fails from there, but not from the other sign: give a \
                     start (Experiment::initial), or estimate its logarithm (free(..).log())";

fn stopped(objective: &Objective<'_>) -> Error {
    Error::Option(match objective.problem.settings.time_limit {
        Some(limit) if objective.control.expired() => format!(
            "the time limit of {} s was over before the start had been evaluated; allow more time",
            limit.as_secs_f64()
        ),
        _ => "the fit was cancelled before its start had been evaluated; lower the flag to run it".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use crate::error::Error;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, ExperimentOf, Fit, Time, free};

    /// A gain of two, and errors that are no line.
    fn record() -> ExperimentOf<Line> {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k) }).collect();
        let outputs = (0..40).map(|k| Current { i: 2.0 * f64::from(k) + f64::from(k * 37 % 21) }).collect();
        Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
    }

    /// The record is named whose cost is not finite, also where each of its errors is.
    #[test]
    fn the_start_of_one_record_has_no_cost() {
        let huge = record().outputs().map(|y| Current { i: 1e200 * y.i }).collect();
        let inputs = record().inputs().collect();
        let huge = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, huge).unwrap();
        let of = |names: [&str; 2]| {
            let records = if names[0] == "huge" { [huge.clone(), record()] } else { [record(), huge.clone()] };
            let [one, other] = records;
            let records = [one.named(names[0]), other.named(names[1])];
            Fit::new(&Line, &records).parameters(Gain { a: free(1.0) }).noise(Current { i: 1.0 }).run().unwrap_err()
        };
        for names in [["huge", "plain"], ["plain", "huge"]] {
            let error = of(names);
            assert!(matches!(&error, Error::Start(failure) if failure.experiment == "huge"), "{error}");
        }
    }
}
