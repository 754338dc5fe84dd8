//! The declarations of parameters and initial states as Rust.

use super::{Module, number};
use crate::parameter::{Parameter, Transform, free};
use crate::text::document::{Begin, State};
use core::fmt::Write;

impl Module<'_> {
    pub(super) fn begin(&self) -> Option<Vec<(&str, Parameter)>> {
        let given = |state: &'_ State| matches!(state.begin, Some((Begin::Given(_), _)));
        if !self.document.states.iter().any(given) {
            return None;
        }
        let value = |state: &'_ State| match state.begin {
            Some((Begin::Given(parameter), _)) => parameter,
            _ => free(0.0),
        };
        Some(self.document.states.iter().map(|state| (state.quantity.name.as_str(), value(state))).collect())
    }

    /// Functions that declare parameters and initial states as the file does.
    pub(super) fn declarations(&self) -> String {
        let mut text = format!("\nimpl {} {{\n", self.name);
        let parameters: Vec<_> =
            self.document.parameters.iter().map(|one| (one.quantity.name.as_str(), one.parameter)).collect();
        let empty = text.len();
        if !parameters.is_empty() {
            self.declared(&mut text, "The parameters as they are declared.", "parameters", "Parameters", &parameters);
        }
        if let Some(begin) = self.begin() {
            self.declared(&mut text, "The state at the first sample as it is declared.", "initial", "State", &begin);
        }
        if text.len() == empty { String::new() } else { text + "}\n" }
    }

    fn declared(&self, text: &mut String, about: &str, function: &str, role: &str, all: &[(&str, Parameter)]) {
        let name = &self.name;
        let _ = writeln!(
            text,
            "    /// {about}\n    pub fn {function}() -> {name}{role}<Parameter> {{\n        {name}{role} {{"
        );
        for (quantity, parameter) in all {
            let _ = writeln!(text, "            {quantity}: {},", declaration(parameter));
        }
        text.push_str("        }\n    }\n");
    }
}

fn declaration(declared: &Parameter) -> String {
    let mut code = format!("{}({})", if declared.free { "free" } else { "fixed" }, number(declared.start));
    if declared.lower > f64::NEG_INFINITY || declared.upper < f64::INFINITY {
        code += &format!(".within({}, {})", number(declared.lower), number(declared.upper));
    }
    if let Some(prior) = declared.prior {
        code += &format!(".prior({}, {})", number(prior.mean), number(prior.std));
    }
    let marks = [
        (declared.transform == Transform::Log, ".log()"),
        (declared.positive, ".positive()"),
        (declared.per_experiment, ".per_experiment()"),
    ];
    code + &marks.iter().filter(|(is_so, _)| *is_so).map(|(_, mark)| *mark).collect::<String>()
}
