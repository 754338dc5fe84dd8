//! [`Trace`]: a profile followed from the estimate to both sides.

use super::super::{Pinned, minimize};
use super::{End, ProfilePoint};
use crate::estimate::{Summary, Unknown};
use crate::optimize::LeastSquares;
use crate::problem::Objective;

/// Most points on each side.
const POINTS: usize = 40;
/// After so many points that a root of the rise below this part of the threshold's shows no end.
const FLAT: (usize, f64) = (8, 1e-3);
/// The curve goes on to this many times the threshold.
pub(super) const HEIGHT: f64 = 1.5;
/// The ends are found to this part of the root of the threshold.
const CLOSE: f64 = 1e-3;
/// Most points between the last inside and the first outside.
const BETWEEN: usize = 30;

/// A profile while it is computed.
pub(super) struct Trace<'t> {
    pub objective: &'t Objective<'t>,
    pub estimate: &'t Summary,
    /// The unknown's place among the unknowns.
    pub index: usize,
    /// Coordinates of the estimate, and the cost there.
    pub best: Vec<f64>,
    pub cost: f64,
    /// Change of each coordinate with that of the unknown, from the covariance.
    pub along: Vec<f64>,
    /// Standard error of the unknown's coordinate.
    pub scale: f64,
    /// Root of the threshold.
    pub quantile: f64,
    pub inflation: f64,
    /// The points so far.
    pub points: Vec<ProfilePoint>,
    /// Whether a point could not be computed.
    pub failed: bool,
    /// The lowest rise of all points: below zero, a better minimum was met.
    pub lowest: f64,
}

/// A point of the profile: the unknown's coordinate, the root of the rise, and all coordinates.
struct Reached {
    at: f64,
    root: f64,
    place: Vec<f64>,
}

impl Trace<'_> {
    fn unknown(&self) -> &Unknown {
        &self.estimate.unknowns[self.index]
    }

    fn value(&self, coordinate: f64) -> f64 {
        self.unknown().transform.to_value(coordinate)
    }

    /// Adds the point of these coordinates.
    pub fn add(&mut self, place: &[f64], rise: f64) {
        let values = self.estimate.unknowns.iter().zip(place).map(|(u, &c)| u.transform.to_value(c)).collect();
        self.points.push(ProfilePoint { value: self.value(place[self.index]), rise: rise.max(0.0), unknowns: values });
    }

    /// The point at a coordinate of the unknown; the search for it starts from another point. `None` if it finds none.
    fn point(&mut self, at: f64, from: &[f64]) -> Option<Reached> {
        let mut bounds = self.objective.bounds();
        let mut start = from.to_vec();
        for ((start, along), (lower, upper)) in start.iter_mut().zip(&self.along).zip(&bounds) {
            *start = (*start + along * (at - from[self.index])).clamp(*lower, *upper);
        }
        start[self.index] = at;
        bounds[self.index] = (at, at);
        let (place, cost) = minimize(Pinned { problem: self.objective, bounds }, start)?;
        let rise = 2.0 * (cost - self.cost) / self.inflation;
        self.lowest = self.lowest.min(rise);
        self.add(&place, rise);
        Some(Reached { at, root: rise.max(0.0).sqrt(), place })
    }

    /// Follows the profile to one side (`sign` is -1 or 1), and gives the interval's end there.
    pub fn side(&mut self, sign: f64) -> End {
        let (lower, upper) = self.objective.bounds()[self.index];
        let bound = if sign < 0.0 { lower } else { upper };
        let mut inside = Reached { at: self.best[self.index], root: 0.0, place: self.best.clone() };
        let mut step = sign * self.scale * self.quantile / 2.0;
        for number in 0..POINTS {
            // Flat so far: the interval is open on this side.
            if number >= FLAT.0 && bound.is_infinite() && inside.root < FLAT.1 * self.quantile {
                break;
            }
            let at_bound = sign * (inside.at + step - bound) >= 0.0;
            let next = if at_bound { bound } else { inside.at + step };
            if next == inside.at {
                return End::Bound(self.value(bound));
            }
            let Some(reached) = self.point(next, &inside.place) else {
                self.failed = true;
                step /= 2.0;
                continue;
            };
            if reached.root >= self.quantile {
                let end = self.crossing(inside, reached, sign, bound);
                return End::At(self.value(end));
            }
            if at_bound {
                return End::Bound(self.value(bound));
            }
            // Half a quantile further by the slope so far, at most twice as far.
            let slope = (reached.root - inside.root) / (next - inside.at).abs();
            let wanted = 0.5 * self.quantile / slope.max(f64::MIN_POSITIVE);
            step = sign * wanted.clamp(0.5 * step.abs(), 2.0 * step.abs());
            inside = reached;
        }
        End::Open(self.value(inside.at))
    }

    /// The coordinate between a point inside and one outside at which the rise is the threshold.
    fn crossing(&mut self, mut inside: Reached, mut outside: Reached, sign: f64, bound: f64) -> f64 {
        let (mut end, highest) = (None, outside.root);
        for _ in 0..BETWEEN {
            let part = ((self.quantile - inside.root) / (outside.root - inside.root)).clamp(0.05, 0.95);
            let Some(reached) = self.point(inside.at + part * (outside.at - inside.at), &inside.place) else {
                self.failed = true;
                break;
            };
            if (reached.root - self.quantile).abs() <= CLOSE * self.quantile {
                end = Some(reached.at);
                break;
            }
            match reached.root < self.quantile {
                true => inside = reached,
                false => outside = reached,
            }
        }
        let end = end.unwrap_or(inside.at + (outside.at - inside.at) / 2.0);
        // Both sides are drawn to one height; a failure there costs a part of the drawing only.
        let beyond = end + (HEIGHT.sqrt() - 1.0) * (end - self.best[self.index]);
        if highest < HEIGHT.sqrt() * self.quantile && sign * (beyond - bound) < 0.0 {
            self.point(beyond, &inside.place);
        }
        end
    }
}
