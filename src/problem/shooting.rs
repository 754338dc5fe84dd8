//! [`Shooting`]: records in pieces with initial states of their own, whose continuity an augmented Lagrangian asks for.

mod rows;
#[cfg(test)]
mod tests;

use super::Objective;
use super::linearize::Part;
use crate::optimize::{Infeasible, LeastSquares};
use std::ops::Range;

/// The most by which a logarithm changes in one search.
const LONGEST: f64 = 1.5;

/// Multiple shooting (H. G. Bock and K. J. Plitt, IFAC Proceedings 17 (1984) 1603): the initial states of all pieces but the first of each record
/// are unknowns, the nodes. A gap is the difference of the state that a piece ends with and the node of the next one, in sizes of the state.
///
/// The cost is that of the measurements, plus `penalty / 2 (gap + multiplier / penalty)^2` for each gap: the augmented Lagrangian of the
/// condition that all gaps are zero (M. R. Hestenes, Journal of Optimization Theory and Applications 4 (1969) 303; M. J. D. Powell in R. Fletcher,
/// *Optimization*, 1969). No node is expressed by the ones before, which would multiply the slopes of all pieces (condensing) and
/// overflow for an unstable plant: they are eliminated piece by piece, by orthogonal reflections, so that time and memory are linear in the
/// number of pieces.
///
/// The unknowns: those that the records share, then for each record its own ones and its nodes in the order of time.
pub(crate) struct Shooting<'p> {
    objective: &'p Objective<'p>,
    /// The samples of the pieces of each record.
    pieces: Vec<Vec<Range<usize>>>,
    /// The size of each state.
    sizes: Vec<f64>,
    penalty: f64,
    /// The multiplier of each gap.
    multipliers: Vec<f64>,
    /// The first own unknown of each record, then the number of all.
    begins: Vec<usize>,
    /// The bounds of the fit's unknowns in this search.
    bounds: Vec<(f64, f64)>,
}

/// What one pass over the pieces says.
pub(crate) struct Passed {
    /// The cost of the measurements alone.
    pub cost: f64,
    /// Each gap, record by record, in the order of time and states.
    pub gaps: Vec<f64>,
}

impl<'p> Shooting<'p> {
    /// With pieces of about so many samples, and the size of each state.
    pub fn new(objective: &'p Objective<'p>, length: usize, sizes: Vec<f64>, penalty: f64) -> Self {
        let pieces: Vec<Vec<Range<usize>>> =
            objective.problem.records.iter().map(|record| cut(record.len(), length)).collect();
        let (unknowns, states) = (&objective.problem.unknowns, sizes.len());
        let mut begins = vec![unknowns.shared()];
        for (e, pieces) in pieces.iter().enumerate() {
            let own = unknowns.columns(e).count() - unknowns.shared();
            begins.push(begins[e] + own + (pieces.len() - 1) * states);
        }
        let gaps = pieces.iter().map(|pieces| (pieces.len() - 1) * states).sum();
        Shooting { objective, pieces, sizes, penalty, multipliers: vec![0.0; gaps], begins, bounds: objective.bounds() }
    }

    /// Begins a search at a point, in which no logarithm changes by more than [`LONGEST`].
    pub fn begin_at(&mut self, x: &[f64]) {
        let (bounds, logarithms) = (self.objective.bounds(), self.objective.logarithms());
        let around = self.coordinates(x).into_iter().zip(logarithms);
        let cut = |((low, high), (x, is_logarithm)): ((f64, f64), (f64, bool))| match is_logarithm {
            true => (low.max(x - LONGEST), high.min(x + LONGEST)),
            false => (low, high),
        };
        self.bounds = bounds.into_iter().zip(around).map(cut).collect();
    }

    /// Whether a search from a point ended where a logarithm was stopped, so that it goes on from there.
    pub fn is_stopped(&self, x: &[f64]) -> bool {
        let coordinates = self.coordinates(x);
        let ends = self.bounds.iter().zip(self.objective.bounds()).zip(&coordinates);
        ends.into_iter()
            .any(|((here, declared), x)| *x == here.0 && here.0 > declared.0 || *x == here.1 && here.1 < declared.1)
    }

    /// The sample and the state of each node of each record.
    pub fn nodes(&self, x: &[f64]) -> Vec<Vec<(usize, Vec<f64>)>> {
        let node = |e: usize, k: usize| (self.pieces[e][k].start, x[self.node(e, k)].to_vec());
        (0..self.pieces.len()).map(|e| (1..self.pieces[e].len()).map(|k| node(e, k)).collect()).collect()
    }

    /// The number of pieces of all records.
    pub fn count(&self) -> usize {
        self.pieces.iter().map(Vec::len).sum()
    }

    /// The samples at which nodes of a record stand.
    pub fn nodes_at(&self, e: usize) -> Vec<usize> {
        self.pieces[e][1..].iter().map(|piece| piece.start).collect()
    }

    /// The unknowns of a point of the fit and of the nodes of each record.
    pub fn point(&self, coordinates: &[f64], nodes: &[Vec<Vec<f64>>]) -> Vec<f64> {
        let shared = self.begins[0];
        let mut x = coordinates[..shared].to_vec();
        for (e, nodes) in nodes.iter().enumerate() {
            x.extend(self.objective.problem.unknowns.columns(e).filter(|i| *i >= shared).map(|i| coordinates[i]));
            x.extend(nodes.iter().flatten());
        }
        x
    }

    /// The point of the fit.
    pub fn coordinates(&self, x: &[f64]) -> Vec<f64> {
        let own = |e: usize| &x[self.begins[e]..self.nodes_from(e)];
        let shared = &x[..self.begins[0]];
        shared.iter().chain((0..self.pieces.len()).flat_map(own)).copied().collect()
    }

    /// The number of the first unknown of a record's nodes.
    fn nodes_from(&self, e: usize) -> usize {
        self.begins[e + 1] - (self.pieces[e].len() - 1) * self.sizes.len()
    }

    /// The numbers of the unknowns of a node: that of piece `k`, from 1 on.
    fn node(&self, e: usize, k: usize) -> Range<usize> {
        let begin = self.nodes_from(e) + (k - 1) * self.sizes.len();
        begin..begin + self.sizes.len()
    }

    /// Adds the gaps to the multipliers, and makes the penalty ten times as large where the gaps have hardly shrunk.
    pub fn tighten(&mut self, gaps: &[f64], shrunk: bool) {
        self.multipliers.iter_mut().zip(gaps).for_each(|(multiplier, gap)| *multiplier += self.penalty * gap);
        if !shrunk {
            self.penalty *= 10.0;
        }
    }

    /// Cost of the measurements and gaps at a point.
    pub fn pass(&self, x: &[f64]) -> Result<Passed, Infeasible> {
        let coordinates = self.coordinates(x);
        let values = self.objective.values(&coordinates);
        let parts = self.parts(x, &self.frames(&coordinates, &values))?;
        let mut passed = Passed { cost: parts.iter().flatten().map(|part| part.cost).sum(), gaps: vec![] };
        for (e, parts) in parts.iter().enumerate() {
            for (k, part) in parts.split_last().map_or(&[][..], |(_, before)| before).iter().enumerate() {
                passed.gaps.extend(self.gaps(part, &x[self.node(e, k + 1)]));
            }
        }
        Ok(passed)
    }

    /// The gaps between the end of a piece and the next node.
    fn gaps(&self, before: &Part, node: &[f64]) -> impl Iterator<Item = f64> {
        let ends = before.reached.carry.iter().zip(node).zip(&self.sizes);
        ends.map(|((end, node), size)| (end - node) / size)
    }
}

impl Shooting<'_> {
    /// What is said of the unknowns of the fit, and of the states of each node.
    fn of_unknowns<T: Clone>(&self, of_fit: Vec<T>, of_state: impl Fn(usize) -> T) -> Vec<T> {
        let states: Vec<T> = (0..self.sizes.len()).map(of_state).collect();
        let (shared, unknowns) = (self.begins[0], &self.objective.problem.unknowns);
        let mut all = of_fit[..shared].to_vec();
        for (e, pieces) in self.pieces.iter().enumerate() {
            all.extend(unknowns.columns(e).filter(|i| *i >= shared).map(|i| of_fit[i].clone()));
            (1..pieces.len()).for_each(|_| all.extend_from_slice(&states));
        }
        all
    }
}

/// Pieces of a record, of about so many samples.
fn cut(samples: usize, length: usize) -> Vec<Range<usize>> {
    let pieces = (samples / length.max(1)).max(1);
    (0..pieces).map(|k| k * samples / pieces..(k + 1) * samples / pieces).collect()
}
