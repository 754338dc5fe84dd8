//! [`DifferentiatedSystem`]: equations known at run time for adaptive and stiff integrators, on duals of eight slopes.
//!
//! The right-hand side is compiled with one tangent per lane, so that one evaluation gives a value and eight slopes, or eight
//! columns of the Jacobian.

use super::{Column, Group, Program, TooLarge};
use crate::dual::Dual;
use crate::equations::Equations;
use crate::integrate::{Square, System};
use crate::interval::Hold;
use crate::layout::Kind;
use crate::signals::Entry;
use core::cell::RefCell;
use smallvec::SmallVec;

/// Slopes of a number.
pub const SLOPES: usize = 8;

/// A number with eight slopes.
type Number = Dual<SLOPES>;

/// A few entries, without memory of their own as long as they are few.
pub type Few<T> = SmallVec<[T; 8]>;

/// The right-hand side of equations, compiled with its slopes.
#[derive(Clone, Debug)]
pub struct Differentiated {
    program: Program,
    kind: Kind,
    states: usize,
    parameters: usize,
}

impl Differentiated {
    /// Compiles the equations' right-hand side.
    ///
    /// # Errors
    /// If it needs too many numbers at a time.
    pub fn new(equations: &Equations) -> Result<Self, TooLarge> {
        let layout = equations.layout();
        let program = Program::right_hand_side(equations)?;
        Ok(Differentiated {
            program,
            kind: layout.kind,
            states: layout.states.len(),
            parameters: layout.parameters.len(),
        })
    }

    /// The system with these parameters, on an interval that is still to be set.
    ///
    /// # Panics
    /// If a parameter is missing.
    pub fn system(&self, p: &[Number]) -> DifferentiatedSystem<'_> {
        let p = &p[..self.parameters];
        let constants: Vec<Number> = p.iter().map(|p| Dual::constant(p.value)).collect();
        let on_interval = Interval { begin: 0.0, length: 0.0, u0: vec![], u1: vec![], hold: Hold::Zero };
        DifferentiatedSystem {
            of: self,
            with_slopes: RefCell::new(Lanes::new(&self.program, p)),
            of_states_alone: RefCell::new(Lanes::new(&self.program, &constants)),
            interval: on_interval,
        }
    }
}

#[derive(Clone, Debug)]
struct Interval {
    begin: f64,
    length: f64,
    u0: Vec<f64>,
    u1: Vec<f64>,
    hold: Hold,
}

/// As many groups as eight lanes take, and their inputs and rows.
#[derive(Debug)]
struct Lanes {
    groups: Vec<Group>,
    columns: Vec<Column>,
    inputs: Vec<f64>,
    rows: Vec<f64>,
}

impl Lanes {
    fn new(program: &Program, p: &[Number]) -> Self {
        let group = program.group(SLOPES);
        let lanes = group.lanes();
        let mut groups = vec![group; SLOPES.div_ceil(lanes)];
        for (number, group) in groups.iter_mut().enumerate() {
            for lane in 0..lanes {
                let slope = (number * lanes + lane).min(SLOPES - 1);
                let values = p.iter().map(|p| p.value).chain(p.iter().map(|p| p.slopes[slope]));
                group.set_parameters(lane, &values.collect::<Few<f64>>());
            }
            group.prepare();
        }
        let columns = program.columns().to_vec();
        let (inputs, rows) = (vec![0.0; columns.len() * lanes], vec![0.0; program.row_length() * lanes]);
        Lanes { groups, columns, inputs, rows }
    }

    /// Values and slopes of the right-hand side; `input` is every other quantity.
    fn run(&mut self, t: f64, x: &[Number], input: impl Fn(usize) -> f64) -> Few<Number> {
        let mut f: Few<Number> = x.iter().map(|_| Number::default()).collect();
        for (number, group) in self.groups.iter_mut().enumerate() {
            let lanes = group.lanes();
            let slopes = number * lanes..SLOPES.min((number + 1) * lanes);
            for (column, lanes) in self.columns.iter().zip(self.inputs.chunks_exact_mut(lanes)) {
                match *column {
                    Column::Input(i) if i < x.len() => lanes.fill(x[i].value),
                    Column::Input(i) if i < 2 * x.len() => {
                        lanes[..slopes.len()].copy_from_slice(&x[i - x.len()].slopes[slopes.clone()]);
                    }
                    Column::Input(i) => lanes.fill(input(i - 2 * x.len())),
                    _ => lanes.fill(t),
                }
            }
            group.run(&self.inputs, &mut self.rows, 1);
            let (values, tangents) = self.rows.split_at(x.len() * lanes);
            for (i, f) in f.iter_mut().enumerate() {
                f.value = values[i * lanes];
                f.slopes[slopes.clone()].copy_from_slice(&tangents[i * lanes..][..slopes.len()]);
            }
        }
        f
    }
}

/// The equations of one interval after the other.
#[derive(Debug)]
pub struct DifferentiatedSystem<'a> {
    of: &'a Differentiated,
    with_slopes: RefCell<Lanes>,
    /// With parameters that do not vary.
    of_states_alone: RefCell<Lanes>,
    interval: Interval,
}

impl DifferentiatedSystem<'_> {
    /// The interval from `t0` to `t1` (s), with the inputs at its ends.
    pub fn set_interval(&mut self, t0: f64, t1: f64, u0: &[f64], u1: &[f64], hold: Hold) {
        self.interval.u0.clear();
        self.interval.u0.extend(u0);
        self.interval.u1.clear();
        self.interval.u1.extend(u1);
        (self.interval.begin, self.interval.length, self.interval.hold) = (t0, t1 - t0, hold);
    }

    fn run(&self, lanes: &RefCell<Lanes>, position: f64, x: &[Number]) -> Few<Number> {
        let Interval { begin, length, u0, u1, hold } = &self.interval;
        let input = |i: usize| match hold {
            Hold::Zero => u0[i],
            Hold::First => u0[i] + (u1[i] - u0[i]) * position,
        };
        lanes.borrow_mut().run(begin + position * length, x, input)
    }
}

impl System for DifferentiatedSystem<'_> {
    type Scalar = Number;
    type Vector<T: Entry> = Few<T>;
    type Matrix = Vec<Vec<f64>>;

    fn kind(&self) -> Kind {
        self.of.kind
    }

    fn interval(&self) -> (f64, f64) {
        (self.interval.begin, self.interval.length)
    }

    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Few<T> {
        (0..self.of.states).map(f).collect()
    }

    fn derivative(&self, position: f64, x: &Few<Number>) -> Few<Number> {
        self.run(&self.with_slopes, position, x)
    }

    fn next(&self, x: &Few<Number>) -> Few<Number> {
        self.run(&self.with_slopes, 0.0, x)
    }

    fn jacobian(&self, position: f64, x: &Few<f64>) -> (Few<f64>, Vec<Vec<f64>>) {
        let (mut f, mut rows) = (x.clone(), vec![vec![0.0; x.len()]; x.len()]);
        for from in (0..x.len()).step_by(SLOPES) {
            let slope = |i: usize| i.checked_sub(from).unwrap_or(SLOPES);
            let seeded: Few<Number> = x.iter().enumerate().map(|(i, x)| Dual::variable(*x, slope(i))).collect();
            for (i, dual) in self.run(&self.of_states_alone, position, &seeded).iter().enumerate() {
                f[i] = dual.value;
                for (entry, slope) in rows.row_mut(i).iter_mut().skip(from).zip(dual.slopes) {
                    *entry = slope;
                }
            }
        }
        (f, rows)
    }

    fn along(&self, x: &Few<Number>, part: f64, k: &Few<Number>) -> Few<Number> {
        use crate::scalar::Scalar;
        let a = self.interval.length * part;
        x.iter().zip(k).map(|(x, k)| x.plus_times(*k, a)).collect()
    }
}
