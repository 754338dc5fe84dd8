//! [`Kalman`]: one-step prediction of a plant with process noise.

use super::gaussian::{Filter, Order};
use super::{Moments, Plant};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The Kalman filter (R. E. Kalman, Journal of Basic Engineering 82 (1960) 35-45; for the likelihood F. C. Schweppe, IEEE Transactions on
/// Information Theory 11 (1965) 61-70): each output is predicted from all measurements before it, with its variance. Right where the plant
/// is disturbed between the samples: wind, load, sun, a friction that the model lacks.
///
/// Mean `x` and covariance `P` of the state are exact for a model that is affine in its state. Where it is linear with constant coefficients, `dx/dt
/// = A x + B u + c` with `A`, `B`, `c` and the diffusion functions of parameters alone, no input late, and no integrator was chosen (samples may change the state by an affine function of it),
/// transition and covariance of an interval are computed once for each set of parameters and each length of the intervals, exactly, however stiff the model and
/// long the interval (C. F. Van Loan, IEEE Transactions on Automatic Control 23 (1978) 395-404). Lengths that differ by rounding, by a part of 1e-9, are one;
/// for a clock that jitters, whose lengths are many and close to each other, the transition is interpolated by a polynomial through twelve lengths, of
/// which `e^{Ah}` and the covariance are checked to 1e-11. A covariance that has settled, to a part of 1e-10, is computed no more while all outputs are
/// measured at intervals of one length, if their slopes and noises follow from parameters alone: it is that of the algebraic Riccati equation. For models that are not affine it is the extended filter: they
/// follow the model and its slopes to the first order (A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 9.3),
///
/// ```text
/// dx/dt = f(x)        dP/dt = A P + P A' + Q        A = df/dx at x
/// ```
///
/// by the steps of the fit's integrator, and an output is linearized at the state that the outputs before it have corrected. That is right
/// where the state's standard deviation is short against the model's curvature, as it is with measurements that are frequent and precise
/// against the disturbance; where [`SecondOrder`](super::SecondOrder) would move an estimate, a warning says so
/// ([`FilterOrder`](crate::WarningCode::FilterOrder)). `A` is found by differentiating the model's graph, so that gradients of the
/// likelihood are exact. A model that cannot be read as a graph (closures in [`Numeric`](crate::Numeric)) has to be affine, and is refused by the name of the equation that is
/// not ([`Error::NotAffine`](crate::Error::NotAffine)): it is tested by its values at some samples of each record, at states of a thousandth to a thousand times the
/// largest measurement, and at far larger ones.
///
/// The noise is part of the model, [`Model::diffusion`](crate::Model::diffusion) and
/// [`Model::noise`](crate::Model::noise), so that noise levels are parameters like others. The state at the first
/// sample is what the fit takes it to be; its covariance is zero unless the model says otherwise
/// ([`Model::initial_noise`](crate::Model::initial_noise)), because the fit estimates it or is given it, or what [`Kalman::starting`] asks for.
/// Without diffusion and initial noise the filter predicts what a simulation does.
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

impl Filter for Kalman {
    type Order = Self;

    fn name(&self) -> &'static str {
        "one-step prediction by a Kalman filter"
    }
}

impl Order for Kalman {
    fn state<S: Scalar>(plant: &dyn Plant<S>, position: f64, carry: &[S]) -> Moments<S> {
        let n = plant.layout().states.len();
        let (mut mean, mut slopes) = (carry[..n].to_vec(), vec![S::from(0.0); n * n]);
        plant.state_slopes(position, &carry[..n], &mut slopes);
        plant.derivative(position, &carry[..n], &mut mean);
        Moments { mean, slopes, spread: vec![] }
    }

    fn jump<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S> {
        let n = plant.layout().states.len();
        let (mut mean, mut slopes) = (carry[..n].to_vec(), vec![S::from(0.0); n * n]);
        plant.jump_slopes(&carry[..n], &mut slopes);
        plant.jump(&mut mean);
        Moments { mean, slopes, spread: vec![] }
    }

    fn outputs<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S> {
        let (n, outputs) = (plant.layout().states.len(), plant.layout().outputs.len());
        let (mut mean, mut slopes) = (vec![S::from(0.0); outputs], vec![S::from(0.0); outputs * n]);
        plant.output(&carry[..n], &mut mean);
        plant.output_slopes(&carry[..n], &mut slopes);
        Moments { mean, slopes, spread: vec![] }
    }
}
