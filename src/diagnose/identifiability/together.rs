//! Words for unknowns that are known only together: a common shift, a common factor, a ratio, a product.

use crate::estimate::{Direction, Unknown, Warning, WarningCode};
use crate::numeral::{number, percent, unit_after};

/// Moves are the same if they differ by less than this part.
const SAME: f64 = 0.02;

/// Unknowns that cannot be told apart, in the words that fit the case; `None` of a single unknown, or of one that is not listed.
///
/// `moves` holds names and changes in the unknowns' own units; `left` is what remains of the effect when they move
/// together, as a part of what one alone would change, zero for nothing at all.
pub(super) fn together(moves: &[(String, f64)], left: f64, unknowns: &[Unknown]) -> Option<String> {
    let of = |(name, by): &(String, f64)| Some((unknowns.iter().find(|u| u.name == *name)?, *by));
    let moves: Vec<(&Unknown, f64)> = moves.iter().map(of).collect::<Option<_>>()?;
    let (first, _) = moves.first().filter(|_| moves.len() > 1)?;
    let names = listed(moves.iter().map(|(unknown, _)| format!("`{}`", unknown.name)).collect());
    let relative = |(unknown, by): &(&Unknown, f64)| by / unknown.value;
    let one_unit = moves.iter().all(|(unknown, _)| unknown.unit == first.unit);
    let not_zero = moves.iter().all(|(unknown, _)| unknown.value != 0.0);
    let up = moves.iter().filter(|step| relative(step) > 0.0).count();
    let one_way = up == 0 || up == moves.len();
    let rising = moves.iter().filter(|(_, by)| *by > 0.0).count();
    let (how, in_units) = if one_unit && same(moves.iter().map(|(_, by)| *by)) {
        (if moves.len() == 2 && rising == 1 { "as their sum" } else { "up to a common shift" }, true)
    } else if not_zero && same(moves.iter().map(relative)) && one_way {
        (if moves.len() == 2 { "as their ratio" } else { "up to a common factor" }, false)
    } else if not_zero && same(moves.iter().map(relative)) && moves.len() == 2 {
        ("as their product", false)
    } else {
        ("together", !not_zero)
    };
    let sizes: Vec<f64> = moves.iter().map(|step| if in_units { step.1 } else { relative(step) }).collect();
    let largest = sizes.iter().fold(0.0f64, |m, by| m.max(by.abs()));
    let part = |((unknown, _), by): (&(&Unknown, f64), &f64)| {
        let sign = if *by < 0.0 { '−' } else { '+' };
        let size = number(by.abs() / largest, 3);
        let unit = unit_after(if in_units { &unknown.unit } else { "%" });
        format!("`{}` {sign}{size}{unit}", unknown.name)
    };
    let steps = listed(moves.iter().zip(&sizes).map(part).collect());
    Some(match left > 0.0 {
        false => format!("{names} are known only {how}: {steps} together change no prediction"),
        true => format!(
            "{names} are hardly known but {how}: {steps} together change the predictions by {} of what one of them alone \
             would",
            percent(left, 2)
        ),
    })
}

fn same(sizes: impl Iterator<Item = f64>) -> bool {
    let (low, high) = sizes.fold((f64::INFINITY, 0.0f64), |(low, high), by| (low.min(by.abs()), high.max(by.abs())));
    low > (1.0 - SAME) * high
}

/// `a, b and c`.
fn listed(mut names: Vec<String>) -> String {
    match names.pop() {
        Some(last) if !names.is_empty() => format!("{} and {last}", names.join(", ")),
        last => last.unwrap_or_default(),
    }
}

/// The warnings, those about directions saying what kind of direction it is. There is one for each direction, in the same order.
pub(crate) fn reworded(warnings: &[Warning], directions: &[Direction], unknowns: &[Unknown]) -> Vec<Warning> {
    let mut directions = directions.iter();
    let reworded = |warning: &Warning| {
        let direction = if warning.code == WarningCode::Unidentified { directions.next() } else { None };
        let kind = direction.and_then(|direction| together(&absolute(direction, unknowns), 0.0, unknowns));
        kind.map_or_else(|| warning.clone(), Direction::warning)
    };
    warnings.iter().map(reworded).collect()
}

/// The changes of a direction in the unknowns' own units.
fn absolute(direction: &Direction, unknowns: &[Unknown]) -> Vec<(String, f64)> {
    let value = |name: &str| unknowns.iter().find(|u| u.name == name).map_or(0.0, |unknown| unknown.value);
    let scaled = |(name, by): &(String, f64)| (name.clone(), if value(name) == 0.0 { *by } else { by * value(name) });
    direction.moves.iter().map(scaled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_in_words() {
        let of = |names: &[&str]| listed(names.iter().map(|name| (*name).to_owned()).collect());
        assert_eq!([of(&[]), of(&["a"]), of(&["a", "b"]), of(&["a", "b", "c"])], ["", "a", "a and b", "a, b and c"]);
    }

    /// Two hundredths of the larger.
    #[test]
    fn moves_of_one_size() {
        let of = |sizes: &[f64]| same(sizes.iter().copied());
        assert!(of(&[1.0, -0.981]) && !of(&[1.0, -0.979]) && !of(&[0.0, 0.0]) && of(&[-2.0, 1.99, 2.0]));
    }
}
