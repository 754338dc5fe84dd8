//! Sweeps made of equations: compiled where they can be, else in dual numbers.

use super::duals::Uncompiled;
use super::{DualSweep, ProgramSweep, Sweep};
use crate::engine::only_duals;
use crate::equations::Equations;
use crate::error::Error;
use crate::graph::{Untraceable, choosing};
use crate::integrate::Method;
use crate::predict::Prediction;
use std::sync::Arc;

/// A compiled program of the equations that `trace` reads, if there can be one, else what `plain` makes of the reason.
///
/// # Errors
/// Equations that are not affine in the state, for a predictor that needs that.
pub(crate) fn compiled<'a>(
    trace: &dyn Fn() -> Result<Arc<Equations>, Untraceable>,
    method: &Arc<dyn Method>,
    predictor: &Arc<dyn Prediction>,
    plain: &dyn Fn(Uncompiled) -> Arc<dyn Sweep + 'a>,
) -> Result<Arc<dyn Sweep + 'a>, Error> {
    if only_duals() {
        return Ok(plain(Uncompiled { reason: "dual numbers are asked for".to_owned(), choosing: None }));
    }
    let equations = match trace() {
        Ok(equations) => equations,
        Err(Untraceable { reason, .. }) => return Ok(plain(Uncompiled { reason, choosing: None })),
    };
    if predictor.needs_affine()
        && let Some(number) = equations.not_affine()
    {
        return Err(Error::NotAffine { what: equations.layout().equation(number), predictor: predictor.describe() });
    }
    let choosing = Some(choosing(equations.graph()));
    let beside = plain(Uncompiled { reason: String::new(), choosing: choosing.clone() });
    Ok(match ProgramSweep::new(equations, method.clone(), predictor.clone(), beside) {
        Ok(sweep) => Arc::new(sweep),
        Err(Untraceable { reason, .. }) => plain(Uncompiled { reason, choosing }),
    })
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
    let plain = |uncompiled| -> Arc<dyn Sweep> {
        let (layout, method, predictor) = (layout.clone(), method.clone(), predictor.clone());
        Arc::new(DualSweep { layout, code: Arc::new(equations.clone()), method, predictor, uncompiled })
    };
    compiled(&|| Ok(equations.clone()), method, predictor, &plain)
}
