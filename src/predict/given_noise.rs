//! [`GivenNoise`]: the extended filter with levels of noise that are not the model's.

use super::{Kalman, Plant, Predictor, Unstable, mean};
use crate::error::Error;
use crate::integrate::Stuck;
use crate::layout::{Kind, Layout};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The extended filter ([`Kalman`](super::Kalman)) with levels of noise that are given as numbers, in place of the model's: each interval adds
/// independent errors to the states.
///
/// With errors of the states that are large against the noise of the outputs, the gain is near one: predictions are near the measurements for
/// any parameters, and the cost has few minima, but the noise of the measurements biases the estimate. A fit from a far start begins so, and
/// lowers the errors in stages ([`Fit::staged`](crate::Fit::staged)).
///
/// The filter carries a root `S` of the state's covariance `P = S S'`: `dS/dt = A S` with the slopes `A` of the model at the state, rotations
/// (Givens) where an interval adds its errors, and J. E. Potter's formula (R. H. Battin, *Astronautical Guidance*, 1964, section 9.5) where an
/// output is measured. `P` is then positive semidefinite also where the steps of the integrator are too long for the model.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::predict::GivenNoise;
/// let noise = GivenNoise { states: vec![0.01, 0.01], outputs: vec![0.05, 0.05] }; // A: each interval, each measurement
/// let estimate = Fit::new(&model, &record).parameters(start).predictor(noise).run()?;
/// assert!((estimate.parameters.ls / 4e-3 - 1.0).abs() < 0.02);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GivenNoise {
    /// Standard deviation of the error that each interval adds to each state, in its unit; positive.
    pub states: Vec<f64>,
    /// Standard deviation of the noise of each output, in its unit; positive.
    pub outputs: Vec<f64>,
}

/// What the filter knows of an output before it is taken in.
struct Expected<S> {
    mean: S,
    /// The output's row of slopes times the root.
    row: Vec<S>,
    variance: S,
}

impl GivenNoise {
    /// Of the states, then of the outputs.
    pub(super) fn levels(&self) -> Vec<f64> {
        [&*self.states, &*self.outputs].concat()
    }

    /// One of these: where a program of many filters is made, the number that the plant has for it.
    fn level<S: Scalar>(&self, plant: &dyn Plant<S>, number: usize) -> S {
        let after = plant.layout().parameters.len() + number;
        plant.parameters().get(after).copied().unwrap_or_else(|| S::from(self.levels()[number]))
    }

    fn of_output<S: Scalar>(&self, plant: &dyn Plant<S>, output: usize) -> S {
        self.level(plant, self.states.len() + output)
    }

    fn expected<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> Expected<S> {
        let (n, outputs) = (plant.layout().states.len(), plant.layout().outputs.len());
        let mut slopes = vec![S::from(0.0); outputs * n];
        plant.output_slopes(&carry[..n], &mut slopes);
        let (c, root) = (&slopes[output * n..][..n], &carry[n..]);
        let row: Vec<S> = (0..n).map(|j| (0..n).map(|i| c[i] * root[i * n + j]).sum()).collect();
        let noise = self.of_output(plant, output);
        let variance = row.iter().map(|entry| *entry * *entry).sum::<S>() + noise * noise;
        Expected { mean: mean(plant, carry, output), row, variance }
    }

    /// Adds the errors of an interval: rotates `[S, errors]` to a root of as many columns as before.
    fn widen<S: Scalar>(&self, plant: &dyn Plant<S>, root: &mut [S]) {
        let n = self.states.len();
        let mut added = vec![S::from(0.0); n * n];
        for i in 0..n {
            added[i * n + i] = self.level(plant, i);
        }
        for i in 0..n {
            // The first rotation is with the column whose entry is positive, so that no length is zero.
            let columns =
                std::iter::once((false, i)).chain((0..i).map(|j| (false, j))).chain((i + 1..n).map(|j| (true, j)));
            for (is_root, j) in columns {
                let other = if is_root { root[i * n + j] } else { added[i * n + j] };
                let this = root[i * n + i];
                let length = (this * this + other * other).sqrt();
                let (cos, sin) = (this / length, other / length);
                for row in i..n {
                    let this = root[row * n + i];
                    let entry = if is_root { &mut root[row * n + j] } else { &mut added[row * n + j] };
                    let other = *entry;
                    *entry = cos * other - sin * this;
                    root[row * n + i] = cos * this + sin * other;
                }
            }
        }
        // What the rotations have made zero.
        for i in 0..n {
            root[i * n + i + 1..(i + 1) * n].fill(S::from(0.0));
        }
    }
}

/// `A S`.
fn product<S: Scalar>(slopes: &[S], root: &[S], n: usize, to: &mut [S]) {
    for i in 0..n {
        for j in 0..n {
            to[i * n + j] = (0..n).map(|k| slopes[i * n + k] * root[k * n + j]).sum();
        }
    }
}

impl Predictor for GivenNoise {
    fn carry(&self, layout: &Layout) -> usize {
        let n = layout.states.len();
        n + n * n
    }

    fn predicts_variance(&self) -> bool {
        true
    }

    fn needs_slopes(&self) -> bool {
        true
    }

    fn check(&self, layout: &Layout) -> Result<(), Error> {
        Kalman.check(layout)?;
        for (what, given, quantities) in
            [("states", &self.states, &layout.states), ("outputs", &self.outputs, &layout.outputs)]
        {
            if given.len() != quantities.len() {
                let (found, expected) = (given.len(), quantities.len());
                return Err(Error::Option(format!(
                    "levels of noise are given for {found} {what}, but the model has {expected}"
                )));
            }
            let wrong = given.iter().zip(quantities).find(|(level, _)| !(**level > 0.0 && level.is_finite()));
            if let Some((&value, quantity)) = wrong {
                return Err(Error::NotPositive { what: format!("the level of noise of `{}`", quantity.name), value });
            }
        }
        Ok(())
    }

    /// The state is what the fit takes it to be.
    fn start<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Unstable> {
        carry[plant.layout().states.len()..].fill(S::from(0.0));
        Ok(())
    }

    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        let Expected { mean, variance, .. } = self.expected(plant, carry, output);
        (mean, variance)
    }

    fn correct<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        let n = plant.layout().states.len();
        let Expected { row, variance, .. } = self.expected(plant, carry, output);
        let (x, root) = carry.split_at_mut(n);
        let shrunk = S::from(1.0) / (variance + variance.sqrt() * self.of_output(plant, output));
        for (i, x) in x.iter_mut().enumerate() {
            let moved = (0..n).map(|j| root[i * n + j] * row[j]).sum::<S>();
            *x += moved / variance * error;
            for (entry, row) in root[i * n..][..n].iter_mut().zip(&row) {
                *entry -= moved * shrunk * *row;
            }
        }
    }

    fn advance<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        let n = plant.layout().states.len();
        let rate = |position: f64, z: &[S], to: &mut [S]| {
            let mut slopes = vec![S::from(0.0); n * n];
            plant.state_slopes(position, &z[..n], &mut slopes);
            plant.derivative(position, &z[..n], &mut to[..n]);
            product(&slopes, &z[n..], n, &mut to[n..]);
        };
        match plant.layout().kind {
            Kind::Discrete => {
                let before = carry.to_vec();
                rate(0.0, &before, carry);
            }
            _ => {
                if plant.jumps() {
                    let (mut slopes, before) = (vec![S::from(0.0); n * n], carry.to_vec());
                    plant.jump_slopes(&before[..n], &mut slopes);
                    plant.jump(carry);
                    product(&slopes, &before[n..], n, &mut carry[n..]);
                }
                plant.integrate(carry, &rate)?;
            }
        }
        self.widen(plant, &mut carry[n..]);
        Ok(())
    }

    fn describe(&self) -> String {
        let listed = |levels: &[f64]| levels.iter().map(|level| format!("{level:e}")).collect::<Vec<_>>().join(", ");
        format!(
            "one-step prediction by an extended Kalman filter with given levels of noise (states {}; outputs {})",
            listed(&self.states),
            listed(&self.outputs)
        )
    }
}
