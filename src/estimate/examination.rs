//! [`Examination`]: what was asked of an estimate, and how far that was examined.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// A check of an estimate, and how far it was made; `docs/checks.md` in the repository says what each asks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Examination {
    /// Its name: what holds where it finds nothing.
    pub check: Cow<'static, str>,
    /// How far it was made.
    pub extent: Extent,
}

/// How far a check was made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Extent {
    /// As a whole, or there was nothing to examine.
    Whole,
    /// In part.
    Part {
        /// What was left out.
        without: Cow<'static, str>,
    },
    /// Not at all.
    Nothing {
        /// Why not.
        because: Cow<'static, str>,
    },
}

impl fmt::Display for Extent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Extent::Whole => f.write_str("as a whole"),
            Extent::Part { without } => write!(f, "without {without}"),
            Extent::Nothing { because } => write!(f, "not made: {because}"),
        }
    }
}

/// How many checks were made, and which were not, with the reason; checks with one reason stand together.
pub(crate) fn described(examined: &[Examination]) -> String {
    let mut left_out: Vec<(String, Vec<&str>)> = vec![];
    for Examination { check, extent } in examined {
        if *extent == Extent::Whole {
            continue;
        }
        let reason = extent.to_string();
        match left_out.iter_mut().find(|(other, _)| *other == reason) {
            Some((_, checks)) => checks.push(check),
            None => left_out.push((reason, vec![check])),
        }
    }
    let whole = examined.iter().filter(|one| one.extent == Extent::Whole).count();
    let said = left_out.iter().map(|(reason, checks)| format!("; {} ({reason})", checks.join(", ")));
    format!("{whole} of {} checks made{}", examined.len(), said.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_with_one_reason_stand_together() {
        let of = |check: &'static str, extent| Examination { check: check.into(), extent };
        let because = || Extent::Nothing { because: "a pre-filter".into() };
        let all = [
            of("a", because()),
            of("b", Extent::Whole),
            of("c", Extent::Part { without: "later records".into() }),
            of("d", because()),
        ];
        let text = "1 of 4 checks made; a, d (not made: a pre-filter); c (without later records)";
        assert_eq!(described(&all), text);
        assert_eq!(described(&all[1..2]), "1 of 1 checks made");
    }
}
