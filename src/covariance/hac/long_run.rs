//! The long-run covariance of scores: prewhitened, summed over moving windows, and recolored.

use super::Sums;
use crate::information::Information;
use nalgebra::{Complex, DMatrix, DVector};

/// Largest singular value of the autoregression (Andrews and Monahan 1992, section 3).
const LARGEST: f64 = 0.97;
/// Longest window by the rule for long records.
const LONGEST: f64 = 500.0;
/// The long-run covariance of the scores of one experiment, times their number `n`.
pub(super) struct LongRun {
    /// The columns of the experiment's unknowns that are not held.
    pub kept: Vec<usize>,
    count: f64,
    /// Prewhitened scores that a moving sum takes.
    pub window: usize,
    /// From standardized scores `z` to scores `s = root' z`.
    root: DMatrix<f64>,
    /// Triangle of the moving sums: `sums' sums` is `n` times the long-run covariance of the prewhitened `z`.
    sums: DMatrix<f64>,
    /// `(I - a)^-1` for the autoregression `a`.
    recolor: DMatrix<f64>,
    /// Covariance of the prewhitened `z`.
    innovations: DMatrix<f64>,
}

/// What the products of the scores over time say of their prewhitening.
pub(super) struct Prewhitened {
    count: f64,
    pub window: usize,
    root: DMatrix<f64>,
    /// From scores to standardized ones.
    pub w: DMatrix<f64>,
    /// The autoregression of these.
    pub a: DMatrix<f64>,
    innovations: DMatrix<f64>,
}

impl Prewhitened {
    pub fn of(sums: &Sums) -> Option<Self> {
        let Sums { count, triangle, products, .. } = sums;
        let (n, length) = (triangle.columns(), *count as f64);
        // To scores of unit covariance: z = s w.
        let root = DMatrix::from_fn(n, n, |i, j| triangle.at(i, j)) / length.sqrt();
        let w = root.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let standard = |product: &DMatrix<f64>| w.transpose() * product * &w / length;
        let (one, two) = (standard(&products[0]), standard(&products[1]));
        // Scores of overflowing slopes; the decompositions do not end with them.
        if one.iter().chain(&two).any(|value| !value.is_finite()) {
            return None;
        }
        let a = stable(&one + bias(&one)? / length)?;
        let window = bandwidth(&one, &two, &a, *count);
        let innovations = DMatrix::identity(n, n) - &a * one.transpose() - &one * a.transpose() + &a * a.transpose();
        Some(Prewhitened { count: length, window, root, w, a, innovations })
    }

    /// With the triangle of the moving sums, and the scores that are independent of all others.
    pub fn run(&self, kept: Vec<usize>, mut sums: Information, alone: &[Vec<f64>]) -> Option<LongRun> {
        let Prewhitened { count, window, root, w, a, innovations } = self;
        let n = a.nrows();
        // Scores that sum to zero have moving sums that are smaller by their part of the record.
        let part = *window as f64 / count;
        let smaller = (1.0 - part + part * part / 3.0).sqrt();
        for score in alone {
            // The prewhitened row that recoloring and the division below turn back into the score.
            let row = (DMatrix::identity(n, n) - a) * w.transpose() * DVector::from_column_slice(score) * smaller;
            sums.absorb_row(row.as_slice(), 0.0);
        }
        let sums = DMatrix::from_fn(n, n, |i, j| sums.at(i, j)) / smaller;
        let recolor = (DMatrix::identity(n, n) - a).try_inverse()?;
        let finite = |m: &DMatrix<f64>| m.iter().all(|value| value.is_finite());
        let sound = finite(&sums) && finite(&recolor);
        let (root, innovations) = (root.clone(), innovations.clone());
        sound.then_some(LongRun { kept, count: *count, window: *window, root, sums, recolor, innovations })
    }
}

impl LongRun {
    /// Its rows among all columns of the experiment.
    pub fn triangle(&self, columns: usize) -> Information {
        let rows = &self.sums * self.recolor.transpose() * &self.root;
        let mut triangle = Information::new(columns);
        for i in 0..rows.nrows() {
            let mut row = vec![0.0; columns];
            self.kept.iter().enumerate().for_each(|(j, &c)| row[c] = rows[(i, j)]);
            triangle.absorb_row(&row, 0.0);
        }
        triangle
    }

    /// The variance of a combination of the scores, and the variance of this estimate of it: from the error of the
    /// autoregression, to first order, and from the moving sums (Bartlett's weights: 4/3 window/n, relative).
    pub fn variance(&self, contrast: &[f64]) -> (f64, f64) {
        let d = self.recolor.transpose() * (&self.root * DVector::from_column_slice(contrast));
        let spectrum = self.sums.transpose() * (&self.sums * &d);
        let variance = d.dot(&spectrum);
        let moved = &self.recolor * &spectrum;
        let autoregression = 4.0 * d.dot(&(&self.innovations * &d)) * moved.norm_squared() / self.count;
        let sums = 4.0 / 3.0 * self.window as f64 / self.count * variance * variance;
        (variance, autoregression + sums)
    }
}

/// By how much least squares underestimates an autoregression of standardized scores that sum to zero, times their
/// number (Nicholls and Pope, Australian J. Statistics 30A (1988) 296, theorem 2).
fn bias(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if a.is_empty() {
        return Some(a.clone());
    }
    let n = a.nrows();
    let a = stable(a.clone())?;
    let identity = DMatrix::<Complex<f64>>::identity(n, n);
    let t = a.transpose().map(Complex::from);
    let mut sum = (&identity - &t).try_inverse()? + &t * (&identity - &t * &t).try_inverse()?;
    for lambda in a.complex_eigenvalues().iter() {
        sum += (&identity - &t * *lambda).try_inverse()? * *lambda;
    }
    Some((DMatrix::identity(n, n) - &a * a.transpose()) * sum.map(|entry| entry.re))
}

/// The matrix with its singular values limited to those of a stable autoregression.
fn stable(a: DMatrix<f64>) -> Option<DMatrix<f64>> {
    if a.is_empty() {
        return Some(a);
    }
    // A decomposition of what is not finite would panic.
    if !a.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let mut svd = a.try_svd(true, true, f64::EPSILON, 1000)?;
    svd.singular_values.iter_mut().for_each(|value| *value = value.min(LARGEST));
    svd.recompose().ok()
}

/// How many prewhitened scores a moving sum takes, from the correlations of the standardized scores at lags one and
/// two, the autoregression `a` and the number of scores.
fn bandwidth(one: &DMatrix<f64>, two: &DMatrix<f64>, a: &DMatrix<f64>, count: usize) -> usize {
    let (n, length) = (a.nrows(), count as f64);
    // Covariances of the prewhitened scores at lags zero and one.
    let zero = DMatrix::identity(n, n) - a * one.transpose() - one * a.transpose() + a * a.transpose();
    let next = one - two * a.transpose() - a + a * one * a.transpose();
    let (mut above, mut below) = (0.0, 0.0);
    for i in 0..n {
        let variance = zero[(i, i)].max(0.0).powi(2);
        let rho = (next[(i, i)] / zero[(i, i)]).clamp(-LARGEST, LARGEST);
        if rho.is_finite() {
            above += 4.0 * rho * rho * variance / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
            below += variance / (1.0 - rho).powi(4);
        }
    }
    let andrews = if below > 0.0 { 1.1447 * (above / below * length).cbrt() } else { 0.0 };
    // Andrews' rule uses the correlation at lag one only; the rule of Lazarus, Lewis, Stock and Watson (J. Business and
    // Economic Statistics 36 (2018) 541) allows for what the autoregression leaves at longer lags, and what that costs, fewer
    // degrees of freedom, is counted.
    let longer = (1.3 * length.sqrt()).min(LONGEST);
    (andrews.max(longer).ceil() as usize + 1).clamp(1, (count / 2).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One series: `1 + 3 a` (Kendall, Biometrika 41 (1954) 403). Two alike: `1 + 2 a + 2 a`, by the eigenvalues' sum.
    #[test]
    fn bias_of_an_autoregression() {
        let one = bias(&DMatrix::from_element(1, 1, 0.5)).unwrap();
        assert!((one[(0, 0)] - 2.5).abs() < 1e-12, "{one}");
        let two = bias(&DMatrix::from_diagonal_element(2, 2, 0.5)).unwrap();
        assert!((two[(0, 0)] - 3.0).abs() < 1e-12 && two[(0, 1)].abs() < 1e-12, "{two}");
    }

    /// One series with autoregression `a` and a window of one sample: relative variances `4 (1 + a)/((1 - a) n)` by the
    /// autoregression and `4/(3 n)` by the sums.
    #[test]
    fn variance_of_the_variance() {
        let (a, n) = (0.9, 1000.0);
        let of = |value: f64| DMatrix::from_element(1, 1, value);
        let run = LongRun {
            kept: vec![0],
            count: n,
            window: 1,
            root: of(1.0),
            sums: of((n * (1.0 - a * a)).sqrt()),
            recolor: of(1.0 / (1.0 - a)),
            innovations: of(1.0 - a * a),
        };
        let (variance, spread) = run.variance(&[2.0]);
        assert!((variance / (4.0 * n * (1.0 + a) / (1.0 - a)) - 1.0).abs() < 1e-12, "{variance}");
        let expected = 4.0 * (1.0 + a) / ((1.0 - a) * n) + 4.0 / (3.0 * n);
        assert!((spread / (variance * variance) / expected - 1.0).abs() < 1e-12, "{spread}");
    }

    /// Andrews' rule for series that are autoregressions of order one after prewhitening (1991, eq. 6.4), with weights one: of
    /// one series `1.1447 (4 r^2 n / ((1 - r)^2 (1 + r)^2))^(1/3)`; of two by their variances. Where it gives less, the rule for
    /// longer lags; never more than half of the scores.
    #[test]
    fn bandwidth_by_hand() {
        let a = [0.3, -0.2];
        let (one, prewhitened) = ([0.5, 0.1], [0.9, 0.7]);
        let zero = |i: usize| 1.0 - 2.0 * a[i] * one[i] + a[i] * a[i];
        // The correlation at lag two that leaves these after prewhitening.
        let two = |i: usize| (one[i] - a[i] + a[i] * a[i] * one[i] - prewhitened[i] * zero(i)) / a[i];
        let diagonal =
            |of: &dyn Fn(usize) -> f64, n: usize| DMatrix::from_diagonal(&DVector::from_iterator(n, (0..n).map(of)));
        let window = |n: usize, count: usize| {
            bandwidth(&diagonal(&|i| one[i], n), &diagonal(&two, n), &diagonal(&|i| a[i], n), count)
        };
        let ratio = |r: f64| 4.0 * r * r / ((1.0 - r).powi(2) * (1.0 + r).powi(2));
        let rule = |alpha: f64, count: f64| (1.1447 * (alpha * count).cbrt()).ceil() as usize + 1;
        assert_eq!(window(1, 10_000_000), rule(ratio(0.9), 1e7));
        let weight = |i: usize| (zero(i) / (1.0 - prewhitened[i]).powi(2)).powi(2);
        let mean = (0..2).map(|i| ratio(prewhitened[i]) * weight(i)).sum::<f64>() / (weight(0) + weight(1));
        assert_eq!(window(2, 10_000_000), rule(mean, 1e7));
        assert_eq!(window(1, 10_000), 131);
        assert_eq!(window(1, 12), 6);
    }
}
