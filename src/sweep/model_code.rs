//! [`ModelCode`]: a model as it runs in dual numbers, compiled with its types or evaluated from a graph.

use super::filtered::Filter;
use super::{Loops, Piece, Reached, RunError, Seed, Visit};
use crate::equations::Equations;
use crate::functions::{Functions, Handle};
use crate::integrate::Duals;
use crate::layout::Kind;
use crate::model::Model;
use std::sync::Arc;

/// A model's equations on vectors, and its loop over the samples.
pub(crate) trait ModelCode: Send + Sync {
    fn values(&self) -> &dyn Functions<f64>;
    fn duals(&self) -> &dyn Functions<Duals>;

    /// Simulates a piece. With `restart`, samples are predicted from the measured states that many samples before.
    fn run(
        &self,
        filter: &Filter<'_>,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError>;

    /// The same for a finer step, if there is one.
    fn refined<'s>(&'s self, kind: Kind) -> Option<Arc<dyn ModelCode + 's>>;

    /// Text that identifies the equations.
    fn identity(&self) -> String;
}

/// A Rust model, with the loop that was compiled for it.
pub(crate) struct Typed<'a, M: Model> {
    pub model: Handle<'a, M>,
    pub loops: Arc<dyn Loops<M> + 'a>,
}

impl<M: Model> ModelCode for Typed<'_, M> {
    fn values(&self) -> &dyn Functions<f64> {
        &self.model
    }

    fn duals(&self) -> &dyn Functions<Duals> {
        &self.model
    }

    fn run(
        &self,
        _filter: &Filter<'_>,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        self.loops.run(&self.model, piece, seeds, restart, visit)
    }

    fn refined<'s>(&'s self, kind: Kind) -> Option<Arc<dyn ModelCode + 's>> {
        Some(Arc::new(Typed { model: self.model.clone(), loops: self.loops.refined(kind)? }))
    }

    fn identity(&self) -> String {
        std::any::type_name::<M>().to_owned()
    }
}

/// Equations, evaluated node by node.
impl ModelCode for Arc<Equations> {
    fn values(&self) -> &dyn Functions<f64> {
        &**self
    }

    fn duals(&self) -> &dyn Functions<Duals> {
        &**self
    }

    fn run(
        &self,
        filter: &Filter<'_>,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        filter.run(piece, seeds, restart, visit)
    }

    fn refined<'s>(&'s self, _kind: Kind) -> Option<Arc<dyn ModelCode + 's>> {
        Some(Arc::new(self.clone()))
    }

    /// The equations as they are written to a file.
    fn identity(&self) -> String {
        serde_json::to_string(&**self).unwrap_or_else(|_| self.to_string())
    }
}
