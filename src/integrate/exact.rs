//! [`Exact`]: the transition of linear equations with constant coefficients.

use super::Stuck;
use super::method::{Duals, Field, Method, SymbolicField, automatic};
use crate::error::Error;
use crate::graph::Symbol;
use crate::layout::Kind;
use std::sync::Arc;

/// Steps per sample for what is no linear equation: a filter with terms that the equations might lack.
const OTHERWISE: u32 = 4;

/// Linear equations with constant coefficients are taken from sample to sample by their transition, which is exact whatever the interval
/// ([`Crossing`](crate::transition::Crossing)). What else is integrated beside them is so by steps.
#[derive(Debug)]
pub(super) struct Exact;

impl Method for Exact {
    fn advance_values(&self, field: &Field<'_, f64>, x: Vec<f64>, step: &mut f64) -> Result<Vec<f64>, Stuck> {
        automatic(OTHERWISE).advance_values(field, x, step)
    }

    fn advance_duals(&self, field: &Field<'_, Duals>, x: Vec<Duals>, step: &mut f64) -> Result<Vec<Duals>, Stuck> {
        automatic(OTHERWISE).advance_duals(field, x, step)
    }

    fn advance_symbols(&self, field: &SymbolicField<'_>, x: Vec<Symbol>) -> Result<Vec<Symbol>, Stuck> {
        automatic(OTHERWISE).advance_symbols(field, x)
    }

    fn is_fixed(&self) -> bool {
        true
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn otherwise(&self) -> Option<Arc<dyn Method>> {
        Some(automatic(OTHERWISE))
    }

    fn refined(&self, _kind: Kind) -> Option<Arc<dyn Method>> {
        None
    }

    fn check(&self, kind: Kind) -> Result<(), Error> {
        automatic(OTHERWISE).check(kind)
    }

    fn describe(&self, _kind: Kind) -> String {
        "exact transition of linear equations".to_owned()
    }
}
