//! [`Linearization`]: cost and slopes at a point, as triangles.

use crate::information::Information;

/// Cost and slopes at a point.
///
/// The unknowns stand in the order: those shared by all blocks, then those of the first block alone, of the second, ...
/// Each block's triangle has the columns: its own unknowns, then the shared ones. Own unknowns (initial states, parameters
/// that each experiment has for itself) are minimized out inside their block before the blocks are merged, so that many
/// blocks cost no more than one.
#[derive(Clone, Debug)]
pub struct Linearization {
    /// The cost; half the sum of squares unless a robust loss bends it.
    pub cost: f64,
    shared: usize,
    blocks: Vec<Information>,
    data_norm: Option<f64>,
    roughness: f64,
}

/// See [`Linearization::reduce`].
pub(crate) type Reduced = (Information, Vec<usize>, Vec<(Information, Vec<usize>)>);

impl Linearization {
    /// From the cost, the number of shared unknowns, and one triangle per block.
    pub fn new(cost: f64, shared: usize, blocks: Vec<Information>) -> Self {
        Linearization { cost, shared, blocks, data_norm: None, roughness: 0.0 }
    }

    /// With the norm of the data themselves, weighted as the rows are: what residuals are small against.
    pub fn with_data_norm(self, norm: f64) -> Self {
        Linearization { data_norm: Some(norm), ..self }
    }

    /// With a part of the cost by which it may jump from point to point: that of an integrator with a tolerance.
    pub fn with_roughness(self, roughness: f64) -> Self {
        Linearization { roughness, ..self }
    }

    /// Norm of the data, if it was said.
    pub fn data_norm(&self) -> Option<f64> {
        self.data_norm
    }

    /// By which part of itself the cost may jump; zero unless said otherwise.
    pub fn roughness(&self) -> f64 {
        self.roughness
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.shared + self.blocks.iter().map(|block| block.columns().saturating_sub(self.shared)).sum::<usize>()
    }

    /// Number of unknowns that all blocks share.
    pub fn shared(&self) -> usize {
        self.shared
    }

    /// The triangle of each block: its own columns, then the shared ones.
    pub fn blocks(&self) -> &[Information] {
        &self.blocks
    }

    /// How many rows the triangles stand for.
    pub fn rows(&self) -> u64 {
        self.blocks.iter().map(Information::rows).sum()
    }

    /// The unknown behind each column of each block.
    pub fn columns(&self) -> impl Iterator<Item = (&Information, Vec<usize>)> {
        let mut next = self.shared;
        self.blocks.iter().map(move |block| {
            let own = block.columns().saturating_sub(self.shared);
            let columns = (next..next + own).chain(0..self.shared).collect();
            next += own;
            (block, columns)
        })
    }

    /// Gradient of half the sum of squares.
    pub fn gradient(&self) -> Vec<f64> {
        let mut gradient = vec![0.0; self.unknowns()];
        for (block, columns) in self.columns() {
            for (&unknown, slope) in columns.iter().zip(block.gradient()) {
                gradient[unknown] += slope;
            }
        }
        gradient
    }

    /// Norm of each unknown's column of the Jacobian.
    pub fn column_norms(&self) -> Vec<f64> {
        let mut norms = vec![0.0f64; self.unknowns()];
        for (block, columns) in self.columns() {
            for (&unknown, norm) in columns.iter().zip(block.column_norms()) {
                norms[unknown] = norms[unknown].hypot(norm);
            }
        }
        norms
    }

    /// Sum of squares at the point itself.
    pub fn sum_of_squares(&self) -> f64 {
        self.blocks.iter().map(Information::residual_at_zero).sum()
    }

    /// By how much half the sum of squares falls along a step, if the slopes held.
    pub fn predicted_reduction(&self, step: &[f64]) -> f64 {
        let mut reduction = 0.0;
        for (block, columns) in self.columns() {
            let n = block.columns();
            // Row by row, |z|^2 - |z - R d|^2 = (2 z - R d) R d, which does not cancel.
            for i in 0..n {
                let change: f64 = (i..n).map(|j| block.at(i, j) * step[columns[j]]).sum();
                reduction += change * (block.at(i, n) - 0.5 * change);
            }
        }
        reduction
    }

    /// What is left for the shared unknowns when each block's own are minimized out, with these unknowns held and this
    /// damping; and each block's damped triangle of its free columns with the unknowns behind them.
    pub(crate) fn reduce(&self, damping: &[f64], held: &[bool]) -> Reduced {
        let shared: Vec<usize> = (0..self.shared).filter(|&i| !held[i]).collect();
        let mut total = Information::new(shared.len());
        let mut blocks = Vec::with_capacity(self.blocks.len());
        for (block, columns) in self.columns() {
            let kept: Vec<usize> = (0..columns.len()).filter(|&c| !held[columns[c]]).collect();
            let unknowns: Vec<usize> = kept.iter().map(|&c| columns[c]).collect();
            let own = unknowns.len() - shared.len();
            let diagonal: Vec<f64> =
                unknowns.iter().enumerate().map(|(c, &i)| if c < own { damping[i] } else { 0.0 }).collect();
            let mut block = if kept.len() == columns.len() { block.clone() } else { block.select(&kept) };
            if diagonal.iter().any(|&d| d != 0.0) {
                block = block.damped(&diagonal);
            }
            total.merge(&block.eliminate(own));
            blocks.push((block, unknowns));
        }
        let diagonal: Vec<f64> = shared.iter().map(|&i| damping[i]).collect();
        if diagonal.iter().any(|&d| d != 0.0) {
            total = total.damped(&diagonal);
        }
        (total, shared, blocks)
    }

    /// The step that minimizes the linearized sum of squares plus `|diag(damping) step|^2`, with the unknowns in `held`
    /// kept; `None` where the free unknowns are not determined.
    pub fn step(&self, damping: &[f64], held: &[bool]) -> Option<Vec<f64>> {
        let (total, shared, blocks) = self.reduce(damping, held);
        let mut step = vec![0.0; self.unknowns()];
        for (&unknown, d) in shared.iter().zip(total.solve().ok()?) {
            step[unknown] = d;
        }
        for (block, unknowns) in &blocks {
            let n = block.columns();
            for i in (0..n - shared.len()).rev() {
                let known: f64 = (i + 1..n).map(|j| block.at(i, j) * step[unknowns[j]]).sum();
                step[unknowns[i]] = (block.at(i, n) - known) / block.at(i, i);
            }
        }
        step.iter().all(|d| d.is_finite()).then_some(step)
    }

    /// As [`step`](Self::step), within this room (at most zero, at least zero) for each unknown. An unknown that would leave
    /// it is put on its end, first come, first put, and the others are minimized again: every stage lowers the damped sum
    /// of squares further.
    pub(crate) fn step_within(&self, damping: &[f64], held: &[bool], room: &[(f64, f64)]) -> Option<Vec<f64>> {
        let mut step = self.step(damping, held)?;
        let (mut held, mut at, mut put) = (held.to_vec(), vec![0.0; step.len()], vec![0.0; step.len()]);
        loop {
            let end = |i: usize| if step[i] < room[i].0 { room[i].0 } else { room[i].1 };
            let beyond = (0..step.len()).filter(|&i| !held[i] && (step[i] < room[i].0 || step[i] > room[i].1));
            let part = |i: usize| ((end(i) - at[i]) / (step[i] - at[i])).clamp(0.0, 1.0);
            let Some(first) = beyond.min_by(|&i, &j| part(i).total_cmp(&part(j))) else { return Some(step) };
            let (part, end) = (part(first), end(first));
            at.iter_mut().zip(&step).for_each(|(at, step)| *at += part * (step - *at));
            (at[first], put[first], held[first]) = (end, end, true);
            let columns = self.columns().map(|(_, columns)| columns);
            let moved = |(block, columns): (&Information, Vec<usize>)| {
                block.about(&columns.iter().map(|&unknown| put[unknown]).collect::<Vec<f64>>())
            };
            let blocks = self.blocks.iter().zip(columns).map(moved).collect();
            step = Linearization::new(self.cost, self.shared, blocks).step(damping, &held)?;
            step.iter_mut().zip(&put).for_each(|(step, put)| *step += put);
        }
    }

    /// What the data say of the shared unknowns alone, each block's own minimized out.
    pub fn shared_information(&self) -> Information {
        let free = vec![false; self.unknowns()];
        self.reduce(&vec![0.0; self.unknowns()], &free).0
    }
}
