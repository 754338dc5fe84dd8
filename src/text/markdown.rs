//! A model as a page of Markdown: its equations, its quantities, its tables.

use super::Model;
use super::document::{Declared, NamedTable};
use super::latex::Printer;
use crate::numeral::exact;
use crate::scalar::{Extrapolation, Interpolation};
use core::fmt::Write;

impl Model {
    /// A page of Markdown: name, equations, a table of all quantities, and the numbers of each table.
    pub fn to_markdown(&self) -> String {
        let (document, printer) = (&self.document, Printer::new(&self.document));
        let title = if self.name().is_empty() { "Model" } else { self.name() };
        let mut text = format!("# {title}\n\n");
        if !document.description.is_empty() {
            let _ = writeln!(text, "{}\n", document.description);
        }
        let _ = writeln!(text, "$$\n{}$$\n\n| symbol | | unit | |\n|---|---|---|---|", self.to_latex());
        let mut row = |role: &str, quantity: &Declared, value: &str| {
            let about = [quantity.description.as_str(), value]
                .into_iter()
                .filter(|one| !one.is_empty())
                .collect::<Vec<_>>()
                .join("; ");
            let unit = if quantity.unit.is_empty() { "1" } else { quantity.unit.as_str() };
            let (symbol, name) = (printer.symbol(&quantity.name), &quantity.name);
            let _ = writeln!(text, "| ${symbol}$ | {role} `{name}` | {unit} | {about} |");
        };
        document.states.iter().for_each(|one| row("state", &one.quantity, ""));
        document.inputs.iter().for_each(|one| row("input", &one.quantity, ""));
        document.parameters.iter().for_each(|one| row("parameter", &one.quantity, ""));
        let values: Vec<f64> = self.constants().into_iter().map(|(_, value, _)| value).collect();
        document.constants.iter().zip(values).for_each(|(one, value)| row("constant", &one.quantity, &exact(value)));
        document.tables.iter().for_each(|one| row("table", &one.quantity, ""));
        document.tables.iter().for_each(|one| text.push_str(&numbers(one)));
        text
    }
}

/// A row for each point of the first argument.
fn numbers(one: &NamedTable) -> String {
    let grid = one.table.grid();
    let between = match grid.interpolation() {
        Interpolation::Linear => "linear between its points",
        Interpolation::Smooth => "smooth between its points",
    };
    let outside = match grid.extrapolation() {
        Extrapolation::Hold => "held outside",
        Extrapolation::Linear => "a straight line outside",
    };
    let mut text = format!("\nTable `{}`, {between}, {outside}:\n\n", one.quantity.name);
    let [x, y] = grid.axes();
    let columns: Vec<String> =
        if y.is_empty() { vec!["value".to_owned()] } else { y.iter().map(|y| format!("y = {}", exact(*y))).collect() };
    let _ = writeln!(text, "| x | {} |\n|---|{}", columns.join(" | "), "---|".repeat(columns.len()));
    for (x, row) in x.iter().zip(grid.values().chunks(columns.len())) {
        let row: Vec<String> = row.iter().map(|value| exact(*value)).collect();
        let _ = writeln!(text, "| {} | {} |", exact(*x), row.join(" | "));
    }
    text
}
