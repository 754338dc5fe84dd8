//! [`Table`]: rows of named columns.

use super::plain;
use crate::numeral::{error_size, fit, grouped, number, percent, resolved, whole};
use core::fmt;
use serde::{Deserialize, Serialize};

/// A table; the first cell of a row names the row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// The caption.
    pub caption: String,
    /// Names of the columns, with units where the rows have no unit of their own.
    pub columns: Vec<String>,
    /// The rows, of as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
    /// Rows left out, because a reader would not look at so many.
    pub omitted: u64,
}

/// A cell of a table; in JSON null, a text, or an object with the number and its text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// Nothing.
    Empty,
    /// Words.
    Text(String),
    /// A number for programs, and how a reader sees it.
    Number {
        /// The number.
        #[serde(with = "crate::real")]
        value: f64,
        /// The same rounded, perhaps with a unit.
        text: String,
    },
}

impl Table {
    /// A table without a row.
    pub fn new<const N: usize>(caption: impl Into<String>, columns: [&str; N]) -> Table {
        Table { caption: caption.into(), columns: columns.map(str::to_owned).to_vec(), rows: vec![], omitted: 0 }
    }

    /// Adds a row; missing cells are empty.
    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        let cells = cells.into_iter().chain(core::iter::repeat(Cell::Empty));
        self.rows.push(cells.take(self.columns.len()).collect());
        self
    }

    /// Adds rows.
    pub fn rows<R: IntoIterator<Item = Cell>>(self, rows: impl IntoIterator<Item = R>) -> Self {
        rows.into_iter().fold(self, Table::row)
    }

    /// Keeps so many rows at most, and counts the others.
    pub fn at_most(mut self, rows: usize) -> Self {
        self.omitted += self.rows.len().saturating_sub(rows) as u64;
        self.rows.truncate(rows);
        self
    }

    /// Whether a column holds sentences rather than words and numbers.
    pub(crate) fn is_prose(&self, column: usize) -> bool {
        const LONG: usize = 32;
        let text = |row: &Vec<Cell>| row.get(column).is_some_and(|cell| cell.text().chars().count() > LONG);
        column > 0 && self.rows.iter().any(text)
    }

    /// Whether all columns but the first hold numbers.
    pub(crate) fn is_of_numbers(&self) -> bool {
        let number = |cell: &Cell| !matches!(cell, Cell::Text(_));
        self.rows.iter().all(|row| row.iter().skip(1).all(number))
    }

    /// Remark on the rows left out.
    pub(crate) fn remainder(&self) -> Option<String> {
        (self.omitted > 0).then(|| format!("and {} more", self.omitted))
    }
}

/// The table as text, within 80 columns.
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(plain::table(self).trim_end())
    }
}

impl Cell {
    /// A number with so many significant digits.
    pub fn number(value: f64, digits: usize) -> Cell {
        Cell::Number { value, text: grouped(&number(value, digits)) }
    }

    /// A number, if there is one.
    pub fn optional(value: Option<f64>, digits: usize) -> Cell {
        value.map_or(Cell::Empty, |value| Cell::number(value, digits))
    }

    /// A number with the digits that its standard error leaves.
    pub fn resolved(value: f64, error: f64) -> Cell {
        Cell::Number { value, text: resolved(value, error) }
    }

    /// A standard error.
    pub fn error(error: f64) -> Cell {
        Cell::Number { value: error, text: error_size(error) }
    }

    /// A part, 0 to 1, as a percentage.
    pub fn percent(part: f64, digits: usize) -> Cell {
        Cell::Number { value: part, text: percent(part, digits) }
    }

    /// A fit, if there is one (%).
    pub(crate) fn fit(percent: Option<f64>) -> Cell {
        percent.map_or("constant".into(), |value| Cell::Number { value, text: format!("{} %", fit(value)) })
    }

    /// The text shown to the reader.
    pub fn text(&self) -> &str {
        match self {
            Cell::Empty => "",
            Cell::Text(text) | Cell::Number { text, .. } => text,
        }
    }

    /// The number, if it is one.
    pub fn value(&self) -> Option<f64> {
        match self {
            Cell::Number { value, .. } => Some(*value),
            Cell::Empty | Cell::Text(_) => None,
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Cell {
        if text.is_empty() { Cell::Empty } else { Cell::Text(text.to_owned()) }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Cell {
        Cell::from(text.as_str())
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Cell {
        Cell::Number { value: count as f64, text: whole(count) }
    }
}
