//! `fit`: parameters, with their intervals.

use crate::arguments::Fit;
use crate::derived::{self, Computed};
use crate::fitting::{Loaded, load, read, watched};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output};
use greybox::problem::Problem;
use greybox::report::{Cell, Origin, Section, Table};
use greybox::{Report, Summary};

pub fn run(one: &Fit, terminal: &Terminal) -> Result<Verdict, Failure> {
    output::check(one.json.as_deref(), &[])?;
    output::check(one.report.as_deref(), &output::REPORTS)?;
    output::check(one.plot.as_deref(), if cfg!(feature = "png") { &["svg", "png"] } else { &["svg"] })?;
    output::apart([&one.json, &one.report, &one.plot, &one.fitting.of_fit.checkpoint], read(&one.fitting)?)?;
    let loaded = load(&one.fitting, terminal)?;
    let expressions = derived::expressions(&one.derived, &loaded.model)?;
    let problem = watched(&loaded, &one.fitting.of_fit, terminal)?.problem()?;
    let mut estimate = problem.run()?;
    if terminal.stopped() {
        terminal.remark("ended by Ctrl-C: this is the best so far");
    }
    let derived = derived::computed(&expressions, &estimate);
    estimate.derived = derived.iter().map(|one| one.derived.clone()).collect();
    let wanted = one.full || one.report.is_some() || one.plot.is_some();
    let report = if wanted { Some(report(&problem, &estimate, &loaded, &derived)?) } else { None };
    match &report {
        Some(report) if one.full => {
            output::line(if terminal.colored() { report.to_colored_text() } else { report.to_string() })?
        }
        _ => {
            output::estimate(&estimate)?;
            derived.iter().try_for_each(|one| output::line(&one.text))?;
        }
    }
    if let Some(path) = &one.json {
        output::write(Some(path), estimate.to_json()?.as_bytes())?;
    }
    if let (Some(report), Some(path)) = (&report, &one.report) {
        output::report(path, report)?;
        terminal.remark(format_args!("report: {}", path.display()));
    }
    if let (Some(report), Some(path)) = (&report, &one.plot) {
        let plot = report.plots().into_iter().find(|plot| plot.name.starts_with("record-"));
        let plot = plot.ok_or("the report has no drawing of a record")?;
        let drawing = match output::ending(path).as_str() {
            #[cfg(feature = "png")]
            "png" => plot.to_png()?,
            _ => plot.to_svg().into_bytes(),
        };
        output::write(Some(path), &drawing)?;
        terminal.remark(format_args!("plot: {}", path.display()));
    }
    let said = report.map_or(estimate.severity(), |report| report.severity.max(estimate.severity()));
    Ok(said.into())
}

/// The report of a fit, with where it came from.
pub fn report(
    problem: &Problem<'_>,
    estimate: &Summary,
    loaded: &Loaded,
    derived: &[Computed],
) -> Result<Report, Failure> {
    let mut origin = Origin::new().command(std::env::args()).at(std::time::SystemTime::now());
    for path in &loaded.files {
        origin = origin.file(path)?;
    }
    let title = match loaded.model.name() {
        "" => "Parameter estimation".to_owned(),
        name => name.to_owned(),
    };
    let mut report = Report::new(problem, estimate)?.titled(title).made_from(origin);
    report.sections.insert(0, Section::from(&loaded.model));
    if derived.is_empty() {
        return Ok(report);
    }
    let row = |Computed { derived: one, .. }: &Computed| {
        let (lower, upper) = one.interval.map_or((None, None), |(lower, upper)| (Some(lower), Some(upper)));
        [
            Cell::from(one.name.as_str()),
            Cell::number(one.value, 6),
            Cell::optional(one.standard_error, 2),
            Cell::optional(lower, 6),
            Cell::optional(upper, 6),
        ]
    };
    let table = Table::new("", ["quantity", "value", "std. error", "from", "to"]).rows(derived.iter().map(row));
    let section = Section::new("derived", "Quantities computed from the parameters").table(table);
    let unknown = derived.iter().filter(|one| one.derived.interval.is_none());
    Ok(report.with(unknown.fold(section, |section, one| section.says(&one.text))))
}
