//! [`Roots`]: the nodes of a graph that make up equations, by what they are.

use super::InvalidEquations;
use crate::graph::Id;
use crate::layout::{Kind, Layout};

/// The nodes of a graph that make up [`Equations`](super::Equations). Lists other than the first two may be left empty; dead times and the noise of the initial
/// state depend on parameters alone, the initial state on these and inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Roots {
    /// The derivative of each state (continuous) or its next value (discrete); empty for a static model.
    pub state: Vec<Id>,
    /// Each output.
    pub output: Vec<Id>,
    /// The process noise of each state, as [`Model::diffusion`](crate::Model::diffusion).
    pub diffusion: Vec<Id>,
    /// The measurement noise of each output, as [`Model::noise`](crate::Model::noise).
    pub noise: Vec<Id>,
    /// The standard deviation of each state at the first sample, as [`Model::initial_noise`](crate::Model::initial_noise).
    pub initial_noise: Vec<Id>,
    /// The state at the first sample, as [`Model::initial`](crate::Model::initial).
    pub initial: Vec<Id>,
    /// The dead time of each input (s), as [`Model::delay`](crate::Model::delay).
    pub delay: Vec<Id>,
    /// The state after a sample, as [`Model::jump`](crate::Model::jump); empty where samples change nothing.
    pub jump: Vec<Id>,
}

impl Roots {
    /// The derivatives (next states), the outputs and the states after a sample.
    pub(super) fn moving(&self) -> Vec<Id> {
        [&*self.state, &self.output, &self.jump].concat()
    }

    /// Those that depend on parameters alone.
    pub(super) fn constant(&self) -> Vec<Id> {
        [&*self.initial_noise, &self.delay].concat()
    }

    /// All, in the order of the fields.
    pub(crate) fn all(&self) -> Vec<Id> {
        let levels = [&*self.diffusion, &self.noise, &self.initial_noise, &self.initial, &self.delay].concat();
        [&*self.state, &self.output, &levels, &self.jump].concat()
    }

    /// Roots of these counts, from a list of all of them in the order of the fields.
    pub(super) fn with(&self, all: &[Id]) -> Roots {
        let mut all = all.iter().copied();
        let mut take = |like: &Vec<Id>| all.by_ref().take(like.len()).collect();
        Roots {
            state: take(&self.state),
            output: take(&self.output),
            diffusion: take(&self.diffusion),
            noise: take(&self.noise),
            initial_noise: take(&self.initial_noise),
            initial: take(&self.initial),
            delay: take(&self.delay),
            jump: take(&self.jump),
        }
    }

    /// Whether there is one for each quantity of a layout.
    pub(super) fn check(&self, layout: &Layout) -> Result<(), InvalidEquations> {
        let (states, outputs, inputs) = (layout.states.len(), layout.outputs.len(), layout.inputs.len());
        let moving = if layout.kind == Kind::Static { 0 } else { states };
        let counts = [
            ("states", moving, &self.state, false),
            ("outputs", outputs, &self.output, false),
            ("diffusions of states", states, &self.diffusion, true),
            ("noises of outputs", outputs, &self.noise, true),
            ("initial noises of states", states, &self.initial_noise, true),
            ("initial states", states, &self.initial, true),
            ("dead times of inputs", inputs, &self.delay, true),
            ("states after a sample", if layout.kind == Kind::Continuous { states } else { 0 }, &self.jump, true),
        ];
        for (role, expected, found, may_be_empty) in counts {
            let found = found.len();
            if found != expected && !(may_be_empty && found == 0) {
                return Err(InvalidEquations::Count { role, expected, found });
            }
        }
        Ok(())
    }
}
