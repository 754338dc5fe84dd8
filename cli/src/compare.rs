//! `compare`: several models or estimates on the same records, on one page.

use crate::arguments::Compare;
use crate::fitting::{Loaded, declared, estimate, expanded, model, watched};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fit, output, records};
use greybox::diagnose::Compared;
use greybox::problem::Problem;
use greybox::record::Record;
use greybox::report::{Cell, Section, Table};
use greybox::{Report, Summary};
use std::path::PathBuf;

/// A model with its estimate.
struct Entrant {
    title: String,
    loaded: Loaded,
    problem: Problem<'static>,
    estimate: Summary,
}

impl Entrant {
    /// The estimate for a record that was fitted, by its place: records may have equal names.
    fn of_record(&self, k: usize) -> Summary {
        let (experiments, records) = (&self.estimate.experiments, &self.loaded.records);
        let is_of = |(name, record): (&str, &Record)| {
            name.strip_prefix(record.name()).is_some_and(|rest| rest.is_empty() || rest.starts_with(" #"))
        };
        let names = experiments.iter().map(|experiment| experiment.name.as_str());
        let fitted = experiments.len() == records.len() && names.zip(records).all(is_of);
        self.estimate.of_experiment(k).filter(|_| fitted).unwrap_or_else(|| self.estimate.clone())
    }
}

pub fn run(one: &Compare, terminal: &Terminal) -> Result<Verdict, Failure> {
    if one.records.is_empty() {
        return Err("no record is named; those before --validation are fitted, those after it predicted".into());
    }
    output::check(one.report.as_deref(), &output::REPORTS)?;
    let (files, validation) = (expanded(&one.records)?, expanded(&one.validation)?);
    let entrants = one.models.iter().map(|name| entrant(name, one, &files, terminal)).collect::<Result<Vec<_>, _>>()?;
    let Some(first) = entrants.first() else { return Err("no model is named: --model MODEL".into()) };
    let mut compared = vec![];
    for (k, record) in first.loaded.records.iter().enumerate() {
        let of = |entrant: &Entrant| Ok((entrant.of_record(k), entrant.loaded.records[k].clone()));
        compared.push(predicted(Compared::estimation(record), &entrants, of)?);
    }
    for path in &validation {
        let read = |entrant: &Entrant| {
            records::one(path, &entrant.loaded.model, &one.of_records, &one.of_model.values.initial, &terminal.silent())
        };
        let record = read(first)?;
        // Parameters that each record has for itself tell nothing of another one.
        if let Some(error) = entrants.iter().find_map(|entrant| entrant.estimate.of_record(&record).err()) {
            terminal.remark(format_args!("{} is left out: {error}", path.display()));
            continue;
        }
        let of = |entrant: &Entrant| Ok((entrant.estimate.clone(), read(entrant)?));
        compared.push(predicted(Compared::validation(&record), &entrants, of)?);
    }
    let report = fit::report(&first.problem, &first.estimate, &first.loaded, &[])?;
    let mut short = Report { sections: vec![], severity: first.estimate.severity(), ..report.clone() };
    let sections = [Section::from(compared), summary(&entrants)];
    let mut whole = report;
    for section in sections {
        short = short.with(section.clone());
        whole = whole.with(section);
    }
    output::line(if terminal.colored() { short.to_colored_text() } else { short.to_string() })?;
    if let Some(path) = &one.report {
        output::report(path, &whole.titled("Comparison of models"))?;
        terminal.remark(format_args!("report: {}", path.display()));
    }
    // The verdict is that of the best one.
    let best = entrants.iter().map(|one| one.estimate.severity()).min();
    Ok(best.map_or(Verdict::NotUsable, Verdict::from))
}

/// Reads a model, with its estimate or fitted.
fn entrant(name: &str, one: &Compare, files: &[PathBuf], terminal: &Terminal) -> Result<Entrant, Failure> {
    let (name, stored) = match name.rsplit_once(':') {
        Some((name, stored)) if stored.ends_with(".json") => (name, Some(PathBuf::from(stored))),
        _ => (name, None),
    };
    let model = model(Some(name), &one.of_model.values.constant, terminal)?;
    let parameters = declared(&model, &one.of_model)?;
    let records = records::all(files, &model, &one.of_records, &one.of_model.values.initial, terminal)?;
    let loaded = Loaded { model, files: files.to_vec(), records, parameters };
    let problem = watched(&loaded, &one.of_fit, terminal)?.problem()?;
    let estimate = match &stored {
        Some(path) => {
            let found = estimate(path)?;
            if found.layout.parameters != loaded.model.equations().layout().parameters {
                return Err(format!("{}: the estimate is of a model with other parameters", path.display()).into());
            }
            found
        }
        None => problem.run()?,
    };
    let title = match &stored {
        Some(path) => format!("{name} ({})", path.display()),
        None => name.to_owned(),
    };
    Ok(Entrant { title, loaded, problem, estimate })
}

/// A record with what each model predicts of it, by the estimate that is for it.
fn predicted(
    compared: Compared,
    entrants: &[Entrant],
    of: impl Fn(&Entrant) -> Result<(Summary, Record), Failure>,
) -> Result<Compared, Failure> {
    let with = |compared: Compared, entrant: &Entrant| {
        let (estimate, record) = of(entrant)?;
        let prediction = entrant.problem.predict(&estimate, &record)?;
        Ok::<_, Failure>(compared.with(&entrant.title, &prediction)?)
    };
    entrants.iter().try_fold(compared, with)
}

/// Criteria of each model.
fn summary(entrants: &[Entrant]) -> Section {
    let row = |one: &Entrant| {
        let unknowns = Cell::from(one.estimate.unknowns.len() as u64);
        [
            Cell::from(one.title.as_str()),
            unknowns,
            Cell::number(one.estimate.cost, 6),
            Cell::optional(one.estimate.aic(), 6),
        ]
    };
    let table = Table::new("Criteria", ["model", "unknowns", "cost", "AIC"]).rows(entrants.iter().map(row));
    Section::new("criteria", "Criteria of each model").table(table)
}
