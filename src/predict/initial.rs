//! [`InitialCovariance`]: how uncertain the state of a filter is at the first sample.

use super::{Plant, Unstable};
use crate::layout::Kind;
use crate::moments::entry;
use crate::scalar::Scalar;
use crate::transition::{NotStationary, Transition, squares};
use serde::{Deserialize, Serialize};

/// The covariance of the state at the first sample, about the initial state that the fit estimates or is given, for
/// [`Kalman::starting`](super::Kalman::starting) and [`SecondOrder::starting`](super::SecondOrder::starting). Slopes of the likelihood with
/// respect to parameters that it depends on are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialCovariance {
    /// As the model says, by [`Model::initial_noise`](crate::Model::initial_noise): zero unless written, then the initial state is exact.
    #[default]
    Declared,
    /// That of a plant that has been disturbed for long: the solution of `A P + P A' + Q = 0`, of a discrete model of `P = A P A' + Q`, with
    /// the slopes `A` of the model at the initial state and the inputs of the first sample, and the diffusion `Q`; where samples change the state
    /// ([`Model::jump`](crate::Model::jump)), that of the step from the first sample to the next, taken for all. A plant that does not come to
    /// rest has none ([`Error::NotStationary`](crate::Error::NotStationary)).
    Stationary,
    /// What the diffusion adds in the first sampling interval, the integral of `e^{As} Q e^{A's}` over it with the same `A`; of a discrete model
    /// `Q`. Measurements at one instant have one interval, the first that is longer than zero. This is how CTSM begins, with a
    /// scale of one (N. R. Kristensen, H. Madsen, S. B. Jørgensen, Automatica 40 (2004) 225-237).
    FirstInterval,
}

impl InitialCovariance {
    /// How a filter begins, after its name.
    pub(super) fn describe(self) -> &'static str {
        match self {
            InitialCovariance::Declared => "",
            InitialCovariance::Stationary => " that starts from the stationary covariance",
            InitialCovariance::FirstInterval => " that starts from the diffusion of the first interval",
        }
    }

    /// The covariance at a state, upper triangle row by row.
    pub(super) fn at<S: Scalar>(self, plant: &dyn Plant<S>, x: &[S]) -> Result<Vec<S>, Unstable> {
        let (n, kind) = (x.len(), plant.layout().kind);
        let diagonal = |fill: &dyn Fn(&mut [S])| {
            let mut levels = vec![S::from(0.0); n];
            fill(&mut levels);
            squares(&levels)
        };
        let upper = |square: Vec<S>| {
            let mut triangle = vec![S::from(0.0); n * (n + 1) / 2];
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
            pairs.for_each(|(i, j)| triangle[entry(n, i, j)] = square[i * n + j]);
            triangle
        };
        if self == InitialCovariance::Declared {
            return Ok(upper(diagonal(&|to| plant.initial_noise(to))));
        }
        let q = diagonal(&|to| plant.diffusion(0.0, x, to));
        if self == InitialCovariance::FirstInterval && kind == Kind::Discrete {
            return Ok(upper(q));
        }
        let mut a = vec![S::from(0.0); n * n];
        plant.state_slopes(0.0, x, &mut a);
        // What is undefined is found where it is simulated.
        if a.iter().chain(&q).any(|entry| !entry.value().is_finite()) {
            return Ok(vec![S::from(f64::NAN); n * (n + 1) / 2]);
        }
        let found = match (self, kind) {
            (InitialCovariance::Stationary, Kind::Discrete) => Transition::discrete(n, a, q).stationary(),
            // What samples change of the state is a part of its step; that of the first interval is taken for all.
            (InitialCovariance::Stationary, _) if plant.jumps() && plant.length().value() > 0.0 => {
                let mut jump = vec![S::from(0.0); n * n];
                plant.jump_slopes(x, &mut jump);
                let per_second =
                    |NotStationary { state, rate }| NotStationary { state, rate: rate / plant.length().value() };
                Transition::over(n, &a, &q, plant.length()).after(&jump).stationary().map_err(per_second)
            }
            (InitialCovariance::Stationary, _) => Transition::at_rest(n, &a, &q),
            _ => Ok(Transition::over(n, &a, &q, plant.length()).covariance()),
        };
        found.map(upper).map_err(|NotStationary { state, rate }| Unstable { state, rate })
    }
}
