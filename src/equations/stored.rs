//! Equations as they are kept in files.

use super::{Equations, InvalidEquations, Roots};
use crate::graph::{Graph, Id};
use crate::layout::Layout;
use serde::{Deserialize, Serialize};

/// The serialized form of equations.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parts {
    layout: Layout,
    graph: Graph,
    state: Vec<Id>,
    output: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    diffusion: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    noise: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    initial_noise: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    initial: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    delay: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    jump: Vec<Id>,
}

impl From<Equations> for Parts {
    fn from(Equations { layout, graph, roots }: Equations) -> Self {
        let Roots { state, output, diffusion, noise, initial_noise, initial, delay, jump } = roots;
        Parts { layout, graph, state, output, diffusion, noise, initial_noise, initial, delay, jump }
    }
}

impl TryFrom<Parts> for Equations {
    type Error = InvalidEquations;

    fn try_from(parts: Parts) -> Result<Self, InvalidEquations> {
        let Parts { layout, graph, state, output, diffusion, noise, initial_noise, initial, delay, jump } = parts;
        Equations::complete(
            layout,
            &graph,
            &Roots { state, output, diffusion, noise, initial_noise, initial, delay, jump },
        )
    }
}
