//! Cost and triangles of an objective.

use super::absorb::Absorber;
use super::batches::{Broken, in_batches, run};
use super::borders::Guess;
use super::by_output::ByOutput;
use super::job::Job;
use super::segments::Borders;
use super::{Free, Noise, Objective, Role, Values, Weighing, Whitening};
use crate::information::{Chain, Information};
use crate::layout::Kind;
use crate::optimize::{Infeasible, Linearization};
use crate::parameter::Transform;
use crate::sweep::{Piece, Reached, RunError, Seed};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// An initial state is held if a change by its size moves the predictions, as the root of the sum of squares, by less than this part of the root mean square
/// error. It then moves another unknown by less than this part of its standard error, while its own standard error is over a thousand times its size.
const FORGOTTEN: f64 = 1e-3;

/// Cost, triangle and final carry of one segment.
pub(super) struct Part<T = Information> {
    pub cost: f64,
    pub triangle: T,
    pub reached: Reached,
}

/// The part of one output's squared errors that the correction of guessed borders may change, relative to that part of all outputs'. It decides how
/// exact the slopes are, not the errors: a part of 0.4 of one output of a motor, 0.07 of both, cost no step.
const OF_ONE: f64 = 5.0;

/// With a triangle for each output, or one for all of them.
pub(super) type PartByOutput = Part<Vec<Information>>;

impl Objective<'_> {
    /// Cost and triangles of all experiments and the priors.
    pub(crate) fn evaluate(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        self.known_at(coordinates).map_or_else(|| self.evaluate_anew(coordinates), Ok)
    }

    /// [`evaluate`](Self::evaluate) in a pass over the data, whatever is kept of this point: it leaves the borders of segments in the memory.
    pub(super) fn evaluate_anew(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let found = self.evaluate_all(coordinates);
        match (&found, self.inside_bounds(coordinates)) {
            (Err(Infeasible::Failed(_)), Some(inside)) => inside.evaluate_all(coordinates).or(found),
            _ => found,
        }
    }

    fn evaluate_all(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let values = self.values(coordinates);
        let found = match self.forgetting(coordinates, &values)? {
            Some(found) => found,
            None => self.chaining(coordinates, &values)?,
        };
        let Triangulation { cost, blocks, borders, .. } = found;
        if let Some(borders) = borders {
            self.memory.keep(Arc::new(borders));
        }
        Ok(self.joined(coordinates, cost, blocks))
    }

    /// Triangles of segments with slopes with respect to their begins, where these are chained.
    pub(super) fn chaining(&self, coordinates: &[f64], values: &[Values]) -> Result<Triangulation, Infeasible> {
        let cuts = &self.problem.cuts;
        let chained = (0..self.experiments()).any(|e| cuts.is_chained(e));
        let guess = if chained { self.guess(coordinates, values)? } else { Guess::Right(None) };
        Ok(match guess {
            Guess::Right(borders) => self.triangles(coordinates, values, borders.as_ref())?,
            Guess::Affine(borders, most) => {
                let found = self.triangles(coordinates, values, Some(&borders))?;
                match found.is_coarse(most) {
                    true => self.triangles(coordinates, values, found.borders.as_ref())?,
                    false => found,
                }
            }
            Guess::Nonlinear(borders, best) => self.repaired(coordinates, values, borders, best)?,
        })
    }

    /// The linearization of one record that was run uncut.
    pub(super) fn linear_of(&self, coordinates: &[f64], part: PartByOutput) -> Result<Linearization, Infeasible> {
        let Part { cost, triangle: mut triangles, .. } = part;
        let scales = self.problem.unknowns.scales(0, coordinates);
        triangles.iter_mut().for_each(|triangle| triangle.scale_columns(&scales));
        if !cost.is_finite() || !triangles.iter().all(Information::is_finite) {
            return Err(self.infeasible(0, RunError::Failed { sample: 0 }));
        }
        Ok(self.joined(coordinates, cost, vec![triangles]))
    }

    /// The linearization of the triangles of all experiments. Where each output has one, they are kept: with other noise levels each is
    /// multiplied by a number.
    fn joined(&self, coordinates: &[f64], cost: f64, blocks: Vec<Vec<Information>>) -> Linearization {
        if !self.keeps_outputs() {
            let blocks = blocks.into_iter().filter_map(|block| block.into_iter().next()).collect();
            return self.with_priors(coordinates, cost, blocks);
        }
        let kept = Arc::new(ByOutput::new(coordinates, self.whitening.sigma(), blocks));
        if kept.is_resolved() {
            self.memory.keep_by_output(kept.clone());
        }
        self.with_priors(coordinates, kept.cost(&kept.sigma), kept.blocks(&kept.sigma))
    }

    /// The linearization at a point that was evaluated with other noise levels.
    pub(super) fn known_at(&self, coordinates: &[f64]) -> Option<Linearization> {
        let known = self.memory.by_output_at(coordinates).filter(|_| self.keeps_outputs())?;
        let sigma = self.whitening.sigma();
        let (cost, blocks) = (known.cost(&sigma), known.blocks(&sigma));
        let finite = cost.is_finite() && blocks.iter().all(Information::is_finite);
        finite.then(|| {
            self.memory.revalue(coordinates, cost);
            self.with_priors(coordinates, cost, blocks)
        })
    }

    /// Whether the triangles of each output are kept, so that other noise levels need no pass.
    pub(crate) fn keeps_outputs(&self) -> bool {
        self.sets() > 1
    }

    /// How many triangles the rows are absorbed into: one for each output where the levels of independent noise are estimated, so that other levels need
    /// no other pass; else one.
    pub(super) fn sets(&self) -> usize {
        let settings = &self.problem.settings;
        let estimated = matches!(settings.noise, Noise::PerOutput | Noise::SomeGiven(_));
        let plain = settings.loss.is_none() && settings.weights.is_none() && !self.sweep.predicts_variance();
        let whole = self.left_out.is_empty();
        match estimated && plain && whole && matches!(self.whitening, Whitening::Diagonal(_)) {
            true => self.outputs(),
            false => 1,
        }
    }

    /// Leaves out the slopes of initial states that have decayed before the first measurement ([`FORGOTTEN`]), and returns these unknowns: the data do not determine
    /// them, and a search would have no end.
    fn without_forgotten(&self, coordinates: &[f64], blocks: &mut [Information]) -> Vec<usize> {
        let mut forgotten = vec![];
        let begins_late = |e: &usize| self.problem.records[*e].outputs().iter().all(|output| output.values[0].is_nan());
        let late: Vec<usize> = (0..blocks.len()).filter(begins_late).collect();
        if late.is_empty() {
            return forgotten;
        }
        let squares: f64 = blocks.iter().map(Information::residual_at_zero).sum();
        let error = (squares / blocks.iter().map(Information::rows).sum::<u64>() as f64).sqrt();
        for e in late {
            let columns: Vec<usize> = self.problem.unknowns.columns(e).collect();
            let norms = blocks[e].column_norms();
            let reach = self.reach(e);
            let decayed = |(norm, i): (&f64, &usize)| {
                let Free { role, parameter, .. } = &self.problem.unknowns.row[*i];
                let plain = parameter.prior.is_none() && parameter.transform == Transform::Identity;
                let size = coordinates[*i].abs().max(parameter.start.abs()).max(reach);
                plain && matches!(role, Role::InitialState(_)) && *norm > 0.0 && norm * size < FORGOTTEN * error
            };
            let left_out: Vec<bool> = norms.iter().zip(&columns).map(decayed).collect();
            if left_out.contains(&true) {
                let scales: Vec<f64> = left_out.iter().map(|out| if *out { 0.0 } else { 1.0 }).collect();
                let mut left = std::mem::replace(&mut blocks[e], Information::new(scales.len()));
                left.scale_columns(&scales);
                blocks[e].merge(&left);
                forgotten.extend(columns.iter().zip(left_out).filter_map(|(i, out)| out.then_some(*i)));
            }
        }
        forgotten
    }

    /// The largest magnitude that an output of a record has: what its states may be expected to reach.
    fn reach(&self, e: usize) -> f64 {
        let found = self.problem.records[e].inspect_some();
        found.outputs.iter().filter_map(|output| output.range).fold(0.0, |most, (low, high)| most.max(-low).max(high))
    }

    fn with_priors(&self, coordinates: &[f64], mut cost: f64, mut blocks: Vec<Information>) -> Linearization {
        let forgotten = self.without_forgotten(coordinates, &mut blocks);
        let unknowns = &self.problem.unknowns;
        unknowns.add_priors(coordinates, 1.0, &mut blocks);
        unknowns.priors(coordinates).for_each(|(_, _, error)| cost += 0.5 * error * error);
        let linear = Linearization::new(cost, unknowns.shared(), blocks).with_forgotten(forgotten);
        match self.data_norm() {
            Some(norm) => linear.with_data_norm(norm),
            None => linear,
        }
    }

    /// The triangles of all experiments, priors left out.
    pub(super) fn triangles(
        &self,
        coordinates: &[f64],
        values: &[Values],
        guess: Option<&Borders>,
    ) -> Result<Triangulation, Infeasible> {
        let cuts = &self.problem.cuts;
        let chained = |e: usize| {
            cuts.is_chained(e)
                .then(|| Chained::new(self.job(e, &values[e], coordinates, true), &cuts.segments[e], guess))
        };
        let chained: Vec<Option<Chained<'_>>> = (0..self.experiments()).map(chained).collect();
        let mut jobs: Vec<Job<'_>> = Vec::with_capacity(cuts.segments.iter().map(Vec::len).sum());
        for (e, chained) in chained.iter().enumerate() {
            match chained {
                Some(chained) => jobs.extend(chained.jobs(&cuts.segments[e], guess)),
                None => jobs.extend(self.independent_jobs(e, &values[e], coordinates, guess)),
            }
        }
        let sets = self.sets();
        // The correction changes the sum of the squares; that of other losses cannot be corrected from triangles.
        let corrects = cuts.affine && self.is_sum_of_squares();
        let parts = in_batches(&jobs, |_, jobs| parts_by_output(jobs, sets))
            .map_err(|(job, error)| self.infeasible(jobs[job].experiment, error))?;
        drop(jobs);
        let mut parts = parts.into_iter();
        let by_output = vec![[0.0; 2]; if sets > 1 { sets } else { 0 }];
        let mut found = Triangulation { cost: 0.0, moved: 0.0, by_output, blocks: vec![], borders: None };
        let mut of = Vec::with_capacity(chained.len());
        let is_static = self.problem.layout().kind == Kind::Static;
        for (e, (chained, segments)) in chained.into_iter().zip(&cuts.segments).enumerate() {
            let mut parts = parts.by_ref().take(segments.len());
            if let Some(chained) = chained {
                of.push(found.chain(chained, (segments.len(), sets), parts, guess, corrects));
                continue;
            }
            let Some(Part { mut cost, triangle: mut whole, .. }) = parts.next() else { continue };
            for part in parts {
                cost += part.cost;
                whole.iter_mut().zip(&part.triangle).for_each(|(whole, part)| whole.merge(part));
            }
            // Segments are short: where squares over- or underflow in their triangles, the whole record may still have one.
            if segments.len() > 1 && is_static && is_out_of_range(cost, &whole) {
                (cost, whole) = self.in_one_piece(e, &values[e], coordinates, sets)?;
            }
            found.cost += cost;
            let scales = self.problem.unknowns.scales(e, coordinates);
            whole.iter_mut().for_each(|triangle| triangle.scale_columns(&scales));
            for ([_, squares], triangle) in found.by_output.iter_mut().zip(&whole) {
                *squares += triangle.residual_at_zero();
            }
            found.blocks.push(whole);
            of.push(vec![]);
        }
        if !found.cost.is_finite() || found.blocks.iter().flatten().any(|block| !block.is_finite()) {
            return Err(self.infeasible(0, RunError::Failed { sample: 0 }));
        }
        if guess.is_some() {
            let (point, cost, values) = (coordinates.to_vec(), found.cost, values.to_vec());
            found.borders = Some(Borders { point, cost, values, of, right: false, run_ins: None });
        }
        Ok(found)
    }

    /// Cost and triangles of an experiment that is not cut, with slopes in the quantities themselves.
    fn in_one_piece(
        &self,
        e: usize,
        values: &Values,
        coordinates: &[f64],
        sets: usize,
    ) -> Result<(f64, Vec<Information>), Infeasible> {
        let job = in_quantities(self.job(e, values, coordinates, true));
        let parts = parts_by_output(&[&job], sets).map_err(|Broken { error, .. }| self.infeasible(e, error))?;
        let part = parts.into_iter().next().map(|part| (part.cost, part.triangle));
        part.ok_or_else(|| self.infeasible(e, RunError::Failed { sample: 0 }))
    }

    /// The segments of an experiment between which nothing is carried, with slopes in the quantities themselves.
    fn independent_jobs<'p>(
        &'p self,
        e: usize,
        values: &'p Values,
        coordinates: &[f64],
        guess: Option<&'p Borders>,
    ) -> Vec<Job<'p>> {
        self.segments(e, values, coordinates, true, guess).into_iter().map(in_quantities).collect()
    }

    /// The cost of one experiment alone, priors left out.
    pub(crate) fn cost_of(&self, e: usize, coordinates: &[f64]) -> Result<f64, Infeasible> {
        self.gather_one(coordinates, e, true, || Weighing::new(self, e)).map(|weighing| weighing.cost)
    }

    /// The cost alone.
    pub(crate) fn cost_at(&self, coordinates: &[f64]) -> Result<f64, Infeasible> {
        let found = self.gather(coordinates, false, |experiment| Weighing::new(self, experiment))?;
        let priors = self.problem.unknowns.priors(coordinates).map(|(_, _, error)| 0.5 * error * error);
        Ok(found.iter().map(|weighing| weighing.cost).sum::<f64>() + priors.sum::<f64>())
    }
}

/// Costs and triangles of jobs that run in parallel lanes.
pub(super) fn parts(jobs: &[&Job<'_>]) -> Result<Vec<Part>, Broken> {
    let first = |part: PartByOutput| {
        let PartByOutput { cost, triangle, reached } = part;
        triangle.into_iter().next().map(|triangle| Part { cost, triangle, reached })
    };
    Ok(parts_by_output(jobs, 1)?.into_iter().filter_map(first).collect())
}

/// Costs and triangles of jobs that run in parallel lanes, one triangle for each of `sets` outputs or one for all.
pub(super) fn parts_by_output(jobs: &[&Job<'_>], sets: usize) -> Result<Vec<PartByOutput>, Broken> {
    let mut absorbers: Absorber<'_> = Absorber::new(jobs, sets);
    let reached = run(jobs, &mut |window| absorbers.absorb(window))?;
    let part = |(lane, reached): (usize, Reached)| {
        let (cost, triangle) = absorbers.part(lane);
        Part { cost, triangle, reached }
    };
    Ok(reached.into_iter().enumerate().map(part).collect())
}

/// The job with slopes with respect to quantities instead of coordinates. A scale of zero marks a column that is left out; it stays zero.
fn in_quantities(mut job: Job<'_>) -> Job<'_> {
    job.scales.iter_mut().filter(|scale| **scale != 0.0).for_each(|scale| *scale = 1.0);
    job
}

/// Whether the cost or a triangle is not finite, or a column is zero in the triangles of all outputs: its squares may have underflown.
fn is_out_of_range(cost: f64, triangles: &[Information]) -> bool {
    let columns = triangles.first().map_or(0, Information::columns);
    let is_zero = |i: usize| triangles.iter().all(|triangle| triangle.at(i, i) == 0.0);
    !cost.is_finite() || !triangles.iter().all(Information::is_finite) || (0..columns).any(is_zero)
}

impl Job<'_> {
    /// The slopes of the covariance of a filter that has settled at all begins of segments but the first one.
    fn settled(&self, segments: &[Range<usize>], borders: Option<&Borders>, seeds: &[Seed]) -> Option<Vec<f64>> {
        let at = |s: usize| {
            let carry = &borders?.at(self.experiment, s)?.carry;
            self.objective.sweep.settled(&self.piece, seeds, segments[s].start, carry, 0.0)
        };
        let first = at(1)?;
        (2..segments.len()).all(|s| at(s).as_ref() == Some(&first)).then_some(first.slopes)
    }
}

/// A record cut into segments, each of which is run with slopes with respect to its initial carry and the parameters.
struct Chained<'p> {
    whole: Job<'p>,
    seeds: Arc<[Seed]>,
    /// The unknown behind each parameter.
    parameters: Vec<usize>,
    /// Slopes of the initial carry with respect to `seeds`: ones for each entry with respect to itself, else zeros.
    slopes: Vec<f64>,
    /// How many entries of the carry are seeds: all, but for the covariance of a filter that has settled at all borders.
    carried: usize,
}

impl<'p> Chained<'p> {
    fn new(whole: Job<'p>, segments: &[Range<usize>], guess: Option<&Borders>) -> Self {
        let is_parameter = |i: &usize| matches!(whole.seeds[*i], Seed::Parameter(_));
        let parameters: Vec<usize> = (0..whole.seeds.len()).filter(is_parameter).collect();
        let seeds = |carried: usize| -> Vec<Seed> {
            (0..carried).map(Seed::Carry).chain(parameters.iter().map(|&i| whole.seeds[i])).collect()
        };
        let ones = |carried: usize, columns: usize| {
            let mut slopes = vec![0.0; carried * columns];
            slopes.iter_mut().step_by(columns + 1).for_each(|slope| *slope = 1.0);
            slopes
        };
        let (all, states) = (whole.piece.carry.len(), whole.objective.sweep.layout().states.len());
        let of_states = seeds(states);
        if let Some(covariance) = whole.settled(segments, guess.filter(|guess| guess.right), &of_states) {
            let slopes = [ones(states, of_states.len()), covariance].concat();
            return Chained { whole, seeds: of_states.into(), parameters, slopes, carried: states };
        }
        let seeds = seeds(all);
        let slopes = ones(all, seeds.len());
        Chained { whole, seeds: seeds.into(), parameters, slopes, carried: all }
    }

    fn jobs<'s>(&'s self, segments: &'s [Range<usize>], guess: Option<&'s Borders>) -> impl Iterator<Item = Job<'s>> {
        let Job { objective, experiment, piece: whole, seeds: unknowns, .. } = &self.whole;
        let job = move |(s, samples): (usize, &Range<usize>)| {
            let border = guess.and_then(|guess| guess.at(*experiment, s)).map(|border| &border.carry[..]);
            let mut slopes = Cow::Borrowed(&self.slopes[..]);
            if s == 0 {
                // A given initial state is constant: slopes with respect to it are not needed, and may be infinite.
                let rows = slopes.to_mut().chunks_exact_mut(self.seeds.len());
                let given = |of: &[f64]| of.iter().all(|slope| *slope == 0.0);
                for (i, row) in rows.enumerate() {
                    let own = &whole.slopes[i * unknowns.len()..][..unknowns.len()];
                    if i >= self.carried {
                        // An entry that is no seed has the slopes of the begin of the record.
                        let of_parameters = row[self.carried..].iter_mut().zip(&self.parameters);
                        of_parameters.for_each(|(slope, unknown)| *slope = own[*unknown]);
                    } else if given(own) {
                        row.fill(0.0);
                    }
                }
            }
            let piece =
                Piece { samples: samples.clone(), carry: border.unwrap_or(&whole.carry).into(), slopes, ..*whole };
            Job { objective, experiment: *experiment, seeds: self.seeds.clone(), scales: vec![], piece }
        };
        segments.iter().enumerate().map(job)
    }
}

/// Costs and triangles of all experiments at a point.
pub(super) struct Triangulation {
    pub cost: f64,
    /// Sum of squares of what the correction of guessed borders changed.
    pub moved: f64,
    /// That sum, and the sum of squares, of each output where these have triangles of their own.
    pub by_output: Vec<[f64; 2]>,
    /// The triangles of each experiment: one for each output, or one for all of them.
    pub blocks: Vec<Vec<Information>>,
    pub borders: Option<Borders>,
}

impl Triangulation {
    /// Whether the correction changed more than this part of the squared errors of all outputs, or, where each has a triangle of its own, more than
    /// [`OF_ONE`] times this part of those of one.
    fn is_coarse(&self, most: f64) -> bool {
        let of_one = |[moved, squares]: &[f64; 2]| *moved > OF_ONE * most * squares;
        self.moved > most * 2.0 * self.cost || self.by_output.iter().any(of_one)
    }

    /// Joins the triangles of an experiment's segments, and returns the corrected borders. Borders that are right differ from the ends of the segments
    /// before them by rounding, which is corrected only where the correction is exact (`corrects`).
    fn chain(
        &mut self,
        of: Chained<'_>,
        (segments, sets): (usize, usize),
        parts: impl Iterator<Item = PartByOutput>,
        guess: Option<&Borders>,
        corrects: bool,
    ) -> Vec<Reached> {
        let Job { experiment, scales, piece: Piece { slopes, .. }, .. } = of.whole;
        let (carried, seeds) = (of.carried, of.seeds.len());
        let begin = || slopes[..carried * scales.len()].to_vec();
        let chain = || Chain::new(carried, segments, begin(), &of.parameters, &scales);
        let mut chains: Vec<Chain<'_>> = (0..sets).map(|_| chain()).collect();
        let right = guess.is_some_and(|guess| guess.right && !corrects);
        let mut corrected = vec![];
        let mut simulated = 0.0;
        for (s, part) in parts.enumerate() {
            simulated += part.cost;
            chains.iter_mut().zip(&part.triangle).for_each(|(chain, triangle)| chain.add(triangle));
            if let Some(Reached { carry, .. }) = guess.and_then(|guess| guess.at(experiment, s + 1)) {
                let Reached { carry: end, slopes: of_end } = &part.reached;
                for chain in &mut chains {
                    chain.go_on(&end[..carried], &of_end[..carried * seeds], &carry[..carried]);
                    if right {
                        chain.without_defect();
                    }
                }
                let Some((defect, slopes)) = chains.first().map(Chain::begin) else { continue };
                let (mut carry, mut slopes) = (carry.clone(), slopes.to_vec());
                carry.iter_mut().zip(defect).for_each(|(carry, defect)| *carry += defect);
                // Entries that are no seeds depend on parameters alone.
                slopes.resize(carry.len() * scales.len(), 0.0);
                for i in carried..carry.len() {
                    for (m, unknown) in of.parameters.iter().enumerate() {
                        slopes[i * scales.len() + unknown] = of.slopes[i * seeds + carried + m];
                    }
                }
                corrected.push(Reached { carry, slopes });
            }
        }
        for ([moved, squares], chain) in self.by_output.iter_mut().zip(&chains) {
            *moved += chain.moved;
            *squares += chain.squares;
        }
        let moved: f64 = chains.iter().map(|chain| chain.moved).sum();
        self.moved += moved;
        self.cost += match moved > 0.0 {
            true => 0.5 * chains.iter().map(|chain| chain.squares).sum::<f64>(),
            false => simulated,
        };
        self.blocks.push(chains.into_iter().map(Chain::triangle).collect());
        corrected
    }
}
