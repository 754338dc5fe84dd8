//! [`Starting`]: filters that begin otherwise than the model says.

use super::gaussian::Filter;
use super::{InitialCovariance, Kalman, SecondOrder};
use serde::{Deserialize, Serialize};

/// A filter whose state is uncertain at the first sample otherwise than the model says; made by [`Kalman::starting`] and
/// [`SecondOrder::starting`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Starting<F> {
    filter: F,
    covariance: InitialCovariance,
}

impl Kalman {
    /// This filter with another covariance at the first sample.
    ///
    /// ```
    /// # use greybox::{Experiment, Fit, Kalman, Kind, Model, Nothing, Scalar, Time, fixed, free, signals};
    /// # signals! { pub struct Level { x: "m" } }
    /// # signals! { pub struct Levels { a: "1", q: "m", r: "m" } }
    /// # struct Drift;
    /// # impl Model for Drift {
    /// #     type State = Level;
    /// #     type Input = Nothing;
    /// #     type Output = Level;
    /// #     type Parameters = Levels;
    /// #     const KIND: Kind = Kind::Discrete;
    /// #     fn next<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> { Level { x: p.a * x.x } }
    /// #     fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Levels<S>) -> Level<S> { *x }
    /// #     fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> { Level { x: p.q } }
    /// #     fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> { Level { x: p.r } }
    /// # }
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// # let outputs = (0..50).map(|k| Level { x: f64::from(k * 7 % 11) / 11.0 - 0.5 }).collect();
    /// # let record = Experiment::new(&Drift, Time::Uniform { start: 0.0, step: 1.0 }, vec![Nothing; 50], outputs)?;
    /// # let start = Levels { a: free(0.5), q: free(0.3).log(), r: fixed(0.1) };
    /// use greybox::InitialCovariance;
    /// // The state at the first sample is a draw from the plant's own distribution, about zero.
    /// let record = record.initial(Level { x: fixed(0.0) });
    /// let fit = Fit::new(&Drift, &record).parameters(start).predictor(Kalman::starting(InitialCovariance::Stationary));
    /// assert_eq!(fit.run()?.method.predictor, "one-step prediction by a Kalman filter that starts from the stationary covariance");
    /// # Ok(())
    /// # }
    /// ```
    pub fn starting(covariance: InitialCovariance) -> Starting<Kalman> {
        Starting { filter: Kalman, covariance }
    }
}

impl SecondOrder {
    /// This filter with another covariance at the first sample, which follows from the model to the first order.
    pub fn starting(covariance: InitialCovariance) -> Starting<SecondOrder> {
        Starting { filter: SecondOrder, covariance }
    }
}

impl Starting<Kalman> {
    pub(super) fn second_order(&self) -> Starting<SecondOrder> {
        SecondOrder::starting(self.covariance)
    }
}

impl<F: Filter> Filter for Starting<F> {
    type Order = F::Order;

    fn initial(&self) -> InitialCovariance {
        self.covariance
    }

    fn name(&self) -> &'static str {
        self.filter.name()
    }
}
