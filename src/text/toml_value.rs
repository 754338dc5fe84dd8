//! Values of a TOML file with their places, and the errors of those that are of another kind than asked for.

use super::expression::Expression;
use super::parse::parse;
use super::remark::{Remark, Source, Span, nearest};
use super::string::Place;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A key, its value and where both stand.
#[derive(Clone)]
pub(super) struct Entry<'a> {
    pub key: &'a str,
    pub at: Span,
    pub value: &'a DeValue<'a>,
    pub span: Span,
}

/// The entries of a table in the order of the file.
pub(super) fn entries<'a>(table: &'a DeTable<'a>) -> Vec<Entry<'a>> {
    let entry = |(key, value): (&'a Spanned<_>, &'a Spanned<DeValue<'a>>)| entry(key, value);
    let mut found: Vec<Entry<'a>> = table.iter().map(entry).collect();
    found.sort_by_key(|entry| entry.at.start);
    found
}

fn entry<'a>(key: &'a Spanned<std::borrow::Cow<'a, str>>, value: &'a Spanned<DeValue<'a>>) -> Entry<'a> {
    Entry { key: key.get_ref(), at: key.span(), value: value.get_ref(), span: value.span() }
}

/// What a value is, in a sentence.
pub(super) fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// The number that a value is.
fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
        DeValue::Integer(integer) => {
            let digits = integer.as_str().replace('_', "");
            match integer.radix() {
                10 => digits.parse().ok(),
                radix => i64::from_str_radix(&digits, radix).ok().map(|whole| whole as f64),
            }
        }
        _ => None,
    }
}

/// Reads values, and gathers what is said of them.
pub(super) struct Values {
    pub source: Arc<Source>,
    pub errors: Vec<Remark>,
    pub warnings: Vec<Remark>,
}

impl Values {
    pub fn error(&mut self, at: Span, title: impl Into<String>) -> &mut Remark {
        self.errors.push(Remark::error(&self.source, at, title));
        let last = self.errors.len() - 1;
        &mut self.errors[last]
    }

    fn wanted<T>(&mut self, entry: &Entry<'_>, what: &str) -> Option<T> {
        let title = format!("`{}` is {}, where {what} should stand", entry.key, kind(entry.value));
        self.error(entry.span.clone(), title);
        None
    }

    /// Entries other than those that have a meaning are errors.
    pub fn only(&mut self, entries: &[Entry<'_>], of: &str, keys: &[&str]) {
        for entry in entries.iter().filter(|entry| !keys.contains(&entry.key)) {
            let help = match nearest(entry.key, keys.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("{of} may have: {}", keys.join(", ")),
            };
            let remark = Remark::error(&self.source, entry.at.clone(), format!("{of} has no `{}`", entry.key));
            self.errors.push(remark.help(help));
        }
    }

    /// The expression of an entry that may be left out; nothing where it is wrong.
    pub fn optional(&mut self, entry: Option<&Entry<'_>>) -> Option<Option<Expression>> {
        match entry {
            Some(entry) => self.expression(entry).map(Some),
            None => Some(None),
        }
    }

    pub fn number(&mut self, entry: &Entry<'_>) -> Option<f64> {
        match number(entry.value) {
            Some(value) => Some(value),
            None => match entry.value {
                DeValue::String(text) if text.trim().parse::<f64>().is_ok() => {
                    let title = format!("`{}` is a text, where a number should stand", entry.key);
                    let remark = Remark::error(&self.source, entry.span.clone(), title);
                    self.errors.push(remark.help(format!("leave out the quotes: {} = {}", entry.key, text.trim())));
                    None
                }
                _ => self.wanted(entry, "a number"),
            },
        }
    }

    /// A number that is finite.
    pub fn finite(&mut self, entry: &Entry<'_>) -> Option<f64> {
        let value = self.number(entry)?;
        if !value.is_finite() {
            self.error(entry.span.clone(), format!("`{}` is {value}; it must be finite", entry.key));
            return None;
        }
        Some(value)
    }

    pub fn text<'a>(&mut self, entry: &Entry<'a>) -> Option<&'a str> {
        match entry.value.as_str() {
            Some(text) => Some(text),
            None => self.wanted(entry, "a text in quotes"),
        }
    }

    pub fn truth(&mut self, entry: &Entry<'_>) -> Option<bool> {
        match entry.value.as_bool() {
            Some(value) => Some(value),
            None => self.wanted(entry, "true or false"),
        }
    }

    pub fn table<'a>(&mut self, entry: &Entry<'a>) -> Option<Vec<Entry<'a>>> {
        match entry.value {
            DeValue::Table(table) => Some(entries(table)),
            _ => self.wanted(entry, "a table"),
        }
    }

    /// The entries of a list, under the key of the list.
    pub fn list<'a>(&mut self, entry: &Entry<'a>) -> Option<Vec<Entry<'a>>> {
        match entry.value {
            DeValue::Array(list) => {
                let one = |value: &'a Spanned<DeValue<'a>>| Entry {
                    key: entry.key,
                    at: value.span(),
                    value: value.get_ref(),
                    span: value.span(),
                };
                Some(list.iter().map(one).collect())
            }
            _ => self.wanted(entry, "a list in brackets"),
        }
    }

    pub fn numbers(&mut self, entry: &Entry<'_>) -> Option<Vec<f64>> {
        self.list(entry)?.iter().map(|one| self.finite(one)).collect()
    }

    /// Two numbers.
    pub fn pair(&mut self, entry: &Entry<'_>, what: &str) -> Option<[f64; 2]> {
        let numbers = self.list(entry)?;
        let [a, b] = numbers.as_slice() else {
            let title = format!("`{}` has {} number(s), where {what} should stand", entry.key, numbers.len());
            self.error(entry.span.clone(), title);
            return None;
        };
        let (a, b) = (self.number(a), self.number(b));
        Some([a?, b?])
    }

    /// An expression in quotes, or a number without.
    pub fn expression(&mut self, entry: &Entry<'_>) -> Option<Expression> {
        let text = match entry.value {
            DeValue::String(text) => text.to_string(),
            DeValue::Integer(_) | DeValue::Float(_) => number(entry.value)?.to_string(),
            _ => return self.wanted(entry, "an expression in quotes"),
        };
        let place = Place::quoted(entry.span.clone());
        let at = |within: Span| place.span(&self.source.text, within);
        match parse(&text) {
            Ok((nodes, hints)) => {
                for hint in hints {
                    self.warnings.push(Remark::warning(&self.source, at(hint.at), hint.title).help(hint.help));
                }
                Some(Expression { text, nodes, place })
            }
            Err(wrong) => {
                self.errors.push(Remark::error(&self.source, at(wrong.at), wrong.title).help(wrong.help));
                None
            }
        }
    }
}
