//! A second implementer of [`Sweep`]: closures with their Jacobians, of a number of states that is known at run time
//! only. Search, judgement, diagnoses and report take it as they take a typed model, with the same answer.

use crate::refused::says;
use approx::assert_relative_eq;
use greybox::diagnose::{identifiability, profile};
use greybox::layout::{Layout, Quantity};
use greybox::record::{Channel, Initial, Record};
use greybox::sweep::{Coupling, Piece, Reached, RunError, Seed, Sweep, Window};
use greybox::*;
use std::sync::Arc;

/// A value of a vector function, and its derivatives with respect to state and parameters, row by row.
struct Value {
    value: Vec<f64>,
    by_state: Vec<f64>,
    by_parameter: Vec<f64>,
}

/// Of state, inputs and parameters.
type Function = Box<dyn Fn(&[f64], &[f64], &[f64]) -> Value + Send + Sync>;

/// A model in discrete time.
struct Closures {
    layout: Layout,
    next: Function,
    output: Function,
}

/// `d(value) / d(seed)` along a trajectory whose state has these slopes.
fn chained(found: &Value, slopes: &[f64], seeds: &[Seed], n: usize, m: usize) -> Vec<f64> {
    let entry = |row: usize, column: usize| {
        let through: f64 = (0..n).map(|i| found.by_state[row * n + i] * slopes[i * seeds.len() + column]).sum();
        match seeds[column] {
            Seed::Carry(_) => through,
            Seed::Parameter(j) => through + found.by_parameter[row * m + j],
        }
    };
    (0..found.value.len())
        .flat_map(|row| (0..seeds.len()).map(move |column| (row, column)))
        .map(|(r, c)| entry(r, c))
        .collect()
}

impl Closures {
    fn run_one(
        &self,
        piece: &Piece<'_>,
        seeds: &[Seed],
        visit: &mut dyn FnMut(&mut Window) -> bool,
    ) -> Result<Reached, RunError> {
        let (n, m) = (self.layout.states.len(), self.layout.parameters.len());
        let mut reached = Reached { carry: piece.carry.to_vec(), slopes: piece.slopes.to_vec() };
        let mut window = Window::new(1, self.layout.outputs.len(), seeds.len(), 50, false);
        for first in piece.samples.clone().step_by(window.capacity()) {
            window.clear();
            window.begin[0] = first;
            window.samples[0] = window.capacity().min(piece.samples.end - first);
            window.carry = reached.carry.clone();
            for k in 0..window.samples[0] {
                let input = |channel: &Channel| channel.values[first + k];
                let u: Vec<f64> = piece.record.inputs().iter().map(input).collect();
                let expected = (self.output)(&reached.carry, &u, piece.parameters);
                let slopes = chained(&expected, &reached.slopes, seeds, n, m);
                for (j, measured) in piece.record.outputs().iter().map(input).enumerate() {
                    window.set_measured(k, j, u32::from(!measured.is_nan()));
                    let row = window.row_mut(k, j);
                    row[..seeds.len()].copy_from_slice(&slopes[j * seeds.len()..][..seeds.len()]);
                    row[seeds.len()] = measured - expected.value[j];
                    window.clear_unmeasured_row(k, j);
                }
                if first + k + 1 < piece.record.len() {
                    let next = (self.next)(&reached.carry, &u, piece.parameters);
                    reached.slopes = chained(&next, &reached.slopes, seeds, n, m);
                    reached.carry = next.value;
                }
            }
            if !visit(&mut window) {
                return Err(RunError::Stopped);
            }
        }
        Ok(reached)
    }
}

impl Sweep for Closures {
    fn layout(&self) -> &Layout {
        &self.layout
    }
    fn coupling(&self) -> Coupling {
        Coupling::Uncut
    }
    fn run(
        &self,
        pieces: &[Piece<'_>],
        seeds: &[Seed],
        visit: &mut dyn FnMut(&mut Window) -> bool,
    ) -> Vec<Result<Reached, RunError>> {
        pieces.iter().map(|piece| self.run_one(piece, seeds, visit)).collect()
    }
    fn integrator(&self) -> String {
        "closures, from sample to sample".to_owned()
    }
    fn predictor(&self) -> String {
        "simulation".to_owned()
    }
    fn engine(&self) -> String {
        "closures with their Jacobians".to_owned()
    }
    fn identity(&self) -> String {
        "cascade of lags".to_owned()
    }
}

/// `n` lags in a row, each with the pole `a`, driven by `g u`; the last is seen.
fn cascade(n: usize) -> Closures {
    let named = |name: &str, unit: &str| Quantity { name: name.to_owned(), unit: unit.to_owned() };
    let next = move |x: &[f64], u: &[f64], p: &[f64]| {
        let (a, g) = (p[0], p[1]);
        let before = |i: usize| if i == 0 { g * u[0] } else { x[i - 1] };
        let at = |row: usize, column: usize| match row {
            _ if row == column => a,
            _ if row == column + 1 => 1.0 - a,
            _ => 0.0,
        };
        Value {
            value: (0..n).map(|i| a * x[i] + (1.0 - a) * before(i)).collect(),
            by_state: (0..n * n).map(|k| at(k / n, k % n)).collect(),
            by_parameter: (0..n)
                .flat_map(|i| [x[i] - before(i), if i == 0 { (1.0 - a) * u[0] } else { 0.0 }])
                .collect(),
        }
    };
    let output = move |x: &[f64], _: &[f64], _: &[f64]| Value {
        value: vec![x[n - 1]],
        by_state: (0..n).map(|i| f64::from(u8::from(i == n - 1))).collect(),
        by_parameter: vec![0.0; 2],
    };
    let layout = Layout {
        kind: Kind::Discrete,
        states: (1..=n).map(|i| named(&format!("x{i}"), "m")).collect(),
        inputs: vec![named("u", "V")],
        outputs: vec![named("y", "m")],
        parameters: vec![named("a", "1"), named("g", "m/V")],
    };
    Closures { layout, next: Box::new(next), output: Box::new(output) }
}

signals! {
    pub struct Lags { x1: "m", x2: "m", x3: "m" }
    pub struct Input { u: "V" }
    pub struct Seen { y: "m" }
    pub struct Poles { a: "1", g: "m/V" }
}

/// The same with three lags, as a typed model
#[derive(Clone)]
struct Three;

#[rustfmt::skip]
impl Model for Three {
    type State = Lags; type Input = Input; type Output = Seen; type Parameters = Poles;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Lags<S>, u: &Input<S>, p: &Poles<S>) -> Lags<S> {
        let lag = |x: S, before: S| p.a * x + (-p.a + 1.0) * before;
        Lags { x1: lag(x.x1, p.g * u.u), x2: lag(x.x2, x.x1), x3: lag(x.x3, x.x2) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Lags<S>, _u: &Input<S>, _p: &Poles<S>) -> Seen<S> { Seen { y: x.x3 } }
}

/// Two missing samples, and noise.
fn typed_record() -> ExperimentOf<Three> {
    let inputs: Vec<Input> = (0..400).map(|k| Input { u: if k / 23 % 2 == 0 { 1.0 } else { -0.5 } }).collect();
    let (truth, time) = (Poles { a: 0.8, g: 2.0 }, Time::Uniform { start: 0.0, step: 0.01 });
    let run = simulate(&Three, &truth, &Lags { x1: 0.0, x2: 0.0, x3: 0.0 }, time.clone(), &inputs).unwrap();
    let mut outputs = run.with_noise(Seen { y: 0.02 }, 3).outputs;
    (outputs[7].y, outputs[200].y) = (f64::NAN, f64::NAN);
    let initial = Lags { x1: fixed(0.0), x2: fixed(0.0), x3: free(0.1) };
    Experiment::new(&Three, time, inputs, outputs).unwrap().initial(initial)
}

/// The same columns in a record without types.
fn record(typed: &ExperimentOf<Three>, states: &[Quantity]) -> Record {
    let of = typed.record();
    let initial = (0..states.len()).map(|i| if i + 1 == states.len() { free(0.1) } else { fixed(0.0) }).collect();
    let record = Record::new(states.to_vec(), of.times().clone(), of.inputs().to_vec(), of.outputs().to_vec()).unwrap();
    record.initial(Initial::Given(initial)).unwrap()
}

fn start() -> Vec<Parameter> {
    vec![free(0.5), free(1.0)]
}

/// A sweep steps and predicts as it does: a choice of either is an error.
#[test]
fn a_sweep_has_its_own_integrator_and_predictor() {
    let typed = typed_record();
    let closures = cascade(3);
    let untyped = record(&typed, &closures.layout.states);
    let sweep: Arc<dyn Sweep> = Arc::new(closures);
    let fit = || Fit::new(&sweep, &untyped).parameters(start());
    says(fit().integrator(Discrete).problem(), &["integrator", "its own"]);
    says(fit().predictor(Kalman).problem(), &["predictor", "its own"]);
}

#[test]
fn closures_and_a_typed_model_give_one_answer() {
    let typed = typed_record();
    let sweep = cascade(3);
    let untyped = record(&typed, &sweep.layout.states);
    let sweep: Arc<dyn Sweep> = Arc::new(sweep);
    let problem = Fit::new(&sweep, &untyped).parameters(start()).problem().unwrap();
    let found = problem.run().unwrap();
    let parameters = Poles::from_array([free(0.5), free(1.0)]);
    let reference = Fit::new(&Three, &typed).parameters(parameters).problem().unwrap();
    let expected = reference.run().unwrap();
    assert_eq!(found.severity(), Severity::Usable, "{found}");
    // Sums in another order: rounding, and 1e-10 of the search's own tolerance.
    for (a, b) in found.unknowns.iter().zip(&expected.unknowns) {
        assert_eq!((&a.name, a.role), (&b.name, b.role));
        assert_relative_eq!(a.value, b.value, max_relative = 1e-10);
        let errors = (a.knowledge.standard_error().unwrap(), b.knowledge.standard_error().unwrap());
        assert_relative_eq!(errors.0, errors.1, max_relative = 1e-8);
    }
    assert_eq!(found.unknowns.len(), 3);
    assert_relative_eq!(found.cost, expected.cost, max_relative = 1e-12);
    assert_eq!(found.measurements, 398);
    // The noise is 0.02; the estimate of a standard deviation from 398 samples scatters by 3.5 %.
    assert_relative_eq!(found.outputs[0].fit.sigma, 0.02, max_relative = 0.1);

    let (a, b) = (profile(&problem, &found, "a", 0.95).unwrap(), profile(&reference, &expected, "a", 0.95).unwrap());
    assert_relative_eq!(a.value, b.value, max_relative = 1e-10);
    assert_eq!(a.points.len(), b.points.len());
    let condition =
        |problem: &Problem<'_>, summary: &Summary| identifiability(problem, summary).unwrap().condition.unwrap();
    assert_relative_eq!(condition(&problem, &found), condition(&reference, &expected), max_relative = 1e-8);
    let report = Report::new(&problem, &found).unwrap();
    assert!(report.to_html().contains("closures with their Jacobians"));
    assert_eq!(Report::from_json(&report.to_json_with_drawings().unwrap()).unwrap(), report);
}

/// Other numbers of lags: each is found from its own record.
#[test]
fn the_number_of_states_is_known_at_run_time() {
    for n in [1, 2, 5, 8] {
        let sweep = cascade(n);
        let (states, time) = (sweep.layout.states.clone(), Time::Uniform { start: 0.0, step: 0.01 });
        let inputs: Vec<f64> = (0..400).map(|k| if k / 40 % 2 == 0 { 1.0 } else { -0.5 }).collect();
        let mut x = vec![0.0; n];
        let output = |u: &f64| {
            let y = x[n - 1];
            x = (sweep.next)(&x, &[*u], &[0.8, 2.0]).value;
            y
        };
        let outputs = vec![Channel::new("y", "m", inputs.iter().map(output).collect::<Vec<f64>>())];
        let record = Record::new(states, time, vec![Channel::new("u", "V", inputs)], outputs).unwrap();
        let record = record.initial(Initial::Given(vec![fixed(0.0); n])).unwrap();
        let sweep: Arc<dyn Sweep> = Arc::new(sweep);
        let found = Fit::new(&sweep, &record).parameters(start()).run().unwrap();
        // Nothing but rounding is between model and record.
        assert_relative_eq!(found.parameters[0].value, 0.8, max_relative = 1e-9);
        assert_relative_eq!(found.parameters[1].value, 2.0, max_relative = 1e-9);
    }
}
