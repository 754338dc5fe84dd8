//! Guesses at a text file from its first lines, as a person would make them: what stands between cells, which line has the names,
//! whether units stand below it.

use super::bytes::{Spaces, decoded};
use super::reading::time_unit;
use super::stamp::Stamp;
use super::{DataFile, is_missing};
use crate::error::Error;
use crate::unit::Unit;
use std::collections::BTreeMap;

/// What stands between cells, the likelier first.
const SEPARATORS: [u8; 5] = [b',', b';', b'\t', b'|', b' '];

/// What stands around units.
const BRACKETS: [char; 4] = ['[', ']', '(', ')'];

/// Lines that are looked at.
const LOOKED_AT: usize = 200;

/// How the text of a file stands.
#[derive(Clone, Debug)]
pub(super) struct Form {
    pub(super) separator: u8,
    pub(super) names: Vec<String>,
    /// Units below the names.
    pub(super) units: Option<Vec<String>>,
    /// Names or units are no UTF-8, and were read as Windows-1252.
    pub(super) windows: bool,
    /// Lines above the names.
    pub(super) preamble: usize,
    /// Lines above the first row.
    pub(super) skipped: usize,
}

/// A line of the file that is neither blank nor a comment.
struct Line<'a> {
    number: usize,
    text: &'a [u8],
}

impl Form {
    /// Guesses, from the first lines of a file, what was not said. The names are on the line that has all that are `wanted`, if there
    /// is one.
    ///
    /// # Errors
    /// No line that could have the names.
    pub(super) fn guess(file: &DataFile, head: &[u8], wanted: &[&str]) -> Result<Form, Error> {
        let mut separators = file.separator.map_or(SEPARATORS.to_vec(), |said| vec![said]);
        let mut lines = Vec::new();
        let mut remark = None;
        for (number, text) in head.split(|byte| *byte == b'\n').enumerate().skip(file.preamble.unwrap_or(0)) {
            // A tab at an end is a cell that is empty.
            let text = text.strip_suffix(b"\r").unwrap_or(text);
            let text: &[u8] = if text.trim_ascii().is_empty() { b"" } else { trimmed(text) };
            if text.first() == Some(&file.comment) {
                if lines.is_empty() {
                    remark = Some(Line { number, text: text[1..].trim_ascii_start() });
                }
            } else if text.len() <= 5 && text.get(..4).is_some_and(|begin| begin.eq_ignore_ascii_case(b"sep=")) {
                if file.separator.is_none() {
                    separators = text.get(4).map_or(separators, |separator| vec![*separator]);
                }
            } else if !text.is_empty() {
                lines.push(Line { number, text });
            }
            if lines.len() == LOOKED_AT {
                break;
            }
        }
        if lines.is_empty() {
            return Err(file.cannot("the file ends before a line with the names of its columns"));
        }
        let forms: Vec<Form> =
            separators.iter().map(|separator| Form::under(file, *separator, &lines, remark.as_ref(), wanted)).collect();
        let complete = forms.iter().filter(|form| form.has(wanted) && !form.is_of_another(file));
        let complete = complete.max_by_key(|form| form.names.len());
        let likeliest = || forms.iter().rev().max_by_key(|form| form.score(file, &lines));
        Ok(complete.or_else(likeliest).cloned().unwrap_or_else(|| forms[0].clone()))
    }

    /// The form of the file if this byte stands between its cells.
    fn under(file: &DataFile, separator: u8, lines: &[Line], remark: Option<&Line>, wanted: &[&str]) -> Form {
        let form = |line: &Line, at: usize| {
            let names = cells(file, separator, line.text);
            Form {
                separator,
                names,
                units: None,
                windows: std::str::from_utf8(line.text).is_err(),
                preamble: line.number,
                skipped: lines.get(at).map_or(line.number + 1, |l| l.number),
            }
        };
        let first = form(&lines[0], 1);
        let numeric = |cells: &[String]| cells.iter().all(|cell| is_value(cell));
        // Names in a comment right above the numbers, as numpy writes them.
        if let Some(remark) = remark.filter(|_| numeric(&first.names)) {
            return form(remark, 0);
        }
        // The first line with all names; with another preamble than was said, if none was.
        let place = lines.iter().take(if file.preamble.is_some() { 1 } else { LOOKED_AT }).enumerate();
        let found = place.map(|(at, line)| (at, form(line, at + 1))).find(|(_, form)| form.has(wanted));
        let (at, mut found) = found.unwrap_or((0, first));
        if let Some(below) = lines.get(at + 1) {
            let units = cells(file, separator, below.text);
            let after = lines.get(at + 2).map(|line| cells(file, separator, line.text));
            let guessed = units.len() == found.names.len()
                && !wanted.is_empty()
                && after.is_some_and(|after| are_units(file, &found.names, wanted, &units, &after));
            if file.units_row || guessed {
                found.units = Some(units);
                found.windows |= std::str::from_utf8(below.text).is_err();
                found.skipped = lines.get(at + 2).map_or(below.number + 1, |line| line.number);
            }
        }
        found
    }

    /// The unit below the name of a column.
    pub(super) fn unit(&self, column: usize) -> Option<&str> {
        Some(self.units.as_ref()?.get(column)?.trim_matches(BRACKETS))
    }

    fn has(&self, wanted: &[&str]) -> bool {
        !wanted.is_empty() && wanted.iter().all(|want| self.names.iter().any(|name| names(name, want)))
    }

    /// Whether spaces were taken for what stands between cells, where another sign stands there and spaces stand around it.
    fn is_of_another(&self, file: &DataFile) -> bool {
        let other = |name: &String| name.is_empty() || name.contains([',', ';', '|', '\t']);
        self.separator == b' ' && file.separator.is_none() && self.names.iter().any(other)
    }

    /// How many cells of the lines below the names are values, in lines with as many cells as there are names.
    fn score(&self, file: &DataFile, lines: &[Line]) -> usize {
        if self.names.len() == 1 {
            return 0;
        }
        let below = lines.iter().filter(|line| line.number >= self.skipped);
        let rows = below.map(|line| cells(file, self.separator, line.text)).filter(|row| row.len() == self.names.len());
        // Without a row below, the number of names decides.
        rows.flatten().filter(|cell| is_value(cell)).count() * 1000 + self.names.len()
    }
}

/// Whether cells between the names and a row are units. Only the columns of time and of signals tell: a text in another is a remark, and a row whose time
/// is a number is a sample.
fn are_units(file: &DataFile, names_of_file: &[String], wanted: &[&str], units: &[String], after: &[String]) -> bool {
    let time = file.time_column(names_of_file, &[]).ok();
    let is_number = |cell: &String| !is_missing(cell.as_bytes()) && is_value(cell);
    if time.and_then(|at| units.get(at)).is_some_and(is_number) {
        return false;
    }
    let signals: Vec<usize> =
        (0..names_of_file.len()).filter(|at| wanted.iter().any(|want| names(&names_of_file[*at], want))).collect();
    let texts = |cells: &[String]| {
        let text = |at: &usize| cells.get(*at).is_some_and(|cell| !cell.is_empty() && !is_value(cell));
        !signals.is_empty() && signals.iter().all(text)
    };
    // The unit of a ratio is written `1`; every other cell of such a row is a unit above a number.
    let above =
        |at: usize| units[at] == "1" || !is_value(&units[at]) && after.get(at).is_some_and(|cell| is_value(cell));
    let ones = || {
        let told: Vec<usize> = signals.iter().copied().chain(time).collect();
        told.iter().any(|at| is_unit(&units[*at])) && told.iter().all(|at| above(*at))
    };
    !texts(after) && (texts(units) || ones())
}

/// Whether a cell has a unit that is known, or one in brackets.
fn is_unit(cell: &str) -> bool {
    let plain = cell.trim_matches(BRACKETS);
    !is_value(cell) && (plain != cell || time_unit(plain).is_some() || Unit::read(plain, &BTreeMap::new()).is_ok())
}

/// Whether a column of this name holds what is wanted: the name itself, or the name with a unit behind it.
pub(super) fn names(column: &str, wanted: &str) -> bool {
    column == wanted || split_unit(column).0 == wanted || over_unit(column).is_some_and(|(name, _)| name == wanted)
}

/// A name and the unit in brackets behind it: `speed [rpm]`, `time (ms)`, `w / (rad/s)`.
pub(super) fn split_unit(name: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        let parts = name.strip_suffix(close).and_then(|name| name.rsplit_once(open));
        let parts = parts.map(|(before, unit)| (before.trim_end(), unit.trim()));
        if let Some((before, unit)) = parts {
            let before = before.strip_suffix(" /").unwrap_or(before).trim_end();
            if !before.trim().is_empty() {
                return (before, Some(unit));
            }
        }
    }
    (name, None)
}

/// A name over a unit that is known: `U / V`, `t/ms`. It may be a ratio (`x/L`) or a unit (`m/s`) as well, so that it counts only where the name
/// before the bar is wanted, and no other column has that name.
pub(super) fn over_unit(name: &str) -> Option<(&str, &str)> {
    let (before, unit) = name.rsplit_once(" / ").or_else(|| name.split_once('/'))?;
    let (before, unit) = (before.trim_end(), unit.trim());
    (!before.is_empty() && is_unit(unit)).then_some((before, unit))
}

/// What may be a unit behind a name: `speed_rpm`, `current mA`. A single letter is more often an index: `T_h`, `i_d`.
pub(super) fn behind_name(name: &str) -> Option<&str> {
    let (_, unit) = name.rsplit_once(['_', ' '])?;
    (unit.chars().count() > 1).then_some(unit)
}

/// Whether a cell holds a number, in any notation, a date, or says that there is none.
pub(super) fn is_value(cell: &str) -> bool {
    is_missing(cell.as_bytes()) || cell.replacen(',', ".", 1).parse::<f64>().is_ok() || Stamp::read(cell).is_some()
}

/// A line without spaces at its ends.
fn trimmed(mut line: &[u8]) -> &[u8] {
    while let [b' ', rest @ ..] | [rest @ .., b' '] = line {
        line = rest;
    }
    line
}

/// The cells of one line.
pub(super) fn cells(file: &DataFile, separator: u8, line: &[u8]) -> Vec<String> {
    let mut record = csv::ByteRecord::new();
    let line = Spaces::new(separator, line);
    // A line in memory is read without an error.
    let _ = super::table::format(file, separator).from_reader(line).read_byte_record(&mut record);
    record.iter().map(|cell| decoded(cell.trim_ascii()).into_owned()).collect()
}
