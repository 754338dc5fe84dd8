//! [`Predictor`]: mean and variance of each output, and the state from which they are computed.

mod between;
mod free_run;
mod gaussian;
mod given_noise;
mod horizon;
mod initial;
mod kalman;
mod measured;
mod plant;
mod second_order;
mod starting;
mod symbolic;

pub use crate::moments::Moments;
pub(crate) use between::Between;
pub use free_run::FreeRun;
pub(crate) use gaussian::transition;
pub use given_noise::GivenNoise;
pub use horizon::Horizon;
pub use initial::InitialCovariance;
pub use kalman::Kalman;
pub use measured::Guess;
pub(crate) use measured::Place;
pub use plant::Plant;
pub(crate) use plant::{Intervals, SlicePlant, Stepped, value_and_slopes};
pub use second_order::SecondOrder;
pub use starting::Starting;
pub(crate) use symbolic::{numbers, recurrence, settled};

use crate::error::Error;
use crate::graph::Symbol;
use crate::integrate::{Duals, Stuck};
use crate::layout::Layout;
use crate::scalar::Scalar;
use core::any::Any;
use core::fmt::Debug;
use std::sync::Arc;

/// Predicts the outputs sample by sample. The numbers that it passes from one sample to the next, the carry, begin with
/// the state; a filter adds the state's covariance.
///
/// At each sample the outputs are processed one after the other: [`predict`](Predictor::predict) returns mean and
/// variance, and where the output was measured [`correct`](Predictor::correct) updates the carry with the prediction
/// error. Then [`advance`](Predictor::advance) moves the carry to the next sample. The functions are generic over
/// [`Scalar`]: slopes are exact, and they are compiled together with the model's equations where these can be traced.
pub trait Predictor: Debug + Clone + Send + Sync + 'static {
    /// Length of the carry for a model of this layout: at least its states, which come first.
    fn carry(&self, layout: &Layout) -> usize {
        layout.states.len()
    }

    /// Whether it predicts a variance. A fit then maximizes the likelihood of the prediction errors, and takes the
    /// noise from the predictor.
    fn predicts_variance(&self) -> bool {
        false
    }

    /// The horizon, if each output is predicted from a state measured a fixed number of samples before; nothing is
    /// carried from sample to sample then.
    fn restarts(&self) -> Option<Horizon> {
        None
    }

    /// Whether it asks for slopes with respect to the state ([`Plant::state_slopes`], [`Plant::output_slopes`], [`Plant::jump_slopes`]) or for
    /// moments. A model that cannot be read as
    /// a graph has them only if it is affine in its state; others are refused ([`Error::NotAffine`]).
    fn needs_slopes(&self) -> bool {
        false
    }

    /// Checks that it can predict a model of this layout.
    ///
    /// # Errors
    /// Why it cannot, and the remedy.
    fn check(&self, layout: &Layout) -> Result<(), Error> {
        let _ = layout;
        Ok(())
    }

    /// What the entries of the carry after the state depend on at the first sample; slopes with respect to anything else are zero there.
    fn starts_from(&self) -> StartsFrom {
        StartsFrom::Anything
    }

    /// Sets the entries of the carry after the state, at the first sample.
    ///
    /// # Errors
    /// A plant that is unstable where these do not exist then.
    fn start<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Unstable> {
        let _ = (plant, carry);
        Ok(())
    }

    /// Mean and variance of an output, from a carry that was corrected with the outputs before it. The variance is
    /// ignored unless [`predicts_variance`](Predictor::predicts_variance).
    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        (mean(plant, carry, output), S::from(1.0))
    }

    /// Corrects the carry with the prediction error of an output that was measured.
    fn correct<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        let _ = (plant, carry, output, error);
    }

    /// Moves the carry to the next sample.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn advance<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        plant.next(carry)
    }

    /// Name and settings in a short text, for reports.
    fn describe(&self) -> String;
}

/// What the entries of a carry after the state depend on at the first sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartsFrom {
    /// States and parameters, as it may be.
    Anything,
    /// The parameters of [`Plant::initial_noise`].
    InitialNoise,
    /// What [`Plant::state_slopes`], [`Plant::jump_slopes`] and [`Plant::diffusion`] depend on, and dead times of inputs.
    Slopes,
}

/// A plant that is unstable where a predictor starts from its stationary covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unstable {
    /// Number of the state that does not come to rest.
    pub state: usize,
    /// By what it grows, about: the real part of an eigenvalue (1/s) of a continuous plant, the logarithm of its magnitude of a discrete one.
    pub rate: f64,
}

/// An output of the state that begins the carry.
fn mean<S: Scalar>(plant: &dyn Plant<S>, carry: &[S], output: usize) -> S {
    let mut y = vec![S::from(0.0); plant.layout().outputs.len()];
    plant.output(&carry[..plant.layout().states.len()], &mut y);
    y[output]
}

/// A [`Predictor`] as a trait object.
pub(crate) trait Prediction: Debug + Send + Sync {
    fn carry(&self, layout: &Layout) -> usize;
    fn predicts_variance(&self) -> bool;
    fn restarts(&self) -> Option<Horizon>;
    fn is_simulation(&self) -> bool;
    fn needs_slopes(&self) -> bool;
    /// Whether it predicts a variance by the model's process noise, as far as is known.
    fn takes_diffusion(&self) -> bool;
    fn starts_from(&self) -> StartsFrom;
    /// Settings that a program reads after the parameters, so that filters which differ in these alone share it.
    fn numbers(&self) -> Vec<f64>;
    /// This predictor to the second order, of a filter of first order.
    fn second_order(&self) -> Option<Arc<dyn Prediction>>;
    /// Whether it is a filter of the model's process noise, of first or second order.
    fn is_filter(&self) -> bool;
    /// Whether it is such a filter of second order.
    fn is_second_order(&self) -> bool;
    fn check(&self, layout: &Layout) -> Result<(), Error>;
    fn describe(&self) -> String;
    fn values(&self) -> &dyn Steps<f64>;
    fn duals(&self) -> &dyn Steps<Duals>;
    fn symbols(&self) -> &dyn Steps<Symbol>;
}

/// The functions of a [`Predictor`] in numbers of one type.
pub(crate) trait Steps<S> {
    fn start(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Unstable>;
    fn predict(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S);
    fn correct(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S);
    fn advance(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck>;
}

impl<P: Predictor, S: Scalar> Steps<S> for P {
    fn start(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Unstable> {
        Predictor::start(self, plant, carry)
    }

    fn predict(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        Predictor::predict(self, plant, carry, output)
    }

    fn correct(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        Predictor::correct(self, plant, carry, output, error);
    }

    fn advance(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        Predictor::advance(self, plant, carry)
    }
}

impl<P: Predictor> Prediction for P {
    fn carry(&self, layout: &Layout) -> usize {
        Predictor::carry(self, layout)
    }

    fn predicts_variance(&self) -> bool {
        Predictor::predicts_variance(self)
    }

    fn restarts(&self) -> Option<Horizon> {
        Predictor::restarts(self)
    }

    fn is_simulation(&self) -> bool {
        std::any::TypeId::of::<P>() == std::any::TypeId::of::<FreeRun>()
    }

    fn needs_slopes(&self) -> bool {
        Predictor::needs_slopes(self)
    }

    fn takes_diffusion(&self) -> bool {
        let given = std::any::TypeId::of::<P>() == std::any::TypeId::of::<GivenNoise>();
        Predictor::predicts_variance(self) && !given
    }

    fn starts_from(&self) -> StartsFrom {
        Predictor::starts_from(self)
    }

    fn numbers(&self) -> Vec<f64> {
        let this: &dyn Any = self;
        this.downcast_ref::<GivenNoise>().map_or(vec![], GivenNoise::levels)
    }

    fn second_order(&self) -> Option<Arc<dyn Prediction>> {
        let this: &dyn Any = self;
        match this.downcast_ref::<Starting<Kalman>>() {
            Some(starting) => Some(Arc::new(starting.second_order())),
            None => this.is::<Kalman>().then(|| Arc::new(SecondOrder) as Arc<dyn Prediction>),
        }
    }

    fn is_filter(&self) -> bool {
        Prediction::is_second_order(self) || Prediction::second_order(self).is_some()
    }

    fn is_second_order(&self) -> bool {
        let this: &dyn Any = self;
        this.is::<SecondOrder>() || this.is::<Starting<SecondOrder>>()
    }

    fn check(&self, layout: &Layout) -> Result<(), Error> {
        Predictor::check(self, layout)
    }

    fn describe(&self) -> String {
        Predictor::describe(self)
    }

    fn values(&self) -> &dyn Steps<f64> {
        self
    }

    fn duals(&self) -> &dyn Steps<Duals> {
        self
    }

    fn symbols(&self) -> &dyn Steps<Symbol> {
        self
    }
}

/// The default. It is not generic, nor inlined, so that it is compiled with the library and not with each model.
#[inline(never)]
pub(crate) fn simulation() -> Arc<dyn Prediction> {
    Arc::new(FreeRun)
}
