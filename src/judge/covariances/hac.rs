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
mod scores;
mod stationary;

use crate::information::{Covariance, Information};
use crate::judge::covariances::sandwich::{Bread, Robust, of_scores};
use crate::judge::leverage::of_experiment;
use crate::judge::point::Point;
use crate::problem::Objective;
use joined::joined;
use nalgebra::{Complex, DMatrix, DVector};
use scores::{EachScore, Lagged, MovingSums};
use stationary::{ErrorSums, Errors, FilteredSlopes, Stationary};

/// Largest singular value of the autoregression (Andrews and Monahan 1992, section 3).
const LARGEST: f64 = 0.97;
/// Longest window by the rule for long records.
const LONGEST: f64 = 500.0;
/// Standard deviations by which a variance by moving sums must be above that of stationary errors to be taken instead.
const CERTAIN: f64 = 2.0;
/// The fewest degrees of freedom: Satterthwaite's rule knows none of less than a square of one normal number.
const FEWEST: f64 = 1.0;

/// The sandwich for autocorrelated errors, and over how many samples they are correlated beyond the autoregression.
pub(crate) struct Hac {
    covariance: Covariance,
    /// The same with the scores of stationary errors, if they have such.
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
        let Lagged { count, scores, products, .. } = scores.into;
        Sums { count, triangle: scores.triangle(), products, errors: errors.map(|errors| errors.into) }
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
        (Some(by), Some(moving)) => Some(Run::Long(by.run(frames[e].kept.clone(), &moving.into.triangle())?)),
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

/// The long-run covariance of the scores of one experiment, times their number `n`.
struct LongRun {
    /// The columns of the experiment's unknowns that are not held.
    kept: Vec<usize>,
    count: f64,
    /// Prewhitened scores that a moving sum takes.
    window: usize,
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
struct Prewhitened {
    count: f64,
    window: usize,
    root: DMatrix<f64>,
    /// From scores to standardized ones.
    w: DMatrix<f64>,
    /// The autoregression of these.
    a: DMatrix<f64>,
    innovations: DMatrix<f64>,
}

impl Prewhitened {
    fn of(sums: &Sums) -> Option<Self> {
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

    /// With the triangle of the moving sums.
    fn run(&self, kept: Vec<usize>, sums: &Information) -> Option<LongRun> {
        let Prewhitened { count, window, root, a, innovations, .. } = self;
        let n = a.nrows();
        // Scores that sum to zero have moving sums that are smaller by their part of the record.
        let part = *window as f64 / count;
        let sums = DMatrix::from_fn(n, n, |i, j| sums.at(i, j)) / (1.0 - part + part * part / 3.0).sqrt();
        let recolor = (DMatrix::identity(n, n) - a).try_inverse()?;
        let finite = |m: &DMatrix<f64>| m.iter().all(|value| value.is_finite());
        let sound = finite(&sums) && finite(&recolor);
        let (root, innovations) = (root.clone(), innovations.clone());
        sound.then_some(LongRun { kept, count: *count, window: *window, root, sums, recolor, innovations })
    }
}

impl LongRun {
    /// Its rows among all columns of the experiment.
    fn triangle(&self, columns: usize) -> Information {
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
    fn variance(&self, contrast: &[f64]) -> (f64, f64) {
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
