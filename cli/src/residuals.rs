//! `residuals`: tests of the residuals of an estimate.

use crate::arguments::Refit;
use crate::describe::{examined, said};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fit};

pub fn run(one: &Refit, terminal: &Terminal) -> Result<Verdict, Failure> {
    let examined = examined(one, terminal)?;
    let report = fit::report(&examined.problem, &examined.estimate, &examined.loaded, &[])?;
    let sections = report.sections.into_iter().filter(|section| section.id.starts_with("residuals")).collect();
    said(one, &examined, sections, terminal)
}
