//! Levels of correlation over time.

use crate::severity::Severity;

/// Level of the test of whiteness below which the color is no chance; between this and the level at which intervals are
/// widened it is a note.
pub(crate) const CERTAIN: f64 = 1e-4;
/// A level that is enough where the colored part is above `MUCH`.
pub(crate) const LIKELY: f64 = 1e-3;
const MUCH: f64 = 0.05;
/// The part of an output's movement that is an error, and follows from the errors before: below `SMALL` it is a note,
/// above `LARGE` the model is wrong or noise dominates the output.
pub(crate) const SMALL: f64 = 1e-4;
pub(crate) const LARGE: f64 = 0.5;
/// The colored part from which on a minimum that was found once is taken as wrong, and a model whose errors certainly follow from its
/// signals: driven pendulums fitted with a wrong natural frequency had
/// 0.3, right models with colored noise of 5 % of the output less than 0.05.
pub(crate) const LEFT: f64 = 0.1;

/// Whether the errors of one of so many outputs, which are as far from white by such a chance and whose colored part is such a part
/// of the output, are taken as colored.
pub(crate) fn is_certain(p_value: f64, outputs: usize, part: f64) -> bool {
    let chance = p_value * outputs as f64;
    chance < CERTAIN || chance < LIKELY && part > MUCH
}

/// How severe it is that such a part of an output's movement is an error that certainly is the model's, and no noise.
pub(crate) fn severity_of_misfit(part: f64) -> Severity {
    if part > LEFT { Severity::NotUsable } else { severity(part) }
}

/// How severe it is that such a part of an output's movement is an error that follows from others.
pub(crate) fn severity(part: f64) -> Severity {
    match part {
        part if part > LARGE => Severity::NotUsable,
        part if part > SMALL => Severity::UsableWithCare,
        _ => Severity::Usable,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On both sides of each level, and on the level, which several outputs share.
    #[test]
    fn color_is_certain_at_its_levels() {
        assert!(is_certain(0.99e-4, 1, 0.0) && !is_certain(1e-4, 1, 0.0));
        assert!(is_certain(0.99e-3, 1, 0.051) && !is_certain(1e-3, 1, 0.051) && !is_certain(0.99e-3, 1, 0.05));
        assert!(is_certain(0.24e-4, 4, 0.0) && !is_certain(0.26e-4, 4, 0.0));
        let levels = [0.501, 0.5, 1.01e-4, 1e-4].map(severity);
        use Severity::{NotUsable, Usable, UsableWithCare};
        assert_eq!(levels, [NotUsable, UsableWithCare, UsableWithCare, Usable]);
        assert_eq!([0.101, 0.1, 1e-4].map(severity_of_misfit), [NotUsable, UsableWithCare, Usable]);
    }
}
