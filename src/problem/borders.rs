//! Where the segments of a record begin at a point that is to be evaluated: guessed, corrected, or simulated.

use super::batches::{each, ends, in_batches};
use super::job::Job;
use super::linearize::Triangulation;
use super::segments::Borders;
use super::{Objective, Values};
use crate::optimize::Infeasible;
use crate::sweep::{Piece, Reached, RunError, Seed};
use std::sync::Arc;

/// Part of the squared errors that the correction of guessed borders may change without the slopes being computed again.
/// The corrected errors are exact; slopes with respect to parameters are off by as much, relatively, as the guesses
/// are.
const MOVED: f64 = 0.1;
/// That part at the first point, where no slopes exist to extrapolate borders from: slopes are then right to the root of it,
/// 1e-3 (2e-3 for one output of several), which leaves the first step of a search as it is.
const MOVED_FIRST: f64 = 1e-6;
/// The correction for a nonlinear model is exact to the first order only. No further pass is made where it changes the squared
/// errors by no more than this part of the difference from the best cost, which is what the search compares,
const MOVED_NONLINEAR: f64 = 1e-6;
/// or by no more than this part of the cost, which is rounding.
const MOVED_ROUNDING: f64 = 1e-15;
/// Most passes from corrected borders of a nonlinear model, and the part of the last correction to which each must reduce it.
/// Where they do not suffice, the borders are simulated from the begin of the record.
const REPAIRS: (usize, f64) = (2, 0.01);
/// The first guess of a border is simulated from this many samples before it: in fast plants the effect of the state
/// there has decayed by then.
const RUN_IN: usize = 128;

/// The borders at a point, before it is evaluated.
pub(super) enum Guess {
    /// No further pass is needed: simulated, or left by an earlier evaluation at this point; `None` where segments are not
    /// chained.
    Right(Option<Borders>),
    /// Guessed, for a model that is affine in its carry. The correction of the errors is exact; slopes are computed again where it
    /// changes more than this part of the squared errors.
    Affine(Borders, f64),
    /// Guessed, for a nonlinear model, with the best cost so far. The correction is exact to the first order.
    Nonlinear(Borders, f64),
}

impl Objective<'_> {
    /// The borders of the segments at a point, with their slopes if `slopes` is set; `None` where nothing is
    /// chained.
    pub(super) fn borders(
        &self,
        coordinates: &[f64],
        values: &[Values],
        slopes: bool,
    ) -> Result<Option<Arc<Borders>>, Infeasible> {
        let cuts = &self.problem.cuts;
        if !(0..self.experiments()).any(|e| cuts.is_chained(e)) {
            return Ok(None);
        }
        let known = |found: &Arc<Borders>| !slopes || found.has_slopes();
        if let Some(found) = self.memory.at(coordinates).filter(known) {
            return Ok(Some(found));
        }
        if slopes {
            self.evaluate_anew(coordinates)?;
            if let Some(found) = self.memory.at(coordinates) {
                return Ok(Some(found));
            }
        }
        let found = Arc::new(self.simulated_borders(coordinates, values)?);
        self.memory.keep(found.clone());
        Ok(Some(found))
    }

    /// The borders of the segments at a point, simulated in values.
    fn simulated_borders(&self, coordinates: &[f64], values: &[Values]) -> Result<Borders, Infeasible> {
        let one = |e: usize| {
            let segments = &self.problem.cuts.segments[e];
            if !self.problem.cuts.is_chained(e) {
                return Ok(vec![]);
            }
            let at: Vec<usize> = segments[1..].iter().map(|samples| samples.start).collect();
            let found = self.carries(e, coordinates, &at)?;
            Ok(found.into_iter().map(|carry| Reached { carry, slopes: vec![] }).collect())
        };
        let of: Result<Vec<_>, Infeasible> = each(self.experiments(), one).into_iter().collect();
        let (point, cost, values) = (coordinates.to_vec(), f64::INFINITY, values.to_vec());
        Ok(Borders { point, cost, values, of: of?, right: true, run_ins: None })
    }

    /// The carries at these samples of an experiment, run from its begin.
    pub(crate) fn carries(&self, e: usize, coordinates: &[f64], at: &[usize]) -> Result<Vec<Vec<f64>>, Infeasible> {
        let values = self.problem.unknowns.of_experiment(e, coordinates);
        let job = self.job(e, &values, coordinates, false);
        self.sweep.follow(&job.piece, at).map_err(|error| self.infeasible(e, error))
    }

    /// The carry at the begin of each segment.
    pub(super) fn guess(&self, coordinates: &[f64], values: &[Values]) -> Result<Guess, Infeasible> {
        if let Some(known) = self.memory.at(coordinates) {
            return Ok(Guess::Right(Some(Borders { right: true, ..(*known).clone() })));
        }
        let affine = self.problem.cuts.affine;
        let squares = self.is_sum_of_squares();
        match self.memory.best().filter(|_| squares) {
            Some(best) if affine => Ok(Guess::Affine(self.extrapolated(coordinates, values, &best), MOVED)),
            Some(best) => Ok(Guess::Nonlinear(self.extrapolated(coordinates, values, &best), best.cost)),
            None if affine && squares => Ok(Guess::Affine(self.first_borders(coordinates, values), MOVED_FIRST)),
            None => Ok(Guess::Right(Some(self.simulated_borders(coordinates, values)?))),
        }
    }

    /// The borders as the slopes at another point tell.
    fn extrapolated(&self, coordinates: &[f64], values: &[Values], from: &Borders) -> Borders {
        let one = |(e, borders): (usize, &Vec<Reached>)| {
            let change = self.change(e, values, from);
            borders.iter().map(|border| border.moved(&change)).collect()
        };
        let of = from.of.iter().enumerate().map(one).collect();
        Borders {
            point: coordinates.to_vec(),
            cost: from.cost,
            values: values.to_vec(),
            of,
            right: false,
            run_ins: None,
        }
    }

    /// The change of the quantities of a record's unknowns from another point.
    pub(super) fn change(&self, e: usize, values: &[Values], from: &Borders) -> Vec<f64> {
        let quantity = |values: &Values, seed: &Seed| match *seed {
            Seed::Carry(i) => values.x[i],
            Seed::Parameter(j) => values.p[j],
        };
        let change = |seed| quantity(&values[e], seed) - quantity(&from.values[e], seed);
        self.problem.unknowns.seeds(e).iter().map(change).collect()
    }

    /// Triangles of a nonlinear model from guessed borders, which are corrected and simulated from anew until the correction
    /// no longer matters for a comparison with the best cost.
    pub(super) fn repaired(
        &self,
        coordinates: &[f64],
        values: &[Values],
        mut borders: Borders,
        best: f64,
    ) -> Result<Triangulation, Infeasible> {
        let (repairs, falls) = REPAIRS;
        let mut last = None;
        for _ in 0..=repairs {
            let found = match self.triangles(coordinates, values, Some(&borders)) {
                Ok(found) => found,
                Err(Infeasible::Cancelled) => return Err(Infeasible::Cancelled),
                Err(Infeasible::Failed(_)) => break,
            };
            let difference = (found.cost - best).abs();
            if found.moved <= (MOVED_NONLINEAR * difference).max(MOVED_ROUNDING * found.cost) {
                return Ok(found);
            }
            // A correction that is larger than the errors themselves is of no use.
            let limit = last.map_or(found.cost, |last: f64| falls * last);
            match found.borders {
                Some(corrected) if found.moved <= limit => borders = corrected,
                _ => break,
            }
            last = Some(found.moved);
        }
        let borders = self.simulated_borders(coordinates, values)?;
        self.triangles(coordinates, values, Some(&borders))
    }

    /// The carry that the last samples before each segment lead to from the carry of the first one.
    fn first_borders(&self, coordinates: &[f64], values: &[Values]) -> Borders {
        let run_in = |e: usize| {
            let whole = self.job(e, &values[e], coordinates, false);
            let before = self.problem.cuts.segments[e].split_last().map_or(&[][..], |(_, before)| before);
            let job = move |samples: &std::ops::Range<usize>| {
                let from = samples.end.saturating_sub(RUN_IN).max(samples.start);
                let piece = Piece { samples: from..samples.end, ..whole.piece.clone() };
                Job { objective: self, experiment: e, seeds: Arc::default(), scales: vec![], piece }
            };
            before.iter().map(job)
        };
        let jobs: Vec<Job<'_>> = (0..self.experiments()).flat_map(run_in).collect();
        // A run that fails leaves its begin as the guess.
        let end = |_: &[usize], jobs: &[&Job<'_>]| {
            let end = |(reached, job): (Result<Reached, RunError>, &&Job<'_>)| {
                reached.unwrap_or_else(|_| Reached { carry: job.piece.carry.to_vec(), slopes: vec![] })
            };
            Ok(ends(jobs).into_iter().zip(jobs).map(end).collect())
        };
        let mut found = in_batches(&jobs, end).unwrap_or_default().into_iter();
        let of_record = |segments: &Vec<_>| found.by_ref().take(segments.len() - 1).collect();
        let of = self.problem.cuts.segments.iter().map(of_record).collect();
        Borders {
            point: coordinates.to_vec(),
            cost: f64::INFINITY,
            values: values.to_vec(),
            of,
            right: false,
            run_ins: None,
        }
    }
}
