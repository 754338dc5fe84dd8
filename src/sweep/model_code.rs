//! [`ModelCode`]: a model as it runs in dual numbers, compiled with its types or evaluated from a graph.

use super::filtered::Filter;
use super::{Loops, Piece, Reached, RunError, Seed, Visit};
use crate::dual::Dual;
use crate::equations::{AllMoments, Equations, Slopes};
use crate::functions::{Functions, Handle, Sloped};
use crate::hash::hexadecimal;
use crate::integrate::Duals;
use crate::layout::{Kind, Layout};
use crate::model::Model;
use crate::moments::Moments;
use crate::scalar::Scalar;
use crate::signals::Signals;
use sha2::{Digest, Sha256};
use std::sync::{Arc, OnceLock};

/// Slopes of a [`Duals`].
const COLUMNS: usize = 8;

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

    /// This code for a finer step, if there is one.
    fn refined<'s>(&'s self, kind: Kind) -> Option<Arc<dyn ModelCode + 's>>;

    /// Whether derivatives (next states) and outputs are affine in the state, as far as slopes with respect to it are asked for.
    fn is_affine(&self) -> bool;

    /// Which inputs have a dead time at these parameters.
    fn late(&self, p: &[f64]) -> Vec<bool>;

    /// Which states the model says at the first sample.
    fn begins(&self, p: &[f64]) -> Vec<bool>;

    /// The equations, where they are evaluated from a graph.
    fn equations(&self) -> Option<&Equations> {
        None
    }

    /// Text that identifies the equations.
    fn identity(&self) -> String;
}

/// A Rust model, with the loop that was compiled for it and its integrator, if there is one.
pub(crate) struct Typed<'a, M: Model> {
    pub model: Handle<'a, M>,
    pub loops: Option<Arc<dyn Loops<M> + 'a>>,
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
        filter: &Filter<'_>,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        match &self.loops {
            Some(loops) => loops.run(&self.model, piece, seeds, restart, visit),
            None => filter.run(piece, seeds, restart, visit),
        }
    }

    fn refined<'s>(&'s self, kind: Kind) -> Option<Arc<dyn ModelCode + 's>> {
        let loops = match &self.loops {
            Some(loops) => Some(loops.refined(kind)?),
            None => None,
        };
        Some(Arc::new(Typed { model: self.model.clone(), loops }))
    }

    /// Others are evaluated from their graph, or refused.
    fn is_affine(&self) -> bool {
        true
    }

    /// Those whose dead time is not zero, or moves with a parameter.
    fn late(&self, p: &[f64]) -> Vec<bool> {
        let mut late = vec![false; M::Input::LEN];
        for first in (0..p.len().max(1)).step_by(COLUMNS) {
            let p: Vec<Duals> = p.iter().enumerate().map(|(j, p)| Dual::variable(*p, j.wrapping_sub(first))).collect();
            let mut delay = vec![Duals::constant(0.0); late.len()];
            self.model.delay(&p, &mut delay);
            let zero = |delay: &Duals| delay.value == 0.0 && delay.slopes == [0.0; COLUMNS];
            late.iter_mut().zip(&delay).for_each(|(late, delay)| *late |= !zero(delay));
        }
        late
    }

    /// Those that are a number, or one that is undefined at these parameters: its slopes are not zero then.
    fn begins(&self, p: &[f64]) -> Vec<bool> {
        let p: Vec<Duals> = p.iter().enumerate().map(|(j, p)| Dual::variable(*p, j % COLUMNS)).collect();
        let u = vec![Duals::constant(0.0); M::Input::LEN];
        let mut state = vec![Duals::constant(f64::NAN); M::State::LEN];
        self.model.initial(&u, &p, &mut state);
        state.iter().map(|x| !(x.value.is_nan() && x.slopes == [0.0; COLUMNS])).collect()
    }

    fn identity(&self) -> String {
        std::any::type_name::<M>().to_owned()
    }
}

/// Equations, evaluated node by node.
pub(crate) struct Evaluated {
    equations: Arc<Equations>,
    late: Vec<bool>,
    /// Made when a predictor asks for them.
    slopes: OnceLock<Slopes>,
    moments: OnceLock<AllMoments>,
}

impl Evaluated {
    pub fn new(equations: Arc<Equations>) -> Self {
        let late = equations.late();
        Evaluated { equations, late, slopes: OnceLock::new(), moments: OnceLock::new() }
    }

    fn slopes(&self) -> &Slopes {
        self.slopes.get_or_init(|| Slopes::of(&self.equations))
    }

    fn moments(&self) -> &AllMoments {
        self.moments.get_or_init(|| self.equations.moments())
    }
}

impl<S: Scalar> Functions<S> for Evaluated {
    fn state(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        Functions::state(&*self.equations, t, x, u, p, to);
    }

    fn output(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        Functions::output(&*self.equations, t, x, u, p, to);
    }

    fn diffusion(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.equations.diffusion(t, x, u, p, to);
    }

    fn noise(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.equations.noise(t, x, u, p, to);
    }

    fn initial_noise(&self, p: &[S], to: &mut [S]) {
        self.equations.initial_noise(p, to);
    }

    fn initial(&self, u: &[S], p: &[S], to: &mut [S]) {
        Functions::initial(&*self.equations, u, p, to);
    }

    fn delay(&self, p: &[S], to: &mut [S]) {
        Functions::delay(&*self.equations, p, to);
    }

    fn jumps(&self) -> bool {
        Functions::<S>::jumps(&*self.equations)
    }

    fn jump(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.equations.jump(t, x, u, p, to);
    }

    fn known(&self) -> Option<&dyn Sloped<S>> {
        Some(self)
    }
}

impl<S: Scalar> Sloped<S> for Evaluated {
    fn state_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.slopes().state.at(t, x, u, p, to);
    }

    fn output_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.slopes().output.at(t, x, u, p, to);
    }

    fn jump_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.slopes().jump.at(t, x, u, p, to);
    }

    fn state_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], _layout: &Layout) -> Moments<S> {
        self.moments().state.at(t, carry, u, p)
    }

    fn output_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], _layout: &Layout) -> Moments<S> {
        self.moments().output.at(t, carry, u, p)
    }

    fn jump_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], _layout: &Layout) -> Moments<S> {
        self.moments().jump.at(t, carry, u, p)
    }
}

impl ModelCode for Evaluated {
    fn values(&self) -> &dyn Functions<f64> {
        self
    }

    fn duals(&self) -> &dyn Functions<Duals> {
        self
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
        Some(Arc::new(Evaluated::new(self.equations.clone())))
    }

    fn is_affine(&self) -> bool {
        self.equations.is_affine()
    }

    fn late(&self, _p: &[f64]) -> Vec<bool> {
        self.late.clone()
    }

    fn begins(&self, _p: &[f64]) -> Vec<bool> {
        self.equations.begins()
    }

    fn equations(&self) -> Option<&Equations> {
        Some(&self.equations)
    }

    /// The hash of the equations as they are written to a file, which is too long to be shown.
    fn identity(&self) -> String {
        let text = serde_json::to_string(&*self.equations).unwrap_or_else(|_| self.equations.to_string());
        format!("equations with SHA-256 {}", hexadecimal(Sha256::new_with_prefix(text)))
    }
}
