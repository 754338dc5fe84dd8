//! Warnings about outputs that the model does not explain, and about a given noise that the errors contradict.

use super::conclude::Judgement;
use crate::estimate::{Warning, WarningCode};
use crate::layout::Kind;
use crate::numeral::{fit, number};
use crate::optimize::Severity;
use crate::problem::Noise;
use crate::whiteness::chi_squared_tail;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Level of the tests against the mean and of a given noise.
const LEVEL: f64 = 1e-3;
/// A smaller fit (%) explains nothing, whatever its significance.
const LITTLE: f64 = 5.0;
/// A larger part of the variance is explained by chance only where hardly any independent error is left, which is said of
/// the color of the errors.
const MUCH: f64 = 0.5;
/// An output stands at a level, and the model gives that level, if movement and errors are below this part of it.
const LEVEL_PART: f64 = 0.1;
/// Errors of such times the given noise, either way, say that it is wrong; beyond the second, or below the third where the
/// noise is larger than all that the output moves, that intervals mean nothing.
const DIFFERENT: f64 = 2.0;
const FAR: f64 = 10.0;
const FAR_BELOW: f64 = 100.0;

impl Judgement<'_> {
    /// How many errors have the information of one independent error.
    pub(super) fn dependence(&self, j: usize) -> f64 {
        if self.is_static() { 1.0 } else { self.residuals.whiteness[j].dependence }
    }

    pub(super) fn is_static(&self) -> bool {
        self.objective.problem.layout().kind == Kind::Static
    }

    /// Sum of squared errors relative to that about the output's mean.
    fn relative_errors(&self, j: usize) -> Option<f64> {
        let (rmse, (_, moves)) = (self.residuals.outputs[j].rmse, self.residuals.levels[j]);
        (moves > 0.0 && self.residuals.outputs[j].fit_percent.is_some()).then(|| (rmse / moves).powi(2))
    }

    /// Probability that noise about a mean is explained as well: Fisher's test with as many measurements as are
    /// independent.
    fn by_chance(&self, j: usize, relative: f64) -> f64 {
        let unknowns = self.values.len().max(1) as f64;
        let independent = self.residuals.outputs[j].samples as f64 / self.dependence(j);
        let free = (independent - unknowns - 1.0).max(1.0);
        let statistic = (1.0 - relative) / unknowns / (relative / free).max(f64::MIN_POSITIVE);
        let distribution = FisherSnedecor::new(unknowns, free);
        if relative < 1.0 { distribution.map_or(1.0, |distribution| distribution.sf(statistic)) } else { 1.0 }
    }

    /// Whether the errors are no larger than the noise that was given.
    fn is_noise(&self, j: usize) -> bool {
        let Noise::Given(sigma) = &self.objective.problem.settings.noise else { return false };
        let (fit, dependence) = (&self.residuals.outputs[j], self.dependence(j));
        fit.rmse <= sigma[j] * (1.0 + 3.0 * (dependence / (2.0 * fit.samples.max(1) as f64)).sqrt())
    }

    /// Outputs that the model explains no better than their mean does.
    pub(super) fn unexplained(&self) -> Vec<Warning> {
        let count = self.objective.outputs();
        let relative: Vec<Option<f64>> = (0..count).map(|j| self.relative_errors(j)).collect();
        let chance: Vec<f64> =
            (0..count).map(|j| relative[j].map_or(1.0, |relative| self.by_chance(j, relative))).collect();
        let explained = |j: usize| chance[j] < LEVEL && self.residuals.outputs[j].fit_percent > Some(LITTLE);
        let another = |j: usize| (0..count).any(|i| i != j && explained(i));
        // What is filtered, weighted or cut off is not what the fit was to explain.
        let settings = &self.objective.problem.settings;
        let partly = settings.prefilter.is_some() || self.objective.is_weighted() || self.objective.is_robust();
        let mut warnings = vec![];
        for j in (0..count).filter(|&j| !explained(j) && !self.is_noise(j)) {
            let (Some(relative), (level, moves)) = (relative[j], self.residuals.levels[j]) else { continue };
            if relative < 1.0 - MUCH {
                continue;
            }
            let fit_percent = self.residuals.outputs[j].fit_percent.unwrap_or(0.0);
            let samples = self.residuals.outputs[j].samples.max(1) as f64;
            let worse = relative > 1.02 + 3.0 * (2.0 * self.dependence(j) / samples).sqrt();
            let rmse = self.residuals.outputs[j].rmse;
            let at_level = moves.max(rmse) < LEVEL_PART * level.abs();
            let severity = match another(j) {
                // Held by a controller, and given by the model.
                true if at_level && !worse => continue,
                true if at_level || !worse => Severity::UsableWithCare,
                _ if partly => Severity::UsableWithCare,
                _ => Severity::NotUsable,
            };
            let output = &self.objective.problem.layout().outputs[j].name;
            let than = if worse { "worse than" } else { "no better than" };
            let text = format!(
                "the model explains `{output}` {than} its mean does (fit {} %): check signals, signs, units and the start \
                 (Fit::starts searches from more), or excite the plant; if noise is all that is left, give its size",
                fit(fit_percent)
            );
            warnings.push(Warning { code: WarningCode::Unexplained, severity, text });
        }
        warnings
    }

    /// Noise that was given, and errors of another size.
    pub(super) fn given_noise(&self) -> Vec<Warning> {
        let Noise::Given(sigma) = &self.objective.problem.settings.noise else { return vec![] };
        if self.objective.problem.settings.prefilter.is_some() || self.objective.is_weighted() {
            return vec![];
        }
        let outputs = self.objective.problem.layout().outputs.iter().enumerate();
        let one = |(j, output): (usize, &crate::layout::Quantity)| {
            let found = &self.residuals.outputs[j];
            let (ratio, samples) = (found.rmse / sigma[j], found.samples as f64 / self.dependence(j));
            let degrees = (samples - self.values.len() as f64).max(1.0);
            let above = chi_squared_tail(samples * ratio * ratio, degrees);
            if above.min(1.0 - above) > LEVEL / 2.0 || ratio > 1.0 && self.objective.is_robust() {
                return None;
            }
            let (_, moves) = self.residuals.levels[j];
            let severity = match ratio {
                ratio if ratio > FAR || ratio < FAR_BELOW.recip() && sigma[j] > moves => Severity::NotUsable,
                ratio if ratio > DIFFERENT || ratio < DIFFERENT.recip() => Severity::UsableWithCare,
                _ => Severity::Usable,
            };
            let wide = if ratio > 1.0 { "narrow" } else { "wide" };
            let text = format!(
                "the noise of `{}` was given as {} {unit}, but the errors are {} {unit} (rms): intervals are too {wide}; leave \
                 the noise out to have it estimated",
                output.name,
                number(sigma[j], 3),
                number(found.rmse, 3),
                unit = output.unit
            );
            Some(Warning { code: WarningCode::GivenNoise, severity, text })
        };
        outputs.filter_map(one).collect()
    }
}
