//! Searches from the minima that earlier ones found by a coarser method.

use super::{Comparison, NoEnd, Run, Searches, begin, is_wide, minima};
use crate::covariance::SearchEnd;
use crate::error::Error;
use crate::estimate::{FailedStart, Starts};
use crate::problem::{Objective, Optimizer, each};
use std::sync::Arc;

/// How a search ended.
type Ended = Result<SearchEnd, NoEnd>;

/// Searches once from each minimum that the coarser method found, and from each start that it could not evaluate; returns the best
/// end. The end of a search from a minimum counts for all searches that had ended in it. Searches that had been run without finding
/// a minimum stay as they were.
pub(super) fn search_again(
    plain: &Objective<'_>,
    optimizer: &Arc<dyn Optimizer>,
    earlier: &Starts,
) -> Result<SearchEnd, Error> {
    let rows = &plain.problem.unknowns.row;
    let place = |named: &[(String, f64)]| -> Vec<f64> {
        let coordinates = named.iter().zip(rows.iter().zip(plain.problem.unknowns.bounds()));
        coordinates
            .map(|((_, value), (row, (lower, upper)))| {
                row.parameter.transform.to_coordinate(*value).max(lower).min(upper)
            })
            .collect()
    };
    // In the order of the starts as far as it is known: what comes first is that of the declared one.
    let (broken, lost): (Vec<&FailedStart>, Vec<_>) = earlier.failed.iter().partition(|failed| !failed.evaluated);
    let minima = earlier.minima.iter().map(|minimum| (place(&minimum.unknowns), minimum.searches));
    let mut begins: Vec<(Vec<f64>, u64)> = minima.collect();
    begins.extend(broken.iter().map(|failed| (place(&failed.start), 1)));
    let runs = each(begins.len(), |i| begin(plain, optimizer, &Ok(begins[i].0.clone())));
    let starts = begins.iter().map(|(place, _)| place.clone()).collect();
    let (comparison, wide) = (Comparison::new(plain), is_wide(plain));
    let mut searches = Searches { plain, comparison, starts, runs, cycle: 0, wide };
    searches.run(None);
    let mut groups: Vec<Vec<(Vec<f64>, Ended)>> = vec![];
    for (run, (place, count)) in searches.runs.into_iter().map(Run::end).zip(begins) {
        let again = run.as_ref().map(|end| SearchEnd { evaluations: 0, ..end.clone() }).map_err(NoEnd::clone);
        let ends = std::iter::once(run).chain((1..count).map(|_| again.clone()));
        groups.push(ends.map(|end| (place.clone(), end)).collect());
    }
    let none = |failed: &&FailedStart| (place(&failed.start), Err(NoEnd::new(failed.evaluated, failed.reason.clone())));
    groups.push(lost.iter().map(none).collect());
    // The failed searches are listed in the order of their starts.
    let first_failed =
        if broken.first().copied() == earlier.failed.first() { earlier.minima.len() } else { groups.len() - 1 };
    groups.swap(0, earlier.declared.unwrap_or(first_failed));
    let (starts, ends): (Vec<_>, Vec<_>) = groups.into_iter().flatten().unzip();
    let (best, found) = minima::found(plain, &starts, &ends).ok_or_else(|| super::declared_error(plain, &starts[0]))?;
    let end =
        ends.into_iter().nth(best).and_then(Result::ok).ok_or_else(|| super::declared_error(plain, &starts[0]))?;
    let found = Starts { evaluations: found.evaluations + earlier.evaluations, ..found };
    Ok(SearchEnd { starts: Some(found), ..end })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::Minimum;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// Searches go on from the minimum, which two had found, and from the start that could not be evaluated; the one that was given up
    /// stays as it was.
    #[test]
    fn searches_that_had_ended_are_repeated() {
        let inputs: Vec<Voltage> = (0..8).map(|k| Voltage { u: f64::from(1 - 2 * (k % 2)) }).collect();
        let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 2.0 * u.u + 0.1 * (k % 3) as f64 }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let plain = problem.objective().unwrap();
        let at = |a: f64| vec![("a".to_owned(), a)];
        let failed =
            |a: f64, evaluated: bool, reason: &str| FailedStart { start: at(a), evaluated, reason: reason.to_owned() };
        let minimum = Minimum { cost_ratio: 1.0, searches: 2, undetermined: vec![], unknowns: at(1.9) };
        let (up, none) = (failed(5.0, true, "given up"), failed(7.0, false, "no simulation"));
        // The first start is the declared one: it led to the minimum, was given up, or ends in the minimum now.
        let cases = [(Some(0), [&up, &none], Some(0)), (None, [&up, &none], None), (None, [&none, &up], Some(0))];
        for (declared, failed, expected) in cases {
            let earlier = Starts {
                tried: 4,
                agreed: 2,
                minima: vec![minimum.clone()],
                declared,
                failed: failed.map(Clone::clone).to_vec(),
                evaluations: 1000,
            };
            let end = search_again(&plain, &problem.settings.optimizer, &earlier).unwrap();
            let found = end.starts.unwrap();
            assert_eq!((found.tried, found.agreed, found.minima.len(), found.declared), (4, 3, 1, expected));
            assert_eq!(found.failed, std::slice::from_ref(&up));
            assert!(found.evaluations > 1000 && found.evaluations < 1100, "{}", found.evaluations);
        }
    }
}
