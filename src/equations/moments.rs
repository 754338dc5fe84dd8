//! [`MomentsOf`]: the moments of equations of a Gaussian state, as graphs.

use super::evaluate;
use super::slopes::Jacobian;
use crate::graph::{Graph, Id, Leaf};
use crate::moments::{Moments, entry};
use crate::scalar::Scalar;

/// The moments of some functions of a Gaussian state to the second order, as a graph of its mean and, as further states, its covariance.
#[derive(Clone, Debug)]
pub(crate) struct MomentsOf {
    pub graph: Graph,
    /// Means, then means of the slopes row by row, then the covariance by curvature, upper triangle row by row.
    pub roots: Vec<Id>,
    pub functions: usize,
}

/// Those of a model's functions.
#[derive(Clone, Debug)]
pub(crate) struct AllMoments {
    /// Of the derivatives, or the next states.
    pub state: MomentsOf,
    /// Of the outputs.
    pub output: MomentsOf,
    /// Of the states after a sample.
    pub jump: MomentsOf,
}

impl MomentsOf {
    pub fn of(graph: &Graph, roots: &[Id], n: usize) -> Self {
        let slopes = Jacobian::of(graph, roots, n);
        let curvature = Jacobian::of(&slopes.graph, &slopes.entries, n);
        let third = Jacobian::of(&curvature.graph, &curvature.entries, n);
        let mut sum = Sum { graph: Graph::default(), n };
        let values = sum.import(graph, roots);
        let [slopes, curvature, third] =
            [slopes, curvature, third].map(|Jacobian { graph, entries }| sum.import(&graph, &entries));
        // g + 1/2 sum_kl P_kl d2g/dx_k dx_l
        // Without states they have no entries.
        let of = |all: &[Id], i: usize| all[i * n * n..][..n * n].to_vec();
        let smoothed = |sum: &mut Sum, values: &[Id], second: &[Id]| -> Vec<Id> {
            (0..values.len()).map(|i| sum.smoothed(values[i], &of(second, i))).collect()
        };
        let means = smoothed(&mut sum, &values, &curvature);
        let slopes = smoothed(&mut sum, &slopes, &third);
        // 1/2 tr(H_r P H_s P)
        let turned: Vec<Vec<Id>> = (0..values.len()).map(|i| sum.times_covariance(&of(&curvature, i))).collect();
        let pairs = (0..turned.len()).flat_map(|r| (r..turned.len()).map(move |s| (r, s)));
        let spread = pairs.map(|(r, s)| sum.half_trace(&turned[r], &turned[s])).collect();
        let (graph, roots) = sum.graph.pruned(&[means, slopes, spread].concat());
        MomentsOf { graph, roots, functions: values.len() }
    }

    /// Moments from the values of the roots.
    pub fn moments<S: Scalar>(&self, mut found: Vec<S>) -> Moments<S> {
        let pairs = self.functions * (self.functions + 1) / 2;
        let spread = found.split_off(found.len() - pairs);
        let slopes = found.split_off(self.functions);
        Moments { mean: found, slopes, spread }
    }

    /// The moments at a time, inputs and parameters, of a state and the covariance after it.
    pub fn at<S: Scalar>(&self, t: S, carry: &[S], u: &[S], p: &[S]) -> Moments<S> {
        self.moments(evaluate(&self.graph, &self.roots, Some((t, carry, u)), p))
    }
}

/// A graph of sums of products with the covariance; terms that are zero for any state are left out.
struct Sum {
    graph: Graph,
    n: usize,
}

impl Sum {
    fn import(&mut self, other: &Graph, roots: &[Id]) -> Vec<Id> {
        self.graph.import(other, roots, |graph, leaf| graph.leaf(leaf))
    }

    fn is_zero(&self, id: Id) -> bool {
        self.graph.known(id) == Some(0.0)
    }

    fn covariance(&mut self, i: usize, j: usize) -> Id {
        let place = self.n + entry(self.n, i, j);
        self.graph.leaf(Leaf::State(u32::try_from(place).unwrap_or(u32::MAX)))
    }

    fn of_products(&mut self, pairs: impl Iterator<Item = (Id, Id)>) -> Option<Id> {
        pairs.fold(None, |sum, (a, b)| {
            if self.is_zero(a) || self.is_zero(b) {
                return sum;
            }
            let product = self.graph.mul(a, b);
            Some(sum.map_or(product, |sum| self.graph.add(sum, product)))
        })
    }

    fn smoothed(&mut self, value: Id, second: &[Id]) -> Id {
        let n = self.n;
        let pairs: Vec<(Id, Id)> = (0..n * n).map(|k| (second[k], self.covariance(k / n, k % n))).collect();
        let Some(sum) = self.of_products(pairs.into_iter()) else { return value };
        let half = self.graph.constant(0.5);
        let half = self.graph.mul(half, sum);
        self.graph.add(value, half)
    }

    /// `H P`.
    fn times_covariance(&mut self, h: &[Id]) -> Vec<Id> {
        let n = self.n;
        let zero = self.graph.constant(0.0);
        let mut product = Vec::with_capacity(n * n);
        for i in 0..n {
            for j in 0..n {
                let pairs: Vec<(Id, Id)> = (0..n).map(|k| (h[i * n + k], self.covariance(k, j))).collect();
                product.push(self.of_products(pairs.into_iter()).unwrap_or(zero));
            }
        }
        product
    }

    /// Half the trace of a product.
    fn half_trace(&mut self, a: &[Id], b: &[Id]) -> Id {
        let n = self.n;
        let pairs = (0..n * n).map(|k| (a[k], b[k % n * n + k / n]));
        let Some(sum) = self.of_products(pairs) else { return self.graph.constant(0.0) };
        let half = self.graph.constant(0.5);
        self.graph.mul(half, sum)
    }
}
