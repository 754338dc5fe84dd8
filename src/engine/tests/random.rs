//! Random expressions: the engine against duals.
//!
//! Slopes are compared where every intermediate value and slope is moderate; beyond, both are of no use. How much an expression makes of
//! rounding is seen by moving its arguments by a few units in the last place: what that changes is allowed.

use super::steps::start;
use greybox::engine::{Program, Sampling, Trajectories};
use greybox::graph::{Function, Function2, Graph, Id, Leaf, Node, Seed};
use greybox::scalar::{Comparison, Extrapolation, Interpolation};
use greybox::{Dual, Table, recurrence::Recurrence};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

pub const FUNCTIONS2: [Function2; 6] =
    [Function2::Pow, Function2::Atan2, Function2::Hypot, Function2::Max, Function2::Min, Function2::Copysign];
const COMPARISONS: [Comparison; 3] = [Comparison::Less, Comparison::LessOrEqual, Comparison::Equal];
const STATES: usize = 3;
const PARAMETERS: usize = 2;
const SEEDS: usize = STATES + PARAMETERS;

pub struct Random(SplitMix64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(SplitMix64::seed_from_u64(seed))
    }
    fn below(&mut self, n: usize) -> usize {
        (self.0.next_u64() % n as u64) as usize
    }
    pub fn number(&mut self) -> f64 {
        match self.below(24) {
            0 => 0.0,
            1 => -0.0,
            2 => 1.0,
            3 => -1.0,
            4 => 0.5,
            5 => [1e200, -1e308, 1e-310, f64::INFINITY, f64::NAN][self.below(5)],
            _ => (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64 * 4.0 - 2.0,
        }
    }
}

/// A curve and a surface for each way between their points and beyond. Points where random numbers often are, too.
fn tables() -> Vec<Table> {
    let (x, y): ([f64; 4], [f64; 3]) = ([-1.0, 0.0, 0.5, 1.7], [-1.2, 0.0, 1.0]);
    let values: Vec<f64> = x.iter().flat_map(|x| y.map(|y| (x * 0.7).sin() + 0.3 * x * y - 0.1 * y * y)).collect();
    let mut all = vec![];
    for between in [Interpolation::Linear, Interpolation::Smooth] {
        for beyond in [Extrapolation::Hold, Extrapolation::Linear] {
            all.push(Table::curve(&x, &[2.0, 1.0, 1.5, -1.0], between, beyond).unwrap());
            all.push(Table::surface(&x, &y, &values, between, beyond).unwrap());
        }
    }
    all
}

pub fn expression(random: &mut Random, size: usize) -> (Graph, Vec<Id>) {
    let (mut graph, tables) = (Graph::default(), tables());
    let mut nodes: Vec<Id> = (0..STATES as u32).map(|i| graph.leaf(Leaf::State(i))).collect();
    nodes.extend((0..PARAMETERS as u32).map(|j| graph.leaf(Leaf::Parameter(j))));
    for _ in 0..size {
        let any = |random: &mut Random, graph: &mut Graph| {
            // Late nodes more often, so that expressions are deep.
            let n = nodes.len();
            match random.below(12) {
                0 => graph.constant(random.number()),
                1..=5 => nodes[n - 1 - random.below(n.min(4))],
                _ => nodes[random.below(n)],
            }
        };
        let [a, b, c, d] = core::array::from_fn(|_| any(random, &mut graph));
        let node = match random.below(17) {
            0..=2 => graph.add(a, b),
            3 | 4 => graph.sub(a, b),
            5..=8 => graph.mul(a, b),
            9 => graph.div(a, b),
            10 => graph.neg(a),
            11 => graph.power(a, random.below(9) as i32 - 4),
            12 | 13 => graph.function(Function::ALL[random.below(28)], a),
            14 => graph.function2(FUNCTIONS2[random.below(6)], a, b),
            15 => {
                let (table, at) = (&tables[random.below(tables.len())], [a, b]);
                graph.table(table, [0, 0], if table.grid().is_surface() { at } else { [a, a] })
            }
            _ => graph.select(COMPARISONS[random.below(3)], a, b, c, d),
        };
        nodes.push(node);
    }
    let last = nodes.len() - 1;
    (graph, vec![nodes[last], nodes[last - 1]])
}

fn duals(graph: &Graph, roots: &[Id], at: &[f64; SEEDS]) -> Vec<Dual<SEEDS>> {
    graph.evaluate(roots, |leaf| match leaf {
        Leaf::State(i) => Dual::variable(at[i as usize], i as usize),
        Leaf::Parameter(j) => Dual::variable(at[STATES + j as usize], STATES + j as usize),
        other => panic!("{other:?}"),
    })
}

/// Compares a graph's values and slopes at these points with duals; tells how many slopes were compared.
pub fn agrees(graph: &Graph, roots: &[Id], points: &[[f64; SEEDS]], random: bool) -> usize {
    let mut with_states = graph.clone();
    let next: Vec<Id> = (0..STATES as u32).map(|i| with_states.leaf(Leaf::State(i))).collect();
    let recurrence = Recurrence::from_roots(&with_states, &next, roots, &[]).unwrap();
    let seeds: Vec<Seed> = (0..STATES).map(Seed::Carry).chain((0..PARAMETERS).map(Seed::Parameter)).collect();
    let program = Program::compile(&recurrence, &seeds, Sampling::Uniform, Trajectories::Many).unwrap();
    let mut compared = 0;
    for points in points.chunks(program.lanes()) {
        let mut group = program.group(points.len());
        let lanes = group.lanes();
        for (lane, point) in points.iter().enumerate() {
            start(&mut group, &program, lane, &point[..STATES]);
            group.set_parameters(lane, &point[STATES..]);
        }
        group.prepare();
        let mut rows = vec![0.0; program.row_length() * lanes];
        group.run(&[], &mut rows, 1);
        for (lane, point) in points.iter().enumerate() {
            let row = |root: usize, s: usize| rows[(root * (SEEDS + 1) + s) * lanes + lane];
            let reached = graph.reached(roots);
            let moderate = |x: f64| x == 0.0 || x.abs() < 1e8 && x.abs() > 1e-150;
            let mut all = vec![];
            graph.evaluate_all(&mut all, |leaf| match leaf {
                Leaf::State(i) => Dual::<SEEDS>::variable(point[i as usize], i as usize),
                Leaf::Parameter(j) => Dual::variable(point[STATES + j as usize], STATES + j as usize),
                other => panic!("{other:?}"),
            });
            // Where a slope is infinite, or nearly so, rounding decides what the argument's slope makes of it.
            let near = |x: &Id, edge: f64| (all[x.index()].value.abs() - edge).abs() < 1e-6;
            let at_the_edge = |node: &Node| match node {
                Node::Function(Function::Asin | Function::Acos | Function::Acosh | Function::Atanh, x) => near(x, 1.0),
                Node::Function(Function::Sqrt | Function::Cbrt, x) => near(x, 0.0),
                Node::Function2(Function2::Hypot | Function2::Pow, x, _) => near(x, 0.0),
                _ => false,
            };
            let at_the_edge = random && graph.nodes().iter().any(at_the_edge);
            let numbers = all.iter().zip(&reached).filter(|(_, reached)| **reached).map(|(x, _)| x);
            let largest = numbers.clone().flat_map(|x| x.slopes).fold(0.0, |m: f64, slope| m.max(slope.abs()));
            // The sign of what is not a number depends on the processor.
            let copied = |node: &Node| match node {
                Node::Function2(Function2::Copysign, _, sign) => all[sign.index()].value.is_nan(),
                _ => false,
            };
            if graph.nodes().iter().any(copied) {
                continue;
            }
            let tame = numbers.clone().all(|x| moderate(x.value) && x.slopes.iter().all(|slope| slope.abs() < 1e8));
            let expected = duals(graph, roots, point);
            let nearby: Vec<_> = [1.0, -1.0, 2.0, -3.0]
                .map(|units: f64| {
                    let at = core::array::from_fn(|i| point[i] * (1.0 + (units + i as f64) * f64::EPSILON));
                    duals(graph, roots, &at)
                })
                .into();
            for (root, expected) in expected.iter().enumerate() {
                let moved = |of: &dyn Fn(&Dual<SEEDS>) -> f64| {
                    nearby.iter().map(|near| (of(&near[root]) - of(expected)).abs()).fold(0.0, f64::max)
                };
                let check = |found: f64, expected: f64, moved: f64, what: &str| {
                    let moved = if what == "slope" { moved + 1e-13 * (1.0 + largest) } else { moved };
                    let fine = found == expected
                        || found.is_nan() && expected.is_nan()
                        || (found - expected).abs() <= 1e-12 * expected.abs() + 64.0 * moved
                        || moved.is_nan();
                    assert!(fine, "{what}: {found} against {expected}, at {point:?} in\n{graph}");
                };
                let value = row(root, SEEDS);
                check(value, expected.value, moved(&|dual| dual.value), "value");
                if tame && !at_the_edge {
                    for s in 0..SEEDS {
                        check(row(root, s), expected.slopes[s], moved(&|dual| dual.slopes[s]), "slope");
                        compared += 1;
                    }
                }
            }
        }
    }
    compared
}

#[test]
fn random_expressions_have_the_slopes_of_duals() {
    let mut random = Random::new(8);
    let mut compared = 0;
    for case in 0..10_000 {
        let (graph, roots) = expression(&mut random, 4 + case % 20);
        let points: Vec<_> = (0..16).map(|_| core::array::from_fn(|_| random.number())).collect();
        compared += agrees(&graph, &roots, &points, true);
    }
    assert!(compared > 500_000, "{compared} slopes");
}

#[test]
fn every_function_has_the_slopes_of_duals() {
    let axis = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.3,
        -0.7,
        2.0,
        -3.5,
        1.5,
        40.0,
        -40.0,
        0.5,
        -0.5,
        710.0,
        -745.0,
        1e-310,
        1e308,
        f64::NAN,
    ];
    let mut points = vec![];
    for a in axis.into_iter().chain([f64::INFINITY, f64::NEG_INFINITY]) {
        for b in [0.0, -0.0, 1.0, 0.3, -2.0, a, -a, f64::NAN] {
            points.push([a, b, 0.25, 1.5, -0.5]);
        }
    }
    let mut compared = 0;
    let mut each = |build: &dyn Fn(&mut Graph, Id, Id) -> Id| {
        for scaled in [false, true] {
            let mut graph = Graph::default();
            let [x, y, z] = [Leaf::State(0), Leaf::State(1), Leaf::Parameter(0)].map(|leaf| graph.leaf(leaf));
            let x = if scaled { graph.mul(x, z) } else { x };
            let root = build(&mut graph, x, y);
            compared += agrees(&graph, &[root], &points, false);
        }
    };
    for function in Function::ALL {
        each(&|graph, x, _| graph.function(function, x));
    }
    for function in FUNCTIONS2 {
        each(&|graph, x, y| graph.function2(function, x, y));
    }
    for n in [-3, -1, 0, 1, 2, 3, 7] {
        each(&|graph, x, _| graph.power(x, n));
    }
    for n in [0.5, 2.5, -0.5, 1.0 / 3.0] {
        each(&|graph, x, _| {
            let n = graph.constant(n);
            graph.function2(Function2::Pow, x, n)
        });
    }
    for comparison in COMPARISONS {
        each(&|graph, x, y| graph.select(comparison, x, y, x, y));
    }
    each(&|graph, x, _| {
        let period = graph.constant(0.7);
        graph.function2(Function2::RemEuclid, x, period)
    });
    each(&|graph, x, y| graph.div(x, y));
    assert!(compared > 30_000, "{compared} slopes");
}

/// Values of sums, products, roots and selects have the very bits of the text: each operation is rounded, in its order.
#[test]
fn values_have_the_bits_of_the_text() {
    let mut random = Random::new(3);
    let mut compared = 0;
    for _ in 0..500 {
        let mut graph = Graph::default();
        let mut nodes: Vec<Id> = (0..3).map(|i| graph.leaf(Leaf::State(i))).collect();
        for _ in 0..25 {
            let n = nodes.len();
            let [a, b, c, d] = core::array::from_fn(|_| nodes[n - 1 - random.below(n.min(6))]);
            nodes.push(match random.below(12) {
                0..=3 => graph.mul(a, b),
                4 | 5 => graph.add(a, b),
                6 | 7 => graph.sub(a, b),
                8 => graph.neg(a),
                9 => graph.function([Function::Sqrt, Function::Abs, Function::Floor][random.below(3)], a),
                10 => graph.function2([Function2::Max, Function2::Min][random.below(2)], a, b),
                _ => graph.select(COMPARISONS[random.below(3)], a, b, c, d),
            });
        }
        let (next, roots) = (nodes[..3].to_vec(), nodes[20..].to_vec());
        let recurrence = Recurrence::from_roots(&graph, &next, &roots, &[]).unwrap();
        for seeds in [&[][..], &[Seed::Carry(0), Seed::Carry(1), Seed::Carry(2)]] {
            let program = Program::compile(&recurrence, seeds, Sampling::Uniform, Trajectories::Many).unwrap();
            let mut group = program.group(1);
            let points: Vec<[f64; 3]> = (0..group.lanes()).map(|_| core::array::from_fn(|_| random.number())).collect();
            points.iter().enumerate().for_each(|(lane, point)| start(&mut group, &program, lane, point));
            group.prepare();
            let mut rows = vec![0.0; program.row_length() * group.lanes()];
            group.run(&[], &mut rows, 1);
            for (lane, point) in points.iter().enumerate() {
                let expected = graph.evaluate(&roots, |leaf| match leaf {
                    Leaf::State(i) => point[i as usize],
                    other => panic!("{other:?}"),
                });
                for (root, expected) in expected.iter().enumerate() {
                    let found = rows[(root * (seeds.len() + 1) + seeds.len()) * group.lanes() + lane];
                    // Which of two zeros is the larger is not said.
                    let same = found == *expected && (found == 0.0 || found.to_bits() == expected.to_bits());
                    assert!(
                        same || found.is_nan() && expected.is_nan(),
                        "{found:e} {expected:e} at {point:?}\n{graph}"
                    );
                    compared += usize::from(found.is_finite());
                }
            }
        }
    }
    assert!(compared > 20_000, "{compared}");
}
