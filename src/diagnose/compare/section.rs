//! Comparisons and validations as sections of a report.

use super::{Candidate, Validation};
use crate::estimate::{Knowledge, OutputFit, Summary, Unknown};
use crate::numeral::{counted, error_size, number, resolved};
use crate::section::{Cell, Section, Table};

/// The unknowns and criteria, a column for each candidate.
fn table(candidates: &[Candidate]) -> Table {
    let mut names: Vec<&str> = vec![];
    for unknown in candidates.iter().flat_map(|candidate| &candidate.estimate.unknowns) {
        if !names.contains(&unknown.name.as_str()) {
            names.push(&unknown.name);
        }
    }
    let columns = [""].into_iter().chain(candidates.iter().map(|candidate| candidate.title.as_str()));
    let columns = columns.map(str::to_owned).collect();
    let empty = Table { columns, ..Table::new("Estimates side by side", []) };
    let row = |label: &str, cell: &dyn Fn(&Summary) -> Cell| -> Vec<Cell> {
        [label.into()].into_iter().chain(candidates.iter().map(|candidate| cell(&candidate.estimate))).collect()
    };
    let unknowns = names
        .iter()
        .map(|name| row(name, &|s| s.unknowns.iter().find(|u| u.name == *name).map_or("-".into(), estimate)));
    let optional = |value: Option<f64>| value.map_or("-".into(), |value| Cell::number(value, 8));
    let fits = |s: &Summary| {
        let fit = |fit: Option<f64>| fit.map_or("-".to_owned(), crate::numeral::fit);
        s.outputs.iter().map(|output| fit(output.fit.fit_percent)).collect::<Vec<_>>().join(" / ").into()
    };
    empty.rows(unknowns).rows([
        row("fit %", &fits),
        row("measurements", &|s| s.measurements.into()),
        row("unknowns", &|s| (s.unknowns.len() as u64).into()),
        row("AIC", &|s| optional(s.aic())),
        row("AICc", &|s| optional(s.aicc())),
        row("BIC", &|s| optional(s.bic())),
        row("verdict", &|s| s.severity().to_string().into()),
    ])
}

/// An estimate with its standard error.
fn estimate(unknown: &Unknown) -> Cell {
    let value = unknown.value;
    let text = match unknown.knowledge {
        Knowledge::Known { standard_error, .. } => {
            format!("{} ± {}", resolved(value, standard_error), error_size(standard_error))
        }
        Knowledge::Held { .. } => format!("{} (bound)", number(value, 6)),
        Knowledge::Unidentified => "not determined".to_owned(),
        Knowledge::Fixed => format!("{} (fixed)", number(value, 6)),
    };
    Cell::Number { value, text }
}

/// Candidates side by side.
impl From<&[Candidate]> for Section {
    fn from(candidates: &[Candidate]) -> Section {
        Section::new("comparison", "Estimates side by side").table(table(candidates))
    }
}

impl From<&[Validation]> for Section {
    fn from(validations: &[Validation]) -> Section {
        let mut table = Table::new(
            "Records that the estimate was not made from",
            ["record", "predicted", "output", "fit", "rms error"],
        );
        for Validation { experiment, qualities } in validations {
            for (steps, outputs) in qualities {
                let ahead = steps.map_or("by simulation".to_owned(), |steps| counted(steps, "sample") + " ahead");
                let row = |(name, quality): &(String, OutputFit)| {
                    let fit = Cell::fit(quality.fit_percent);
                    let record = experiment.as_str().into();
                    [record, ahead.as_str().into(), name.as_str().into(), fit, Cell::number(quality.rmse, 3)]
                };
                table = table.rows(outputs.iter().map(row));
            }
        }
        Section::new("validation", "Validation").table(table.at_most(60))
    }
}

impl From<Vec<Validation>> for Section {
    fn from(validations: Vec<Validation>) -> Section {
        Section::from(validations.as_slice())
    }
}
