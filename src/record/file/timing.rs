//! [`Timing`]: the time of each row, from a column of numbers, from one of dates, or from a constant step.

use super::bytes::decoded;
use super::dates::Dates;
use super::guess::{over_unit, split_unit};
use super::numbers::Numbers;
use super::reading::{of_size, time_unit};
use super::stamp::Stamp;
use super::table::Table;
use super::{Column, DataFile, TimeSource};
use crate::error::Error;
use crate::numeral::{Moment, TimeUnit};
use crate::record::{Clock, Time};
use jiff::tz::TimeZone;

/// Names of columns of time, without spaces and in small letters.
const NAMES: [&str; 9] =
    ["time", "timestamp", "datetime", "dateandtime", "zeit", "zeitstempel", "uhrzeit", "elapsedtime", "temps"];
/// Names of columns of dates.
const DATES: [&str; 2] = ["date", "datum"];

/// What stands where a unit would, and is none.
const NO_UNITS: [&str; 5] = ["", "utc", "gmt", "local", "unix"];

/// Numbers beyond these are no seconds: milliseconds, microseconds and nanoseconds since 1970.
const SINCE_1970: [(f64, f64); 3] = [(1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)];

/// From here on not every whole number is one of `f64`.
const ROUNDED: f64 = 9_007_199_254_740_992.0;

/// The time of the rows so far.
pub(super) enum Timing {
    /// A constant step (s).
    Even(f64),
    /// A constant step (s) that was said, and what a column says of the time.
    Said { step: f64, beside: Box<Timing> },
    /// A column of numbers.
    Numbers { ticks: Ticks, clock: Clock, stamps: Option<Vec<f64>> },
    /// A column of dates, and a second one of the times of day.
    Dates { column: usize, date: Option<usize>, dates: Box<Dates>, first: String },
}

/// How numbers become seconds.
#[derive(Clone)]
pub(super) struct Ticks {
    pub(super) column: usize,
    pub(super) unit: f64,
    /// The unit in which they are shown.
    pub(super) shown: TimeUnit,
    offset: f64,
    pub(super) origin: f64,
    /// The origin, if that is a whole number: as `f64` one of nanoseconds since 1970 is rounded to 256.
    whole: Option<i64>,
}

impl Ticks {
    pub(super) fn time(&self, count: Count) -> f64 {
        let since = match (count, self.whole) {
            (Count::Whole(count), Some(origin)) => (i128::from(count) - i128::from(origin)) as f64,
            _ => count.number() - self.origin,
        };
        since * self.unit + self.offset
    }
}

/// A number in a column of time.
#[derive(Clone, Copy)]
pub(super) enum Count {
    Number(f64),
    Whole(i64),
}

impl Count {
    /// In a cell of a text that is this number.
    fn read(cell: &[u8], number: f64) -> Count {
        let large = number.abs() >= ROUNDED;
        let whole = large.then(|| std::str::from_utf8(cell).ok()?.trim().parse().ok()).flatten();
        whole.map_or(Count::Number(number), Count::Whole)
    }

    fn number(self) -> f64 {
        match self {
            Count::Number(number) => number,
            Count::Whole(count) => count as f64,
        }
    }
}

/// The name of a column without spaces and large letters.
fn plain(name: &str) -> String {
    name.to_lowercase().replace([' ', '_', '-'], "")
}

/// The name and the unit of time over which it stands: `t / ms`.
fn over_time(name: &str) -> Option<(&str, &str)> {
    over_unit(name).filter(|(_, unit)| time_unit(unit).is_some())
}

/// Whether a column of this name may be that of the time.
pub(super) fn tells_time(name: &str) -> bool {
    let is_known = |name: &str| {
        let plain = plain(name);
        name == "t" || NAMES.contains(&plain.as_str()) || DATES.contains(&plain.as_str())
    };
    is_known(split_unit(name).0)
        || over_time(name).is_some_and(|(name, _)| is_known(name))
        || suffix(name, false).is_some()
}

/// Whether a column of this name has dates, which may be without times of day.
pub(super) fn tells_date(name: &str) -> bool {
    DATES.contains(&plain(split_unit(name).0).as_str())
}

/// Whether a number is a date and a time of day, digit by digit: 20250320140500, without seconds or with milliseconds. As milliseconds or microseconds
/// since 1970 these would be years to come, or of twelve digits the 1970s.
fn is_compact(number: f64) -> bool {
    let digits = format!("{number:.0}");
    let part = |at: std::ops::Range<usize>, within: std::ops::RangeInclusive<u32>| {
        digits.get(at).and_then(|text| text.parse().ok()).is_some_and(|part| within.contains(&part))
    };
    matches!(digits.len(), 12 | 14 | 17)
        && part(0..4, 1980..=2099)
        && part(4..6, 1..=12)
        && part(6..8, 1..=31)
        && part(8..10, 0..=23)
        && part(10..12, 0..=59)
}

impl DataFile {
    /// The column of time: the one that was said, `t`, or the only one of such a name; none of these places, which hold signals.
    ///
    /// # Errors
    /// No such column, or several.
    pub(super) fn time_column(&self, names: &[String], taken: &[usize]) -> Result<usize, Error> {
        let is_free = |at: &usize| !taken.contains(at);
        let are = |is: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..names.len()).filter(|at| is_free(at) && is(&names[*at])).collect()
        };
        let called = |list: &[&str]| are(&|name| list.contains(&plain(split_unit(name).0).as_str()));
        let over = || are(&|name| over_time(name).is_some_and(|(name, _)| NAMES.contains(&plain(name).as_str())));
        let found = self.place(names, "t");
        if found.as_ref().is_ok_and(is_free) || self.said("t").name.is_some() {
            return found;
        }
        // Units stand behind an underscore, too.
        let with_unit = || are(&|name| suffix(name, false).is_some());
        for found in [called(&NAMES), over(), with_unit(), called(&DATES)] {
            if let [only] = found[..] {
                return Ok(only);
            }
        }
        // Unnamed, as pandas writes an index.
        if names.first().is_some_and(String::is_empty) {
            return Ok(0);
        }
        match taken.iter().find(|at| tells_time(&names[**at])) {
            Some(at) => Err(self.cannot(format!(
                "column `{}` holds a signal of the model, so that it is not the time, and no other column is: say which one holds the time by \
                 DataFile::column, or give DataFile::sample_time",
                names[*at]
            ))),
            None => found,
        }
    }

    /// How the numbers of a column of time become seconds, as its first number, its name and the unit below it say; none where they are
    /// numbers of rows.
    ///
    /// # Errors
    /// Numbers of rows in place of a column of time that is wanted.
    pub(super) fn ticks(
        &self,
        names: &[String],
        below: Option<&str>,
        column: usize,
        first: Count,
    ) -> Result<Option<Ticks>, Error> {
        let number = first.number();
        let (name, said) = (&names[column], self.said("t"));
        if name.is_empty() && said.name.is_none() {
            return self.place(names, "t").map(|_| None);
        }
        let written = said
            .unit
            .as_deref()
            .or(split_unit(name).1)
            .or_else(|| over_time(name).map(|(_, unit)| unit))
            .or_else(|| suffix(name, said.name.is_some()))
            .or(below)
            .map(str::trim);
        let written = written.filter(|text| !NO_UNITS.contains(&text.to_lowercase().as_str()));
        let named = written.and_then(time_unit);
        let remedy = "say how many seconds one is by DataFile::factor(\"t\", ..)";
        if let (Some(text), None, None) = (written, &named, said.factor) {
            return Err(
                self.cannot(format!("column `{name}` has times in `{text}`, no unit of time that is known: {remedy}"))
            );
        }
        if said.factor.is_none() && (is_compact(number) || named.is_none() && DATES.contains(&plain(name).as_str())) {
            return Err(self.cannot(format!(
                "column `{name}` has dates that are written as numbers ({number}): write them as 2025-03-20 14:05:00, or, if they are a count, {remedy}"
            )));
        }
        self.no_dates(name)?;
        let unit = said.factor.or_else(|| named.as_ref().map(TimeUnit::seconds));
        // A unit that is named says the same of numbers of that size.
        let is_unit = |one: f64| unit.is_none_or(|unit| said.factor.is_none() && (unit / one - 1.0).abs() < 1e-9);
        let long_ago = SINCE_1970.iter().find(|(least, one)| number.abs() >= *least && is_unit(*one));
        let (unit, origin) = long_ago.map_or((unit.unwrap_or(1.0), 0.0), |(_, unit)| (*unit, number));
        let whole = if let Count::Whole(first) = first { Some(first).filter(|_| origin != 0.0) } else { None };
        let shown = shown(named, unit);
        let unit = if said.reversed { -unit } else { unit };
        Ok(Some(Ticks { column, unit, shown, offset: said.offset, origin, whole }))
    }

    /// Refuses what was said of dates, of a column of time that has none.
    pub(super) fn no_dates(&self, column: &str) -> Result<(), Error> {
        let said = self.zone.as_ref().map(|_| "DataFile::zone").or(self.dates.map(|_| "DataFile::dates"));
        let refused = |option| {
            Err(Error::Option(format!(
                "column `{column}` has times that are no dates, so that {option} has no effect: leave it out"
            )))
        };
        said.map_or(Ok(()), refused)
    }

    /// Refuses what was said of numbers, of a column of time that has dates or times of day.
    fn no_numbers(&self, column: &str) -> Result<(), Error> {
        let said = self.said("t");
        let option = match &said {
            Column { factor: Some(factor), .. } if *factor != 1.0 => "DataFile::factor",
            Column { unit: Some(_), .. } => "DataFile::unit",
            Column { reversed: true, .. } => "DataFile::reversed",
            Column { offset, .. } if *offset != 0.0 => "DataFile::offset",
            _ => return Ok(()),
        };
        Err(Error::Option(format!(
            "column `{column}` has dates or times of day, whose unit is known, so that {option} of `t` has no effect: leave it out"
        )))
    }

    /// Dates in a column, in the order and the zone that were said.
    pub(super) fn dates_of(&self, column: &str) -> Result<Dates, Error> {
        self.no_numbers(column)?;
        let zone = self.zone.as_ref().map(|zone| {
            TimeZone::get(zone).map_err(|error| Error::Option(format!("DataFile::zone(\"{zone}\"): {error}")))
        });
        Ok(Dates::new(self.dates, zone.transpose()?))
    }

    /// Looks at the first row of a record. Its stamps are `kept` where they cannot be read again.
    pub(super) fn timing(
        &self,
        table: &Table,
        numbers: &mut Numbers,
        column: usize,
        kept: bool,
    ) -> Result<Timing, Error> {
        let found = self.timing_in(table, numbers, column, kept);
        let Some(step) = self.sample_time else { return found };
        Ok(found.map_or(Timing::Even(step), |beside| Timing::Said { step, beside: Box::new(beside) }))
    }

    /// The time in a column.
    fn timing_in(&self, table: &Table, numbers: &mut Numbers, column: usize, kept: bool) -> Result<Timing, Error> {
        let cell = table.cell(column);
        if let Some(number) = numbers.read(cell) {
            let Some(ticks) =
                self.ticks(table.names(), table.form().unit(column), column, Count::read(cell, number))?
            else {
                return Ok(Timing::Even(1.0));
            };
            // A pipe cannot be read again.
            let stamps = if kept || !self.path.is_file() { Some(Vec::new()) } else { None };
            return Ok(Timing::Numbers { ticks, clock: Clock::default(), stamps });
        }
        let text = decoded(cell).into_owned();
        let dates = Box::new(match Stamp::read(&text) {
            Some(_) => self.dates_of(&table.names()[column])?,
            // No date either; the first row says so.
            None => Dates::new(None, None),
        });
        let mut date = None;
        if !matches!(Stamp::read(&text), Some(Stamp::Instant(_) | Stamp::Local(_))) {
            let is_date = |at: &usize| {
                let name = table.names()[*at].to_lowercase();
                let cell = decoded(table.cell(*at));
                DATES.contains(&name.as_str()) && matches!(Stamp::read(&cell), Some(Stamp::Local(_)))
            };
            date = (0..table.names().len()).find(is_date);
        }
        Ok(Timing::Dates { column, date, dates, first: String::new() })
    }
}

/// The unit in which times are shown that were multiplied by `factor`: the one that the file names, if it is of that size or they were not
/// converted; else the one of that size, or seconds.
fn shown(named: Option<TimeUnit>, factor: f64) -> TimeUnit {
    match named {
        Some(named) if named.seconds() == factor => named,
        Some(named) if factor == 1.0 => TimeUnit::of_model(named.name()),
        _ => of_size(factor).unwrap_or_default(),
    }
}

/// A unit of time behind the name of a column of time: `time_ms`, `time ms`; of any name, where it was said that it is the column of time.
fn suffix(name: &str, is_time: bool) -> Option<&str> {
    let (before, unit) = name.rsplit_once(['_', ' '])?;
    let before = plain(before);
    (time_unit(unit).is_some() && (is_time || before == "t" || NAMES.contains(&before.as_str()))).then_some(unit)
}

impl Timing {
    /// The unit in which the times are shown.
    pub(super) fn unit(&self) -> TimeUnit {
        match self {
            Timing::Numbers { ticks, .. } => ticks.shown.clone(),
            _ => TimeUnit::default(),
        }
    }

    /// The time of the current row (s); zero for a date, whose column is read whole.
    pub(super) fn tick(
        &mut self,
        file: &DataFile,
        table: &Table,
        numbers: &mut Numbers,
        sample: usize,
    ) -> Result<f64, Error> {
        match self {
            Timing::Even(step) => Ok(sample as f64 * *step),
            Timing::Said { step, beside } => {
                let step = *step;
                if let Err(error) = beside.tick(file, table, numbers, sample) {
                    beside.check_order(file, table, step, error)?;
                    // What cannot be read tells no time.
                    *self = Timing::Even(step);
                }
                Ok(sample as f64 * step)
            }
            Timing::Numbers { ticks, clock, stamps } => {
                let cell = table.cell(ticks.column);
                let number = numbers.read(cell).map(|number| ticks.time(Count::read(cell, number)));
                let Some(time) = number.filter(|time| time.is_finite()) else {
                    let time = Moment { time: f64::NAN, unit: ticks.shown.clone() };
                    return Err(file.bad_cell(table, ticks.column, number, "t", sample, time));
                };
                if let Some(before) = clock.last().filter(|before| time < *before) {
                    let [before, time] = [before, time].map(|time| Moment { time, unit: ticks.shown.clone() });
                    let problem = Error::TimeOrder { experiment: file.name(), sample, before, time };
                    return Err(file.at_line(table, problem));
                }
                let even = clock.tick(time);
                if let Some(stamps) = stamps {
                    stamps.push(time);
                } else if !even {
                    let mut all = stamps_of(file, table, numbers, ticks, sample)?;
                    all.push(time);
                    *stamps = Some(all);
                }
                Ok(time)
            }
            Timing::Dates { column, date, dates, first } => {
                let cell = |at: usize| decoded(table.cell(at));
                let text = match date {
                    Some(date) => format!("{} {}", cell(*date), cell(*column)),
                    None => cell(*column).into_owned(),
                };
                let Some(stamp) = Stamp::read(&text) else {
                    return Err(file.bad_cell(table, *column, None, "t", sample, f64::NAN.into()));
                };
                let more = dates.push(stamp, &text, table.line());
                if sample == 0 {
                    *first = text;
                }
                if more { Ok(0.0) } else { Err(self.fault(file, table)) }
            }
        }
    }

    /// The fault of dates that cannot be read on.
    #[cold]
    fn fault(&mut self, file: &DataFile, table: &Table) -> Error {
        match std::mem::replace(self, Timing::Even(1.0)).finish(file, table, 0) {
            Err(error) => error,
            Ok(_) => file.cannot("its dates cannot be read"),
        }
    }

    /// The times of all rows, and where they are from.
    pub(super) fn finish(self, file: &DataFile, table: &Table, rows: usize) -> Result<(Time, TimeSource), Error> {
        let name = |column: usize| table.names()[column].clone();
        match self {
            Timing::Even(step) => Ok((Time::Uniform { start: 0.0, step }, TimeSource::Even { step })),
            Timing::Said { step, beside } => {
                if let Ok((time, source)) = beside.finish(file, table, rows) {
                    file.agree(step, &time, &source)?;
                }
                Timing::Even(step).finish(file, table, rows)
            }
            Timing::Numbers { ticks: Ticks { column, unit, origin, .. }, clock, stamps } => {
                let time = clock.uniform().unwrap_or_else(|| {
                    Time::Stamps(stamps.unwrap_or_else(|| clock.last().into_iter().cycle().take(rows).collect()))
                });
                Ok((time, TimeSource::Numbers { column: name(column), unit, origin }))
            }
            Timing::Dates { column, dates, first, .. } => {
                let zone = file.zone.clone().filter(|_| dates.in_zone());
                let (seconds, order) = dates.finish().map_err(|fault| Error::Dates {
                    path: file.path.clone(),
                    line: fault.line,
                    column: name(column),
                    text: fault.text,
                    problem: fault.problem,
                })?;
                let source = TimeSource::Dates { column: name(column), first, order, zone };
                Ok((Time::from_stamps(seconds), source))
            }
        }
    }
}

/// The time stamps of the first rows, for a clock that turned out uneven.
fn stamps_of(file: &DataFile, table: &Table, numbers: &Numbers, ticks: &Ticks, rows: usize) -> Result<Vec<f64>, Error> {
    let (mut table, mut numbers) = (table.again(file)?, numbers.clone());
    let mut stamps = Vec::with_capacity(rows + 1);
    while stamps.len() < rows && table.next()? {
        let cell = table.cell(ticks.column);
        stamps.extend(numbers.read(cell).map(|number| ticks.time(Count::read(cell, number))));
    }
    Ok(stamps)
}
