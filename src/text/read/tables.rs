//! `[tables]`: functions that are known at points.

use super::{Reader, field};
use crate::scalar::{Extrapolation, Interpolation, Table};
use crate::text::document::NamedTable;
use crate::text::remark::Remark;
use crate::text::toml_value::Entry;

impl Reader {
    pub(super) fn table(&mut self, entry: &Entry<'_>) -> Option<NamedTable> {
        let keys = ["x", "y", "values", "method", "outside", "x_unit", "y_unit"];
        let (quantity, fields) = self.in_table(entry, "a table", &keys)?;
        for key in ["x", "values", "outside"] {
            if field(&fields, key).is_none() {
                let title = format!("table `{}` has no `{key}`", entry.key);
                let values = "say what it is outside its points: outside = \"hold\" (its last value) or \"linear\" (its last slope goes on)";
                let help = (key == "outside").then(|| values.to_owned());
                self.values.errors.push(Remark::error(&self.values.source, entry.at.clone(), title).help(help));
            }
        }
        let x = self.values.numbers(field(&fields, "x")?)?;
        let y = match field(&fields, "y") {
            Some(found) => self.values.numbers(found)?,
            None => vec![],
        };
        let values = self.table_values(field(&fields, "values")?, x.len(), y.len())?;
        let method = self.choice(field(&fields, "method"), "method", &["linear", "smooth"], Some(0))?;
        let outside = self.choice(field(&fields, "outside"), "behavior outside", &["hold", "linear"], None)?;
        let method = [Interpolation::Linear, Interpolation::Smooth][method];
        let outside = [Extrapolation::Hold, Extrapolation::Linear][outside];
        let made = match y.is_empty() {
            true => Table::curve(&x, &values, method, outside),
            false => Table::surface(&x, &y, &values, method, outside),
        };
        let axes = ["x_unit", "y_unit"].map(|key| {
            let found = field(&fields, key)?;
            let text = self.values.text(found)?;
            self.read_unit(text, found)
        });
        match made {
            Ok(table) => Some(NamedTable { quantity, table, axes }),
            Err(error) => {
                self.values.error(entry.at.clone(), format!("table `{}`: {error}", entry.key));
                None
            }
        }
    }

    /// One number for each point; of two axes, a list for each point of the first.
    pub(super) fn table_values(&mut self, entry: &Entry<'_>, x: usize, y: usize) -> Option<Vec<f64>> {
        if y == 0 {
            return self.values.numbers(entry);
        }
        let rows = self.values.list(entry)?;
        if rows.len() != x {
            let title = format!("`values` has {} row(s) for {x} point(s) of `x`; give one list for each", rows.len());
            self.values.error(entry.span.clone(), title);
            return None;
        }
        let mut all = vec![];
        for row in &rows {
            let numbers = self.values.numbers(row)?;
            if numbers.len() != y {
                self.values.error(
                    row.span.clone(),
                    format!("this row has {} number(s) for {y} point(s) of `y`", numbers.len()),
                );
                return None;
            }
            all.extend(numbers);
        }
        Some(all)
    }
}
