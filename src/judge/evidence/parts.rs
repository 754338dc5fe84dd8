//! The data taken apart: into outputs, into records, before and after a time in the records.
//!
//! At the minimum each part has a triangle of its own, and with it a step to the minimum that it would have by itself. If
//! all parts follow one model, what they gain by steps of their own over the common one is noise: Fisher's F with as many
//! degrees of freedom as they have steps more (Chow, Econometrica 28 (1960) 591), and those of the noise of the shortest part. Errors
//! that are correlated over time, also without what contradicts the common step, count for fewer. The time at which a plant may have changed,
//! or one run may have been joined to another, is not known: of several that gain most (Quandt, J. American Statistical Association 55
//! (1960) 324) is tested, at a level divided by their number.

use super::Evidence;
use super::ruled_out::Unless;
use crate::covariance::point::Point;
use crate::information::{Covariance, Information};
use crate::optimize::Linearization;
use crate::problem::Role;
use crate::residuals::powers::COMPARED;
use crate::rows::pieces::{Piece, Rows, pieces};
use crate::rows::spans::SPANS;
use crate::whiteness::chi_squared_tail;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// What rules out that parts are compared.
pub(crate) const UNLESS: &[Unless] =
    &[Unless::Prefilter, Unless::ManyUnknowns, Unless::NoFreedom(0.0), Unless::NoMinimum];
/// Level of the tests.
pub(crate) const LEVEL: f64 = 1e-4;
/// A pivot below this part of its column is rounding.
const ROUNDING: f64 = 1e-11;
/// The parameter that differs most between two pieces differs by so many standard errors at least, where the test has found a difference.
pub(crate) const APART: f64 = 3.0;
/// The fewest of the parts of a record before and after a time at which all may have changed.
const FEWEST: usize = 2;
/// From so many degrees of freedom of the noise on, Fisher's F is chi squared.
const MANY: f64 = 1e5;

/// Into what data are taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Into {
    Records,
    Outputs,
    /// Before and after a time.
    Times,
}

/// Of several ways to take the data apart, the pieces that gain most.
pub(crate) struct Parts {
    pub into: Into,
    pub pieces: Vec<Piece>,
    /// The number of ways.
    ways: f64,
}

/// A difference between pieces that is no chance: its probability, over all ways of taking the data apart, what the pieces gain by steps of
/// their own, the parameter that differs most, and the two pieces.
pub(crate) struct Difference {
    pub chance: f64,
    gain: f64,
    pub unknown: usize,
    pub pieces: [usize; 2],
}

/// Parts that seem to differ, as far as the errors are independent. Where one run was joined to another, the part of a record that they share
/// may be of neither: it is left out in a second group of ways.
pub(crate) fn parts(evidence: &Evidence<'_>) -> Vec<Parts> {
    let (point, outputs) = (&evidence.point, evidence.point.objective.outputs());
    let compared = evidence.ruled_out(UNLESS).is_none() && evidence.compare_parts();
    let all = if compared { evidence.rows().spans.as_ref() } else { None };
    let Some(all) = all else { return vec![] };
    let mut groups: Vec<(Into, Vec<Vec<Rows>>)> = vec![];
    if (2..=COMPARED).contains(&all.len()) {
        groups.push((Into::Records, vec![(0..all.len()).map(Rows::Record).collect()]));
    }
    if outputs > 1 {
        groups.push((Into::Outputs, vec![(0..outputs).map(Rows::Output).collect()]));
    }
    for without in (0..2).filter(|_| !point.is_static()) {
        let at = |parts: usize| vec![Rows::Before(parts), Rows::After(parts + without)];
        groups.push((Into::Times, (FEWEST..=SPANS - FEWEST - without).map(at).collect()));
    }
    let of = |(into, group): &(Into, Vec<Vec<Rows>>)| {
        let ways: usize = groups.iter().filter(|(other, _)| other == into).map(|(_, group)| group.len()).sum();
        let found = group.iter().filter_map(|rows| {
            let parts = Parts { into: *into, pieces: pieces(point, all, rows), ways: ways as f64 };
            Some((parts.difference(point)?.gain, parts))
        });
        found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, parts)| parts)
    };
    groups.iter().filter_map(of).collect()
}

impl Parts {
    /// Whether the pieces follow different sets of parameters.
    pub fn difference(&self, point: &Point<'_>) -> Option<Difference> {
        let pieces = &self.pieces;
        let first = pieces.first().filter(|_| pieces.len() > 1)?;
        let inflation = pieces.iter().map(|piece| piece.variance_inflation).fold(1.0, f64::max);
        let shared = point.objective.problem.unknowns.shared();
        let mut whole: Vec<Information> = first.linear.columns().map(|(triangle, _)| triangle.clone()).collect();
        for piece in &pieces[1..] {
            whole.iter_mut().zip(piece.linear.columns()).for_each(|(all, (one, _))| all.merge(one));
        }
        let whole = Piece::new(first.rows, Linearization::new(0.0, shared, whole), &point.undetermined.held)?;
        let free = |piece: &Piece| piece.held.iter().filter(|held| !**held).count() as f64;
        let degrees = pieces.iter().map(free).sum::<f64>() - free(&whole);
        let gain = pieces.iter().map(|piece| piece.gain).sum::<f64>() - whole.gain;
        let of_noise = pieces.iter().map(|piece| piece.degrees).fold(f64::INFINITY, f64::min) / inflation;
        let chance = significant(gain / inflation, degrees, of_noise, self.ways)?;
        let (unknown, pieces) = furthest(pieces, point)?;
        Some(Difference { chance, gain, unknown, pieces })
    }
}

/// The parameter that differs most between two pieces, in standard errors, and these.
fn furthest(pieces: &[Piece], point: &Point<'_>) -> Option<(usize, [usize; 2])> {
    let mut found: Option<(usize, [usize; 2], f64)> = None;
    let covariances: Vec<Option<Covariance>> =
        pieces.iter().map(|piece| piece.linear.covariance(&piece.held)).collect();
    let unknowns = point.objective.problem.unknowns.row.iter().zip(&point.values).enumerate();
    for (i, _) in unknowns.filter(|(_, (row, value))| matches!(row.role, Role::Parameter(_)) && **value != 0.0) {
        for (a, b) in (0..pieces.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
            let (Some(first), Some(second)) = (&covariances[a], &covariances[b]) else { continue };
            if pieces[a].held[i] || pieces[b].held[i] {
                continue;
            }
            let error = |of: &Covariance, piece: usize| of.standard_error(i) * pieces[piece].variance_inflation.sqrt();
            let apart = (pieces[a].step[i] - pieces[b].step[i]).abs() / error(first, a).hypot(error(second, b));
            if apart > found.map_or(APART, |(.., most)| most) {
                found = Some((i, [a, b], apart));
            }
        }
    }
    found.map(|(unknown, pieces, _)| (unknown, pieces))
}

/// Probability that pieces of one plant gain as much by steps of their own in one of so many ways, if it is below the level: by Fisher's F with
/// the degrees of freedom of the steps and of the noise.
fn significant(gain: f64, degrees: f64, of_noise: f64, ways: f64) -> Option<f64> {
    if degrees < 1.0 || of_noise.is_nan() || of_noise < 1.0 {
        return None;
    }
    let fisher = FisherSnedecor::new(degrees, of_noise).ok().filter(|_| of_noise < MANY);
    let chance = fisher.map_or_else(|| chi_squared_tail(gain, degrees), |fisher| fisher.sf((gain / degrees).max(0.0)));
    (ways * chance <= LEVEL).then_some(ways * chance)
}

/// The probability that records of one plant gain as much by steps of their own, by the slopes that a fit has of each.
pub(crate) fn records_by_chance(point: &Point<'_>) -> f64 {
    let (mut gain, mut left, mut own, mut rows) = (0.0, 0.0, 0.0, 0.0);
    for (triangle, columns) in point.linear.columns() {
        let kept: Vec<usize> = (0..columns.len()).filter(|&c| !point.undetermined.held[columns[c]]).collect();
        let triangle = triangle.select(&kept);
        let norms = triangle.column_norms();
        let told = (0..kept.len()).filter(|&c| triangle.at(c, c).abs() > ROUNDING * norms[c]).count();
        gain += triangle.residual_at_zero() - triangle.residual();
        left += triangle.residual();
        own += told as f64;
        rows += triangle.rows() as f64;
    }
    let common = point.undetermined.held.iter().filter(|held| !**held).count() as f64;
    let (steps, free) = (own - common, rows - own);
    if steps < 1.0 || free < 1.0 || left <= 0.0 {
        return 1.0;
    }
    let statistic = (gain / steps) / (left / free);
    FisherSnedecor::new(steps, free).map_or(1.0, |fisher| fisher.sf(statistic.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 0.01 % points of chi-squared with 1 and 2 degrees of freedom are 15.137 and `-2 ln 1e-4 = 18.421`; of two ways the level of each is
    /// half of that: `-2 ln 5e-5 = 19.807`. With 2 and `n` degrees of freedom Fisher's F is beyond `f` with probability
    /// `(1 + 2 f / n)^(-n / 2)`: 1e-4 at `f = 6 (1e4^(1/6) - 1)` for `n = 12`.
    #[test]
    fn contradictions_begin_at_their_level() {
        let said =
            |gain: f64, degrees: f64, of_noise: f64, tests: f64| significant(gain, degrees, of_noise, tests).is_some();
        let all = f64::INFINITY;
        assert!(said(15.14, 1.0, all, 1.0) && !said(15.13, 1.0, all, 1.0));
        assert!(said(18.43, 2.0, all, 1.0) && !said(18.41, 2.0, all, 1.0) && !said(99.0, 0.0, all, 1.0));
        assert!(said(19.81, 2.0, all, 2.0) && !said(19.80, 2.0, all, 2.0));
        let f = 6.0 * (1e4f64.powf(1.0 / 6.0) - 1.0);
        assert!(said(2.0 * f * 1.001, 2.0, 12.0, 1.0) && !said(2.0 * f * 0.999, 2.0, 12.0, 1.0));
        assert!(!said(1e9, 2.0, 0.5, 1.0) && !said(1e9, 2.0, f64::NAN, 1.0));
    }
}
