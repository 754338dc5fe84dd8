//! [`Point`]: the end of a search, and what follows from its slopes without a pass over the data.

use crate::covariance::{bounds, directions};
use crate::estimate::Starts;
use crate::estimate::student::Spread;
use crate::information::Undetermined;
use crate::layout::Kind;
use crate::optimize::{LeastSquares, Linearization, Outcome, is_negligible};
use crate::problem::{Memory, Noise, Objective, Whitening, noise};

/// The end of a search.
#[derive(Clone)]
pub(crate) struct SearchEnd {
    pub coordinates: Vec<f64>,
    pub whitening: Whitening,
    /// The slopes there, if they are still those of this whitening.
    pub linear: Option<Linearization>,
    pub outcome: Outcome,
    pub iterations: u64,
    pub evaluations: u64,
    /// The search's name.
    pub name: String,
    /// The last error in writing a checkpoint.
    pub write_error: Option<String>,
    /// Carries at the begins of the segments there.
    pub memory: Memory,
    /// Results of searches from other starts, if there were any.
    pub starts: Option<Starts>,
}

/// The end of a search, and the quantities derived from it.
pub(crate) struct Point<'p> {
    pub objective: &'p Objective<'p>,
    pub end: &'p SearchEnd,
    pub linear: &'p Linearization,
    /// Values of the unknowns, and the derivative of each with respect to its coordinate.
    pub values: Vec<f64>,
    pub slopes: Vec<f64>,
    pub norms: Vec<f64>,
    /// The bound that each unknown is held at.
    pub held_at: Vec<Option<f64>>,
    /// Null directions of the scaled unknowns; and the unknowns held for the covariance: at a bound, or one for each
    /// null direction.
    pub undetermined: Undetermined,
    /// Which unknowns the covariance takes as exact: those that are held, without those whose bound is released, and one for each null
    /// direction.
    pub held_for_covariance: Vec<bool>,
    /// From the estimate to that without the bounds of the released unknowns.
    pub unbounded_step: Vec<f64>,
    /// Degrees of freedom: measurements minus estimated unknowns, at least zero.
    pub degrees: f64,
    /// Estimated noise level relative to that by which the errors were divided.
    pub widening: f64,
}

impl<'p> Point<'p> {
    /// The end of a search with so many measurements.
    pub fn new(objective: &'p Objective<'p>, end: &'p SearchEnd, linear: &'p Linearization, measured: u64) -> Self {
        let (unknowns, coordinates) = (&objective.problem.unknowns, &end.coordinates);
        let n = unknowns.row.len();
        let (gradient, norms, bounds) = (linear.gradient(), linear.column_norms(), unknowns.bounds());
        let at_bound = |i: usize| {
            let ((lower, upper), x) = (bounds[i], coordinates[i]);
            let parameter = unknowns.row[i].parameter;
            let low = (x <= lower && gradient[i] >= 0.0).then_some(parameter.lower);
            low.or((x >= upper && gradient[i] <= 0.0).then_some(parameter.upper))
        };
        let residual = linear.sum_of_squares().sqrt();
        let (starts, logarithms) = (unknowns.start(), objective.logarithms());
        let slopes_vanish =
            |i: usize| logarithms[i] && coordinates[i] < starts[i] && is_negligible(norms[i], gradient[i], residual);
        let negligible: Vec<bool> =
            (0..n).map(|i| slopes_vanish(i) && vanishes(objective, coordinates, linear, i)).collect();
        let held_at: Vec<Option<f64>> = (0..n).map(|i| at_bound(i).or(negligible[i].then_some(0.0))).collect();
        let flat = |i: usize| norms[i] == 0.0 || negligible[i] && !is_proportional(objective, coordinates, linear, i);
        let at_bounds: Vec<bool> = held_at.iter().map(Option::is_some).collect();
        let undetermined = directions::undetermined(linear, &at_bounds);
        let values = unknowns.values(coordinates);
        let slopes = (0..n).map(|i| unknowns.row[i].parameter.transform.slope(values[i])).collect();
        let estimated = undetermined.held.iter().filter(|held| !**held).count() as f64;
        // With no more measurements than unknowns there are no degrees of freedom to estimate the noise from.
        let degrees = if measured <= n as u64 { 0.0 } else { measured as f64 - estimated };
        let widening = match &objective.problem.settings.noise {
            Noise::Given(_) | Noise::Predicted => 1.0,
            _ if noise::only_scales(objective) => {
                (linear.sum_of_squares() / degrees.max(1.0)).sqrt().max(noise::rounding(objective))
            }
            _ => (measured as f64 / degrees.max(1.0)).sqrt(),
        };
        let flat: Vec<bool> = (0..n).map(flat).collect();
        let (held_for_covariance, unbounded_step) =
            bounds::released(linear, &undetermined, &at_bounds, &flat, Spread { standard_error: widening, degrees });
        Point {
            objective,
            end,
            linear,
            values,
            slopes,
            norms,
            held_at,
            undetermined,
            held_for_covariance,
            unbounded_step,
            degrees,
            widening,
        }
    }

    /// Whether an unknown is neither held at a bound, without being released, nor part of a null direction.
    pub fn seen(&self) -> Vec<bool> {
        let held = self.held_at.iter().zip(&self.held_for_covariance);
        let mut seen: Vec<bool> = held.map(|(at, held)| at.is_none() || !held).collect();
        for direction in &self.undetermined.directions {
            directions::taking_part(direction).for_each(|(i, _)| seen[i] = false);
        }
        seen
    }

    pub fn is_static(&self) -> bool {
        self.objective.problem.layout().kind == Kind::Static
    }

    /// Whether the model reproduces the data to their rounding.
    pub fn is_exact(&self) -> bool {
        self.end.outcome == Outcome::Exact
    }
}

/// A rise of the cost by less than this part of the mean square of an error is none: it changes no estimate by a tenth of its standard error.
const LEVEL: f64 = 0.01;

/// Whether the cost does not rise when a quantity is divided by `e`, as where its influence falls towards zero. It rises where the slope is zero at a
/// minimum of the predictions, such as at the decay for which one step of Runge-Kutta's method damps the most.
fn vanishes(objective: &Objective<'_>, coordinates: &[f64], linear: &Linearization, i: usize) -> bool {
    let mut smaller = coordinates.to_vec();
    smaller[i] -= 1.0;
    let costs = objective.cost_at(coordinates).ok().zip(objective.cost_at(&smaller).ok());
    costs.is_some_and(|(here, there)| there - here <= LEVEL * linear.sum_of_squares() / linear.rows().max(1) as f64)
}

/// Whether the cost rises as the slopes of a logarithm say when its quantity grows from next to zero until it changes the errors by one
/// standard deviation, to half of that rise. Not so where the quantity enters as a square, as noise levels do: slopes next to zero then
/// say nothing of its size.
fn is_proportional(objective: &Objective<'_>, coordinates: &[f64], linear: &Linearization, i: usize) -> bool {
    let (norm, gradient) = (linear.column_norms()[i], linear.gradient()[i]);
    let times = (linear.sum_of_squares() / linear.rows().max(1) as f64).sqrt() / norm;
    let rise = times * (gradient + 0.5 * norm * norm * times);
    let mut grown = coordinates.to_vec();
    grown[i] += times.ln_1p();
    let costs = objective.cost_at(coordinates).ok().zip(objective.cost_at(&grown).ok());
    costs.is_some_and(|(here, there)| (there - here - rise).abs() <= 0.5 * rise)
}
