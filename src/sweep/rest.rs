//! [`Rest`]: the state at which a plant rests under its first inputs.

use super::filtered::Filter;
use crate::dual::Dual;
use crate::functions::delays;
use crate::integrate::Duals;
use crate::layout::Kind;
use crate::predict::{Between, value_and_slopes};
use crate::record::Record;
use nalgebra::{DMatrix, DVector};

/// Newton steps, and halvings of one, before the search is given up.
const STEPS: usize = 100;
const HALVINGS: usize = 30;
/// A step by this part of the state is the last but one: the next is by the square of it.
const LAST: f64 = 1e-9;
/// A jump below this part of the largest state or step is the rounding of the last Newton step.
const JUMP: f64 = 1e-6;
/// A singular value below this part of the largest, of slopes whose rows and columns are scaled, is rounding.
const SINGULAR: f64 = 1e-13;

/// A plant that does not rest at the inputs of the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotAtRest {
    /// Number of a state.
    pub state: usize,
    /// How it still changes where the search for a state of rest ended.
    pub change: Change,
}

/// How a state changes that does not rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// By so much per second, of a discrete model per sample.
    Rate(f64),
    /// By so much at a sample, which changes the state of a continuous model.
    AtSample(f64),
    /// The plant rests at any value of it.
    Free,
}

/// A state of rest, and the inverse of the slopes there.
pub(super) struct Rest {
    state: Vec<f64>,
    inverse: DMatrix<f64>,
}

/// The rate of each state, and what a sample changes of it, in any numbers: zero at rest.
fn rate(filter: &Filter<'_>, between: &Between<Duals>, x: &[Duals], p: &[Duals], to: &mut [Duals]) {
    filter.duals.state(between.time(0.0), x, &between.input(0.0), p, to);
    if filter.layout.kind == Kind::Discrete {
        to.iter_mut().zip(x).for_each(|(to, x)| *to -= *x);
    }
    if filter.duals.jumps() {
        jumped(filter, between, x, p).iter().zip(to).for_each(|(jumped, to)| *to += *jumped);
    }
}

/// What a sample changes of each state.
fn jumped(filter: &Filter<'_>, between: &Between<Duals>, x: &[Duals], p: &[Duals]) -> Vec<Duals> {
    let mut after = x.to_vec();
    filter.duals.jump(between.time(0.0), x, &between.input(0.0), p, &mut after);
    after.iter().zip(x).map(|(after, x)| *after - *x).collect()
}

impl Rest {
    /// The state of rest that Newton's method finds from another, with steps that are shortened until the next would be shorter (P. Deuflhard, *Newton
    /// Methods for Nonlinear Problems*, 2004, section 3.3).
    pub fn near(filter: &Filter<'_>, record: &Record, state: &[f64], parameters: &[f64]) -> Result<Self, NotAtRest> {
        let p: Vec<Duals> = parameters.iter().map(|p| Dual::constant(*p)).collect();
        let between = Between::new(record, 0, &delays(filter.duals, &filter.late, &p));
        let slopes = |x: &[f64]| value_and_slopes(x, &|x, to| rate(filter, &between, x, &p, to));
        let moving = |f: &[f64], change: fn(f64) -> Change| {
            let largest = f.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            largest.map_or(NotAtRest { state: 0, change: Change::Rate(f64::NAN) }, |(state, f)| NotAtRest {
                state,
                change: change(*f),
            })
        };
        let mut x = state.to_vec();
        let (mut f, rows) = slopes(&x);
        let Some(mut here) = inverse(&rows, &f)? else { return Err(moving(&f, Change::Rate)) };
        // The largest state or step so far: where the state of rest is zero, a step of rounding is short against it.
        let mut longest = 0.0f64;
        for _ in 0..STEPS {
            let Inverse { inverse: solve, units } = &here;
            let step = -(solve * DVector::from_column_slice(&f));
            let length = |of: &[f64]| of.iter().zip(units).map(|(x, unit)| (x / unit).abs()).fold(0.0, f64::max);
            let shortest = LAST * longest.max(length(&x));
            longest = longest.max(length(&x)).max(length(step.as_slice()));
            if length(step.as_slice()) <= shortest {
                // A derivative that the jump cancels, such as under a dose at the first sample, is no state of rest.
                let at_rest: Vec<Duals> = x.iter().map(|x| Dual::constant(*x)).collect();
                let jumps: Vec<f64> = jumped(filter, &between, &at_rest, &p).iter().map(|jump| jump.value).collect();
                return match length(&jumps) <= JUMP * longest {
                    true => Ok(Rest { state: x, inverse: here.inverse }),
                    false => Err(moving(&jumps, Change::AtSample)),
                };
            }
            let shortened = (0..HALVINGS).find_map(|halvings| {
                let part = 0.5f64.powi(halvings as i32);
                let there: Vec<f64> = x.iter().zip(&step).map(|(x, step)| x + part * step).collect();
                let (f, rows) = slopes(&there);
                let next = solve * DVector::from_column_slice(&f);
                let shorter = length(next.as_slice()) <= (1.0 - 0.25 * part) * length(step.as_slice());
                // Beyond a guard, such as the square root of `max(h, 0)`, no rate depends on the state.
                let inverse = inverse(&rows, &f).ok().flatten().filter(|_| shorter)?;
                Some((there, f, inverse))
            });
            let Some((there, next, inverse)) = shortened else { return Err(moving(&f, Change::Rate)) };
            (x, f, here) = (there, next, inverse);
        }
        Err(moving(&f, Change::Rate))
    }

    /// The state of rest in numbers with slopes: one more Newton step. The slopes of the inverse are left out, since they multiply a rate of zero
    /// (implicit function theorem).
    pub fn state(&self, filter: &Filter<'_>, record: &Record, delays: &[Option<Duals>], p: &[Duals]) -> Vec<Duals> {
        let between = Between::new(record, 0, delays);
        let x: Vec<Duals> = self.state.iter().map(|x| Dual::constant(*x)).collect();
        let mut f = x.clone();
        rate(filter, &between, &x, p, &mut f);
        let entry = |(i, x): (usize, &Duals)| {
            let step = f.iter().enumerate().map(|(j, f)| *f * self.inverse[(i, j)]).sum::<Duals>();
            *x - step
        };
        x.iter().enumerate().map(entry).collect()
    }
}

/// The inverse of the slopes of the rates, and for each state a change that moves the rates by about one of their units.
struct Inverse {
    inverse: DMatrix<f64>,
    units: Vec<f64>,
}

/// The inverse of slopes; `None` where they are not finite.
///
/// # Errors
/// The state on which no rate depends, alone or with others.
fn inverse(rows: &[f64], f: &[f64]) -> Result<Option<Inverse>, NotAtRest> {
    let n = f.len();
    let a = DMatrix::from_row_slice(n, n, rows);
    if a.iter().chain(f).any(|entry| !entry.is_finite()) {
        return Ok(None);
    }
    let scale = |largest: f64| if largest > 0.0 { largest.recip() } else { 1.0 };
    let of_rows: Vec<f64> = a.row_iter().map(|row| scale(row.amax())).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| a[(i, j)] * of_rows[i]);
    let of_columns: Vec<f64> = scaled.column_iter().map(|column| scale(column.amax())).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| scaled[(i, j)] * of_columns[j]);
    let svd = scaled.svd(true, true);
    let (least, largest) = (svd.singular_values.argmin(), svd.singular_values.max());
    let free = |v: &DMatrix<f64>| NotAtRest { state: v.row(least.0).transpose().iamax(), change: Change::Free };
    match svd.v_t.as_ref() {
        Some(v) if least.1 <= SINGULAR * largest => Err(free(v)),
        _ => {
            let Ok(inverse) = svd.pseudo_inverse(0.0) else { return Ok(None) };
            let inverse = DMatrix::from_fn(n, n, |i, j| of_columns[i] * inverse[(i, j)] * of_rows[j]);
            Ok(Some(Inverse { inverse, units: of_columns }))
        }
    }
}
