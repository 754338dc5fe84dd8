//! [`Exact`]: the transition of linear equations with constant coefficients.

use super::Stuck;
use super::method::{Duals, Field, Method, SymbolicField, automatic};
use crate::error::Error;
use crate::graph::Symbol;
use crate::layout::Kind;
use std::sync::Arc;

/// Steps per sample for what is no linear equation: a filter with terms that the equations might lack.
pub(super) const STEPS: u32 = 4;

/// The state of linear equations with constant coefficients at the next sample follows by their transition, exactly, however long the interval
/// ([`Crossing`](crate::transition::Crossing)). For linear equations only; terms that a filter adds to them, to test
/// whether equations lack them, are integrated by steps.
#[derive(Debug)]
pub(super) struct Exact;

impl Method for Exact {
    fn advance_values(&self, field: &Field<'_, f64>, x: &mut [f64], step: &mut f64) -> Result<(), Stuck> {
        automatic(STEPS).advance_values(field, x, step)
    }

    fn advance_duals(&self, field: &Field<'_, Duals>, x: &mut [Duals], step: &mut f64) -> Result<(), Stuck> {
        automatic(STEPS).advance_duals(field, x, step)
    }

    fn advance_symbols(&self, field: &SymbolicField<'_>, x: Vec<Symbol>) -> Result<Vec<Symbol>, Stuck> {
        automatic(STEPS).advance_symbols(field, x)
    }

    fn is_fixed(&self) -> bool {
        true
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn refined(&self, _kind: Kind) -> Option<Arc<dyn Method>> {
        None
    }

    fn check(&self, kind: Kind) -> Result<(), Error> {
        automatic(STEPS).check(kind)
    }

    fn describe(&self, _kind: Kind) -> String {
        "exact transition of linear equations".to_owned()
    }
}
