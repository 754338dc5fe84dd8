//! [`Column`]: the numbers of one signal, in memory or in a file that is mapped into it.

use core::fmt;
use core::ops::{Deref, Range};
use std::sync::Arc;

/// Numbers that are kept elsewhere: in a vector, or in a mapped file.
type Storage = Arc<dyn AsRef<[f64]> + Send + Sync>;

/// A range of numbers; copies and parts share them.
#[derive(Clone)]
pub struct Column {
    storage: Storage,
    range: Range<usize>,
}

impl Column {
    /// The numbers of a container that stays as it is.
    pub fn new(storage: impl AsRef<[f64]> + Send + Sync + 'static) -> Self {
        let range = 0..storage.as_ref().len();
        Column { storage: Arc::new(storage), range }
    }

    /// Whether these are the same numbers at the same place.
    pub(crate) fn is(&self, other: &Column) -> bool {
        Arc::ptr_eq(&self.storage, &other.storage) && self.range == other.range
    }

    /// A part of the column; what lies beyond its end is left out.
    pub fn part(&self, range: Range<usize>) -> Self {
        let end = self.range.end.min(self.range.start + range.end);
        let start = end.min(self.range.start + range.start);
        Column { storage: self.storage.clone(), range: start..end }
    }
}

impl Deref for Column {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        (*self.storage).as_ref().get(self.range.clone()).unwrap_or_default()
    }
}

impl From<Vec<f64>> for Column {
    fn from(values: Vec<f64>) -> Self {
        Column::new(values)
    }
}

impl fmt::Debug for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} numbers", self.len())
    }
}

/// A signal of a record.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// One number per sample.
    pub values: Column,
}

impl Channel {
    /// A signal of this name, unit and values.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, values: impl Into<Column>) -> Self {
        Channel { name: name.into(), unit: unit.into(), values: values.into() }
    }

    /// This signal with other values.
    pub fn with(&self, values: impl Into<Column>) -> Self {
        Channel { name: self.name.clone(), unit: self.unit.clone(), values: values.into() }
    }

    /// This signal over a part of the samples.
    pub(crate) fn part(&self, range: Range<usize>) -> Self {
        self.with(self.values.part(range))
    }
}
