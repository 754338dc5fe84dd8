//! Model reference adaptive system: the model itself, pulled towards the measured states, with parameters that move
//! along what the remaining error says. No covariance, no interval: tens of nanoseconds per sample.
//!
//! The order matters. Continuous proofs of stability (Lyapunov) say nothing of the sampled loop: with the prediction
//! still on the parameters before the update, a motor's loop is unstable from a fifth of the speed up where it is stable
//! with the corrected ones. [`Mras::check`] looks at the sampled loop itself.

mod law;
mod stability;

pub use law::{AdaptationLaw, Gradient, Moment, Rate};

use super::{Beat, Clock, Divergence, Guard, ObserverError, Update, UpdateOutcome, Watch};
use super::{check_identity, check_not_late, check_starts, in_bounds, not_finite};
use crate::integrate::{Automatic, ModelSystem};
use crate::interval::{Hold, Interval};
use crate::layout::Kind;
use crate::model::Model;
use crate::parameter::Parameter;
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// Whether the prediction already knows what the error told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// The error corrects the parameters, and the prediction to the next sample uses the corrected ones.
    #[default]
    UpdateThenPredict,
    /// The prediction uses the parameters from before the update: the order of the thesis (M. Tenerz,
    /// LiTH-ISY-EX--11/4495--SE, 2011), kept for comparison.
    Thesis,
}

/// How the observer's equation `dx/dt = f(x, u; p) + F e` gets from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stepping {
    /// `F` by itself is exact, `x + (1 - exp(-F Ts)) e`; the model steps as its kind asks: discrete models (exact holds)
    /// by themselves, continuous ones by Runge-Kutta 4.
    #[default]
    Split,
    /// Forward Euler of a continuous model, with `F e` in the derivative; for comparison.
    Euler,
}

/// How an [`Mras`] starts and steps.
#[derive(Clone, Copy)]
pub struct MrasStart<M: Model> {
    /// Start and bounds of each parameter; those fixed are not adapted. Outside its bounds the observer has diverged.
    pub parameters: Of<M::Parameters, Parameter>,
    /// How fast the states are pulled to the measured ones: `F`, 1/s, zero or more.
    pub pull: Of<M::State, f64>,
    /// Order of update and prediction.
    pub order: Order,
    /// How the prediction is made.
    pub stepping: Stepping,
    /// When innovations (in their unit) mean divergence.
    pub watch: Watch<Of<M::State, f64>>,
}

/// Model reference adaptive system for a model whose states are all measured.
///
/// The adaptation law says how the parameters move: [`Gradient`] for any model, laws of a wing (the motor's are in
/// [`pmsm`](crate::pmsm)), or a closure.
///
/// ```
/// use greybox::online::{Mras, MrasStart, Moment, Order, Rate, Stepping, Watch};
/// use greybox::pmsm::{Currents, Drive, Surface, Winding};
/// use greybox::{fixed, free};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let start = MrasStart {
///     parameters: Winding { rs: free(0.4), ls: fixed(4e-3), ke: fixed(0.95) },
///     pull: Currents { id: 100.0, iq: 100.0 },
///     order: Order::UpdateThenPredict,
///     stepping: Stepping::Split,
///     watch: Watch { limit: Currents { id: 10.0, iq: 10.0 }, patience: 10 },
/// };
/// // The law is a closure: the resistance rises where less current flows than was predicted.
/// let law = |seen: &Moment<'_, Surface>| Winding {
///     rs: Rate::Adapt(-seen.e.id * seen.x.id), ls: Rate::Adapt(0.0), ke: Rate::Adapt(0.0),
/// };
/// let mut observer = Mras::new(Surface::new(4)?, law, 1e-3, start)?;
/// for k in 0..2000 {
///     let id = 3.0 / 0.63 * (1.0 - (-0.63 / 4e-3 * 1e-3 * f64::from(k)).exp());
///     observer.update(f64::from(k) * 1e-3, &Drive { ud: 3.0, uq: 0.0, w: 0.0 }, &Currents { id, iq: 0.0 });
/// }
/// assert!((observer.parameters().rs - 0.63).abs() < 0.005);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy)]
pub struct Mras<M: Model, L> {
    model: M,
    law: L,
    start: MrasStart<M>,
    pull: Of<M::State, f64>,
    adapting: Of<M::Parameters, bool>,
    clock: Clock,
    x: Of<M::State, f64>,
    p: Of<M::Parameters, f64>,
    guard: Guard<M::State>,
    stopped: Option<Divergence>,
}

impl<M: Model, L: AdaptationLaw<M>> Mras<M, L> {
    /// An observer for samples `ts` seconds apart; its states start from the first measured ones.
    ///
    /// # Errors
    /// A sample time that is not positive, a start outside its bounds, a logarithm, a pull below zero, forward Euler of
    /// a model that is not continuous, a model with a dead time.
    pub fn new(model: M, law: L, ts: f64, start: MrasStart<M>) -> Result<Self, ObserverError> {
        check_starts::<M::Parameters>(&start.parameters)?;
        check_not_late(&model, &start.parameters)?;
        check_identity::<M::Parameters>(&start.parameters)?;
        if start.stepping == Stepping::Euler && M::KIND != Kind::Continuous {
            return Err(ObserverError::EulerOfDiscrete);
        }
        for (name, &pull) in M::State::NAMES.iter().zip(M::State::into_array(start.pull).as_ref()) {
            if !(pull >= 0.0 && pull.is_finite()) {
                return Err(ObserverError::Pull { state: name, value: pull });
            }
        }
        let pull = M::State::map(start.pull, |f| match start.stepping {
            Stepping::Split => -Scalar::exp_m1(-f * ts),
            Stepping::Euler => f * ts,
        });
        Ok(Mras {
            model,
            law,
            pull,
            adapting: M::Parameters::map(start.parameters, |known| known.free),
            clock: Clock::new(ts)?,
            x: M::State::splat(0.0),
            p: M::Parameters::map(start.parameters, |known| known.start),
            guard: Guard::new(start.watch),
            stopped: None,
            start,
        })
    }

    /// Takes the sample at `t` (s): the states measured then, and the input that holds until the next. The innovation is
    /// measured less predicted states.
    ///
    /// With a state missing (not a number), nothing is corrected. After an input or a time that is not a number, or a
    /// jump in time, the states start from the measured ones again.
    #[inline]
    pub fn update(&mut self, t: f64, u: &Of<M::Input, f64>, measured: &Of<M::State, f64>) -> Update<Of<M::State, f64>> {
        let none = M::State::splat(0.0);
        if let Some(divergence) = self.stopped {
            return Update { innovation: none, outcome: UpdateOutcome::Diverged(divergence) };
        }
        if let Some(signal) = not_finite::<M::Input>(u).or(if t.is_finite() { None } else { Some("t") }) {
            return Update { innovation: none, outcome: UpdateOutcome::Missing { signal } };
        }
        let missing = not_finite::<M::State>(measured);
        let last = self.clock.last;
        let mut outcome = match (self.clock.beat(t), missing) {
            (Beat::Regular, None) => UpdateOutcome::Corrected,
            (Beat::Regular, Some(signal)) => UpdateOutcome::Missing { signal },
            // Without a state to start from, the next sample must try again.
            (_, Some(signal)) => {
                self.clock.last = last;
                return Update { innovation: none, outcome: UpdateOutcome::Missing { signal } };
            }
            (beat, None) => {
                self.x = *measured;
                match beat {
                    Beat::Jump { found } => UpdateOutcome::Restarted { expected: self.clock.ts, found },
                    _ => UpdateOutcome::Started,
                }
            }
        };
        let innovation = match missing {
            None => {
                let (y, x) = (M::State::into_array(*measured), M::State::into_array(self.x));
                M::State::from_fn(|i| y.as_ref()[i] - x.as_ref()[i])
            }
            Some(_) => none,
        };
        match self.step(t, u, innovation) {
            Ok(held) => {
                if let (UpdateOutcome::Corrected, Some(held)) = (outcome, held) {
                    outcome = held;
                }
            }
            Err(divergence) => {
                self.stopped = Some(divergence);
                outcome = UpdateOutcome::Diverged(divergence);
            }
        }
        Update { innovation, outcome }
    }

    /// Corrects and predicts; says which parameter was held.
    #[inline(always)]
    fn step(
        &mut self,
        t: f64,
        u: &Of<M::Input, f64>,
        e: Of<M::State, f64>,
    ) -> Result<Option<UpdateOutcome>, Divergence> {
        let ts = self.clock.ts;
        let rates = self.law.rates(&Moment { model: &self.model, ts, t, x: &self.x, e: &e, u, p: &self.p });
        let (rates, p) = (M::Parameters::into_array(rates), M::Parameters::into_array(self.p));
        let adapting = M::Parameters::into_array(self.adapting);
        let mut held = None;
        let p = M::Parameters::from_fn(|i| {
            let p = p.as_ref()[i];
            match rates.as_ref()[i] {
                _ if !adapting.as_ref()[i] => p,
                Rate::Adapt(rate) => p + rate * ts,
                Rate::Hold { quantity, value, limit } => {
                    let parameter = M::Parameters::NAMES[i];
                    held.get_or_insert(UpdateOutcome::Held { parameter, quantity, value, limit });
                    p
                }
            }
        });
        in_bounds::<M::Parameters>(&p, &self.start.parameters)?;
        let predicted_with = match self.start.order {
            Order::UpdateThenPredict => p,
            Order::Thesis => self.p,
        };
        let x = self.predict(t, u, self.x, e, &predicted_with)?;
        if let Some(signal) = not_finite::<M::State>(&x) {
            return Err(Divergence::NotFinite { signal });
        }
        self.guard.judge(e, |_| 1.0)?;
        (self.x, self.p) = (x, p);
        Ok(held)
    }

    /// The states one sample on.
    #[inline(always)]
    fn predict<S: Scalar>(
        &self,
        t: f64,
        u: &Of<M::Input, f64>,
        x: Of<M::State, S>,
        e: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
    ) -> Result<Of<M::State, S>, Divergence> {
        let ts = self.clock.ts;
        let pulled = |x: Of<M::State, S>| {
            let (x, e) = (M::State::into_array(x), M::State::into_array(e));
            let pull = M::State::into_array(self.pull);
            M::State::from_fn(|i| x.as_ref()[i] + e.as_ref()[i] * pull.as_ref()[i])
        };
        let interval = Interval { t0: t, t1: t + ts, u0: *u, u1: *u, hold: Hold::Zero };
        let system = ModelSystem { model: &self.model, interval: &interval, p };
        if self.start.stepping == Stepping::Euler {
            let x = system.jump(x);
            let slope = self.model.derivative(S::from(t), &x, &M::Input::map(*u, S::from), p);
            return Ok(pulled(crate::integrate::axpy::<M::State, S>(x, ts, slope)));
        }
        let advance = |x| system.step(&Automatic::default(), x, &mut 0.0).map_err(|_| Divergence::Stuck);
        match self.start.order {
            Order::UpdateThenPredict => advance(pulled(x)),
            Order::Thesis => advance(x).map(pulled),
        }
    }

    /// Says which parameters move from now on; those fixed at the start never do.
    pub fn adapt(&mut self, which: Of<M::Parameters, bool>) {
        let (which, known) = (M::Parameters::into_array(which), M::Parameters::into_array(self.start.parameters));
        self.adapting = M::Parameters::from_fn(|i| which.as_ref()[i] && known.as_ref()[i].free);
    }

    /// The states predicted for the next sample.
    pub fn state(&self) -> Of<M::State, f64> {
        self.x
    }

    /// The parameters.
    pub fn parameters(&self) -> Of<M::Parameters, f64> {
        self.p
    }
}
