//! The state that follows from measured outputs, as far as they determine it.

use crate::dual::Dual;
use crate::functions::Functions;
use crate::information::{Information, norm};
use crate::integrate::Duals;
use crate::layout::{Kind, Layout, Quantity};
use crate::numeral::exact;
use crate::predict::plant::{identity, value_and_slopes};

const LANES: usize = 8;
const ITERATIONS: usize = 50;
/// A Newton step to a state where the outputs are undefined is halved this many times at most.
const HALVINGS: usize = 30;
/// Damping of states that the outputs do not give, relative to the largest slopes.
const DAMPING: f64 = 1e-6;
/// A state whose slopes are below this part of those at the start moves the outputs no more.
const LOST: f64 = 1e-6;
/// A state of which a larger part than this comes from the damping is not given.
const GIVEN: f64 = 0.01;

/// Where outputs are solved for states: equations, time, inputs and parameters.
pub(crate) struct Place<'p> {
    pub layout: &'p Layout,
    pub functions: &'p dyn Functions<Duals>,
    pub t: f64,
    pub u: &'p [f64],
    pub p: &'p [f64],
}

impl Slopes {
    /// The states that the outputs do not determine: those of which the damping decides a part, with rows and columns in units of their largest entry.
    fn open(&self) -> Vec<bool> {
        let n = self.rows.first().map_or(0, Vec::len);
        let largest = |of: &mut dyn Iterator<Item = f64>| of.fold(0.0f64, |most, entry| most.max(entry.abs()));
        let unit = |most: f64| if most > 0.0 { most } else { 1.0 };
        let measured = self.rows.iter().zip(&self.errors).filter(|(_, error)| error.is_finite());
        let rows = measured.map(|(row, _)| {
            let most = unit(largest(&mut row.iter().copied()));
            row.iter().map(|entry| entry / most).collect()
        });
        let rows: Vec<Vec<f64>> = rows.collect();
        let columns: Vec<f64> = (0..n).map(|j| unit(largest(&mut rows.iter().map(|row| row[j])))).collect();
        let mut information = Information::new(n);
        for row in &rows {
            let row: Vec<f64> = row.iter().zip(&columns).map(|(entry, most)| entry / most).collect();
            information.absorb_row(&row, 0.0);
        }
        let damped = information.damped(&vec![DAMPING; n]);
        let of_damping = |i: usize| {
            let row: Vec<f64> = (0..n).map(|j| if i == j { DAMPING } else { 0.0 }).collect();
            damped.leverage(&row).unwrap_or(1.0)
        };
        (0..n).map(|i| of_damping(i) > GIVEN).collect()
    }
}

/// A start for the state, and which of its entries the outputs do not give.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// The state; zero (one, where the equations are undefined at zero) in the entries that are not given.
    pub state: Vec<f64>,
    /// Whether the outputs leave the entry open.
    pub open: Vec<bool>,
    /// The size of each entry that the outputs give, in its unit: its magnitude, or the change that changes an output by half
    /// its range in the record, whichever is larger. A search limits its steps by it; `None`: by the magnitude alone.
    pub sizes: Vec<Option<f64>>,
}

/// Errors of the outputs at a state, and their slopes with respect to the states.
struct Slopes {
    errors: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

impl Place<'_> {
    /// The state whose outputs are the measured ones.
    ///
    /// # Errors
    /// Why there is none.
    pub fn state(&self, y: &[f64]) -> Result<Vec<f64>, String> {
        let n = self.layout.states.len();
        let found = y.iter().filter(|y| y.is_finite()).count();
        if found < n {
            let (states, outputs) = (names(&self.layout.states), names(&self.layout.outputs));
            let t = exact(self.t);
            return Err(format!("{n} state(s), {states}, but {found} measured of the output(s) {outputs} at t = {t}"));
        }
        let Guess { state, open, .. } = self.nearest(y, 0.0)?;
        match open.iter().position(|open| *open) {
            Some(i) => Err(format!("the outputs do not determine `{}`", self.layout.states[i].name)),
            None => Ok(state),
        }
    }

    /// The same for entries that the outputs determine; the others are zero, or one where the equations are undefined there.
    /// `moves`: half the range of each output in the record, in its unit.
    ///
    /// # Errors
    /// Outputs that are undefined at both.
    pub fn guess(&self, y: &[f64], moves: &[f64]) -> Result<Guess, String> {
        let guess = self.guess_state(y)?;
        let Ok(slopes) = self.slopes(&guess.state, y) else { return Ok(guess) };
        let change = |i: usize| {
            let changes = slopes.rows.iter().zip(moves).map(|(row, moves)| (moves / row[i]).abs());
            changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min)
        };
        let size =
            |i: usize| Some(change(i).max(guess.state[i].abs())).filter(|size| size.is_finite() && !guess.open[i]);
        Ok(Guess { sizes: (0..guess.state.len()).map(size).collect(), ..guess })
    }

    fn guess_state(&self, y: &[f64]) -> Result<Guess, String> {
        let zero = self.nearest(y, 0.0);
        let is_start = |guess: &Guess| !guess.open.contains(&true) || self.moves(&guess.state);
        if zero.as_ref().is_ok_and(is_start) {
            return zero;
        }
        // Where both are undefined, the simulation says what is wrong.
        self.nearest(y, 1.0).ok().filter(is_start).map_or(zero, Ok)
    }

    /// The state nearest to one of equal entries whose outputs are the measured ones, by Newton's method.
    fn nearest(&self, y: &[f64], from: f64) -> Result<Guess, String> {
        let n = self.layout.states.len();
        let mut x = vec![from; n];
        if n == 0 {
            return Ok(Guess { state: x, open: vec![], sizes: vec![] });
        }
        let mut at = self.slopes(&x, y)?;
        let influence = |at: &Slopes, j: usize| {
            norm(at.rows.iter().zip(&at.errors).filter(|(_, error)| error.is_finite()).map(|(row, _)| row[j]))
        };
        let first: Vec<f64> = (0..n).map(|j| influence(&at, j)).collect();
        for iteration in 0..ITERATIONS {
            let mut information = Information::new(n);
            for (row, &error) in at.rows.iter().zip(&at.errors).filter(|(_, error)| error.is_finite()) {
                information.absorb_row(row, error);
            }
            let (mut step, open) = match information.solve() {
                Ok(step) => (step, vec![false; n]),
                Err(_) => (shortest_step(&information), at.open()),
            };
            let mut next = self.moved(&x, &step, y);
            for _ in 0..HALVINGS {
                if next.is_ok() {
                    break;
                }
                step.iter_mut().for_each(|step| *step *= 0.5);
                next = self.moved(&x, &step, y);
            }
            (x, at) = next?;
            let size = |v: &[f64]| norm(v.iter().copied());
            if iteration > 0 && size(&step) <= 1e-12 * size(&x).max(f64::MIN_POSITIVE) {
                // Towards a measurement that no state gives (noise beyond where an output saturates), steps lead to where the
                // state moves nothing any more.
                let lost = |j: usize| open[j] && influence(&at, j) < LOST * first[j];
                let state = (0..n).map(|j| if lost(j) { from } else { x[j] }).collect();
                return Ok(Guess { state, open, sizes: vec![None; n] });
            }
        }
        // The steps may have led anywhere.
        Ok(Guess { state: vec![from; n], open: vec![true; n], sizes: vec![None; n] })
    }

    fn moved(&self, x: &[f64], step: &[f64], y: &[f64]) -> Result<(Vec<f64>, Slopes), String> {
        let next: Vec<f64> = x.iter().zip(step).map(|(x, step)| x + step).collect();
        let slopes = self.slopes(&next, y)?;
        Ok((next, slopes))
    }

    /// The states from `first` on as variables.
    fn seeded(x: &[f64], first: usize) -> Vec<Duals> {
        x.iter().enumerate().map(|(i, x)| Dual::variable(*x, i.wrapping_sub(first))).collect()
    }

    /// Errors and slopes at a state; an error text if those of a measured output are not finite.
    fn slopes(&self, x: &[f64], y: &[f64]) -> Result<Slopes, String> {
        let (n, u, p) = (x.len(), constants(self.u), constants(self.p));
        let (mut errors, mut rows) = (vec![0.0; y.len()], vec![vec![0.0; n]; y.len()]);
        let mut expected = vec![Dual::constant(0.0); y.len()];
        for first in (0..n).step_by(LANES) {
            self.functions.output(Dual::constant(self.t), &Self::seeded(x, first), &u, &p, &mut expected);
            for (j, output) in expected.iter().enumerate() {
                errors[j] = y[j] - output.value;
                let lanes = &output.slopes[..LANES.min(n - first)];
                rows[j][first..first + lanes.len()].copy_from_slice(lanes);
                let what = match (output.value.is_finite(), lanes.iter().find(|slope| !slope.is_finite())) {
                    _ if y[j].is_nan() => continue,
                    (false, _) => format!("`{}` is {}", self.layout.outputs[j].name, output.value),
                    (true, Some(slope)) => format!("`{}` has the slope {slope}", self.layout.outputs[j].name),
                    (true, None) => continue,
                };
                return Err(format!("the model's output {what} where {}", self.at(x)));
            }
        }
        Ok(Slopes { errors, rows })
    }

    /// Whether derivative or next state are finite at a state, with their slopes.
    fn moves(&self, x: &[f64]) -> bool {
        let (u, p) = (constants(self.u), constants(self.p));
        let mut to = vec![Dual::constant(0.0); x.len()];
        self.layout.kind == Kind::Static
            || (0..x.len()).step_by(LANES).all(|first| {
                self.functions.state(Dual::constant(self.t), &Self::seeded(x, first), &u, &p, &mut to);
                to.iter().all(|to| to.value.is_finite() && to.slopes.iter().all(|slope| slope.is_finite()))
            })
    }

    /// The slopes of the derivative (of the next state of a discrete model) with respect to the states, row by row.
    pub fn state_slopes(&self, x: &[f64]) -> Vec<f64> {
        let (t, u, p) = (Dual::constant(self.t), constants(self.u), constants(self.p));
        value_and_slopes(x, &|x, to| self.functions.state(t, x, &u, &p, to)).1
    }

    /// The slopes of the state after a sample; `None` of a model whose samples leave it as it is.
    pub fn jump_slopes(&self, x: &[f64]) -> Option<Vec<f64>> {
        let (t, u, p) = (Dual::constant(self.t), constants(self.u), constants(self.p));
        let of = || value_and_slopes(x, &|x, to| self.functions.jump(t, x, &u, &p, to)).1;
        self.functions.jumps().then(of).filter(|found| *found != identity::<f64>(x.len()))
    }

    /// The state in words: `x = 0, v = 0`.
    fn at(&self, x: &[f64]) -> String {
        let states = self.layout.states.iter().zip(x).map(|(state, x)| format!("{} = {}", state.name, exact(*x)));
        states.collect::<Vec<String>>().join(", ")
    }

    /// The name of a parameter that the outputs depend on directly, if there is one: then they do not give the state alone.
    pub fn depends_on_parameter(&self, x: &[f64]) -> Option<String> {
        let (x, u) = (constants(x), constants(self.u));
        let mut y = vec![Dual::constant(0.0); self.layout.outputs.len()];
        for first in (0..self.p.len()).step_by(LANES) {
            self.functions.output(Dual::constant(self.t), &x, &u, &Self::seeded(self.p, first), &mut y);
            let depends = |lane: &usize| y.iter().any(|y| y.slopes[*lane] != 0.0);
            if let Some(lane) = (0..LANES.min(self.p.len() - first)).find(depends) {
                return Some(self.layout.parameters[first + lane].name.clone());
            }
        }
        None
    }
}

/// The step to the minimum where some entries are not determined: those take the shortest step.
fn shortest_step(information: &Information) -> Vec<f64> {
    let n = information.columns();
    let largest = information.column_norms().into_iter().fold(0.0, f64::max);
    let damping = if largest > 0.0 { DAMPING * largest } else { 1.0 };
    information.damped(&vec![damping; n]).solve().unwrap_or(vec![0.0; n])
}

fn names(quantities: &[Quantity]) -> String {
    quantities.iter().map(|quantity| quantity.name.as_str()).collect::<Vec<&str>>().join(", ")
}

fn constants(values: &[f64]) -> Vec<Duals> {
    values.iter().map(|value| Dual::constant(*value)).collect()
}
