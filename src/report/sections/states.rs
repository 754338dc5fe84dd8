//! The states of a record by a filter.

use crate::report::facts::{Record, State};
use crate::section::{Cell, Section, Table};

/// The states smoothed and filtered, over time and in a table; `None` where the predictor is no filter.
pub(super) fn section(number: usize, record: &Record) -> Option<Section> {
    let section = Section::new(format!("states-{number}"), format!("States: {}", record.name));
    let states = match record.states.as_ref()? {
        Ok(states) => states,
        Err(reason) => return Some(section.says(format!("The states are not shown: {reason}."))),
    };
    let row = |State { name, unit, range, deviations: [smoothed, filtered] }: &State| {
        let end = |end: Option<f64>| end.map_or("-".into(), |end| Cell::number(end, 4));
        [
            name.as_str().into(),
            end(range.map(|range| range.0)),
            end(range.map(|range| range.1)),
            Cell::number(*smoothed, 3),
            Cell::number(*filtered, 3),
            unit.as_str().into(),
        ]
    };
    let columns = ["state", "least", "greatest", "deviation", "filtered", "unit"];
    let caption =
        "States, smoothed: least and greatest value, standard deviation (rms), and that of the filtered state";
    let section = section
        .says(
            "The smoothed state is estimated from all measurements of the record, the filtered one from those up to the sample. The band holds \
             the state with 95 %; parameters, and an initial state that is estimated, count as known.",
        )
        .table(Table::new(caption, columns).rows(states.all.iter().map(row)));
    let timeline = states.timeline.clone();
    Some(section.plot(timeline))
}
