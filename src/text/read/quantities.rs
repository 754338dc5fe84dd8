//! Constants, inputs, definitions, states and outputs.

use super::{Reader, field};
use crate::interval::Hold;
use crate::layout::Kind;
use crate::text::document::{Constant, Declared, Definition, Input, Output, State};
use crate::text::remark::Remark;
use crate::text::toml_value::Entry;
use toml::de::DeValue;

impl Reader {
    /// `name = 4`, `name = "2*pi"` or `name = { value = 4, unit = "1" }`.
    pub(super) fn constant(&mut self, entry: &Entry<'_>) -> Option<Constant> {
        let (quantity, value) = match entry.value {
            DeValue::Table(_) => {
                let (quantity, fields) = self.in_table(entry, "a constant", &["value"])?;
                (quantity, self.required(entry, &fields, "value", "constant")?)
            }
            _ => (self.declared(entry, None, None)?, self.values.expression(entry)?),
        };
        Some(Constant { quantity, value, set: None })
    }

    /// `name = "V"` or `name = { unit = "V", hold = "zero", delay = "theta" }`.
    pub(super) fn input(&mut self, entry: &Entry<'_>) -> Option<Input> {
        if entry.value.is_str() {
            return Some(Input { quantity: self.declared(entry, Some(entry), None)?, hold: None, delay: None });
        }
        let (quantity, fields) = self.in_table(entry, "an input", &["hold", "delay"])?;
        let hold = match field(&fields, "hold") {
            None => None,
            Some(found) => match self.values.text(found)? {
                "zero" => Some(Hold::Zero),
                "first" => Some(Hold::First),
                other => {
                    let remark =
                        Remark::error(&self.values.source, found.span.clone(), format!("there is no hold `{other}`"));
                    let help =
                        "\"zero\": constant from sample to sample; \"first\": a straight line to the next sample";
                    self.values.errors.push(remark.help(help.to_owned()));
                    None
                }
            },
        };
        let delay = self.values.optional(field(&fields, "delay"))?;
        Some(Input { quantity, hold, delay })
    }

    /// `name = "np*w"` or `name = { value = "np*w", unit = "rad/s" }`.
    pub(super) fn definition(&mut self, entry: &Entry<'_>) -> Option<Definition> {
        let (quantity, value) = match entry.value {
            DeValue::Table(_) => {
                let (quantity, fields) = self.in_table(entry, "a definition", &["value"])?;
                (quantity, self.required(entry, &fields, "value", "definition")?)
            }
            _ => (self.declared(entry, None, None)?, self.values.expression(entry)?),
        };
        Some(Definition { quantity, value })
    }

    pub(super) fn state(&mut self, entry: &Entry<'_>, kind: Kind) -> Option<State> {
        let (key, other) = if kind == Kind::Discrete { ("next", "derivative") } else { ("derivative", "next") };
        let (quantity, fields) =
            self.in_table(entry, "a state", &["derivative", "next", "jump", "initial", "diffusion", "initial_noise"])?;
        if let Some(found) = field(&fields, other) {
            let title = format!("state `{}` has `{other}`, another has `{key}`", entry.key);
            let remark = Remark::error(&self.values.source, found.at.clone(), title);
            let help = "a model is continuous (`derivative`) or discrete (`next`), in all its states";
            self.values.errors.push(remark.help(help.to_owned()));
            return None;
        }
        let begin = match field(&fields, "initial") {
            Some(found) => Some((self.begin(found)?, found.span.clone())),
            None => None,
        };
        let [diffusion, initial_noise] = ["diffusion", "initial_noise"].map(|key| field(&fields, key));
        let diffusion = self.values.optional(diffusion)?;
        let initial_noise = self.values.optional(initial_noise)?;
        let jump = field(&fields, "jump");
        if let (Some(found), Kind::Discrete) = (jump, kind) {
            let title = format!("state `{}` has `jump`, but the model is discrete", entry.key);
            let remark = Remark::error(&self.values.source, found.at.clone(), title);
            self.values.errors.push(remark.help("a discrete model changes its states by `next` alone".to_owned()));
            return None;
        }
        let jump = self.values.optional(jump)?;
        let rate = match (&jump, field(&fields, key)) {
            (Some(_), None) => None,
            _ => Some(self.required(entry, &fields, key, "state")?),
        };
        Some(State { quantity, rate, jump, begin, diffusion, initial_noise })
    }

    /// `outputs = ["id", "iq"]` of states or inputs, or a table.
    pub(super) fn outputs(&mut self, entry: Option<&Entry<'_>>, states: &[State]) -> Vec<Output> {
        let Some(entry) = entry else {
            let end = self.values.source.text.len();
            let remark = Remark::error(&self.values.source, end..end, "the model has no outputs");
            let help = match states.first() {
                Some(state) => format!(
                    "say what is measured: outputs = [\"{}\"] above the first [table], or a table [outputs]",
                    state.quantity.name
                ),
                None => "say what is measured in a table [outputs]".to_owned(),
            };
            self.values.errors.push(remark.help(help));
            return vec![];
        };
        let found: Vec<Output> = match entry.value {
            DeValue::Array(_) => {
                let listed = self.values.list(entry).unwrap_or_default();
                listed.iter().filter_map(|one| self.listed_output(one)).collect()
            }
            _ => {
                let fields = self.values.table(entry).unwrap_or_default();
                fields.iter().filter_map(|one| self.output(one)).collect()
            }
        };
        if found.is_empty() && self.values.errors.is_empty() {
            self.values.error(entry.at.clone(), "the model has no outputs; say what is measured");
        }
        found
    }

    /// An output that is a state or an input, by its name.
    pub(super) fn listed_output(&mut self, entry: &Entry<'_>) -> Option<Output> {
        let name = self.values.text(entry)?.to_owned();
        let value = self.values.expression(entry)?;
        let (at, unit, description) = (entry.span.clone(), String::new(), String::new());
        let quantity = Declared { name, at, unit, dimension: None, description };
        Some(Output { quantity, value, noise: None })
    }

    /// `name = "id"` or `name = { value = "id", unit = "A", noise = 0.05 }`.
    pub(super) fn output(&mut self, entry: &Entry<'_>) -> Option<Output> {
        match entry.value {
            DeValue::Table(_) => {
                let (quantity, fields) = self.in_table(entry, "an output", &["value", "noise"])?;
                let value = self.required(entry, &fields, "value", "output")?;
                let noise = self.values.optional(field(&fields, "noise"))?;
                Some(Output { quantity, value, noise })
            }
            _ => {
                let quantity = self.declared(entry, None, None)?;
                Some(Output { quantity, value: self.values.expression(entry)?, noise: None })
            }
        }
    }
}
