//! The time of a record from a column of numbers, lengths of time, times of day, dates or texts.

use super::super::read::Plan;
use super::super::stamp::Stamp;
use super::super::timing::Count;
use super::super::{DataFile, Fault, TimeSource};
use super::{Cells, Columns};
use crate::error::Error;
use crate::numeral::TimeUnit;
use crate::record::Time;
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};

/// Times (s), the unit in which they are shown, and where they are from.
type Times = ((Time, TimeUnit), TimeSource);

/// Times of an even step (s).
fn even(step: f64) -> Times {
    ((Time::Uniform { start: 0.0, step }, TimeUnit::default()), TimeSource::Even { step })
}

impl DataFile {
    /// The times of the rows, or of some of them (s), the unit in which they are shown, and where they are from.
    pub(super) fn column_times(
        &self,
        plan: &Plan,
        file: &dyn Columns,
        cells: &[Cells],
        rows: Option<&[usize]>,
    ) -> Result<Times, Error> {
        let (Some(at), Some(cells)) = (plan.time, cells.get(plan.sources.len())) else { return Ok(even(plan.step)) };
        let found = self.times_in(at, file, cells, rows);
        let Some(step) = self.sample_time else { return found };
        if let Ok(((time, _), source)) = &found {
            self.agree(step, time, source)?;
        }
        Ok(even(step))
    }

    /// The times in a column.
    fn times_in(&self, at: usize, file: &dyn Columns, cells: &Cells, rows: Option<&[usize]>) -> Result<Times, Error> {
        let seconds = TimeUnit::default;
        let row = |sample: usize| rows.map_or(sample, |rows| rows[sample]);
        let samples = rows.map_or(cells.len(), <[usize]>::len);
        let column = file.names()[at].clone();
        match cells {
            Cells::Numbers(numbers) => self.counted(at, file, samples, |sample| Count::Number(numbers[row(sample)])),
            Cells::Whole(counts) => {
                let none = Count::Number(f64::NAN);
                self.counted(at, file, samples, |sample| counts[row(sample)].map_or(none, Count::Whole))
            }
            Cells::Seconds(lengths) => {
                let said = self.said("t");
                let what = said.factor.filter(|factor| *factor != 1.0).map(|_| "factor");
                if let Some(what) = what.or(said.unit.as_ref().map(|_| "unit")) {
                    let held = format!("`{column}` holds lengths of time, whose unit is known");
                    return Err(Error::Option(format!("the {what} of `t`: column {held}; give none")));
                }
                self.no_dates(&column)?;
                let sign = if said.reversed { -1.0 } else { 1.0 };
                let stamps = (0..samples).map(|sample| sign * lengths[row(sample)] + said.offset).collect();
                Ok(((Time::from_stamps(stamps), seconds()), TimeSource::Numbers { column, unit: 1.0, origin: 0.0 }))
            }
            Cells::Clocks(clocks) => {
                let stamp = |sample| Some(Stamp::Clock(clocks[row(sample)]? as f64 / 1e9));
                let passed = |sample| clocks[row(sample)].map(SignedDuration::from_nanos);
                let text = |sample| Some(jiff::civil::Time::midnight().wrapping_add(passed(sample)?).to_string());
                self.stamps(column, samples, stamp, text)
            }
            Cells::Instants { nanoseconds, universal } => {
                let of = |sample| nanoseconds[row(sample)].and_then(|nanoseconds| instant(nanoseconds, *universal));
                self.stamps(column, samples, |sample| Some(of(sample)?.0), |sample| of(sample).map(|(_, text)| text()))
            }
            Cells::Texts(texts) => {
                let text = |sample| texts[row(sample)].clone();
                self.stamps(column, samples, |sample| Stamp::read(&texts[row(sample)]), |sample| Some(text(sample)))
            }
        }
    }

    /// The times of the numbers of samples.
    fn counted(
        &self,
        at: usize,
        file: &dyn Columns,
        samples: usize,
        count: impl Fn(usize) -> Count,
    ) -> Result<Times, Error> {
        let first = if samples == 0 { Count::Number(0.0) } else { count(0) };
        let Some(ticks) = self.ticks(file.names(), file.unit(at), at, first)? else { return Ok(even(1.0)) };
        let stamps = (0..samples).map(|sample| ticks.time(count(sample))).collect();
        let source = TimeSource::Numbers { column: file.names()[at].clone(), unit: ticks.unit, origin: ticks.origin };
        Ok(((Time::from_stamps(stamps), ticks.shown), source))
    }

    /// The times of the dates of samples, which have these stamps and texts.
    fn stamps(
        &self,
        column: String,
        samples: usize,
        stamp: impl Fn(usize) -> Option<Stamp>,
        text: impl Fn(usize) -> Option<String>,
    ) -> Result<Times, Error> {
        let mut dates = self.dates_of(&column)?;
        for sample in 0..samples {
            let Some(stamp) = stamp(sample) else {
                let text = text(sample).map_or("nothing".to_owned(), |text| format!("`{text}`"));
                return Err(self.wrong_kind(&column, format!("{text} in sample {sample}"), "dates"));
            };
            if !dates.push(stamp, "", sample as u64 + 1) {
                break;
            }
        }
        let zone = self.zone.clone().filter(|_| dates.in_zone());
        let (seconds, order) = dates.finish().map_err(|Fault { line, problem, .. }| {
            // Samples are counted from zero. A fault of no single one has no line.
            let at = line.checked_sub(1).map(|sample| (sample, text(sample as usize).unwrap_or_default()));
            let problem = at.map_or(problem.clone(), |(sample, text)| format!("sample {sample}, `{text}`, {problem}"));
            Error::Dates { path: self.path.clone(), line: 0, column: column.clone(), text: String::new(), problem }
        })?;
        let first = if samples == 0 { String::new() } else { text(0).unwrap_or_default() };
        let time = (Time::from_stamps(seconds), TimeUnit::default());
        Ok((time, TimeSource::Dates { column, first, order, zone }))
    }
}

/// A date and its text; none beyond the years that dates have.
fn instant(nanoseconds: i64, universal: bool) -> Option<(Stamp, impl Fn() -> String)> {
    let instant = Timestamp::from_nanosecond(nanoseconds.into()).ok()?;
    let local = TimeZone::UTC.to_datetime(instant);
    let stamp = if universal { Stamp::Instant(instant) } else { Stamp::Local([Some(local); 2]) };
    Some((stamp, move || if universal { instant.to_string() } else { local.to_string() }))
}
