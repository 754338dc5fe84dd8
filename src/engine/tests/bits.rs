//! The same bits from every engine: the variable that chooses one is set for runs of this very program.

use super::random::{FUNCTIONS2, Random, expression};
use super::steps::{Pmsm, simulation, start};
use super::tables::Mapped;
use greybox::engine::{Program, Sampling, Trajectories};
use greybox::graph::{Function, Graph, Id, Leaf, Seed};
use greybox::pmsm::{Machine, Salient};
use greybox::{
    Hold, Model, Rk4,
    equations::Equations,
    recurrence::Recurrence,
    scalar::{Extrapolation, Interpolation},
};
use std::process::Command;

/// A number made of all bits of all rows (FNV-1a); all numbers that are none count as one.
struct Digest(u64);

impl Digest {
    fn add(&mut self, x: f64) {
        let bits = if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
        self.0 = (self.0 ^ bits).wrapping_mul(0x0100_0000_01b3).rotate_left(17);
    }
}

/// Eight trajectories, whatever the number of lanes; `at(k, lane, column)` are the inputs.
fn rows_of(
    digest: &mut Digest,
    recurrence: &Recurrence,
    seeds: &[Seed],
    starts: &[Vec<f64>; 8],
    p: &[Vec<f64>; 8],
    samples: usize,
) {
    for trajectories in [Trajectories::Many, Trajectories::One] {
        let program = Program::compile(recurrence, seeds, Sampling::Uniform, trajectories).unwrap();
        let mut found = vec![vec![]; 8];
        let mut next = 0;
        while next < 8 {
            let mut group = program.group(8 - next);
            let lanes = group.lanes();
            for lane in 0..lanes {
                let trajectory = (next + lane).min(7);
                group.set_parameters(lane, &p[trajectory]);
                group.set_step(lane, 1e-3 * (1.0 + trajectory as f64));
                start(&mut group, &program, lane, &starts[trajectory]);
            }
            group.prepare();
            let columns = program.columns().len();
            let mut inputs = vec![0.0; (samples + 1) * columns * lanes];
            for (i, input) in inputs.iter_mut().enumerate() {
                let (k, column, lane) = (i / (columns * lanes), i / lanes % columns, (next + i % lanes).min(7));
                *input = 30.0 * (0.1 * k as f64 + column as f64 + 0.3 * lane as f64).sin();
            }
            let mut rows = vec![0.0; samples * program.row_length() * lanes];
            // Odd numbers of samples: what is carried stands in other slots then.
            let half = samples * 9 / 20;
            let (first, second) = rows.split_at_mut(half * program.row_length() * lanes);
            group.run(&inputs, first, half);
            group.run(&inputs[half * columns * lanes..], second, samples - half);
            for lane in 0..lanes.min(8 - next) {
                found[next + lane].extend(rows.iter().skip(lane).step_by(lanes));
                let mut carry = vec![0.0; program.carried() * (1 + seeds.len())];
                let (values, slopes) = carry.split_at_mut(program.carried());
                group.carry(lane, values);
                group.carry_slopes(lane, slopes);
                found[next + lane].extend(carry);
            }
            next += lanes;
        }
        found.iter().flatten().for_each(|x| digest.add(*x));
    }
}

fn of_expression(digest: &mut Digest, random: &mut Random, mut graph: Graph, roots: &[Id]) {
    let next: Vec<Id> = (0..3).map(|i| graph.leaf(Leaf::State(i))).collect();
    let recurrence = Recurrence::from_roots(&graph, &next, roots, &[]).unwrap();
    let seeds = [Seed::Carry(0), Seed::Carry(1), Seed::Carry(2), Seed::Parameter(0), Seed::Parameter(1)];
    let mut numbers = |n: usize| core::array::from_fn(|_| (0..n).map(|_| random.number()).collect());
    let (starts, p) = (numbers(3), numbers(2));
    rows_of(digest, &recurrence, &seeds, &starts, &p, 1);
    // Entries that change places, and one that is computed in the place of one that is still read.
    let changed = [next[1], next[0], *roots.last().unwrap()];
    let recurrence = Recurrence::from_roots(&graph, &changed, roots, &[]).unwrap();
    rows_of(digest, &recurrence, &seeds, &starts, &p, 5);
}

fn of_model<M: Model>(digest: &mut Digest, model: &M, p: &[f64]) {
    let equations = Equations::trace(model).unwrap();
    for hold in [Hold::Zero, Hold::First] {
        let recurrence = simulation(&equations, &Rk4 { substeps: 2 }, hold);
        let states = equations.layout().states.len();
        let seeds: Vec<Seed> = (0..p.len()).map(Seed::Parameter).chain((0..states).map(Seed::Carry)).collect();
        let starts = core::array::from_fn(|lane| (0..states).map(|i| (lane + i) as f64 - 3.0).collect());
        let p = core::array::from_fn(|lane| p.iter().map(|p| p * (1.0 + 0.05 * lane as f64)).collect());
        rows_of(digest, &recurrence, &seeds, &starts, &p, 60);
        rows_of(digest, &recurrence, &[], &starts, &p, 60);
    }
}

fn digest() -> u64 {
    let mut digest = Digest(0);
    of_model(&mut digest, &Pmsm { pole_pairs: 4.0 }, &[0.6, 3.5e-3, 0.9]);
    of_model(&mut digest, &Salient::new(4).unwrap(), &[0.63, 4e-3, 5e-3, 0.95]);
    of_model(&mut digest, &Machine::new(4, 100.0).unwrap(), &[0.63, 4e-3, 5e-3, 0.95, 0.012, 4e-3, 1.2, 1.0]);
    for between in [Interpolation::Linear, Interpolation::Smooth] {
        of_model(&mut digest, &Mapped::new(between, Extrapolation::Linear), &[1.0, 0.7]);
    }
    let mut random = Random::new(88);
    for case in 0..1500 {
        let (graph, roots) = expression(&mut random, 4 + case % 40);
        of_expression(&mut digest, &mut random, graph, &roots);
    }
    let mut each = |build: &dyn Fn(&mut Graph, Id, Id) -> Id| {
        for _ in 0..20 {
            let mut graph = Graph::default();
            let [x, y] = [Leaf::State(0), Leaf::State(1)].map(|leaf| graph.leaf(leaf));
            let root = build(&mut graph, x, y);
            of_expression(&mut digest, &mut random, graph, &[root]);
        }
    };
    Function::ALL.iter().for_each(|function| each(&|graph, x, _| graph.function(*function, x)));
    FUNCTIONS2.iter().for_each(|function| each(&|graph, x, y| graph.function2(*function, x, y)));
    digest.0
}

const MARK: &str = "digest of all rows: ";

#[test]
#[ignore = "run by the test below, once for each engine"]
fn digest_of_this_engine() {
    println!("{MARK}{:x}", digest());
}

#[test]
fn every_engine_gives_the_same_bits() {
    let digest_of = |engine: &str| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "engine::tests::bits::digest_of_this_engine", "--ignored", "--nocapture"])
            .env("GREYBOX_ENGINE", engine);
        let output = String::from_utf8(command.output().unwrap().stdout).unwrap();
        let at = output.find(MARK).unwrap_or_else(|| panic!("{engine}: {output}"));
        output[at + MARK.len()..].lines().next().unwrap().to_owned()
    };
    let reference = digest_of("portable");
    for engine in ["machine-code", "avx2", "interpreter", "interpreter-avx2"] {
        assert_eq!(digest_of(engine), reference, "{engine} against the portable interpreter");
    }
}

#[test]
fn machine_code_is_made_where_it_can_be() {
    let equations = Equations::trace(&Pmsm { pole_pairs: 4.0 }).unwrap();
    let recurrence = simulation(&equations, &Rk4::default(), Hold::Zero);
    let program = Program::compile(&recurrence, &[Seed::Carry(0)], Sampling::Uniform, Trajectories::Many).unwrap();
    let chosen = std::env::var("GREYBOX_ENGINE").unwrap_or_default();
    let expected = cfg!(all(feature = "jit", target_arch = "x86_64", target_os = "linux"))
        && !chosen.starts_with("interpreter")
        && chosen != "portable";
    #[cfg(target_arch = "x86_64")]
    let expected = expected && is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    assert_eq!(program.machine_code() > 0, expected);
}
