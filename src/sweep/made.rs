//! Sweeps made of equations: compiled where they can be, else in dual numbers.

use super::{DualSweep, ProgramSweep, Sweep};
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
    plain: &dyn Fn(String) -> Arc<dyn Sweep + 'a>,
) -> Arc<dyn Sweep + 'a> {
    if only_duals() {
        return plain("dual numbers are asked for".to_owned());
    }
    let program = trace()
        .and_then(|equations| ProgramSweep::new(equations, method.clone(), predictor.clone(), plain(String::new())));
    match program {
        Ok(sweep) => Arc::new(sweep),
        Err(untraceable) => plain(untraceable.reason),
    }
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
    let layout = Arc::new(equations.layout().clone());
    method.check(layout.kind)?;
    predictor.check(&layout)?;
    let plain = |reason: String| -> Arc<dyn Sweep> {
        let (layout, method, predictor) = (layout.clone(), method.clone(), predictor.clone());
        Arc::new(DualSweep { layout, code: Arc::new(equations.clone()), method, predictor, reason })
    };
    Ok(compiled(&|| Ok(equations.clone()), method, predictor, &plain))
}
