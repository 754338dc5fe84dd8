//! What was examined of the estimate, and what was not.

use crate::estimate::described;
use crate::report::facts::Facts;
use crate::section::{Section, Table};

pub(super) fn section(facts: &Facts) -> Section {
    let examined = &facts.estimate.examined;
    let rows = examined.iter().map(|one| [one.check.to_string().into(), one.extent.to_string().into()]);
    let table = Table::new("Checks", ["check", "examined"]).rows(rows);
    let section = Section::new("checks", "What was examined").says(format!("{}.", described(examined)));
    Section { folded: true, ..section.table(table) }
}
