//! [`Window`]: prediction errors and slopes of consecutive samples of several pieces, in lanes.

use crate::aligned::Aligned;
use crate::wide::Width;

/// Prediction errors and slopes of consecutive samples of several pieces, one per lane.
///
/// A row is one output of one sample: its slopes with respect to the seeds, then the prediction error; each entry holds
/// one number per lane. Rows without a measurement, or beyond the end of a lane's piece, are zero. Where variances are
/// predicted they stand in rows of the same shape: slopes, then the variance.
#[derive(Clone, Debug)]
pub struct Window {
    lanes: usize,
    outputs: usize,
    columns: usize,
    capacity: usize,
    /// First sample of each lane.
    pub begin: Vec<usize>,
    /// Number of samples of each lane; zero for a lane without a piece.
    pub samples: Vec<usize>,
    values: Aligned,
    variances: Aligned,
    /// Per row, a bit for each lane that holds a measurement.
    measured: Vec<u32>,
    /// The carry at each lane's first sample, entry by entry.
    pub carry: Vec<f64>,
    /// Whether it is known that every lane with a piece has as many samples, all measured, and all errors are finite.
    pub(crate) whole: bool,
    /// Lanes whose variances and their slopes are the same at all samples, a bit each.
    pub(crate) settled: u32,
    /// Whether they are so in all lanes, which have as many samples, and stand in the rows of the first sample only.
    repeated: bool,
    /// The registers that its lanes are made for.
    pub(crate) width: Width,
}

impl Window {
    /// An empty window of at most `capacity` samples.
    pub fn new(lanes: usize, outputs: usize, seeds: usize, capacity: usize, variances: bool) -> Self {
        let columns = seeds + 1;
        let size = capacity * outputs * columns * lanes;
        Window {
            lanes,
            outputs,
            columns,
            capacity,
            begin: vec![0; lanes],
            samples: vec![0; lanes],
            values: Aligned::zeros(size),
            variances: Aligned::zeros(if variances { size } else { 0 }),
            measured: vec![0; capacity * outputs],
            carry: vec![],
            whole: false,
            settled: 0,
            repeated: false,
            width: Width::widest(),
        }
    }

    /// Says that no lane holds a sample.
    pub(crate) fn forget(&mut self) {
        self.begin.fill(0);
        self.samples.fill(0);
        self.whole = false;
        (self.settled, self.repeated) = (0, false);
    }

    /// Numbers in each entry, one per lane.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Outputs, which are the rows of a sample.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Entries of a row: slopes and the error.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The most samples it can hold.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Samples of the longest lane.
    pub fn len(&self) -> usize {
        self.samples.iter().copied().max().unwrap_or(0)
    }

    /// Whether no lane holds a sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sets all to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
        self.variances.fill(0.0);
        self.measured.fill(0);
        (self.settled, self.repeated) = (0, false);
    }

    /// All rows, one after the other, of the samples that the longest lane has.
    pub fn rows_mut(&mut self) -> &mut [f64] {
        let used = self.len() * self.outputs * self.columns * self.lanes;
        &mut self.values[..used]
    }

    /// The rows of the variances that there are: those of each sample, or of the first where they repeat themselves.
    pub fn variance_rows_mut(&mut self) -> &mut [f64] {
        self.rows_and_variances_mut().1
    }

    /// Rows and those of the variances that there are.
    pub(crate) fn rows_and_variances_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        let sample = self.outputs * self.columns * self.lanes;
        let (used, samples) = (self.len() * sample, if self.repeated { 1 } else { self.len() });
        (&mut self.values[..used], &mut self.variances[..samples * sample])
    }

    /// Whether the rows of the variances of the first sample are those of all.
    pub(crate) fn is_repeated(&self) -> bool {
        self.repeated
    }

    /// Says whether the rows of the variances of the first sample are those of all.
    pub(crate) fn repeat(&mut self, repeated: bool) {
        self.repeated = repeated;
    }

    /// Gives each sample rows of the variances of its own.
    pub(crate) fn spread(&mut self) {
        if self.repeated {
            let sample = self.outputs * self.columns * self.lanes;
            (1..self.len()).for_each(|k| self.variances.copy_within(..sample, k * sample));
            self.repeated = false;
        }
    }

    /// Where the row of an output's variance begins.
    #[inline(always)]
    fn variance_begin(&self, sample: usize, output: usize) -> usize {
        let sample = if self.repeated { 0 } else { sample };
        (sample * self.outputs + output) * self.columns * self.lanes
    }

    /// The rows of a window of one lane, and whether each holds a measurement.
    #[inline(always)]
    pub(crate) fn only_lane_mut(&mut self) -> (&mut [f64], &mut [u32]) {
        (&mut self.values, &mut self.measured)
    }

    /// All rows, used or not.
    pub fn all_rows_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The row of an output of a sample: entry by entry, each with its lanes.
    #[inline(always)]
    pub fn row(&self, sample: usize, output: usize) -> &[f64] {
        let width = self.columns * self.lanes;
        &self.values[(sample * self.outputs + output) * width..][..width]
    }

    /// The row of an output of a sample, to be written.
    #[inline(always)]
    pub fn row_mut(&mut self, sample: usize, output: usize) -> &mut [f64] {
        let width = self.columns * self.lanes;
        &mut self.values[(sample * self.outputs + output) * width..][..width]
    }

    /// The row of an output's variance.
    pub fn variance_row(&self, sample: usize, output: usize) -> &[f64] {
        &self.variances[self.variance_begin(sample, output)..][..self.columns * self.lanes]
    }

    /// The row of an output's variance, to be written.
    pub fn variance_row_mut(&mut self, sample: usize, output: usize) -> &mut [f64] {
        let begin = self.variance_begin(sample, output);
        &mut self.variances[begin..][..self.columns * self.lanes]
    }

    /// Whether variances are predicted.
    pub fn has_variances(&self) -> bool {
        !self.variances.is_empty()
    }

    /// One number of a row.
    #[inline(always)]
    pub fn at(&self, sample: usize, output: usize, column: usize, lane: usize) -> f64 {
        self.values[((sample * self.outputs + output) * self.columns + column) * self.lanes + lane]
    }

    /// One number of the row of an output's variance.
    pub(crate) fn variance_at(&self, sample: usize, output: usize, column: usize, lane: usize) -> f64 {
        self.variances[self.variance_begin(sample, output) + column * self.lanes + lane]
    }

    /// The prediction error.
    #[inline(always)]
    pub fn error(&self, sample: usize, output: usize, lane: usize) -> f64 {
        self.at(sample, output, self.columns - 1, lane)
    }

    /// The prediction errors of an output, sample by sample.
    #[inline(always)]
    pub(crate) fn errors(&self, output: usize, lane: usize) -> impl Iterator<Item = f64> {
        let first = ((output + 1) * self.columns - 1) * self.lanes + lane;
        let errors = self.values.iter().skip(first).step_by(self.outputs * self.columns * self.lanes);
        errors.take(self.samples[lane]).copied()
    }

    /// The predicted variance; one where none is predicted.
    #[inline(always)]
    pub fn variance(&self, sample: usize, output: usize, lane: usize) -> f64 {
        let at = self.variance_begin(sample, output) + (self.columns - 1) * self.lanes + lane;
        self.variances.get(at).copied().unwrap_or(1.0)
    }

    /// Standard deviation that the error was divided by, where variances are predicted and the window is standardized; one where nothing was
    /// measured.
    #[inline(always)]
    pub(crate) fn variance_root(&self, sample: usize, output: usize, lane: usize) -> f64 {
        match self.variance(sample, output, lane) {
            0.0 => 1.0,
            variance => variance.sqrt(),
        }
    }

    /// Logarithm of the variance that the error was divided by; zero where variances are not predicted.
    #[inline(always)]
    pub(crate) fn log_variance(&self, sample: usize, output: usize, lane: usize) -> f64 {
        match self.variance(sample, output, lane) {
            0.0 => 0.0,
            variance => variance.ln(),
        }
    }

    /// Whether an output was measured at a sample of a lane.
    #[inline(always)]
    pub fn is_measured(&self, sample: usize, output: usize, lane: usize) -> bool {
        self.measured[sample * self.outputs + output] >> lane & 1 == 1
    }

    /// How many measurements a lane holds, of the first of every `step` outputs from number `first` on.
    pub fn measurements(&self, lane: usize, first: usize, step: usize) -> u64 {
        let rows = &self.measured[..self.len() * self.outputs];
        rows.iter().skip(first).step_by(step).map(|lanes| u64::from(lanes >> lane & 1)).sum()
    }

    /// Which lanes have measured an output at a sample, a bit each.
    #[inline(always)]
    pub fn measured(&self, sample: usize, output: usize) -> u32 {
        self.measured[sample * self.outputs + output]
    }

    /// Sets which lanes have measured an output at a sample, a bit each.
    #[inline(always)]
    pub fn set_measured(&mut self, sample: usize, output: usize, lanes: u32) {
        self.measured[sample * self.outputs + output] = lanes;
    }

    /// Sets which lanes have measured all outputs at the first samples, a bit each.
    pub(crate) fn set_all_measured(&mut self, samples: usize, lanes: u32) {
        self.measured[..samples * self.outputs].fill(lanes);
    }

    /// Sets a row to zero in the lanes without a measurement.
    pub fn clear_unmeasured_row(&mut self, sample: usize, output: usize) {
        let (lanes, measured) = (self.lanes, self.measured(sample, output));
        let clear = |row: &mut [f64]| {
            for lane in (0..lanes).filter(|lane| measured >> lane & 1 == 0) {
                row.iter_mut().skip(lane).step_by(lanes).for_each(|value| *value = 0.0);
            }
        };
        clear(self.row_mut(sample, output));
        if self.has_variances() {
            clear(self.variance_row_mut(sample, output));
        }
    }

    /// Sets rows without a measurement to zero, after a filter has been applied to all rows.
    pub fn clear_unmeasured(&mut self) {
        let (lanes, width) = (self.lanes, self.columns * self.lanes);
        let all = u32::MAX >> (32 - lanes);
        for (row, measured) in self.values.chunks_exact_mut(width).zip(&self.measured) {
            if measured & all == all {
                continue;
            }
            for (at, value) in row.iter_mut().enumerate() {
                if measured >> (at % lanes) & 1 == 0 {
                    *value = 0.0;
                }
            }
        }
    }
}
