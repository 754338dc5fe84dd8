//! The pieces, run, and the rows that they give the elimination: those of the measurements, and those of the gaps.

use super::Shooting;
use crate::information::{Elimination, Information};
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::problem::Values;
use crate::problem::batches::in_batches;
use crate::problem::job::Job;
use crate::problem::linearize::{Part, parts};
use crate::sweep::{Piece, RunError, Seed};
use std::sync::Arc;

/// What the pieces of a record have in common.
pub(super) struct Frame<'p> {
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

impl Shooting<'_> {
    pub(super) fn frames<'f>(&'f self, coordinates: &[f64], values: &'f [Values]) -> Vec<Frame<'f>> {
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
    pub(super) fn parts(&self, x: &[f64], frames: &[Frame<'_>]) -> Result<Vec<Vec<Part>>, Infeasible> {
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
        let border = self.border(e, k, frame);
        let columns: Vec<usize> = self.node(e, k).chain(border.iter().copied()).collect();
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
        // The columns of the piece before are the border.
        let scales: &[f64] = if k == 1 { &frame.first.scales } else { &frame.scales };
        let (numbers, root, node) = (places(border), self.penalty.sqrt(), &x[self.node(e, k)]);
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

    /// The unknowns that a piece depends on, besides its node: those of the piece before, in the order of its columns.
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
