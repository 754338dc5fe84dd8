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

/// What is known of one record.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub name: Name,
    /// `usable`, `with care`, `not usable`, or `error`.
    pub verdict: String,
    /// Value, standard error and interval of each parameter; none where there is none.
    pub numbers: Vec<Option<f64>>,
    /// Codes of warnings, or the error.
    pub remarks: String,
}

impl Row {
    /// The row of an answer.
    pub fn of(name: Name, answer: Result<&Summary, String>) -> Self {
        let found = match answer {
            Ok(found) => found,
            Err(error) => return Row::failed(name, error),
        };
        let verdict = match found.severity() {
            Severity::Usable => "usable",
            Severity::UsableWithCare => "with care",
            Severity::NotUsable => "not usable",
        };
        let codes: Vec<String> = found.warnings.iter().map(|one| format!("{:?}", one.code)).collect();
        let numbers = found.parameters.iter().flat_map(numbers).collect();
        Row { name, verdict: verdict.to_owned(), numbers, remarks: codes.join(" ") }
    }

    /// The row of a record that cannot be fitted.
    pub fn failed(name: Name, error: String) -> Self {
        Row { name, verdict: "error".to_owned(), numbers: vec![], remarks: in_shell(&error) }
    }

    /// Whether the record could not be read or fitted.
    pub fn is_error(&self) -> bool {
        self.verdict == "error"
    }

    pub fn verdict(&self) -> Verdict {
        match self.verdict.as_str() {
            "with care" => Verdict::WithCare,
            "not usable" | "error" => Verdict::NotUsable,
            _ => Verdict::Usable,
        }
    }

    /// The texts before and behind the numbers, as the header has them.
    pub fn texts(&self, by: bool) -> (Vec<&str>, &str) {
        let group = by.then(|| self.name.group.as_deref().unwrap_or_default());
        ([self.name.record.as_str()].into_iter().chain(group).chain([self.verdict.as_str()]).collect(), &self.remarks)
    }

    /// The row of texts before, numbers and the text behind.
    pub fn from_parts(texts: Vec<String>, by: bool, numbers: Vec<Option<f64>>, remarks: String) -> Option<Self> {
        let mut texts = texts.into_iter();
        let record = texts.next()?;
        let group = if by { texts.next().filter(|group| !group.is_empty()) } else { None };
        // An error has no number at all.
        let numbers = if numbers.iter().all(Option::is_none) { vec![] } else { numbers };
        Some(Row { name: Name { record, group }, verdict: texts.next()?, numbers, remarks })
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
        let columns = layout.parameters.iter().map(|one| one.name.as_str());
        let columns = columns.flat_map(|name| ["", "_std", "_lower", "_upper"].map(|end| format!("{name}{end}")));
        let first = ["record"].into_iter().chain(by).chain(["verdict"]).map(str::to_owned);
        let names: Vec<String> = first.chain(columns).chain(["remarks".to_owned()]).collect();
        match names.iter().enumerate().find(|(at, name)| names[..*at].contains(name)) {
            Some((_, name)) => {
                Err(format!("the table would have two columns `{name}`; rename that of the records").into())
            }
            None => Ok(Header { names, by: by.is_some() }),
        }
    }

    /// How many columns have texts before the numbers.
    pub fn texts(&self) -> usize {
        if self.by { 3 } else { 2 }
    }

    /// How many columns have numbers.
    pub fn numbers(&self) -> usize {
        self.names.len() - self.texts() - 1
    }
}

/// Value, standard error and interval of a parameter.
fn numbers(one: &greybox::estimate::ParameterEstimate) -> [Option<f64>; 4] {
    let (error, lower, upper) = match one.knowledge {
        Knowledge::Known { standard_error, lower, upper } => (Some(standard_error), Some(lower), Some(upper)),
        _ => (None, None, None),
    };
    [Some(one.value), error, lower, upper]
}
