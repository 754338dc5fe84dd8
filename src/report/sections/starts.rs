//! The minima that searches from several starts found.

use crate::estimate::{FailedStart, Minimum, Starts};
use crate::numeral::number;
use crate::report::facts::Facts;
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};

/// Minima, and failures, in a table.
const LISTED: usize = 10;
/// Unknowns whose values at the minima are listed.
const UNKNOWNS: usize = 20;

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
    let section = match starts.failed.iter().all(|failed| failed.evaluated) {
        true => section,
        false => {
            section.says("Narrower bounds keep the starts away from where the model cannot be simulated.".to_owned())
        }
    };
    let section = section.table(minima(starts)).table(places(starts));
    Some(section.table(failed(starts)).plot(waterfall(&starts.minima)))
}

fn at(unknowns: &[(String, f64)]) -> Cell {
    let places = unknowns.iter().map(|(name, value)| format!("{name} = {}", number(*value, 4)));
    places.collect::<Vec<_>>().join(", ").into()
}

fn minima(starts: &Starts) -> Table {
    let row = |(i, minimum): (usize, &Minimum)| {
        [Cell::from((i + 1) as u64), Cell::number(minimum.cost_ratio, 5), minimum.searches.into()]
    };
    let columns = ["minimum", "cost / estimate's", "searches"];
    Table::new("Minima found", columns).rows(starts.minima.iter().enumerate().map(row)).at_most(LISTED)
}

/// Where several minima are, a column each; a single one is the estimate.
fn places(starts: &Starts) -> Table {
    let shown = &starts.minima[..starts.minima.len().min(LISTED)];
    let numbers = (1..=shown.len()).map(|i| i.to_string());
    let columns = ["unknown".to_owned()].into_iter().chain(numbers).collect();
    let names = shown.first().map_or(&[][..], |minimum| &minimum.unknowns).iter().map(|(name, _)| name);
    let row = |(i, name): (usize, &String)| {
        let values = shown.iter().map(move |minimum| minimum.unknowns.get(i).map(|(_, value)| *value));
        [Cell::from(name.as_str())].into_iter().chain(values.map(|value| Cell::optional(value, 4))).collect::<Vec<_>>()
    };
    let table = Table { columns, ..Table::new("Unknowns at each minimum", []) };
    let several = shown.len() > 1;
    table.rows(names.enumerate().filter(|_| several).map(row)).at_most(UNKNOWNS)
}

fn failed(starts: &Starts) -> Table {
    let why = |failed: &FailedStart| failed.reason.replace('`', "'");
    let rows = starts.failed.iter().map(|failed| [at(&failed.start), why(failed).as_str().into()]);
    Table::new("Searches that found no minimum", ["began at", "why"]).rows(rows).at_most(LISTED)
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
    (!minima.is_empty()).then(|| Plot::of("starts", caption, title, Drawing::Curves(drawing)))
}
