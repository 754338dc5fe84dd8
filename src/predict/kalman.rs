//! [`Kalman`]: one-step prediction of a plant with process noise.

use super::{Plant, Predictor};
use crate::error::Error;
use crate::integrate::Stuck;
use crate::layout::{Kind, Layout};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The Kalman filter (R. E. Kalman, Journal of Basic Engineering 82 (1960) 35-45; for the likelihood F. C. Schweppe, IEEE Transactions on
/// Information Theory 11 (1965) 61-70): each output is predicted from all measurements before it, with its variance. Right where the plant
/// is disturbed between the samples: wind, load, sun, a friction that the model lacks.
///
/// Mean `x` and covariance `P` of the state are exact for a model that is affine in its state. For others it is the extended filter: they
/// follow the model and its slopes to the first order (A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 9.3),
///
/// ```text
/// dx/dt = f(x)        dP/dt = A P + P A' + Q        A = df/dx at x
/// ```
///
/// by the steps of the fit's integrator, and an output is linearized at the state that the outputs before it have corrected. That is right
/// where the state's standard deviation is short against the model's curvature, as it is with measurements that are frequent and precise
/// against the disturbance. `A` is found by differentiating the model's graph, so that gradients of the likelihood are exact. A model that
/// cannot be read as a graph (closures in [`Numeric`](crate::Numeric)) has to be affine, and is refused by the name of the equation that is
/// not ([`Error::NotAffine`]): it is tested by its values at some samples of each record, at states of a thousandth to a thousand times the
/// largest measurement, and at far larger ones.
///
/// The noise is part of the model, [`Model::diffusion`](crate::Model::diffusion) and
/// [`Model::noise`](crate::Model::noise), so that noise levels are parameters like others. The state at the first
/// sample is what the fit takes it to be; its covariance is zero, because the fit estimates it or is given it. Without diffusion the
/// filter predicts what a simulation does.
///
/// The outputs of a sample are taken in one by one, which for independent measurement noises is the same as all at
/// once. The covariance is corrected in Joseph's form (R. S. Bucy, P. D. Joseph, *Filtering for Stochastic Processes with Applications to
/// Guidance*, 1968), a sum of squares: two sensors of one quantity whose noise is a part of 1e-9 of the process noise leave nine digits of
/// the likelihood.
///
/// A level of noise is found by its logarithm (`free(0.1).log()`); start the diffusion large rather than small: a filter that trusts a wrong
/// start of the model has nothing to correct it by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Kalman;

/// Where entry `(i, j)` of a symmetric matrix of `n` rows stands, its upper triangle row by row.
fn entry(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (2 * n - i + 1) / 2 + j - i
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
        let mut slopes = vec![S::from(0.0); outputs * n];
        plant.output_slopes(&carry[..n], &mut slopes);
        let c = slopes[output * n..][..n].to_vec();
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

    fn needs_slopes(&self) -> bool {
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
            let (x, covariance) = carry.split_at_mut(n);
            let mut a = vec![S::from(0.0); n * n];
            plant.state_slopes(0.0, x, &mut a);
            plant.next(x)?;
            let before = covariance.to_vec();
            for i in 0..n {
                for j in i..n {
                    let pairs = (0..n).flat_map(|k| (0..n).map(move |l| (k, l)));
                    let moved: S = pairs.map(|(k, l)| a[i * n + k] * before[entry(n, k, l)] * a[j * n + l]).sum();
                    covariance[entry(n, i, j)] = if i == j { moved + noise[i] * noise[i] } else { moved };
                }
            }
            return Ok(());
        }
        // dx/dt = f(x), dP/dt = A P + P A' + Q.
        plant.integrate(carry, &|position, z, to| {
            let (x, covariance) = z.split_at(n);
            let mut a = vec![S::from(0.0); n * n];
            plant.derivative(position, x, &mut to[..n]);
            plant.state_slopes(position, x, &mut a);
            let flow = |i: usize, j: usize| (0..n).map(|k| a[i * n + k] * covariance[entry(n, k, j)]).sum::<S>();
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
