//! Correlation over time of the errors that remain when each part of the data has taken its own step.
//!
//! At the common estimate, a contradiction between parts makes the errors correlated by itself. How many errors have the information of
//! one is therefore taken from those that remain without the contradiction.

use super::pieces::Piece;
use crate::judge::evidence::spans::span;
use crate::judge::evidence::whiteness::{LAGS, Whiteness};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use crate::whiteness::Portmanteau;

/// A piece with fewer errors of an output than these takes the correlations of all pieces together.
const OWN: u64 = 100;

/// Correlations and number of the errors of one output that remain in a piece.
#[derive(Clone)]
struct Left {
    sums: Portmanteau,
    count: u64,
}

/// The errors of an experiment, piece by piece and output by output.
struct Pass<'p> {
    objective: &'p Objective<'p>,
    pieces: &'p [Piece],
    experiment: usize,
    columns: Vec<usize>,
    of: Vec<Vec<Left>>,
    run: Vec<f64>,
}

impl Accumulate for Pass<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (e, begin) = (self.experiment, window.begin[lane]);
        let samples = self.objective.problem.records[e].len();
        for (piece, of) in self.pieces.iter().zip(&mut self.of) {
            for (j, left) in of.iter_mut().enumerate() {
                let inside = |k: &usize| {
                    piece.rows.contain(e, j, span(begin + k, samples))
                        && window.is_measured(*k, j, lane)
                        && self.objective.weight(e, begin + k) > 0.0
                };
                let moved = |k: usize| {
                    let by = self.columns.iter().enumerate().map(|(c, i)| window.at(k, j, c, lane) * piece.step[*i]);
                    window.error(k, j, lane) - by.sum::<f64>()
                };
                self.run.clear();
                self.run.extend((0..window.samples[lane]).filter(inside).map(moved));
                left.count += self.run.len() as u64;
                left.sums.add(&self.run);
            }
        }
    }

    fn append(&mut self, later: Self) {
        for (left, later) in self.of.iter_mut().flatten().zip(later.of.iter().flatten()) {
            left.sums.follow(&later.sums);
            left.count += later.count;
        }
    }
}

/// How many errors have the information of one, by each piece: the most of its outputs.
pub(crate) fn dependences(objective: &Objective<'_>, coordinates: &[f64], pieces: &[Piece]) -> Option<Vec<f64>> {
    let none = Left { sums: Portmanteau::new(LAGS), count: 0 };
    let empty = vec![vec![none.clone(); objective.outputs()]; pieces.len()];
    let make = |experiment: usize| Pass {
        objective,
        pieces,
        experiment,
        columns: objective.problem.unknowns.columns(experiment).collect(),
        of: empty.clone(),
        run: vec![],
    };
    let all = objective.gather(coordinates, true, make).ok()?;
    let mut sums = empty.clone();
    for one in all {
        for (sum, own) in sums.iter_mut().flatten().zip(one.of.iter().flatten()) {
            sum.sums.append(&own.sums);
            sum.count += own.count;
        }
    }
    let mut together = vec![none; objective.outputs()];
    for of in &sums {
        for (all, own) in together.iter_mut().zip(of) {
            all.sums.append(&own.sums);
            all.count += own.count;
        }
    }
    let dependence = |(left, all): (&Left, &Left)| {
        let of = if left.count < OWN { all } else { left };
        Whiteness::of(&of.sums, of.count).dependence
    };
    let most = |of: &Vec<Left>| {
        of.iter().zip(&together).filter(|(left, _)| left.count > 0).map(dependence).fold(1.0, f64::max)
    };
    Some(sums.iter().map(most).collect())
}
