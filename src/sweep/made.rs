//! Sweeps made of equations: compiled where they can be, else in dual numbers.

use super::duals::Uncompiled;
use super::{DualSweep, Evaluated, ProgramSweep, Sweep};
use crate::engine::only_duals;
use crate::equations::Equations;
use crate::error::Error;
use crate::graph::Untraceable;
use crate::integrate::Method;
use crate::predict::Prediction;
use std::sync::Arc;

/// A compiled program of the equations that `trace` reads, if there can be one, else what `plain` makes of the reason.
pub(crate) fn compiled<'a>(
    trace: &dyn Fn() -> Result<Arc<Equations>, Untraceable>,
    method: &Arc<dyn Method>,
    predictor: &Arc<dyn Prediction>,
    plain: &dyn Fn(Uncompiled) -> Arc<dyn Sweep + 'a>,
) -> Arc<dyn Sweep + 'a> {
    let asked = only_duals().then(|| "dual numbers are asked for".to_owned());
    if let Some(reason) = &asked
        && !predictor.needs_slopes()
    {
        return plain(Uncompiled::unread(reason.clone()));
    }
    let equations = match trace() {
        Ok(equations) => equations,
        Err(Untraceable { reason, .. }) => return plain(Uncompiled::unread(reason)),
    };
    let in_duals = |reason: String| {
        let uncompiled = Uncompiled::of(&equations, reason);
        // The model's own code in duals has no slopes whose slopes are known, and does not say which inputs are never late.
        match predictor.needs_slopes() && !equations.is_affine() || equations.late().contains(&true) {
            true => evaluated(&equations, method, predictor, uncompiled),
            false => plain(uncompiled),
        }
    };
    if let Some(reason) = asked {
        return in_duals(reason);
    }
    match ProgramSweep::new(equations.clone(), method.clone(), predictor.clone(), in_duals(String::new())) {
        Ok(sweep) => Arc::new(sweep),
        Err(Untraceable { reason, .. }) => in_duals(reason),
    }
}

/// Equations in dual numbers, node by node.
fn evaluated(
    equations: &Arc<Equations>,
    method: &Arc<dyn Method>,
    predictor: &Arc<dyn Prediction>,
    uncompiled: Uncompiled,
) -> Arc<dyn Sweep> {
    let (method, predictor) = (method.clone(), predictor.clone());
    let (layout, code) = (Arc::new(equations.layout().clone()), Arc::new(Evaluated::new(equations.clone())));
    Arc::new(DualSweep { layout, code, method, predictor, uncompiled })
}

/// The sweep of equations in dual numbers, beside their programs.
pub(super) fn of_equations_in_duals(
    equations: &Arc<Equations>,
    method: &Arc<dyn Method>,
    predictor: &Arc<dyn Prediction>,
) -> Arc<dyn Sweep> {
    evaluated(equations, method, predictor, Uncompiled::of(equations, String::new()))
}

/// The sweep of equations.
///
/// # Errors
/// A method or a predictor that does not serve them.
pub(crate) fn of_equations(
    equations: &Arc<Equations>,
    method: &Arc<dyn Method>,
    predictor: &Arc<dyn Prediction>,
) -> Result<Arc<dyn Sweep>, Error> {
    method.check(equations.layout().kind)?;
    predictor.check(equations.layout())?;
    let plain = |uncompiled| evaluated(equations, method, predictor, uncompiled);
    Ok(compiled(&|| Ok(equations.clone()), method, predictor, &plain))
}
