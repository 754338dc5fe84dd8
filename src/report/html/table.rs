//! Tables that fit the screen: where it is narrow, rows become cards.

use super::prose::Prose;
use crate::report::markup::{Attributes, Markup};
use crate::section::{Cell, Table};
use core::fmt::Display;

/// A table of more cells than these, or of more columns, is scrolled on a narrow screen; its rows would be too many cards,
/// or cards as long as the screen.
const CELLS: usize = 48;
const COLUMNS: usize = 9;
/// Names of rows with more letters are broken where the table is scrolled.
const NAME: usize = 26;
/// Words of fewer letters stay on one line.
const SHORT: usize = 20;
/// Width of a narrow screen without its margins, of a letter in a table, and between two columns (px).
const SCREEN: f64 = 340.0;
const LETTER: f64 = 8.7;
const BETWEEN: f64 = 24.0;
/// The separator between the ends of an interval, which stay on one line.
const SPACED: &str = " … ";

pub(super) fn draw(to: &mut Markup, table: &Table, prose: &mut Prose) {
    let kind = match table.columns.len() {
        // A name and a value have room beside each other on any screen.
        2 => "entries",
        _ if narrow(table) => "narrow",
        _ => "cards",
    };
    let fitting: Attributes<'_> = &[("class", &kind)];
    let long = |row: &Vec<Cell>| row.first().is_some_and(|name| name.text().chars().count() > NAME);
    let scrolled = if table.rows.iter().any(long) { "scroll long" } else { "scroll" };
    let scroll: Attributes<'_> =
        &[("class", &scrolled), ("tabindex", &"0"), ("role", &"group"), ("aria-label", &table.caption)];
    let prose_in_it = (0..table.columns.len()).any(|column| table.is_prose(column));
    let small = table.rows.len() * table.columns.len() <= CELLS;
    let fits = kind != "cards" || table.columns.len() <= COLUMNS && (small || prose_in_it);
    to.node("div", if fits { fitting } else { scroll }, |around| {
        around.node("table", &[("role", &"table")], |node| {
            node.node("caption", &[], |caption| prose.sentence(caption, &table.caption));
            node.node("thead", &[("role", &"rowgroup")], |head| {
                head.node("tr", &[("role", &"row")], |row| {
                    for (i, name) in table.columns.iter().enumerate() {
                        let class = if table.is_prose(i) { "prose" } else { "" };
                        let attributes: Attributes<'_> =
                            &[("scope", &"col"), ("role", &"columnheader"), ("class", &class)];
                        row.node("th", attributes, |cell| prose.text(cell, name));
                    }
                });
            });
            node.node("tbody", &[("role", &"rowgroup")], |body| {
                for cells in &table.rows {
                    body.node("tr", &[("role", &"row")], |row| cells_of(row, table, cells, prose));
                }
            });
        });
        if let Some(more) = table.remainder() {
            around.words("p", &[("class", &"note")], more);
        }
    });
}

/// Whether all columns have room beside each other on a narrow screen; names of columns are broken between words.
fn narrow(table: &Table) -> bool {
    let letters = |text: &str| text.chars().count();
    let width = |(i, name): (usize, &String)| {
        let cells = table.rows.iter().filter_map(|row| row.get(i)).map(|cell| letters(cell.text()));
        cells.chain(name.split_whitespace().map(letters)).max().unwrap_or(0) as f64 * LETTER + BETWEEN
    };
    table.columns.iter().enumerate().map(width).sum::<f64>() - BETWEEN <= SCREEN
}

/// Roles are said, for a table that is laid out as cards is none to a browser any more.
fn cells_of(row: &mut Markup, table: &Table, cells: &[Cell], prose: &mut Prose) {
    for (i, (name, cell)) in table.columns.iter().zip(cells).enumerate() {
        if i == 0 {
            row.words("th", &[("scope", &"row"), ("role", &"rowheader")], cell.text());
            continue;
        }
        let mut attributes: Vec<(&str, &dyn Display)> = vec![("role", &"cell"), ("data-name", name)];
        let text = cell.text();
        if text.is_empty() {
            attributes.push(("class", &"empty"));
        } else if table.is_prose(i) {
            attributes.push(("class", &"prose"));
        }
        if matches!(cell, Cell::Text(text) if !table.is_prose(i) && text.chars().count() > SHORT && !text.contains(SPACED))
        {
            attributes.push(("class", &"words"));
        }
        match cell {
            Cell::Text(text) => row.node("td", &attributes, |cell| prose.text(cell, text)),
            Cell::Empty | Cell::Number { .. } => row.words("td", &attributes, text),
        }
    }
}
