//! [`Exploration`]: points around a start or an end, where slopes show nothing.

use crate::optimize::Outcome;
use crate::optimize::point::Point;
use crate::scaling::Seen;

/// A search that is to end like this, or to go on if it has just begun, unless the cost is lower at one of these points.
#[derive(Clone, Debug)]
pub(super) struct Exploration {
    outcome: Option<Outcome>,
    /// The last one next.
    points: Vec<Vec<f64>>,
    /// How many of these points lie along directions that have lost their influence, and how many such directions.
    beside: usize,
    lost: usize,
    /// At how many of them the cost is the same.
    flat: usize,
}

/// The cost is flat where it changes by less than this part over a hundredth of the unknowns' sizes.
const FLAT: f64 = 1e-9;

impl Exploration {
    /// Inside bounds where an unknown has no slopes.
    pub fn at_start(point: &Point, seen: &Seen) -> Self {
        Exploration { outcome: None, points: point.inside(seen), beside: 0, lost: 0, flat: 0 }
    }

    /// The same before a search ends, and along directions that have lost their influence on the way: there were this many
    /// without at the fewest.
    pub fn before_end(point: &Point, outcome: Outcome, seen: &Seen, unseen: usize) -> Self {
        let mut exploration = Exploration { outcome: Some(outcome), points: vec![], beside: 0, lost: 0, flat: 0 };
        let without_influence = point.without_influence();
        if without_influence.len() > unseen
            && matches!(outcome, Outcome::Converged { .. } | Outcome::LimitOfPrecision { .. })
        {
            exploration.lost = without_influence.len() - unseen;
            exploration.points = without_influence.iter().flat_map(|direction| point.beside(direction, seen)).collect();
            exploration.beside = exploration.points.len();
        }
        exploration.points.extend(point.inside(seen));
        exploration
    }

    /// Leaves out the remaining points.
    pub fn stop(&mut self) {
        self.points.clear();
    }

    /// The next point.
    pub fn next(&self) -> Option<&[f64]> {
        self.points.last().map(Vec::as_slice)
    }

    /// Takes it out.
    pub fn take(&mut self) -> Vec<f64> {
        self.points.pop().unwrap_or_default()
    }

    /// Whether the cost is lower at the point that was taken out last; remembers whether it is the same.
    pub fn is_lower(&mut self, point: &Point, next: &Point) -> bool {
        let beside = self.points.len() < self.beside;
        self.flat += usize::from(beside && next.cost() <= point.cost() + FLAT * point.cost_size());
        next.cost() < point.cost() - point.resolution()
    }

    /// How the search ends after all; `None` if it has just begun. `spent` says that it has found lower costs too often.
    pub fn outcome(&self, point: &Point, spent: bool) -> Option<Outcome> {
        // Of several lost directions the flat one may lie between those explored; and a saddle that the search comes back
        // to is no minimum either.
        let plateau = self.flat > 0 || self.lost > 1 || self.lost > 0 && spent;
        self.outcome.map(|outcome| match plateau {
            true => Outcome::Plateau { lost: self.lost, gradient: point.cosine() },
            false => outcome,
        })
    }
}
