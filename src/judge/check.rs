//! [`Check`]: a question that the verdict asks of an estimate, as a value.

use crate::estimate::{Extent, Warning, WarningCode};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::ruled_out::Unless;
use crate::judge::intervals::Intervals;
use crate::severity::Severity;
use std::borrow::Cow;

/// A question that the verdict asks of an estimate.
pub(crate) struct Check {
    /// What holds where it finds nothing, in a few words.
    pub name: &'static str,
    /// What it looks at and by which test, in a sentence.
    #[cfg_attr(not(test), expect(dead_code, reason = "docs/checks.md shows it"))]
    pub asks: &'static str,
    /// The codes of its warnings.
    pub codes: &'static [WarningCode],
    examine: Examine,
    /// What rules it out.
    pub unless: &'static [Unless],
    /// Whether it is left out once a check before it finds the estimate not usable.
    pub of_usable: bool,
    /// The passes over the data that it may take.
    pub costs: &'static [Pass],
    /// The numbers by which it decides.
    #[cfg_attr(not(test), expect(dead_code, reason = "docs/checks.md shows them"))]
    pub levels: &'static [Level],
}

type Examine = fn(&Evidence<'_>, &Intervals) -> Examined;

impl Check {
    /// One that is always made, without a pass of its own.
    pub const fn new(name: &'static str, asks: &'static str, codes: &'static [WarningCode], examine: Examine) -> Self {
        Check { name, asks, codes, examine, unless: &[], of_usable: false, costs: &[], levels: &[] }
    }

    pub const fn of_usable(self) -> Self {
        Check { of_usable: true, ..self }
    }

    pub const fn unless(self, unless: &'static [Unless]) -> Self {
        Check { unless, ..self }
    }

    pub const fn costs(self, costs: &'static [Pass]) -> Self {
        Check { costs, ..self }
    }

    pub const fn levels(self, levels: &'static [Level]) -> Self {
        Check { levels, ..self }
    }

    pub fn examine(&self, evidence: &Evidence<'_>, intervals: &Intervals) -> Examined {
        Examined::unless(evidence.ruled_out(self.unless), || (self.examine)(evidence, intervals))
    }
}

/// What a check needs of passes over the data, beside the one in values that every estimate takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pass {
    /// The slopes of the pass with slopes that all checks share.
    Rows,
    /// So many more in values, where the pass in values or the rows give a reason.
    Values(usize),
    /// So many more with slopes, where the pass in values or the rows give a reason.
    Slopes(usize),
    /// The pass with slopes for the curvature of a loss.
    Curvature,
    /// One with slopes that parts of the data and sensors share, where the rows give a reason.
    Left,
    /// So many with slopes for each unknown that is examined, where its expected curvature or a condition of the model gives a reason.
    EachUnknown(usize),
    /// Some windows, or the whole, by a finer method, where the step gives a reason.
    Finer,
}

/// A number by which a check decides.
#[cfg_attr(not(test), expect(dead_code, reason = "docs/checks.md shows them"))]
pub(crate) struct Level {
    /// What it limits.
    pub of: &'static str,
    pub value: f64,
    /// Where the number comes from.
    pub source: &'static str,
}

/// A level: what it limits, its value, and where that comes from.
pub(crate) const fn level(of: &'static str, value: f64, source: &'static str) -> Level {
    Level { of, value, source }
}

/// What a check found, and how far it was made.
pub(crate) struct Examined {
    pub warnings: Vec<Warning>,
    pub extent: Extent,
}

impl Examined {
    /// Not made, for this reason.
    pub fn skipped(because: &'static str) -> Self {
        Examined { warnings: vec![], extent: Extent::Nothing { because: because.into() } }
    }

    /// Made, unless there is a reason against it.
    pub fn unless<W: Into<Examined>>(skipped: Option<&'static str>, examine: impl FnOnce() -> W) -> Self {
        skipped.map_or_else(|| examine().into(), Examined::skipped)
    }

    /// Made without a part, if there is one.
    pub fn without(mut self, part: Option<impl Into<Cow<'static, str>>>) -> Self {
        if let (Extent::Whole, Some(part)) = (&self.extent, part) {
            self.extent = Extent::Part { without: part.into() };
        }
        self
    }
}

impl From<Vec<Warning>> for Examined {
    fn from(warnings: Vec<Warning>) -> Self {
        Examined { warnings, extent: Extent::Whole }
    }
}

impl From<Option<Warning>> for Examined {
    fn from(warning: Option<Warning>) -> Self {
        Vec::from_iter(warning).into()
    }
}

pub(crate) fn note(code: WarningCode, text: String) -> Warning {
    Warning::new(code, Severity::Usable, text)
}

pub(crate) fn not_usable(code: WarningCode, text: String) -> Warning {
    Warning::new(code, Severity::NotUsable, text)
}

/// A warning that asks for care.
pub(crate) fn with_care(code: WarningCode, text: String) -> Warning {
    Warning::new(code, Severity::UsableWithCare, text)
}
