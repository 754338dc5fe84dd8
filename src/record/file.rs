//! [`DataFile`]: from a file to a record, and from a record to a CSV file.

mod beside;
mod bytes;
#[cfg_attr(not(all(feature = "arrow", feature = "mat", feature = "npz")), allow(dead_code))]
mod columns;
mod dates;
mod format;
mod groups;
mod guess;
mod header;
mod numbers;
mod read;
mod reading;
mod stamp;
mod table;
mod timing;
mod write;

pub use format::FileFormat;
pub use header::Header;
pub use reading::{DateOrder, Reading, TimeSource};

use super::Record;
use crate::error::Error;
use crate::interval::Hold;
use std::path::{Path, PathBuf};

/// A file, and how it becomes a record.
///
/// A file whose columns have the names of the model's signals, and one of time, needs no word:
/// `Experiment::from_file(&model, "record.csv")`. Separator, decimal comma, the line with the names, a row of units and the column of
/// time are found as a person would find them, and [`Record::reading`] says what was found. Of any other file, what differs is said. From
///
/// ```text
/// # bench 3, winding cold
/// time (ms); speed; voltage; i;     remark
/// 0;         1500;  24,1;    -0,52;
/// 1;         1500;  24,1;    ;      out of range
/// 2;         1498;  24,0;    -0,50;
/// ```
///
/// a motor with the inputs `u` (V) and `w` (rad/s) and the output `i` (A) gets its record by
///
/// ```
/// # use greybox::{Model, Of, Scalar, signals};
/// # signals! { pub struct Current { i: "A" } pub struct Supply { u: "V", w: "rad/s" } pub struct Winding { r: "ohm" } }
/// # struct Motor;
/// # impl Model for Motor {
/// #     type State = Current; type Input = Supply; type Output = Current; type Parameters = Winding;
/// #     fn output<S: Scalar>(&self, _: S, x: &Current<S>, _: &Supply<S>, _: &Winding<S>) -> Current<S> { *x }
/// # }
/// # let (model, path) = (Motor, std::env::temp_dir().join(format!("greybox_csv_{}.csv", std::process::id())));
/// # let text = "# bench 3, winding cold\ntime (ms); speed; voltage; i;     remark\n0;         1500;  24,1;    -0,52;\n\
/// # 1;         1500;  24,1;    ;      out of range\n2;         1498;  24,0;    -0,50;\n";
/// # std::fs::write(&path, text).unwrap();
/// use greybox::{DataFile, Hold, Time, units};
///
/// let record = DataFile::new(&path)
///     .column("u", "voltage")
///     .column("w", "speed").factor("w", units::RPM)
///     .reversed("i")
///     .read(&model)?
///     .named("bench 3")
///     .hold(Hold::First);
///
/// assert_eq!(
///     record.record().reading().unwrap().to_string(),
///     "cells between \";\", decimal comma, 1 line above the names, time \"time (ms)\" in ms"
/// );
/// assert_eq!(record.times(), &Time::Uniform { start: 0.0, step: 1e-3 });
/// assert_eq!(record.input(0).w, 1500.0 * units::RPM);
/// assert_eq!(record.output(0).i, 0.52);
/// assert!(record.output(1).i.is_nan());
/// # std::fs::remove_file(path).unwrap();
/// # Ok::<(), greybox::Error>(())
/// ```
///
/// **Columns** go by name. Each input and output of the model has a column of its own name, with a unit behind it or without
/// (`ud [V]`, `ud / V`), unless [`column`](DataFile::column) says another. States need none; further columns are ignored. A value is
/// `factor * cell + offset`, in the unit of the signal. Where the file says a unit that is known and not the signal's (rpm for rad/s, mA for
/// A; of a column that was said, also as `speed_rpm`), it is refused until a [`unit`](DataFile::unit) or a [`factor`](DataFile::factor) is
/// given; nothing is converted unasked.
///
/// **Cells** stand between commas, semicolons, tabs, bars or runs of spaces, may be quoted, and may have white space around them. Letters
/// are UTF-8, or else Windows-1252, of which Latin-1 is a part. Numbers
/// have a point or a comma, the same in the whole file. An output that was not measured is empty, `NaN`, `NA` or `null`; inputs and time
/// are always there, unless an input has a rate of its own and is to be [filled in](DataFile::fill).
///
/// **Lines** that begin with `#` are comments; they are passed over, as are blank lines, and a line such as `sep=;` above the
/// names. The names stand on the first line that has all those wanted, or in the last comment if numbers follow it at once (as numpy
/// writes them); a row of units may follow.
///
/// **Other formats** are known by their first bytes, where the library is built with the feature:
///
/// | format | feature | columns |
/// |---|---|---|
/// | Parquet; Arrow IPC files (Feather 2) and streams | `arrow` | columns, of any number type; no value is a missing measurement |
/// | MATLAB 5 to 7 | `mat` | vectors, and fields of structures as `structure.field` |
/// | MATLAB 7.3 and other HDF5 | `mat` | vectors, and datasets in groups as `group.dataset` |
/// | archives of NumPy arrays (`.npz`) | `npz` | vectors |
///
/// Dates in them, and texts that are dates, become seconds from the first. Objects of MATLAB (`datetime`, `table`) are refused: save
/// `seconds(t - t(1))`, and `table2struct(T, "ToScalar", true)`.
///
/// **Time** is the column `t`, or the only one called `time`, `timestamp`, `datetime`, `Zeit` or the like that holds no signal. It does not decrease. Numbers are
/// seconds, unless a unit stands behind or below the name, or they can only be milli-, micro- or nanoseconds since 1970. Dates
/// (`2025-03-20T14:05:00.5Z`, `2025-03-20 14:05`, `20.03.2025 14:05:00`, `03/20/2025 2:05:00 PM`, `20-Mar-2025 14:05:00`) and times of day
/// (`14:05:00`) become seconds from the first. Whether day or month stands first is seen from numbers above 12, from time that must not
/// decrease, and from even steps; where that does not tell, [`dates`](DataFile::dates) must. Clocks that are set forward or back are followed
/// where the dates have a zone, or [`zone`](DataFile::zone) names theirs; without one, such a step is an error.
///
/// If time is even, up to a millionth of a step (see [`Time::from_stamps`](crate::Time::from_stamps)), it is
/// stored as [`Time::Uniform`](crate::Time::Uniform) and costs no memory. A static model needs no time: without such a
/// column the rows are numbered.
///
/// **The record** is named after the file, its input is held from sample to sample, and its initial state is estimated,
/// unless the [`Experiment`](crate::Experiment) is told otherwise.
///
/// A text is read row by row and kept only as the record: ten million rows of five signals take 400 MB. Only where time
/// turns out uneven, a regular file is read again up to there for its stamps.
#[derive(Clone, Debug)]
pub struct DataFile {
    path: PathBuf,
    separator: Option<u8>,
    comment: u8,
    decimal_comma: bool,
    preamble: Option<usize>,
    units_row: bool,
    sample_time: Option<f64>,
    dates: Option<DateOrder>,
    zone: Option<String>,
    columns: Vec<Column>,
}

/// What was said of one signal.
#[derive(Clone, Debug)]
struct Column {
    signal: String,
    name: Option<String>,
    factor: Option<f64>,
    /// The unit that its cells were said to have.
    unit: Option<String>,
    offset: f64,
    reversed: bool,
    /// How it is filled in where it was not sampled.
    fill: Option<Hold>,
}

impl Column {
    fn new(signal: &str) -> Column {
        // Adding minus zero changes no number, not even minus zero.
        let signal = signal.to_owned();
        Column { signal, name: None, factor: None, unit: None, offset: -0.0, reversed: false, fill: None }
    }

    fn name(&self) -> &str {
        self.name.as_deref().unwrap_or(&self.signal)
    }
}

/// What a file or a column cannot be read for, and the line and text where that shows.
#[derive(Clone, Debug, Default)]
struct Fault {
    line: u64,
    text: String,
    problem: String,
}

/// Whether a cell says that nothing was measured.
fn is_missing(cell: &[u8]) -> bool {
    [&b""[..], b"nan", b"na", b"null"].iter().any(|word| cell.eq_ignore_ascii_case(word))
}

impl DataFile {
    /// The file at `path`: columns named as the signals and in their units, the rest as it is found.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        DataFile {
            path: path.into(),
            separator: None,
            comment: b'#',
            decimal_comma: false,
            preamble: None,
            units_row: false,
            sample_time: None,
            dates: None,
            zone: None,
            columns: Vec::new(),
        }
    }

    /// The column that holds `signal`: an input or output of the model, or the time `t`.
    pub fn column(self, signal: &str, name: &str) -> Self {
        self.with(signal, |column| column.name = Some(name.to_owned()))
    }

    /// Factor of the cells of `signal`, such as [`units::RPM`](crate::units::RPM); positive.
    pub fn factor(self, signal: &str, factor: f64) -> Self {
        self.with(signal, |column| column.factor = Some(factor))
    }

    /// Unit of the cells of `signal`, whatever the file says: they are converted to the signal's. `unit("w", "rpm")` multiplies by 0.1047 for
    /// `rad/s`; `unit("temp", "degF")` for `degC` subtracts 32 first, beside which there is no offset.
    pub fn unit(self, signal: &str, unit: &str) -> Self {
        self.with(signal, |column| column.unit = Some(unit.to_owned()))
    }

    /// Offset added to `signal` after its factor, in the signal's unit.
    pub fn offset(self, signal: &str, offset: f64) -> Self {
        self.with(signal, |column| column.offset = offset)
    }

    /// Turns the sign of the cells of `signal`: for a sensor mounted the other way round.
    pub fn reversed(self, signal: &str) -> Self {
        self.with(signal, |column| column.reversed = true)
    }

    /// Fills in the empty cells of an input that is sampled less often than the rows: by the number before ([`Hold::Zero`], to the end of the file) or by
    /// straight lines between numbers ([`Hold::First`]). This is then the hold of the input. Rows before its first number are left out, and of straight lines
    /// those behind its last; [`Reading`] says how many.
    pub fn fill(self, input: &str, hold: Hold) -> Self {
        self.with(input, |column| column.fill = Some(hold))
    }

    /// Time from a constant sample time (s) instead of a column; it starts at zero. A column of another time is refused.
    pub fn sample_time(self, step: f64) -> Self {
        DataFile { sample_time: Some(step), ..self }
    }

    /// Whether the day or the month stands first in dates such as 03/04/2025.
    pub fn dates(self, order: DateOrder) -> Self {
        DataFile { dates: Some(order), ..self }
    }

    /// Zone of dates that have none, such as `Europe/Berlin`: clocks that are set forward and back are then followed. `UTC` says
    /// that the clock was never changed.
    pub fn zone(self, zone: &str) -> Self {
        DataFile { zone: Some(zone.to_owned()), ..self }
    }

    /// The byte between cells, such as `b';'` or `b'\t'`.
    pub fn delimiter(self, delimiter: u8) -> Self {
        DataFile { separator: Some(delimiter), ..self }
    }

    /// Numbers as `1,5`.
    pub fn decimal_comma(self) -> Self {
        DataFile { decimal_comma: true, ..self }
    }

    /// The byte that a comment begins with, if not `b'#'`.
    pub fn comment(self, comment: u8) -> Self {
        DataFile { comment, ..self }
    }

    /// How many lines to skip above the names.
    pub fn preamble(self, lines: usize) -> Self {
        DataFile { preamble: Some(lines), ..self }
    }

    /// Skips the line below the names, where some instruments write the units.
    pub fn units_row(self) -> Self {
        DataFile { units_row: true, ..self }
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

    /// What was said of a signal.
    fn said(&self, signal: &str) -> Column {
        self.columns.iter().find(|column| column.signal == signal).cloned().unwrap_or_else(|| Column::new(signal))
    }

    fn cannot(&self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
        table::cannot(&self.path, source)
    }
}

impl Record {
    /// Writes `t`, inputs and outputs as columns under their names, a missing output as an empty cell. Reading the file
    /// gives the signals back to the last bit, and an even time to its rounding; hold, initial state and name are not in
    /// it (JSON keeps them).
    ///
    /// # Errors
    /// A file that cannot be written (it is left as it was); an input and an output of one name.
    pub fn to_csv(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        write::write(self, path.as_ref())
    }
}
