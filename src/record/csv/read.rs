//! Reading: cells become a record, one row after the other.

use super::table::Table;
use super::{Column, CsvFile};
use crate::error::Error;
use crate::interval::Hold;
use crate::layout::{Kind, Layout, Quantity};
use crate::record::{Channel, Clock, Holds, Initial, Record, Time};
use std::sync::Arc;

/// Where the number of one signal comes from.
#[derive(Clone, Copy, Debug, Default)]
struct SignalColumn {
    column: usize,
    factor: f64,
    offset: f64,
}

impl CsvFile {
    /// Reads a record of the inputs and outputs of a layout; it is named after the file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_record(&self, layout: &Layout) -> Result<Record, Error> {
        self.check(layout)?;
        let mut table = Table::open(self)?;
        let name = self.path.file_stem().map_or("record".into(), |stem| stem.to_string_lossy().into_owned());

        // A static model needs no time: without one its rows are numbered.
        let timed =
            self.columns.iter().any(|column| column.signal == "t") || table.names().iter().any(|name| name == "t");
        let sample_time = self.sample_time.or((layout.kind == Kind::Static && !timed).then_some(1.0));
        let t = if sample_time.is_none() { Some(self.source(&table, "t")?) } else { None };
        let signals: Vec<&Quantity> = layout.inputs.iter().chain(&layout.outputs).collect();
        let sources = signals.iter().map(|signal| self.source(&table, &signal.name)).collect::<Result<Vec<_>, _>>()?;

        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); signals.len()];
        let mut clock = Clock::default();
        // A pipe cannot be read again, so that its stamps are kept until the end.
        let mut stamps = if self.path.is_file() { None } else { Some(Vec::new()) };
        let mut sample = 0;
        while table.next()? {
            let mut time = sample as f64 * sample_time.unwrap_or_default();
            if let Some(t) = t {
                let Some(stamp) = self.value(&table, t).filter(|stamp| stamp.is_finite()) else {
                    return Err(self.bad_cell(&table, t, &name, "t", sample, f64::NAN));
                };
                time = stamp;
                if let Some(before) = clock.last().filter(|before| time < *before) {
                    let problem = Error::TimeOrder { experiment: name, sample, before, time };
                    return Err(self.at_line(&table, problem));
                }
                let even = clock.tick(time);
                if let Some(stamps) = &mut stamps {
                    stamps.push(time);
                } else if !even {
                    let mut all = self.stamps(t, sample)?;
                    all.push(time);
                    stamps = Some(all);
                }
            }
            for (i, (column, source)) in columns.iter_mut().zip(&sources).enumerate() {
                let value = self.value(&table, *source);
                // An output may be missing, an input may not.
                let good = |value: &f64| if i < layout.inputs.len() { value.is_finite() } else { !value.is_infinite() };
                let Some(value) = value.filter(good) else {
                    return Err(self.bad_cell(&table, *source, &name, &signals[i].name, sample, time));
                };
                column.push(value);
            }
            sample += 1;
        }
        let time = match sample_time {
            Some(step) => Time::Uniform { start: 0.0, step },
            None => match clock.uniform() {
                Some(uniform) => uniform,
                // No step at all was found: all stamps are alike.
                None => Time::Stamps(stamps.unwrap_or_else(|| clock.last().into_iter().cycle().take(sample).collect())),
            },
        };
        let named = |(values, signal): (Vec<f64>, &&Quantity)| {
            let mut values = values;
            values.shrink_to_fit();
            Channel::new(&signal.name, &signal.unit, values)
        };
        let mut inputs: Vec<Channel> = columns.into_iter().zip(&signals).map(named).collect();
        let outputs = inputs.split_off(layout.inputs.len());
        let (states, inputs, outputs) = (layout.states.clone().into(), inputs.into(), outputs.into());
        let (holds, initial) = (Holds::All(Hold::default()), Initial::default());
        Record { name, states, time, inputs, outputs, holds, initial, looked: Arc::default() }.checked()
    }

    /// The time stamps of the first rows, for a clock that turned out uneven.
    fn stamps(&self, t: SignalColumn, rows: usize) -> Result<Vec<f64>, Error> {
        let mut table = Table::open(self)?;
        let mut stamps = Vec::with_capacity(rows + 1);
        while stamps.len() < rows && table.next()? {
            stamps.extend(self.value(&table, t));
        }
        Ok(stamps)
    }

    /// Refuses what makes no sense whatever the file holds.
    fn check(&self, layout: &Layout) -> Result<(), Error> {
        let signals = layout.inputs.iter().chain(&layout.outputs).map(|signal| signal.name.as_str());
        let known = || signals.clone().chain(["t"]);
        for Column { signal, factor, offset, .. } in &self.columns {
            if !known().any(|name| name == signal) {
                let available = known().map(|name| (*name).to_owned()).collect();
                return Err(Error::UnknownSignal { signal: signal.clone(), available });
            }
            if !(*factor > 0.0 && factor.is_finite()) {
                let what = format!("the factor of `{signal}` (CsvFile::reversed turns a sign)");
                return Err(Error::NotPositive { what, value: *factor });
            }
            if !offset.is_finite() {
                return Err(Error::Option(format!("the offset of `{signal}` is {offset}; it must be finite")));
            }
        }
        match self.sample_time {
            Some(value) if !(value > 0.0 && value.is_finite()) => {
                Err(Error::NotPositive { what: "CsvFile::sample_time".to_owned(), value })
            }
            _ => Ok(()),
        }
    }

    fn said(&self, signal: &str) -> Column {
        self.columns.iter().find(|column| column.signal == signal).cloned().unwrap_or_else(|| Column::new(signal))
    }

    fn source(&self, table: &Table, signal: &str) -> Result<SignalColumn, Error> {
        let said = self.said(signal);
        let mut places = table.names().iter().enumerate().filter(|(_, name)| **name == said.name).map(|(at, _)| at);
        let (path, column) = (self.path.clone(), said.name.clone());
        let Some(at) = places.next() else {
            let available = table.names().to_vec();
            return Err(Error::MissingColumn { path, column, signal: signal.to_owned(), available });
        };
        if let Some(again) = places.next() {
            return Err(Error::AmbiguousColumn { path, column, first: at + 1, second: again + 1 });
        }
        let factor = if said.reversed { -said.factor } else { said.factor };
        Ok(SignalColumn { column: at, factor, offset: said.offset })
    }

    /// The value of a signal in the current row; NaN where missing, none where its cell is no number.
    #[inline]
    fn value(&self, table: &Table, source: SignalColumn) -> Option<f64> {
        Some(self.number(table.cell(source.column))? * source.factor + source.offset)
    }

    /// The number in a cell: NaN where it says that nothing was measured.
    #[inline]
    pub(super) fn number(&self, cell: &[u8]) -> Option<f64> {
        let mut text = [0; 64];
        let mut plain = cell;
        if self.decimal_comma {
            let text = text.get_mut(..cell.len())?;
            for (to, &from) in text.iter_mut().zip(cell) {
                *to = if from == b',' { b'.' } else { from };
            }
            plain = text;
        }
        let number = std::str::from_utf8(plain).ok()?.parse().ok();
        let missing = || [&b""[..], b"na", b"null"].iter().any(|word| cell.eq_ignore_ascii_case(word));
        number.or_else(|| missing().then_some(f64::NAN))
    }

    /// The error of a cell that is no number, or not a finite one.
    #[cold]
    fn bad_cell(
        &self,
        table: &Table,
        source: SignalColumn,
        name: &str,
        signal: &str,
        sample: usize,
        time: f64,
    ) -> Error {
        let Some(value) = self.value(table, source) else {
            let (path, line, column) = (self.path.clone(), table.line(), table.names()[source.column].clone());
            let text = String::from_utf8_lossy(table.cell(source.column)).into_owned();
            return Error::NotANumber { path, line, column, text };
        };
        let (experiment, signal) = (name.to_owned(), signal.to_owned());
        self.at_line(table, Error::NotFinite { experiment, signal, value, sample, time })
    }

    fn at_line(&self, table: &Table, problem: Error) -> Error {
        Error::AtLine { path: self.path.clone(), line: table.line(), problem: Box::new(problem) }
    }
}
