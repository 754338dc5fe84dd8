//! [`Crossing`]: the state and its covariance at the end of an interval.

use super::{Filter, Sensor, product};
use crate::moments::entry;
use crate::scalar::Scalar;

/// An interval of linear equations with constant coefficients, `dx = (A x + b) dt + dw`, as a [`Transition`](super::Transition) has it; row by row,
/// without the entries that are zero whatever the coefficients are.
pub(crate) struct Crossing<S> {
    pub n: usize,
    /// `e^{Ah}`.
    pub kept: Vec<Option<S>>,
    /// What a constant rate adds.
    pub constant: Vec<Option<S>>,
    /// What a rate adds that grows from zero.
    pub ramp: Vec<Option<S>>,
    /// What the noise adds to the covariance.
    pub covariance: Vec<Option<S>>,
}

impl<S: Scalar> Crossing<S> {
    fn times(&self, row: usize, entries: &[Option<S>], vector: &[S]) -> impl Iterator<Item = S> {
        let row = entries[row * self.n..][..self.n].iter().zip(vector);
        let products: Vec<S> = row.filter_map(|(entry, x)| entry.map(|entry| entry * *x)).collect();
        products.into_iter()
    }

    /// Replaces the state at the begin by that at the end. `rate(position, x, to)` writes `A x + b` at a fraction of the interval; `b` grows along it
    /// in proportion to time where inputs are `interpolated`, else it is constant.
    pub fn state(&self, x: &mut [S], interpolated: bool, rate: impl Fn(f64, &[S], &mut [S])) {
        let at = |position: f64| {
            let mut found = x.to_vec();
            rate(position, x, &mut found);
            found
        };
        let begin = at(0.0);
        let grown = interpolated.then(|| at(1.0));
        let change: Option<Vec<S>> =
            grown.map(|end| end.iter().zip(&begin).map(|(end, begin)| *end - *begin).collect());
        for (i, x) in x.iter_mut().enumerate() {
            let constant = self.times(i, &self.constant, &begin);
            let ramp = change.iter().flat_map(|change| self.times(i, &self.ramp, change));
            *x = constant.chain(ramp).fold(*x, |sum, term| sum + term);
        }
    }

    /// The covariance at the end, upper triangle row by row.
    pub fn spread(&self, covariance: &mut [S]) {
        let n = self.n;
        let column = |j: usize| (0..n).map(|k| covariance[entry(n, k, j)]).collect::<Vec<S>>();
        let columns: Vec<Vec<S>> = (0..n).map(column).collect();
        let moved = |i: usize, j: usize| self.times(i, &self.kept, &columns[j]).reduce(|sum, term| sum + term);
        let moved: Vec<Vec<Option<S>>> = (0..n).map(|i| (0..n).map(|j| moved(i, j)).collect()).collect();
        for i in 0..n {
            for j in i..n {
                let row = self.kept[j * n..][..n].iter().zip(&moved[i]);
                let terms = row.filter_map(|(entry, moved)| entry.zip(*moved)).map(|(entry, moved)| entry * moved);
                let sum = terms.chain(self.covariance[i * n + j]).reduce(|sum, term| sum + term);
                covariance[entry(n, i, j)] = sum.unwrap_or_else(|| S::from(0.0));
            }
        }
    }
}

impl<S: Scalar> Crossing<S> {
    /// The filter of the state by these measurements at the begin of each interval, after which samples change it by the slopes `jump`, if they do.
    pub fn filter(self, jump: &[S], sensors: Vec<Sensor<S>>) -> Filter<S> {
        let n = self.n;
        let all = |entries: Vec<Option<S>>| {
            entries.into_iter().map(|entry| entry.unwrap_or_else(|| S::from(0.0))).collect::<Vec<S>>()
        };
        let (kept, upper) = (all(self.kept), all(self.covariance));
        let added = (0..n * n).map(|at| upper[(at / n).min(at % n) * n + (at / n).max(at % n)]).collect();
        Filter { n, kept: if jump.is_empty() { kept } else { product(n, &kept, jump) }, added, sensors }
    }
}

impl Crossing<f64> {
    /// Whether the end is finite, and its covariance.
    pub fn is_finite(&self) -> bool {
        self.kept.iter().chain(&self.covariance).flatten().all(|number| number.is_finite())
    }

    /// Whether the end is the other's to this part of the terms that it is a sum of, whatever the units of the states; not where a number is none.
    pub fn is_near(&self, other: &Self, part: f64) -> bool {
        let n = self.n;
        let number = |of: &[Option<f64>], i: usize, j: usize| of[i * n + j].unwrap_or(0.0);
        let identity = |i: usize, j: usize| f64::from(u8::from(i == j));
        let added = |i: usize, j: usize| (number(&other.kept, i, j) - identity(i, j)).abs();
        let terms = |i: usize, j: usize| {
            let twice = (0..n).map(|k| added(i, k) * added(k, j)).sum::<f64>();
            identity(i, j) + added(i, j) + twice
        };
        let variance = |i: usize| number(&other.covariance, i, i);
        let is_close = |of: fn(&Self) -> &[Option<f64>], size: f64, i: usize, j: usize| {
            (number(of(self), i, j) - number(of(other), i, j)).abs() <= part * size
        };
        (0..n * n).all(|at| {
            let (i, j) = (at / n, at % n);
            let covariance = (variance(i) * variance(j)).sqrt();
            is_close(|of| &of.kept, terms(i, j), i, j) && is_close(|of| &of.covariance, covariance, i, j)
        })
    }
}
