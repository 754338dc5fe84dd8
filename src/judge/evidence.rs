//! [`Evidence`]: what passes over the data say of a point, each made once, when it is first asked for.

pub(crate) mod color;
pub(crate) mod extended;
pub(crate) mod left;
pub(crate) mod parts;
pub(crate) mod ruled_out;
pub(crate) mod suspects;

use crate::covariance::point::Point;
use crate::covariance::sandwich::Bread;
use crate::information::Covariance;
use crate::problem::{Noise, Whitening};
use crate::residuals::Residuals;
use crate::residuals::coupling::Coupled;
use crate::residuals::whiteness::{WHITENESS_LEVEL, Whiteness, least_white};
use crate::rows::{Asked, Rows, rows, rows_together};
use color::is_certain;
use left::{Left, left};
use parts::records_by_chance;
use std::cell::OnceCell;

/// Below this number of measurements the covariance is the classical one, whether the errors are autocorrelated, or of one size, or not.
const CORRELATED_SAMPLES: u64 = 12;
/// Records of up to so many measurements are tested for color at this level before their intervals are made: the tests see little
/// there, and white errors that are taken as colored lose nothing (docs/intervals.md).
const SHORT: u64 = 1_000;
const SHORT_LEVEL: f64 = 0.05;
/// Errors below this fraction of a given noise are round-off: no whiteness test, no HAC.
const ROUNDING: f64 = 0.1;

/// The end of a search, and what passes over the data say of it.
pub(crate) struct Evidence<'e> {
    pub point: Point<'e>,
    pub residuals: Residuals,
    /// Which outputs have errors that are round-off: nothing beside their measurements, or far below a given noise; and whether all have.
    pub rounded: Vec<bool>,
    pub rounding: bool,
    unit: OnceCell<Option<Covariance>>,
    bread: OnceCell<Option<Bread>>,
    rows: OnceCell<Rows>,
    compare_parts: OnceCell<bool>,
    left: OnceCell<Left>,
}

impl<'e> Evidence<'e> {
    pub fn new(point: Point<'e>, residuals: Residuals) -> Self {
        let objective = point.objective;
        let sigma = objective.whitening.sigma();
        let rounded = |(j, sigma): (usize, &f64)| {
            let rmse = residuals.outputs[j].rmse;
            let given = objective.problem.settings.noise.given(j).is_some();
            point.is_exact() || given && rmse < ROUNDING * sigma || residuals.is_rounding_of(j)
        };
        let rounded: Vec<bool> = sigma.iter().enumerate().map(rounded).collect();
        let rounding = rounded.iter().all(|rounded| *rounded);
        let (unit, bread, rows) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Evidence {
            point,
            residuals,
            rounded,
            rounding,
            unit,
            bread,
            rows,
            compare_parts: OnceCell::new(),
            left: OnceCell::new(),
        }
    }

    /// The covariance of unit noise in coordinates.
    pub fn unit(&self) -> Option<&Covariance> {
        self.unit.get_or_init(|| self.point.linear.covariance(&self.point.held_for_covariance)).as_ref()
    }

    /// The curvature of the cost, for weights and losses by a pass with slopes.
    pub fn bread(&self) -> Option<&Bread> {
        self.bread.get_or_init(|| Bread::of(&self.point, self.residuals.measured)).as_ref()
    }

    /// What a pass with slopes sums up for the covariance and the checks of this estimate.
    pub fn rows(&self) -> &Rows {
        let Point { objective, end, .. } = &self.point;
        self.rows.get_or_init(|| rows(objective, &end.coordinates, self.asked()))
    }

    /// Makes the passes of [`rows`](Self::rows) for several estimates of one record each, in parallel lanes. Errors that are round-off are left
    /// out: few checks look at them, and these make the pass themselves.
    pub fn pass_together(all: &[&Self]) {
        let asking = all.iter().filter(|one| !one.rounding).map(|one| (*one, one.asked()));
        let (asking, asked): (Vec<&Self>, Vec<Asked<'_>>) = asking.filter(|(_, asked)| !asked.is_empty()).unzip();
        let points = asking.iter().map(|one| (one.point.objective, &one.point.end.coordinates[..])).zip(asked);
        for (one, found) in asking.iter().zip(rows_together(&points.collect::<Vec<_>>())) {
            found.into_iter().for_each(|found| _ = one.rows.set(found));
        }
    }

    /// What is asked of that pass.
    fn asked(&self) -> Asked<'_> {
        let held = &self.point.held_for_covariance;
        let colored = || self.unit().filter(|_| self.uses_hac()).map(|unit| (&held[..], unit));
        let shares = || self.unit().filter(|_| self.takes_one_size());
        let parts = || self.ruled_out(parts::UNLESS).is_none() && self.compare_parts();
        let sensors = || self.ruled_out(extended::UNLESS).is_none();
        Asked { shares: shares(), colored: colored(), sensors: sensors(), parts: parts() }
    }

    /// What remains after the steps that parts of the data and sensors ask for.
    pub fn left(&self) -> &Left {
        self.left.get_or_init(|| left(self))
    }

    /// Whether the intervals allow for colored errors.
    pub fn uses_hac(&self) -> bool {
        let level = match self.residuals.measured {
            ..CORRELATED_SAMPLES => return false,
            CORRELATED_SAMPLES..=SHORT => SHORT_LEVEL,
            _ => WHITENESS_LEVEL,
        };
        !self.point.is_static() && self.autocorrelated_at(level).is_some()
    }

    /// Whether the classical covariance takes noise, estimated or given, to be of one size per output.
    pub fn takes_one_size(&self) -> bool {
        let objective = self.point.objective;
        let predicted = matches!(objective.problem.settings.noise, Noise::Predicted);
        let exact = self.rounding || self.point.is_exact() || !self.has_noise();
        !predicted && !exact && !objective.needs_sandwich() && self.residuals.measured >= CORRELATED_SAMPLES
    }

    /// Whether there is a reason to compare parts of the data, which takes slopes: where errors are correlated over time or with the
    /// prediction, or records differ. Always of filters, which estimate what contradicts them as process noise, so that their errors stay
    /// white; of static models, whose samples have no order; and with a loss, weights or restarts, where errors are not tested against
    /// powers of the prediction.
    pub fn compare_parts(&self) -> bool {
        let objective = self.point.objective;
        if self.weighs_variances() {
            return false;
        }
        let examine = || {
            let least = self.residuals.shape.iter().copied().fold(self.residuals.parts, f64::min);
            let follow = least * (objective.outputs() as f64) < parts::LEVEL && !self.rounding;
            let unseen = self.residuals.shape.is_empty() && !self.rounding;
            let apart = || !self.rounding && records_by_chance(&self.point) < parts::LEVEL;
            let always = self.point.is_static() || objective.sweep.predicts_variance();
            follow || unseen || self.is_colored() || always || apart()
        };
        *self.compare_parts.get_or_init(examine)
    }

    /// Whether predicted variances have weights: parts with others have no noise by which to compare them.
    pub fn weighs_variances(&self) -> bool {
        self.point.objective.is_weighted() && self.point.objective.sweep.predicts_variance()
    }

    /// The errors' autocorrelation; not computed where residuals are round-off.
    pub fn autocorrelated(&self) -> Option<(usize, Whiteness)> {
        self.autocorrelated_at(WHITENESS_LEVEL)
    }

    /// The errors' autocorrelation at another level.
    pub fn autocorrelated_at(&self, level: f64) -> Option<(usize, Whiteness)> {
        least_white(&self.tested()).filter(|(_, white)| white.p_value < level)
    }

    /// The outputs whose errors are tested for whiteness, all but those that are round-off.
    pub fn tested(&self) -> Vec<(usize, Whiteness)> {
        let whiteness = self.residuals.whiteness.iter().copied().enumerate();
        whiteness.filter(|(j, _)| !self.rounded[*j]).collect()
    }

    /// Whether there is noise to tell the accuracy by: given, or measured. Where no output moves, errors are numbers next to the smallest.
    pub fn has_noise(&self) -> bool {
        let given = matches!(self.point.objective.problem.settings.noise, Noise::Given(_) | Noise::Predicted);
        self.point.degrees > 0.0 && (given || self.residuals.levels.iter().any(|(_, moves)| *moves > 0.0))
    }

    /// Whether the errors of an output are correlated over time, beyond chance and rounding.
    pub fn is_colored(&self) -> bool {
        self.colored_part() > color::SMALL
    }

    /// Whether so large a part of an output is colored errors that the model is more likely to be wrong than the noise to be colored.
    pub fn color_dominates(&self) -> bool {
        self.colored_part() > color::LEFT
    }

    /// The largest part of an output's movement that is an error and follows from the errors before.
    pub fn colored_part(&self) -> f64 {
        let tested = self.tested();
        let parts = tested.iter().filter_map(|(j, white)| {
            let part = self.colored(*j, white);
            is_certain(white.p_value, tested.len(), part).then_some(part)
        });
        parts.fold(0.0, f64::max)
    }

    /// The part of an output's movement that is an error and follows from others.
    pub fn colored(&self, j: usize, white: &Whiteness) -> f64 {
        let (rmse, (_, moves)) = (self.residuals.outputs[j].rmse, self.residuals.levels[j]);
        if moves > 0.0 { rmse / moves * white.predicted.sqrt() } else { 0.0 }
    }

    /// How many errors have the information of one independent error.
    fn variance_inflation(&self, j: usize) -> f64 {
        if self.point.is_static() { 1.0 } else { self.residuals.whiteness[j].variance_inflation }
    }

    /// The same of the output whose errors are correlated most.
    pub fn most_inflation(&self) -> f64 {
        (0..self.residuals.whiteness.len()).map(|j| self.variance_inflation(j)).fold(1.0, f64::max)
    }

    /// How many independent errors an output has the information of, one at least.
    pub fn independent(&self, j: usize) -> f64 {
        self.residuals.outputs[j].samples.max(1) as f64 / self.variance_inflation(j)
    }

    /// Outputs whose errors are correlated, where the fit took them as independent.
    pub fn coupled(&self) -> Option<Coupled> {
        let objective = self.point.objective;
        let independent = matches!(objective.whitening, Whitening::Diagonal(_));
        let own = matches!(objective.problem.settings.noise, Noise::Predicted);
        self.residuals.coupled.filter(|_| independent && !own && !self.rounding)
    }
}
