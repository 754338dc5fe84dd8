//! [`Kalman`]: one-step prediction of a linear plant with process noise.

use super::{Plant, Predictor};
use crate::error::Error;
use crate::integrate::Stuck;
use crate::layout::{Kind, Layout};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The Kalman filter of a model that is affine in its state (R. E. Kalman, Journal of Basic Engineering 82 (1960)
/// 35-45; for the likelihood F. C. Schweppe, IEEE Transactions on Information Theory 11 (1965) 61-70): each output is
/// predicted from all measurements before it, with its variance.
///
/// A model that is not affine in its state is refused by name ([`Error::NotAffine`]). One that cannot be read as a graph (closures in
/// [`Numeric`](crate::Numeric)) is tested by its values: at some samples of each record, at states of a thousandth to a thousand times the
/// largest measurement, and at far larger ones.
///
/// The noise is part of the model, [`Model::diffusion`](crate::Model::diffusion) and
/// [`Model::noise`](crate::Model::noise), so that noise levels are parameters like others. The state at the first
/// sample is what the fit takes it to be; its covariance is zero, because the fit estimates it or is given it.
///
/// The outputs of a sample are taken in one by one, which for independent measurement noises is the same as all at
/// once. The covariance is corrected in Joseph's form (R. S. Bucy, P. D. Joseph, *Filtering for Stochastic Processes with Applications to
/// Guidance*, 1968), a sum of squares: two sensors of one quantity whose noise is a part of 1e-9 of the process noise leave nine digits of
/// the likelihood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Kalman;

/// Where entry `(i, j)` of a symmetric matrix of `n` rows stands, its upper triangle row by row.
fn entry(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (2 * n - i + 1) / 2 + j - i
}

/// The length of a vector by which the column of an affine function is found: so large that its value at zero, which is subtracted, takes
/// no digits from the difference. A power of two, by which a number is multiplied without rounding.
pub(crate) const LONG: f64 = (1u64 << 60) as f64;

/// The columns of a function that is affine: what each unit vector adds to its value at zero.
fn columns<S: Scalar, E>(n: usize, m: usize, f: impl Fn(&[S], &mut [S]) -> Result<(), E>) -> Result<Vec<Vec<S>>, E> {
    let (zero, mut origin) = (vec![S::from(0.0); n], vec![S::from(0.0); m]);
    f(&zero, &mut origin)?;
    (0..n)
        .map(|j| {
            let (mut long, mut to) = (zero.clone(), origin.clone());
            long[j] = S::from(LONG);
            f(&long, &mut to)?;
            Ok(to.iter().zip(&origin).map(|(a, b)| (*a - *b) * LONG.recip()).collect())
        })
        .collect()
}

/// What the filter knows of an output before it is taken in.
struct Expected<S> {
    /// The output's row of slopes.
    c: Vec<S>,
    /// Covariance of the state times that row.
    gain: Vec<S>,
    /// Variance of the measurement noise.
    noise: S,
    /// Variance of the output.
    variance: S,
}

impl Kalman {
    fn expected<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> Expected<S> {
        let (n, outputs) = (plant.layout().states.len(), plant.layout().outputs.len());
        let at = |x: &[S], y: &mut [S]| {
            plant.output(x, y);
            Ok::<(), Stuck>(())
        };
        let c: Vec<S> = columns(n, outputs, at).unwrap_or_default().iter().map(|column| column[output]).collect();
        let covariance = &carry[n..];
        let times = |i: usize| (0..n).map(|j| covariance[entry(n, i, j)] * c[j]).sum::<S>();
        let gain: Vec<S> = (0..n).map(times).collect();
        let mut noise = vec![S::from(0.0); outputs];
        plant.noise(&mut noise);
        let noise = noise[output] * noise[output];
        let variance = gain.iter().zip(&c).map(|(g, c)| *g * *c).sum::<S>() + noise;
        Expected { c, gain, noise, variance }
    }
}

impl Predictor for Kalman {
    fn carry(&self, layout: &Layout) -> usize {
        let n = layout.states.len();
        n + n * (n + 1) / 2
    }

    fn predicts_variance(&self) -> bool {
        true
    }

    fn needs_affine(&self) -> bool {
        true
    }

    fn check(&self, layout: &Layout) -> Result<(), Error> {
        if layout.kind == Kind::Static {
            return Err(Error::Option("a static model has no state to filter; leave the predictor out".to_owned()));
        }
        Ok(())
    }

    fn start<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) {
        carry[plant.layout().states.len()..].fill(S::from(0.0));
    }

    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        (super::mean(plant, carry, output), self.expected(plant, carry, output).variance)
    }

    fn correct<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        let n = plant.layout().states.len();
        let Expected { c, gain, noise, variance } = self.expected(plant, carry, output);
        let part: Vec<S> = gain.iter().map(|gain| *gain / variance).collect();
        let (x, covariance) = carry.split_at_mut(n);
        x.iter_mut().zip(&part).for_each(|(x, part)| *x += *part * error);
        // (I - k c) P (I - k c)' + k r k'
        let rest = |i: usize, j: usize| {
            let taken = -(part[i] * c[j]);
            if i == j { taken + 1.0 } else { taken }
        };
        let rest: Vec<Vec<S>> = (0..n).map(|i| (0..n).map(|j| rest(i, j)).collect()).collect();
        let product = |i: usize, j: usize| (0..n).map(|l| rest[i][l] * covariance[entry(n, l, j)]).sum::<S>();
        let product: Vec<Vec<S>> = (0..n).map(|i| (0..n).map(|j| product(i, j)).collect()).collect();
        for i in 0..n {
            for j in i..n {
                let left = (0..n).map(|l| product[i][l] * rest[j][l]).sum::<S>();
                covariance[entry(n, i, j)] = left + part[i] * noise * part[j];
            }
        }
    }

    fn advance<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        let n = plant.layout().states.len();
        let mut noise = vec![S::from(0.0); n];
        plant.diffusion(&mut noise);
        if plant.layout().kind == Kind::Discrete {
            let a = columns(n, n, |x: &[S], to: &mut [S]| {
                to.copy_from_slice(x);
                plant.next(to)
            })?;
            let (x, covariance) = carry.split_at_mut(n);
            plant.next(x)?;
            let before = covariance.to_vec();
            for i in 0..n {
                for j in i..n {
                    let pairs = (0..n).flat_map(|k| (0..n).map(move |l| (k, l)));
                    let moved: S = pairs.map(|(k, l)| a[k][i] * before[entry(n, k, l)] * a[l][j]).sum();
                    covariance[entry(n, i, j)] = if i == j { moved + noise[i] * noise[i] } else { moved };
                }
            }
            return Ok(());
        }
        // dx/dt = f(x), dP/dt = A P + P A' + Q.
        plant.integrate(carry, &|position, z, to| {
            let (x, covariance) = z.split_at(n);
            plant.derivative(position, x, &mut to[..n]);
            let at = |x: &[S], to: &mut [S]| {
                plant.derivative(position, x, to);
                Ok::<(), Stuck>(())
            };
            let a = columns(n, n, at).unwrap_or_default();
            let flow = |i: usize, j: usize| (0..n).map(|k| a[k][i] * covariance[entry(n, k, j)]).sum::<S>();
            for i in 0..n {
                for j in i..n {
                    let moved = flow(i, j) + flow(j, i);
                    to[n + entry(n, i, j)] = if i == j { moved + noise[i] * noise[i] } else { moved };
                }
            }
        })
    }

    fn describe(&self) -> String {
        "one-step prediction by a Kalman filter".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::columns;

    /// A value at zero that is 1e13 times what a unit of the state adds takes no digit from it.
    #[test]
    fn columns_beside_a_large_offset() {
        let f = |x: &[f64], to: &mut [f64]| {
            to[0] = 0.1 * x[0] + 1e12;
            to[1] = 3.0 * x[1] - 2e-5 * x[0];
            Ok::<(), ()>(())
        };
        let found = columns(2, 2, f).unwrap();
        let expected = [[0.1, -2e-5], [0.0, 3.0]];
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() <= 1e-15 * expected.abs(), "{found} {expected}");
        }
    }
}
