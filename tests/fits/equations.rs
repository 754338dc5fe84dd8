//! Equations as data: fits of graphs that were read from a file or made by hand, against those of Rust models.

use crate::refused::says;
use crate::stiff;
use approx::assert_relative_eq;
use greybox::equations::Equations;
use greybox::graph::{Function, Graph, Id, Leaf};
use greybox::layout::{Layout, Quantity};
use greybox::record::{Channel, Record};
use greybox::*;

signals! {
    pub struct Swing { phi: "rad", w: "rad/s" }
    pub struct Torque { m: "N m" }
    pub struct Pull { g: "1/s^2", d: "1/s", b: "1/(kg m^2)" }
}

#[derive(Clone)]
struct Pendulum;

#[rustfmt::skip]
impl Model for Pendulum {
    type State = Swing; type Input = Torque; type Output = Swing; type Parameters = Pull;
    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, u: &Torque<S>, p: &Pull<S>) -> Swing<S> {
        Swing { phi: x.w, w: u.m * p.b - x.phi.sin() * p.g - x.w * p.d }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Torque<S>, _p: &Pull<S>) -> Swing<S> { *x }
}

fn record(samples: usize) -> ExperimentOf<Pendulum> {
    let push = |k: usize| Torque { m: [0.8, -0.5, 1.2, 0.2][k / 60 % 4] + 0.3 * (0.05 * k as f64).sin() };
    let (truth, inputs) = (Pull { g: 9.81, d: 1.2, b: 2.0 }, (0..samples).map(push).collect::<Vec<_>>());
    let time = Time::Uniform { start: 0.0, step: 0.02 };
    let run = simulate(&Pendulum, &truth, &Swing { phi: 0.3, w: 0.0 }, time, &inputs).unwrap();
    run.with_noise(Swing { phi: 0.02, w: 0.05 }, 4).experiment(&Pendulum).unwrap()
}

fn start() -> Pull<Parameter> {
    Pull { g: free(9.0), d: free(1.0).within(0.0, 5.0), b: free(1.5) }
}

/// The equations of a model, written and read.
fn read<M: Model>(model: &M) -> Equations {
    let text = serde_json::to_string(&Equations::trace(model).unwrap()).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// What both come to: values to `close` of themselves, or to rounding next to their standard errors.
fn same(found: &Summary, expected: &Summary, close: f64) {
    assert_eq!(
        std::mem::discriminant(&found.outcome),
        std::mem::discriminant(&expected.outcome),
        "{found}\n{expected}"
    );
    assert_eq!(found.method.integrator, expected.method.integrator);
    let codes = |summary: &Summary| summary.warnings.iter().map(|warning| warning.code).collect::<Vec<_>>();
    assert_eq!(codes(found), codes(expected), "{found}\n{expected}");
    assert_eq!(found.unknowns.len(), expected.unknowns.len());
    for (a, b) in found.unknowns.iter().zip(&expected.unknowns) {
        assert_eq!((&a.name, &a.unit, a.role), (&b.name, &b.unit, b.role));
        assert_relative_eq!(a.value, b.value, max_relative = close);
        let errors = [a, b].map(|one| one.knowledge.standard_error().unwrap());
        assert_relative_eq!(errors[0], errors[1], max_relative = 1e-8);
        let ends = [a, b].map(|one| match one.knowledge {
            Knowledge::Known { lower, upper, .. } => [lower, upper],
            ref other => panic!("{}: {other:?}", one.name),
        });
        assert_relative_eq!(ends[0][..], ends[1][..], max_relative = 1e-8);
    }
    assert_relative_eq!(found.cost, expected.cost, max_relative = 1e-10);
}

/// Compiled, of a record in segments too; and in dual numbers, which methods that choose their steps ask for.
#[test]
fn equations_that_were_read_give_what_their_model_gives() {
    for samples in [300, 1_200] {
        let record = record(samples);
        let equations = read(&Pendulum);
        let untyped = || Fit::new(&equations, record.record()).parameters(Pull::into_array(start()).to_vec());
        let fit = || Fit::new(&Pendulum, &record).parameters(start());
        let found = untyped().run().unwrap();
        assert_eq!(found.severity(), Severity::Usable, "{found}");
        assert!(found.method.engine.contains("graph"), "{found}");
        same(&found, &fit().run().unwrap(), 1e-10);
        let horizon = untyped().predictor(Horizon::new(5)).run().unwrap();
        same(&horizon, &fit().predictor(Horizon::new(5)).run().unwrap(), 1e-10);
    }
    let (record, equations) = (record(300), read(&Pendulum));
    let fit = || Fit::new(&Pendulum, &record).parameters(start()).integrator(Rk45::default());
    let untyped = || {
        let fit = Fit::new(&equations, record.record()).parameters(Pull::into_array(start()).to_vec());
        fit.integrator(Rk45::default())
    };
    let found = untyped().run().unwrap();
    assert!(found.method.engine.contains("dual numbers"), "{found}");
    same(&found, &fit().run().unwrap(), 1e-10);
    let horizon = untyped().predictor(Horizon::new(5)).run().unwrap();
    same(&horizon, &fit().predictor(Horizon::new(5)).run().unwrap(), 1e-10);
}

/// A default method, then three finer ones, then an implicit one.
#[test]
fn stiff_equations_take_the_method_that_their_model_takes() {
    let (truth, record) = stiff::motor(&stiff::FANNED, 1e4);
    let expected = Fit::new(&stiff::FANNED, &record).parameters(stiff::off(truth)).run().unwrap();
    let parameters = stiff::Motor::into_array(stiff::off(truth)).to_vec();
    let problem = Fit::new(&read(&stiff::FANNED), record.record()).parameters(parameters).problem().unwrap();
    let found = problem.run().unwrap();
    assert!(found.method.integrator.contains("implicit"), "{found}");
    same(&found, &expected, 1e-10);
    let again = problem.predict(&found, record.record()).unwrap();
    assert!(again.residuals[0].iter().all(|residual| residual.abs() < 0.5), "five standard deviations");
}

/// The error of a start that cannot be simulated says what was no number, where; so does that of the Rust model.
#[test]
fn a_start_that_fails_is_located() {
    let record = record(300);
    let runaway = Pull { d: free(-4e3), ..start() };
    for chosen in [false, true] {
        let equations = read(&Pendulum);
        // Multiple shooting would lead it to the data.
        let fit = Fit::new(&Pendulum, &record).parameters(runaway).starts(1);
        let untyped = Fit::new(&equations, record.record()).parameters(Pull::into_array(runaway).to_vec()).starts(1);
        let (fit, untyped) = match chosen {
            true => (fit.integrator(Rk4::default()), untyped.integrator(Rk4::default())),
            false => (fit, untyped),
        };
        let expected = fit.run().err().unwrap();
        let found = untyped.run().err().unwrap();
        let Error::Start(failure) = &found else { panic!("{found}") };
        assert!(failure.sample > 0 && failure.signal.contains('`'), "{failure:?}");
        assert_eq!(found.to_string(), expected.to_string());
    }
}

fn named(name: impl Into<String>, unit: &str) -> Quantity {
    Quantity { name: name.into(), unit: unit.to_owned() }
}

/// `n` equal lags in a row, the first driven by `g u`, the last seen through `bend`.
fn cascade(n: usize, bend: impl Fn(&mut Graph, Id) -> Id) -> Equations {
    let layout = Layout {
        kind: Kind::Continuous,
        states: (1..=n).map(|i| named(format!("x{i}"), "V")).collect(),
        inputs: vec![named("u", "V")],
        outputs: vec![named("y", "V")],
        parameters: vec![named("tau", "s"), named("g", "1")],
    };
    let mut graph = Graph::default();
    let [u, tau, g] = [Leaf::Input(0), Leaf::Parameter(0), Leaf::Parameter(1)].map(|leaf| graph.leaf(leaf));
    let mut before = graph.mul(g, u);
    let mut slopes = vec![];
    for i in 0..n as u32 {
        let x = graph.leaf(Leaf::State(i));
        let rest = graph.sub(before, x);
        slopes.push(graph.div(rest, tau));
        before = x;
    }
    let output = bend(&mut graph, before);
    Equations::new(layout, &graph, &slopes, &[output]).unwrap()
}

/// The response to a step of 1 V: `g (1 - exp(-z) sum z^k / k!)`, `k < n`, `z = t / tau`.
fn response(n: usize, t: f64, tau: f64, g: f64) -> f64 {
    let z = t / tau;
    let sum = (1..n).fold((1.0, 1.0), |(sum, term), k| (sum + term * z / k as f64, term * z / k as f64)).0;
    g * (1.0 - (-z).exp() * sum)
}

fn step_record(equations: &Equations, y: impl Fn(f64) -> f64) -> Record {
    let states = equations.layout().states.clone();
    let (time, n) = (Time::Uniform { start: 0.0, step: 0.01 }, states.len());
    let outputs = vec![Channel::new("y", "V", (0..600).map(|k| y(0.01 * f64::from(k))).collect::<Vec<_>>())];
    let record = Record::new(states, time, vec![Channel::new("u", "V", vec![1.0; 600])], outputs).unwrap();
    record.initial(Initial::Given(vec![fixed(0.0); n])).unwrap()
}

/// From one to four states; linear, and with an output that is not, whose record is cut in another way.
#[test]
fn equations_made_by_hand_are_fitted() {
    for n in 1..=4 {
        for bent in [false, true] {
            let equations = cascade(n, |graph, x| if bent { graph.function(Function::Tanh, x) } else { x });
            let seen = |t: f64| response(n, t, 0.5, 1.5);
            let record = step_record(&equations, |t| if bent { seen(t).tanh() } else { seen(t) });
            let start = vec![free(0.8).within(0.01, 10.0), free(1.0)];
            let problem = Fit::new(&equations, &record).parameters(start).problem().unwrap();
            let found = problem.run().unwrap();
            // One step of Runge-Kutta's method per 0.02 time constants is right to 1e-8 or so.
            assert_relative_eq!(found.parameters[0].value, 0.5, max_relative = 1e-6);
            assert_relative_eq!(found.parameters[1].value, 1.5, max_relative = 1e-6);
            assert!(Report::new(&problem, &found).unwrap().to_markdown().contains("tau"), "{n} states");
        }
    }
}

/// Records and parameters that are not those of the equations, and a predictor that cannot serve them.
#[test]
fn what_does_not_fit_the_equations_is_refused() {
    let (equations, start) = (cascade(2, |_, x| x), [free(0.8), free(1.0)]);
    let good = step_record(&cascade(2, |_, x| x), |t| t);
    let one_state = step_record(&cascade(1, |_, x| x), |t| t);
    let fit = |record: &Record, start: &[Parameter]| Fit::new(&equations, record).parameters(start.to_vec());
    let problem = |record: &Record, start: &[Parameter]| fit(record, start).problem();
    says(problem(&one_state, &start), &["states", "`x1`", "`x2`", "`record`"]);
    let (states, time) = (good.clone(), good.times().clone());
    let with = |inputs: Vec<Channel>, outputs: Vec<Channel>| {
        Record::new(cascade(2, |_, x| x).layout().states.clone(), time.clone(), inputs, outputs).unwrap()
    };
    let swapped = with(states.outputs().to_vec(), states.inputs().to_vec());
    says(problem(&swapped, &start), &["inputs", "`u`", "`y`"]);
    says(problem(&with(states.inputs().to_vec(), vec![]), &start), &["outputs", "none", "`y`"]);
    says(problem(&good, &start[..1]), &["1", "2"]);
    says(fit(&good, &start).predictor(Horizon::new(3)).problem(), &["state"]);
    says(fit(&good, &start).integrator(Discrete).problem(), &["discrete"]);
}

/// The same arithmetic from sample to sample, up to the rounding of a damped swing; the same noise from the same seed.
#[test]
fn equations_are_simulated_as_their_model() {
    let (truth, time) = (Pull { g: 9.81, d: 1.2, b: 2.0 }, Time::Uniform { start: 0.5, step: 0.02 });
    let push: Vec<f64> = (0..300).map(|k| (0.05 * f64::from(k)).sin()).collect();
    let equations = read(&Pendulum);
    let inputs = |m: &[f64]| {
        let channels = vec![Channel::new("m", "N m", m.to_vec())];
        Record::new(equations.layout().states.clone(), time.clone(), channels, vec![]).unwrap()
    };
    let torques: Vec<Torque> = push.iter().map(|m| Torque { m: *m }).collect();
    let (from, start) = ([9.81, 1.2, 2.0], Swing { phi: 0.3, w: -0.1 });
    let close = |found: &Record, run: Simulation<Pendulum>| {
        for (k, y) in run.outputs.iter().enumerate() {
            let found = [0, 1].map(|j| found.outputs()[j].values[k]);
            assert!((found[0] - y.phi).abs() < 1e-13 && (found[1] - y.w).abs() < 1e-13, "{k}: {found:?} {y:?}");
        }
    };
    let at = |p: &[f64]| Fleet::new(&equations).parameters(p.iter().copied().map(fixed).collect());
    let one = at(&from).integrator(Rk4 { substeps: 1 });
    let found = one.simulate(&[0.3, -0.1], &inputs(&push)).unwrap();
    let run = simulate(&Pendulum, &truth, &start, time.clone(), &torques).unwrap();
    assert_eq!((found.len(), found.time(1), &found.inputs()[0].values[..]), (300, 0.52, &push[..]));
    close(&found.with_noise(&[0.02, 0.05], 4), run.clone().with_noise(Swing { phi: 0.02, w: 0.05 }, 4));
    close(&found, run);
    // A method that chooses its steps.
    for hold in [Hold::Zero, Hold::First] {
        let found = at(&from).integrator(Rk45::default()).simulate(&[0.3, -0.1], &inputs(&push).hold(hold)).unwrap();
        let simulator = Simulator::new(&Pendulum).integrator(Rk45::default()).hold(hold);
        close(&found, simulator.run(&truth, &start, time.clone(), &torques).unwrap());
    }
    let refused = |p: &[f64], x: &[f64], of: &Record| at(p).simulate(x, of);
    let other = |channels: Vec<Channel>| {
        Record::new(equations.layout().states.clone(), time.clone(), channels, vec![]).unwrap()
    };
    let given = inputs(&push);
    says(refused(&from, &[0.3, -0.1], &other(vec![Channel::new("u", "N m", push.clone())])), &["inputs", "`u`", "`m`"]);
    says(refused(&from[..2], &[0.3, -0.1], &given), &["2 parameter(s)", "has 3"]);
    says(refused(&from, &[0.3], &given), &["1 entries", "2 states"]);
    says(refused(&[f64::NAN, 1.2, 2.0], &[0.3, -0.1], &given), &["`g`", "not a number"]);
    says(refused(&[9.81, -400.0, 2.0], &[0.3, -0.1], &given), &["simulation"]);
}

/// Decays of their own rates: each answer is that of the record alone, in the order of the records, beside one that is none of the
/// equations'.
#[test]
fn a_fleet_of_equations_is_each_fit_alone() {
    let equations = read(&Pendulum);
    let push: Vec<f64> = (0..200).map(|k| [1.0, -0.5][k / 40 % 2]).collect();
    let record = |i: usize| {
        let time = Time::Uniform { start: 0.0, step: 0.02 };
        let truth = [9.81, 0.8 + 0.02 * i as f64, 2.0].map(fixed).to_vec();
        let fit = Fleet::new(&equations).parameters(truth);
        let inputs = vec![Channel::new("m", "N m", push.clone())];
        let inputs = Record::new(equations.layout().states.clone(), time, inputs, vec![]).unwrap();
        let swing = fit.simulate(&[0.2, 0.0], &inputs).unwrap();
        swing.with_noise(&[0.02, 0.05], i as u64).named(format!("{i}"))
    };
    let mut records: Vec<Record> = (0..40).map(record).collect();
    let other = vec![Channel::new("v", "V", vec![0.0; 200])];
    let time = records[0].times().clone();
    records[7] = Record::new(vec![], time, other.clone(), other).unwrap();
    let parameters = Pull::into_array(start()).to_vec();
    let fleet = Fleet::new(&equations).parameters(parameters.clone()).fleet().unwrap();
    let answers: Vec<_> = fleet.run(records.clone()).collect();
    assert_eq!(answers.len(), 40);
    for (i, (record, answer)) in records.into_iter().zip(answers).enumerate() {
        if i == 7 {
            assert!(answer.is_err());
            continue;
        }
        let answer = answer.unwrap();
        same(&answer, &Fit::new(&equations, &record).parameters(parameters.clone()).run().unwrap(), 1e-10);
        let damping = &answer.parameters[1];
        let error = damping.knowledge.standard_error().unwrap();
        assert!((damping.value - 0.8 - 0.02 * i as f64).abs() < 5.0 * error && error < 0.05, "{i}: {answer}");
    }
}

/// What a typed fit is told by types can be said by name, and comes to the same bits.
#[test]
fn what_a_fit_is_told_can_be_said_by_name() {
    let record = record(300);
    let equations = read(&Pendulum);
    let untyped = || {
        let declared = [("b", free(1.5)), ("g", free(9.0)), ("d", free(1.0).within(0.0, 5.0))];
        Fit::new(&equations, record.record()).parameters_by_name(declared).unwrap()
    };
    let typed = || Fit::new(&Pendulum, &record).parameters(start());
    let agree = |untyped: Fit<'_, Equations>, typed: Fit<'_, Pendulum>| {
        let (found, expected) = (untyped.run().unwrap(), typed.run().unwrap());
        let values = |summary: &Summary| summary.parameters.iter().map(|one| one.value).collect::<Vec<_>>();
        assert_eq!(values(&found), values(&expected), "{found}\n{expected}");
        let method = |summary: &Summary| {
            let method = &summary.method;
            [&method.integrator, &method.predictor, &method.loss, &method.prefilter].map(|text| format!("{text:?}"))
        };
        assert_eq!(method(&found), method(&expected));
    };
    let noise = [("w", 0.05), ("phi", 0.02)];
    agree(untyped().noise_by_name(noise).unwrap(), typed().noise(Swing { phi: 0.02, w: 0.05 }));
    agree(untyped().loss_by_name("huber").unwrap(), typed().loss(Huber::default()));
    agree(untyped().loss_by_name("tukey:6").unwrap(), typed().loss(greybox::loss::Tukey(6.0)));
    agree(untyped().integrator_by_name("rk4:2").unwrap(), typed().integrator(Rk4 { substeps: 2 }));
    agree(untyped().predictor_by_name("horizon:5").unwrap(), typed().predictor(Horizon::new(5)));
    let filter = Butterworth::low_pass(2, 5.0, 0.02).unwrap();
    agree(untyped().prefilter_by_name("low-pass:2,5").unwrap(), typed().prefilter(filter));
    let gauss_newton = greybox::optimize::GaussNewton::default();
    agree(untyped().optimizer_by_name("gauss-newton").unwrap(), typed().optimizer(gauss_newton));
    let fixed = Pull { d: fixed(1.2), ..start() };
    agree(untyped().parameter("d", greybox::fixed(1.2)).unwrap(), Fit::new(&Pendulum, &record).parameters(fixed));
    // A weight of |m|, and a time that counts.
    let mut graph = Graph::default();
    let [m, t] = [Leaf::Input(0), Leaf::Time].map(|leaf| graph.leaf(leaf));
    let size = graph.function(Function::Abs, m);
    let weight = graph.add(size, t);
    agree(
        untyped().weighting_by(&graph, weight),
        typed().weighting(|sample: &Sample<Pendulum>| sample.u.m.abs() + sample.t),
    );
}

/// Each name that is none says so with those there are, and the nearest.
#[test]
fn wrong_names_are_refused_with_near_ones() {
    let (equations, record) = (read(&Pendulum), record(300));
    let records = || Fit::new(&equations, record.record());
    let fit = || records().parameters(Pull::into_array(start()).to_vec());
    says(records().parameters_by_name([("g", free(1.0))]), &["parameter `d` is not given"]);
    says(records().parameters_by_name([("g", free(1.0)), ("g", free(1.0))]), &["`g` is given twice"]);
    says(fit().parameter("damping", free(1.0)), &["no parameter `damping`", "g, d, b"]);
    says(fit().noise_by_name([("phy", 0.1)]), &["no output `phy` (`phi` is near)", "phi, w"]);
    says(fit().input_noise_by_name([("u", 0.1)]), &["no input `u`", "m"]);
    says(fit().loss_by_name("hubert"), &["no loss `hubert` (`huber` is near)", "cauchy"]);
    says(fit().loss_by_name("huber:a"), &["`a` is not a number"]);
    says(fit().loss_by_name("huber:1,2"), &["`2` is one number too many"]);
    says(fit().predictor_by_name("horizon"), &["horizon", "whole number"]);
    says(fit().predictor_by_name("horizon:2.5"), &["2.5 is not a whole number"]);
    says(fit().integrator_by_name("rk5"), &["no integrator `rk5` (`rk4"]);
    says(fit().optimizer_by_name("gauss"), &["no optimizer `gauss`", "gauss-newton"]);
    says(fit().prefilter_by_name("low-pass:2"), &["cut-off"]);
    let fleet = Fleet::new(&equations).parameters(Pull::into_array(start()).to_vec());
    says(fleet.prefilter_by_name("low-pass:2,5"), &["no sample time is known"]);
    let mut graph = Graph::default();
    let p = graph.leaf(Leaf::Parameter(0));
    says(fit().weighting_by(&graph, p).problem(), &["weight depends on Parameter(0)"]);
}

/// Two rows of a table that have one name, or none, could not be told apart.
#[test]
fn a_layout_whose_names_do_not_tell_quantities_apart_is_refused() {
    let made = |names: [&str; 2], unit: &str| {
        let mut layout = cascade(1, |_, x| x).layout().clone();
        layout.parameters = names.map(|name| named(name, unit)).to_vec();
        let mut graph = Graph::default();
        let x = graph.leaf(Leaf::State(0));
        Equations::new(layout, &graph, &[x], &[x])
    };
    assert!(made(["rs", "ls"], "ohm").is_ok());
    says(made(["rs", "rs"], "1"), &["parameter `rs` stands twice", "places 1 and 2"]);
    says(made(["rs", " "], "1"), &["parameter 2 of the layout has no name"]);
    says(made(["rs", "l\ns"], "1"), &["parameter \"l\\ns\"", "control character '\\n'"]);
    says(made(["rs", "ls"], "V\t"), &["parameter \"rs\"", "'\\t'"]);
    // The same name in two groups is no matter: `iq` is a state and an output of every motor.
    assert!(made(["x1", "u"], "1").is_ok());
}
