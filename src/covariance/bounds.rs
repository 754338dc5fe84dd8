//! Knowledge of unknowns at a bound, and their effect on the others.
//!
//! Where the estimate without bounds lies beyond one by less than its interval reaches, the truth may be within the bounds,
//! and the others, estimated with the unknown at its bound, are biased by as much as they are correlated with it. There,
//! intervals are those of the estimate without bounds: they cover as often as they say, whether the truth is at the
//! bound or within it. What the unknown at the bound keeps of its own is the part within the bounds.

use crate::covariance::directions::undetermined;
use crate::estimate::student::Spread;
use crate::information::Undetermined;
use crate::optimize::Linearization;

/// Which unknowns remain held, of those at bounds and those held for null directions, and the step from the estimate to
/// that without the bounds of the others. Slopes tell nothing of what is beyond for those that are `flat`. `unit` is the spread of
/// an unknown whose variance is one.
pub(super) fn released(
    linear: &Linearization,
    found: &Undetermined,
    at_bounds: &[bool],
    flat: &[bool],
    unit: Spread,
) -> (Vec<bool>, Vec<f64>) {
    let none = vec![0.0; at_bounds.len()];
    let mut kept: Vec<bool> = at_bounds.iter().zip(flat).map(|(at, flat)| *at && *flat).collect();
    // Each round holds one more at least.
    while kept != at_bounds {
        let free = undetermined(linear, &kept);
        let steps = || Some((linear.covariance(&free.held)?, linear.step(&none, &free.held)?));
        // Data that determine fewer directions without the bounds do not determine the values beyond them.
        let Some((covariance, step)) = steps().filter(|_| free.directions.len() == found.directions.len()) else {
            break;
        };
        let reach = unit.reach(0.95);
        let beyond = |i: usize| at_bounds[i] && !kept[i] && step[i].abs() > reach * covariance.standard_error(i);
        let far: Vec<usize> = (0..kept.len()).filter(|&i| beyond(i)).collect();
        if far.is_empty() {
            return (free.held, step);
        }
        far.into_iter().for_each(|i| kept[i] = true);
    }
    (found.held.clone(), none)
}
