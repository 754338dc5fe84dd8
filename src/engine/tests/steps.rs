//! Whole steps with slopes on lanes, against duals through the same integrator.

use greybox::engine::{Column, Group, Program, Sampling, Trajectories};
use greybox::graph::{Graph, Leaf, Seed, Symbol};
use greybox::{
    Dual, Hold, Interval, Model, Of, Rk4, Scalar, Signals,
    equations::Equations,
    integrate::{Integrator, ModelSystem},
    record::Holds,
    recurrence::{Recurrence, SymbolicInterval},
    signals,
};

signals! {
    pub struct Currents { id: "A", iq: "A" }
    pub struct Drive { ud: "V", uq: "V", w: "rad/s" }
    pub struct Winding { rs: "ohm", ls: "H", ke: "V s/rad" }
}

pub struct Pmsm {
    pub pole_pairs: f64,
}

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = u.w * self.pole_pairs;
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * 0.816_496_580_927_726) / p.ls - we * x.id,
        }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

/// The simulation of equations by a method of fixed steps: the state is carried.
pub fn simulation(equations: &Equations, integrator: &impl Integrator, hold: Hold) -> Recurrence {
    let mut graph = Graph::default();
    let mean = graph.import(equations.graph(), &equations.roots().output, Graph::leaf);
    let states = equations.layout().states.len() as u32;
    let holds = Holds::All(hold);
    let between = SymbolicInterval::new(equations, integrator, &holds);
    let next = graph.trace(|| {
        let mut x: Vec<Symbol> = (0..states).map(|i| Symbol::leaf(Leaf::State(i))).collect();
        between.next(&mut x);
        x
    });
    Recurrence::from_roots(&graph, &next.unwrap(), &mean, &[]).unwrap()
}

/// Starts a lane: what it carries, with a slope of one for each seed that is an entry of it.
pub fn start(group: &mut Group, program: &Program, lane: usize, carry: &[f64]) {
    let own = |i: usize| program.seeds().iter().map(move |seed| f64::from(u8::from(*seed == Seed::Carry(i))));
    let slopes: Vec<f64> = (0..carry.len()).flat_map(own).collect();
    group.resume(lane, carry, &slopes);
}

/// The columns of `n` samples, the same in all lanes.
pub fn columns_of(program: &Program, n: usize, lanes: usize, value: impl Fn(&Column, usize) -> f64) -> Vec<f64> {
    let (from, reads_next) = program.derived_from();
    let sources: Vec<Vec<f64>> = from.iter().map(|column| (0..n).map(|k| value(column, k)).collect()).collect();
    let sources: Vec<&[f64]> = sources.iter().map(Vec::as_slice).collect();
    let derived = program.derive(&sources, if reads_next { n - 1 } else { n });
    let mut block = vec![];
    for k in 0..n {
        for column in program.columns() {
            let value = match column {
                Column::Derived(d) => derived[*d].get(k).copied().unwrap_or(f64::NAN),
                column => value(column, k),
            };
            block.extend(std::iter::repeat_n(value, lanes));
        }
    }
    block
}

/// Runs a model's program from a start over samples of these inputs, all lanes alike but for their parameters, and compares
/// rows and what is carried with duals.
pub fn agrees<M: Model, I: Integrator, const N: usize>(
    model: &M,
    integrator: &I,
    hold: Hold,
    start: Of<M::State, f64>,
    parameters: Of<M::Parameters, f64>,
    inputs: &[Of<M::Input, f64>],
    step: f64,
) {
    let equations = Equations::trace(model).unwrap();
    let recurrence = simulation(&equations, integrator, hold);
    let (nx, np) = (M::State::LEN, M::Parameters::LEN);
    let seeds: Vec<Seed> = (0..np).map(Seed::Parameter).chain((0..nx).map(Seed::Carry)).collect();
    assert_eq!(N, seeds.len());
    let program = Program::compile(&recurrence, &seeds, Sampling::Uniform, Trajectories::Many).unwrap();
    let samples = inputs.len() - 1;
    for wanted in [1, program.lanes()] {
        let mut group = program.group(wanted);
        let lanes = group.lanes();
        let p = |lane: usize| M::Parameters::map(parameters, |p| p * (1.0 + 0.01 * lane as f64));
        for lane in 0..lanes {
            group.set_parameters(lane, M::Parameters::into_array(p(lane)).as_ref());
            group.set_step(lane, step);
            self::start(&mut group, &program, lane, M::State::into_array(start).as_ref());
        }
        group.prepare();
        let value = |column: &Column, k: usize| match column {
            Column::Input(i) => M::Input::into_array(inputs[k]).as_ref()[*i],
            Column::Time => k as f64 * step,
            other => panic!("{other:?}"),
        };
        let block = columns_of(&program, inputs.len(), lanes, value);
        let mut rows = vec![f64::NAN; samples * program.row_length() * lanes];
        group.run(&block, &mut rows, samples);
        for lane in 0..lanes {
            let values = M::Parameters::into_array(p(lane));
            let p = M::Parameters::from_fn(|i| Dual::<N>::variable(values.as_ref()[i], i));
            let values = M::State::into_array(start);
            let mut x = M::State::from_fn(|i| Dual::<N>::variable(values.as_ref()[i], np + i));
            // What has passed through zero keeps the rounding of what it was.
            let mut largest = 0.0f64;
            for k in 0..samples {
                let u = M::Input::map(inputs[k], Dual::from);
                let t = Dual::from(k as f64 * step);
                let y = M::Output::into_array(model.output(t, &x, &u, &p));
                for (j, y) in y.as_ref().iter().enumerate() {
                    let row = |s: usize| rows[((k * program.outputs() + j) * (N + 1) + s) * lanes + lane];
                    largest = largest.max(y.value.abs());
                    same_within(row(N), y.value, 1e-12 * largest);
                    let size = y.slopes.iter().fold(0.0f64, |m, s| m.max(s.abs()));
                    (0..N).for_each(|s| same_within(row(s), y.slopes[s], 1e-12 * size + 1e-300));
                }
                let interval =
                    Interval { t0: k as f64 * step, t1: (k + 1) as f64 * step, u0: inputs[k], u1: inputs[k + 1], hold };
                let system = ModelSystem { model, interval: &interval, p: &p };
                x = system.step(integrator, x, &mut 0.0).unwrap();
            }
            let mut carry = vec![0.0; nx];
            group.carry(lane, &mut carry);
            for (carry, x) in carry.iter().zip(M::State::into_array(x)) {
                same_within(*carry, x.value, 1e-12 * largest);
            }
        }
    }
}

fn same_within(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance || a.is_nan() && b.is_nan(), "{a} against {b}");
}

#[test]
fn the_motor_runs_on_lanes() {
    let swing = |k: usize| Drive { ud: (k as f64 * 0.1).sin() * 20.0, uq: 30.0, w: 100.0 + k as f64 };
    let inputs: Vec<_> = (0..200).map(swing).collect();
    let p = Winding { rs: 0.6, ls: 3.5e-3, ke: 0.9 };
    for hold in [Hold::Zero, Hold::First] {
        let start = Currents { id: 1.0, iq: -2.0 };
        agrees::<_, _, 5>(&Pmsm { pole_pairs: 4.0 }, &Rk4::default(), hold, start, p, &inputs, 0.126e-3);
        agrees::<_, _, 5>(&Pmsm { pole_pairs: 4.0 }, &Rk4 { substeps: 3 }, hold, start, p, &inputs, 0.126e-3);
    }
}
