//! [`PooledRegression`]: several sets of rows that have some of their parameters in common.

use super::error::directions;
use super::{Assumption, LinearEstimate, Regression, RegressionError, percent};
use crate::information::{Elimination, Information, SquareMatrix};
use crate::signals::{Of, Signals};
use nalgebra::DMatrix;

/// Sets of rows of the same model, such as the cycles of one motor: some parameters are the same in all of them, the
/// others belong to each set. All are solved together; the own ones are eliminated set by set, so that time and memory
/// are linear in the number of sets.
///
/// ```
/// use greybox::{signals, regress::{PooledRegression, Regression}};
/// signals! {
///     /// A straight line.
///     pub struct Line { slope: "V/s", offset: "V" }
/// }
/// let line = |offset: f64| {
///     let mut rows = Regression::<Line>::new();
///     (0..4).map(f64::from).for_each(|t| rows.row(Line { slope: t, offset: 1.0 }, 3.0 * t + offset));
///     rows
/// };
/// // One slope, an offset for each.
/// let found = PooledRegression::new([line(1.0), line(-2.0)], Line { slope: true, offset: false }).solve()?;
/// assert!((found[1].parameters.slope - 3.0).abs() < 1e-12);
/// assert!((found[1].parameters.offset + 2.0).abs() < 1e-12);
/// # Ok::<(), greybox::regress::RegressionError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PooledRegression<P: Signals> {
    sets: Vec<Regression<P>>,
    /// Positions of the parameters that each set has for itself, and of those that all share.
    own: Vec<usize>,
    shared: Vec<usize>,
}

impl<P: Signals> PooledRegression<P> {
    /// These sets, with the parameters in common that `shared` says.
    pub fn new(sets: impl IntoIterator<Item = Regression<P>>, shared: Of<P, bool>) -> Self {
        let is_shared = P::into_array(shared);
        let (shared, own) = (0..P::LEN).partition(|&i| is_shared.as_ref()[i]);
        PooledRegression { sets: sets.into_iter().collect(), own, shared }
    }

    /// The least weighted sum of squared residuals; NaN where the rows do not determine the parameters.
    pub fn least_squares(&self) -> f64 {
        let informations = self.informations();
        let step = Self::eliminate(&informations, self.shared.len()).step(&[], &[]);
        step.map_or(f64::NAN, |step| self.residual(&informations, &step))
    }

    /// The parameters with the least weighted sum of squared residuals, for each set its own beside the common ones, and
    /// how well they are known; standard errors as in [`Regression::solve`], errors of different sets being independent. The
    /// indices relate to the squared residual of all sets.
    ///
    /// # Errors
    /// As [`Regression::solve`]; rows are counted within their set.
    pub fn solve(&self) -> Result<Vec<LinearEstimate<P>>, RegressionError> {
        self.sets.iter().try_for_each(Regression::check)?;
        let (rows, unknowns) = (
            self.sets.iter().map(Regression::used).sum::<usize>(),
            self.sets.len() * self.own.len() + self.shared.len(),
        );
        if rows <= unknowns {
            return Err(RegressionError::TooFewRows { rows, parameters: unknowns });
        }
        let informations = self.informations();
        let elimination = Self::eliminate(&informations, self.shared.len());
        self.identifiable(&elimination)?;
        let out_of_range = || RegressionError::OutOfRange;
        let step = elimination.step(&[], &[]).ok_or_else(out_of_range)?;
        let squares = self.residual(&informations, &step);
        let inverse = elimination.covariance(&[]).ok_or_else(out_of_range)?;

        let solutions: Vec<Vec<f64>> = (0..self.sets.len()).map(|set| self.of(set, &step)).collect();
        let inverses: Vec<SquareMatrix> = (0..self.sets.len()).map(|set| inverse.dense(&self.unknowns(set))).collect();
        let assumption = self.assumption();
        let lags = match assumption {
            Assumption::Correlated { lags } => Some(lags),
            Assumption::OwnVariance => Some(0),
            Assumption::EqualVariance => None,
        };
        let covariance = match lags {
            None => inverse.times(squares / (rows - unknowns) as f64),
            Some(lags) => {
                let scores = self.scores(&solutions, &inverses, lags).ok_or_else(out_of_range)?;
                elimination.sandwich(&[], &scores).ok_or_else(out_of_range)?
            }
        };
        let norms = self.norms(&elimination.column_norms());
        let sets = self.sets.iter().zip(&solutions).zip(&inverses).enumerate();
        let estimates: Vec<LinearEstimate<P>> = sets
            .map(|(set, ((regression, solution), inverse))| {
                let covariance = covariance.dense(&self.unknowns(set));
                LinearEstimate {
                    parameters: P::from_fn(|i| solution[i]),
                    standard_errors: P::from_fn(|i| covariance[(i, i)].sqrt()),
                    index: P::from_fn(|i| percent((squares * inverse[(i, i)]).sqrt(), solution[i])),
                    index_others_held: P::from_fn(|i| percent(squares.sqrt() / norms[set][i], solution[i])),
                    rms: regression.rms(solution),
                    covariance,
                    rows: regression.used() as u64,
                    condition: condition(inverse, &norms[set]),
                    assumption,
                }
            })
            .collect();
        let finite = |e: &LinearEstimate<P>| e.covariance.rows().flatten().all(|v| v.is_finite());
        if estimates.iter().all(finite) { Ok(estimates) } else { Err(RegressionError::OutOfRange) }
    }

    /// The triangle of each set, its own parameters before the common ones.
    fn informations(&self) -> Vec<Information> {
        let order = [self.own.as_slice(), &self.shared].concat();
        self.sets.iter().map(|set| set.information().select(&order)).collect()
    }

    fn eliminate(informations: &[Information], shared: usize) -> Elimination {
        Elimination::of_records(shared, informations.to_vec())
    }

    /// The number of each parameter of a set among all unknowns: the common ones first, then each set's own.
    fn unknowns(&self, set: usize) -> Vec<usize> {
        let mut unknowns = vec![0; P::LEN];
        self.shared.iter().enumerate().for_each(|(k, &i)| unknowns[i] = k);
        let first = self.shared.len() + set * self.own.len();
        self.own.iter().enumerate().for_each(|(k, &i)| unknowns[i] = first + k);
        unknowns
    }

    /// The entries for the parameters of one set in a vector of all unknowns.
    fn of(&self, set: usize, all: &[f64]) -> Vec<f64> {
        self.unknowns(set).into_iter().map(|unknown| all[unknown]).collect()
    }

    fn norms(&self, all: &[f64]) -> Vec<Vec<f64>> {
        (0..self.sets.len()).map(|set| self.of(set, all)).collect()
    }

    fn residual(&self, informations: &[Information], step: &[f64]) -> f64 {
        let of_set = |(set, information): (usize, &Information)| {
            let of = self.of(set, step);
            let ordered: Vec<f64> = self.own.iter().chain(&self.shared).map(|&i| of[i]).collect();
            information.about(&ordered).residual_at_zero()
        };
        informations.iter().enumerate().map(of_set).sum()
    }

    fn assumption(&self) -> Assumption {
        let lags = self.sets.iter().filter_map(|set| set.lags).max();
        Assumption::of(lags, self.sets.iter().flat_map(|set| &set.rows).map(|row| row.weight))
    }

    /// The triangles of the sets' scores, in the order of their columns.
    fn scores(&self, solutions: &[Vec<f64>], inverses: &[SquareMatrix], lags: usize) -> Option<Vec<Information>> {
        let order = [self.own.as_slice(), &self.shared].concat();
        let sets = self.sets.iter().zip(solutions).zip(inverses);
        sets.map(|((set, solution), inverse)| {
            let leverage = |phi: &[f64]| {
                let of = |(row, left): (&[f64], &f64)| left * row.iter().zip(phi).map(|(a, b)| a * b).sum::<f64>();
                Some(inverse.rows().zip(phi).map(of).sum())
            };
            Some(set.scores(solution, lags, leverage)?.select(&order))
        })
        .collect()
    }

    fn identifiable(&self, elimination: &Elimination) -> Result<(), RegressionError> {
        let rows = elimination.columns().map(|(triangle, _)| triangle.tolerance()).fold(0.0, f64::max);
        let undetermined = elimination.undetermined(&[], rows);
        if undetermined.directions.is_empty() {
            return Ok(());
        }
        let unknowns = elimination.unknowns();
        let mut names = vec![""; unknowns];
        for set in 0..self.sets.len() {
            self.unknowns(set).iter().zip(P::NAMES).for_each(|(&unknown, &name)| names[unknown] = name);
        }
        let dense = |direction: &Vec<(usize, f64)>| {
            let mut vector = vec![0.0; unknowns];
            direction.iter().for_each(|&(unknown, part)| vector[unknown] = part);
            vector
        };
        let scale = |norm: f64| if norm > 0.0 { 1.0 / norm } else { 1.0 };
        let scales: Vec<f64> = elimination.column_norms().into_iter().map(scale).collect();
        let null = undetermined.directions.iter().map(dense).collect();
        Err(RegressionError::NotIdentifiable { directions: directions(null, &scales, |i| names[i]) })
    }
}

/// Condition number of columns scaled to unit norm, from the inverse of their sum of squares.
fn condition(inverse: &SquareMatrix, norms: &[f64]) -> f64 {
    let n = inverse.size();
    let eigenvalues = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * norms[i] * norms[j]).symmetric_eigenvalues();
    (eigenvalues.max() / eigenvalues.min()).sqrt()
}
