//! Initial states that the outputs do not give, or not at the first sample, start where they can, and the report says so.

use crate::common::{Branch, Current, Lag, Voltage, levels};
use crate::refused::says;
use greybox::optimize::Severity;
use greybox::*;

signals! { pub struct Motion { x: "m", v: "m/s" } }
signals! { pub struct Position { x: "m" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Spring { c: "1/s^2", d: "1/s" } }
signals! { pub struct Speeds { a: "m/s", b: "m/s" } }
signals! { pub struct Level { h: "m" } }
signals! { pub struct Levels { h1: "m", h2: "m" } }
signals! { pub struct Outlets { c1: "m^0.5/s", c2: "m^0.5/s" } }

/// A mass on a spring, its position measured.
struct Oscillator;

impl Model for Oscillator {
    type State = Motion;
    type Input = Force;
    type Output = Position;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Motion { x: x.v, v: u.f - p.c * x.x - p.d * x.v }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Position<S> {
        Position { x: x.x }
    }
}

/// The same, its states measured together: their sum, and the speed now and then.
struct Together;

impl Model for Together {
    type State = Motion;
    type Input = Force;
    type Output = Speeds;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Oscillator.derivative(t, x, u, p)
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Speeds<S> {
        Speeds { a: x.x + x.v, b: x.v }
    }
}

/// The same with two sensors of the sum.
struct Twice;

impl Model for Twice {
    type State = Motion;
    type Input = Force;
    type Output = Speeds;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Oscillator.derivative(t, x, u, p)
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Speeds<S> {
        Speeds { a: x.x + x.v, b: x.x + x.v }
    }
}

/// Two sensors that differ by their noise give the sum of two states to their mean, which both states share.
#[test]
fn sensors_that_differ_give_their_mean() {
    let inputs: Vec<Force> = (0..200).map(|k| Force { f: f64::from(k / 20 % 3) }).collect();
    let (truth, time) = (Spring { c: 2.0, d: 0.4 }, Time::Uniform { start: 0.0, step: 0.1 });
    let run = simulate(&Twice, &truth, &Motion { x: 0.5, v: 0.6 }, time.clone(), &inputs).unwrap();
    let mut outputs = run.with_noise(Speeds { a: 0.1, b: 0.1 }, 5).outputs;
    outputs[0] = Speeds { a: 1.0, b: 1.2 };
    let record = Experiment::new(&Twice, time, inputs, outputs).unwrap();
    let fit = Fit::new(&Twice, &record).parameters(Spring { c: free(1.5), d: free(0.5) }).run().unwrap();
    // The damping of states that are not given, a millionth, leaves its square.
    assert!(fit.unknowns[2..].iter().all(|state| (state.start - 0.55).abs() < 1e-9), "{fit}");
}

signals! { pub struct Acid { x: "mol/l" } }
signals! { pub struct Meter { ph: "1" } }
signals! { pub struct Titration { rate: "1/s", height: "1", width: "l/mol" } }

/// A stirred vessel with a meter that saturates at 4 and at 10.
struct Vessel;

impl Model for Vessel {
    type State = Acid;
    type Input = Force;
    type Output = Meter;
    type Parameters = Titration;
    fn derivative<S: Scalar>(&self, _t: S, x: &Acid<S>, u: &Force<S>, p: &Titration<S>) -> Acid<S> {
        Acid { x: (u.f - x.x) * p.rate }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Acid<S>, _u: &Force<S>, p: &Titration<S>) -> Meter<S> {
        Meter { ph: p.height * ((x.x - 1.0) * p.width).tanh() + 7.0 }
    }
}

/// A first measurement beyond where the output saturates, by its noise, leaves the state at zero: Newton's steps towards it led to
/// -1e9 and farther, where nothing has an influence on the output.
#[test]
fn a_measurement_beyond_saturation_leads_nowhere() {
    let inputs: Vec<Force> = (0..300).map(|k| Force { f: [0.4, 1.5, 0.9, 1.9, 1.1][k / 12 % 5] }).collect();
    let (truth, time) = (Titration { rate: 0.3, height: 3.0, width: 2.0 }, Time::Uniform { start: 0.0, step: 0.2 });
    let run =
        simulate(&Vessel, &truth, &Acid { x: 0.3 }, time.clone(), &inputs).unwrap().with_noise(Meter { ph: 0.1 }, 3);
    let mut outputs: Vec<Meter> = run.outputs.clone();
    outputs[0].ph = 3.9;
    let record = Experiment::new(&Vessel, time, inputs, outputs).unwrap();
    let start = Titration { rate: free(0.4), height: free(2.5), width: free(1.6) };
    let fit = Fit::new(&Vessel, &record).parameters(start).run().unwrap();
    assert!(fit.unknowns[3].start == 0.0 && fit.severity() < Severity::NotUsable, "{fit}");
    // Four standard errors for three parameters.
    for (unknown, truth) in fit.unknowns.iter().zip(Titration::into_array(truth)) {
        assert!((unknown.value - truth).abs() < 4.0 * unknown.knowledge.standard_error().unwrap(), "{fit}");
    }
}

/// Two tanks, one above the other, the lower level measured.
struct Tanks;

impl Model for Tanks {
    type State = Levels;
    type Input = Force;
    type Output = Level;
    type Parameters = Outlets;
    fn derivative<S: Scalar>(&self, _t: S, x: &Levels<S>, u: &Force<S>, p: &Outlets<S>) -> Levels<S> {
        let (upper, lower) = (p.c1 * x.h1.sqrt(), p.c2 * x.h2.sqrt());
        Levels { h1: u.f - upper, h2: upper - lower }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Levels<S>, _u: &Force<S>, _p: &Outlets<S>) -> Level<S> {
        Level { h: x.h2 }
    }
}

/// A tank whose level is measured as a logarithm.
struct Logarithm;

impl Model for Logarithm {
    type State = Level;
    type Input = Force;
    type Output = Level;
    type Parameters = Outlets;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Force<S>, p: &Outlets<S>) -> Level<S> {
        Level { h: p.c1 * u.f - p.c2 * x.h }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Force<S>, _p: &Outlets<S>) -> Level<S> {
        Level { h: x.h.ln() }
    }
}

const SAMPLES: usize = 300;

fn forces(mean: f64) -> Vec<Force> {
    (0..SAMPLES).map(|k| Force { f: mean + if k / 40 % 2 == 0 { 0.5 * mean } else { -0.5 * mean } }).collect()
}

fn record<M: Model<Input = Force>>(
    model: &M,
    p: M::Parameters,
    x: M::State,
    noise: M::Output,
    mean: f64,
) -> ExperimentOf<M>
where
    M::Parameters: Signals<Of<f64> = M::Parameters>,
    M::State: Signals<Of<f64> = M::State>,
    M::Output: Signals<Of<f64> = M::Output>,
{
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let exact = Rk45 { relative: 1e-11, absolute: 1e-13 };
    let run = Simulator::new(model).integrator(exact).run(&p, &x, time, &forces(mean)).unwrap();
    run.with_noise(noise, 1).experiment(model).unwrap()
}

fn guessed(estimate: &Summary) -> Option<&str> {
    let found = estimate.warnings.iter().find(|warning| warning.code == WarningCode::GuessedStart)?;
    assert_eq!(found.severity, Severity::Usable);
    Some(&found.text)
}

const SPRING: Spring = Spring { c: 4.0, d: 0.3 };

fn start() -> Spring<Parameter> {
    Spring { c: free(3.0), d: free(0.5) }
}

/// The truth within five standard errors, and the report says what was guessed.
#[test]
fn a_state_that_no_output_gives_starts_from_zero() {
    let record = record(&Oscillator, SPRING, Motion { x: 0.4, v: -0.7 }, Position { x: 0.01 }, 1.0);
    let estimate = Fit::new(&Oscillator, &record).parameters(start()).run().unwrap();
    for (unknown, truth) in estimate.unknowns.iter().zip([4.0, 0.3, 0.4, -0.7]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 5.0 * error, "{estimate}");
    }
    assert_eq!(estimate.unknowns[3].start, 0.0);
    let text = guessed(&estimate).unwrap();
    assert!(text.contains("do not give `v(0)`") && text.contains("a start of 0"), "{text}");
    assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
    // Given, nothing is guessed.
    let given = record.initial(Motion { x: free(0.0), v: free(0.0) });
    assert_eq!(guessed(&Fit::new(&Oscillator, &given).parameters(start()).run().unwrap()), None);
}

/// The first measurement of each output counts, be they at different samples.
#[test]
fn a_first_sample_that_is_missing_looks_at_the_next_ones() {
    let whole = record(&Together, SPRING, Motion { x: 0.4, v: -0.7 }, Speeds { a: 1e-6, b: 1e-6 }, 1.0);
    let outputs = (0..SAMPLES).map(|k| {
        let Speeds { a, b } = whole.output(k);
        Speeds { a: if k < 2 { f64::NAN } else { a }, b: if k % 10 == 4 { b } else { f64::NAN } }
    });
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let record = Experiment::new(&Together, time, forces(1.0), outputs.collect()).unwrap();
    let estimate = Fit::new(&Together, &record).parameters(start()).run().unwrap();
    assert_eq!(guessed(&estimate), None, "{estimate}");
    let (a, b) = (whole.output(2).a, whole.output(4).b);
    let starts: Vec<f64> = estimate.unknowns[2..].iter().map(|unknown| unknown.start).collect();
    assert!((starts[0] - (a - b)).abs() < 1e-12 && (starts[1] - b).abs() < 1e-12, "{starts:?}");
    assert!((estimate.parameters.c - 4.0).abs() < 1e-4, "{estimate}");
    // What is taken from the first sample must be there.
    let first = Fit::new(&Together, &record.initial_from_first_sample()).parameters(start()).run();
    says(
        first,
        &["2 state(s), x, v, but 0 measured of the output(s) a, b at t = 0)", "leave initial_from_first_sample out"],
    );
}

/// A level of zero has a root of infinite slope: the guess is one.
#[test]
fn a_state_whose_equations_are_undefined_at_zero_starts_from_one() {
    let record = record(&Tanks, Outlets { c1: 0.5, c2: 0.4 }, Levels { h1: 0.3, h2: 0.6 }, Level { h: 0.002 }, 0.3);
    let parameters = Outlets { c1: free(0.7), c2: free(0.6) };
    let estimate = Fit::new(&Tanks, &record).parameters(parameters).run().unwrap();
    assert!(guessed(&estimate).unwrap().contains("do not give `h1(0)`: estimated, from a start of 1"), "{estimate}");
    for (unknown, truth) in estimate.unknowns.iter().zip([0.5, 0.4, 0.3, 0.6]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 5.0 * error, "{estimate}");
    }
}

/// `ln(0)` is not finite; the state is found from one on. Where the state is given as zero, the error says what is wrong.
#[test]
fn an_output_that_is_a_logarithm() {
    let truth = Outlets { c1: 0.8, c2: 0.5 };
    let record = record(&Logarithm, truth, Level { h: 3.0 }, Level { h: 1e-3 }, 1.0);
    let parameters = Outlets { c1: free(0.5), c2: free(0.9) };
    let estimate = Fit::new(&Logarithm, &record).parameters(parameters).run().unwrap();
    assert_eq!(guessed(&estimate), None);
    assert!((estimate.unknowns[2].start - 3.0).abs() < 0.02, "{estimate}");
    assert!((estimate.parameters.c2 - 0.5).abs() < 0.01, "{estimate}");
    let zero = record.initial(Level { h: fixed(0.0) });
    let error = says(
        Fit::new(&Logarithm, &zero).parameters(parameters).run(),
        &["sample 0 (t = 0 s)", "output `h` is -inf", "undefined there", "logarithm", "initial states"],
    );
    assert!(!error.to_string().contains("overflows"), "{error}");
}

#[test]
fn a_horizon_needs_measured_states() {
    let record = record(&Oscillator, SPRING, Motion { x: 0.4, v: -0.7 }, Position { x: 0.01 }, 1.0);
    let given = record.clone().initial(Motion { x: free(0.4), v: free(0.0) });
    for record in [record, given] {
        let fit = Fit::new(&Oscillator, &record).parameters(start()).predictor(Horizon::new(3)).run();
        let error = says(fit, &["2 state(s), x, v, but 1 measured", "FreeRun", "Kalman", "record the missing outputs"]);
        assert!(!error.to_string().contains("Experiment::initial"), "{error}");
    }
}

/// Every experiment has an initial state of its own.
#[test]
fn an_initial_state_per_experiment_is_refused() {
    let record = record(&Oscillator, SPRING, Motion { x: 0.4, v: -0.7 }, Position { x: 0.01 }, 1.0);
    let record = record.initial(Motion { x: free(0.4).per_experiment(), v: free(0.0) });
    says(Fit::new(&Oscillator, &record).parameters(start()).run(), &["`x(0)`", "leave .per_experiment() out"]);
}

/// A current of 3 A whose first measurement happens to be 10 uA: how far a step may go is judged by how far the current moves in
/// the record, not by that measurement, of which a step at most doubles the magnitude.
#[test]
fn a_first_measurement_next_to_zero_does_not_hold_the_search_back() {
    let inputs: Vec<Voltage> = levels(400, 20, 5).into_iter().map(|u| Voltage { u }).collect();
    let (truth, time) = (Branch { gain: 2.0, tau: 0.05 }, Time::Uniform { start: 0.0, step: 5e-3 });
    let run = simulate(&Lag, &truth, &Current { i: 3.0 }, time.clone(), &inputs).unwrap();
    let record = run.with_noise(Current { i: 0.02 }, 1).experiment(&Lag).unwrap();
    let fit = |first: f64| {
        let mut outputs: Vec<Current> = record.outputs().collect();
        outputs[0].i = first;
        let record = Experiment::new(&Lag, time.clone(), inputs.clone(), outputs).unwrap();
        let parameters = Branch { gain: free(1.0), tau: free(0.1) };
        Fit::new(&Lag, &record).parameters(parameters).noise(Current { i: 0.02 }).run().unwrap()
    };
    let [usual, small] = [3.0, 1e-5].map(fit);
    // 13 and 9; judged by that measurement, 27.
    assert!(small.evaluations <= 2 * usual.evaluations, "{} {}", small.evaluations, usual.evaluations);
    // One of 400 measurements is wrong, by 150 standard deviations, of an exponential that ten measurements tell.
    let tau = small.parameters.tau;
    assert!((tau - truth.tau).abs() < 0.1 * truth.tau, "{tau}");
}
