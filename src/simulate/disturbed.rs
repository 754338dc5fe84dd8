//! What process noise adds to a simulated state from one sample to the next.

use crate::integrate::{ModelSystem, Square, System};
use crate::layout::Kind;
use crate::model::Model;
use crate::random::Random;
use crate::signals::{Of, Signals};
use crate::transition::{Transition, squares};

/// The random numbers of states are others than those that [`with_noise`](super::Simulation::with_noise) adds to outputs.
const STATES: u64 = 1 << 32;

/// Draws of a model's process noise: the same seed draws the same.
pub(crate) struct Disturbance {
    of_states: Vec<Random>,
}

impl Disturbance {
    pub fn new(states: usize, seed: u64) -> Self {
        Disturbance { of_states: (0..states as u64).map(|i| Random::stream(seed, STATES + i)).collect() }
    }

    /// The state at the end of an interval of `h` (s) that begins at another, disturbed by what the diffusion at its begin leaves over it.
    pub fn add<M: Model>(
        &mut self,
        system: &ModelSystem<'_, M, f64>,
        begin: &Of<M::State, f64>,
        h: f64,
        end: &Of<M::State, f64>,
    ) -> Of<M::State, f64> {
        let end = M::State::into_array(*end);
        let (t, u) = (system.interval.t0, system.interval.input(0.0));
        let levels = M::State::into_array(system.model.diffusion(t, begin, &u, system.p));
        let slopes = (M::KIND == Kind::Continuous).then(|| {
            let rows = system.jacobian(0.0, &M::State::into_array(*begin)).1;
            (0..M::State::LEN).flat_map(|i| rows.row(i).to_vec()).collect::<Vec<f64>>()
        });
        let added = self.draw(slopes.as_deref(), levels.as_ref(), h);
        M::State::from_fn(|i| end.as_ref()[i] + added[i])
    }

    /// Numbers of a normal distribution with the covariance that diffusion of these levels leaves over an interval of `h` (s) of a plant with
    /// these slopes, row by row; of a discrete plant, which has none, the levels are standard deviations.
    pub fn draw(&mut self, slopes: Option<&[f64]>, levels: &[f64], h: f64) -> Vec<f64> {
        let n = levels.len();
        let normal: Vec<f64> = self.of_states.iter_mut().map(Random::normal).collect();
        let Some(slopes) = slopes else {
            return levels.iter().zip(&normal).map(|(level, normal)| level * normal).collect();
        };
        let covariance = Transition::over(n, slopes, &squares(levels), h).covariance();
        if covariance.iter().any(|entry| !entry.is_finite()) {
            return vec![f64::NAN; n];
        }
        let factor = factor(n, covariance);
        (0..n).map(|i| (0..=i).map(|j| factor[i * n + j] * normal[j]).sum()).collect()
    }
}

/// The lower triangle whose product with its mirror image is a covariance, by A.-L. Cholesky's method; a column of zeros where a state has no
/// noise but that of the states before it.
fn factor(n: usize, covariance: Vec<f64>) -> Vec<f64> {
    let mut factor = covariance;
    for j in 0..n {
        let own = factor[j * n + j];
        let rest = own - (0..j).map(|k| factor[j * n + k] * factor[j * n + k]).sum::<f64>();
        // What is left of rounding is none.
        let root = if rest > 1e-14 * own { rest.sqrt() } else { 0.0 };
        factor[j * n + j] = root;
        for i in j + 1..n {
            let shared = (0..j).map(|k| factor[i * n + k] * factor[j * n + k]).sum::<f64>();
            factor[i * n + j] = if root > 0.0 { (factor[i * n + j] - shared) / root } else { 0.0 };
        }
    }
    factor
}
