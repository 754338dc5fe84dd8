//! [`Shooting`]: records in pieces with initial states of their own, whose continuity an augmented Lagrangian asks for.

use super::batches::in_batches;
use super::job::Job;
use super::linearize::{Part, parts};
use super::{Objective, Values};
use crate::information::{Elimination, Information};
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::sweep::{Piece, RunError, Seed};
use std::ops::Range;
use std::sync::Arc;

/// The longest way of a logarithm in one search.
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

/// What the pieces of a record have in common.
struct Frame<'p> {
    /// The first piece: its columns are the record's own unknowns, then the shared ones.
    first: Job<'p>,
    /// The number of the unknown behind each of these columns.
    numbers: Vec<usize>,
    /// Of the other pieces: the quantity behind each column, its derivative with respect to the coordinate, and the slopes of the initial state.
    seeds: Arc<[Seed]>,
    scales: Vec<f64>,
    slopes: Vec<f64>,
    /// The numbers of the parameters' unknowns.
    parameters: Vec<usize>,
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

    /// Begins a search at a point: logarithms move by no more than a part of it.
    pub fn begin_at(&mut self, x: &[f64]) {
        let (bounds, logarithms) = (self.objective.bounds(), self.objective.logarithms());
        let around = self.coordinates(x).into_iter().zip(logarithms);
        let cut = |((low, high), (x, is_logarithm)): ((f64, f64), (f64, bool))| match is_logarithm {
            true => (low.max(x - LONGEST), high.min(x + LONGEST)),
            false => (low, high),
        };
        self.bounds = bounds.into_iter().zip(around).map(cut).collect();
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

    fn frames<'f>(&'f self, coordinates: &[f64], values: &'f [Values]) -> Vec<Frame<'f>> {
        let frame = |e: usize| {
            let first = self.objective.job(e, &values[e], coordinates, true);
            let (shared, states) = (self.begins[0], self.sizes.len());
            let own = self.begins[e]..self.nodes_from(e);
            let numbers: Vec<usize> = own.chain(0..shared).collect();
            let is_parameter = |i: &usize| matches!(first.seeds[*i], Seed::Parameter(_));
            let parameters: Vec<usize> = (0..numbers.len()).filter(is_parameter).collect();
            let seeds: Arc<[Seed]> =
                (0..states).map(Seed::Carry).chain(parameters.iter().map(|&i| first.seeds[i])).collect();
            let ones = std::iter::repeat_n(1.0, states);
            let scales = ones.chain(parameters.iter().map(|&i| first.scales[i])).collect();
            let mut slopes = vec![0.0; states * seeds.len()];
            slopes.iter_mut().step_by(seeds.len() + 1).for_each(|slope| *slope = 1.0);
            let parameters = parameters.into_iter().map(|i| numbers[i]).collect();
            Frame { first, numbers, seeds, scales, slopes, parameters }
        };
        (0..self.pieces.len()).map(frame).collect()
    }

    /// All pieces, run.
    fn parts(&self, x: &[f64], frames: &[Frame<'_>]) -> Result<Vec<Vec<Part>>, Infeasible> {
        let mut jobs: Vec<Job<'_>> = Vec::with_capacity(self.count());
        for (e, Frame { first, seeds, scales, slopes, .. }) in frames.iter().enumerate() {
            let Job { objective, experiment, piece: whole, .. } = first;
            for (k, samples) in self.pieces[e].iter().cloned().enumerate() {
                jobs.push(match k {
                    0 => Job {
                        objective,
                        experiment: *experiment,
                        seeds: first.seeds.clone(),
                        scales: first.scales.clone(),
                        piece: Piece { samples, ..whole.lent() },
                    },
                    _ => {
                        let (carry, slopes) = (x[self.node(e, k)].into(), slopes.as_slice().into());
                        let piece = Piece { samples, carry, slopes, ..*whole };
                        Job { objective, experiment: *experiment, seeds: seeds.clone(), scales: scales.clone(), piece }
                    }
                });
            }
        }
        let found = in_batches(&jobs, |_, jobs| parts(jobs))
            .map_err(|(job, error)| self.objective.infeasible(jobs[job].experiment, error))?;
        let finite = |part: &Part| {
            let reached = part.reached.carry.iter().chain(&part.reached.slopes).all(|entry| entry.is_finite());
            part.cost.is_finite() && part.triangle.is_finite() && reached
        };
        if !found.iter().all(finite) {
            return Err(self.objective.infeasible(0, RunError::Failed { sample: 0 }));
        }
        let mut found = found.into_iter();
        Ok(self.pieces.iter().map(|pieces| found.by_ref().take(pieces.len()).collect()).collect())
    }

    /// The triangle of a piece after the first: its columns are those of its node, then of its border; and the cost of the gaps before it.
    fn triangle(&self, x: &[f64], (e, k): (usize, usize), frame: &Frame<'_>, of: (&Part, &Part)) -> (f64, Information) {
        let (before, part) = of;
        let columns: Vec<usize> = self.node(e, k).chain(self.border(e, k, frame)).collect();
        let place = |number: usize| columns.iter().position(|column| *column == number).unwrap_or_default();
        let places = |of: Vec<usize>| of.into_iter().map(place).collect::<Vec<usize>>();
        let seeds = places(self.node(e, k).chain(frame.parameters.iter().copied()).collect());
        let mut triangle = Information::new(columns.len());
        let mut row = vec![0.0; columns.len()];
        for i in 0..=seeds.len() {
            row.fill(0.0);
            seeds.iter().enumerate().for_each(|(j, at)| row[*at] = part.triangle.at(i, j));
            triangle.absorb_row(&row, part.triangle.at(i, seeds.len()));
        }
        // The columns of the piece before.
        let (numbers, scales): (Vec<usize>, &[f64]) = match k {
            1 => (frame.numbers.clone(), &frame.first.scales),
            _ => (self.node(e, k - 1).chain(frame.parameters.iter().copied()).collect(), &frame.scales),
        };
        let (numbers, root, node) = (places(numbers), self.penalty.sqrt(), &x[self.node(e, k)]);
        let multipliers = &self.multipliers[self.first_gap(e, k)..];
        let mut cost = 0.0;
        for (i, (gap, multiplier)) in self.gaps(before, node).zip(multipliers).enumerate() {
            let unit = root / self.sizes[i];
            let slopes = before.reached.slopes[i * numbers.len()..].iter().zip(scales);
            row.fill(0.0);
            numbers.iter().zip(slopes).for_each(|(at, (slope, scale))| row[*at] = unit * slope * scale);
            row[i] -= unit;
            let error = root * gap + multiplier / root;
            triangle.absorb_row(&row, -error);
            cost += 0.5 * error * error;
        }
        (cost, triangle.of_rows(part.triangle.rows()))
    }

    /// The number of the first gap before a piece.
    fn first_gap(&self, e: usize, k: usize) -> usize {
        let before: usize = self.pieces[..e].iter().map(|pieces| pieces.len() - 1).sum();
        (before + k - 1) * self.sizes.len()
    }

    /// The unknowns that a piece depends on, besides its node.
    fn border(&self, e: usize, k: usize, frame: &Frame<'_>) -> Vec<usize> {
        match k {
            1 => frame.numbers.clone(),
            _ => self.node(e, k - 1).chain(frame.parameters.iter().copied()).collect(),
        }
    }
}

impl LeastSquares for Shooting<'_> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        let coordinates = self.coordinates(x);
        let (values, unknowns) = (self.objective.values(&coordinates), &self.objective.problem.unknowns);
        let frames = self.frames(&coordinates, &values);
        let parts = self.parts(x, &frames)?;
        let mut cost: f64 = unknowns.priors(&coordinates).map(|(_, _, error)| 0.5 * error * error).sum();
        let mut firsts: Vec<Information> = parts.iter().map(|parts| parts[0].triangle.clone()).collect();
        unknowns.add_priors(&coordinates, 1.0, &mut firsts);
        let mut all = Elimination::new(self.begins[0]);
        for (e, ((parts, frame), first)) in parts.iter().zip(&frames).zip(firsts).enumerate() {
            let wrong = |_| Infeasible::Failed("pieces in a wrong order".to_owned());
            let mut above = all.add(None, (0..self.begins[0]).collect(), first).map_err(wrong)?;
            cost += parts[0].cost;
            for (k, pair) in parts.windows(2).enumerate() {
                let (of_gaps, triangle) = self.triangle(x, (e, k + 1), frame, (&pair[0], &pair[1]));
                above = all.add(Some(above), self.border(e, k + 1, frame), triangle).map_err(wrong)?;
                cost += pair[1].cost + of_gaps;
            }
        }
        Ok(Linearization::of(cost, all))
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.of_unknowns(self.bounds.clone(), |_| (f64::NEG_INFINITY, f64::INFINITY))
    }

    fn sizes(&self) -> Vec<Option<f64>> {
        self.of_unknowns(self.objective.sizes(), |i| Some(self.sizes[i]))
    }

    fn logarithms(&self) -> Vec<bool> {
        self.of_unknowns(self.objective.logarithms(), |_| false)
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
