//! The row of one record.

use crate::remedies::in_shell;
use crate::{Failure, Verdict};
use greybox::Severity;
use greybox::layout::Layout;
use greybox::{Knowledge, Summary};

/// Which record it is.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Name {
    /// Its file.
    pub record: String,
    /// What the column says that tells the records of a file apart.
    pub group: Option<String>,
}

/// How many columns have texts behind the numbers.
pub const BEHIND: usize = 4;

/// What is known of one record.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub name: Name,
    /// Samples; value, standard error and interval of each parameter; root mean squared error of each output. None where there is none.
    pub numbers: Vec<Option<f64>>,
    /// `usable`, `usable with care`, `not usable`, or `failed`.
    pub verdict: String,
    /// How the search ended, as in the JSON of an estimate.
    pub outcome: String,
    /// Codes of warnings, as in the JSON of an estimate.
    pub warnings: String,
    /// Why the record could not be read or fitted.
    pub reason: String,
}

impl Row {
    /// The row of an answer about a record of so many samples.
    pub fn of(name: Name, samples: usize, answer: Result<&Summary, String>) -> Self {
        let samples = Some(samples as f64);
        let found = match answer {
            Ok(found) => found,
            Err(error) => return Row { numbers: vec![samples], ..Row::failed(name, error) },
        };
        let verdict = match found.severity() {
            Severity::Usable => "usable",
            Severity::UsableWithCare => "usable with care",
            Severity::NotUsable => "not usable",
        };
        let mut codes: Vec<String> = vec![];
        for warning in found.warnings.iter().filter(|one| one.severity != Severity::Usable) {
            let code = code(warning.code);
            if !codes.contains(&code) {
                codes.push(code);
            }
        }
        let errors = found.outputs.iter().map(|one| Some(one.fit.rmse).filter(|rmse| !rmse.is_nan()));
        let numbers = [samples].into_iter().chain(found.parameters.iter().flat_map(numbers)).chain(errors).collect();
        let (outcome, reason) = (code(found.outcome), String::new());
        Row { name, numbers, verdict: verdict.to_owned(), outcome, warnings: codes.join(" "), reason }
    }

    /// The row of a record that cannot be read or fitted.
    pub fn failed(name: Name, error: String) -> Self {
        let (outcome, warnings) = (String::new(), String::new());
        Row { name, numbers: vec![], verdict: "failed".to_owned(), outcome, warnings, reason: in_shell(&error) }
    }

    /// Whether the record could not be read or fitted.
    pub fn is_failed(&self) -> bool {
        self.verdict == "failed"
    }

    /// Why there is no estimate, after the name of the record, with which reasons may begin.
    pub fn failure(&self) -> String {
        let (record, group) = (&self.name.record, self.name.group.as_ref());
        let group = group.map_or(String::new(), |group| format!(", {group}"));
        let reason = self.reason.strip_prefix(record.as_str()).filter(|rest| rest.starts_with([':', ',']));
        reason.map_or_else(|| format!("{record}{group}: {}", self.reason), |rest| format!("{record}{group}{rest}"))
    }

    pub fn verdict(&self) -> Verdict {
        match self.verdict.as_str() {
            "usable with care" => Verdict::WithCare,
            "not usable" | "failed" => Verdict::NotUsable,
            _ => Verdict::Usable,
        }
    }

    /// The texts before the numbers, as the header has them.
    pub fn before(&self, by: bool) -> Vec<&str> {
        let group = by.then(|| self.name.group.as_deref().unwrap_or_default());
        [self.name.record.as_str()].into_iter().chain(group).collect()
    }

    /// The texts behind the numbers, as the header has them.
    pub fn behind(&self) -> [&str; BEHIND] {
        [&self.verdict, &self.outcome, &self.warnings, &self.reason].map(String::as_str)
    }

    /// The row of texts before, numbers and texts behind.
    pub fn from_parts(before: Vec<String>, by: bool, numbers: Vec<Option<f64>>, behind: Vec<String>) -> Option<Self> {
        let mut before = before.into_iter();
        let record = before.next()?;
        let group = if by { before.next().filter(|group| !group.is_empty()) } else { None };
        let [verdict, outcome, warnings, reason] = behind.try_into().ok()?;
        Some(Row { name: Name { record, group }, numbers, verdict, outcome, warnings, reason })
    }
}

/// The columns of the table.
#[derive(Debug)]
pub struct Header {
    pub names: Vec<String>,
    /// Whether one of them tells the records of a file apart.
    pub by: bool,
}

impl Header {
    /// The columns for the parameters of a model.
    ///
    /// # Errors
    /// A name that stands twice.
    pub fn new(layout: &Layout, by: Option<&str>) -> Result<Self, Failure> {
        let parameters = layout.parameters.iter().map(|one| one.name.as_str());
        let parameters =
            parameters.flat_map(|name| ["", "_error", "_lower", "_upper"].map(|end| format!("{name}{end}")));
        let outputs = layout.outputs.iter().map(|one| format!("{}_rmse", one.name));
        let before = ["record"].into_iter().chain(by).chain(["samples"]).map(str::to_owned);
        let behind: [&str; BEHIND] = ["verdict", "outcome", "warnings", "reason"];
        let names: Vec<String> = before.chain(parameters).chain(outputs).chain(behind.map(str::to_owned)).collect();
        match names.iter().enumerate().find(|(at, name)| names[..*at].contains(name)) {
            Some((_, name)) => {
                Err(format!("the table would have two columns `{name}`; rename that of the records, or the parameter")
                    .into())
            }
            None => Ok(Header { names, by: by.is_some() }),
        }
    }

    /// How many columns have texts before the numbers.
    pub fn texts(&self) -> usize {
        if self.by { 2 } else { 1 }
    }

    /// How many columns have numbers.
    pub fn numbers(&self) -> usize {
        self.names.len() - self.texts() - BEHIND
    }
}

/// Value, standard error and interval of a parameter.
fn numbers(one: &greybox::estimate::ParameterEstimate) -> [Option<f64>; 4] {
    let interval = match one.knowledge {
        Knowledge::Known { lower, upper, .. } => Some((lower, upper)),
        Knowledge::Held { bound, end: Some(end) } => Some((bound.min(end), bound.max(end))),
        _ => None,
    };
    let (lower, upper) = interval.unzip();
    [Some(one.value), one.knowledge.standard_error(), lower, upper]
}

/// The name that a variant has in JSON.
fn code(variant: impl greybox::serde::Serialize) -> String {
    let json = serde_json::to_value(variant).unwrap_or_default();
    json.get("code").unwrap_or(&json).as_str().unwrap_or_default().to_owned()
}
