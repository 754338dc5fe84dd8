//! Correlation over time of the errors that remain in each piece of the data when it has taken its own step.

use crate::problem::{Accumulate, Objective};
use crate::residuals::whiteness::{LAGS, Whiteness};
use crate::rows::pieces::Piece;
use crate::rows::spans::span;
use crate::sweep::Window;
use crate::whiteness::Portmanteau;

/// A piece with fewer errors of an output than these takes the correlations of all pieces together.
const OWN: u64 = 100;

/// Correlations and number of errors.
#[derive(Clone)]
pub(crate) struct Run {
    sums: Portmanteau,
    pub count: u64,
}

impl Run {
    pub fn new() -> Self {
        Run { sums: Portmanteau::new(LAGS), count: 0 }
    }

    pub fn add(&mut self, errors: &[f64]) {
        self.sums.add(errors);
        self.count += errors.len() as u64;
    }

    /// Adds the errors that follow.
    pub fn follow(&mut self, later: &Run) {
        self.sums.follow(&later.sums);
        self.count += later.count;
    }

    /// Adds errors of another record or piece.
    pub fn append(&mut self, other: &Run) {
        self.sums.append(&other.sums);
        self.count += other.count;
    }

    pub fn whiteness(&self) -> Whiteness {
        Whiteness::of(&self.sums, self.count)
    }
}

/// The errors of an experiment, piece by piece and output by output.
pub(crate) struct OfPieces<'p> {
    objective: &'p Objective<'p>,
    pieces: &'p [Piece],
    experiment: usize,
    columns: Vec<usize>,
    of: Vec<Vec<Run>>,
    run: Vec<f64>,
}

impl<'p> OfPieces<'p> {
    pub fn new(objective: &'p Objective<'p>, pieces: &'p [Piece], experiment: usize) -> Self {
        let of = vec![vec![Run::new(); objective.outputs()]; pieces.len()];
        let columns = objective.problem.unknowns.columns(experiment).collect();
        OfPieces { objective, pieces, experiment, columns, of, run: vec![] }
    }
}

impl Accumulate for OfPieces<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (e, begin) = (self.experiment, window.begin[lane]);
        let samples = self.objective.problem.records[e].len();
        for (piece, of) in self.pieces.iter().zip(&mut self.of) {
            for (j, run) in of.iter_mut().enumerate() {
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
                run.add(&self.run);
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.of.iter_mut().flatten().zip(later.of.iter().flatten()).for_each(|(run, later)| run.follow(later));
    }
}

/// How many errors have the information of one, by each piece: the most of its outputs.
pub(crate) fn inflations<'p>(all: impl Iterator<Item = &'p OfPieces<'p>>) -> Vec<f64> {
    let mut sums: Vec<Vec<Run>> = vec![];
    for one in all {
        match sums.is_empty() {
            true => sums.clone_from(&one.of),
            false => sums.iter_mut().flatten().zip(one.of.iter().flatten()).for_each(|(sum, own)| sum.append(own)),
        }
    }
    let mut together = vec![Run::new(); sums.first().map_or(0, Vec::len)];
    sums.iter().for_each(|of| together.iter_mut().zip(of).for_each(|(all, own)| all.append(own)));
    let inflation = |(own, all): (&Run, &Run)| if own.count < OWN { all } else { own }.whiteness().variance_inflation;
    let most =
        |of: &Vec<Run>| of.iter().zip(&together).filter(|(own, _)| own.count > 0).map(inflation).fold(1.0, f64::max);
    sums.iter().map(most).collect()
}
