//! Engines keep within the memory that they are given, which the compiler does not check for them: machine code and the interpreter's
//! reads and writes at addresses.

use super::super::choice::Machine;
use super::super::code::Sound;
use super::super::interpret::{Part, Run};
use super::random::{Random, expression};
use crate::wide::{Width, run, run_narrow};
use greybox::engine::{Program, Sampling, Trajectories};
use greybox::graph::{Graph, Id, Leaf, Seed};
use greybox::recurrence::Recurrence;

/// Numbers before and after those that are given: more than the widest register has.
const AROUND: usize = 32;

/// Numbers amid others of one value.
struct Guarded {
    all: Vec<f64>,
    guard: f64,
}

impl Guarded {
    fn new(numbers: &[f64], guard: f64) -> Self {
        let around = [guard; AROUND];
        Guarded { all: [&around, numbers, &around].concat(), guard }
    }

    fn numbers(&mut self) -> &mut [f64] {
        let end = self.all.len() - AROUND;
        &mut self.all[AROUND..end]
    }

    fn is_intact(&self) -> bool {
        let (before, rest) = self.all.split_at(AROUND);
        let after = &rest[rest.len() - AROUND..];
        before.iter().chain(after).all(|x| x.to_bits() == self.guard.to_bits())
    }
}

/// An engine on registers side by side.
#[derive(Clone, Copy, Debug)]
enum Engine {
    Machine,
    Interpreter(usize),
}

/// Runs samples from these slots, all numbers between guards, and returns what the rows and the carry are then.
fn ran(
    code: &Sound,
    engine: Engine,
    width: Width,
    [slots, inputs]: [&[f64]; 2],
    samples: usize,
    guard: f64,
) -> Vec<u64> {
    let registers = if let Engine::Interpreter(registers) = engine { registers } else { 1 };
    let lanes = registers * width.lanes();
    let (mut slots, mut inputs) = (Guarded::new(slots, guard), Guarded::new(inputs, guard));
    let mut rows = Guarded::new(&vec![0.0; samples * code.rows.len() * lanes], guard);
    let interpret = |slots: &mut [f64], part| match registers {
        1 => run(width, Run::<1> { code, slots, part, width }),
        2 => run(width, Run::<2> { code, slots, part, width }),
        4 => run(width, Run::<4> { code, slots, part, width }),
        _ => run_narrow(width, Run::<8> { code, slots, part, width }),
    };
    interpret(slots.numbers(), Part::Once);
    match engine {
        Engine::Machine => {
            let machine = Machine::new(code, width).unwrap();
            machine.run(code, lanes, slots.numbers(), inputs.numbers(), rows.numbers(), samples);
        }
        Engine::Interpreter(_) => {
            interpret(slots.numbers(), Part::Samples { inputs: inputs.numbers(), rows: rows.numbers(), samples });
        }
    }
    assert!(slots.is_intact() && inputs.is_intact() && rows.is_intact(), "{engine:?} of {width:?}, {samples} samples");
    let carry = slots.numbers()[..code.carried * lanes].to_vec();
    // Whether a number that is none is negative depends on the processor.
    let bits = |x: &f64| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() };
    rows.numbers().iter().chain(&carry).map(bits).collect()
}

/// The expression with an input and another of the next sample in the place of a state and a parameter.
fn with_inputs(random: &mut Random, size: usize) -> Recurrence {
    let (expression, roots) = expression(random, size);
    let mut graph = Graph::default();
    let roots = graph.import(&expression, &roots, |graph, leaf| {
        graph.leaf(match leaf {
            Leaf::State(2) => Leaf::Input(0),
            Leaf::Parameter(1) => Leaf::NextInput(1),
            other => other,
        })
    });
    let state: Vec<Id> = (0..2).map(|i| graph.leaf(Leaf::State(i))).collect();
    Recurrence::from_roots(&graph, &[state[1], roots[0]], &roots, &[]).unwrap()
}

/// What lies around slots, inputs and rows is not written, whatever its value, and not read: the same bits come out, other value or not.
#[test]
fn engines_keep_within_their_memory() {
    let mut random = Random::new(21);
    let seeds = [Seed::Carry(0), Seed::Carry(1), Seed::Parameter(0)];
    let widths = [Some(Width::widest()), Width::avx2(), Some(Width::portable()), Some(Width::single())];
    let (mut compiled, mut numbers) = (0, 0);
    for case in 0..400 {
        let recurrence = with_inputs(&mut random, 4 + case % 40);
        let seeds = &seeds[..if case % 3 == 0 { 0 } else { 3 }];
        let program = Program::compile(&recurrence, seeds, Sampling::Uniform, Trajectories::Many).unwrap();
        let code = &program.0.code;
        for width in widths.into_iter().flatten() {
            let machine = Machine::new(code, width).map(|_| Engine::Machine);
            compiled += usize::from(machine.is_some());
            let registers: &[usize] = if width.lanes() == 4 { &[1, 2, 4, 8] } else { &[1, 2, 4] };
            for engine in registers.iter().map(|registers| Engine::Interpreter(*registers)).chain(machine) {
                let lanes = if let Engine::Interpreter(registers) = engine { registers } else { 1 } * width.lanes();
                let samples = [1, 2, 5, 0][case % 4];
                let mut some = |count: usize| (0..count * lanes).map(|_| random.number()).collect::<Vec<f64>>();
                let mut slots = some(code.slots);
                for (slot, value) in &code.constants {
                    slots[usize::from(*slot) * lanes..][..lanes].fill(*value);
                }
                let inputs = some((samples + usize::from(code.reads_next())) * code.columns.len());
                let given = [&slots[..], &inputs[..]];
                let [a, b] = [1.5, f64::NAN].map(|guard| ran(code, engine, width, given, samples, guard));
                assert_eq!(a, b, "{engine:?} of {width:?}, {samples} samples");
                numbers += a.len();
            }
        }
    }
    assert!(numbers > 500_000, "{numbers}");
    let machine = cfg!(all(feature = "jit", target_arch = "x86_64", target_os = "linux")) && Width::avx2().is_some();
    assert!(!machine || compiled >= 800, "{compiled}");
}
