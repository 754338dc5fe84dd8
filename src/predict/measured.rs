//! The state that the outputs of one sample give, where they give it.

use crate::dual::Dual;
use crate::information::Information;
use crate::model::Model;
use crate::numeral::exact;
use crate::signals::{Of, Signals};

const LANES: usize = 8;
const ITERATIONS: usize = 50;

/// The state whose outputs are the measured ones, by Newton's method from zero; why not, where there is none.
pub(crate) fn state<M: Model>(
    model: &M,
    t: f64,
    u: &Of<M::Input, f64>,
    y: &Of<M::Output, f64>,
    p: &Of<M::Parameters, f64>,
) -> Result<Of<M::State, f64>, String> {
    let n = M::State::LEN;
    let mut x = M::State::splat(0.0);
    if n == 0 {
        return Ok(x);
    }
    let y = M::Output::into_array(*y);
    let found = y.as_ref().iter().filter(|y| y.is_finite()).count();
    if found < n {
        let (states, outputs) = (M::State::NAMES.join(", "), M::Output::NAMES.join(", "));
        return Err(format!(
            "{n} state(s), {states}, but {found} measured of the output(s) {outputs} at t = {} s",
            exact(t)
        ));
    }
    let entries = |x: Of<M::State, f64>| M::State::into_array(x);
    for iteration in 0..ITERATIONS {
        let mut rows = vec![vec![0.0; n]; M::Output::LEN];
        let mut errors = vec![0.0; M::Output::LEN];
        for first in (0..n).step_by(LANES) {
            let seeded = M::State::from_fn(|i| Dual::<LANES>::variable(entries(x).as_ref()[i], i.wrapping_sub(first)));
            let expected =
                model.output(t.into(), &seeded, &M::Input::map(*u, Dual::from), &M::Parameters::map(*p, Dual::from));
            for (j, output) in M::Output::into_array(expected).into_iter().enumerate() {
                errors[j] = y.as_ref()[j] - output.value;
                for lane in 0..LANES.min(n - first) {
                    rows[j][first + lane] = output.slopes[lane];
                }
            }
        }
        let undefined = (0..M::Output::LEN).find(|&j| y.as_ref()[j].is_finite() && errors[j].is_nan());
        if let Some(j) = undefined {
            return Err(format!(
                "the model's output `{}` is not a number on the way to it, at t = {} s",
                M::Output::NAMES[j],
                exact(t)
            ));
        }
        let mut information = Information::new(n);
        for (row, &error) in rows.iter().zip(&errors).filter(|(_, error)| error.is_finite()) {
            information.absorb_row(row, error);
        }
        let step = information.solve().map_err(|deficient| {
            format!("the outputs do not depend on `{}`", M::State::NAMES.get(deficient.column).unwrap_or(&"a state"))
        })?;
        x = M::State::from_fn(|i| entries(x).as_ref()[i] + step[i]);
        let size = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        if iteration > 0 && size(&step) <= 1e-12 * size(entries(x).as_ref()).max(f64::MIN_POSITIVE) {
            return Ok(x);
        }
    }
    Err("the outputs cannot be solved for the state".to_owned())
}

/// The name of a parameter that the outputs depend on directly, if there is one: then they do not give the state alone.
pub(crate) fn depends_on_parameter<M: Model>(
    model: &M,
    t: f64,
    x: &Of<M::State, f64>,
    u: &Of<M::Input, f64>,
    p: &Of<M::Parameters, f64>,
) -> Option<&'static str> {
    let p = M::Parameters::into_array(*p);
    (0..M::Parameters::LEN).find_map(|i| {
        let seeded = M::Parameters::from_fn(|j| Dual::<1>::variable(p.as_ref()[j], usize::from(i != j)));
        let y = model.output(t.into(), &M::State::map(*x, Dual::from), &M::Input::map(*u, Dual::from), &seeded);
        let depends = M::Output::into_array(y).into_iter().any(|y| y.slopes[0] != 0.0);
        depends.then_some(M::Parameters::NAMES[i])
    })
}
