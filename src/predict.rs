//! [`Predictor`]: what the model expects of each output, mean and variance, and where the state behind it comes from.

mod free_run;
mod horizon;
mod kalman;
pub(crate) mod measured;
mod plant;
mod symbolic;

pub use free_run::FreeRun;
pub use horizon::Horizon;
pub use kalman::Kalman;
pub use plant::Plant;
pub(crate) use plant::{Between, SlicePlant, Stepped};
pub(crate) use symbolic::recurrence;

use crate::error::Error;
use crate::graph::Symbol;
use crate::integrate::{Duals, Stuck};
use crate::layout::Layout;
use crate::scalar::Scalar;
use core::fmt::Debug;

/// How a prediction comes about, sample by sample. What it hands from one sample to the next, the carry, begins with the
/// state; a filter adds its uncertainty.
///
/// At each sample the outputs are taken one after the other: [`predict`](Predictor::predict) says what is expected of it,
/// and where it was measured [`correct`](Predictor::correct) takes the prediction error into the carry. Then
/// [`advance`](Predictor::advance) goes on to the next sample. Written over [`Scalar`], the text gives exact slopes, and is
/// compiled together with the model's equations where these can be read as a graph.
pub trait Predictor: Debug + Clone + Send + Sync + 'static {
    /// How many numbers the carry has, for a model of this layout: its states at least, which come first.
    fn carry(&self, layout: &Layout) -> usize {
        layout.states.len()
    }

    /// Whether it predicts a variance. Then the likelihood of the prediction errors is what a fit maximizes, and the noise
    /// is the predictor's business.
    fn predicts_variance(&self) -> bool {
        false
    }

    /// Whether each output is predicted from a state that was measured so many samples before, and by which settings;
    /// nothing is carried on then.
    fn restarts(&self) -> Option<Horizon> {
        None
    }

    /// Whether it serves a model of this layout.
    ///
    /// # Errors
    /// Why it does not, and what to do.
    fn check(&self, layout: &Layout) -> Result<(), Error> {
        let _ = layout;
        Ok(())
    }

    /// Fills in what the carry holds at the first sample beyond the state.
    fn start<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) {
        let _ = (plant, carry);
    }

    /// Mean and variance of an output, from a carry that has taken in the outputs before it. The variance does not matter
    /// to a predictor that predicts none.
    fn predict<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S) {
        let mut y = vec![S::from(0.0); plant.layout().outputs.len()];
        plant.output(&carry[..plant.layout().states.len()], &mut y);
        (y[output], S::from(1.0))
    }

    /// Takes in the prediction error of an output that was measured.
    fn correct<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S) {
        let _ = (plant, carry, output, error);
    }

    /// On to the next sample.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn advance<S: Scalar>(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck> {
        plant.next(carry)
    }

    /// Name and settings in a few words, for reports.
    fn describe(&self) -> String;
}

/// A [`Predictor`] as an object.
pub(crate) trait Prediction: Debug + Send + Sync {
    fn carry(&self, layout: &Layout) -> usize;
    fn predicts_variance(&self) -> bool;
    fn restarts(&self) -> Option<Horizon>;
    fn is_simulation(&self) -> bool;
    fn check(&self, layout: &Layout) -> Result<(), Error>;
    fn describe(&self) -> String;
    fn values(&self) -> &dyn Steps<f64>;
    fn duals(&self) -> &dyn Steps<Duals>;
    fn symbols(&self) -> &dyn Steps<Symbol>;
}

/// The functions of a [`Predictor`] in numbers of one type.
pub(crate) trait Steps<S> {
    fn start(&self, plant: &dyn Plant<S>, carry: &mut [S]);
    fn predict(&self, plant: &dyn Plant<S>, carry: &[S], output: usize) -> (S, S);
    fn correct(&self, plant: &dyn Plant<S>, carry: &mut [S], output: usize, error: S);
    fn advance(&self, plant: &dyn Plant<S>, carry: &mut [S]) -> Result<(), Stuck>;
}

impl<P: Predictor, S: Scalar> Steps<S> for P {
    fn start(&self, plant: &dyn Plant<S>, carry: &mut [S]) {
        Predictor::start(self, plant, carry);
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
