//! Which unknowns the records tell apart, and where they do.

use crate::numeral::number;
use crate::report::facts::Facts;
use crate::section::{Cell, Drawing, Heat, Plot, Section, Table};

/// Parameters in a matrix of correlations.
const MATRIX: usize = 20;
/// Pairs of estimates that are named.
const PAIRS: usize = 20;
/// Rows of the tables.
const SHOWN: usize = 40;

pub(super) fn section(facts: &Facts) -> Section {
    let found = &facts.identifiability;
    let section = Section::new("identifiability", "What the data tell apart").says(rank(facts));
    let section = found.advice.iter().fold(section, |section, text| section.says(sentence(text)));
    let correlations = pairs(facts);
    let section = match correlations.rows.is_empty() {
        true => section.says("No two estimates are correlated by more than 0.95."),
        false => section.table(correlations),
    };
    section.table(excitation(facts)).plot(matrix(facts)).plot(excited(facts)).part(numbers(facts))
}

/// A sentence as it stands at the begin of a paragraph.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_uppercase().collect::<String>()).unwrap_or_default();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}

/// Rank and condition in a sentence.
fn rank(facts: &Facts) -> String {
    let found = &facts.identifiability;
    let n = found.unknowns.len();
    let condition = found.condition.map_or("beyond rounding".to_owned(), |condition| number(condition, 3));
    match found.rank as usize == n {
        true => format!(
            "The records tell all {n} unknowns apart (condition number of the scaled sensitivities {condition})."
        ),
        false => {
            format!("The records do not tell all unknowns apart: the sensitivities have rank {} of {n}.", found.rank)
        }
    }
}

/// Pairs of estimates that are hard to tell apart, most so first.
fn pairs(facts: &Facts) -> Table {
    const STRONG: f64 = 0.95;
    let n = facts.estimate.unknowns.len().min(facts.correlation.size());
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (j, i, facts.correlation[(i, j)])));
    let mut strong: Vec<_> = pairs.filter(|(_, _, r)| r.abs() > STRONG).collect();
    strong.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let name = |i: usize| Cell::from(facts.estimate.unknowns[i].name.as_str());
    let row = |(i, j, r): (usize, usize, f64)| [name(i), name(j), Cell::number(r, 4)];
    let caption = "Strongly correlated estimates, known better together than alone";
    Table::new(caption, ["estimate", "with", "correlation"]).rows(strong.into_iter().map(row)).at_most(PAIRS)
}

/// The parameters of the matrix of correlations: their numbers among the unknowns.
fn shown(facts: &Facts) -> Vec<usize> {
    let n = facts.correlation.size();
    facts.unknowns(false).map(|(i, _)| i).filter(|i| *i < n).take(MATRIX).collect()
}

/// Correlation of two unknowns, if both have an interval.
fn correlation(facts: &Facts, i: usize, j: usize) -> Option<f64> {
    let known = |i: usize| facts.estimate.unknowns[i].knowledge.standard_error().is_some();
    // Adding a zero takes the sign from one.
    (known(i) && known(j)).then(|| facts.correlation[(i, j)] + 0.0)
}

/// Which estimates go together, in color; from two parameters on.
fn matrix(facts: &Facts) -> Option<Plot> {
    let shown = shown(facts);
    let cells = |i: &usize| shown.iter().map(|j| correlation(facts, *i, *j)).collect();
    let label = |(number, i): (usize, &usize)| format!("{} {}", number + 1, facts.estimate.unknowns[*i].name);
    let heat = Heat {
        rows: shown.iter().enumerate().map(label).collect(),
        columns: (1..=shown.len()).map(|j| j.to_string()).collect(),
        cells: shown.iter().map(cells).collect(),
        percent: false,
    };
    let plot =
        Plot::of("correlation", "Correlation of the parameters", "Correlation of the parameters", Drawing::Heat(heat));
    (shown.len() > 1).then_some(plot)
}

/// The rows as numbers.
fn numbers(facts: &Facts) -> Option<Section> {
    let shown = shown(facts);
    let columns = ["parameter".to_owned()].into_iter().chain((1..=shown.len()).map(|j| j.to_string())).collect();
    let rows = shown.iter().enumerate().map(|(number, i)| {
        let label = format!("{} {}", number + 1, facts.estimate.unknowns[*i].name);
        let cell = |j: &usize| correlation(facts, *i, *j).map_or("-".into(), |r| Cell::number(r, 4));
        [Cell::from(label)].into_iter().chain(shown.iter().map(cell)).collect::<Vec<_>>()
    });
    let table = Table { columns, ..Table::new("Correlation of the parameters", []) }.rows(rows);
    let section = Section::new("correlations", "Correlations as numbers").table(table).folded();
    (shown.len() > 1).then_some(section)
}

/// How strongly each unknown is excited, and which output shows it.
fn excitation(facts: &Facts) -> Table {
    let unknowns = facts.unknowns(false).chain(facts.unknowns(true));
    let rows = unknowns.filter_map(|(i, _)| facts.identifiability.excitation.get(i)).map(|excited| {
        let through = excited.outputs.iter().filter(|(_, share)| *share >= 5e-4);
        let through: Vec<String> =
            through.map(|(output, share)| format!("{output} {} %", number(100.0 * share, 3))).collect();
        let strength = Cell::number(excited.strength / 100.0, 3);
        [excited.name.as_str().into(), strength, through.join(", ").into()]
    });
    Table::new("Excitation", ["unknown", "σ of noise per 1 %", "seen through"]).rows(rows).at_most(SHOWN)
}

/// Where in the records each parameter is excited: by tenths of one record, or by records.
fn excited(facts: &Facts) -> Option<Plot> {
    /// Records with a column of their own; more are taken together.
    const COLUMNS: usize = 24;
    let rows: Vec<_> =
        facts.unknowns(false).filter_map(|(i, _)| facts.identifiability.excitation.get(i)).take(MATRIX).collect();
    let single = facts.single();
    let group = facts.records.len().div_ceil(COLUMNS).max(1);
    let columns = match single {
        true => rows.first()?.segments.len(),
        false => facts.records.len().div_ceil(group),
    };
    let cells = |excited: &&crate::diagnose::Excitation| {
        let mut shares = vec![0.0; columns];
        let mut record = 0;
        for (k, segment) in excited.segments.iter().enumerate() {
            record += usize::from(k > 0 && excited.segments[k - 1].experiment != segment.experiment);
            let column = if single { k } else { record / group };
            if let Some(share) = shares.get_mut(column) {
                *share += segment.share;
            }
        }
        shares.into_iter().map(Some).collect()
    };
    let heat = Heat {
        columns: (1..=columns).map(|column| (1 + (column - 1) * if single { 1 } else { group }).to_string()).collect(),
        rows: rows.iter().map(|excited| excited.name.clone()).collect(),
        cells: rows.iter().map(cells).collect(),
        percent: true,
    };
    let caption = match (single, group) {
        (true, _) => "Part of each parameter's information (%) from each tenth of the record".to_owned(),
        (false, 1) => "Part of each parameter's information (%) from each record".to_owned(),
        (false, group) => {
            format!("Part of each parameter's information (%) from {group} records each, the first named")
        }
    };
    Some(Plot::of("excitation", &caption, &caption, Drawing::Heat(heat))).filter(|_| !rows.is_empty())
}
