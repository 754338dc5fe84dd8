//! Slopes of a step: of its results with respect to chosen seeds, as further nodes.
//!
//! Three ways give the same numbers, and the one of fewest instructions is taken: slopes carried through every operation, as
//! duals do; the step's own Jacobian forward, or in reverse (a sweep for each result), and then the chain rule with the slopes
//! that the step starts from. The last two treat some operations apart (*cuts*): those whose slope may be infinite where
//! their value is not (a square root at zero: what does not vary contributes nothing), and selects of a side that could be
//! infinite when it is not taken, whose adjoint of zero would make it not a number. A cut's own slopes are computed as if it
//! were carried, and it counts as one more variable of what depends on it (A. Griewank, A. Walther, *Evaluating
//! Derivatives*, 2008, chapters 3 and 9).

mod cuts;
mod forward;
mod reverse;

use super::tape::Tape;
use super::{Id, Leaf};
use cuts::Cuts;

/// One slope per seed; none where it is zero whatever the numbers.
pub(crate) type Tangent = Vec<Option<Id>>;

/// How slopes are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Through every operation.
    Carried,
    /// By the step's Jacobian, forward.
    Forward,
    /// By the step's Jacobian, in reverse.
    Reverse,
}

/// A quantity with respect to which slopes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Seed {
    /// An entry of what is carried, at its start.
    Carry(usize),
    /// A parameter.
    Parameter(usize),
}

/// A number that follows from parameters and the time between two samples, computed before a pass. It stands after the parameters, and after it
/// stand its slopes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Following {
    /// Its number as a [`Leaf::Parameter`].
    pub number: u32,
    /// The parameters that it has slopes with respect to.
    pub moves: Vec<u32>,
}

/// A number as leaves have it; no graph has as many as it does not hold.
pub(crate) fn narrow(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

impl Following {
    /// The leaf of its slope.
    fn slope(&self, seed: &Seed) -> Option<Leaf> {
        let Seed::Parameter(j) = *seed else { return None };
        let at = self.moves.iter().position(|moves| *moves as usize == j)?;
        Some(Leaf::Parameter(self.number + 1 + u32::try_from(at).unwrap_or(u32::MAX)))
    }

    /// The leaf after its last slope.
    pub fn end(&self) -> usize {
        self.number as usize + 1 + self.moves.len()
    }
}

/// With more cuts than this, slopes are carried.
const MAX_CUTS: usize = 64;

/// The leaves that vary with the seeds, and how.
pub(crate) struct Variables {
    pub leaves: Vec<Id>,
    /// The slopes of each leaf.
    pub tangents: Vec<Tangent>,
    pub seeds: usize,
}

impl Variables {
    /// The carried entries, whose slopes are leaves themselves where `pattern` says that there are any, the seeded parameters, and what follows from
    /// these.
    pub fn new(tape: &mut Tape, seeds: &[Seed], pattern: &Pattern, following: &[Following]) -> Self {
        let (mut leaves, mut tangents) = (vec![], vec![]);
        for (i, row) in pattern.rows.iter().enumerate() {
            if row.iter().any(Option::is_some) {
                leaves.push(tape.leaf(state(i)));
                tangents.push(row.iter().map(|at| at.map(|at| tape.leaf(state(at)))).collect());
            }
        }
        for (s, seed) in seeds.iter().enumerate() {
            if let Seed::Parameter(j) = seed {
                leaves.push(tape.leaf(Leaf::Parameter(u32::try_from(*j).unwrap_or(u32::MAX))));
                let one = tape.constant(1.0);
                tangents.push((0..seeds.len()).map(|i| (i == s).then_some(one)).collect());
            }
        }
        for one in following {
            let slopes: Vec<Option<Leaf>> = seeds.iter().map(|seed| one.slope(seed)).collect();
            if slopes.iter().any(Option::is_some) {
                leaves.push(tape.leaf(Leaf::Parameter(one.number)));
                tangents.push(slopes.iter().map(|slope| slope.map(|slope| tape.leaf(slope))).collect());
            }
        }
        Variables { leaves, tangents, seeds: seeds.len() }
    }
}

pub(crate) fn state(i: usize) -> Leaf {
    Leaf::State(u32::try_from(i).unwrap_or(u32::MAX))
}

/// Which carried entries have which slopes, and where each slope stands among the entries that a program carries.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pattern {
    pub rows: Vec<Vec<Option<usize>>>,
}

impl Pattern {
    /// All slopes that may arise from unit slopes at the start and from what else each entry `starts` from, by what each next entry
    /// depends on.
    pub fn new(
        tape: &mut Tape,
        next: &[Id],
        seeds: &[Seed],
        following: &[Following],
        starts: &dyn Fn(usize, Leaf) -> bool,
    ) -> Self {
        let n = next.len();
        let leaf = |seed: &Seed| match seed {
            Seed::Carry(i) => state(*i),
            Seed::Parameter(j) => Leaf::Parameter(u32::try_from(*j).unwrap_or(u32::MAX)),
        };
        let mut all: Vec<Id> = (0..n).map(|i| tape.leaf(state(i))).collect();
        all.extend(seeds.iter().map(|seed| tape.leaf(leaf(seed))));
        all.extend(following.iter().map(|one| tape.leaf(Leaf::Parameter(one.number))));
        let influence = forward::influence(tape, &all, next);
        let by_parameters = |i: usize, s: usize, seed: &Seed| {
            let itself = matches!(seed, Seed::Parameter(_)) && influence[i][n + s];
            let mut moving = following.iter().zip(&influence[i][n + seeds.len()..]);
            itself || moving.any(|(one, reaches)| *reaches && one.slope(seed).is_some())
        };
        let mut there: Vec<Vec<bool>> = (0..n)
            .map(|i| seeds.iter().map(|seed| *seed == Seed::Carry(i) || starts(i, leaf(seed))).collect())
            .collect();
        let mut grew = true;
        while grew {
            grew = false;
            for i in 0..n {
                for (s, seed) in seeds.iter().enumerate() {
                    let reached = by_parameters(i, s, seed) || (0..n).any(|j| influence[i][j] && there[j][s]);
                    if reached && !there[i][s] {
                        (there[i][s], grew) = (true, true);
                    }
                }
            }
        }
        let mut at = n;
        let mut numbered = |there: &bool| {
            at += usize::from(*there);
            there.then_some(at - 1)
        };
        Pattern { rows: there.iter().map(|row| row.iter().map(&mut numbered).collect()).collect() }
    }
}

/// The slopes of the roots.
pub(crate) fn slopes(tape: &mut Tape, roots: &[Id], variables: &Variables, way: Way) -> Vec<Tangent> {
    if variables.seeds == 0 || variables.leaves.is_empty() {
        return vec![vec![None; variables.seeds]; roots.len()];
    }
    if way == Way::Carried {
        return forward::carried(tape, roots, variables);
    }
    match (Cuts::new(tape, roots, variables), way) {
        // Each takes gradients of its own.
        (cuts, _) if cuts.count() > MAX_CUTS => forward::carried(tape, roots, variables),
        (cuts, Way::Forward) => cuts.slopes(tape, roots, variables, forward::gradients),
        (cuts, _) => cuts.slopes(tape, roots, variables, reverse::gradients),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::graph::{Function, Function2, Graph};
    use crate::scalar::Comparison;

    const SEEDS: usize = 4;
    const POINTS: [[f64; SEEDS]; 8] = [
        [0.0, 1.0, 0.5, 2.0],
        [0.0, 0.0, 0.5, 2.0],
        [-1.0, 0.3, 0.7, -2.0],
        [1.0, 1.0, -0.5, 0.0],
        [4.0, -3.0, 0.0, 0.2],
        [0.25, 0.25, 1.0, 1.0],
        [-0.0, 2.0, 1.5, 0.1],
        [1e-3, -1e-3, 3.0, 0.4],
    ];

    /// Two states whose slopes are carried and two parameters; each expression is differentiated in all three ways.
    fn agrees(build: impl Fn(&mut Graph, [Id; 4]) -> Vec<Id>) {
        let mut graph = Graph::default();
        let leaves =
            [Leaf::State(0), Leaf::State(1), Leaf::Parameter(0), Leaf::Parameter(1)].map(|leaf| graph.leaf(leaf));
        let roots = build(&mut graph, leaves);
        let seeds = [Seed::Carry(0), Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(1)];
        for way in [Way::Carried, Way::Forward, Way::Reverse] {
            let mut tape = Tape::new(true);
            let values = tape.import(&graph, &roots);
            // All slopes may be there; those of the parameters are zero at the start.
            let row = |i: usize| (0..SEEDS).map(|s| Some(2 + i * SEEDS + s)).collect();
            let pattern = Pattern { rows: vec![row(0), row(1)] };
            let variables = Variables::new(&mut tape, &seeds, &pattern, &[]);
            let tangents = slopes(&mut tape, &values, &variables, way);
            for point in POINTS {
                let value = |leaf| match leaf {
                    Leaf::State(i) if i < 2 => point[i as usize],
                    Leaf::State(i) => f64::from(u8::from((i as usize - 2) / SEEDS == (i as usize - 2) % SEEDS)),
                    Leaf::Parameter(j) => point[2 + j as usize],
                    _ => f64::NAN,
                };
                let expected = graph.evaluate(&roots, |leaf| match leaf {
                    Leaf::State(i) => Dual::<SEEDS>::variable(point[i as usize], i as usize),
                    Leaf::Parameter(j) => Dual::variable(point[2 + j as usize], 2 + j as usize),
                    _ => Dual::from(f64::NAN),
                });
                let mut all = vec![];
                tape.graph.evaluate_all(&mut all, value);
                for (expected, tangent) in expected.iter().zip(&tangents) {
                    if !expected.value.is_finite() {
                        continue;
                    }
                    for (s, expected) in expected.slopes.iter().enumerate() {
                        let found = tangent[s].map_or(0.0, |slope| all[slope.index()]);
                        let same = found == *expected
                            || (found - expected).abs() <= 1e-13 * expected.abs().max(1.0)
                            || found.is_nan() && expected.is_nan();
                        assert!(same, "{way:?} at {point:?}: slope {s} is {found}, not {expected}, of\n{graph}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_side_not_taken_does_not_reach_the_slopes() {
        agrees(|graph, [x, _, p, _]| {
            let (zero, root) = (graph.constant(0.0), graph.function(Function::Sqrt, x));
            let chosen = graph.select(Comparison::Less, x, zero, zero, root);
            vec![graph.mul(chosen, p)]
        });
        agrees(|graph, [x, y, p, q]| {
            let (one, ratio) = (graph.constant(1.0), graph.div(p, x));
            let inner = graph.select(Comparison::Equal, x, y, one, ratio);
            let outer = graph.select(Comparison::LessOrEqual, inner, q, y, inner);
            vec![graph.mul(outer, outer), graph.add(inner, outer)]
        });
    }

    #[test]
    fn what_does_not_vary_contributes_nothing_to_an_infinite_slope() {
        agrees(|graph, [x, y, p, q]| {
            let (xx, yy) = (graph.mul(x, x), graph.mul(y, y));
            let sum = graph.add(xx, yy);
            let root = graph.function(Function::Sqrt, sum);
            let length = graph.function2(Function2::Hypot, x, y);
            let scaled = graph.mul(root, p);
            let power = graph.function2(Function2::Pow, sum, q);
            vec![graph.mul(scaled, q), graph.mul(length, p), root, power]
        });
        // Two steps of a tank that runs dry: the second root depends on the first.
        agrees(|graph, [x, _, p, q]| {
            let mut level = x;
            for _ in 0..3 {
                let root = graph.function(Function::Sqrt, level);
                let flow = graph.mul(root, p);
                let change = graph.sub(q, flow);
                level = graph.mul_add(change, q, level);
            }
            vec![level]
        });
    }
}
