//! The equations of a model as a section of a report.

use super::Model;
use super::document::Begin;
use super::expression::Expression;
use crate::layout::Kind;
use crate::section::{Cell, Section, Table};

impl Model {
    /// An expression as the file has it, on one line.
    fn written(&self, expression: &Expression) -> String {
        let text = &self.source.text[expression.whole()];
        text.trim_matches(['"', '\'']).split_whitespace().collect::<Vec<_>>().join(" ")
    }
}

impl From<&Model> for Section {
    /// Constants, definitions, the equations of states and outputs, dead times, and the intensities of noise, as they were fitted.
    fn from(model: &Model) -> Section {
        let document = &model.document;
        let mut rows = vec![];
        for state in &document.states {
            let name = &state.quantity.name;
            let left = if document.kind == Kind::Discrete { format!("next {name}") } else { format!("d {name}/dt") };
            rows.push((left, state.rate.as_ref().map_or("0".to_owned(), |rate| model.written(rate))));
            rows.extend(state.jump.as_ref().map(|jump| (format!("{name} after a sample"), model.written(jump))));
        }
        for one in &document.definitions {
            rows.push((one.quantity.name.clone(), model.written(&one.value)));
        }
        for one in &document.outputs {
            rows.push((format!("output {}", one.quantity.name), model.written(&one.value)));
        }
        let delays = document.inputs.iter().map(|one| ("delay", &one.quantity, &one.delay));
        let diffusion = document.states.iter().map(|one| ("diffusion", &one.quantity, &one.diffusion));
        let noise = document.outputs.iter().map(|one| ("noise", &one.quantity, &one.noise));
        let initial = document.states.iter().map(|one| ("initial noise", &one.quantity, &one.initial_noise));
        for state in &document.states {
            let initial = match &state.begin {
                Some((Begin::Said(initial), _)) => model.written(initial),
                Some((Begin::Steady, _)) => "at rest under the first inputs".to_owned(),
                _ => continue,
            };
            rows.push((format!("{}(0)", state.quantity.name), initial));
        }
        for (what, quantity, expression) in delays.chain(diffusion).chain(noise).chain(initial) {
            if let Some(expression) = expression {
                rows.push((format!("{what} of {}", quantity.name), model.written(expression)));
            }
        }
        // The unit "1" of a number without dimension is left out: `4 1` reads as two numbers.
        let unit = |unit: &str| if unit == "1" { String::new() } else { format!(" {unit}") };
        let number = |(name, value, of): (&str, f64, &str)| (name.to_owned(), format!("{value}{}", unit(of)));
        rows.extend(model.constants().into_iter().map(number));
        let row = |(left, right): (String, String)| [Cell::from(left.as_str()), Cell::from(right.trim_end())];
        let table = Table::new("", ["quantity", "equation"]).rows(rows.into_iter().map(row));
        Section::new("equations", "Equations").table(table)
    }
}
