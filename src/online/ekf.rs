//! The extended Kalman filter in factored form (Bierman-Thornton), on the joint vector of states and parameters. Its
//! Jacobians are the exact slopes of the model's own text. States come first in the joint vector: `U D U^T` then keeps
//! the parameters' covariance in a block of its own, which survives when the state must start anew.

use super::{Beat, Clock, Divergence, Guard, ObserverError, UdFactors, Update, UpdateOutcome, Watch};
use super::{check_all_positive, check_not_late, check_starts, in_bounds, not_finite, prior_std};
use crate::dual::Dual;
use crate::integrate::{Automatic, Integrator, ModelSystem};
use crate::interval::{Hold, Interval};
use crate::model::Model;
use crate::parameter::{Parameter, Transform};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use nalgebra::SMatrix;

/// Initial estimates of an [`Ekf`] and the noise it assumes; standard deviations, each in its signal's unit.
#[derive(Clone, Copy)]
pub struct EkfStart<M: Model> {
    /// Initial state: `free(x0).prior(x0, std)`, or `fixed(x0)` if known exactly.
    pub state: Of<M::State, Parameter>,
    /// Parameters: `free(p0).prior(p0, std)` are estimated; outside their bounds the filter has diverged.
    pub parameters: Of<M::Parameters, Parameter>,
    /// Process noise: standard deviation by which each state strays in one sample.
    pub state_drift: Of<M::State, f64>,
    /// Standard deviation by which each free parameter drifts in one sample; zero for constants.
    pub parameter_drift: Of<M::Parameters, f64>,
    /// Standard deviation of each output's noise.
    pub noise: Of<M::Output, f64>,
    /// How the inputs get from one sample to the next.
    pub hold: Hold,
    /// When innovations (in their standard deviations) mean divergence.
    pub watch: Watch<Of<M::Output, f64>>,
}

/// Joint extended Kalman filter of the states and the free parameters of any model.
///
/// `N` is the number of states plus free parameters (a greater one works, and costs). A parameter with a
/// [`log`](Parameter::log) is filtered as its logarithm: it stays positive.
///
/// ```
/// use greybox::online::{Ekf, EkfStart, Watch};
/// use greybox::pmsm::{Currents, Drive, Surface, Winding};
/// use greybox::{Hold, fixed, free};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let start = EkfStart {
///     state: Currents { id: free(0.0).prior(0.0, 1.0), iq: free(0.0).prior(0.0, 1.0) },
///     parameters: Winding { rs: free(0.5).prior(0.5, 0.2), ls: fixed(4e-3), ke: fixed(0.95) },
///     state_drift: Currents { id: 0.01, iq: 0.01 },
///     parameter_drift: Winding { rs: 1e-5, ls: 0.0, ke: 0.0 },
///     noise: Currents { id: 0.05, iq: 0.05 },
///     hold: Hold::Zero,
///     watch: Watch { limit: Currents { id: 8.0, iq: 8.0 }, patience: 10 },
/// };
/// let mut filter = Ekf::<Surface, 3>::new(Surface::new(4)?, 1e-3, start)?; // two states and one parameter
/// for k in 0..200 {
///     // 3 V along the flux at standstill: in the end 3 V / 0.63 ohm.
///     let id = 3.0 / 0.63 * (1.0 - (-0.63 / 4e-3 * 1e-3 * f64::from(k)).exp());
///     filter.update(f64::from(k) * 1e-3, &Drive { ud: 3.0, uq: 0.0, w: 0.0 }, &Currents { id, iq: 0.0 });
/// }
/// assert!((filter.parameters().rs - 0.63).abs() < 3.0 * filter.deviations().rs);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy)]
pub struct Ekf<M: Model, const N: usize, I: Integrator = Automatic> {
    model: M,
    integrator: I,
    step: f64,
    start: EkfStart<M>,
    lanes: <M::Parameters as Signals>::Array<usize>,
    drift: [f64; N],
    clock: Clock,
    input: Option<Of<M::Input, f64>>,
    x: Of<M::State, f64>,
    p: Of<M::Parameters, f64>,
    covariance: UdFactors<N>,
    nis: f64,
    guard: Guard<M::Output>,
    stopped: Option<Divergence>,
}

type Step<Y> = Result<Update<Y>, (Y, Divergence)>;

impl<M: Model, const N: usize> Ekf<M, N> {
    /// A filter for samples `ts` seconds apart, with the integrator that the model's kind asks for.
    ///
    /// # Errors
    /// As [`Ekf::with_integrator`].
    pub fn new(model: M, ts: f64, start: EkfStart<M>) -> Result<Self, ObserverError> {
        Self::with_integrator(model, Automatic::default(), ts, start)
    }
}

impl<M: Model, const N: usize, I: Integrator> Ekf<M, N, I> {
    /// A filter with an integrator of one's own.
    ///
    /// # Errors
    /// A sample time or noise that is not positive, a start outside its bounds, a free quantity without prior, more
    /// states and free parameters than `N`, a model with a dead time.
    pub fn with_integrator(model: M, integrator: I, ts: f64, start: EkfStart<M>) -> Result<Self, ObserverError> {
        check_starts::<M::State>(&start.state)?;
        check_starts::<M::Parameters>(&start.parameters)?;
        check_not_late(&model, &start.parameters)?;
        check_all_positive::<M::Output>("the noise", &start.noise)?;
        let (state, known) = (M::State::into_array(start.state), M::Parameters::into_array(start.parameters));
        let needed = M::State::LEN + known.as_ref().iter().filter(|known| known.free).count();
        if needed > N {
            return Err(ObserverError::Capacity { needed, capacity: N });
        }
        let (mut variances, mut drift) = ([0.0; N], [0.0; N]);
        let state_drift = M::State::into_array(start.state_drift);
        for (i, known) in state.as_ref().iter().enumerate() {
            let std = prior_std(M::State::NAMES[i], known)?;
            (variances[i], drift[i]) = (std * std, state_drift.as_ref()[i] * state_drift.as_ref()[i]);
        }
        let parameter_drift = M::Parameters::into_array(start.parameter_drift);
        let mut lanes = M::Parameters::array_from_fn(|_| usize::MAX);
        let free = (0..M::Parameters::LEN).filter(|&i| known.as_ref()[i].free);
        for (lane, i) in (M::State::LEN..).zip(free) {
            let known = &known.as_ref()[i];
            let slope = known.transform.slope(known.start);
            let std = prior_std(M::Parameters::NAMES[i], known)? / slope;
            let walk = parameter_drift.as_ref()[i] / slope;
            (variances[lane], drift[lane]) = (std * std, walk * walk);
            lanes.as_mut()[i] = lane;
        }
        Ok(Ekf {
            model,
            integrator,
            step: 0.0,
            lanes,
            drift,
            clock: Clock::new(ts)?,
            input: None,
            x: M::State::map(start.state, |known| known.start),
            p: M::Parameters::map(start.parameters, |known| known.start),
            covariance: UdFactors::diagonal(variances),
            nis: 0.0,
            guard: Guard::new(start.watch),
            stopped: None,
            start,
        })
    }

    /// Takes the sample at `t` (s): the outputs measured then, and the input that holds from then on (or is met then,
    /// under a first-order hold). Predicts from the sample before to this one and corrects.
    ///
    /// An output that is not a number is not used. After an input or a time that is not a number, or a jump in time,
    /// the state starts anew from its initial uncertainty; the parameters keep theirs.
    #[inline]
    pub fn update(&mut self, t: f64, u: &Of<M::Input, f64>, y: &Of<M::Output, f64>) -> Update<Of<M::Output, f64>> {
        let none = M::Output::splat(0.0);
        if let Some(divergence) = self.stopped {
            return Update { innovation: none, outcome: UpdateOutcome::Diverged(divergence) };
        }
        if let Some(signal) = not_finite::<M::Input>(u).or(if t.is_finite() { None } else { Some("t") }) {
            return Update { innovation: none, outcome: UpdateOutcome::Missing { signal } };
        }
        let before = (self.x, self.p, self.covariance);
        match self.step(t, u, y) {
            Ok(update) => update,
            Err((innovation, divergence)) => {
                (self.x, self.p, self.covariance) = before;
                self.stopped = Some(divergence);
                Update { innovation, outcome: UpdateOutcome::Diverged(divergence) }
            }
        }
    }

    /// The update, or why it cannot stand, with the innovation that told.
    #[inline(always)]
    fn step(&mut self, t: f64, u: &Of<M::Input, f64>, y: &Of<M::Output, f64>) -> Step<Of<M::Output, f64>> {
        let none = M::Output::splat(0.0);
        let since = self.clock.last.unwrap_or(t);
        let mut outcome = match (self.clock.beat(t), self.input.replace(*u)) {
            (Beat::Regular, Some(u0)) => {
                let interval = Interval { t0: since, t1: t, u0, u1: *u, hold: self.start.hold };
                self.predict(&interval).map_err(|divergence| (none, divergence))?;
                UpdateOutcome::Corrected
            }
            (Beat::Jump { found }, _) => {
                let mut variances = M::State::array_from_fn(|_| 0.0);
                let state = M::State::into_array(self.start.state);
                for (variance, known) in variances.as_mut().iter_mut().zip(state.as_ref()) {
                    *variance = known.prior.map_or(0.0, |prior| prior.std * prior.std);
                }
                self.covariance.renew(variances.as_ref());
                UpdateOutcome::Restarted { expected: self.clock.ts, found }
            }
            _ => UpdateOutcome::Started,
        };

        let u = M::Input::map(*u, Dual::from);
        let y_hat = M::Output::into_array(self.model.output(Dual::from(t), &self.x_dual(), &u, &self.p_dual()));
        let (y, noise) = (M::Output::into_array(*y), M::Output::into_array(self.start.noise));
        let mut prior = M::Output::array_from_fn(|_| 0.0);
        let (mut whitened, mut deviations) = (prior, prior);
        let mut dz = [0.0; N];
        self.nis = 0.0;
        for i in 0..M::Output::LEN {
            let (y, Dual { value, slopes }) = (y.as_ref()[i], y_hat.as_ref()[i]);
            if !y.is_finite() {
                outcome = UpdateOutcome::Missing { signal: M::Output::NAMES[i] };
                continue;
            }
            let mut e = y - value;
            prior.as_mut()[i] = e;
            for (slope, dz) in slopes.iter().zip(&dz) {
                e -= slope * dz;
            }
            let gain = self.covariance.absorb(&slopes, noise.as_ref()[i] * noise.as_ref()[i]);
            for (dz, gain) in dz.iter_mut().zip(&gain.gain) {
                *dz += gain * e;
            }
            self.nis += e * e / gain.variance;
            whitened.as_mut()[i] = e;
            deviations.as_mut()[i] = Scalar::sqrt(gain.variance);
        }
        self.correct(&dz);

        let innovation = M::Output::from_array(prior);
        self.check().map_err(|divergence| (none, divergence))?;
        self.guard
            .judge(M::Output::from_array(whitened), |i| deviations.as_ref()[i])
            .map_err(|divergence| (innovation, divergence))?;
        Ok(Update { innovation, outcome })
    }

    #[inline(always)]
    fn predict(&mut self, interval: &Interval<M::Input>) -> Result<(), Divergence> {
        let (x, p) = (self.x_dual(), self.p_dual());
        let system = ModelSystem { model: &self.model, interval, p: &p };
        let x = system.step(&self.integrator, x, &mut self.step).map_err(|_| Divergence::Stuck)?;
        self.x = M::State::map(x, |x| x.value);
        self.covariance.predict(M::State::into_array(M::State::map(x, |x| x.slopes)).as_ref(), &self.drift);
        Ok(())
    }

    #[inline(always)]
    fn correct(&mut self, dz: &[f64; N]) {
        let (x, p) = (M::State::into_array(self.x), M::Parameters::into_array(self.p));
        self.x = M::State::from_fn(|i| x.as_ref()[i] + dz[i]);
        let known = M::Parameters::into_array(self.start.parameters);
        self.p = M::Parameters::from_fn(|i| {
            let (p, lane) = (p.as_ref()[i], self.lanes.as_ref()[i]);
            match (dz.get(lane), known.as_ref()[i].transform) {
                (None, _) => p,
                (Some(dz), Transform::Identity) => p + dz,
                (Some(dz), Transform::Log) => p * Scalar::exp(*dz),
            }
        });
    }

    #[inline(always)]
    fn check(&self) -> Result<(), Divergence> {
        if let Some(signal) = not_finite::<M::State>(&self.x) {
            return Err(Divergence::NotFinite { signal });
        }
        in_bounds::<M::Parameters>(&self.p, &self.start.parameters)
    }

    #[inline(always)]
    fn x_dual(&self) -> Of<M::State, Dual<N>> {
        let x = M::State::into_array(self.x);
        M::State::from_fn(|i| Dual::variable(x.as_ref()[i], i))
    }

    #[inline(always)]
    fn p_dual(&self) -> Of<M::Parameters, Dual<N>> {
        let (p, known) = (M::Parameters::into_array(self.p), M::Parameters::into_array(self.start.parameters));
        M::Parameters::from_fn(|i| {
            let p = p.as_ref()[i];
            let unit = Dual::variable(p, self.lanes.as_ref()[i]);
            unit.chain(p, known.as_ref()[i].transform.slope(p))
        })
    }

    /// The states at the last sample.
    pub fn state(&self) -> Of<M::State, f64> {
        self.x
    }

    /// The parameters.
    pub fn parameters(&self) -> Of<M::Parameters, f64> {
        self.p
    }

    /// Standard deviations of the states.
    pub fn state_deviations(&self) -> Of<M::State, f64> {
        M::State::from_fn(|i| Scalar::sqrt(self.covariance.variance(i)))
    }

    /// Standard deviations of the parameters, by first order where a logarithm is filtered; zero for what is fixed.
    pub fn deviations(&self) -> Of<M::Parameters, f64> {
        let (p, known) = (M::Parameters::into_array(self.p), M::Parameters::into_array(self.start.parameters));
        M::Parameters::from_fn(|i| {
            let slope = known.as_ref()[i].transform.slope(p.as_ref()[i]);
            Scalar::sqrt(self.covariance.variance(self.lanes.as_ref()[i])) * slope
        })
    }

    /// Covariance of states, then free parameters in order of declaration (in logarithms where those are filtered).
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.covariance.matrix()
    }

    /// Normalized square of the last innovation: chi-squared, with one degree of freedom per output used, if the model
    /// and the noise are right.
    pub fn nis(&self) -> f64 {
        self.nis
    }
}
