//! The results of an experiment: tables, claims beside what came out, and figures.

use crate::figure::Figure;
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

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{}\n{}", self.title, "=".repeat(self.title.chars().count()))?;
        for table in &self.tables {
            let first = table.rows.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
            write!(f, "\n{}\n{:first$}", table.title, "")?;
            for column in &table.columns {
                write!(f, " {column:>11}")?;
            }
            writeln!(f)?;
            for (label, cells) in &table.rows {
                write!(f, "{label:first$}")?;
                for cell in cells {
                    // No minus before a zero.
                    let cell = if cell.abs() < 5e-4 { 0.0 } else { *cell };
                    write!(f, " {cell:>11.3}")?;
                }
                writeln!(f)?;
            }
        }
        writeln!(f)?;
        for claim in &self.claims {
            let verdict = if claim.holds { "holds" } else { "does not hold" };
            writeln!(f, "[{verdict}] {}", claim.statement)?;
            writeln!(f, "        threshold: {}\n        here: {}", claim.threshold, claim.found)?;
        }
        Ok(())
    }
}
