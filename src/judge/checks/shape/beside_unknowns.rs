//! A test of errors against regressors beside the unknowns.
//!
//! If all errors are of one size, the fit makes their products with a regressor smaller than those of the noise, and a test without slopes finds too little rather
//! than too much. If they are larger in one record than in the others, its noise moves the unknowns, and the predictions of the other records with them: by much,
//! compared with the small errors there. So each regressor is replaced by its part that is orthogonal to the slopes, and the variance of the products is
//! taken from the square of each error (a score test that allows for errors of any size: White, Econometrica 48 (1980) 817).

use crate::judge::evidence::Evidence;
use crate::problem::{Accumulate, Whitening};
use crate::residuals::powers::explained;
use crate::sweep::Window;
use crate::whiteness::chi_squared_tail;
use nalgebra::{DMatrix, DVector};

/// With more unknowns their inverse curvature is not written out.
const MOST: usize = 300;

/// A measurement and its error, in the unit of the output.
pub(super) struct Measured {
    pub experiment: usize,
    pub sample: usize,
    pub output: usize,
    pub error: f64,
}

/// The probability that the errors follow as much from the regressors by chance. `regressors` gives those of a measurement, `None` where all are zero. The
/// probability is zero, so that the test without slopes decides, with weights, a loss, a pre-filter, predicted variances, a full noise covariance, or more
/// than 300 unknowns.
pub(super) fn by_chance<const N: usize>(
    evidence: &Evidence<'_>,
    regressors: impl Fn(Measured) -> Option<[f64; N]> + Sync,
) -> f64 {
    let objective = evidence.point.objective;
    let all = objective.problem.unknowns.row.len();
    let Whitening::Diagonal(sigma) = &objective.whitening else { return 0.0 };
    if objective.needs_sandwich() || objective.sweep.predicts_variance() || all > MOST {
        return 0.0;
    }
    let Some(unit) = evidence.unit() else { return 0.0 };
    let make = |experiment: usize| {
        let columns = objective.problem.unknowns.columns(experiment).count();
        let gram = DMatrix::zeros(columns + N, columns + N);
        let (cross, row) = (DMatrix::zeros(columns, N), DVector::zeros(columns + N));
        Products { experiment, sigma, regressors: &regressors, cross, sums: row.clone(), gram, row }
    };
    let Ok(parts) = objective.gather(&evidence.point.end.coordinates, true, make) else { return 0.0 };
    let columns = |e: usize| objective.problem.unknowns.columns(e);
    let mut cross = DMatrix::<f64>::zeros(all, N);
    for part in &parts {
        for (own, i) in columns(part.experiment).enumerate() {
            (0..N).for_each(|z| cross[(i, z)] += part.cross[(own, z)]);
        }
    }
    let inverse = unit.dense(&(0..all).collect::<Vec<_>>());
    let explained_by = DMatrix::from_fn(all, N, |i, z| (0..all).map(|c| inverse[(i, c)] * cross[(c, z)]).sum::<f64>());
    let (mut variances, mut products) = ([[0.0; N]; N], [0.0; N]);
    for part in &parts {
        let of: Vec<usize> = columns(part.experiment).collect();
        let orthogonal = DMatrix::from_fn(of.len() + N, N, |row, z| match of.get(row) {
            Some(&i) => -explained_by[(i, z)],
            None => f64::from(u8::from(row == of.len() + z)),
        });
        let (own, sums) = (orthogonal.tr_mul(&part.gram) * &orthogonal, orthogonal.tr_mul(&part.sums));
        for i in 0..N {
            products[i] += sums[i];
            (0..N).for_each(|c| variances[i][c] += own[(i, c)]);
        }
    }
    let (gain, rank) = explained(variances, products);
    chi_squared_tail(gain, rank)
}

/// Sums over the measurements of an experiment, of slopes `g`, regressors `z` and errors `e`.
struct Products<'p, const N: usize, F> {
    experiment: usize,
    sigma: &'p [f64],
    regressors: &'p F,
    /// Of `g z'`.
    cross: DMatrix<f64>,
    /// Of `e (g, z)`.
    sums: DVector<f64>,
    /// Of `e^2 (g, z) (g, z)'`.
    gram: DMatrix<f64>,
    row: DVector<f64>,
}

impl<const N: usize, F: Fn(Measured) -> Option<[f64; N]> + Sync> Accumulate for Products<'_, N, F> {
    fn add(&mut self, window: &Window, lane: usize) {
        let columns = self.cross.nrows();
        for (k, j) in (0..window.samples[lane]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j))) {
            if !window.is_measured(k, j, lane) {
                continue;
            }
            let (standardized, sample) = (window.error(k, j, lane), window.begin[lane] + k);
            let error = standardized * self.sigma[j];
            let z = (self.regressors)(Measured { experiment: self.experiment, sample, output: j, error })
                .unwrap_or([0.0; N]);
            (0..columns).for_each(|c| self.row[c] = window.at(k, j, c, lane));
            z.iter().enumerate().for_each(|(i, z)| self.row[columns + i] = *z);
            for (i, z) in z.iter().enumerate().filter(|(_, z)| **z != 0.0) {
                (0..columns).for_each(|c| self.cross[(c, i)] += self.row[c] * z);
            }
            self.sums.axpy(standardized, &self.row, 1.0);
            self.gram.ger(standardized * standardized, &self.row, &self.row, 1.0);
        }
    }

    fn append(&mut self, later: Self) {
        self.cross += later.cross;
        self.sums += later.sums;
        self.gram += later.gram;
    }
}
