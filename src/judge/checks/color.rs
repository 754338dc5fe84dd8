//! Warnings about errors that are correlated over time.

use super::conclude::Judgement;
use super::covariances::Covariances;
use super::whiteness::Whiteness;
use crate::estimate::{CovarianceMethod, Warning, WarningCode};
use crate::numeral::{counted, number, p_value, percent};
use crate::optimize::Severity;

/// Level of the test of whiteness below which the color is no chance; between this and the level at which intervals are
/// widened it is a note.
pub(super) const CERTAIN: f64 = 1e-4;
/// A level that is enough where the colored part is above the second.
pub(super) const LIKELY: f64 = 1e-3;
const MUCH: f64 = 0.05;
/// The part of an output's movement that is an error, and follows from the errors before: below the first it is a note,
/// above the second the model is wrong or noise dominates the output.
pub(super) const SMALL: f64 = 1e-4;
const LARGE: f64 = 0.5;
/// The same part from which on a minimum that was found once is taken as wrong: driven pendulums fitted with a wrong natural frequency had
/// 0.3, right models with colored noise of 5 % of the output less than 0.05.
const LEFT: f64 = 0.1;

impl Judgement<'_> {
    /// Whether the errors of an output are correlated over time, beyond chance and rounding.
    pub(super) fn is_colored(&self) -> bool {
        self.colored_part() > SMALL
    }

    /// Whether so large a part of an output is colored errors that the model is more likely to be wrong than the noise to be colored.
    pub(super) fn leaves_much(&self) -> bool {
        self.colored_part() > LEFT
    }

    /// The largest part of an output's movement that is an error and follows from the errors before.
    fn colored_part(&self) -> f64 {
        let tested = self.tested();
        let parts = tested.iter().filter_map(|(j, white)| {
            let part = self.colored(*j, white);
            is_certain(white.p_value, tested.len(), part).then_some(part)
        });
        parts.fold(0.0, f64::max)
    }

    /// The part of an output's movement that is an error and follows from others.
    pub(super) fn colored(&self, j: usize, white: &Whiteness) -> f64 {
        let (rmse, (_, moves)) = (self.residuals.outputs[j].rmse, self.residuals.levels[j]);
        if moves > 0.0 { rmse / moves * white.predicted.sqrt() } else { 0.0 }
    }

    /// Whether the errors are autocorrelated, how much of the output that is, and what of it the intervals allow for.
    pub(super) fn autocorrelation(&self, covariances: &Covariances) -> Option<Warning> {
        let (output, white) = self.autocorrelated()?;
        let part = self.colored_part();
        let severity = severity(part);
        let output = &self.objective.problem.layout().outputs[output].name;
        let (probability, first) = (p_value(white.p_value.min(1.0)), number(white.correlations[0], 2));
        let mut text = format!(
            "the errors of `{output}` are not white ({probability}, correlation with the error before \
             {first}): the model misses a part, or the noise is colored"
        );
        if part > SMALL {
            text += &format!("; the colored part is {} of what an output moves", percent(part, 2));
        }
        let CovarianceMethod::Hac { lags } = covariances.method else {
            text += "; the intervals take them as white and are too narrow if the order of the samples matters";
            return Some(Warning { code: WarningCode::ColoredErrors, severity, text });
        };
        let white = |i: usize| {
            let unit = covariances.unit.as_ref()?;
            Some(unit.standard_error(i) * self.widening * self.slopes[i].abs()).filter(|error| *error > 0.0)
        };
        let widened = |i: usize| Some(covariances.unknowns.as_ref()?.standard_error(i) / white(i)?);
        let widest = (0..self.slopes.len()).filter_map(widened).fold(0.0, f64::max);
        text += &format!(
            "; the intervals allow for colored noise (HAC over {}, prewhitened), not for a wrong model",
            counted(lags, "lag")
        );
        if widest > 1.0 {
            text += &format!("; they are up to {} times as wide as for white errors", number(widest, 3));
        }
        Some(Warning { code: WarningCode::ColoredErrors, severity, text })
    }
}

/// Whether the errors of one of so many outputs, which are as far from white by such a chance and whose colored part is such a part
/// of the output, are taken as colored.
fn is_certain(p_value: f64, outputs: usize, part: f64) -> bool {
    let chance = p_value * outputs as f64;
    chance < CERTAIN || chance < LIKELY && part > MUCH
}

/// How severe it is that such a part of an output's movement is an error that follows from others.
pub(super) fn severity(part: f64) -> Severity {
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
    }
}
