//! [`Equations`]: linear least squares on equations `y = phi . p`, in the names of the parameters.
//!
//! For models that are linear in their parameters once the states and their slopes are measured. The products themselves
//! may be pre-filtered (filtering both sides of an equation leaves it true), weighted, and pooled over records. The
//! regressors contain measured signals: their noise biases the estimate toward zero, which no standard error shows; a fit
//! of the simulated model does not have this bias.

use crate::error::Error;
use crate::information::{Block, Information, SquareMatrix};
use crate::prefilter::{Butterworth, FilterState};
use crate::signals::{Of, Signals};
use core::fmt;

/// Rows gathered before they are absorbed.
const BLOCK: usize = 256;

/// Equations `y = phi . p` in the parameters `P`, in streams: one stream per equation, one row per sample.
#[derive(Clone, Debug)]
pub struct Equations<P: Signals> {
    streams: Vec<Stream<P>>,
    colour: f64,
}

#[derive(Clone, Debug)]
struct Stream<P: Signals> {
    rows: Vec<(Of<P, f64>, f64)>,
    weights: Vec<f64>,
}

impl<P: Signals> Default for Equations<P> {
    fn default() -> Self {
        Equations { streams: Vec::new(), colour: 1.0 }
    }
}

impl<P: Signals> Equations<P> {
    /// No equation.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a stream of rows `(phi, y)`, sample by sample.
    pub fn stream(mut self, rows: impl IntoIterator<Item = (Of<P, f64>, f64)>) -> Self {
        self.streams.push(Stream { rows: rows.into_iter().collect(), weights: Vec::new() });
        self
    }

    /// Adds the streams of another record.
    pub fn and(mut self, other: Self) -> Self {
        self.colour = self.colour.max(other.colour);
        self.streams.extend(other.streams);
        self
    }

    /// Filters every stream, causally and from rest: each entry of `phi`, and `y`, by the same filter.
    ///
    /// The errors are then coloured and a row says less than it seems to: the variance of an estimate is larger by
    /// `1 / sum h^2` (`h` the filter's impulse response) where its regressors are slow against the filter. The standard
    /// errors count this.
    pub fn prefiltered(mut self, filter: &Butterworth) -> Self {
        for stream in &mut self.streams {
            let mut states = vec![FilterState::default(); P::LEN + 1];
            for (phi, y) in &mut stream.rows {
                let entries = P::into_array(*phi);
                let mut states = states.iter_mut();
                let mut pass = |x: f64| states.next().map_or(x, |state| filter.step(state, x));
                *phi = P::from_fn(|i| pass(entries.as_ref()[i]));
                *y = pass(*y);
            }
        }
        self.colour /= energy(filter);
        self
    }

    /// Multiplies the cost of row `k` of every stream by `weight(k)`, finite and not negative (thesis (5.9)). A weight is
    /// not an inverse variance: the standard errors are those of the sandwich.
    ///
    /// # Errors
    /// A weight that is negative or not finite.
    pub fn weighted(mut self, weight: impl Fn(usize) -> f64) -> Result<Self, Error> {
        for stream in &mut self.streams {
            stream.weights = (0..stream.rows.len()).map(&weight).collect();
            if let Some((k, w)) = stream.weights.iter().enumerate().find(|(_, w)| !(**w >= 0.0 && w.is_finite())) {
                return Err(Error::Option(format!("the weight of row {k} is {w}; it must be finite and not negative")));
            }
        }
        Ok(self)
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.streams.iter().map(|stream| stream.rows.len()).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `(y, phi . p)` of each row, stream by stream.
    pub fn predictions(&self, parameters: &Of<P, f64>) -> Vec<Vec<(f64, f64)>> {
        let p = P::into_array(*parameters);
        let dot = |phi: &Of<P, f64>| P::into_array(*phi).as_ref().iter().zip(p.as_ref()).map(|(a, b)| a * b).sum();
        self.streams.iter().map(|stream| stream.rows.iter().map(|(phi, y)| (*y, dot(phi))).collect()).collect()
    }

    /// The parameters that leave the least sum of squares; those `held` keep the value given.
    ///
    /// # Errors
    /// Fewer rows than parameters, nothing free, a parameter that the rows do not tell from the others (named).
    pub fn solve(&self, held: Of<P, Option<f64>>) -> Result<Regression<P>, Error> {
        let held = P::into_array(held);
        let free: Vec<usize> = (0..P::LEN).filter(|&i| held.as_ref()[i].is_none()).collect();
        if free.is_empty() {
            return Err(Error::NothingFree);
        }
        let (rows, n) = (self.len(), free.len());
        if rows <= n {
            return Err(Error::Option(format!(
                "a regression of {n} parameters needs more than {n} rows; there are {rows}"
            )));
        }
        let row = |(phi, y): &(Of<P, f64>, f64)| {
            let phi = P::into_array(*phi);
            let known: f64 = (0..P::LEN).filter_map(|i| held.as_ref()[i].map(|p| p * phi.as_ref()[i])).sum();
            (phi, y - known)
        };
        let mut information = Information::new(n);
        let mut block = Block::new(n, BLOCK);
        self.for_each(|stream_row, weight| {
            let (phi, y) = row(stream_row);
            push(&mut information, &mut block, weight.sqrt(), free.iter().map(|&i| phi.as_ref()[i]), y);
        });
        information.absorb(&mut block);
        let solution = information.solve().map_err(|deficient| Error::Parameter {
            parameter: free.get(deficient.column).map_or("?", |&i| P::NAMES[i]).to_owned(),
            problem: format!("not identifiable from these equations: its {deficient}"),
        })?;

        let deficient = |e: crate::information::RankDeficient| Error::Option(e.to_string());
        let inverse = information.covariance().map_err(deficient)?;
        let residual = information.residual();
        let degrees = (rows - n) as f64;
        let covariance = if self.streams.iter().all(|stream| stream.weights.is_empty()) {
            SquareMatrix::from_fn(n, |i, j| self.colour * residual / degrees * inverse[(i, j)])
        } else {
            let mut meat = Information::new(n);
            self.for_each(|stream_row, weight| {
                let (phi, y) = row(stream_row);
                let error = y - free.iter().zip(&solution).map(|(&i, p)| phi.as_ref()[i] * p).sum::<f64>();
                push(&mut meat, &mut block, weight * error, free.iter().map(|&i| phi.as_ref()[i]), 0.0);
            });
            meat.absorb(&mut block);
            let sandwich = information.sandwich(&meat).map_err(deficient)?;
            SquareMatrix::from_fn(n, |i, j| self.colour * rows as f64 / degrees * sandwich[(i, j)])
        };
        let norms = information.column_norms();
        let place = |i: usize| free.iter().position(|&f| f == i);
        let value = |i: usize| place(i).map_or(held.as_ref()[i].unwrap_or(0.0), |k| solution[k]);
        let percent = |spread: f64, i: usize| 100.0 * spread.sqrt() / value(i).abs();
        Ok(Regression {
            parameters: P::from_fn(value),
            std: P::from_fn(|i| place(i).map_or(0.0, |k| covariance[(k, k)].sqrt())),
            index: P::from_fn(|i| place(i).map_or(0.0, |k| percent(residual * inverse[(k, k)], i))),
            index_others_held: P::from_fn(|i| place(i).map_or(0.0, |k| percent(residual / norms[k].powi(2), i))),
            covariance,
            residual,
            rows,
        })
    }

    fn for_each(&self, mut f: impl FnMut(&(Of<P, f64>, f64), f64)) {
        for stream in &self.streams {
            for (k, row) in stream.rows.iter().enumerate() {
                f(row, stream.weights.get(k).copied().unwrap_or(1.0));
            }
        }
    }
}

/// Appends a row times `factor`; absorbs the block first, if full.
fn push(into: &mut Information, block: &mut Block, factor: f64, phi: impl Iterator<Item = f64>, y: f64) {
    if block.is_full() {
        into.absorb(block);
    }
    let (row, columns) = (block.len(), block.columns());
    for (column, slope) in phi.enumerate() {
        block.column_mut(column)[row] = factor * slope;
    }
    block.column_mut(columns)[row] = factor * y;
    block.set_len(row + 1);
}

/// Sum of the squares of a filter's impulse response: its gain on white noise, in variance.
fn energy(filter: &Butterworth) -> f64 {
    let mut state = FilterState::default();
    // The response has died out after some 10 periods of the cut-off.
    let length = (30.0 / filter.cutoff() / filter.sample_time()) as usize + 10;
    (0..length).map(|k| filter.step(&mut state, if k == 0 { 1.0 } else { 0.0 }).powi(2)).sum()
}

/// What a linear regression found.
#[derive(Clone, Debug)]
pub struct Regression<P: Signals> {
    /// The parameters, in their units; those held as given.
    pub parameters: Of<P, f64>,
    /// Standard errors, same units; zero for what was held.
    pub std: Of<P, f64>,
    /// Parametric error index (%), the others refitted: the change of a parameter that doubles the squared residual
    /// (thesis (5.12) to (5.14)). Low is well excited.
    pub index: Of<P, f64>,
    /// The same with the others held.
    pub index_others_held: Of<P, f64>,
    /// Covariance of the free parameters, in order of declaration.
    pub covariance: SquareMatrix,
    /// Weighted sum of squared residuals.
    pub residual: f64,
    /// How many equations.
    pub rows: usize,
}

impl<P: Signals> fmt::Display for Regression<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, std, index) = (P::into_array(self.parameters), P::into_array(self.std), P::into_array(self.index));
        writeln!(f, "{:<10} {:>14} {:>14} {:>10}", "parameter", "value", "std. error", "index %")?;
        for i in 0..P::LEN {
            writeln!(
                f,
                "{:<10} {:>14.6e} {:>14.2e} {:>10.3} {}",
                P::NAMES[i],
                value.as_ref()[i],
                std.as_ref()[i],
                index.as_ref()[i],
                P::UNITS[i]
            )?;
        }
        Ok(())
    }
}

/// What a regression may be told to hold, by signals: nothing.
pub fn all_free<P: Signals>() -> Of<P, Option<f64>> {
    P::splat(None)
}
