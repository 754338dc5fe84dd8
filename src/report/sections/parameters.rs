//! The section on the parameters and initial states.

use crate::estimate::{Knowledge, ParameterEstimate, Unknown, held};
use crate::numeral::{number, resolved};
use crate::report::facts::Facts;
use crate::section::{Cell, Drawing, Forest, Interval, Plot, Section, Table};

/// Unknowns that a reader looks at; of more, the first are shown.
const SHOWN: usize = 40;
const COLUMNS: [&str; 6] = ["parameter", "value", "unit", "std. error", "95 % interval", "error index"];

pub(super) fn section(facts: &Facts) -> Section {
    let unknowns: Vec<&Unknown> = facts.unknowns(false).map(|(_, unknown)| unknown).collect();
    let fixed = facts.estimate.parameters.iter().filter(|p| !p.declared.free).map(
        |ParameterEstimate { name, unit, value, .. }| {
            [
                name.as_str().into(),
                Cell::number(*value, 7),
                unit.as_str().into(),
                Cell::Empty,
                "fixed".into(),
                Cell::Empty,
            ]
        },
    );
    let table = Table::new("Estimates", COLUMNS).rows(unknowns.iter().map(|unknown| row(unknown))).rows(fixed);
    let section =
        Section::new("parameters", "Parameters").table(table.at_most(SHOWN)).plot(forest("parameters", &unknowns));
    let warnings = facts.estimate.warnings.iter();
    let section = warnings.fold(section, |section, warning| section.because(warning.severity, warning.text.clone()));
    let initial: Vec<&Unknown> = facts.unknowns(true).map(|(_, unknown)| unknown).collect();
    let rows = initial.iter().map(|unknown| row(unknown));
    let of_states = Section::new("initial-states", "Initial states")
        .says("The state at the first sample of each record, estimated with the parameters.")
        .table(
            Table::new("Estimates", ["initial state", COLUMNS[1], COLUMNS[2], COLUMNS[3], COLUMNS[4], COLUMNS[5]])
                .rows(rows)
                .at_most(SHOWN),
        )
        .plot(forest("initial-states", &initial));
    section.part((!initial.is_empty()).then(|| of_states.folded()))
}

fn row(unknown: &Unknown) -> [Cell; 6] {
    let Unknown { name, value, unit, .. } = unknown;
    let (name, unit): (Cell, Cell) = (name.as_str().into(), unit.as_str().into());
    let said = |text: String| (Cell::number(*value, 6), Cell::Empty, Cell::from(text), Cell::Empty);
    let (value, error, interval, index) = match unknown.knowledge {
        Knowledge::Known { standard_error, lower, upper } => {
            let (lower, upper) = (resolved(lower, standard_error), resolved(upper, standard_error));
            let index = unknown.error_index.map_or(Cell::Empty, |index| match index {
                many if many >= 1e4 => Cell::Number { value: many, text: "> 9999 %".to_owned() },
                index => Cell::Number { value: index, text: format!("{} %", number(index, 3)) },
            });
            let interval = format!("{lower} … {upper}").into();
            (Cell::resolved(*value, standard_error), Cell::error(standard_error), interval, index)
        }
        Knowledge::Held { bound, end } => said(held(bound, end)),
        Knowledge::Unidentified => said("not determined by the data".to_owned()),
        Knowledge::Fixed => said("fixed".to_owned()),
    };
    [name, value, unit, error, interval, index]
}

/// Estimates with their intervals.
fn forest(name: &str, unknowns: &[&Unknown]) -> Option<Plot> {
    let row = |unknown: &&Unknown| {
        let relative = |end: f64| 100.0 * (end - unknown.value) / unknown.value.abs();
        let ends = match unknown.knowledge {
            Knowledge::Known { .. } if unknown.value == 0.0 => Err("the estimate is 0"),
            Knowledge::Known { lower, upper, .. } => Ok((relative(lower), relative(upper))),
            Knowledge::Held { .. } => Err("held at its bound"),
            Knowledge::Unidentified => Err("not determined"),
            Knowledge::Fixed => Err("fixed"),
        };
        let why = ends.err().unwrap_or_default().to_owned();
        Interval { name: unknown.name.clone(), ends: ends.ok(), why }
    };
    let rows: Vec<Interval> = unknowns.iter().take(SHOWN).map(row).collect();
    let drawing = Forest { scale: "95 % interval about the estimate".to_owned(), rows };
    let title = "95 % intervals of the estimates, relative to them";
    (!unknowns.is_empty()).then(|| Plot::of(name, "Intervals beside each other", title, Drawing::Forest(drawing)))
}
