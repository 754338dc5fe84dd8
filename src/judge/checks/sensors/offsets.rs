//! What is known of the unknowns if each output may have an offset.

use crate::judge::directions::{taking_part, undetermined};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::extended::Extended;
use crate::judge::evidence::sensors::{KINDS, Kind};

/// By how much the standard error of each unknown grows where each output may have an offset; infinite where an offset then replaces it, one
/// where it is held anyway. `None` where that is not examined.
pub(crate) fn growth_by_offsets(evidence: &Evidence<'_>) -> Option<Vec<f64>> {
    let extended = Extended::new(evidence)?;
    let without = extended.held(None);
    let mut with = without.clone();
    for j in 0..evidence.point.objective.outputs() {
        let number = j * KINDS + Kind::ALL.iter().position(|kind| *kind == Kind::Offset)?;
        with[extended.place(number)] = false;
    }
    let found = undetermined(&extended.linear, &with);
    let replaced: Vec<usize> =
        found.directions.iter().flat_map(|direction| taking_part(direction)).map(|(place, _)| place).collect();
    let (before, after) = (extended.linear.covariance(&without)?, extended.linear.covariance(&found.held)?);
    let growth = |i: usize| match extended.place_of(i) {
        place if without[place] => 1.0,
        place if replaced.contains(&place) => f64::INFINITY,
        place => after.standard_error(place) / before.standard_error(place),
    };
    Some((0..evidence.point.values.len()).map(growth).collect())
}
