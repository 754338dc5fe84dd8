//! [`Reading`]: how a file was read.

use super::FileFormat;
use crate::numeral::TimeUnit;
use core::fmt;

/// How a file was read: what was said of it, and what was guessed. Its text is one line:
/// `cells between ";", decimal comma, 2 lines above the names, a row of units; time "Zeit": dates, day first, from 20.03.2025 00:00`.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The kind of file.
    pub format: FileFormat,
    /// What stands between the cells; none in a file that is no text.
    pub separator: Option<char>,
    /// Whether numbers are written as 1,5.
    pub decimal_comma: bool,
    /// Lines above the names of the columns, comments among them.
    pub preamble: u64,
    /// Whether a row of units was skipped.
    pub units_row: bool,
    /// Whether names or units are no UTF-8 and were read as Windows-1252.
    pub windows: bool,
    /// Where time comes from.
    pub time: TimeSource,
    /// Signals for which the file has another unit than the model, one of them unknown: name, the file's unit, the model's. They
    /// are not converted.
    pub units: Vec<(String, String, String)>,
    /// Inputs that were filled in between their own samples, and how many of these there are.
    pub filled: Vec<(String, usize)>,
    /// Rows that were left out since one of them is not known there.
    pub left_out: usize,
}

/// Where the time of a record comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeSource {
    /// Even steps; there is no column.
    Even {
        /// The step (s).
        step: f64,
    },
    /// A column of numbers.
    Numbers {
        /// Name of the column.
        column: String,
        /// Its unit in seconds.
        unit: f64,
        /// The number that became time zero, if the numbers count from long ago.
        origin: f64,
    },
    /// A column of dates or of times of day; time is in seconds from the first.
    Dates {
        /// Name of the column.
        column: String,
        /// The first of them.
        first: String,
        /// Whether the day or the month stands first, where that matters.
        order: Option<DateOrder>,
        /// The zone that was said, if it was used: none for dates that have one of their own, and for times of day.
        zone: Option<String>,
    },
}

/// Order of the numbers in a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DateOrder {
    /// 20/03/2025.
    DayFirst,
    /// 03/20/2025.
    MonthFirst,
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.separator {
            Some('\t') => write!(f, "cells between tabs, ")?,
            Some(' ') => write!(f, "cells between spaces, ")?,
            Some(separator) => write!(f, "cells between \"{separator}\", ")?,
            None => write!(f, "{}, ", self.format)?,
        }
        if self.decimal_comma {
            write!(f, "decimal comma, ")?;
        }
        match self.preamble {
            0 => {}
            1 => write!(f, "1 line above the names, ")?,
            lines => write!(f, "{lines} lines above the names, ")?,
        }
        if self.units_row {
            write!(f, "a row of units, ")?;
        }
        if self.windows {
            write!(f, "letters of Windows-1252, ")?;
        }
        write!(f, "{}", self.time)?;
        for (signal, file, model) in &self.units {
            write!(f, "; `{signal}` in \"{file}\" taken as \"{model}\"")?;
        }
        for (signal, samples) in &self.filled {
            write!(f, "; `{signal}` filled in between {samples} samples")?;
        }
        match self.left_out {
            0 => Ok(()),
            1 => write!(f, "; 1 row left out at which it is not known"),
            rows => write!(f, "; {rows} rows left out at which it is not known"),
        }
    }
}

impl fmt::Display for TimeSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TimeSource::Even { step } => write!(f, "no column of time, {step} s per sample"),
            TimeSource::Numbers { column, unit, origin } => {
                write!(f, "time \"{column}\" in {}", unit_name(*unit))?;
                if *origin == 0.0 { Ok(()) } else { write!(f, ", from {origin}") }
            }
            TimeSource::Dates { column, first, order, zone } => {
                write!(f, "time \"{column}\": dates")?;
                match order {
                    Some(DateOrder::DayFirst) => write!(f, ", day first")?,
                    Some(DateOrder::MonthFirst) => write!(f, ", month first")?,
                    None => {}
                }
                if let Some(zone) = zone {
                    write!(f, ", in {zone}")?;
                }
                write!(f, ", from {first}")
            }
        }
    }
}

/// Units of time, their size (s) and how files write them, the first as it is shown.
const TIMES: [(f64, &[&str]); 7] = [
    (1.0, &["s", "sec", "secs", "second", "seconds", "sek", "sekunden"]),
    (1e-3, &["ms", "msec", "msecs", "millisecond", "milliseconds"]),
    (1e-6, &["us", "µs", "μs", "usec", "microsecond", "microseconds"]),
    (1e-9, &["ns", "nsec", "nanosecond", "nanoseconds"]),
    (60.0, &["min", "mins", "minute", "minutes", "minuten"]),
    (3600.0, &["h", "hr", "hrs", "hour", "hours", "std", "stunde", "stunden"]),
    (86_400.0, &["d", "day", "days", "tag", "tage"]),
];

/// A unit of time by one of its names.
pub(super) fn time_unit(text: &str) -> Option<TimeUnit> {
    let text = text.to_lowercase();
    let known = TIMES.iter().find(|(_, names)| names.contains(&text.as_str()));
    known.map(|(size, names)| TimeUnit::of_seconds(names[0], *size))
}

/// The unit of time of so many seconds.
pub(super) fn of_size(size: f64) -> Option<TimeUnit> {
    let known = TIMES.iter().find(|(known, _)| *known == size);
    known.map(|(size, names)| TimeUnit::of_seconds(names[0], *size))
}

fn unit_name(size: f64) -> String {
    of_size(size).map_or_else(|| format!("units of {size} s"), |unit| unit.name().to_owned())
}
