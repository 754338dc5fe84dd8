//! [`Exploration`]: points around a start or an end, where slopes show nothing.

use crate::optimize::Outcome;
use crate::optimize::point::Point;
use crate::scaling::Seen;

/// Points to be evaluated before a search ends, or after its start. If the cost is lower at one of them, the search goes on from there;
/// if not, it ends with this outcome, or goes on from its start.
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

    /// Points before the end of a search: those of [`at_start`](Self::at_start), and points along directions that lost their influence
    /// during the search. `unseen` is the least number of directions without influence that was met.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::Information;
    use crate::optimize::point::tests::{at, linear};
    use crate::optimize::{Domain, Linearization};

    /// Costs of 2 and a little more or less.
    fn cost(more: f64) -> Point {
        at(1.0, linear(&[(0.0, (4.0f64 + 2.0 * more).sqrt())]))
    }

    /// Only points along lost directions tell of a plateau, and only a cost below what it resolves is lower.
    #[test]
    fn flat_and_lower_points() {
        let points = vec![vec![1.0], vec![2.0], vec![3.0]];
        let mut exploration = Exploration { outcome: None, points, beside: 2, lost: 1, flat: 0 };
        // The cost resolves 2e-13, and is flat within 2e-9.
        for (more, lower, flat) in [(-1e-10, true, 0), (1e-9, false, 1), (3e-9, false, 1)] {
            exploration.take();
            assert_eq!(exploration.is_lower(&cost(0.0), &cost(more)), lower, "{more}");
            assert_eq!(exploration.flat, flat, "{more}");
        }
        assert!(!exploration.is_lower(&cost(0.0), &cost(0.0)) && exploration.flat == 2);
    }

    /// Of three unknowns two have no influence, and one of these had none before.
    #[test]
    fn directions_lost_on_the_way() {
        let mut information = Information::new(3);
        information.absorb_row(&[1.0, 0.0, 0.0], 1.0);
        let linear = Linearization::new(0.5, 1, vec![information]);
        let point = Point::new(vec![1.0; 3], linear, &Domain::default(), &Seen::default()).unwrap();
        let (end, seen) = (Outcome::Converged { step: 0.0, gradient: 0.0 }, Seen::new(&[1.0; 3], &[None; 3]));
        let exploration = |outcome, unseen| {
            let exploration = Exploration::before_end(&point, outcome, &seen, unseen);
            (exploration.lost, exploration.beside, exploration.points.len())
        };
        assert_eq!([exploration(end, 0), exploration(end, 1), exploration(end, 2)], [(2, 4, 4), (1, 4, 4), (0, 0, 0)]);
        assert_eq!(exploration(Outcome::TimeLimit, 0), (0, 0, 0));
    }

    #[test]
    fn a_plateau_is_flat_or_has_lost_directions() {
        let end = Outcome::Converged { step: 0.0, gradient: 0.0 };
        let ends = |lost: usize, flat: usize, spent: bool| {
            let exploration = Exploration { outcome: Some(end), points: vec![], beside: 0, lost, flat };
            exploration.outcome(&cost(0.0), spent).unwrap()
        };
        for (lost, flat, spent) in [(0, 1, false), (2, 0, false), (1, 0, true)] {
            assert!(matches!(ends(lost, flat, spent), Outcome::Plateau { .. }), "{lost} {flat} {spent}");
        }
        for (lost, flat, spent) in [(0, 0, false), (1, 0, false), (0, 0, true)] {
            assert_eq!(ends(lost, flat, spent), end, "{lost} {flat} {spent}");
        }
        let begun = Exploration { outcome: None, points: vec![], beside: 0, lost: 2, flat: 0 };
        assert_eq!(begun.outcome(&cost(0.0), true), None);
    }
}
