//! [`Point`]: where a search stands, and the tests that both searches share.
//!
//! Near a minimum the cost has half the digits of the unknowns: it cannot tell points apart that differ by 1e-8 of what
//! the data resolve. There the length of the residual's projection on the Jacobian's columns decides, which is what Bates
//! and Watts (Technometrics 23 (1981) 179) call the relative offset; unlike the gradient it weighs all directions alike.

use super::{Domain, Linearization, Outcome, PRECISION, Stop};
use crate::scaling::Seen;

/// Where a search stands.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub x: Vec<f64>,
    pub linear: Linearization,
    pub gradient: Vec<f64>,
    pub norms: Vec<f64>,
    pub held: Vec<bool>,
    /// Unknowns whose change by their own size moves the residual by less than its rounding; their gradients are rounding, too.
    silent: Vec<bool>,
    /// How far each unknown may move, down and up.
    pub limits: Vec<(f64, f64)>,
    bounds: Vec<(f64, f64)>,
    /// The step without damping, but for directions that the data do not determine.
    pub full: Option<Vec<f64>>,
    /// By how much the full step would lower the cost, if the slopes held.
    pub potential: f64,
}

/// A cost cannot tell apart points that differ by less than this part of it.
const RESOLUTION: f64 = 1e-13;
/// A residual below this part of the data's norm is rounding.
const ROUNDING: f64 = 1e-10;
/// A residual within so many roundings of the unknowns is rounding, too.
const ROUNDINGS: f64 = 10.0;
/// Directions with a singular value below this part of the largest (columns scaled to unit norm) have no influence, and
/// are damped.
const RANK: f64 = 1e-10;

/// The distance explored along a direction without influence, as a part of the unknowns' sizes.
const BESIDE: f64 = 1e-2;
/// How far inside its bound an unknown without slopes is tried, as a part of its size.
const INSIDE: f64 = 1e-3;

/// A quantity that changes the residual by less than this part is negligible: it moves no other unknown by more than about so many
/// standard errors times the root of the number of measurements.
const NEGLIGIBLE: f64 = 1e-9;
/// A column has shrunk if its norm is below this part of the largest one. On a plateau where the quantity is far too large, norms grow
/// on the way down and never are.
const SHRUNK: f64 = 0.1;

/// Whether the quantity behind a logarithm with a column of this norm is negligible, while the cost still falls along with it.
pub(crate) fn is_negligible(norm: f64, gradient: f64, residual: f64) -> bool {
    gradient >= 0.0 && norm <= NEGLIGIBLE * residual
}

impl Point {
    /// `None` where cost or slopes are no finite numbers. `seen` is what came before, if anything did.
    pub fn new(x: Vec<f64>, linear: Linearization, domain: &Domain, seen: &Seen) -> Option<Self> {
        let (gradient, norms) = (linear.gradient(), linear.column_norms());
        if !linear.cost.is_finite() || gradient.iter().chain(&norms).any(|entry| !entry.is_finite()) {
            return None;
        }
        let mut bounds = domain.bounds.clone();
        bounds.resize(x.len(), (f64::NEG_INFINITY, f64::INFINITY));
        let limits: Vec<(f64, f64)> = bounds.iter().zip(&x).map(|(bound, x)| (bound.0 - x, bound.1 - x)).collect();
        // Held: what has no influence, or has lost it, and what sits on a bound that it would cross.
        let on_bound = |i: usize| limits[i].0 >= 0.0 && gradient[i] >= 0.0 || limits[i].1 <= 0.0 && gradient[i] <= 0.0;
        let residual = linear.sum_of_squares().sqrt();
        let is_logarithm = |i: usize| domain.logarithms.get(i) == Some(&true);
        let has_shrunk = |i: usize| seen.norms.get(i).is_some_and(|largest| norms[i] < SHRUNK * largest);
        let negligible = |i: usize| is_logarithm(i) && has_shrunk(i) && is_negligible(norms[i], gradient[i], residual);
        let held: Vec<bool> = (0..x.len()).map(|i| norms[i] == 0.0 || on_bound(i) || negligible(i)).collect();
        let size = |i: usize| if is_logarithm(i) { 1.0 } else { x[i].abs() };
        let is_silent = |i: usize| size(i) > 0.0 && norms[i] * size(i) <= f64::EPSILON * residual;
        let silent: Vec<bool> = (0..x.len()).map(is_silent).collect();
        let damping: Vec<f64> = norms.iter().map(|norm| RANK * norm).collect();
        let full = linear.step_within(&damping, &held, &limits);
        let potential = full.as_ref().map_or(f64::INFINITY, |step| linear.predicted_reduction(step));
        Some(Point { x, linear, gradient, norms, held, silent, limits, bounds, full, potential })
    }

    pub fn cost(&self) -> f64 {
        self.linear.cost
    }

    /// Size of the terms of the cost, by which its changes are measured. Where variances are predicted, their logarithms
    /// may leave a sum that is negative or next to zero.
    pub fn cost_size(&self) -> f64 {
        self.cost().abs().max(0.5 * self.linear.sum_of_squares())
    }

    fn free(&self) -> impl Iterator<Item = usize> {
        (0..self.x.len()).filter(|&i| !self.held[i])
    }

    /// Largest cosine between the residual and a free column of the Jacobian that moves it.
    pub fn cosine(&self) -> f64 {
        let residual = self.linear.sum_of_squares().sqrt();
        let moving = self.free().filter(|&i| !self.silent[i]);
        moving.map(|i| self.gradient[i].abs() / (self.norms[i] * residual)).fold(0.0, f64::max)
    }

    /// Largest part of itself, or of the standard error it has at least, by which the full step moves an unknown.
    pub fn relative_step(&self) -> f64 {
        let sigma = (self.linear.sum_of_squares() / self.linear.rows().max(1) as f64).sqrt();
        let size = |step: &Vec<f64>| {
            let moved = self.free().filter(|&i| step[i] != 0.0);
            moved.map(|i| step[i].abs() / (self.x[i].abs() + sigma / self.norms[i])).fold(0.0, f64::max)
        };
        self.full.as_ref().map_or(f64::MAX, size).min(f64::MAX)
    }

    /// Slope of the cost along a step; negative downhill.
    pub fn slope(&self, step: &[f64]) -> f64 {
        self.gradient.iter().zip(step).map(|(g, d)| g * d).sum()
    }

    /// `x + step`, exactly on the bound where the step reaches its limit.
    pub fn towards(&self, step: &[f64]) -> Vec<f64> {
        let along = |i: usize| {
            let ((down, up), (lower, upper)) = (self.limits[i], self.bounds[i]);
            match step[i] {
                step if step <= down => lower,
                step if step >= up => upper,
                // Not `clamp`, which panics where the bounds are out of order.
                step => (self.x[i] + step).max(lower).min(upper),
            }
        };
        (0..self.x.len()).map(along).collect()
    }

    /// The smallest difference that the cost resolves, in its own unit.
    pub fn resolution(&self) -> f64 {
        RESOLUTION * self.cost_size()
    }

    /// The directions, of unknowns that are not on a bound nor forgotten, that have no influence.
    pub fn without_influence(&self) -> Vec<Vec<f64>> {
        let mut held: Vec<bool> = self.limits.iter().map(|(down, up)| *down >= 0.0 || *up <= 0.0).collect();
        self.linear.forgotten().iter().for_each(|i| held[*i] = true);
        let direction = |entries: Vec<(usize, f64)>| {
            let mut direction = vec![0.0; self.x.len()];
            for (i, entry) in entries {
                direction[i] = if self.norms[i] > 0.0 { entry / self.norms[i] } else { entry };
            }
            direction
        };
        self.linear.undetermined(&held, RANK).directions.into_iter().map(direction).collect()
    }

    /// Points to either side along a direction, a hundredth of the unknowns' sizes away.
    pub fn beside(&self, direction: &[f64], seen: &Seen) -> Vec<Vec<f64>> {
        let sizes = (0..self.x.len()).filter(|&i| seen.size(i) > 0.0).map(|i| direction[i].abs() / seen.size(i));
        let length = BESIDE / sizes.fold(0.0, f64::max);
        let side = |sign: f64| self.towards(&direction.iter().map(|d| sign * length * d).collect::<Vec<f64>>());
        if length.is_finite() { vec![side(1.0), side(-1.0)] } else { vec![] }
    }

    /// Points with an unknown inside that sits on its bound without slopes, one for each such unknown: slopes that are infinite
    /// at a bound are given as zeros.
    pub fn inside(&self, seen: &Seen) -> Vec<Vec<f64>> {
        let free = |i: &usize| self.norms[*i] == 0.0 && (self.limits[*i].0 < 0.0) != (self.limits[*i].1 > 0.0);
        let moved = |unknown: usize| {
            let (down, up) = self.limits[unknown];
            let width = up.max(-down).min(1.0);
            let size = if seen.size(unknown) > 0.0 { seen.size(unknown).min(width) } else { width };
            let mut x = self.x.clone();
            x[unknown] += if up > 0.0 { INSIDE * size } else { -INSIDE * size };
            x
        };
        (0..self.x.len()).filter(free).map(moved).collect()
    }

    /// Whether the residual is the rounding of the data and of the unknowns.
    fn is_rounding(&self) -> bool {
        let left = self.linear.sum_of_squares();
        let unknowns: f64 = self.x.iter().zip(&self.norms).map(|(x, norm)| (f64::EPSILON * x * norm).powi(2)).sum();
        let small = self.linear.data_norm().is_none_or(|norm| left <= (ROUNDING * norm).powi(2));
        left == 0.0 || left > 0.0 && small && left <= ROUNDINGS.powi(2) * unknowns
    }

    /// By how much the cost jumps, as a part of it, because the data are rounded before the model is subtracted.
    fn rounding(&self) -> f64 {
        let left = self.linear.sum_of_squares().sqrt();
        let norm = self.linear.data_norm().filter(|_| left > 0.0);
        norm.map_or(0.0, |norm| ROUNDINGS * f64::EPSILON * norm / left)
    }

    /// Whether the gradient is that of the rounding of the data.
    pub fn is_flat(&self) -> bool {
        self.cosine() <= self.rounding()
    }

    /// Whether the residual is far below the data.
    fn is_next_to_data(&self) -> bool {
        self.linear.data_norm().is_some_and(|norm| self.linear.sum_of_squares() <= (ROUNDING * norm).powi(2))
    }

    /// Whether the search is over here by itself: nothing left to do, or the full step negligible. (A damped one may be short
    /// for its damping alone.)
    pub fn ended(&self, stop: &Stop) -> Option<Outcome> {
        if self.is_rounding() {
            return Some(Outcome::Exact);
        }
        if self.norms.iter().all(|&norm| norm == 0.0) {
            return Some(Outcome::Stalled { gradient: 0.0, step: 0.0, failed: 0 });
        }
        let (step, gradient) = (self.relative_step(), self.cosine());
        if step <= stop.step && gradient <= stop.gradient {
            return Some(Outcome::Converged { step, gradient });
        }
        let decrease = self.potential / self.cost_size();
        (stop.cost > 0.0 && decrease <= stop.cost).then_some(Outcome::CostUnchanged { decrease })
    }

    /// How a search ends here that no step leads away from. `noise` is how far, as a part of the cost, the last trials were
    /// off what the slopes predicted; `rough` says that they were off however short.
    pub fn stuck(&self, failed: u64, noise: f64, rough: bool) -> Outcome {
        let (step, gradient) = (self.relative_step(), self.cosine());
        let noise = noise.max(self.rounding());
        let left = self.potential / self.cost_size();
        if self.is_next_to_data() {
            Outcome::Exact
        } else if gradient <= PRECISION {
            Outcome::LimitOfPrecision { gradient, step }
        } else if rough || left <= noise {
            self.rough(noise.max(left))
        } else {
            Outcome::Stalled { gradient, step, failed }
        }
    }

    fn rough(&self, noise: f64) -> Outcome {
        let left = self.potential / self.cost_size();
        // A step of `d` standard errors gains `d^2 / (2 rows)` of the sum of squares.
        Outcome::Rough { noise, errors: (left.max(0.0) * self.linear.rows() as f64).sqrt() }
    }
}

/// The outcome of a search that stopped at a point where the cost resolves no further step.
pub(crate) fn limit_of_precision(x: &[f64], linear: Linearization, domain: &Domain) -> Option<Outcome> {
    let point = Point::new(x.to_vec(), linear, domain, &Seen::default())?;
    Some(Outcome::LimitOfPrecision { gradient: point.cosine(), step: point.relative_step() })
}

/// The outcome of a search that stopped at a point because no step lowers its cost, from cost and slopes there:
/// [`Outcome::Rough`] if the full step is negligible, or would lower the cost by less than `noise` at the
/// point it leads to; else `None`.
pub(crate) fn within_tolerance(
    x: &[f64],
    linear: Linearization,
    domain: &Domain,
    noise: impl Fn(&[f64]) -> f64,
) -> Option<Outcome> {
    let point = Point::new(x.to_vec(), linear, domain, &Seen::default())?;
    let noise = noise(&point.towards(point.full.as_ref()?));
    // The relative difference is not finite where the cost is zero.
    let rough = Some(noise / point.cost_size()).filter(|part| part.is_finite()).map(|part| point.rough(part))?;
    (point.potential <= noise || rough.converged()).then_some(rough)
}

#[cfg(test)]
pub(super) mod tests;
