//! [`DeadTimes`]: which inputs of equations are late.

use super::Equations;
use crate::graph::Id;

/// Dead times of inputs.
#[derive(Clone, Debug)]
pub(crate) struct DeadTimes {
    /// Each once, by its node.
    pub roots: Vec<Id>,
    /// Of each input the number of its dead time, if it is late.
    pub of: Vec<Option<usize>>,
}

impl Equations {
    /// Which inputs have a dead time.
    pub(crate) fn late(&self) -> Vec<bool> {
        self.dead_times().of.iter().map(Option::is_some).collect()
    }

    /// The dead times that differ, and which one each input has.
    pub(crate) fn dead_times(&self) -> DeadTimes {
        let (mut roots, mut of) = (vec![], vec![None; self.layout.inputs.len()]);
        for (of, id) in of.iter_mut().zip(&self.roots.delay).filter(|(_, id)| self.graph.known(**id) != Some(0.0)) {
            let known = roots.iter().position(|root| root == id);
            *of = known.or(Some(roots.len()));
            if known.is_none() {
                roots.push(*id);
            }
        }
        DeadTimes { roots, of }
    }
}
