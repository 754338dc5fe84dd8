//! [`Inspection`]: what the columns of a record show before any model: constant, clipped, frozen, held or repeated values,
//! sentinels, few levels, missing measurements.

mod held;
mod repeated;
mod values;

use super::{Channel, Record};
use crate::numeral::exact;
use core::fmt;
use core::ops::Range;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Inspection of the columns of a record. Nothing in it is an error in itself: a commanded voltage is clipped on purpose, and
/// an encoder at rest repeats its value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inspection {
    /// The inputs, in their order.
    pub inputs: Vec<ChannelInspection>,
    /// The measured outputs, in their order.
    pub outputs: Vec<ChannelInspection>,
}

/// Inspection of one column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelInspection {
    /// Name.
    pub name: String,
    /// Samples that were looked at.
    pub samples: usize,
    /// How many of them were not measured.
    pub missing: usize,
    /// Least and greatest value, in the channel's unit; `None` if nothing was measured.
    pub range: Option<(f64, f64)>,
    /// How many values occur, if they are 16 at most.
    pub levels: Option<usize>,
    /// Least distance of two of these values.
    pub step: Option<f64>,
    /// Suspicious values of an output. An input has sentinels only: commands are constant for a while, limited and
    /// repeated on purpose.
    pub suspicions: Vec<Suspicion>,
}

/// Values that no working sensor gives, unless the plant did just that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Suspicion {
    /// One exact value, far away from all others, stands for something else than a measurement.
    Sentinel {
        /// The value.
        value: f64,
        /// How often it occurs.
        count: usize,
    },
    /// The extreme value occurs much more often than its neighbors.
    Clipped {
        /// The value.
        value: f64,
        /// How often it occurs.
        count: usize,
    },
    /// The value stands still where it changes elsewhere.
    Frozen {
        /// The value.
        value: f64,
        /// The samples.
        samples: Range<usize>,
    },
    /// Each value stands for several samples, as if the sensor measured less often.
    Held {
        /// For how many: the median.
        samples: usize,
    },
    /// A block of samples occurs twice.
    Repeated {
        /// The samples of the block.
        samples: Range<usize>,
        /// Where it occurs again.
        again: usize,
    },
}

/// Inspection of these channels of a record: it does not hold for a record with others that was made from it.
#[derive(Debug)]
pub(crate) struct Looked {
    inputs: Arc<[Channel]>,
    outputs: Arc<[Channel]>,
    found: Arc<Inspection>,
}

/// A record of more samples than these is looked at in pieces, evenly spaced, when it is fitted.
const WHOLE: usize = 16_384;
/// Samples of such a piece.
const PIECE: usize = 512;

impl Record {
    /// Looks at every sample of every column. A fit looks at as many as 16,384 of them.
    pub fn inspect(&self) -> Inspection {
        self.inspect_within(self.len())
    }

    /// An inspection at a cost that does not grow beyond some length, once for all copies of the record.
    pub(crate) fn inspect_some(&self) -> Arc<Inspection> {
        let is_of_this =
            |looked: &&Looked| Arc::ptr_eq(&looked.inputs, &self.inputs) && Arc::ptr_eq(&looked.outputs, &self.outputs);
        if let Some(looked) = self.looked.get().filter(is_of_this) {
            return looked.found.clone();
        }
        let (inputs, outputs, found) =
            (self.inputs.clone(), self.outputs.clone(), Arc::new(self.inspect_within(WHOLE)));
        // Kept is what was set first: by another thread, or for the channels of a record that this one was made from.
        let _ = self.looked.set(Looked { inputs, outputs, found: found.clone() });
        found
    }

    /// Whether that looks at every sample.
    pub(crate) fn is_inspected_whole(&self) -> bool {
        self.len() <= WHOLE
    }

    fn inspect_within(&self, whole: usize) -> Inspection {
        let n = self.len();
        let (count, length) = if n <= whole { (1, n) } else { (WHOLE / PIECE, PIECE) };
        let begin = |i: usize| i * (n - length) / (count - 1).max(1);
        let pieces: Vec<Range<usize>> = (0..count).map(|i| begin(i)..begin(i) + length).collect();
        let all = |channels: &[Channel], output| channels.iter().map(|one| inspect(one, &pieces, output)).collect();
        Inspection { inputs: all(&self.inputs, false), outputs: all(&self.outputs, true) }
    }
}

fn inspect(channel: &Channel, pieces: &[Range<usize>], output: bool) -> ChannelInspection {
    let values = &channel.values[..];
    let mut found = values::Values::of(values, pieces, output);
    // A channel that is constant, or takes few values, in some pieces may not be so in others.
    let whole = 0..values.len();
    if pieces.len() > 1 && (found.least >= found.greatest || output && found.levels.is_some()) {
        found = values::Values::of(values, std::slice::from_ref(&whole), output);
    }
    let extremes = found.extremes().map_or(vec![], Vec::from);
    let mut suspicions = Vec::from_iter(found.sentinel(&extremes));
    if output && suspicions.is_empty() {
        // Where each value is held, so are the extremes.
        if found.repeats_mostly() {
            suspicions.extend(held::held(values, pieces));
        }
        if suspicions.is_empty() {
            suspicions.extend(found.clipped(&extremes));
        }
        suspicions.extend(found.frozen().filter(|_| suspicions.is_empty()));
        if suspicions.is_empty() && pieces.len() == 1 && found.continuous() {
            suspicions.extend(repeated::repeated(values));
        }
    }
    ChannelInspection {
        name: channel.name.clone(),
        samples: found.measured + found.missing,
        missing: found.missing,
        range: (found.least <= found.greatest).then_some((found.least, found.greatest)),
        levels: found.levels.as_ref().map(Vec::len),
        step: found.step(),
        suspicions,
    }
}

impl ChannelInspection {
    /// The value of a column that never changes.
    pub fn constant(&self) -> Option<f64> {
        self.range.filter(|(least, greatest)| least == greatest).map(|(value, _)| value)
    }

    /// Remarks on its values, in words; may be empty.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = vec![];
        if let Some(value) = self.constant() {
            remarks.push(format!("is {} throughout", exact(value)));
        } else if let Some(levels) = self.levels.filter(|levels| *levels <= 8) {
            remarks.push(format!("has {levels} values only"));
        }
        remarks.extend(self.suspicions.iter().map(Suspicion::to_string));
        remarks
    }
}

impl Suspicion {
    /// Whether a sample of the column is suspicious by it.
    pub(crate) fn holds(&self, values: &[f64], sample: usize) -> bool {
        match self {
            Suspicion::Sentinel { value, .. } | Suspicion::Clipped { value, .. } => values[sample] == *value,
            Suspicion::Frozen { samples, .. } => samples.contains(&sample),
            Suspicion::Held { .. } => sample > 0 && values[sample] == values[sample - 1],
            Suspicion::Repeated { samples, again } => (*again..again + samples.len()).contains(&sample),
        }
    }
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Suspicion::Sentinel { value, count } => {
                write!(f, "has the value {} in {count} samples, far away from all others", exact(*value))
            }
            Suspicion::Clipped { value, count } => {
                write!(f, "stops at {}, which it is in {count} samples", exact(*value))
            }
            Suspicion::Frozen { value, samples } => write!(
                f,
                "stands still at {} for {} samples (from sample {})",
                exact(*value),
                samples.len(),
                samples.start
            ),
            Suspicion::Held { samples } => write!(f, "holds each value for {samples} samples"),
            Suspicion::Repeated { samples, again } => {
                write!(f, "has the same {} values from sample {} and from sample {again}", samples.len(), samples.start)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Time;

    /// Copies share what was found; a record with other numbers does not take it over.
    #[test]
    fn other_numbers_are_looked_at_anew() {
        let channels = |values: [f64; 4]| vec![Channel::new("y", "V", values.to_vec())];
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Record::new(vec![], time, vec![], channels([1.0, 2.0, 4.0, 3.0])).unwrap();
        let found = record.inspect_some();
        assert!(Arc::ptr_eq(&found, &record.clone().named("copy").inspect_some()));
        let thinned = record.decimate(2).unwrap();
        let other = Record { outputs: channels([5.0; 4]).into(), ..record.clone() };
        for (record, range) in [(record, (1.0, 4.0)), (thinned, (1.0, 4.0)), (other, (5.0, 5.0))] {
            assert_eq!(record.inspect_some().outputs[0].range, Some(range));
            assert_eq!(*record.inspect_some(), record.inspect());
        }
    }
}
