//! [`simulate`]: what a model does with given parameters, and records made of it.

mod coarse;
mod disturbed;

use crate::error::{Error, Failure};
use crate::experiment::{Experiment, ExperimentOf};
use crate::integrate::{Automatic, Integrator, Method, ModelSystem, Stuck};
use crate::interval::{Hold, Interval};
use crate::layout::Kind;
use crate::model::Model;
use crate::numeral::TimeUnit;
use crate::random::Random;
use crate::record::{Channel, NO_DEAD_TIME, Part, Record, Time, is_dead_time};
use crate::signals::{Of, Signals};
pub(crate) use disturbed::Disturbance;

use coarse::Coarse;

/// Simulates a model from an initial state, its inputs held from sample to sample, by the step that its kind asks for;
/// [`Simulator`] has the choice.
///
/// ```
/// use greybox::{Model, Scalar, Time, signals, simulate};
/// signals! { pub struct Speed { w: "rad/s" } pub struct Torque { m: "N m" } pub struct Shaft { j: "kg m^2", b: "N m s" } }
/// struct Rotor;
/// impl Model for Rotor {
///     type State = Speed; type Input = Torque; type Output = Speed; type Parameters = Shaft;
///     fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Torque<S>, p: &Shaft<S>) -> Speed<S> {
///         Speed { w: (u.m - p.b * x.w) / p.j }
///     }
///     fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Torque<S>, _p: &Shaft<S>) -> Speed<S> { *x }
/// }
/// let (shaft, time) = (Shaft { j: 0.1, b: 0.2 }, Time::Uniform { start: 0.0, step: 0.01 });
/// let run = simulate(&Rotor, &shaft, &Speed { w: 0.0 }, time, &vec![Torque { m: 1.0 }; 500])?;
/// assert!((run.outputs[499].w - 5.0).abs() < 1e-3); // m / b, after ten time constants
/// let record = run.with_noise(Speed { w: 0.05 }, 7).experiment(&Rotor)?; // a record to try a fit on
/// # assert_eq!(record.len(), 500);
/// # Ok::<(), greybox::Error>(())
/// ```
///
/// # Errors
/// As [`Simulator::run`].
pub fn simulate<M: Model>(
    model: &M,
    parameters: &Of<M::Parameters, f64>,
    initial: &Of<M::State, f64>,
    time: Time,
    inputs: &[Of<M::Input, f64>],
) -> Result<Simulation<M>, Error> {
    Simulator::new(model).run(parameters, initial, time, inputs)
}

/// A simulation about to be run: the method, the hold of the inputs, and whether the plant is disturbed.
#[derive(Clone, Debug)]
pub struct Simulator<'a, M, I = Automatic> {
    model: &'a M,
    integrator: I,
    hold: Hold,
    disturbed: Option<u64>,
    /// Whether the method was chosen.
    chosen: bool,
}

impl<'a, M: Model> Simulator<'a, M> {
    /// By the step that the model's kind asks for, inputs held from sample to sample.
    ///
    /// Of a continuous model that is one step of [`Rk4`](crate::Rk4) per sample: a time constant of one sample comes out 2 % off. Where two steps
    /// would change a state by more than a tenth of its largest value, the run is an error. Where the simulation stands for a plant, take
    /// [`Rk45`](crate::Rk45) or [`Esdirk`](crate::Esdirk).
    pub fn new(model: &'a M) -> Self {
        Simulator { model, integrator: Automatic::default(), hold: Hold::default(), disturbed: None, chosen: false }
    }
}

impl<'a, M: Model, I: Integrator> Simulator<'a, M, I> {
    /// Steps the model by another method.
    pub fn integrator<J: Integrator>(self, integrator: J) -> Simulator<'a, M, J> {
        Simulator { model: self.model, integrator, hold: self.hold, disturbed: self.disturbed, chosen: true }
    }

    /// Says how the inputs behave between samples.
    pub fn hold(self, hold: Hold) -> Self {
        Simulator { hold, ..self }
    }

    /// Disturbs the state by the process noise of the model ([`Model::diffusion`]); the same seed draws the same. After each interval a normal number
    /// is added, with the covariance that noise leaves there with the slopes of the model at its begin: exact of a model that is affine in its
    /// state, of others to the first order in the length of the interval.
    ///
    /// ```
    /// # use greybox::{Kind, Model, Nothing, Scalar, Simulator, Time, signals};
    /// # signals! { pub struct Level { x: "m" } }
    /// # signals! { pub struct Rates { a: "1/s", q: "m/s^0.5" } }
    /// # struct Drift;
    /// # impl Model for Drift {
    /// #     type State = Level;
    /// #     type Input = Nothing;
    /// #     type Output = Level;
    /// #     type Parameters = Rates;
    /// #     fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, p: &Rates<S>) -> Level<S> { Level { x: -(p.a * x.x) } }
    /// #     fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Rates<S>) -> Level<S> { *x }
    /// #     fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Rates<S>) -> Level<S> { Level { x: p.q } }
    /// # }
    /// let (truth, time) = (Rates { a: 0.5, q: 0.2 }, Time::Uniform { start: 0.0, step: 1.0 });
    /// let run = Simulator::new(&Drift).disturbed(7).run(&truth, &Level { x: 0.0 }, time, &[Nothing; 2000])?;
    /// let variance = run.states.iter().map(|x| x.x * x.x).sum::<f64>() / 2000.0;
    /// assert!((variance / 0.04 - 1.0).abs() < 0.2); // q^2 / 2a
    /// # Ok::<(), greybox::Error>(())
    /// ```
    pub fn disturbed(self, seed: u64) -> Self {
        Simulator { disturbed: Some(seed), ..self }
    }

    /// Simulates from the initial state; one sample for each row of inputs.
    ///
    /// # Errors
    /// No input row, time that does not increase or does not go with the inputs, an input that is not finite, a method that
    /// does not serve the model; a state or an output that is not finite, an integrator that is stuck, steps that nobody chose and that are far too
    /// long ([`Error::Simulation`]).
    pub fn run(
        &self,
        parameters: &Of<M::Parameters, f64>,
        initial: &Of<M::State, f64>,
        time: Time,
        inputs: &[Of<M::Input, f64>],
    ) -> Result<Simulation<M>, Error> {
        self.check(&time, inputs)?;
        let late = self.late(parameters, &time, inputs)?;
        let mut x = *initial;
        let (mut step, mut finer_step) = (0.0, 0.0);
        let finer = if self.chosen { None } else { Integrator::refined(&self.integrator, M::KIND) };
        let mut coarse = Coarse::<M::State>::new();
        let mut disturbance = self.disturbed.map(|seed| Disturbance::new(M::State::LEN, seed));
        let (mut states, mut outputs) = (Vec::with_capacity(inputs.len()), Vec::with_capacity(inputs.len()));
        for (k, u) in inputs.iter().enumerate() {
            finite::<M::State>("state", &x, k, &time)?;
            let here = late.as_ref().map_or(*u, |late| late.at::<M::Input>(k));
            let y = self.model.output(time.at(k), &x, &here, parameters);
            finite::<M::Output>("output", &y, k, &time)?;
            states.push(x);
            outputs.push(y);
            let Some(&next) = inputs.get(k + 1) else { break };
            let u1 = if self.hold == Hold::First { next } else { *u };
            let interval = Interval { t0: time.at(k), t1: time.at(k + 1), u0: *u, u1, hold: self.hold };
            let parts = match &late {
                Some(late) => &late.parts::<M::Input>(M::KIND, k)[..],
                None => &[interval],
            };
            let over = |interval| ModelSystem { model: self.model, interval, p: parameters };
            let sample = Interval { u0: here, u1: here, ..interval };
            x = over(&sample).jump(x);
            let begin = x;
            for interval in parts {
                let from = x;
                x = over(interval)
                    .flow(&self.integrator, from, &mut step)
                    .map_err(|Stuck| failure("the progress of the integrator".to_owned(), 0.0, k, &time))?;
                let compared = finer.as_ref().map(|finer| over(interval).flow(finer, from, &mut finer_step));
                if let Some(Ok(two)) = compared {
                    coarse.compare(k + 1, &x, &two);
                }
            }
            if let (Some(disturbance), Some(first)) = (&mut disturbance, parts.first()) {
                x = disturbance.add(&over(first), &begin, time.at(k + 1) - time.at(k), &x);
            }
        }
        coarse.check(&time)?;
        Ok(Simulation { time, hold: self.hold, inputs: inputs.to_vec(), states, outputs })
    }

    /// The inputs as the model has them, if any has a dead time.
    fn late(
        &self,
        parameters: &Of<M::Parameters, f64>,
        time: &Time,
        inputs: &[Of<M::Input, f64>],
    ) -> Result<Option<Late>, Error> {
        let delays = M::Input::into_array(self.model.delay(parameters));
        let delays = delays.as_ref();
        if delays.iter().all(|delay| *delay == 0.0) {
            return Ok(None);
        }
        if let Some(i) = delays.iter().position(|delay| !is_dead_time(*delay)) {
            let signal = format!("the dead time of input `{}`", M::Input::NAMES[i]);
            return Err(failed(signal, delays[i], 0, time, NO_DEAD_TIME));
        }
        let values = |i: usize| inputs.iter().map(|u| M::Input::into_array(*u).as_ref()[i]).collect::<Vec<f64>>();
        let channels = (0..delays.len()).map(|i| Channel::new(M::Input::NAMES[i], M::Input::UNITS[i], values(i)));
        let record = Record::new(vec![], time.clone(), channels.collect(), vec![])?.hold(self.hold);
        Ok(Some(Late { record, delays: delays.iter().map(|delay| (*delay != 0.0).then_some(*delay)).collect() }))
    }

    fn check(&self, time: &Time, inputs: &[Of<M::Input, f64>]) -> Result<(), Error> {
        if inputs.is_empty() {
            let (experiment, purpose) = ("simulation".to_owned(), "of inputs, to simulate");
            return Err(Error::TooFewSamples { experiment, samples: 0, needed: 1, purpose });
        }
        time.check("simulation", inputs.len(), "the inputs", &TimeUnit::default())?;
        let bad = |u: &Of<M::Input, f64>| M::Input::into_array(*u).as_ref().iter().position(|u| !u.is_finite());
        if let Some((sample, i)) = inputs.iter().enumerate().find_map(|(k, u)| Some((k, bad(u)?))) {
            let (experiment, signal) = ("simulation".to_owned(), M::Input::NAMES[i].to_owned());
            let value = M::Input::into_array(inputs[sample]).as_ref()[i];
            return Err(Error::NotFinite { experiment, signal, value, sample, time: time.at(sample).into() });
        }
        Method::check(&self.integrator, M::KIND)
    }
}

/// Inputs with their dead times.
struct Late {
    record: Record,
    delays: Vec<Option<f64>>,
}

impl Late {
    /// The inputs at a sample.
    fn at<U: Signals>(&self, k: usize) -> Of<U, f64> {
        let u = self.record.late_inputs(k, &self.delays);
        U::from_fn(|i| u[i])
    }

    /// An interval between two samples, by what the inputs do in it; a discrete model makes one step.
    fn parts<U: Signals>(&self, kind: Kind, k: usize) -> Vec<Interval<U>> {
        let of = |u: &[f64]| U::from_fn(|i| u[i]);
        if kind != Kind::Continuous {
            let (t0, t1, u) = (self.record.time(k), self.record.time(k + 1), self.at::<U>(k));
            return vec![Interval { t0, t1, u0: u, u1: u, hold: Hold::Zero }];
        }
        let parts = self.record.parts(k, &self.delays).into_iter();
        let part = |part: Part<f64>| {
            let (t0, t1) = (part.t0, part.t0 + part.length);
            Interval { t0, t1, u0: of(&part.u0), u1: of(&part.u1), hold: Hold::First }
        };
        parts.map(part).collect()
    }
}

fn failure(signal: String, value: f64, sample: usize, time: &Time) -> Error {
    let hint = "; check the parameters and the initial state, or take a shorter step or a stiff method";
    failed(signal, value, sample, time, hint)
}

fn failed(signal: String, value: f64, sample: usize, time: &Time, hint: &'static str) -> Error {
    Error::Simulation(Failure {
        experiment: "simulation".to_owned(),
        sample,
        time: time.at(sample).into(),
        signal,
        value,
        hint,
    })
}

/// Refuses a vector with an entry that is not finite.
fn finite<S: Signals>(what: &str, signals: &Of<S, f64>, k: usize, time: &Time) -> Result<(), Error> {
    let entries = S::into_array(*signals);
    match entries.as_ref().iter().position(|value| !value.is_finite()) {
        Some(i) => Err(failure(format!("{what} `{}`", S::NAMES[i]), entries.as_ref()[i], k, time)),
        None => Ok(()),
    }
}

/// Result of a simulation.
#[derive(Debug)]
pub struct Simulation<M: Model> {
    /// When.
    pub time: Time,
    /// How the inputs behave between samples.
    pub hold: Hold,
    /// Inputs, one row per sample.
    pub inputs: Vec<Of<M::Input, f64>>,
    /// States, one row per sample.
    pub states: Vec<Of<M::State, f64>>,
    /// Outputs, one row per sample.
    pub outputs: Vec<Of<M::Output, f64>>,
}

impl<M: Model> Simulation<M> {
    /// The outputs with white Gaussian noise of these standard deviations added; the same seed adds the same noise.
    pub fn with_noise(mut self, sigma: Of<M::Output, f64>, seed: u64) -> Self {
        let sigma = M::Output::into_array(sigma);
        for (j, sigma) in sigma.as_ref().iter().enumerate() {
            let mut random = Random::stream(seed, j as u64);
            for y in &mut self.outputs {
                let mut entries = M::Output::into_array(*y);
                entries.as_mut()[j] += sigma * random.normal();
                *y = M::Output::from_array(entries);
            }
        }
        self
    }

    /// The run as a record; its initial state is to be estimated.
    ///
    /// # Errors
    /// As [`Experiment::new`].
    pub fn experiment(&self, model: &M) -> Result<ExperimentOf<M>, Error> {
        let record = Experiment::new(model, self.time.clone(), self.inputs.clone(), self.outputs.clone())?;
        Ok(record.hold(self.hold))
    }
}

// `derive` would ask for the same of `M`.
impl<M: Model> Clone for Simulation<M> {
    fn clone(&self) -> Self {
        let (time, hold, inputs) = (self.time.clone(), self.hold, self.inputs.clone());
        Simulation { time, hold, inputs, states: self.states.clone(), outputs: self.outputs.clone() }
    }
}
