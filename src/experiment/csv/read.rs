//! Reading: cells become a record, one row after the other.

use super::table::Table;
use super::{Column, CsvFile};
use crate::error::Error;
use crate::experiment::{Clock, Experiment, ExperimentOf, Initial, Time};
use crate::interval::Hold;
use crate::model::{Kind, Model};
use crate::signals::{Of, Signals};

/// Where the number of one signal comes from.
#[derive(Clone, Copy, Debug, Default)]
struct Source {
    column: usize,
    factor: f64,
    offset: f64,
}

impl CsvFile {
    /// Reads the record of a model; it is named after the file.
    ///
    /// # Errors
    /// A file that cannot be read; a missing or ambiguous column (the message lists those there); a cell that is no
    /// number, a missing input, time that does not increase, a row of another length (each with its line); a factor that
    /// is not positive; a signal that the model does not have; whatever [`Experiment::new`] refuses.
    pub fn read<M: Model>(&self, _model: &M) -> Result<ExperimentOf<M>, Error> {
        self.check::<M>()?;
        let mut table = Table::open(self)?;
        let name = self.path.file_stem().map_or("record".into(), |stem| stem.to_string_lossy().into_owned());

        // A static model needs no time: without one its rows are numbered.
        let timed =
            self.columns.iter().any(|column| column.signal == "t") || table.names().iter().any(|name| name == "t");
        let sample_time = self.sample_time.or((M::KIND == Kind::Static && !timed).then_some(1.0));
        let t = if sample_time.is_none() { Some(self.source(&table, "t")?) } else { None };
        let inputs = self.sources::<M::Input>(&table)?;
        let outputs = self.sources::<M::Output>(&table)?;

        let mut us: Vec<Of<M::Input, f64>> = Vec::new();
        let mut ys: Vec<Of<M::Output, f64>> = Vec::new();
        let mut clock = Clock::default();
        // A pipe cannot be read again, so that its stamps are kept until the end.
        let mut stamps = if self.path.is_file() { None } else { Some(Vec::new()) };
        while table.next()? {
            let sample = us.len();
            let mut time = sample as f64 * sample_time.unwrap_or_default();
            if let Some(t) = t {
                let Some(stamp) = self.value(&table, t).filter(|stamp| stamp.is_finite()) else {
                    return Err(self.bad_cell(&table, t, &name, "t", sample, f64::NAN));
                };
                time = stamp;
                if let Some(before) = clock.last().filter(|before| time <= *before) {
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
            let mut bad = None;
            us.push(M::Input::from_fn(|i| {
                let value = self.value(&table, inputs.as_ref()[i]).filter(|value| value.is_finite());
                value.unwrap_or_else(|| {
                    bad.get_or_insert((M::Input::NAMES[i], inputs.as_ref()[i]));
                    f64::NAN
                })
            }));
            ys.push(M::Output::from_fn(|i| {
                let value = self.value(&table, outputs.as_ref()[i]).filter(|value| !value.is_infinite());
                value.unwrap_or_else(|| {
                    bad.get_or_insert((M::Output::NAMES[i], outputs.as_ref()[i]));
                    f64::NAN
                })
            }));
            if let Some((signal, source)) = bad {
                return Err(self.bad_cell(&table, source, &name, signal, sample, time));
            }
        }
        us.shrink_to_fit();
        ys.shrink_to_fit();
        let time = match sample_time {
            Some(step) => Time::Uniform { start: 0.0, step },
            None => match clock.uniform() {
                Some(uniform) => uniform,
                None => Time::Stamps(stamps.unwrap_or_else(|| clock.last().into_iter().collect())),
            },
        };
        let (hold, initial) = (Hold::default(), Initial::Estimated);
        Experiment { name, time, inputs: us, outputs: ys, hold, initial }.checked()
    }

    /// The time stamps of the first rows, for a clock that turned out uneven.
    fn stamps(&self, t: Source, rows: usize) -> Result<Vec<f64>, Error> {
        let mut table = Table::open(self)?;
        let mut stamps = Vec::with_capacity(rows + 1);
        while stamps.len() < rows && table.next()? {
            stamps.extend(self.value(&table, t));
        }
        Ok(stamps)
    }

    /// Refuses what makes no sense whatever the file holds.
    fn check<M: Model>(&self) -> Result<(), Error> {
        let known = || M::Input::NAMES.iter().chain(M::Output::NAMES).chain(&["t"]);
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

    fn sources<S: Signals>(&self, table: &Table) -> Result<S::Array<Source>, Error> {
        let mut sources = S::array_from_fn(|_| Source::default());
        for (source, signal) in sources.as_mut().iter_mut().zip(S::NAMES) {
            *source = self.source(table, signal)?;
        }
        Ok(sources)
    }

    fn source(&self, table: &Table, signal: &str) -> Result<Source, Error> {
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
        Ok(Source { column: at, factor, offset: said.offset })
    }

    /// The value of a signal in the current row; NaN where missing, none where its cell is no number.
    #[inline]
    fn value(&self, table: &Table, source: Source) -> Option<f64> {
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
    fn bad_cell(&self, table: &Table, source: Source, name: &str, signal: &str, sample: usize, time: f64) -> Error {
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
