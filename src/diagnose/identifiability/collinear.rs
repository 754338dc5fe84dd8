//! Sets of unknowns that stand in for each other.

use super::{COLLINEAR, Collinear, RANK};
use crate::information::Information;

/// Sets of up to four are looked through among so many unknowns: the first, which are the common parameters.
const MOST: usize = 24;

/// All sets of two to four unknowns above the limit, without those that hold a smaller such set.
pub(super) fn collinear(whole: &Information, norms: &[f64], names: &[String], slopes: &[f64]) -> Vec<Collinear> {
    let seen: Vec<usize> = (0..norms.len()).filter(|&i| norms[i] > 0.0).take(MOST).collect();
    let mut found: Vec<(f64, Vec<usize>, Vec<f64>)> = vec![];
    for size in 2..=seen.len().min(4) {
        for set in subsets(&seen, size) {
            if found.iter().any(|(_, smaller, _)| smaller.iter().all(|i| set.contains(i))) {
                continue;
            }
            let scales: Vec<f64> = set.iter().map(|&i| norms[i].recip()).collect();
            let Ok(spectrum) = whole.select(&set).decomposition(&scales) else { continue };
            let (Some(smallest), Some(direction)) = (spectrum.values.last(), spectrum.directions.last()) else {
                continue;
            };
            if smallest * COLLINEAR <= 1.0 {
                found.push((*smallest, set, direction.clone()));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let listed = |(smallest, set, direction): (f64, Vec<usize>, Vec<f64>)| {
        let mut moves: Vec<(f64, String, f64)> =
            set.iter().zip(&direction).map(|(&i, d)| (d.abs(), names[i].clone(), d / norms[i] * slopes[i])).collect();
        moves.sort_by(|a, b| b.0.total_cmp(&a.0));
        let unit = moves.first().map_or(1.0, |(_, _, by)| *by);
        let moves = moves.into_iter().map(|(_, name, by)| (name, by / unit)).collect();
        Collinear { index: (smallest > RANK).then(|| smallest.recip()), moves }
    };
    found.into_iter().map(listed).collect()
}

fn subsets(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    match (size, of) {
        (0, _) => vec![vec![]],
        (_, []) => vec![],
        (_, [first, rest @ ..]) => {
            let with = subsets(rest, size - 1).into_iter().map(|set| [&[*first], set.as_slice()].concat());
            with.chain(subsets(rest, size)).collect()
        }
    }
}
