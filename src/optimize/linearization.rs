//! [`Linearization`]: cost and slopes at a point.

use crate::information::{Elimination, Information};
use core::ops::Deref;

/// Cost and slopes at a point: the slopes as an [`Elimination`], whose methods it has.
#[derive(Clone, Debug)]
pub struct Linearization {
    /// The cost; half the sum of squares unless a robust loss bends it.
    pub cost: f64,
    slopes: Elimination,
    data_norm: Option<f64>,
    forgotten: Vec<usize>,
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
        Linearization { cost, slopes, data_norm: None, forgotten: vec![] }
    }

    /// With the norm of the data themselves, weighted as the rows are: what residuals are small against.
    pub fn with_data_norm(self, norm: f64) -> Self {
        Linearization { data_norm: Some(norm), ..self }
    }

    /// With the numbers of unknowns whose slopes were set to zero because they are below the rounding of the residual. A search that ends where
    /// these have no influence has not ended on a plateau.
    pub fn with_forgotten(self, forgotten: Vec<usize>) -> Self {
        Linearization { forgotten, ..self }
    }

    /// The numbers of these unknowns, in the order of the coordinates.
    pub fn forgotten(&self) -> &[usize] {
        &self.forgotten
    }

    /// Norm of the data, if it was said.
    pub fn data_norm(&self) -> Option<f64> {
        self.data_norm
    }
}

impl Deref for Linearization {
    type Target = Elimination;
    fn deref(&self) -> &Elimination {
        &self.slopes
    }
}
