//! [`Change`]: by how much parameters differ between two sets of rows whose residuals repeat.

use super::{Regression, RegressionError, moving_sums};
use crate::information::SquareMatrix;
use crate::signals::{Of, Signals};

/// By how much parameters changed from one regression to another, see [`Regression::change`].
#[derive(Clone, Debug)]
pub struct Change<P: Signals> {
    /// The later parameters less the earlier ones, each in its unit.
    pub parameters: Of<P, f64>,
    /// Standard errors of these differences, in the same units.
    pub standard_errors: Of<P, f64>,
    /// Covariance of the differences, in the order of the parameters' declaration.
    pub covariance: SquareMatrix,
}

impl<P: Signals> Regression<P> {
    /// By how much the parameters changed from these rows to `later`, row by row the same experiment, such as one motion made
    /// cold and warm.
    ///
    /// Errors of the model then repeat: the residuals of the two rows of a pair are correlated, and their effect on the
    /// parameters cancels in the difference. The two influences on the parameters, `(sum phi phi^T)^-1 phi residual`, are
    /// subtracted pair by pair, and the covariance is the sum of the products of these differences: each of its own variance
    /// and, with [`correlated`](Self::correlated) rows, over as many lags, as in [`solve`](Self::solve). If nothing repeats,
    /// this is the sum of the two covariances, but for chance. A bias of the parameters is not part of it.
    ///
    /// ```
    /// use greybox::{signals, regress::Regression};
    /// signals! {
    ///     /// A resistor.
    ///     pub struct Resistor { r: "ohm" }
    /// }
    /// // The errors of the model are the same in both records, and a hundred times the noise.
    /// let record = |r: f64, noise: f64| {
    ///     let mut rows = Regression::<Resistor>::new();
    ///     for k in 0..100 {
    ///         let (i, k) = (1.0 + (0.3 * k as f64).sin(), k as f64);
    ///         rows.row(Resistor { r: i }, r * i + 0.1 * (2.0 * k).sin() + 0.001 * (noise * k).cos());
    ///     }
    ///     rows
    /// };
    /// let (cold, warm) = (record(1.0, 1.0), record(1.1, 3.0));
    /// let change = cold.change(&warm)?;
    /// assert!((change.parameters.r - 0.1).abs() < 3.0 * change.standard_errors.r);
    /// assert!(change.standard_errors.r < 0.02 * cold.solve()?.standard_errors.r);
    /// # Ok::<(), greybox::regress::RegressionError>(())
    /// ```
    ///
    /// # Errors
    /// As [`solve`](Self::solve) for either; sets of rows that do not go together, by their number or by which of them have a
    /// weight.
    pub fn change(&self, later: &Regression<P>) -> Result<Change<P>, RegressionError> {
        let weighted = |rows: &Self| rows.rows.iter().map(|row| row.weight > 0.0).collect::<Vec<_>>();
        let (before, after) = (self.solve()?, later.solve()?);
        if weighted(self) != weighted(later) {
            return Err(RegressionError::NotPaired { rows: self.used(), later: later.used() });
        }
        let out_of_range = || RegressionError::OutOfRange;
        let from = self.influences(P::into_array(before.parameters).as_ref()).ok_or_else(out_of_range)?;
        let to = later.influences(P::into_array(after.parameters).as_ref()).ok_or_else(out_of_range)?;
        let less =
            |(to, from): (&P::Array<f64>, &P::Array<f64>)| P::array_from_fn(|i| to.as_ref()[i] - from.as_ref()[i]);
        let differences: Vec<P::Array<f64>> = to.iter().zip(&from).map(less).collect();
        let sums = moving_sums::<P>(&differences, self.lags.max(later.lags).unwrap_or(0));
        let product = |i: usize, j: usize| (0..=i.min(j)).map(|k| sums.at(k, i) * sums.at(k, j)).sum();
        let covariance = SquareMatrix::from_fn(P::LEN, product);
        let (before, after) = (P::into_array(before.parameters), P::into_array(after.parameters));
        Ok(Change {
            parameters: P::from_fn(|i| after.as_ref()[i] - before.as_ref()[i]),
            standard_errors: P::from_fn(|i| covariance[(i, i)].sqrt()),
            covariance,
        })
    }

    // By how much the error of each row that has a weight moves the parameters.
    fn influences(&self, solution: &[f64]) -> Option<Vec<P::Array<f64>>> {
        let information = self.information();
        let inverse = information.covariance().ok()?;
        let form = |phi: &[f64]| -> f64 { inverse.rows().zip(phi).map(|(row, left)| left * dot(row, phi)).sum() };
        let mut scores = self.each_score(solution, |phi| Some(form(phi)))?;
        for score in &mut scores {
            *score = P::array_from_fn(|i| inverse.rows().nth(i).map_or(0.0, |row| dot(row, score.as_ref())));
        }
        Some(scores)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
