//! What the entries of a file must have in common.

use super::{RESERVED, Reader};
use crate::text::document::{Begin, Document, State};
use crate::text::lex::{WORDS, is_name};
use crate::text::remark::{Remark, Span};
use std::collections::{BTreeMap, BTreeSet};

impl Reader {
    /// The first sample gives all states or none, all rest or none, and what is a function stands beside no declaration.
    pub(super) fn check_begins(&mut self, states: &[State]) {
        type Kind = fn(Option<&Begin>) -> bool;
        let all: [(Kind, Kind, &str, &str); 3] = [
            (
                |begin| matches!(begin, Some(Begin::FirstSample)),
                |begin| !matches!(begin, Some(Begin::FirstSample)),
                "the first sample gives this state, but not",
                "write `initial = \"first\"` at all states, or give each a number or `{ start = ... }`",
            ),
            (
                |begin| matches!(begin, Some(Begin::Steady)),
                |begin| !matches!(begin, Some(Begin::Steady)),
                "this state is that of rest, but not",
                "write `initial = \"steady\"` at all states, or give each a number or `{ start = ... }`",
            ),
            (
                |begin| matches!(begin, Some(Begin::Said(_))),
                |begin| matches!(begin, Some(Begin::Given(_))),
                "this state is an expression, but a declaration is that of",
                "declare a parameter, and name it in `initial`: `initial = \"x0\"`",
            ),
        ];
        for (is_one, is_other, title, help) in all {
            let kind = |state: &&State, is: Kind| is(state.begin.as_ref().map(|begin| &begin.0));
            let one = states.iter().find(|state| kind(state, is_one)).and_then(|state| state.begin.as_ref());
            let other = states.iter().find(|state| kind(state, is_other));
            if let Some(((_, at), other)) = one.zip(other) {
                let name = &other.quantity.name;
                let remark = Remark::error(&self.values.source, at.clone(), format!("{title} `{name}`"));
                let remark = remark.and_at(other.quantity.at.clone(), "this one");
                self.values.errors.push(remark.help(help.to_owned()));
                return;
            }
        }
    }

    /// Each name stands for one thing; outputs have names of their own.
    pub(super) fn check_names(&mut self, document: &Document) {
        let mut known: BTreeMap<&str, (&str, Span)> = BTreeMap::new();
        for (role, quantity) in document.named() {
            let (name, at) = (quantity.name.as_str(), quantity.at.clone());
            if let Some((other, there)) = known.get(name) {
                let remark = Remark::error(&self.values.source, at.clone(), format!("`{name}` is {role} and {other}"));
                self.values
                    .errors
                    .push(remark.and_at(there.clone(), "declared here, too").help("rename one".to_owned()));
            }
            if RESERVED.contains(&name) || WORDS.contains(&name) {
                let meaning = match name {
                    "t" => "the time (s)",
                    "pi" => "3.14159",
                    _ => "a word of expressions",
                };
                self.values.error(at.clone(), format!("`{name}` is {meaning}, and can be no name of {role}"));
            }
            known.insert(name, (role, at));
        }
        let outputs = document.outputs.iter().map(|output| ("an output", &output.quantity));
        for (role, quantity) in document.named().chain(outputs) {
            let name = quantity.name.as_str();
            if !is_name(name)
                && (name.trim().is_empty() || name.contains(['`', '\n', '\r']) || name.chars().any(char::is_control))
            {
                let title = format!("`{}` can be no name of {role}: take letters, digits and `_`", name.escape_debug());
                self.values.error(quantity.at.clone(), title);
            }
        }
        let mut outputs = BTreeSet::new();
        for output in &document.outputs {
            if !outputs.insert(&output.quantity.name) {
                self.values
                    .error(output.quantity.at.clone(), format!("output `{}` stands twice", output.quantity.name));
            }
        }
    }
}
