//! Groups of lanes: independence of lanes, blocks, what is read back, irregular steps, large models.

use super::steps::{Currents, Drive, Pmsm, Winding, simulation, start};
use greybox::engine::{Column, Group, Program, Sampling, Trajectories};
use greybox::graph::{Function, Graph, Id, Leaf, Seed};
use greybox::{
    Dual, Hold, Interval, Rk4, Signals, equations::Equations, integrate::ModelSystem, recurrence::Recurrence,
};

const P: [f64; 3] = [0.6, 3.5e-3, 0.9];
const SEEDS: [Seed; 5] = [Seed::Parameter(0), Seed::Parameter(1), Seed::Parameter(2), Seed::Carry(0), Seed::Carry(1)];

fn recurrence(hold: Hold) -> Recurrence {
    simulation(&Equations::trace(&Pmsm { pole_pairs: 4.0 }).unwrap(), &Rk4::default(), hold)
}

fn inputs(k: usize, column: usize) -> f64 {
    30.0 * (0.2 * k as f64 + column as f64).sin()
}

fn block(program: &Program, samples: std::ops::Range<usize>, lanes: usize) -> Vec<f64> {
    let columns = 0..program.columns().len();
    samples
        .flat_map(|k| columns.clone().flat_map(move |column| std::iter::repeat_n(inputs(k, column), lanes)))
        .collect()
}

fn ready(program: &Program, lanes: usize) -> Group {
    let mut group = program.group(lanes);
    for lane in 0..group.lanes() {
        group.set_parameters(lane, &P);
        group.set_step(lane, 1e-4);
        start(&mut group, program, lane, &[1.0 + lane as f64, -2.0]);
    }
    group.prepare();
    group
}

fn carried(group: &Group, lane: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut carry, mut slopes) = (vec![0.0; 2], vec![0.0; 10]);
    group.carry(lane, &mut carry);
    group.carry_slopes(lane, &mut slopes);
    (carry, slopes)
}

#[test]
fn lanes_depend_neither_on_their_neighbors_nor_on_blocks() {
    let program = Program::compile(&recurrence(Hold::Zero), &SEEDS, Sampling::Uniform, Trajectories::Many).unwrap();
    let mut group = ready(&program, program.lanes());
    let lanes = group.lanes();
    let mut rows = vec![0.0; 64 * program.row_length() * lanes];
    group.run(&block(&program, 0..64, lanes), &mut rows, 64);
    // The same in blocks, copied in the middle, with a neighbor that is no number and one that starts anew.
    let mut other = ready(&program, lanes);
    if lanes > 1 {
        other.set_parameters(1, &[f64::NAN, f64::INFINITY, 0.0]);
        other.prepare();
    }
    let mut pieces = vec![];
    for begin in [0, 10, 11, 40] {
        let end = [10, 11, 40, 64][[0, 10, 11, 40].iter().position(|b| *b == begin).unwrap()];
        let mut some = vec![0.0; (end - begin) * program.row_length() * lanes];
        other.run(&block(&program, begin..end, lanes), &mut some, end - begin);
        pieces.extend(some);
        other = other.clone();
        if begin == 11 {
            let (carry, slopes) = carried(&other, 0);
            start(&mut other, &program, 0, &[7.0, 7.0]);
            assert_eq!(carried(&other, 0), (vec![7.0, 7.0], vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
            other.resume(0, &carry, &slopes);
        }
    }
    for lane in (0..lanes).filter(|lane| *lane != 1) {
        assert!(rows.iter().skip(lane).step_by(lanes).eq(pieces.iter().skip(lane).step_by(lanes)), "lane {lane}");
        assert_eq!(carried(&group, lane), carried(&other, lane));
    }
}

/// One trajectory by itself has the bits of one among many.
#[test]
fn one_trajectory_is_as_good_as_many() {
    for hold in [Hold::Zero, Hold::First] {
        let of = |trajectories| {
            let program = Program::compile(&recurrence(hold), &[], Sampling::Uniform, trajectories).unwrap();
            let mut group = ready(&program, 1);
            let lanes = group.lanes();
            let mut rows = vec![0.0; 50 * 2 * lanes];
            let samples = 50 + usize::from(program.reads_next());
            assert_eq!(program.reads_next(), hold == Hold::First);
            group.run(&block(&program, 0..samples, lanes), &mut rows, 50);
            rows.into_iter().step_by(lanes).collect::<Vec<_>>()
        };
        assert_eq!(of(Trajectories::One), of(Trajectories::Many));
    }
}

#[test]
fn steps_may_differ_from_sample_to_sample() {
    let program = Program::compile(&recurrence(Hold::First), &SEEDS, Sampling::Irregular, Trajectories::Many).unwrap();
    let step = |k: usize| 1e-4 * (1.0 + (k % 3) as f64);
    let mut group = ready(&program, 1);
    let lanes = group.lanes();
    let input = |k: usize| Drive { ud: inputs(k, 0), uq: inputs(k, 1), w: inputs(k, 2) };
    let mut block = vec![];
    for k in 0..41 {
        for column in program.columns() {
            let value = match column {
                Column::Step => step(k),
                Column::Input(i) => Drive::into_array(input(k))[*i],
                other => panic!("{other:?}"),
            };
            block.extend(std::iter::repeat_n(value, lanes));
        }
    }
    let mut rows = vec![0.0; 40 * program.row_length() * lanes];
    group.run(&block, &mut rows, 40);
    let mut x = Currents { id: Dual::<5>::variable(1.0, 3), iq: Dual::variable(-2.0, 4) };
    let p = Winding::from_fn(|j| Dual::<5>::variable(P[j], j));
    let mut t0 = 0.0;
    for k in 0..40 {
        let interval = Interval { t0, t1: t0 + step(k), u0: input(k), u1: input(k + 1), hold: Hold::First };
        t0 = interval.t1;
        let model = Pmsm { pole_pairs: 4.0 };
        x = ModelSystem { model: &model, interval: &interval, p: &p }.step(&Rk4::default(), x, &mut 0.0).unwrap();
    }
    let (carry, slopes) = carried(&group, 0);
    for (i, x) in [x.id, x.iq].into_iter().enumerate() {
        // Forty steps of forty operations; times of samples are sums, hence steps are off by 1e-16 / 1e-4.
        assert!((carry[i] - x.value).abs() < 1e-11 * x.value.abs(), "{} {}", carry[i], x.value);
        let size = x.slopes.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        (0..5).for_each(|s| assert!((slopes[5 * i + s] - x.slopes[s]).abs() < 1e-11 * size));
    }
}

/// Slopes that have decayed become zero, not denormal.
#[test]
fn negligible_slopes_are_set_to_zero() {
    let mut graph = Graph::default();
    let (x, k) = (graph.leaf(Leaf::State(0)), graph.leaf(Leaf::Parameter(0)));
    let next = graph.mul(x, k);
    let recurrence = Recurrence::from_roots(&graph, &[next], &[x], &[]).unwrap();
    let program = Program::compile(&recurrence, &[Seed::Carry(0)], Sampling::Uniform, Trajectories::Many).unwrap();
    let mut group = program.group(1);
    for lane in 0..group.lanes() {
        group.set_parameters(lane, &[0.1]);
        start(&mut group, &program, lane, &[1.0]);
    }
    group.prepare();
    let mut rows = vec![0.0; 100 * 2 * group.lanes()];
    let mut slope = [0.0];
    group.run(&[], &mut rows, 100);
    group.carry_slopes(0, &mut slope);
    assert!((slope[0] / 1e-100 - 1.0).abs() < 1e-12);
    group.run(&[], &mut rows, 60);
    group.run(&[], &mut rows, 1);
    group.carry_slopes(0, &mut slope);
    assert_eq!(slope, [0.0], "1e-160 was set to zero before the last block");
}

/// Thousands of operations: a network of a hundred and fifty states, each coupled to its neighbors.
#[test]
fn large_models_run() {
    const STATES: u32 = 150;
    let mut graph = Graph::default();
    let p: Vec<Id> = (0..6).map(|j| graph.leaf(Leaf::Parameter(j))).collect();
    let x: Vec<Id> = (0..STATES).map(|i| graph.leaf(Leaf::State(i))).collect();
    let next: Vec<Id> = (0..x.len())
        .map(|i| {
            let (before, after) = (x[(i + x.len() - 1) % x.len()], x[(i + 1) % x.len()]);
            let pull = graph.mul(before, p[i % 5]);
            let push = graph.mul(after, p[(i + 1) % 5]);
            let sum = graph.add(pull, push);
            let bent = graph.function(Function::Tanh, sum);
            let product = graph.mul(bent, x[i]);
            let change = graph.sub(product, sum);
            let scaled = graph.mul(change, p[5]);
            graph.add(x[i], scaled)
        })
        .collect();
    let mut mean = next[0];
    for next in &next[1..] {
        mean = graph.add(mean, *next);
    }
    let recurrence = Recurrence::from_roots(&graph, &next, &[mean], &[]).unwrap();
    let seeds: Vec<Seed> = (0..6).map(Seed::Parameter).chain([Seed::Carry(0), Seed::Carry(77)]).collect();
    let program = Program::compile(&recurrence, &seeds, Sampling::Uniform, Trajectories::Many).unwrap();
    let instructions = program.0.code.output.len() + program.0.code.advance.len();
    assert!(instructions > 5000, "{instructions}");
    let values = [0.3, -0.2, 0.5, 0.1, -0.4, 0.05];
    let carry: Vec<f64> = (0..STATES).map(|i| (0.1 * f64::from(i)).sin()).collect();
    let mut group = program.group(1);
    for lane in 0..group.lanes() {
        group.set_parameters(lane, &values);
        start(&mut group, &program, lane, &carry);
    }
    group.prepare();
    let mut rows = vec![0.0; 20 * 9 * group.lanes()];
    group.run(&[], &mut rows, 20);
    let at = |i: usize| match i {
        0 => 6,
        77 => 7,
        _ => 8,
    };
    let mut x: Vec<Dual<8>> = carry.iter().enumerate().map(|(i, x)| Dual::variable(*x, at(i))).collect();
    for k in 0..20 {
        let mut all = vec![];
        graph.evaluate_all(&mut all, |leaf| match leaf {
            Leaf::State(i) => x[i as usize],
            Leaf::Parameter(j) => Dual::variable(values[j as usize], j as usize),
            other => panic!("{other:?}"),
        });
        x = next.iter().map(|next| all[next.index()]).collect();
        let mean = all[mean.index()];
        for (s, expected) in mean.slopes.iter().chain([&mean.value]).enumerate() {
            let found = rows[(k * 9 + s) * group.lanes()];
            // A sum of a hundred and fifty numbers, after twenty steps.
            assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{found} {expected}");
        }
    }
}
