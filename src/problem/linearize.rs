//! Cost and triangles of an objective.

use super::absorb::Absorber;
use super::batches::{Broken, in_batches, run};
use super::borders::Guess;
use super::pass::Job;
use super::segments::{Border, Borders};
use super::{Objective, Values, Weighing};
use crate::information::{Chain, Information};
use crate::optimize::{Infeasible, Linearization};
use crate::sweep::{Piece, Reached, RunError, Seed};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Cost, triangle and final carry of one segment.
pub(super) struct Part {
    cost: f64,
    triangle: Information,
    reached: Reached,
}

impl Objective<'_> {
    /// Cost and triangles of all experiments and the priors.
    pub(crate) fn evaluate(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let found = self.evaluate_all(coordinates);
        match (&found, self.inside_bounds(coordinates)) {
            (Err(Infeasible::Failed(_)), Some(inside)) => inside.evaluate_all(coordinates).or(found),
            _ => found,
        }
    }

    fn evaluate_all(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let values = self.values(coordinates);
        let cuts = &self.problem.cuts;
        let chained = (0..self.experiments()).any(|e| cuts.is_chained(e));
        let guess = if chained { self.guess(coordinates, &values)? } else { Guess::Right(None) };
        let found = match guess {
            Guess::Right(borders) => self.triangles(coordinates, &values, borders.as_ref())?,
            Guess::Affine(borders, most) => {
                let found = self.triangles(coordinates, &values, Some(&borders))?;
                match found.moved > most * 2.0 * found.cost {
                    true => self.triangles(coordinates, &values, found.borders.as_ref())?,
                    false => found,
                }
            }
            Guess::Nonlinear(borders, best) => self.repaired(coordinates, &values, borders, best)?,
        };
        let Triangulation { cost, blocks, borders, .. } = found;
        if let Some(borders) = borders {
            self.memory.keep(Arc::new(borders));
        }
        Ok(self.with_priors(coordinates, cost, blocks))
    }

    /// The linearization of one record that was run uncut.
    pub(super) fn linear_of(&self, coordinates: &[f64], part: Part) -> Result<Linearization, Infeasible> {
        let Part { cost, mut triangle, .. } = part;
        triangle.scale_columns(&self.problem.unknowns.scales(0, coordinates));
        if !cost.is_finite() || !triangle.is_finite() {
            return Err(self.infeasible(0, RunError::Failed { sample: 0 }));
        }
        Ok(self.with_priors(coordinates, cost, vec![triangle]))
    }

    fn with_priors(&self, coordinates: &[f64], mut cost: f64, mut blocks: Vec<Information>) -> Linearization {
        for (i, slope, error) in self.problem.unknowns.priors(coordinates) {
            let e = self.problem.unknowns.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = self.problem.unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect();
            blocks[e].absorb_row(&row, error);
            cost += 0.5 * error * error;
        }
        let linear = Linearization::new(cost, self.problem.unknowns.shared(), blocks);
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
        let mut jobs: Vec<Job<'_>> = Vec::with_capacity(self.problem.cuts.segments.iter().map(Vec::len).sum());
        (0..self.experiments()).for_each(|e| jobs.extend(self.linear_jobs(e, &values[e], coordinates, guess)));
        let parts = in_batches(&jobs, |_, jobs| parts(jobs))
            .map_err(|(job, error)| self.infeasible(jobs[job].experiment, error))?;
        let mut parts = parts.into_iter();
        let mut found = Triangulation { cost: 0.0, moved: 0.0, blocks: vec![], borders: None };
        let mut of = vec![];
        for (e, segments) in self.problem.cuts.segments.iter().enumerate() {
            let parts: Vec<Part> = parts.by_ref().take(segments.len()).collect();
            if self.problem.cuts.is_chained(e) {
                of.push(self.chain(e, &values[e], coordinates, parts, guess, &mut found));
            } else {
                let mut parts = parts.into_iter();
                let Some(Part { cost, triangle: mut whole, .. }) = parts.next() else { continue };
                found.cost += cost;
                for part in parts {
                    found.cost += part.cost;
                    whole.merge(&part.triangle);
                }
                whole.scale_columns(&self.problem.unknowns.scales(e, coordinates));
                found.blocks.push(whole);
                of.push(vec![]);
            }
        }
        if !found.cost.is_finite() || found.blocks.iter().any(|block| !block.is_finite()) {
            return Err(self.infeasible(0, RunError::Failed { sample: 0 }));
        }
        if guess.is_some() {
            let (point, cost, values) = (coordinates.to_vec(), found.cost, values.to_vec());
            found.borders = Some(Borders { point, cost, values, of, right: false });
        }
        Ok(found)
    }

    /// Joins the triangles of an experiment's segments into `found`, and returns the corrected borders.
    fn chain(
        &self,
        e: usize,
        values: &Values,
        coordinates: &[f64],
        parts: Vec<Part>,
        guess: Option<&Borders>,
        found: &mut Triangulation,
    ) -> Vec<Border> {
        let whole = self.job(e, values, coordinates, true);
        let is_parameter = |i: &usize| matches!(whole.seeds[*i], Seed::Parameter(_));
        let parameters: Vec<usize> = (0..whole.seeds.len()).filter(is_parameter).collect();
        let Piece { carry, slopes, .. } = whole.piece;
        let mut chain = Chain::new(carry.len(), slopes.into_owned(), &parameters, &whole.scales);
        let simulated_from = guess.map_or(&[][..], |guess| &guess.of[e]);
        let mut borders = Vec::with_capacity(simulated_from.len());
        let simulated = parts.iter().map(|part| part.cost).sum::<f64>();
        for (s, part) in parts.iter().enumerate() {
            chain.add(&part.triangle);
            if let Some(Border { carry, .. }) = simulated_from.get(s) {
                chain.go_on(&part.reached.carry, &part.reached.slopes, carry);
                if guess.is_some_and(|guess| guess.right) && !self.problem.cuts.affine {
                    chain.without_defect();
                }
                let (defect, slopes) = chain.begin();
                let carry = carry.iter().zip(defect).map(|(carry, defect)| carry + defect).collect();
                borders.push(Border { carry, slopes: slopes.to_vec() });
            }
        }
        found.moved += chain.moved;
        found.cost += if chain.moved > 0.0 { 0.5 * chain.squares } else { simulated };
        found.blocks.push(chain.triangle());
        borders
    }

    /// The segments of an experiment with slopes in the quantities themselves; chained ones with respect to all that
    /// they begin with.
    fn linear_jobs<'p>(
        &'p self,
        e: usize,
        values: &'p Values,
        coordinates: &[f64],
        guess: Option<&'p Borders>,
    ) -> Vec<Job<'p>> {
        if self.problem.cuts.is_chained(e) {
            return self.chained_jobs(e, values, coordinates, guess);
        }
        let mut jobs = self.segments(e, values, coordinates, true, guess);
        for job in &mut jobs {
            // A scale of zero marks a column that is left out; it stays zero.
            job.scales.iter_mut().filter(|scale| **scale != 0.0).for_each(|scale| *scale = 1.0);
        }
        jobs
    }

    /// The chained segments of an experiment, with slopes with respect to all that each begins with and the parameters.
    fn chained_jobs<'p>(
        &'p self,
        e: usize,
        values: &'p Values,
        coordinates: &[f64],
        guess: Option<&'p Borders>,
    ) -> Vec<Job<'p>> {
        let Job { seeds: unknowns, piece: whole, .. } = self.job(e, values, coordinates, true);
        let carried = whole.carry.len();
        let is_parameter = |seed: &&Seed| matches!(seed, Seed::Parameter(_));
        let seeds: Vec<Seed> =
            (0..carried).map(Seed::Carry).chain(unknowns.iter().filter(is_parameter).copied()).collect();
        // What a record begins with does not move where it is given, and slopes with respect to it may be infinite.
        let row = |i: usize| &whole.slopes[i * unknowns.len()..][..unknowns.len()];
        let moves = |s: usize, i: usize| s > 0 || row(i).iter().any(|slope| *slope != 0.0);
        let job = |(s, samples): (usize, &Range<usize>)| {
            let border = guess.filter(|_| s > 0).and_then(|guess| guess.of[e].get(s - 1));
            let mut slopes = vec![0.0; carried * seeds.len()];
            for i in (0..carried).filter(|&i| moves(s, i)) {
                slopes[i * seeds.len() + i] = 1.0;
            }
            let carry = border.map_or_else(|| whole.carry.clone(), |border| Cow::Borrowed(&*border.carry));
            let piece = Piece { samples: samples.clone(), carry, slopes: slopes.into(), ..whole };
            Job { objective: self, experiment: e, seeds: seeds.clone(), scales: vec![], piece }
        };
        self.problem.cuts.segments[e].iter().enumerate().map(job).collect()
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
    let mut absorbers: Absorber<'_> = Absorber::new(jobs);
    let reached = run(jobs, &mut |window| absorbers.absorb(window))?;
    let parts = reached.into_iter().enumerate();
    parts
        .map(|(lane, reached)| {
            let (cost, triangle) = absorbers.part(lane);
            Ok(Part { cost, triangle, reached })
        })
        .collect()
}

/// Costs and triangles of all experiments at a point.
pub(super) struct Triangulation {
    pub cost: f64,
    /// Sum of squares of what the correction of guessed borders changed.
    pub moved: f64,
    blocks: Vec<Information>,
    pub borders: Option<Borders>,
}
