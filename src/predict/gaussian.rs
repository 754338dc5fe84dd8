//! The filter of a state that is taken as Gaussian, by the moments of the model's functions: what [`Kalman`](super::Kalman) and
//! [`SecondOrder`](super::SecondOrder) share.

use super::plant::identity;
use super::{InitialCovariance, Moments, Plant, Predictor, StartsFrom, Unstable};
use crate::error::Error;
use crate::integrate::Stuck;
use crate::layout::{Kind, Layout};
use crate::moments::entry;
use crate::scalar::Scalar;
use core::fmt::Debug;

/// How a filter finds the moments of the model's functions, from a state and the covariance after it.
pub trait Order: 'static {
    /// Of the derivative at a fraction of the interval, or of the next state.
    fn state<S: Scalar>(plant: &dyn Plant<S>, position: f64, carry: &[S]) -> Moments<S>;

    /// Of the state after the sample.
    fn jump<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S>;

    /// Of the outputs.
    fn outputs<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S>;
}

/// What the filter knows of an output before it is taken in.
struct Expected<S> {
    mean: S,
    /// The output's row of slopes.
    c: Vec<S>,
    /// Covariance of the state times that row.
    gain: Vec<S>,
    /// Variance of the measurement noise, and what the output's curvature adds.
    noise: S,
    /// Variance of the output.
    variance: S,
}

fn expected<O: Order, S: Scalar>(plant: &dyn Plant<S>, carry: &[S], output: usize) -> Expected<S> {
    let (n, outputs) = (plant.layout().states.len(), plant.layout().outputs.len());
    let Moments { mean, slopes, spread } = O::outputs(plant, carry);
    let c = slopes[output * n..][..n].to_vec();
    let covariance = &carry[n..];
    let times = |i: usize| (0..n).map(|j| covariance[entry(n, i, j)] * c[j]).sum::<S>();
    let gain: Vec<S> = (0..n).map(times).collect();
    let mut noise = vec![S::from(0.0); outputs];
    plant.noise(&carry[..n], &mut noise);
    let noise = noise[output] * noise[output];
    let noise = spread.get(entry(outputs, output, output)).map_or(noise, |spread| noise + *spread);
    let variance = gain.iter().zip(&c).map(|(g, c)| *g * *c).sum::<S>() + noise;
    Expected { mean: mean[output], c, gain, noise, variance }
}

fn correct<O: Order, S: Scalar>(plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
    let n = plant.layout().states.len();
    let Expected { c, gain, noise, variance, .. } = expected::<O, S>(plant, carry, output);
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

/// Replaces a state and its covariance by the moments of a function of them; `with_noise(i, j, p)` adds noise to an entry of the covariance.
fn replace<S: Scalar>(carry: &mut [S], moments: Moments<S>, with_noise: impl Fn(usize, usize, S) -> S) {
    let Moments { mean, slopes: a, spread } = moments;
    let n = mean.len();
    let before = carry[n..].to_vec();
    carry[..n].copy_from_slice(&mean);
    for i in 0..n {
        for j in i..n {
            let pairs = (0..n).flat_map(|k| (0..n).map(move |l| (k, l)));
            let moved: S = pairs.map(|(k, l)| a[i * n + k] * before[entry(n, k, l)] * a[j * n + l]).sum();
            let moved = spread.get(entry(n, i, j)).map_or(moved, |spread| moved + *spread);
            carry[n + entry(n, i, j)] = with_noise(i, j, moved);
        }
    }
}

/// The noise of the states at a position, added to the diagonal of a covariance or of its rate.
fn noise_at<S: Scalar>(plant: &dyn Plant<S>, position: f64, x: &[S]) -> impl Fn(usize, usize, S) -> S + use<S> {
    let mut noise = vec![S::from(0.0); x.len()];
    plant.diffusion(position, x, &mut noise);
    move |i: usize, j: usize, moved: S| if i == j { moved + noise[i] * noise[i] } else { moved }
}

/// The rate of the carry, `dx/dt = E f` and `dP/dt = A P + P A' + Q` with `A = E df/dx`: the covariance of `x` and `f(x)` is `P A'` where `x` is
/// Gaussian (C. Stein). Returns `A`.
fn rate<O: Order, S: Scalar>(plant: &dyn Plant<S>, position: f64, z: &[S], to: &mut [S]) -> Vec<S> {
    let n = plant.layout().states.len();
    let Moments { mean, slopes: a, .. } = O::state(plant, position, z);
    to[..n].copy_from_slice(&mean);
    let with_noise = noise_at(plant, position, &z[..n]);
    let flow = |i: usize, j: usize| (0..n).map(|k| a[i * n + k] * z[n + entry(n, k, j)]).sum::<S>();
    for i in 0..n {
        for j in i..n {
            to[n + entry(n, i, j)] = with_noise(i, j, flow(i, j) + flow(j, i));
        }
    }
    a
}

fn advance<O: Order, S: Scalar>(plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
    let n = plant.layout().states.len();
    if plant.layout().kind == Kind::Discrete {
        let with_noise = noise_at(plant, 0.0, &carry[..n]);
        replace(carry, O::state(plant, 0.0, carry), with_noise);
        return Ok(());
    }
    if n == 0 {
        return Ok(());
    }
    if plant.jumps() {
        replace(carry, O::jump(plant, carry), |_, _, moved| moved);
    }
    if plant.spread(&mut carry[n..]) {
        return plant.flow(&mut carry[..n]);
    }
    plant.integrate(carry, &|position, z, to| {
        rate::<O, S>(plant, position, z, to);
    })
}

/// The matrix `F` with which the covariance of this state and the next is `P F'`: `dF/dt = A F` with the mean slopes `A`, from those of the jump on; row by
/// row.
pub(crate) fn transition<O: Order>(plant: &dyn Plant<f64>, carry: &[f64]) -> Result<Vec<f64>, Stuck> {
    let (n, carried) = (plant.layout().states.len(), carry.len());
    match plant.layout().kind {
        Kind::Continuous => {}
        Kind::Discrete => return Ok(O::state(plant, 0.0, carry).slopes),
        Kind::Static => return Ok(vec![]),
    }
    let mut z = carry.to_vec();
    let mut begin = identity(n);
    if plant.jumps() {
        let moments = O::jump(plant, carry);
        begin.clone_from(&moments.slopes);
        replace(&mut z, moments, |_, _, moved| moved);
    }
    z.extend(begin);
    plant.integrate(&mut z, &|position, z, to| {
        let a = rate::<O, f64>(plant, position, &z[..carried], &mut to[..carried]);
        for at in 0..n * n {
            to[carried + at] = (0..n).map(|k| a[at / n * n + k] * z[carried + k * n + at % n]).sum();
        }
    })?;
    Ok(z.split_off(carried))
}

/// A filter of some order.
pub trait Filter: Debug + Clone + Send + Sync + 'static {
    /// Its order.
    type Order: Order;

    /// How it begins.
    fn initial(&self) -> InitialCovariance {
        InitialCovariance::Declared
    }

    /// What it is called.
    fn name(&self) -> &'static str;
}

impl<F: Filter> Predictor for F {
    /// The state and its covariance.
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

    /// Any model: of a static one, outputs are predicted with the variance of their noise.
    fn check(&self, _layout: &Layout) -> Result<(), Error> {
        Ok(())
    }

    fn starts_from(&self) -> StartsFrom {
        match self.initial() {
            InitialCovariance::Declared => StartsFrom::InitialNoise,
            InitialCovariance::Stationary | InitialCovariance::FirstInterval => StartsFrom::Slopes,
        }
    }

    fn start<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Unstable> {
        let (x, covariance) = carry.split_at_mut(plant.layout().states.len());
        covariance.copy_from_slice(&self.initial().at(plant, x)?);
        Ok(())
    }

    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        let Expected { mean, variance, .. } = expected::<F::Order, S>(plant, carry, output);
        (mean, variance)
    }

    fn correct<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        correct::<F::Order, S>(plant, carry, output, error);
    }

    fn advance<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        advance::<F::Order, S>(plant, carry)
    }

    fn describe(&self) -> String {
        format!("{}{}", self.name(), self.initial().describe())
    }
}
