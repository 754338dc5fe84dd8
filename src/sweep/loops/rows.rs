//! [`Rows`]: a window of a record as values of the model's types.

use super::WINDOW;
use crate::model::Model;
use crate::record::Record;
use crate::signals::Signals;
use std::ops::Range;

/// The rows of one window, with the sample after its last one, and the samples before from which it is predicted; made
/// once, and filled for each window.
pub(super) struct Rows<'p, M: Model> {
    record: &'p Record,
    input_columns: Vec<&'p [f64]>,
    output_columns: Vec<&'p [f64]>,
    /// How many samples there are before the window's first.
    pub before: usize,
    pub times: Vec<f64>,
    pub inputs: Vec<<M::Input as Signals>::Array<f64>>,
    pub outputs: Vec<<M::Output as Signals>::Array<f64>>,
}

impl<'p, M: Model> Rows<'p, M> {
    pub fn new(record: &'p Record) -> Self {
        Rows {
            record,
            input_columns: record.inputs().iter().map(|channel| &*channel.values).collect(),
            output_columns: record.outputs().iter().map(|channel| &*channel.values).collect(),
            before: 0,
            times: Vec::with_capacity(WINDOW + 1),
            inputs: Vec::with_capacity(WINDOW + 1),
            outputs: Vec::with_capacity(WINDOW),
        }
    }

    pub fn read(&mut self, begin: usize, samples: usize, before: usize) {
        let (record, inputs, outputs) = (self.record, &self.input_columns, &self.output_columns);
        self.before = before.min(begin);
        let all = begin - self.before..record.len().min(begin + samples + 1);
        self.times.clear();
        record.times().append(all.clone(), &mut self.times);
        gather::<M::Input>(inputs, all, &mut self.inputs);
        gather::<M::Output>(outputs, begin..begin + samples, &mut self.outputs);
    }
}

/// Samples of columns, row by row.
fn gather<S: Signals>(columns: &[&[f64]], samples: Range<usize>, rows: &mut Vec<S::Array<f64>>) {
    rows.resize(samples.len(), S::array_from_fn(|_| 0.0));
    for (i, column) in columns.iter().enumerate() {
        for (row, value) in rows.iter_mut().zip(&column[samples.clone()]) {
            row.as_mut()[i] = *value;
        }
    }
}
