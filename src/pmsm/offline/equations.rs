use crate::prefilter::Butterworth;
use crate::regress::{Change, LinearEstimate, Regression, RegressionError};
use crate::signals::{Of, Signals};

/// Voltage equations `y = phi . p` of a record: one stream per axis, one row per sample, to be filtered and weighted
/// before they are solved.
#[derive(Clone, Debug)]
pub struct Equations<P: Signals> {
    streams: Vec<Stream<P>>,
    lags: Option<usize>,
}

#[derive(Clone, Debug)]
struct Stream<P: Signals> {
    rows: Vec<(Of<P, f64>, f64)>,
    weights: Vec<f64>,
}

impl<P: Signals> Default for Equations<P> {
    fn default() -> Self {
        Equations { streams: Vec::new(), lags: None }
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
        self.lags = self.lags.max(other.lags);
        self.streams.extend(other.streams);
        self
    }

    /// Filters every stream, causally and from rest: each entry of `phi`, and `y`, by the same filter, which leaves the
    /// equations true.
    ///
    /// The remaining noise is correlated over the filter's memory; the standard errors count this.
    pub fn prefiltered(mut self, filter: &Butterworth) -> Self {
        for stream in &mut self.streams {
            let (mut states, mut row) = (vec![], Vec::with_capacity(P::LEN + 1));
            for (phi, y) in &mut stream.rows {
                row.clear();
                row.extend(P::into_array(*phi));
                row.push(*y);
                filter.filter_rows(&mut row, P::LEN + 1, &mut states);
                *phi = P::from_fn(|i| row[i]);
                *y = row[P::LEN];
            }
        }
        // The response is over after some two periods of the cut-off.
        self.lags = self.lags.max(Some((2.0 / filter.cutoff() / filter.sample_time()).ceil() as usize));
        self
    }

    /// Multiplies the cost of row `k` of every stream by `weight(k)` (thesis (5.9)).
    pub fn weighted(mut self, weight: impl Fn(usize) -> f64) -> Self {
        for stream in &mut self.streams {
            stream.weights = (0..stream.rows.len()).map(&weight).collect();
        }
        self
    }

    /// The rows as a regression, stream after stream.
    pub fn regression(&self) -> Regression<P> {
        let mut regression = Regression::new();
        for stream in &self.streams {
            for (k, (phi, y)) in stream.rows.iter().enumerate() {
                regression.weighted_row(*phi, *y, stream.weights.get(k).copied().unwrap_or(1.0));
            }
        }
        match self.lags {
            Some(lags) => regression.correlated(lags),
            None => regression,
        }
    }

    /// The parameters that leave the least sum of squares.
    ///
    /// # Errors
    /// As [`Regression::solve`].
    pub fn solve(&self) -> Result<LinearEstimate<P>, RegressionError> {
        self.regression().solve()
    }

    /// By how much the parameters changed from this record to `later`, one of the same motion; see [`Regression::change`].
    ///
    /// # Errors
    /// As [`Regression::change`].
    pub fn change(&self, later: &Self) -> Result<Change<P>, RegressionError> {
        self.regression().change(&later.regression())
    }

    /// The least weighted sum of squared residuals.
    pub fn least_squares(&self) -> f64 {
        self.regression().information().residual()
    }

    /// `(y, phi . p)` of each row, stream by stream.
    pub fn predictions(&self, parameters: &Of<P, f64>) -> Vec<Vec<(f64, f64)>> {
        let p = P::into_array(*parameters);
        let dot = |phi: &Of<P, f64>| P::into_array(*phi).as_ref().iter().zip(p.as_ref()).map(|(a, b)| a * b).sum();
        self.streams.iter().map(|stream| stream.rows.iter().map(|(phi, y)| (*y, dot(phi))).collect()).collect()
    }
}
