//! A column of time beside a sample time that was said: it must say the same.

use super::table::Table;
use super::timing::{Timing, tells_date};
use super::{DataFile, TimeSource};
use crate::error::Error;
use crate::numeral::number;
use crate::record::Time;

/// The part of a sample time by which times of a column may differ from it, as rounded ones do.
const SAME: f64 = 0.01;

impl DataFile {
    /// The column of time beside a sample time, if there is one: none whose rows are of one day, and none of these places, which hold signals.
    pub(super) fn beside(&self, names: &[String], taken: &[usize]) -> Option<usize> {
        let found = self.time_column(names, taken).ok()?;
        Some(found).filter(|at| !names[*at].is_empty() && !tells_date(&names[*at]))
    }

    /// Refuses times of a column that are not so many seconds apart; those that are no numbers say nothing.
    pub(super) fn agree(&self, step: f64, time: &Time, source: &TimeSource) -> Result<(), Error> {
        let (TimeSource::Numbers { column, .. } | TimeSource::Dates { column, .. }) = source else { return Ok(()) };
        let between = match time {
            Time::Uniform { step, .. } => vec![*step],
            Time::Stamps(stamps) => stamps.windows(2).map(|pair| pair[1] - pair[0]).collect(),
        };
        let other = between.into_iter().find(|between| (between - step).abs() > SAME * step);
        other.map_or(Ok(()), |other| Err(self.two_times(step, column, other)))
    }

    /// The error of a column whose times are so many seconds apart somewhere.
    pub(super) fn two_times(&self, step: f64, column: &str, between: f64) -> Error {
        self.cannot(format!(
            "DataFile::sample_time of {step} s and column `{column}`, where {} s lie between samples, both give the time: leave the sample time out, \
             or take the column out of the file",
            number(between, 6)
        ))
    }
}

impl Timing {
    /// Refuses a column of numbers that goes back in time; one with another error tells no time.
    pub(super) fn check_order(&self, file: &DataFile, table: &Table, step: f64, error: Error) -> Result<(), Error> {
        if let (Timing::Numbers { ticks, .. }, Error::AtLine { problem, .. }) = (self, error)
            && let Error::TimeOrder { before, time, .. } = *problem
        {
            return Err(file.two_times(step, &table.names()[ticks.column], time.time - before.time));
        }
        Ok(())
    }
}
