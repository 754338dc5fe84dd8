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

/// What slopes are taken with respect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Seed {
    /// An entry of what is carried, at its start.
    Carry(usize),
    /// A parameter.
    Parameter(usize),
}

/// The leaves that vary with the seeds, and how.
pub(crate) struct Variables {
    pub leaves: Vec<Id>,
    /// The slopes of each leaf.
    pub tangents: Vec<Tangent>,
    pub seeds: usize,
}

impl Variables {
    /// The carried entries, whose slopes are leaves themselves where `pattern` says that there are any, and the seeded
    /// parameters.
    pub fn new(tape: &mut Tape, seeds: &[Seed], pattern: &Pattern) -> Self {
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
    /// All slopes that may arise from unit slopes at the start, by what each next entry depends on.
    pub fn new(tape: &mut Tape, next: &[Id], seeds: &[Seed]) -> Self {
        let n = next.len();
        let mut all: Vec<Id> = (0..n).map(|i| tape.leaf(state(i))).collect();
        all.extend(seeds.iter().map(|seed| match seed {
            Seed::Carry(i) => tape.leaf(state(*i)),
            Seed::Parameter(j) => tape.leaf(Leaf::Parameter(u32::try_from(*j).unwrap_or(u32::MAX))),
        }));
        let influence = forward::influence(tape, &all, next);
        let parameter = |s: usize| matches!(seeds[s], Seed::Parameter(_));
        let mut there: Vec<Vec<bool>> =
            (0..n).map(|i| seeds.iter().map(|seed| *seed == Seed::Carry(i)).collect()).collect();
        let mut grew = true;
        while grew {
            grew = false;
            for i in 0..n {
                for s in 0..seeds.len() {
                    let from_parameter = parameter(s) && influence[i][n + s];
                    let reached = from_parameter || (0..n).any(|j| influence[i][j] && there[j][s]);
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
    match way {
        Way::Carried => forward::carried(tape, roots, variables),
        Way::Forward => Cuts::new(tape, roots, variables).slopes(tape, roots, variables, forward::gradients),
        Way::Reverse => Cuts::new(tape, roots, variables).slopes(tape, roots, variables, reverse::gradients),
    }
}
