//! The results of an experiment: tables, claims beside what came out, and figures.

use crate::figure::Figure;
use greybox::report::{Cell, Table as TextTable};
use serde::Serialize;
use std::fmt;

#[derive(Default, Serialize)]
pub struct Report {
    pub title: String,
    pub tables: Vec<Table>,
    pub claims: Vec<Claim>,
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

#[derive(Serialize)]
pub struct Table {
    pub title: String,
    pub columns: Vec<&'static str>,
    pub rows: Vec<(String, Vec<f64>)>,
}

/// A statement of the source, and what these runs say to it.
#[derive(Serialize)]
pub struct Claim {
    pub statement: &'static str,
    /// When it counts as shown.
    pub threshold: &'static str,
    pub found: String,
    pub holds: bool,
}

impl Report {
    pub fn new(title: impl Into<String>) -> Self {
        Report { title: title.into(), ..Report::default() }
    }

    pub fn table(&mut self, title: impl Into<String>, columns: &[&'static str], rows: Vec<(String, Vec<f64>)>) {
        self.tables.push(Table { title: title.into(), columns: columns.to_vec(), rows });
    }

    pub fn claim(&mut self, statement: &'static str, threshold: &'static str, found: String, holds: bool) {
        self.claims.push(Claim { statement, threshold, found, holds });
    }

    pub fn figure(&mut self, figure: Figure) {
        self.figures.push(figure);
    }
}

/// Text of 80 columns.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{}\n{}", self.title, "=".repeat(self.title.chars().count()))?;
        for table in &self.tables {
            let number = |value: &f64| {
                // No minus before a zero.
                let value = if value.abs() < 5e-4 { 0.0 } else { *value };
                Cell::Number { value, text: format!("{value:.3}") }
            };
            let rows = table.rows.iter().map(|(label, cells)| {
                [label.as_str().into()].into_iter().chain(cells.iter().map(number)).collect::<Vec<Cell>>()
            });
            let columns = [""].iter().chain(&table.columns).map(|name| (*name).to_owned()).collect();
            writeln!(f, "\n{}\n{}", table.title, TextTable { columns, ..TextTable::new("", []) }.rows(rows))?;
        }
        let verdict = |claim: &Claim| if claim.holds { "holds" } else { "does not hold" };
        let rows = self.claims.iter().flat_map(|claim| {
            [
                [verdict(claim).into(), claim.statement.into()],
                ["  threshold".into(), claim.threshold.into()],
                ["  here".into(), claim.found.as_str().into()],
            ]
        });
        writeln!(f, "\n{}", TextTable::new("", ["claim", "is"]).rows(rows))
    }
}
