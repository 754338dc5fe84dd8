//! `residuals`: tests of the residuals of an estimate.

use crate::arguments::Refit;
use crate::describe::{examined, said};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fit};
use greybox::report::{Section, Table};

pub fn run(one: &Refit, terminal: &Terminal) -> Result<Verdict, Failure> {
    let examined = examined(one, terminal)?;
    let report = fit::report(&examined.problem, &examined.estimate, &examined.loaded, &[])?;
    let failed = report.sections.iter().find(|section| section.id == "residuals").cloned();
    let section = failed.unwrap_or_else(|| passed(&report.sections));
    said(one, &examined, vec![section], terminal)
}

/// What was tested where no test failed, by the tables of the outputs in the sections of the records.
fn passed(sections: &[Section]) -> Section {
    let records = sections.iter().filter(|section| section.id.starts_with("record-"));
    let outputs: Vec<&Section> = records.flat_map(|record| &record.parts).collect();
    let tables = outputs.iter().flat_map(|output| &output.tables).filter(|table| is_of_tests(table));
    let mut tests: Vec<&str> = vec![];
    for test in tables.flat_map(|table| &table.rows).filter_map(|row| row.first()) {
        if !tests.contains(&test.text()) {
            tests.push(test.text());
        }
    }
    let text = match tests.is_empty() {
        true => "No test was made: the residuals are fewer than 20, or do not vary.".to_owned(),
        false => format!("All tests of all outputs passed: {}.", tests.join("; ")),
    };
    Section::new("residuals", "Tests of the residuals").says(text)
}

/// Whether a table has the results of tests.
fn is_of_tests(table: &Table) -> bool {
    table.columns.first().is_some_and(|first| first == "test")
}
