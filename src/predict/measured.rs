//! The state that follows from the outputs of one sample, where they determine it.

use crate::dual::Dual;
use crate::functions::Functions;
use crate::information::Information;
use crate::integrate::Duals;
use crate::layout::{Layout, Quantity};
use crate::numeral::exact;

const LANES: usize = 8;
const ITERATIONS: usize = 50;

/// The state whose outputs are the measured ones, by Newton's method from zero; an error text where there is none.
pub(crate) fn state(
    layout: &Layout,
    functions: &dyn Functions<Duals>,
    t: f64,
    u: &[f64],
    y: &[f64],
    p: &[f64],
) -> Result<Vec<f64>, String> {
    let n = layout.states.len();
    let mut x = vec![0.0; n];
    if n == 0 {
        return Ok(x);
    }
    let names = |quantities: &[Quantity]| quantities.iter().map(|q| q.name.as_str()).collect::<Vec<&str>>().join(", ");
    let found = y.iter().filter(|y| y.is_finite()).count();
    if found < n {
        let (states, outputs) = (names(&layout.states), names(&layout.outputs));
        let t = exact(t);
        return Err(format!("{n} state(s), {states}, but {found} measured of the output(s) {outputs} at t = {t} s"));
    }
    let (u, p) = (constants(u), constants(p));
    for iteration in 0..ITERATIONS {
        let mut rows = vec![vec![0.0; n]; y.len()];
        let mut errors = vec![0.0; y.len()];
        let mut expected = vec![Dual::constant(0.0); y.len()];
        for first in (0..n).step_by(LANES) {
            let seeded: Vec<Duals> =
                x.iter().enumerate().map(|(i, x)| Dual::variable(*x, i.wrapping_sub(first))).collect();
            functions.output(Dual::constant(t), &seeded, &u, &p, &mut expected);
            for (j, output) in expected.iter().enumerate() {
                errors[j] = y[j] - output.value;
                for lane in 0..LANES.min(n - first) {
                    rows[j][first + lane] = output.slopes[lane];
                }
            }
        }
        if let Some(j) = (0..y.len()).find(|&j| y[j].is_finite() && errors[j].is_nan()) {
            let (output, t) = (&layout.outputs[j].name, exact(t));
            return Err(format!("the model's output `{output}` is not a number on the way to it, at t = {t} s"));
        }
        let mut information = Information::new(n);
        for (row, &error) in rows.iter().zip(&errors).filter(|(_, error)| error.is_finite()) {
            information.absorb_row(row, error);
        }
        let step = information.solve().map_err(|deficient| {
            let state = layout.states.get(deficient.column).map_or("a state", |state| &state.name);
            format!("the outputs do not depend on `{state}`")
        })?;
        x.iter_mut().zip(&step).for_each(|(x, step)| *x += step);
        let size = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        if iteration > 0 && size(&step) <= 1e-12 * size(&x).max(f64::MIN_POSITIVE) {
            return Ok(x);
        }
    }
    Err("the outputs cannot be solved for the state".to_owned())
}

/// The name of a parameter that the outputs depend on directly, if there is one: then they do not give the state alone.
pub(crate) fn depends_on_parameter(
    layout: &Layout,
    functions: &dyn Functions<Duals>,
    t: f64,
    x: &[f64],
    u: &[f64],
    p: &[f64],
) -> Option<String> {
    let (x, u) = (constants(x), constants(u));
    let mut y = vec![Dual::constant(0.0); layout.outputs.len()];
    for first in (0..p.len()).step_by(LANES) {
        let seeded: Vec<Duals> = p.iter().enumerate().map(|(i, p)| Dual::variable(*p, i.wrapping_sub(first))).collect();
        functions.output(Dual::constant(t), &x, &u, &seeded, &mut y);
        let depends = |lane: &usize| y.iter().any(|y| y.slopes[*lane] != 0.0);
        if let Some(lane) = (0..LANES.min(p.len() - first)).find(depends) {
            return Some(layout.parameters[first + lane].name.clone());
        }
    }
    None
}

fn constants(values: &[f64]) -> Vec<Duals> {
    values.iter().map(|value| Dual::constant(*value)).collect()
}
