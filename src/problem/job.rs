//! [`Job`]: a segment of an experiment, ready to run.

use super::segments::Borders;
use super::{Objective, Values};
use crate::sweep::{Piece, Reached, Seed};
use std::sync::Arc;

/// A segment of an experiment, with the objective that standardizes and weighs its windows.
pub(crate) struct Job<'p> {
    pub objective: &'p Objective<'p>,
    pub experiment: usize,
    pub seeds: Arc<[Seed]>,
    /// Derivative of the quantity of each seed with respect to its coordinate; zero where its slopes are left out.
    pub scales: Vec<f64>,
    pub piece: Piece<'p>,
}

impl Objective<'_> {
    /// An experiment as one piece.
    pub(super) fn job<'p>(&'p self, e: usize, values: &'p Values, coordinates: &[f64], slopes: bool) -> Job<'p> {
        let (problem, unknowns) = (self.problem, &self.problem.unknowns);
        let record = &problem.records[e];
        let seeds = if slopes { unknowns.seeds(e).clone() } else { Arc::default() };
        let mut scales = if slopes { unknowns.scales(e, coordinates) } else { vec![] };
        for (scale, i) in scales.iter_mut().zip(unknowns.columns(e)) {
            if self.left_out.get(i) == Some(&true) {
                *scale = 0.0;
            }
        }
        let (states, width) = (values.x.len(), values.x.len() + values.p.len());
        // What has no start cannot be evaluated: its first error is not a number.
        let size = self.sweep.carry();
        let none = |_| Reached { carry: vec![f64::NAN; size], slopes: vec![f64::NAN; size * width] };
        let started = self.sweep.start(record, &values.x, &values.p);
        let Reached { carry, slopes: all } = started.unwrap_or_else(none);
        let column = |seed: &Seed| match *seed {
            Seed::Carry(i) => i,
            Seed::Parameter(j) => states + j,
        };
        let known = seeds.iter().zip(&scales);
        let slopes =
            (0..carry.len()).flat_map(|row| known.clone().map(move |(seed, scale)| (row, column(seed), *scale)));
        let slope =
            |(row, column, scale): (usize, usize, f64)| if scale == 0.0 { 0.0 } else { all[row * width + column] };
        let (carry, slopes) = (carry.into(), slopes.map(slope).collect());
        let (prepared, samples) = (&problem.prepared[e], 0..record.len());
        Job {
            objective: self,
            experiment: e,
            seeds,
            scales,
            piece: Piece { record, prepared, samples, carry, slopes, parameters: &values.p },
        }
    }

    /// The segments of an experiment, from the carries in `borders`.
    pub(super) fn segments<'p>(
        &'p self,
        e: usize,
        values: &'p Values,
        coordinates: &[f64],
        slopes: bool,
        borders: Option<&Borders>,
    ) -> Vec<Job<'p>> {
        let whole = self.job(e, values, coordinates, slopes);
        let segments = self.problem.cuts.segments[e].iter().enumerate();
        let job = |(s, samples): (usize, &std::ops::Range<usize>)| {
            let Piece { carry, slopes: own, .. } = &whole.piece;
            let border = borders.and_then(|borders| borders.at(e, s));
            let there = border.map(|border| &border.slopes[..]).filter(|there| slopes && !there.is_empty());
            let slopes = there.unwrap_or(own).to_vec().into();
            let carry = border.map_or(&carry[..], |border| &border.carry).to_vec().into();
            let (seeds, scales) = (whole.seeds.clone(), whole.scales.clone());
            Job {
                objective: self,
                experiment: e,
                seeds,
                scales,
                piece: Piece { samples: samples.clone(), carry, slopes, ..whole.piece },
            }
        };
        segments.map(job).collect()
    }
}
