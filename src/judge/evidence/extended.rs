//! [`Extended`]: the slopes at the estimate with gain, offset and delay of each output as further unknowns.
//!
//! The unknowns take a part of such a fault, which biases them and leaves little in the errors. Gain, offset and delay of each output are
//! therefore tested one by one as one more unknown beside all others, by the slopes at the estimate (score test: Rao, Proc. Cambridge
//! Philosophical Society 44 (1948) 50).

use super::Evidence;
use super::ruled_out::Unless;
use crate::covariance::directions;
use crate::estimate::Unknown;
use crate::estimate::student::two_sided;
use crate::optimize::Linearization;
use crate::problem::Role;
use crate::rows::sensors::{KINDS, Kind};

/// What rules out that rows are extended, and that sensors are tested.
pub(crate) const UNLESS: &[Unless] = &[Unless::Prefilter, Unless::Restarts, Unless::ManyUnknowns, Unless::NoMinimum];
pub(crate) const UNTESTED: &[Unless] = &[
    Unless::Prefilter,
    Unless::Restarts,
    Unless::ManyUnknowns,
    Unless::NoMinimum,
    Unless::NoFreedom(1.0),
    Unless::RoundOff,
];

/// Level of the test, divided by the number of regressors.
pub(crate) const LEVEL: f64 = 1e-4;
/// Part of a regressor's norm that must be orthogonal to the slopes of the unknowns: below it, curvature and rounding decide.
const LEFT: f64 = 1e-4;
/// Norm of the prediction, or of its changes, in standard deviations of the noise, below which its gain or delay has a standard error of more
/// than one by itself: a current that a controller holds at zero.
const ACTS: f64 = 1.0;

/// A regressor that was estimated beside the unknowns.
pub(crate) struct Released {
    pub number: usize,
    /// The steps of the unknowns and of the regressor.
    pub step: Vec<f64>,
    pub value: f64,
    pub standard_error: f64,
    /// The sum of squares that is left, and its probability by chance.
    pub left: f64,
    pub chance: f64,
}

/// The slopes at the estimate, with the regressors of each output behind the shared unknowns.
pub(crate) struct Extended<'j> {
    pub evidence: &'j Evidence<'j>,
    pub linear: Linearization,
}

impl<'j> Extended<'j> {
    /// `None` with a pre-filter, predictions that restart, many unknowns, or without a minimum.
    pub fn new(evidence: &'j Evidence<'j>) -> Option<Self> {
        let objective = evidence.point.objective;
        let (unknowns, mut triangles) = (&objective.problem.unknowns, evidence.rows().sensors.clone()?);
        unknowns.add_priors(&evidence.point.end.coordinates, 1.0, &mut triangles);
        let linear = Linearization::new(0.0, unknowns.shared() + objective.outputs() * KINDS, triangles);
        Some(Extended { evidence, linear })
    }

    /// The regressors beside the unknowns, the one that explains most first, and the number of those that were tested; `None` where it explains
    /// no more than chance.
    pub fn suspects(&self) -> Option<(Vec<Released>, f64)> {
        let numbers = (0..self.regressors()).filter(|number| self.is_examined(*number));
        let mut found: Vec<Released> = numbers.clone().filter_map(|number| self.release(number)).collect();
        found.sort_by(|a, b| a.left.total_cmp(&b.left));
        let tests = numbers.count() as f64;
        (found.first()?.chance * tests < LEVEL).then_some((found, tests))
    }

    fn regressors(&self) -> usize {
        self.evidence.point.objective.outputs() * KINDS
    }

    /// The step of all without regressors.
    pub fn without(&self) -> Option<Vec<f64>> {
        self.linear.step(&vec![0.0; self.linear.unknowns()], &self.held(None))
    }

    /// The place of a regressor.
    pub fn place(&self, number: usize) -> usize {
        self.evidence.point.objective.problem.unknowns.shared() + number
    }

    /// The place of an unknown.
    pub fn place_of(&self, unknown: usize) -> usize {
        let shared = self.evidence.point.objective.problem.unknowns.shared();
        if unknown < shared { unknown } else { unknown + self.regressors() }
    }

    /// Whether an output has noise to tell it by, its samples an order where it is asked for a delay, and its prediction anything that a gain
    /// or a delay changes.
    fn is_examined(&self, number: usize) -> bool {
        let (j, kind) = (number / KINDS, Kind::ALL[number % KINDS]);
        let acts = kind == Kind::Offset || self.linear.column_norms()[self.place(number)] > ACTS;
        acts && !(self.evidence.rounded[j] || kind == Kind::Delay && self.evidence.point.is_static())
    }

    /// Which unknowns and regressors are held, one of the latter released.
    pub fn held(&self, released: Option<usize>) -> Vec<bool> {
        let mut held = vec![true; self.linear.unknowns()];
        for (unknown, of_unknown) in self.evidence.point.undetermined.held.iter().enumerate() {
            held[self.place_of(unknown)] = *of_unknown;
        }
        if let Some(number) = released {
            held[self.place(number)] = false;
        }
        held
    }

    /// The regressor beside the unknowns; `None` where these replace it.
    fn release(&self, number: usize) -> Option<Released> {
        let (place, held) = (self.place(number), self.held(Some(number)));
        let held = directions::undetermined(&self.linear, &held).held;
        let norm = self.linear.column_norms()[place];
        let unit = self.linear.covariance(&held).filter(|_| !held[place])?.standard_error(place);
        // One over what is left of it beside the unknowns.
        if unit * norm * LEFT >= 1.0 || !unit.is_finite() {
            return None;
        }
        let step = self.linear.step(&vec![0.0; held.len()], &held)?;
        let left = self.linear.sum_of_squares() - 2.0 * self.linear.predicted_reduction(&step);
        let degrees = self.degrees();
        let (value, standard_error) = (step[place], unit * (left / degrees).sqrt());
        let chance = two_sided(value / standard_error, degrees);
        Some(Released { number, step, value, standard_error, left, chance })
    }

    /// Degrees of freedom with a regressor.
    pub fn degrees(&self) -> f64 {
        self.evidence.point.degrees - 1.0
    }

    /// The parameter that a step moves by most standard errors, by which part of itself, and by how many.
    pub fn furthest<'u>(&self, step: &[f64], unknowns: &'u [Unknown]) -> Option<(&'u str, f64, f64)> {
        let moves = |i: usize| {
            let unknown = &unknowns[i];
            let error = unknown.knowledge.standard_error().filter(|_| matches!(unknown.role, Role::Parameter(_)))?;
            let by = self.evidence.point.slopes[i] * step[self.place_of(i)];
            (unknown.value != 0.0).then_some((&*unknown.name, (by / unknown.value).abs(), (by / error).abs()))
        };
        (0..unknowns.len()).filter_map(moves).max_by(|a, b| a.2.total_cmp(&b.2))
    }
}
