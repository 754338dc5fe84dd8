//! Parameters and initial states: start, bounds, and what else is known of them.

use super::{Reader, field};
use crate::parameter::{Parameter, fixed, free};
use crate::text::document::{Begin, DeclaredParameter};
use crate::text::remark::Remark;
use crate::text::toml_value::{Entry, kind};
use toml::de::DeValue;

impl Reader {
    pub(super) fn parameter(&mut self, entry: &Entry<'_>) -> Option<DeclaredParameter> {
        let keys = ["start", "fixed", "within", "positive", "log", "prior", "per_experiment"];
        let (quantity, fields) = self.in_table(entry, "a parameter", &keys)?;
        let what = format!("parameter `{}`", entry.key);
        let parameter = self.declaration(entry, &fields, &what)?;
        Some(DeclaredParameter { quantity, parameter })
    }

    /// Start, bounds and what else is known of a parameter or of an initial state.
    pub(super) fn declaration(&mut self, entry: &Entry<'_>, fields: &[Entry<'_>], what: &str) -> Option<Parameter> {
        let mut number = |key: &str| field(fields, key).map(|found| self.values.finite(found));
        let mut parameter = match (number("start"), number("fixed")) {
            (Some(start), None) => free(start?),
            (None, Some(value)) => fixed(value?),
            (None, None) => {
                let remark = Remark::error(
                    &self.values.source,
                    entry.at.clone(),
                    format!("{what} has neither `start` nor `fixed`"),
                );
                self.values
                    .errors
                    .push(remark.help("give the value that the search starts from: start = 1.0".to_owned()));
                return None;
            }
            (Some(_), Some(_)) => {
                self.values.error(entry.at.clone(), format!("{what} has `start` and `fixed`; leave one out"));
                return None;
            }
        };
        if let Some(found) = field(fields, "within") {
            let [lower, upper] = self.values.pair(found, "two numbers, [lower, upper]")?;
            if lower >= upper || lower.is_nan() || upper.is_nan() {
                self.values.error(
                    found.span.clone(),
                    format!("{what}: the lower bound {lower} is not below the upper bound {upper}"),
                );
                return None;
            }
            if parameter.free && !(lower..=upper).contains(&parameter.start) {
                let title = format!("{what} starts at {}, outside its bounds {lower} to {upper}", parameter.start);
                self.values.error(found.span.clone(), title);
                return None;
            }
            parameter = parameter.within(lower, upper);
        }
        let mut truth = |key: &str| field(fields, key).map_or(Some(false), |found| self.values.truth(found));
        let (positive, log, per_experiment) = (truth("positive")?, truth("log")?, truth("per_experiment")?);
        if log && parameter.start <= 0.0 {
            let at = field(fields, "log").map_or(entry.at.clone(), |found| found.at.clone());
            self.values.error(at, format!("{what} is {}; a logarithm needs a positive start", parameter.start));
            return None;
        }
        parameter = if log { parameter.log() } else { parameter };
        parameter = if positive { parameter.positive() } else { parameter };
        parameter = if per_experiment { parameter.per_experiment() } else { parameter };
        if let Some(found) = field(fields, "prior") {
            let prior = self.values.table(found)?;
            self.values.only(&prior, "a prior", &["mean", "sd"]);
            let mut number = |key: &str| field(&prior, key).and_then(|found| self.values.finite(found));
            let (mean, sd) = (number("mean"), number("sd"));
            let Some((mean, sd)) = mean.zip(sd).filter(|(_, sd)| *sd > 0.0) else {
                self.values.error(found.span.clone(), format!("the prior of {what} needs `mean` and a positive `sd`"));
                return None;
            };
            parameter = parameter.prior(mean, sd);
        }
        Some(parameter)
    }

    /// `"estimated"`, `"first"`, `"steady"`, a known number, an expression, or a declaration as of a parameter.
    pub(super) fn begin(&mut self, entry: &Entry<'_>) -> Option<Begin> {
        match entry.value {
            DeValue::Table(_) => {
                let fields = self.values.table(entry)?;
                self.values.only(
                    &fields,
                    "an initial state",
                    &["start", "fixed", "within", "positive", "log", "prior"],
                );
                Some(Begin::Given(self.declaration(entry, &fields, "the initial state")?))
            }
            DeValue::String(text) => match text.trim() {
                "estimated" => Some(Begin::Estimated),
                "first" => Some(Begin::FirstSample),
                "steady" => Some(Begin::Steady),
                _ => Some(Begin::Said(self.values.expression(entry)?)),
            },
            DeValue::Integer(_) | DeValue::Float(_) => Some(Begin::Given(fixed(self.values.finite(entry)?))),
            other => {
                let title = format!(
                    "`initial` is {}, where a number, an expression, \"first\", \"steady\", \"estimated\" or a table should \
                     stand",
                    kind(other)
                );
                self.values.error(entry.span.clone(), title);
                None
            }
        }
    }
}
