//! Reading: a file's columns become a record, those of a text row by row.

use super::bytes::decoded;
use super::columns;
use super::guess::{behind_name, over_unit, split_unit};
use super::numbers::Numbers;
use super::table::Table;
use super::timing::{Timing, tells_time};
use super::{Column, DataFile, FileFormat, Reading, TimeSource};
use crate::error::Error;
use crate::interval::Hold;
use crate::layout::{Kind, Layout, Quantity};
use crate::numeral::{Moment, TimeUnit};
use crate::record::series::Filled;
use crate::record::{Channel, Holds, Initial, Record, Time};
use crate::unit::{Relation, relation};
use std::sync::Arc;

/// Where the number of one signal comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub(super) column: usize,
    factor: f64,
    offset: f64,
    fill: Option<Hold>,
}

impl Source {
    /// The value of a number in the file.
    #[inline]
    pub(super) fn value(self, number: f64) -> f64 {
        number * self.factor + self.offset
    }
}

/// Where the signals and the time of a record are among the columns of a file.
pub(super) struct Plan<'a> {
    layout: &'a Layout,
    pub(super) signals: Vec<&'a Quantity>,
    pub(super) sources: Vec<Source>,
    /// The column of time; none where its steps are even, unless it stands beside a sample time that was said.
    pub(super) time: Option<usize>,
    /// The even step (s).
    pub(super) step: f64,
    /// Signals for which the file has another unit, one of both unknown.
    pub(super) units: Vec<(String, String, String)>,
}

/// What was read of one record so far.
pub(super) struct Rows {
    columns: Vec<Vec<f64>>,
    timing: Timing,
    samples: usize,
}

impl DataFile {
    /// Reads a record of the inputs and outputs of a layout; it is named after the file.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_record(&self, layout: &Layout) -> Result<Record, Error> {
        self.check(layout)?;
        if let Some(mut file) = columns::open(self)? {
            let mut plan = self.plan(layout, file.names(), |at| file.unit(at))?;
            let cells = columns::read(self, file.as_mut(), &mut plan, None)?;
            return self.of_columns(&plan, file.as_ref(), &cells, None);
        }
        let (mut table, mut numbers, plan) = self.text(layout, &[])?;
        let mut rows = Rows::new(&plan);
        while table.next()? {
            rows.push(self, &plan, &table, &mut numbers, false)?;
        }
        rows.finish(self, &plan, &table, &numbers)
    }

    /// The rows of a text that has the columns of a layout, and others; its numbers; where the columns of the layout are.
    pub(super) fn text<'a>(&self, layout: &'a Layout, others: &[&str]) -> Result<(Table, Numbers, Plan<'a>), Error> {
        let signals = layout.inputs.iter().chain(&layout.outputs);
        let said: Vec<Column> = signals.map(|signal| self.said(&signal.name)).collect();
        let t = self.said("t").name;
        let wanted: Vec<&str> =
            said.iter().map(Column::name).chain(t.as_deref()).chain(others.iter().copied()).collect();
        let table = Table::open(self, &wanted)?;
        let numbers = Numbers::new(self.decimal_comma.then_some(true), table.form().separator);
        let plan = self.plan(layout, table.names(), |column| table.form().unit(column))?;
        Ok((table, numbers, plan))
    }

    /// Finds the columns of a layout by their names, and checks their units; `below` is the unit below a name.
    pub(super) fn plan<'a, 'b>(
        &self,
        layout: &'a Layout,
        names: &[String],
        below: impl Fn(usize) -> Option<&'b str>,
    ) -> Result<Plan<'a>, Error> {
        let signals: Vec<&Quantity> = layout.inputs.iter().chain(&layout.outputs).collect();
        let taken: Vec<usize> = signals.iter().filter_map(|signal| self.place(names, &signal.name).ok()).collect();
        // A static model needs no time: its rows are numbered where no column but those of its signals may be that of the time.
        let mut others = names.iter().enumerate().filter(|(at, _)| !taken.contains(at));
        let said = self.columns.iter().any(|column| column.signal == "t");
        let untimed = layout.kind == Kind::Static && !said && !others.any(|(_, name)| tells_time(name));
        let step = self.sample_time.or(untimed.then_some(1.0));
        let time = match (self.sample_time, step) {
            (Some(_), _) => self.beside(names, &taken),
            (None, Some(_)) => None,
            (None, None) => Some(self.time_column(names, &taken)?),
        };
        let mut units = Vec::new();
        let sources = signals.iter().map(|signal| self.source(names, &below, signal, &mut units));
        let sources = sources.collect::<Result<Vec<_>, _>>()?;
        Ok(Plan { layout, signals, sources, time, step: step.unwrap_or(1.0), units })
    }

    /// The record of values that were read.
    pub(super) fn record(
        &self,
        plan: &Plan,
        columns: Vec<Vec<f64>>,
        (time, time_unit): (Time, TimeUnit),
        reading: Reading,
    ) -> Result<Record, Error> {
        let samples = columns.first().map_or(0, Vec::len);
        let named = |(mut values, signal): (Vec<f64>, &&Quantity)| {
            values.shrink_to_fit();
            Channel::new(&signal.name, &signal.unit, values)
        };
        let mut inputs: Vec<Channel> = columns.into_iter().zip(&plan.signals).map(named).collect();
        let mut outputs = inputs.split_off(plan.layout.inputs.len());
        let fills: Vec<Option<Hold>> = plan.sources.iter().take(inputs.len()).map(|source| source.fill).collect();
        let (mut time, mut reading, mut holds) = (time, reading, Holds::All(Hold::default()));
        if fills.iter().any(Option::is_some) {
            let filled = Filled::new(&time, samples, &inputs, &fills);
            if let Some((input, _)) = filled.given.iter().find(|(_, given)| *given == 0) {
                return Err(self.cannot(format!("`{input}` is to be filled in, but has no number")));
            }
            outputs = outputs.iter().map(|channel| channel.part(filled.range.clone())).collect();
            time = time.part(filled.range.clone());
            (reading.filled, reading.left_out) = (filled.given, samples - filled.range.len());
            (inputs, holds) = (filled.inputs, Holds::each(fills.into_iter().map(Option::unwrap_or_default).collect()));
        }
        let (states, inputs, outputs) = (plan.layout.states.clone().into(), inputs.into(), outputs.into());
        let (name, initial) = (self.name(), Initial::default());
        let (reading, looked) = (Some(Arc::new(reading)), Arc::default());
        Record { name, states, time, time_unit, inputs, outputs, holds, initial, reading, looked }.checked()
    }

    /// The record's name: the file's.
    pub(super) fn name(&self) -> String {
        self.path.file_stem().map_or("record".into(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Refuses what makes no sense whatever the file holds.
    pub(super) fn check(&self, layout: &Layout) -> Result<(), Error> {
        let signals = layout.inputs.iter().chain(&layout.outputs).map(|signal| signal.name.as_str());
        let known = || signals.clone().chain(["t"]);
        for Column { signal, factor, unit, offset, fill, .. } in &self.columns {
            if !known().any(|name| name == signal) {
                let available = known().map(|name| (*name).to_owned()).collect();
                return Err(Error::UnknownSignal { signal: signal.clone(), available });
            }
            if let Some(value) = factor.filter(|factor| !(*factor > 0.0 && factor.is_finite())) {
                let what = format!("the factor of `{signal}` (DataFile::reversed turns a sign)");
                return Err(Error::NotPositive { what, value });
            }
            if let Some((factor, unit)) = factor.zip(unit.as_ref()) {
                let text = format!("`{signal}` has a factor, {factor}, and a unit, {unit}; leave one of them out");
                return Err(Error::Option(text));
            }
            if let (Some(_), false) = (fill, layout.inputs.iter().any(|input| input.name == *signal)) {
                let text = format!("DataFile::fill is for inputs, which `{signal}` is not; outputs may be missing");
                return Err(Error::Option(text));
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
        let exact = |name: &str| name == column;
        let bracketed = |name: &str| split_unit(name).0 == column;
        let over = |name: &str| over_unit(name).is_some_and(|(name, _)| name == column);
        let places = |is: &dyn Fn(&str) -> bool| -> Vec<usize> {
            columns.iter().enumerate().filter(|(_, name)| is(name)).map(|(at, _)| at).collect()
        };
        let found = [&exact as &dyn Fn(&str) -> bool, &bracketed, &over].map(|is| places(is));
        match found.into_iter().find(|found| !found.is_empty()).unwrap_or_default()[..] {
            [] => {
                let available = columns.to_vec();
                Err(Error::MissingColumn { path, column, signal: signal.to_owned(), available })
            }
            [only] => Ok(only),
            [first, second, ..] => Err(Error::AmbiguousColumn { path, column, first: first + 1, second: second + 1 }),
        }
    }

    /// The column of a signal, in the signal's unit if the file says one.
    pub(super) fn source<'b>(
        &self,
        names: &[String],
        below: impl Fn(usize) -> Option<&'b str>,
        signal: &Quantity,
        units: &mut Vec<(String, String, String)>,
    ) -> Result<Source, Error> {
        let said = self.said(&signal.name);
        let column = self.place(names, &signal.name)?;
        let name = &names[column];
        // A signal may have brackets in its own name.
        let over = || over_unit(name).filter(|(name, _)| *name == said.name()).map(|(_, unit)| unit);
        let written = split_unit(name).1.or_else(over).filter(|_| *name != signal.name);
        let (mut factor, mut offset) = (said.factor.unwrap_or(1.0), said.offset);
        // What stands behind an underscore or a space may be a part of the name: it is a unit only where it converts to the signal's.
        let behind = || {
            let other =
                |unit: &&str| matches!(relation(unit, &signal.unit), Relation::Factor(_) | Relation::OtherZero { .. });
            behind_name(name).filter(|_| *name != signal.name).filter(other)
        };
        let below = below(column).filter(|unit| !unit.is_empty());
        let of_file = said.unit.as_deref().or(written).or(below).or_else(behind);
        if let Some(file) = of_file.filter(|_| said.factor.is_none()) {
            let refused = |factor: Option<f64>| {
                let (path, column, signal_name) = (self.path.clone(), name.clone(), signal.name.clone());
                let (file, model) = (file.into(), signal.unit.as_str().into());
                Err(Error::Unit { path, column, file, signal: signal_name, model, factor })
            };
            // A signal without a unit counts as a ratio where the unit of its column was said.
            let model = if signal.unit.is_empty() && said.unit.is_some() { "1" } else { &signal.unit };
            match (relation(file, model), said.unit.is_some()) {
                (Relation::Same, _) => {}
                (Relation::Factor(found), true) => factor = found,
                // An offset was said, and kelvins are as large as degrees Celsius.
                (Relation::OtherZero { factor, .. }, false) if factor == 1.0 && offset != 0.0 => {}
                (Relation::OtherZero { .. }, _) if offset != 0.0 => {
                    let name = &signal.name;
                    return Err(Error::Option(format!(
                        "the cells of `{name}` are in {file}, whose zero is not that of {model}, and an offset of {offset} was given: give \
                         DataFile::unit(\"{name}\", \"{file}\"), which has the zero, and leave out DataFile::offset"
                    )));
                }
                (Relation::OtherZero { factor: found, shift }, true) => (factor, offset) = (found, shift),
                (Relation::Unknown, false) => {
                    if !file.is_empty() {
                        units.push((signal.name.clone(), file.to_owned(), signal.unit.clone()));
                    }
                }
                (Relation::Factor(found), false) => return refused(Some(found)),
                _ => return refused(None),
            }
        }
        Ok(Source { column, factor: if said.reversed { -factor } else { factor }, offset, fill: said.fill })
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
            let text = decoded(table.cell(column)).into_owned();
            return Error::NotANumber { path, line, column: name, text };
        };
        let (experiment, signal) = (self.name(), signal.to_owned());
        self.at_line(table, Error::NotFinite { experiment, signal, value, sample, time })
    }

    pub(super) fn at_line(&self, table: &Table, problem: Error) -> Error {
        Error::AtLine { path: self.path.clone(), line: table.line(), problem: Box::new(problem) }
    }
}

impl Rows {
    /// None yet.
    pub(super) fn new(plan: &Plan) -> Rows {
        Rows { columns: vec![Vec::new(); plan.signals.len()], timing: Timing::Even(plan.step), samples: 0 }
    }

    /// Takes the current row. Its time is `kept` where the rows of a record do not follow each other in the file.
    pub(super) fn push(
        &mut self,
        file: &DataFile,
        plan: &Plan,
        table: &Table,
        numbers: &mut Numbers,
        kept: bool,
    ) -> Result<(), Error> {
        let sample = self.samples;
        if let (0, Some(column)) = (sample, plan.time) {
            self.timing = file.timing(table, numbers, column, kept)?;
        }
        let time = self.timing.tick(file, table, numbers, sample)?;
        for (i, (column, source)) in self.columns.iter_mut().zip(&plan.sources).enumerate() {
            let value = numbers.read(table.cell(source.column)).map(|number| source.value(number));
            // An output may be missing, an input may not unless it is filled in.
            let input = i < plan.layout.inputs.len() && source.fill.is_none();
            let good = |value: &f64| if input { value.is_finite() } else { !value.is_infinite() };
            let Some(value) = value.filter(good) else {
                let time = Moment { time, unit: self.timing.unit() };
                return Err(file.bad_cell(table, source.column, value, &plan.signals[i].name, sample, time));
            };
            column.push(value);
        }
        self.samples += 1;
        Ok(())
    }

    /// The record of the rows.
    pub(super) fn finish(
        self,
        file: &DataFile,
        plan: &Plan,
        table: &Table,
        numbers: &Numbers,
    ) -> Result<Record, Error> {
        let time_unit = self.timing.unit();
        let (time, source): (Time, TimeSource) = self.timing.finish(file, table, self.samples)?;
        let form = table.form();
        let reading = Reading {
            format: FileFormat::Text,
            separator: Some(form.separator.into()),
            decimal_comma: numbers.comma(),
            preamble: form.preamble as u64,
            units_row: form.units.is_some(),
            windows: form.windows,
            time: source,
            units: plan.units.clone(),
            filled: vec![],
            left_out: 0,
        };
        file.record(plan, self.columns, (time, time_unit), reading)
    }
}
