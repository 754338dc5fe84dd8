//! Searches from the minima that earlier ones found by a coarser method.

use super::{Comparison, NoEnd, Run, Searches, begin, is_wide, minima};
use crate::error::Error;
use crate::estimate::{FailedStart, Starts};
use crate::judge::SearchEnd;
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
    let mut searches = Searches { plain, comparison: Comparison::new(plain), runs, cycle: 0, wide: is_wide(plain) };
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
