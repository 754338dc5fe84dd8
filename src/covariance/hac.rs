//! The covariance where the errors are autocorrelated: it allows the scores to be correlated over time and of changing
//! size (heteroscedasticity and autocorrelation consistent, HAC).
//!
//! The scores of each experiment are prewhitened by a vector autoregression of order one, summed over lags with
//! Bartlett's weights (Newey and West, Econometrica 55 (1987) 703) at Andrews' bandwidth (Econometrica 59 (1991) 817,
//! eqs. 6.2 and 6.4), and recolored (Andrews and Monahan, Econometrica 60 (1992) 953). Newey and West's sum is the sum
//! of squares of moving sums, which a triangle absorbs like any other rows; so two passes over the data serve, and no
//! score is kept longer than the bandwidth. The first of them is the pass that all checks share ([`Frame::first`]).
//!
//! The autoregression works on scores of unit covariance: so its singular values are below one, and the result does not
//! depend on the choice of units or parameters. Its coefficients are corrected for the bias of least squares. The variance
//! that comes out is an estimate from few independent stretches of the record, so intervals take Student's t with the
//! degrees of freedom that the errors of the autoregression and of the sums leave.
//!
//! Where these sums do not certainly say more, the standard errors are those of stationary errors ([`stationary`]). A record of few
//! measurements among several has no moving sums: its scores are those of stationary errors, with the autoregression of all.

mod joined;
mod long_run;
mod scores;
mod stationary;

use crate::covariance::leverage::of_experiment;
use crate::covariance::point::Point;
use crate::covariance::sandwich::{Bread, Robust, of_scores};
use crate::information::{Covariance, Information};
use crate::problem::Objective;
use joined::joined;
use long_run::{LongRun, Prewhitened};
use nalgebra::DMatrix;
use scores::{EachScore, Lagged, MovingSums};
use stationary::{ErrorSums, Errors, FilteredSlopes, Stationary};

/// Standard deviations by which a variance by moving sums must be above that of stationary errors to be taken instead.
const CERTAIN: f64 = 2.0;
/// The fewest degrees of freedom: Satterthwaite's rule knows none of less than a square of one normal number.
const FEWEST: f64 = 1.0;

/// The sandwich for autocorrelated errors, and over how many samples they are correlated beyond the autoregression.
pub(crate) struct Hac {
    covariance: Covariance,
    /// The covariance by the scores of stationary errors, if they have such.
    stationary: Option<Covariance>,
    /// The sandwich of independent errors, if it was asked for.
    pub robust: Option<Robust>,
    pub lags: usize,
    runs: Vec<Run>,
}

/// The unknowns of an experiment whose scores are summed, as columns, and the inverse of the curvature in all columns.
pub(crate) struct Frame {
    kept: Vec<usize>,
    inverse: DMatrix<f64>,
}

/// What the first pass sums up of an experiment.
pub(crate) type First<'f> = (EachScore<'f, Lagged>, Option<Errors<'f>>);

/// Its sums: of products of the scores over time and, but where variances are predicted, of the errors.
pub(crate) struct Sums {
    count: usize,
    /// The mean square of the influences ([`EachScore::mean_square`]).
    mean_square: f64,
    triangle: Information,
    products: [DMatrix<f64>; 2],
    pub errors: Option<ErrorSums>,
}

impl Frame {
    /// Of all experiments, by the inverse of the curvature.
    pub fn of_all(objective: &Objective<'_>, held: &[bool], inverse: &Covariance) -> Vec<Self> {
        let frame = |e: usize| {
            let columns = objective.problem.unknowns.columns(e).enumerate();
            let kept = columns.filter(|(_, i)| !held[*i]).map(|(c, _)| c).collect();
            Frame { kept, inverse: of_experiment(objective, inverse, e) }
        };
        (0..objective.experiments()).map(frame).collect()
    }

    fn scores<'f, T>(&'f self, objective: &'f Objective<'f>, experiment: usize, into: T) -> EachScore<'f, T> {
        EachScore::new(objective, experiment, (&self.kept, &self.inverse), into)
    }

    /// The accumulators of the first pass.
    pub fn first<'f>(&'f self, objective: &'f Objective<'f>, experiment: usize) -> First<'f> {
        let stationary = !objective.sweep.predicts_variance();
        let errors = stationary.then(|| Errors::new(objective, experiment, self.inverse.clone()));
        (self.scores(objective, experiment, Lagged::new(self.kept.len())), errors)
    }
}

impl Sums {
    pub fn of((scores, errors): First<'_>) -> Self {
        let mean_square = scores.mean_square();
        let alone = scores.alone(mean_square);
        let Lagged { count, scores, products, .. } = scores.into;
        let mut triangle = scores.triangle();
        alone.iter().for_each(|row| triangle.absorb_row(row, 0.0));
        Sums { count, mean_square, triangle, products, errors: errors.map(|errors| errors.into) }
    }
}

/// By the sums of the first pass, with one more pass with slopes; in which the sandwich of plain least squares is made, too, where its inverse
/// curvature is given. `None` where the scores of the unknowns that are not held are linearly dependent.
pub(crate) fn hac(
    point: &Point<'_>,
    bread: &Bread,
    (frames, first): (&[Frame], &[Sums]),
    robust: Option<&Covariance>,
) -> Option<Hac> {
    let (objective, x) = (point.objective, &point.end.coordinates);
    let errors: Option<Vec<&ErrorSums>> = first.iter().map(|one| one.errors.as_ref()).collect();
    let stationary = errors.map(|errors| Stationary::of(objective.outputs(), &errors));
    let several = first.len() > 1;
    let is_short = |e: usize| several && stationary.as_ref().is_some_and(|found| found.short[e]);
    let prewhitened =
        |(e, sums): (usize, &Sums)| if is_short(e) { Some(None) } else { Some(Some(Prewhitened::of(sums)?)) };
    let prewhitened: Vec<Option<Prewhitened>> = first.iter().enumerate().map(prewhitened).collect::<Option<_>>()?;
    let make = |e: usize| {
        let moving = prewhitened[e].as_ref();
        let moving = moving.map(|by| frames[e].scores(objective, e, MovingSums::new(&by.w, &by.a, by.window)));
        let filtered = stationary.as_ref().map(|found| FilteredSlopes::new(objective, e, &found.models[e]));
        (moving, (filtered, robust.map(|inverse| bread.scores(objective, inverse, e))))
    };
    let (moving, others): (Vec<_>, Vec<_>) = objective.gather(x, true, make).ok()?.into_iter().unzip();
    let (filtered, scores): (Vec<_>, Vec<_>) = others.into_iter().unzip();
    let filtered: Vec<Option<Information>> =
        filtered.into_iter().map(|one| one.map(FilteredSlopes::triangle)).collect();
    let uncertainty = stationary.as_ref().map_or(0.0, |found| found.uncertainty);
    let run = |(e, moving): (usize, Option<EachScore<'_, MovingSums<'_>>>)| match (&prewhitened[e], moving) {
        (Some(by), Some(moving)) => {
            let alone = moving.alone(first[e].mean_square);
            Some(Run::Long(by.run(frames[e].kept.clone(), moving.into.triangle(), &alone)?))
        }
        _ => Some(Run::Short { triangle: filtered[e].clone()?, uncertainty }),
    };
    let runs: Vec<Run> = moving.into_iter().enumerate().map(run).collect::<Option<_>>()?;
    let unknowns = &objective.problem.unknowns;
    let with_priors = |mut scores: Vec<Information>| {
        unknowns.add_priors(x, 1.0, &mut scores);
        bread.sandwich(&point.held_for_covariance, &scores, 1.0)
    };
    let of_runs = runs.iter().enumerate().map(|(e, run)| run.triangle(unknowns.columns(e).count())).collect();
    let scores: Vec<_> = scores.into_iter().flatten().collect();
    Some(Hac {
        covariance: with_priors(of_runs)?,
        stationary: filtered.into_iter().collect::<Option<_>>().and_then(with_priors),
        robust: (!scores.is_empty()).then(|| of_scores(point, bread, scores)),
        lags: runs.iter().map(Run::lags).max().unwrap_or(0),
        runs,
    })
}

impl Hac {
    /// The covariance of all unknowns that are not held. The standard errors are those of stationary errors, but where the moving
    /// sums say more by over [`CERTAIN`] standard deviations of what they say (`degrees` of freedom), as they do for errors
    /// whose size follows the slopes; or by anything at all, where the errors of several outputs are `coupled`.
    pub fn covariance(&self, degrees: &[f64], coupled: bool) -> Covariance {
        let found = self.covariance.clone();
        let Some(stationary) = &self.stationary else { return found };
        let factor = |(i, degrees): (usize, &f64)| {
            let certain = if coupled { 0.0 } else { certain(*degrees) };
            joined(stationary.standard_error(i) / found.standard_error(i), certain)
        };
        let factors: Vec<f64> = degrees.iter().enumerate().map(factor).collect();
        found.scaled(&factors)
    }

    /// Degrees of freedom of the variance of each unknown, by Satterthwaite's rule over the experiments; `inverse` is
    /// the inverse of the curvature. Infinite for unknowns that are held.
    pub fn degrees(&self, objective: &Objective<'_>, inverse: &Covariance) -> Vec<f64> {
        // Variances, their variances, and variances of which all are uncertain alike.
        let mut variances = vec![(0.0, 0.0, 0.0); objective.problem.unknowns.row.len()];
        for (e, run) in self.runs.iter().enumerate() {
            let columns: Vec<usize> = objective.problem.unknowns.columns(e).collect();
            let inverse = inverse.dense(&columns);
            for (row, &i) in columns.iter().enumerate() {
                let contrast: Vec<f64> = (0..columns.len()).map(|c| inverse[(row, c)]).collect();
                let (variance, spread) = run.variance(&contrast);
                let (all, spreads, alike) = &mut variances[i];
                *all += variance;
                match run {
                    Run::Long(_) => *spreads += spread,
                    Run::Short { .. } => *alike += spread.sqrt(),
                }
            }
        }
        let degrees = |(variance, spread, alike): (f64, f64, f64)| {
            (2.0 * variance * variance / (spread + alike * alike)).max(FEWEST)
        };
        variances.into_iter().map(degrees).collect()
    }
}

/// The scores of one experiment: their long-run covariance, or those of stationary errors.
enum Run {
    Long(LongRun),
    Short {
        triangle: Information,
        /// Relative variance of its variances.
        uncertainty: f64,
    },
}

impl Run {
    fn triangle(&self, columns: usize) -> Information {
        match self {
            Run::Long(run) => run.triangle(columns),
            Run::Short { triangle, .. } => triangle.clone(),
        }
    }

    fn lags(&self) -> usize {
        match self {
            Run::Long(run) => run.window.saturating_sub(1),
            Run::Short { .. } => 0,
        }
    }

    /// The variance of a combination of the scores of all columns, and the variance of this estimate of it.
    fn variance(&self, contrast: &[f64]) -> (f64, f64) {
        match self {
            Run::Long(run) => run.variance(&run.kept.iter().map(|&c| contrast[c]).collect::<Vec<f64>>()),
            Run::Short { triangle, uncertainty } => {
                let n = triangle.columns();
                let row = |i: usize| (i..n).map(|j| triangle.at(i, j) * contrast[j]).sum::<f64>();
                let variance: f64 = (0..n).map(|i| row(i).powi(2)).sum();
                (variance, uncertainty * variance * variance)
            }
        }
    }
}

/// By which part a variance with these degrees of freedom is certainly larger than another.
fn certain(degrees: f64) -> f64 {
    CERTAIN * (2.0 / degrees).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The relative standard deviation of a variance is the root of two over its degrees of freedom.
    #[test]
    fn a_certain_difference_of_variances() {
        assert!((certain(200.0) / (0.1 * CERTAIN) - 1.0).abs() < 1e-12, "{}", certain(200.0));
    }
}
