//! [`CsvFile`]: from a CSV file to a record, and back.
//!
//! ```no_run
//! # use greybox::{Error, Model, Nothing, Of, Scalar, signals};
//! # signals! { pub struct Drive { w: "rad/s", ud: "V" } pub struct Currents { id: "A" } pub struct Winding { rs: "ohm" } }
//! # struct Pmsm;
//! # impl Model for Pmsm {
//! #     type State = Currents; type Input = Drive; type Output = Currents; type Parameters = Winding;
//! #     fn output<S: Scalar>(&self, _: f64, x: &Currents<S>, _: &Drive<S>, _: &Winding<S>) -> Currents<S> { *x }
//! # }
//! # let model = Pmsm;
//! use greybox::{CsvFile, Experiment, units};
//! // Columns named as the signals, in their units:
//! let record = Experiment::from_csv(&model, "record.csv")?;
//! // Anything else is said:
//! let record = CsvFile::new("bench.csv")
//!     .column("t", "time (ms)").factor("t", 1e-3)
//!     .column("w", "speed").factor("w", units::RPM)
//!     .offset("id", -0.12)
//!     .read(&model)?;
//! # Ok::<(), Error>(())
//! ```

mod table;

use super::{Clock, Experiment, ExperimentOf, Initial, Time};
use crate::error::Error;
use crate::interval::Hold;
use crate::model::{Kind, Model};
use crate::signals::{Of, Signals};
use std::path::PathBuf;
use table::Table;

/// A CSV file and how it is to be understood.
///
/// **Columns** go by name. Each input and output of the model, and the time `t`, has a column of its own name unless
/// [`column`](CsvFile::column) says another; further columns are ignored. A value is `factor * cell + offset`, in the unit
/// of the signal.
///
/// **Cells** stand between commas, may be quoted, and may have white space around them. An output that was not measured
/// is empty, `NaN`, `NA` or `null`; inputs and time are always there.
///
/// **Lines** that begin with `#` are comments, blank lines nothing. The names stand on the first line that is neither,
/// or on the last comment if numbers follow it at once.
///
/// **Time** increases. If evenly, up to a millionth of a step (see [`Time::from_stamps`]), it is stored as
/// [`Time::Uniform`] and costs no memory. Between samples the input is held, as for every [`Experiment`].
///
/// The file is read row by row, and kept only as the record. A regular file with uneven time is read twice up to the first
/// uneven stamp.
#[derive(Clone, Debug)]
pub struct CsvFile {
    path: PathBuf,
    delimiter: u8,
    comment: u8,
    decimal_comma: bool,
    preamble: usize,
    units_row: bool,
    sample_time: Option<f64>,
    columns: Vec<Column>,
}

/// What was said of one signal.
#[derive(Clone, Debug)]
struct Column {
    signal: String,
    name: String,
    factor: f64,
    offset: f64,
    reversed: bool,
}

impl Column {
    fn new(signal: &str) -> Column {
        Column { signal: signal.to_owned(), name: signal.to_owned(), factor: 1.0, offset: 0.0, reversed: false }
    }
}

/// Where the number of one signal comes from.
#[derive(Clone, Copy, Debug, Default)]
struct Source {
    column: usize,
    factor: f64,
    offset: f64,
}

impl CsvFile {
    /// The file at `path`: comma-separated, columns named as the signals and in their units.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        CsvFile {
            path: path.into(),
            delimiter: b',',
            comment: b'#',
            decimal_comma: false,
            preamble: 0,
            units_row: false,
            sample_time: None,
            columns: Vec::new(),
        }
    }

    /// The column that holds `signal`: an input or output of the model, or the time `t`.
    pub fn column(self, signal: &str, name: &str) -> Self {
        self.with(signal, |column| column.name = name.to_owned())
    }

    /// What a cell of `signal` is multiplied by, such as [`units::RPM`](crate::units::RPM); positive.
    pub fn factor(self, signal: &str, factor: f64) -> Self {
        self.with(signal, |column| column.factor = factor)
    }

    /// What is added to `signal` after its factor, in the signal's unit.
    pub fn offset(self, signal: &str, offset: f64) -> Self {
        self.with(signal, |column| column.offset = offset)
    }

    /// Turns the sign of the cells of `signal`: for a sensor mounted the other way round.
    pub fn reversed(self, signal: &str) -> Self {
        self.with(signal, |column| column.reversed = true)
    }

    /// Time from a constant sample time (s) instead of a column; it starts at zero.
    pub fn sample_time(self, step: f64) -> Self {
        CsvFile { sample_time: Some(step), ..self }
    }

    /// The byte between cells, such as `b';'` or `b'\t'`.
    pub fn delimiter(self, delimiter: u8) -> Self {
        CsvFile { delimiter, ..self }
    }

    /// Numbers as `1,5`, and cells between semicolons (unless [`delimiter`](CsvFile::delimiter) says otherwise after this).
    pub fn decimal_comma(self) -> Self {
        CsvFile { decimal_comma: true, delimiter: b';', ..self }
    }

    /// The byte that a comment begins with, if not `b'#'`.
    pub fn comment(self, comment: u8) -> Self {
        CsvFile { comment, ..self }
    }

    /// How many lines to skip above the names.
    pub fn preamble(self, lines: usize) -> Self {
        CsvFile { preamble: lines, ..self }
    }

    /// Skips the line below the names, where some instruments write the units.
    pub fn units_row(self) -> Self {
        CsvFile { units_row: true, ..self }
    }

    fn with(mut self, signal: &str, say: impl FnOnce(&mut Column)) -> Self {
        let known = self.columns.iter().position(|column| column.signal == signal);
        let at = known.unwrap_or_else(|| {
            self.columns.push(Column::new(signal));
            self.columns.len() - 1
        });
        say(&mut self.columns[at]);
        self
    }

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
        let timeless = M::KIND == Kind::Static && !table.names().iter().any(|name| *name == self.said("t").name);
        let sample_time = self.sample_time.or(timeless.then_some(1.0));
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
                time = self.value(&table, t);
                if !time.is_finite() {
                    return Err(self.bad_cell(&table, t, &name, "t", sample, f64::NAN));
                }
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
                let value = self.value(&table, inputs.as_ref()[i]);
                if !value.is_finite() {
                    bad.get_or_insert((M::Input::NAMES[i], inputs.as_ref()[i]));
                }
                value
            }));
            ys.push(M::Output::from_fn(|i| {
                let source = outputs.as_ref()[i];
                let value = self.value(&table, source);
                if !value.is_finite() && (value.is_infinite() || !missing(table.cell(source.column))) {
                    bad.get_or_insert((M::Output::NAMES[i], source));
                }
                value
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
            stamps.push(self.value(&table, t));
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

    #[inline]
    fn value(&self, table: &Table, source: Source) -> f64 {
        self.number(table.cell(source.column)).unwrap_or(f64::NAN) * source.factor + source.offset
    }

    /// The number in a cell. The standard library's parser is exact, and as fast as the crates that offer one.
    #[inline]
    fn number(&self, cell: &[u8]) -> Option<f64> {
        if !self.decimal_comma {
            return std::str::from_utf8(cell).ok()?.parse().ok();
        }
        let mut text = [0; 64];
        let text = text.get_mut(..cell.len())?;
        for (to, &from) in text.iter_mut().zip(cell) {
            *to = if from == b',' { b'.' } else { from };
        }
        std::str::from_utf8(text).ok()?.parse().ok()
    }

    /// The error of a cell whose value is not finite.
    #[cold]
    fn bad_cell(&self, table: &Table, source: Source, name: &str, signal: &str, sample: usize, time: f64) -> Error {
        let cell = table.cell(source.column);
        if self.number(cell).is_none() && !missing(cell) {
            let (path, line, column) = (self.path.clone(), table.line(), table.names()[source.column].clone());
            return Error::NotANumber { path, line, column, text: String::from_utf8_lossy(cell).into_owned() };
        }
        let (experiment, signal, value) = (name.to_owned(), signal.to_owned(), self.value(table, source));
        self.at_line(table, Error::NotFinite { experiment, signal, value, sample, time })
    }

    fn at_line(&self, table: &Table, problem: Error) -> Error {
        Error::AtLine { path: self.path.clone(), line: table.line(), problem: Box::new(problem) }
    }
}

/// Whether a cell says that nothing was measured.
fn missing(cell: &[u8]) -> bool {
    [&b""[..], b"nan", b"na", b"null"].iter().any(|word| cell.eq_ignore_ascii_case(word))
}

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// Reads a record from a CSV file whose columns are named as the signals of the model, and `t` for time (s), in their
    /// units; see [`CsvFile`] for files that are not.
    ///
    /// # Errors
    /// Those of [`CsvFile::read`].
    pub fn from_csv<M: Model<State = X, Input = U, Output = Y>>(
        model: &M,
        path: impl Into<PathBuf>,
    ) -> Result<Self, Error> {
        CsvFile::new(path).read(model)
    }
}
