//! [`Linearization`]: cost and slopes at a point.

use crate::information::{Elimination, Information};
use core::ops::Deref;

/// Cost and slopes at a point: the slopes as an [`Elimination`], whose methods it has.
#[derive(Clone, Debug)]
pub struct Linearization {
    /// The cost; half the sum of squares unless a robust loss bends it.
    pub cost: f64,
    slopes: Elimination,
}

impl Linearization {
    /// From the cost, the number of shared unknowns, and one triangle per block, whose columns are the block's own unknowns
    /// and then the shared ones. The unknowns stand in the order: the shared ones, those of the first block alone, of the
    /// second, ...
    pub fn new(cost: f64, shared: usize, blocks: Vec<Information>) -> Self {
        Self::of(cost, Elimination::of_records(shared, blocks))
    }

    /// From the cost and the slopes.
    pub fn of(cost: f64, slopes: Elimination) -> Self {
        Linearization { cost, slopes }
    }
}

impl Deref for Linearization {
    type Target = Elimination;
    fn deref(&self) -> &Elimination {
        &self.slopes
    }
}
