//! [`Regression`]: linear least squares from rows of named regressors.
//!
//! For models that are linear in their parameters, `y = phi . theta + error`: all at once, without start and without
//! iteration. The rows are kept, because standard errors that allow for correlation need the residuals in their order; the solution itself
//! comes from the [`Information`] triangle.

mod change;
mod error;
mod estimate;
mod pooled;

pub use change::Change;
pub use error::RegressionError;
pub use estimate::{Assumption, LinearEstimate};
pub use pooled::PooledRegression;

use crate::information::{Block, Information, SquareMatrix};
use crate::signals::{Of, Signals};

/// Rows that are absorbed together; they stay in the fast cache.
const BLOCK: usize = 256;

/// One less the leverage of a row that alone determines a parameter: its residual is zero but for rounding.
const ALONE: f64 = 1e-6;

/// Rows `(phi, y)` of a model that is linear in the parameters `P`.
///
/// ```
/// use greybox::{signals, regress::Regression};
/// signals! {
///     /// A coil: `u = r i + l di/dt`.
///     pub struct Coil { r: "ohm", l: "H" }
/// }
/// let mut regression = Regression::<Coil>::new();
/// for (i, slope, u) in [(1.0, 0.0, 2.01), (0.0, 10.0, 0.49), (2.0, 10.0, 4.52), (1.0, -10.0, 1.48)] {
///     regression.row(Coil { r: i, l: slope }, u);
/// }
/// let estimate = regression.solve()?;
/// assert!((estimate.parameters.r - 2.0).abs() < 0.02);
/// println!("{estimate}");
/// # Ok::<(), greybox::regress::RegressionError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Regression<P: Signals> {
    rows: Vec<Row<P>>,
    lags: Option<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Row<P: Signals> {
    regressor: Of<P, f64>,
    y: f64,
    weight: f64,
}

impl<P: Signals> Default for Regression<P> {
    fn default() -> Self {
        Regression { rows: Vec::new(), lags: None }
    }
}

impl<P: Signals> Regression<P> {
    /// Without a row yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds the row `y = regressor . parameters`; each regressor in the unit of `y` per unit of its parameter.
    pub fn row(&mut self, regressor: Of<P, f64>, y: f64) {
        self.weighted_row(regressor, y, 1.0);
    }

    /// Adds a row whose squared residual is multiplied by `weight >= 0`.
    ///
    /// A weight says what matters; it is not an inverse variance. Rows of a different known noise level are divided by it,
    /// regressor and `y` alike.
    pub fn weighted_row(&mut self, regressor: Of<P, f64>, y: f64, weight: f64) {
        self.rows.push(Row { regressor, y, weight });
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Says that residuals up to `lags` rows apart are correlated, as they are after a filter (a 100 Hz low-pass leaves
    /// them so over a few times `1 / (2 pi 100 Hz)`). Standard errors then count it; the parameters stay the same.
    /// Two rows per sample count twice.
    #[must_use]
    pub fn correlated(mut self, lags: usize) -> Self {
        self.lags = Some(lags);
        self
    }

    /// The residuals `y - regressor . parameters`, row by row, not weighted.
    pub fn residuals(&self, parameters: Of<P, f64>) -> impl Iterator<Item = f64> + '_ {
        let parameters = P::into_array(parameters);
        self.rows.iter().map(move |row| row.residual(parameters.as_ref()))
    }

    /// The information of the rows on the parameters: the triangle of `sqrt(weight) (phi, y)`.
    pub fn information(&self) -> Information {
        triangle::<P>(self.rows.iter().map(|row| {
            let root = row.weight.sqrt();
            (P::into_array(P::map(row.regressor, |phi| phi * root)), row.y * root)
        }))
    }

    /// The parameters with the least weighted sum of squared residuals, and how well they are known.
    ///
    /// Standard errors: from the residual variance if all weights are equal; otherwise by the sandwich that allows each
    /// row a variance of its own (White, Econometrica 48 (1980) 817; with residuals divided by one less their leverage,
    /// HC3 of MacKinnon and White, J. Econometrics 29 (1985) 305, without which it is too narrow for a few hundred rows);
    /// with [`correlated`](Self::correlated) rows also for their correlation (Newey and West, Econometrica 55 (1987) 703).
    ///
    /// # Errors
    /// An entry that is not finite, a negative weight, fewer rows than parameters and one more, or parameters that the
    /// rows do not determine, by name.
    pub fn solve(&self) -> Result<LinearEstimate<P>, RegressionError> {
        self.check()?;
        let (n, used) = (P::LEN, self.used());
        if used <= n {
            return Err(RegressionError::TooFewRows { rows: used, parameters: n });
        }
        let information = self.information();
        let condition = error::identifiable::<P>(&information)?;
        let solution = information.solve().map_err(|_| RegressionError::OutOfRange)?;

        let freedom = (used - n) as f64;
        let inverse = information.covariance().map_err(|_| RegressionError::OutOfRange)?;
        let assumption = self.assumption();
        let covariance = match assumption {
            Assumption::EqualVariance => scaled(&inverse, information.residual() / freedom),
            Assumption::OwnVariance => self.sandwich(&information, &solution, 0)?,
            Assumption::Correlated { lags } => self.sandwich(&information, &solution, lags)?,
        };
        let estimate = LinearEstimate {
            parameters: P::from_fn(|i| solution[i]),
            standard_errors: P::from_fn(|i| covariance[(i, i)].sqrt()),
            index: P::from_fn(|i| percent((information.residual() * inverse[(i, i)]).sqrt(), solution[i])),
            index_others_held: {
                let norms = information.column_norms();
                P::from_fn(|i| percent(information.residual().sqrt() / norms[i], solution[i]))
            },
            rms: self.rms(&solution),
            covariance,
            rows: used as u64,
            condition,
            assumption,
        };
        let known = |i: usize| solution[i].is_finite() && estimate.covariance[(i, i)].is_finite();
        if (0..n).all(known) { Ok(estimate) } else { Err(RegressionError::OutOfRange) }
    }

    // How many rows have a weight.
    fn used(&self) -> usize {
        self.rows.iter().filter(|row| row.weight > 0.0).count()
    }

    fn rms(&self, solution: &[f64]) -> f64 {
        let used = self.rows.iter().filter(|row| row.weight > 0.0);
        let squares: f64 = used.map(|row| row.residual(solution).powi(2)).sum();
        (squares / self.used() as f64).sqrt()
    }

    fn assumption(&self) -> Assumption {
        Assumption::of(self.lags, self.rows.iter().map(|row| row.weight))
    }

    fn sandwich(
        &self,
        information: &Information,
        solution: &[f64],
        lags: usize,
    ) -> Result<SquareMatrix, RegressionError> {
        let scores = self.scores(solution, lags, |phi| information.leverage(phi).ok());
        scores.and_then(|scores| information.sandwich(&scores).ok()).ok_or(RegressionError::OutOfRange)
    }

    // The triangle of the scores. `leverage` is that of a row of weight one.
    fn scores(&self, solution: &[f64], lags: usize, leverage: impl Fn(&[f64]) -> Option<f64>) -> Option<Information> {
        Some(moving_sums::<P>(&self.each_score(solution, leverage)?, lags))
    }

    // The score of each row that has a weight: its slopes times its residual, divided by one less its leverage.
    fn each_score(&self, solution: &[f64], leverage: impl Fn(&[f64]) -> Option<f64>) -> Option<Vec<P::Array<f64>>> {
        let used = self.rows.iter().filter(|row| row.weight > 0.0);
        used.map(|row| {
            let leverage = row.weight * leverage(P::into_array(row.regressor).as_ref())?;
            let score = row.weight * row.residual(solution) / (1.0 - leverage).max(ALONE);
            Some(P::into_array(P::map(row.regressor, |phi| phi * score)))
        })
        .collect()
    }

    fn check(&self) -> Result<(), RegressionError> {
        for (index, row) in self.rows.iter().enumerate() {
            let regressor = P::into_array(row.regressor);
            let named = P::NAMES.iter().copied().zip(regressor.as_ref().iter().copied());
            if let Some((name, value)) =
                named.chain([("y", row.y), ("weight", row.weight)]).find(|(_, value)| !value.is_finite())
            {
                return Err(RegressionError::NotFinite { row: index, name, value });
            }
            if row.weight < 0.0 {
                return Err(RegressionError::NegativeWeight { row: index, weight: row.weight });
            }
        }
        Ok(())
    }
}

impl<P: Signals> Row<P> {
    fn residual(&self, parameters: &[f64]) -> f64 {
        let regressor = P::into_array(self.regressor);
        self.y - regressor.as_ref().iter().zip(parameters).map(|(phi, theta)| phi * theta).sum::<f64>()
    }
}

// Newey and West's sum over lags with Bartlett's falling weights is the sum of squares of moving sums of `lags + 1` scores,
// which a triangle absorbs like any other rows; without lags it is White's.
fn moving_sums<P: Signals>(scores: &[P::Array<f64>], lags: usize) -> Information {
    let (rows, window) = (scores.len(), lags.min(scores.len()) + 1);
    let share = (window as f64).sqrt().recip();
    let mut sums = P::array_from_fn(|_| 0.0);
    triangle::<P>((0..rows + window - 1).map(|t| {
        for (i, sum) in sums.as_mut().iter_mut().enumerate() {
            *sum += if t < rows { scores[t].as_ref()[i] } else { 0.0 };
            *sum -= if t >= window { scores[t - window].as_ref()[i] } else { 0.0 };
        }
        (P::array_from_fn(|i| sums.as_ref()[i] * share), 0.0)
    }))
}

fn triangle<P: Signals>(rows: impl Iterator<Item = (P::Array<f64>, f64)>) -> Information {
    let mut information = Information::new(P::LEN);
    let mut block = Block::new(P::LEN, BLOCK);
    for (phi, y) in rows {
        information.gather(&mut block, phi.as_ref(), y);
    }
    information.absorb(&mut block);
    information
}

fn scaled(matrix: &SquareMatrix, factor: f64) -> SquareMatrix {
    SquareMatrix::from_fn(matrix.size(), |i, j| matrix[(i, j)] * factor)
}

// A change in percent of a value; no change is no percent even of zero.
fn percent(change: f64, value: f64) -> f64 {
    if change == 0.0 { 0.0 } else { 100.0 * change / value.abs() }
}
