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

impl<P: Signals> Regression<P> {
    /// Index (%) above which a parameter counts as hardly seen: a change by two fifths of its value does no more than
    /// double the squared residual.
    pub const WEAK: f64 = 40.0;

    /// Names of the parameters that these equations hardly see, by [`WEAK`](Self::WEAK): their values are not to be relied
    /// on, whatever their standard errors.
    pub fn weak(&self) -> Vec<&'static str> {
        let index = P::into_array(self.index);
        P::NAMES
            .iter()
            .zip(index.as_ref())
            .filter(|(_, index)| !(**index <= Self::WEAK))
            .map(|(name, _)| *name)
            .collect()
    }
}

impl<P: Signals> fmt::Display for Regression<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, std, index) = (P::into_array(self.parameters), P::into_array(self.std), P::into_array(self.index));
        writeln!(f, "{:<10} {:>14} {:>10} {:<8} {:>10}", "parameter", "value", "std. error", "unit", "index %")?;
        for i in 0..P::LEN {
            writeln!(
                f,
                "{:<10} {:>14.6e} {:>10.2e} {:<8} {:>10.3}",
                P::NAMES[i],
                value.as_ref()[i],
                std.as_ref()[i],
                P::UNITS[i],
                index.as_ref()[i]
            )?;
        }
        match self.weak().as_slice() {
            [] => Ok(()),
            weak => writeln!(f, "hardly seen in these data: {}", weak.join(", ")),
        }
    }
}

/// What a regression may be told to hold, by signals: nothing.
pub fn all_free<P: Signals>() -> Of<P, Option<f64>> {
    P::splat(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::SeedableRng;

    crate::signals! {
        struct Pair { a: "V/A", b: "V" }
    }

    fn rows(n: usize, noise: f64, seed: u64) -> Vec<(Pair, f64)> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        (0..n)
            .map(|k| {
                let x = (0.01 * k as f64).sin();
                let e: f64 = StandardNormal.sample(&mut rng);
                (Pair { a: x, b: 1.0 }, 3.0 * x - 0.5 + noise * e)
            })
            .collect()
    }

    #[test]
    fn exact_rows_give_exact_parameters() {
        let filter = Butterworth::low_pass(4, 10.0, 1e-3).unwrap();
        for equations in [
            Equations::<Pair>::new().stream(rows(500, 0.0, 1)),
            Equations::<Pair>::new().stream(rows(500, 0.0, 1)).prefiltered(&filter),
            Equations::<Pair>::new().stream(rows(500, 0.0, 1)).weighted(|k| k as f64).unwrap(),
        ] {
            let found = equations.solve(all_free::<Pair>()).unwrap();
            assert_relative_eq!(found.parameters, Pair { a: 3.0, b: -0.5 }, max_relative = 1e-12);
        }
        let held = Equations::<Pair>::new().stream(rows(500, 0.0, 1)).solve(Pair { a: Some(3.0), b: None }).unwrap();
        assert_relative_eq!(held.parameters, Pair { a: 3.0, b: -0.5 }, max_relative = 1e-12);
        assert_eq!(held.std.a, 0.0);
    }

    // The index is the change that doubles the squared residual when the others are refitted: the profile itself.
    #[test]
    fn index_doubles_the_profiled_residual() {
        let equations = Equations::<Pair>::new().stream(rows(500, 0.1, 1));
        let found = equations.solve(all_free::<Pair>()).unwrap();
        let a = found.parameters.a * (1.0 + found.index.a / 100.0);
        let profiled = equations.solve(Pair { a: Some(a), b: None }).unwrap();
        assert!((profiled.residual / found.residual - 2.0).abs() < 1e-6);
        // Held: all others stay where they are.
        let b = found.parameters.b * (1.0 + found.index_others_held.b / 100.0);
        let moved = equations.predictions(&Pair { a: found.parameters.a, b });
        let residual: f64 = moved.iter().flatten().map(|(y, y_hat)| (y - y_hat).powi(2)).sum();
        assert!((residual / found.residual - 2.0).abs() < 1e-6);
        // It is sqrt(rows - p) standard errors.
        let n = (500.0f64 - 2.0).sqrt();
        assert_relative_eq!(found.index.a / 100.0 * found.parameters.a, n * found.std.a, max_relative = 1e-9);
    }

    /// Spread of the estimates over what the standard errors say, in variance, over 1000 seeds.
    fn calibration(make: impl Fn(u64) -> Regression<Pair>) -> f64 {
        let ratios = (0..1000).map(|seed| {
            let found = make(seed);
            ((found.parameters.a - 3.0) / found.std.a).powi(2)
        });
        ratios.sum::<f64>() / 1000.0
    }

    // Chi-square of 1000: standard deviation 0.045; three of them.
    #[test]
    fn standard_errors_hold_plain_weighted_and_filtered() {
        let plain = calibration(|seed| {
            Equations::<Pair>::new().stream(rows(200, 0.1, seed)).solve(all_free::<Pair>()).unwrap()
        });
        assert!((plain - 1.0).abs() < 0.135, "{plain}");
        // The sandwich is a little small on 200 rows of unequal weight: of order (mean leverage) more.
        let weighted = calibration(|seed| {
            let equations = Equations::<Pair>::new().stream(rows(200, 0.1, seed)).weighted(|k| (k % 5) as f64).unwrap();
            equations.solve(all_free::<Pair>()).unwrap()
        });
        assert!((weighted - 1.0).abs() < 0.16, "{weighted}");
        // The regressor (1.6 Hz) is slow against the filter (25 Hz); without the colour the ratio would be near 20.
        let filter = Butterworth::low_pass(4, 25.0, 1e-3).unwrap();
        let filtered = calibration(|seed| {
            Equations::<Pair>::new()
                .stream(rows(4000, 0.1, seed))
                .prefiltered(&filter)
                .solve(all_free::<Pair>())
                .unwrap()
        });
        assert!((filtered - 1.0).abs() < 0.135, "{filtered}");
    }

    // SPEC 5: 100 Hz at 0.126 ms makes the variance 39 times as large.
    #[test]
    fn colour_of_the_motors_filter() {
        let filter = Butterworth::low_pass(4, 100.0, 0.126e-3).unwrap();
        assert!((1.0 / energy(&filter) - 39.0).abs() < 0.5, "{}", 1.0 / energy(&filter));
    }

    #[test]
    fn what_cannot_be_told_is_named() {
        let twins = (0..50).map(|k| (Pair { a: k as f64, b: 2.0 * k as f64 }, k as f64));
        let error = Equations::<Pair>::new().stream(twins).solve(all_free::<Pair>()).unwrap_err().to_string();
        assert!(error.contains("`b`") && error.contains("not identifiable"), "{error}");
        let absent = (0..50).map(|k| (Pair { a: k as f64, b: 0.0 }, k as f64));
        let error = Equations::<Pair>::new().stream(absent).solve(all_free::<Pair>()).unwrap_err().to_string();
        assert!(error.contains("`b`") && error.contains("no influence"), "{error}");
        assert!(Equations::<Pair>::new().solve(all_free::<Pair>()).is_err());
        assert!(Equations::<Pair>::new().stream(rows(9, 0.0, 1)).solve(Pair { a: Some(1.0), b: Some(1.0) }).is_err());
        assert!(Equations::<Pair>::new().stream(rows(9, 0.0, 1)).weighted(|_| f64::NAN).is_err());
    }
}
