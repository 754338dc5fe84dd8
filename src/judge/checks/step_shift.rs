//! How far what the data determine would move with a finer step.

use crate::estimate::Unknown;
use crate::judge::directions::{taking_part, undetermined};
use crate::judge::evidence::Evidence;
use crate::optimize::Linearization;
use crate::problem::Objective;

/// A move towards the minimum of another objective.
pub(crate) struct Shift {
    /// What moves, for a sentence.
    pub of: String,
    /// By how many standard errors.
    pub errors: f64,
    /// By which part of itself.
    pub part: f64,
}

/// The largest move of an unknown, or of what the data determine of several unknowns together.
pub(crate) fn shift(evidence: &Evidence<'_>, objective: &Objective<'_>, unknowns: &[Unknown]) -> Option<Shift> {
    let linear = objective.evaluate(&evidence.point.end.coordinates).ok()?;
    let found = [of_one(&linear, unknowns), of_several(evidence, &linear, unknowns)];
    found.into_iter().flatten().max_by(|a, b| a.errors.total_cmp(&b.errors))
}

/// The largest move of an unknown that is known by itself.
fn of_one(linear: &Linearization, unknowns: &[Unknown]) -> Option<Shift> {
    let held: Vec<bool> = unknowns.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
    let step = linear.step(&vec![0.0; unknowns.len()], &held)?;
    let of = |i: usize| {
        let (unknown, change) = (&unknowns[i], change(&step, unknowns, i));
        let errors = change / unknown.knowledge.standard_error()?;
        Some(Shift { of: format!("`{}`", unknown.name), errors, part: change / unknown.value.abs() })
    };
    (0..unknowns.len()).filter_map(of).max_by(|a, b| a.errors.total_cmp(&b.errors))
}

/// The move of unknowns that the data determine only together, such as the product of a scale and a rate.
fn of_several(evidence: &Evidence<'_>, linear: &Linearization, unknowns: &[Unknown]) -> Option<Shift> {
    let directions = evidence.point.undetermined.directions.iter();
    let several = directions.map(|direction| taking_part(direction).map(|(i, _)| i).collect::<Vec<_>>());
    let mut together: Vec<usize> = several.filter(|all| all.len() > 1).flatten().collect();
    together.sort_unstable();
    together.dedup();
    if together.is_empty() {
        return None;
    }
    let at_bounds: Vec<bool> = evidence.point.held_at.iter().map(Option::is_some).collect();
    let held = undetermined(linear, &at_bounds).held;
    let step = linear.step(&vec![0.0; unknowns.len()], &held)?;
    // The norm of the change of all predictions: no combination of unknowns changes by more of its standard errors.
    let errors = (2.0 * linear.predicted_reduction(&step)).max(0.0).sqrt() / evidence.point.widening;
    let parts = together.iter().map(|&i| change(&step, unknowns, i) / unknowns[i].value.abs());
    let part = parts.filter(|part| part.is_finite()).fold(0.0, f64::max);
    let names: Vec<String> = together.iter().map(|&i| format!("`{}`", unknowns[i].name)).collect();
    Some(Shift { of: format!("what the data determine of {}", names.join(", ")), errors, part })
}

/// The change of an unknown by a step of all coordinates.
fn change(step: &[f64], unknowns: &[Unknown], i: usize) -> f64 {
    (step[i] * unknowns[i].transform.slope(unknowns[i].value)).abs()
}

#[cfg(test)]
mod tests {
    use super::of_one;
    use crate::estimate::Knowledge;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// At a gain of two, where a record has three: the whole way in the gain itself; in its logarithm half of it by the slope,
    /// which is one of the gain. Errors of 0.5.
    #[test]
    fn an_unknown_moves_in_its_own_unit() {
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 4], vec![Current { i: 3.0 }; 4]).unwrap();
        for (a, coordinate) in [(free(2.0), 2.0), (free(2.0).log(), 2f64.ln())] {
            let fit = Fit::new(&Line, &record).parameters(Gain { a }).noise(Current { i: 1.0 });
            let problem = fit.problem().unwrap();
            let mut unknowns = problem.estimate(&[coordinate]).unwrap().unknowns;
            unknowns[0].knowledge = Knowledge::Known { standard_error: 0.5, lower: 1.0, upper: 3.0 };
            let linear = problem.objective().unwrap().evaluate(&[coordinate]).unwrap();
            let found = of_one(&linear, &unknowns).unwrap();
            assert!(
                (found.errors - 2.0).abs() < 1e-12 && (found.part - 0.5).abs() < 1e-12,
                "{} {}",
                found.errors,
                found.part
            );
        }
    }
}
