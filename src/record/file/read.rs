//! Reading: cells become a record, one row after the other.

use super::guess::{names, split_unit};
use super::numbers::Numbers;
use super::table::Table;
use super::timing::Timing;
use super::{Column, DataFile, Reading, reading};
use crate::error::Error;
use crate::interval::Hold;
use crate::layout::{Kind, Layout, Quantity};
use crate::numeral::Moment;
use crate::record::{Channel, Holds, Initial, Record};
use std::sync::Arc;

/// Where the number of one signal comes from.
#[derive(Clone, Copy, Debug)]
struct Source {
    column: usize,
    factor: f64,
    offset: f64,
}

impl DataFile {
    /// Reads a record of the inputs and outputs of a layout; it is named after the file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_record(&self, layout: &Layout) -> Result<Record, Error> {
        self.check(layout)?;
        let signals: Vec<&Quantity> = layout.inputs.iter().chain(&layout.outputs).collect();
        let said: Vec<Column> = signals.iter().map(|signal| self.said(&signal.name)).collect();
        let t = self.said("t");
        let wanted: Vec<&str> = said.iter().map(Column::name).chain(t.name.as_deref()).collect();
        let mut table = Table::open(self, &wanted)?;
        let mut numbers = Numbers::new(self.decimal_comma.then_some(true), table.form().separator);

        // A static model needs no time: without one its rows are numbered.
        let timed = t.name.is_some() || self.columns.iter().any(|column| column.signal == "t") || table.has("t");
        let step = self.sample_time.or((layout.kind == Kind::Static && !timed).then_some(1.0));
        let column = if step.is_none() { Some(self.time_column(&table)?) } else { None };
        let mut units = Vec::new();
        let sources = signals.iter().zip(&said);
        let sources = sources
            .map(|(signal, said)| self.source(&table, signal, said, &mut units))
            .collect::<Result<Vec<_>, _>>()?;

        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); signals.len()];
        let mut timing = Timing::Even(step.unwrap_or(1.0));
        let mut sample = 0;
        while table.next()? {
            if let (0, Some(column)) = (sample, column) {
                timing = self.timing(&table, &mut numbers, column)?;
            }
            let time = timing.tick(self, &table, &mut numbers, sample)?;
            for (i, (column, source)) in columns.iter_mut().zip(&sources).enumerate() {
                let number = numbers.read(table.cell(source.column));
                let value = number.map(|number| number * source.factor + source.offset);
                // An output may be missing, an input may not.
                let good = |value: &f64| if i < layout.inputs.len() { value.is_finite() } else { !value.is_infinite() };
                let Some(value) = value.filter(good) else {
                    let time = Moment { time, unit: timing.unit() };
                    return Err(self.bad_cell(&table, source.column, value, &signals[i].name, sample, time));
                };
                column.push(value);
            }
            sample += 1;
        }
        let time_unit = timing.unit();
        let (time, source) = timing.finish(self, &table, sample)?;
        let form = table.form();
        let reading = Reading {
            separator: Some(form.separator.into()),
            decimal_comma: numbers.comma(),
            preamble: form.preamble as u64,
            units_row: form.units.is_some(),
            time: source,
            units,
        };
        let named = |(values, signal): (Vec<f64>, &&Quantity)| {
            let mut values = values;
            values.shrink_to_fit();
            Channel::new(&signal.name, &signal.unit, values)
        };
        let mut inputs: Vec<Channel> = columns.into_iter().zip(&signals).map(named).collect();
        let outputs = inputs.split_off(layout.inputs.len());
        let (states, inputs, outputs) = (layout.states.clone().into(), inputs.into(), outputs.into());
        let (name, holds, initial) = (self.name(), Holds::All(Hold::default()), Initial::default());
        let (reading, looked) = (Some(Arc::new(reading)), Arc::default());
        Record { name, states, time, time_unit, inputs, outputs, holds, initial, reading, looked }.checked()
    }

    /// The record's name: the file's.
    pub(super) fn name(&self) -> String {
        self.path.file_stem().map_or("record".into(), |stem| stem.to_string_lossy().into_owned())
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
            if let Some(value) = factor.filter(|factor| !(*factor > 0.0 && factor.is_finite())) {
                let what = format!("the factor of `{signal}` (DataFile::reversed turns a sign)");
                return Err(Error::NotPositive { what, value });
            }
            if !offset.is_finite() {
                return Err(Error::Option(format!("the offset of `{signal}` is {offset}; it must be finite")));
            }
        }
        match self.sample_time {
            Some(value) if !(value > 0.0 && value.is_finite()) => {
                Err(Error::NotPositive { what: "DataFile::sample_time".to_owned(), value })
            }
            _ => Ok(()),
        }
    }

    /// The place of a signal's column: the one of its name, else the one of its name with a unit.
    pub(super) fn place(&self, columns: &[String], signal: &str) -> Result<usize, Error> {
        let said = self.said(signal);
        let (path, column) = (self.path.clone(), said.name().to_owned());
        let exact = |name: &&String| **name == column;
        let like = |name: &&String| names(name, &column);
        let places = |is: &dyn Fn(&&String) -> bool| -> Vec<usize> {
            columns.iter().enumerate().filter(|(_, name)| is(name)).map(|(at, _)| at).collect()
        };
        let exact = places(&exact);
        match if exact.is_empty() { places(&like) } else { exact }[..] {
            [] => {
                let available = columns.to_vec();
                Err(Error::MissingColumn { path, column, signal: signal.to_owned(), available })
            }
            [only] => Ok(only),
            [first, second, ..] => Err(Error::AmbiguousColumn { path, column, first: first + 1, second: second + 1 }),
        }
    }

    /// The column of a signal, in the signal's unit if the file says one.
    fn source(
        &self,
        table: &Table,
        signal: &Quantity,
        said: &Column,
        units: &mut Vec<(String, String, String)>,
    ) -> Result<Source, Error> {
        let column = self.place(table.names(), &signal.name)?;
        let name = &table.names()[column];
        let below = table.form().unit(column);
        if let (None, Some(file)) = (said.factor, split_unit(name).1.filter(|_| name != said.name()).or(below)) {
            let (file, model) = (file.to_owned(), signal.unit.clone());
            if let Some(factor) = reading::factor(&file, &model) {
                let (path, column, signal) = (self.path.clone(), name.clone(), signal.name.clone());
                return Err(Error::Unit { path, column, file: file.into(), signal, model: model.into(), factor });
            }
            if file != model && !file.is_empty() {
                units.push((signal.name.clone(), file, model));
            }
        }
        let factor = said.factor.unwrap_or(1.0);
        Ok(Source { column, factor: if said.reversed { -factor } else { factor }, offset: said.offset })
    }

    /// The error of a cell that is no number, or not a finite one.
    #[cold]
    pub(super) fn bad_cell(
        &self,
        table: &Table,
        column: usize,
        value: Option<f64>,
        signal: &str,
        sample: usize,
        time: Moment,
    ) -> Error {
        let Some(value) = value else {
            let (path, line, name) = (self.path.clone(), table.line(), table.names()[column].clone());
            let text = String::from_utf8_lossy(table.cell(column)).into_owned();
            return Error::NotANumber { path, line, column: name, text };
        };
        let (experiment, signal) = (self.name(), signal.to_owned());
        self.at_line(table, Error::NotFinite { experiment, signal, value, sample, time })
    }

    pub(super) fn at_line(&self, table: &Table, problem: Error) -> Error {
        Error::AtLine { path: self.path.clone(), line: table.line(), problem: Box::new(problem) }
    }
}
