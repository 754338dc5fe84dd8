//! Records as clusters: standard errors of what several records share, by what each record moves it by.
//!
//! Errors of one record may be correlated in any way, and records may differ in what the model takes as common; errors of different
//! records are independent. The covariance of the score is then the sum over the records of the squares of their scores (Liang and
//! Zeger, Biometrika 73 (1986) 13). At the minimum the scores are smaller than those of the truth by what each record took over; in the
//! coordinates where the curvature is one, a record with the part `H` of it has a score of variance `H - H^2` instead of `H`, and is
//! multiplied by `(I - H)^(-1/2)` (CR2: Bell and McCaffrey, Survey Methodology 28 (2002) 169). What each record has for itself is
//! minimized out before; of such unknowns this says nothing.

use crate::covariance::leverage::ALONE;
use crate::covariance::point::Point;
use crate::covariance::sandwich::Bread;
use crate::information::Information;
use crate::optimize::Linearization;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Numbers of an eigendecomposition of all records, above which none is made.
const MOST: usize = 100_000_000;

/// The standard errors, in coordinates, of unknowns that records share, and their degrees of freedom; `None` where fewer than two
/// records tell of one, or only one tells of it.
pub(crate) struct Clusters {
    pub records: usize,
    pub of: Vec<Option<Cluster>>,
}

/// What the scores of the records say of an unknown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    pub standard_error: f64,
    /// One less than the number of records, if all tell as much: the inverse of the sum of squares of their parts in the variance, less
    /// one.
    pub degrees: f64,
}

/// The triangle of a record over the unknowns that it shares with others and that are not held, all others minimized out.
fn shared(triangle: &Information, columns: &[usize], shared: usize, held: &[bool]) -> Information {
    let kept: Vec<usize> = (0..columns.len()).filter(|&c| !held[columns[c]]).collect();
    let own = kept.iter().filter(|&&c| columns[c] >= shared).count();
    triangle.select(&kept).eliminate(own)
}

/// `R' R` of a triangle.
fn curvature(triangle: &Information) -> DMatrix<f64> {
    let n = triangle.columns();
    let root = DMatrix::from_fn(n, n, |i, j| triangle.at(i, j));
    root.tr_mul(&root)
}

/// Curvature and score of a record.
type Part = (DMatrix<f64>, DVector<f64>);

/// Variances of some unknowns and their degrees of freedom, by the parts of the records and by what is known beside them (priors).
fn variances(parts: &[Part], beside: &DMatrix<f64>) -> Option<Vec<(f64, f64)>> {
    let n = beside.nrows();
    let whole = parts.iter().fold(beside.clone(), |sum, (curvature, _)| sum + curvature);
    let root: DMatrix<f64> = Cholesky::<f64, Dyn>::new(whole)?.l();
    let inverse = root.solve_lower_triangular(&DMatrix::identity(n, n))?;
    let standard = |matrix: &DMatrix<f64>| &inverse * matrix * inverse.transpose();
    let mut scatter = standard(beside);
    let mut shares = vec![0.0; n];
    for (curvature, score) in parts {
        let part = standard(curvature);
        if !part.iter().chain(score.iter()).all(|value| value.is_finite()) {
            return None;
        }
        let eigen = part.clone().try_symmetric_eigen(f64::EPSILON, 1000)?;
        let raised = eigen.eigenvalues.map(|h| (1.0 - h).max(ALONE).sqrt().recip());
        let moved =
            &eigen.eigenvectors * DMatrix::from_diagonal(&raised) * eigen.eigenvectors.tr_mul(&(&inverse * score));
        scatter += &moved * moved.transpose();
        for (i, share) in shares.iter_mut().enumerate() {
            let along = inverse.column(i);
            *share += ((&part * along).dot(&along) / along.norm_squared()).powi(2);
        }
    }
    let of = |i: usize| {
        let along = inverse.column(i);
        ((&scatter * along).dot(&along), shares[i].recip() - 1.0)
    };
    Some((0..n).map(of).collect())
}

/// What the scores of the records say, at a minimum of several that share unknowns.
pub(crate) fn clusters<'b>(point: &Point<'_>, bread: impl FnOnce() -> Option<&'b Bread>) -> Option<Clusters> {
    let Point { objective, linear, held_for_covariance: held, end, .. } = point;
    let unknowns = &objective.problem.unknowns;
    let (records, all) = (objective.experiments(), unknowns.shared());
    let free: Vec<usize> = (0..all).filter(|&i| !held[i]).collect();
    let n = free.len();
    if records < 2 || n == 0 || !end.outcome.converged() || n * n * n * records > MOST {
        return None;
    }
    let of = |linear: &Linearization| -> Vec<Information> {
        linear.columns().map(|(triangle, columns)| shared(triangle, columns, all, held)).collect()
    };
    let scores = of(linear);
    // The curvature of a robust loss is not that of its weights.
    let (bread, factor) = match objective.is_robust() {
        false => (None, 1.0),
        true => {
            let bread = bread()?;
            (Some(of(&bread.linear)), bread.curvature)
        }
    };
    let curvatures = bread.as_ref().unwrap_or(&scores).iter().map(|one| curvature(one) * factor);
    let score = |one: &Information| -DVector::from_vec(one.gradient());
    let mut parts: Vec<Part> = curvatures.zip(scores.iter().map(score)).collect();
    // Priors of what is shared stand in the first record's triangle, as measurements of unit variance.
    let mut beside = DMatrix::zeros(n, n);
    for (i, slope, error) in unknowns.priors(&end.coordinates) {
        let Some(c) = free.iter().position(|&one| one == i) else { continue };
        let (curvature, score) = &mut parts[0];
        curvature[(c, c)] -= slope * slope;
        score[c] -= slope * error;
        beside[(c, c)] += slope * slope;
    }
    let mut found = vec![None; held.len()];
    for (&i, (variance, degrees)) in free.iter().zip(variances(&parts, &beside)?) {
        let known = variance > 0.0 && variance.is_finite() && degrees >= 1.0;
        found[i] = known.then(|| Cluster { standard_error: variance.sqrt(), degrees });
    }
    Some(Clusters { records, of: found })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(curvature: f64, score: f64) -> Part {
        (DMatrix::from_element(1, 1, curvature), DVector::from_element(1, score))
    }

    /// Four records of one curvature, whose own values are 1, 2, 3 and 6 where all together give 3: the variance of a mean of four, 14/3 / 4,
    /// with three degrees of freedom.
    #[test]
    fn equal_records_are_a_sample() {
        let parts = [1.0, 2.0, 3.0, 6.0].map(|own| part(5.0, 5.0 * (own - 3.0)));
        let [(variance, degrees)] = variances(&parts, &DMatrix::zeros(1, 1)).unwrap()[..] else { panic!() };
        assert!((variance - 14.0 / 12.0).abs() < 1e-13 && (degrees - 3.0).abs() < 1e-12, "{variance} {degrees}");
    }

    /// Of unequal ones, scores of their own expected size, `h (1 - h)` times the curvature of all, give the variance of white errors, here
    /// with a prior of the tenth part: the inverse of the curvature.
    #[test]
    fn records_that_do_not_differ_have_the_variance_of_their_errors() {
        let shares: [f64; 4] = [0.5, 0.2, 0.15, 0.05];
        let parts = shares.map(|h| part(7.0 * h, (7.0 * h * (1.0 - h)).sqrt()));
        let found = variances(&parts, &DMatrix::from_element(1, 1, 0.7)).unwrap()[0];
        let squares: f64 = shares.iter().map(|h| h * h).sum();
        assert!((found.0 - 1.0 / 7.0).abs() < 1e-13 && (found.1 - (1.0 / squares - 1.0)).abs() < 1e-12, "{found:?}");
    }

    /// Two unknowns, each told by two records of its own: each has the variance of its two.
    #[test]
    fn unknowns_of_different_records_do_not_mix() {
        let of = |c: usize, score: f64| {
            let (mut curvature, mut scores) = (DMatrix::zeros(2, 2), DVector::zeros(2));
            (curvature[(c, c)], scores[c]) = (4.0, score);
            (curvature, scores)
        };
        let found = variances(&[of(0, 2.0), of(0, -2.0), of(1, 3.0), of(1, -3.0)], &DMatrix::zeros(2, 2)).unwrap();
        // (2^2 + 2^2) / (1 - 1/2) / 8^2 and 9/4 of it.
        assert!((found[0].0 - 0.25).abs() < 1e-14 && (found[1].0 - 0.5625).abs() < 1e-14, "{found:?}");
        assert!(found.iter().all(|(_, degrees)| (degrees - 1.0).abs() < 1e-12), "{found:?}");
    }
}
