//! Small models and reproducible noise for the tests of the fit.
#![allow(dead_code, reason = "each test uses some of it")]

use greybox::*;

signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Current { i: "A" } }
signals! { pub struct Pair { y: "V", z: "V" } }
signals! { pub struct Affine { slope: "1", offset: "V" } }
signals! { pub struct Branch { gain: "A/V", tau: "s" } }
signals! { pub struct Coil { r: "ohm", l: "H" } }

/// `y = slope u + offset`, `z = offset u - slope`: linear in its parameters, without state.
#[derive(Clone)]
pub struct Line;

impl Model for Line {
    type State = Nothing;
    type Input = Voltage;
    type Output = Pair;
    type Parameters = Affine;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Affine<S>) -> Pair<S> {
        Pair { y: p.slope * u.u + p.offset, z: p.offset * u.u - p.slope }
    }
}

/// `i = slope u + offset`.
#[derive(Clone)]
pub struct Straight;

impl Model for Straight {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Affine;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Affine<S>) -> Current<S> {
        Current { i: p.slope * u.u + p.offset }
    }
}

/// `tau di/dt = gain u - i`, the current measured.
#[derive(Clone)]
pub struct Lag;

impl Model for Lag {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Branch;
    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Branch<S>) -> Current<S> {
        Current { i: (p.gain * u.u - x.i) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Branch<S>) -> Current<S> {
        *x
    }
}

/// `l di/dt = u - r i`.
#[derive(Clone)]
pub struct Rl;

impl Model for Rl {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Coil;
    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: (u.u - p.r * x.i) / p.l }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Coil<S>) -> Current<S> {
        *x
    }
}

/// Uniform numbers in 0..1 and Gaussian ones, the same on every run.
pub struct Noise(pub u64);

impl Noise {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mixed = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58476d1ce4e5b9);
        ((mixed >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
    pub fn gauss(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (core::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A square wave, so many samples per level, with a level of its own each time.
pub fn levels(samples: usize, hold: usize, seed: u64) -> Vec<f64> {
    let mut noise = Noise(seed);
    let mut level = 0.0;
    (0..samples)
        .map(|k| {
            if k % hold == 0 {
                level = 2.0 * noise.uniform() - 1.0;
            }
            level
        })
        .collect()
}

/// The record that a model makes of these inputs with these parameters, from this state, without noise; the state at its
/// first sample is given.
pub fn simulated<M: Model>(
    model: &M,
    step: f64,
    inputs: Vec<Of<M::Input, f64>>,
    start: Of<M::State, f64>,
    truth: Of<M::Parameters, f64>,
) -> ExperimentOf<M> {
    let run = simulate(model, &truth, &start, Time::Uniform { start: 0.0, step }, &inputs).unwrap();
    run.experiment(model).unwrap().initial(M::State::map(start, fixed))
}

/// The record, whose initial state is given, with the model's own outputs in place of the measured ones.
pub fn with_truth<M: Model>(model: &M, record: &ExperimentOf<M>, truth: Of<M::Parameters, f64>) -> ExperimentOf<M> {
    let Initial::Given(start) = record.initial_state() else { panic!("the initial state is not given") };
    let (start, inputs) = (M::State::from_fn(|i| start[i].start), record.inputs().collect::<Vec<_>>());
    let simulator = Simulator::new(model).hold(record.record().input_hold(0));
    let run = simulator.run(&truth, &start, record.times().clone(), &inputs).unwrap();
    with_outputs(model, record, run.outputs)
}

/// The record with other outputs.
pub fn with_outputs<M: Model>(
    model: &M,
    record: &ExperimentOf<M>,
    outputs: Vec<Of<M::Output, f64>>,
) -> ExperimentOf<M> {
    let made = Experiment::new(model, record.times().clone(), record.inputs().collect(), outputs).unwrap();
    let made = made.named(record.name()).hold(record.record().input_hold(0));
    match record.initial_state() {
        Initial::Given(state) => made.initial(M::State::from_fn(|i| state[i])),
        Initial::FirstSample => made.initial_from_first_sample(),
        Initial::Steady => made.initially_at_rest(),
        Initial::Estimated => made,
        Initial::Free => made.initial_estimated(),
    }
}

/// The record with Gaussian noise of these standard deviations on its outputs.
pub fn noisy<M: Model>(
    model: &M,
    record: &ExperimentOf<M>,
    sigma: Of<M::Output, f64>,
    noise: &mut Noise,
) -> ExperimentOf<M> {
    let sigma = M::Output::into_array(sigma);
    let disturbed = |y: Of<M::Output, f64>| {
        let y = M::Output::into_array(y);
        M::Output::from_fn(|j| y.as_ref()[j] + sigma.as_ref()[j] * noise.gauss())
    };
    let outputs = record.outputs().map(disturbed).collect();
    with_outputs(model, record, outputs)
}
