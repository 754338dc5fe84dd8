//! The minima that searches from several starts found.

use crate::estimate::{Minimum, Starts};
use crate::numeral::number;
use crate::report::facts::Facts;
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};

/// Rows of a table.
const LISTED: usize = 10;

/// The minima and the failures as tables, and the searches by rising cost as a waterfall plot.
pub(super) fn section(facts: &Facts) -> Option<Section> {
    let starts = facts.estimate.starts.as_ref()?;
    let section = Section::new("starts", "Searches from several starts").says(format!("{starts}."));
    let section = match starts.declared {
        Some(declared) if declared > 0 => {
            section.says(format!("The declared start ended in minimum {} of the table.", declared + 1))
        }
        Some(_) => section,
        None => section.says("The search from the declared start found no minimum.".to_owned()),
    };
    Some(section.table(minima(starts)).table(failed(starts)).plot(waterfall(&starts.minima)))
}

fn at(unknowns: &[(String, f64)]) -> Cell {
    let places = unknowns.iter().map(|(name, value)| format!("{name} = {}", number(*value, 4)));
    places.collect::<Vec<_>>().join(", ").into()
}

fn minima(starts: &Starts) -> Table {
    let row = |(i, minimum): (usize, &Minimum)| {
        let Minimum { cost_ratio, searches, unknowns } = minimum;
        [Cell::from((i + 1) as u64), Cell::number(*cost_ratio, 5), (*searches).into(), at(unknowns)]
    };
    let columns = ["minimum", "cost / estimate's", "searches", "at"];
    Table::new("Minima found", columns).rows(starts.minima.iter().enumerate().map(row)).at_most(LISTED)
}

fn failed(starts: &Starts) -> Table {
    let rows = starts.failed.iter().map(|failed| [failed.reason.replace('`', "'").as_str().into(), at(&failed.start)]);
    Table::new("Searches that found no minimum", ["why", "began at"]).rows(rows).at_most(LISTED)
}

fn waterfall(minima: &[Minimum]) -> Option<Plot> {
    let mut points = vec![];
    let mut before = 0.0;
    for minimum in minima {
        let after = before + minimum.searches as f64;
        points.extend([(before, minimum.cost_ratio), (after, minimum.cost_ratio)]);
        before = after;
    }
    let layers =
        vec![Layer::Line { style: Style::Main, points }, Layer::Level { value: 1.0, label: "the estimate".to_owned() }];
    let drawing = Curves {
        x: Axis::new("searches, the best first", "").from(0.0),
        y: Axis::new("cost / estimate's", "").logarithmic(),
        layers,
    };
    let title = "Cost at the end of each search from another start, by rising cost, relative to the estimate's";
    let caption = "Cost where each search ended; a step is a minimum";
    (!minima.is_empty()).then(|| Plot::new("starts", caption, title, Drawing::Curves(drawing)))
}
