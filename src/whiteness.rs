//! Whether errors are white: autocorrelations gathered run by run, and portmanteau tests.

use crate::wide::{self, Task, Wide, Width};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Running sums of products of a sequence with its own past, which need no memory but that of the longest lag.
#[derive(Clone, Debug)]
pub(crate) struct Autocorrelation {
    /// Sum of `e[t] e[t - k]` for `k = 0..=lags`, and of the squares of these products.
    sums: Vec<f64>,
    squares: Vec<f64>,
    /// The first values.
    first: Vec<f64>,
    /// The last values, then those of the run at hand.
    values: Vec<f64>,
}

impl Autocorrelation {
    pub fn new(lags: usize) -> Self {
        let mut values = Vec::with_capacity(lags + RUN + LAGS);
        values.resize(lags, 0.0);
        let [sums, squares] = [vec![0.0; lags + 1], vec![0.0; lags + 1]];
        Autocorrelation { sums, squares, first: Vec::with_capacity(lags), values }
    }

    /// The next values in order of time, zero where missing.
    pub fn add(&mut self, run: &[f64]) {
        let lags = self.sums.len() - 1;
        let missing = (lags - self.first.len()).min(run.len());
        self.first.extend_from_slice(&run[..missing]);
        self.values.extend_from_slice(run);
        self.values.resize(lags + run.len() + LAGS, 0.0);
        let Autocorrelation { sums, squares, values, .. } = self;
        wide::run(Width::widest(), Products { run, values, sums, squares });
        self.values.truncate(lags + run.len());
        self.values.drain(..run.len());
    }

    /// As if the values of the other had followed.
    pub fn follow(&mut self, next: &Autocorrelation) {
        let lags = self.sums.len() - 1;
        for (j, e) in next.first.iter().enumerate() {
            // From the lag that reaches the last value of these.
            let sums = self.sums[j + 1..].iter_mut().zip(&mut self.squares[j + 1..]);
            for ((sum, square), before) in sums.zip(self.values[j..lags].iter().rev()) {
                let product = e * before;
                *sum += product;
                *square += product * product;
            }
        }
        self.append(next);
        let missing = (lags - self.first.len()).min(next.first.len());
        self.first.extend_from_slice(&next.first[..missing]);
        self.values.extend_from_slice(&next.values[lags - next.first.len()..]);
        self.values.drain(..next.first.len());
    }

    /// Sums of products at lags `0, 1, ...`.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Adds the sums of another record.
    pub fn append(&mut self, other: &Autocorrelation) {
        self.sums.iter_mut().zip(&other.sums).for_each(|(sum, other)| *sum += other);
        self.squares.iter_mut().zip(&other.squares).for_each(|(sum, other)| *sum += other);
    }
}

/// A portmanteau test of errors whose size may change from sample to sample.
///
/// At each lag the sum of products `e[t] e[t - k]` is divided by the root of the sum of their squares, which is its
/// standard deviation where the errors are uncorrelated, whatever their variances (Dalla, Giraitis and Phillips,
/// Econometric Theory 38 (2022) 595, section 2). Where the variances are equal, it is the test of Box and Pierce.
///
/// A few large errors can decide these sums; the signs of neighbors weigh all errors alike.
#[derive(Clone, Debug)]
pub(crate) struct Portmanteau {
    errors: Autocorrelation,
    neighbors: Neighbors,
}

/// How often errors agree in sign with the one before.
#[derive(Clone, Copy, Debug, Default)]
struct Neighbors {
    /// Errors that are not zero, pairs of such, and pairs of equal sign less those of different sign.
    errors: i64,
    pairs: i64,
    agreements: i64,
    /// The signs of the first error and of the last.
    first: Option<i64>,
    last: i64,
}

impl Neighbors {
    fn add(&mut self, run: &[f64]) {
        let sign = |e: &f64| i8::from(*e > 0.0) - i8::from(*e < 0.0);
        let Some(first) = run.first() else { return };
        self.first.get_or_insert(sign(first).into());
        for run in run.chunks(RUN) {
            // The sign before the run, and those of the run: sums over neighbors are then free of any order.
            let mut signs = [0i8; RUN + 1];
            signs[0] = self.last as i8;
            signs[1..].iter_mut().zip(run).for_each(|(to, e)| *to = sign(e));
            let (mut errors, mut pairs, mut agreements) = (0i32, 0i32, 0i32);
            for (here, before) in signs[1..].iter().zip(&signs) {
                let product = i32::from(here * before);
                errors += i32::from(here * here);
                pairs += product * product;
                agreements += product;
            }
            self.errors += i64::from(errors);
            self.pairs += i64::from(pairs);
            self.agreements += i64::from(agreements);
            self.last = signs[run.len()].into();
        }
    }

    /// As if the errors of the other had followed.
    fn follow(&mut self, next: &Neighbors) {
        let Some(first) = next.first else { return };
        self.first.get_or_insert(first);
        self.pairs += (first * self.last).abs();
        self.agreements += first * self.last;
        self.append(next);
        self.last = next.last;
    }

    /// Adds the counts of another record.
    fn append(&mut self, other: &Neighbors) {
        (self.errors, self.pairs) = (self.errors + other.errors, self.pairs + other.pairs);
        self.agreements += other.agreements;
    }
}

impl Portmanteau {
    pub fn new(lags: usize) -> Self {
        Portmanteau { errors: Autocorrelation::new(lags), neighbors: Neighbors::default() }
    }

    /// The next errors in order of time, zero where missing.
    pub fn add(&mut self, run: &[f64]) {
        self.errors.add(run);
        self.neighbors.add(run);
    }

    /// As if the errors of the other had followed.
    pub fn follow(&mut self, next: &Portmanteau) {
        self.errors.follow(&next.errors);
        self.neighbors.follow(&next.neighbors);
    }

    /// These sums with the autocorrelation at each lag reduced in size by this much, to zero at least.
    pub fn without(mut self, correlation: f64) -> Self {
        let sums = &mut self.errors.sums;
        let part = correlation * sums[0];
        sums[1..].iter_mut().for_each(|sum| *sum = sum.signum() * (sum.abs() - part).max(0.0));
        self
    }

    /// Adds the sums of another record.
    pub fn append(&mut self, other: &Portmanteau) {
        self.errors.append(&other.errors);
        self.neighbors.append(&other.neighbors);
    }

    /// The sum of products at a lag over its standard deviation without correlation, and the autocorrelation.
    pub fn at(&self, lag: usize) -> (f64, f64) {
        let (sum, squares) = (self.errors.sums[lag], self.errors.squares[lag]);
        let over = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        (over(sum, squares.sqrt()), over(sum, self.errors.sums[0]))
    }

    /// The probability that errors without correlation show as much of it at lags `1..=lags`.
    ///
    /// The squares of the standardized sums have a mean of one each, but those of two lags are correlated: errors at `t`, `t - k`,
    /// `t - l` and `t - k - l` make two products of either lag, so that their covariance is 4 over the number of errors. With 20 lags
    /// of 80 errors the sum's variance is half as large again as that of chi squared, and 1e-3 would be said where 6e-3 is true. A
    /// multiple of Fisher's F with the same mean and variance is near in the tail, too: within a factor of two down to 1e-4. With three
    /// lags this is made up for by the lighter tails of each sum, and chi squared is as near.
    pub fn p_value(&self, lags: usize) -> f64 {
        let sums = self.errors.sums.iter().zip(&self.errors.squares).skip(1).take(lags);
        let terms: Vec<f64> = sums.filter(|(_, squares)| **squares > 0.0).map(|(sum, q)| sum * sum / q).collect();
        let (statistic, lags) = (terms.iter().sum::<f64>(), terms.len() as f64);
        let more = 4.0 * (lags - 1.0) / self.deciding(terms.len());
        let degrees = (2.0 * lags + 4.0 + 4.0 * more) / more;
        let ratio = statistic / lags * degrees / (degrees - 2.0);
        // Sums of huge errors overflow.
        if terms.len() > FEW && degrees < CHI_SQUARED && ratio.is_finite() {
            return FisherSnedecor::new(lags, degrees).map_or(1.0, |distribution| distribution.sf(ratio));
        }
        chi_squared_tail(statistic, lags)
    }

    /// The effective number of errors: so many of equal variance would give sums at two lags the covariance that these have. That follows
    /// from eighth moments; it is approximated by `n r^2` with `r = mean(e^2)^2 / mean(e[t]^2 e[t - k]^2)`, one where variances are equal.
    fn deciding(&self, lags: usize) -> f64 {
        let errors = self.neighbors.errors as f64;
        let squares = self.errors.squares.iter().skip(1).take(lags);
        let mean = squares.zip(1..).map(|(square, lag)| square / (errors - f64::from(lag)).max(1.0)).sum::<f64>();
        let part = (self.errors.sums[0] / errors).powi(2) * lags as f64 / mean;
        errors * part.min(1.0).powi(2)
    }

    /// The probability that errors without correlation agree, or disagree, as often in sign with the error before, or that
    /// they have as large a correlation with it: the larger of both. Where noise changes much in size, signs alone show what
    /// an estimate is off by where there is little noise.
    pub fn neighbors_p_value(&self) -> f64 {
        let Neighbors { errors, pairs, agreements, .. } = self.neighbors;
        let tail = |square: f64| chi_squared_tail(square, 1.0);
        let signs = if pairs > 0 { tail((agreements as f64).powi(2) / pairs as f64) } else { 1.0 };
        signs.max(tail(errors as f64 * self.at(1).1.powi(2)))
    }
}

/// Up to so many lags the portmanteau statistic is compared with chi squared.
pub(crate) const FEW: usize = 3;
/// Degrees of freedom of the denominator from which on F is taken as chi squared.
const CHI_SQUARED: f64 = 1e6;
/// Values of a run that need no more memory; those of a window.
const RUN: usize = 64;
/// Lags whose sums are kept in registers together.
const LAGS: usize = 24;

/// Adds the products of a run with itself and with what came before, and their squares, to the sums of all lags.
struct Products<'p> {
    run: &'p [f64],
    /// As many values as there are lags, then those of the run, then [`LAGS`] zeros.
    values: &'p [f64],
    sums: &'p mut [f64],
    squares: &'p mut [f64],
}

impl Task for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let registers = LAGS / W::LANES;
        // The longest lag comes first: its values are the earliest.
        let blocks = self.sums.rchunks_mut(LAGS).zip(self.squares.rchunks_mut(LAGS));
        for (block, (sums, squares)) in blocks.enumerate() {
            let values = &self.values[block * LAGS..];
            let mut totals = [[W::splat(0.0); LAGS]; 2];
            for (e, before) in self.run.iter().zip(values.windows(LAGS)) {
                let e = W::splat(*e);
                let mut at = 0;
                while at < registers {
                    let product = e.mul(W::load(&before[at * W::LANES..]));
                    totals[0][at] = totals[0][at].add(product);
                    totals[1][at] = product.mul_add(product, totals[1][at]);
                    at += 1;
                }
            }
            for (totals, sums) in totals.iter().zip([sums, squares]) {
                let mut numbers = [0.0; LAGS];
                totals.iter().zip(numbers.chunks_exact_mut(W::LANES)).for_each(|(total, to)| total.store(to));
                sums.iter_mut().rev().zip(numbers).for_each(|(sum, total)| *sum += total);
            }
        }
    }
}

/// Statistic and p-value of Ljung and Box (Biometrika 65 (1978) 297) for the autocorrelations at lags `1, 2, ...` of
/// `count` values: the probability that white noise shows as much.
pub(crate) fn ljung_box(coefficients: &[f64], count: u64) -> (f64, f64) {
    let n = count as f64;
    let lags = coefficients.len().min(count.saturating_sub(1) as usize);
    let term = |(k, rho): (usize, &f64)| rho * rho / (n - (k + 1) as f64);
    let statistic = n * (n + 2.0) * coefficients[..lags].iter().enumerate().map(term).sum::<f64>();
    (statistic, chi_squared_tail(statistic, lags as f64))
}

/// Probability that chi squared with so many degrees of freedom is larger.
pub(crate) fn chi_squared_tail(statistic: f64, degrees: f64) -> f64 {
    ChiSquared::new(degrees).map_or(1.0, |distribution| distribution.sf(statistic.max(0.0)))
}

/// Levinson and Durbin's recursion: of each order in turn, the coefficients `a` of the autoregression
/// `e[t] = sum over k of a[k] e[t - 1 - k]` and the variance of its innovations relative to that of the errors, from the
/// autocorrelations at lags `1, 2, ...` (Durbin, Review of the International Statistical Institute 28 (1960) 233). Ends before
/// the first order that is not stationary.
pub(crate) fn levinson_durbin(correlations: &[f64], mut order: impl FnMut(&[f64], f64)) {
    let (mut variance, mut a) = (1.0, Vec::with_capacity(correlations.len()));
    for (k, rho) in correlations.iter().enumerate() {
        let known: f64 = a.iter().zip(correlations[..k].iter().rev()).map(|(a, rho): (&f64, _)| a * rho).sum();
        let reflection = (rho - known) / variance;
        if reflection.is_nan() || reflection.abs() >= 1.0 {
            return;
        }
        // From both ends at once: each coefficient less the reflection times the one at its mirrored place.
        for i in 0..k.div_ceil(2) {
            let (first, last) = (a[i], a[k - 1 - i]);
            (a[i], a[k - 1 - i]) = (first - reflection * last, last - reflection * first);
        }
        a.push(reflection);
        variance *= 1.0 - reflection * reflection;
        order(&a, variance);
    }
}

/// Sum of products over the shorter, in accumulators that the compiler may keep in vector lanes.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let mut sums = [0.0; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest = a.chunks_exact(8).remainder().iter().zip(b.chunks_exact(8).remainder());
    sums.iter().sum::<f64>() + rest.map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests;
