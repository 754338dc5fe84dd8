//! `compare`: several models or estimates on the same records, on one page.

use crate::arguments::Compare;
use crate::fitting::{Loaded, declared, estimate, expanded, model, same_parameters, watched};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fit, output, records};
use greybox::diagnose::Compared;
use greybox::estimate::{Method, NoiseModel};
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
    /// Whether the estimate is of these records and this model.
    own: bool,
}

impl Entrant {
    /// The estimate for a record that was fitted, by its place: records may have equal names.
    fn of_record(&self, k: usize) -> Summary {
        let fitted = labels(&self.loaded.records).eq(self.estimate.experiments.iter().map(|one| one.name.clone()));
        self.estimate.of_experiment(k).filter(|_| fitted).unwrap_or_else(|| self.estimate.clone())
    }

    /// Says whose values files of one name are given: a stored estimate has no other name of them than their places.
    fn say_places(&self, files: &[PathBuf], terminal: &Terminal) {
        let has_own = !self.estimate.own_parameters().is_empty();
        let numbered = files.iter().zip(&self.estimate.experiments).zip(&self.loaded.records);
        let numbered = numbered.filter(|((_, stored), record)| stored.name != record.name());
        let said: Vec<String> =
            numbered.map(|((file, stored), _)| format!("{} of `{}`", file.display(), stored.name)).collect();
        if has_own && !said.is_empty() {
            terminal.remark(format_args!(
                "{}: files of one name have the values of the fit's records in their order: {}",
                self.title,
                said.join(", ")
            ));
        }
    }
}

/// The names of records, numbered where they are equal, as those of an estimate.
fn labels(records: &[Record]) -> impl Iterator<Item = String> {
    let count = |all: &[Record], name: &str| all.iter().filter(|one| one.name() == name).count();
    records.iter().enumerate().map(move |(k, record)| match record.name() {
        name if count(records, name) > 1 => format!("{name} #{}", count(&records[..=k], name)),
        name => name.to_owned(),
    })
}

/// Refuses records of validation where each record of the fit has a parameter for itself: such a parameter tells nothing of another record.
fn shared(title: &str, parameters: &[&str], validation: &[PathBuf]) -> Result<(), Failure> {
    match (parameters, validation) {
        ([name, ..], [path, ..]) => Err(format!(
            "{}: parameter `{name}` of {title} has a value for each record of the fit, and a record of validation has none; \
             leave --validation out, or have all records share `{name}`",
            path.display()
        )
        .into()),
        _ => Ok(()),
    }
}

pub fn run(one: &Compare, terminal: &Terminal) -> Result<Verdict, Failure> {
    if one.records.is_empty() {
        return Err("no record is named; those before --validation are fitted, those after it predicted".into());
    }
    output::check(one.report.as_deref(), &output::REPORTS)?;
    let (files, validation) = (expanded(&one.records)?, expanded(&one.validation)?);
    let models =
        one.models.iter().map(|name| parts(name)).flat_map(|(name, stored)| stored.into_iter().chain([name.into()]));
    output::apart([&one.report], files.iter().chain(&validation).cloned().chain(models))?;
    let of_name = |name: &String| entrant(name, one, (&files, &validation), terminal);
    let entrants = one.models.iter().map(of_name).collect::<Result<Vec<_>, _>>()?;
    let Some(first) = entrants.first() else { return Err("no model is named: --model MODEL".into()) };
    let mut compared = vec![];
    for (k, (record, label)) in first.loaded.records.iter().zip(labels(&first.loaded.records)).enumerate() {
        let of = |entrant: &Entrant, _: usize| (entrant.of_record(k), entrant.loaded.records[k].clone());
        compared.push(predicted(Compared::estimation(&record.clone().named(label)), &entrants, of)?);
    }
    let read = |entrant: &Entrant| {
        let initial = &one.of_model.values.initial;
        records::all(&validation, &entrant.loaded.model, &one.of_records, initial, &terminal.silent())
    };
    let others = entrants.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    for (k, (record, label)) in others[0].iter().zip(labels(&others[0])).enumerate() {
        let of = |entrant: &Entrant, e: usize| (entrant.estimate.clone(), others[e][k].clone());
        compared.push(predicted(Compared::validation(&record.clone().named(label)), &entrants, of)?);
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

/// A model and, after a colon, its estimate.
fn parts(name: &str) -> (&str, Option<PathBuf>) {
    match name.rsplit_once(':') {
        Some((name, stored)) if stored.ends_with(".json") => (name, Some(PathBuf::from(stored))),
        _ => (name, None),
    }
}

/// Reads a model, with its estimate or fitted.
fn entrant(
    name: &str,
    one: &Compare,
    (files, validation): (&[PathBuf], &[PathBuf]),
    terminal: &Terminal,
) -> Result<Entrant, Failure> {
    let (name, stored) = parts(name);
    let model = model(Some(name), &one.of_model.values.constant, terminal)?;
    let parameters = declared(&model, &one.of_model)?;
    let records = records::all(files, &model, &one.of_records, &one.of_model.values.initial, terminal)?;
    let layout = model.equations().layout();
    let own = parameters.iter().zip(&layout.parameters).filter(|(one, _)| one.per_experiment);
    shared(name, &own.map(|(_, of)| of.name.as_str()).collect::<Vec<_>>(), validation)?;
    let loaded = Loaded { model, files: files.to_vec(), records, parameters };
    let problem = watched(&loaded, &one.of_fit, terminal)?.problem()?;
    let Some(path) = stored else {
        let estimate = problem.run()?;
        return Ok(Entrant { title: name.to_owned(), loaded, problem, estimate, own: true });
    };
    let (estimate, title) = (estimate(&path)?, format!("{name} ({})", path.display()));
    same_parameters(&path, &estimate, loaded.model.equations().layout())?;
    let own = estimate.own_parameters().into_iter().map(|j| estimate.parameters[j].name.as_str());
    shared(&title, &own.collect::<Vec<_>>(), validation)?;
    // One that is of other records or of an earlier version of the model has criteria of its own.
    let own = problem.reproduces(&estimate).unwrap_or(false);
    let entrant = Entrant { title, loaded, problem, estimate, own };
    entrant.say_places(files, terminal);
    Ok(entrant)
}

/// A record with what each model predicts of it, by the estimate that is for it.
fn predicted(
    compared: Compared,
    entrants: &[Entrant],
    of: impl Fn(&Entrant, usize) -> (Summary, Record),
) -> Result<Compared, Failure> {
    let with = |compared: Compared, (e, entrant): (usize, &Entrant)| {
        let (estimate, record) = of(entrant, e);
        let prediction = entrant.problem.predict(&estimate, &record)?;
        Ok::<_, Failure>(compared.with(&entrant.title, &prediction)?)
    };
    entrants.iter().enumerate().try_fold(compared, with)
}

/// Criteria of each model, and costs and AIC where those of all models are of one kind.
fn summary(entrants: &[Entrant]) -> Section {
    let own: Vec<&Summary> = entrants.iter().filter(|one| one.own).map(|one| &one.estimate).collect();
    let (costs, aics) =
        (are_alike(&own, weighed), are_alike(&own, |one| (one.method.prefilter.clone(), one.measurements)));
    let row = |one: &Entrant| {
        let unknowns = Cell::from(one.estimate.unknowns.len() as u64);
        [
            Cell::from(one.title.as_str()),
            Cell::from(one.estimate.severity().to_string()),
            unknowns,
            Cell::optional((one.own && costs).then_some(one.estimate.cost), 6),
            Cell::optional(one.estimate.aic().filter(|_| one.own && aics), 6),
        ]
    };
    let table = Table::new("Criteria", ["model", "verdict", "unknowns", "cost", "AIC"]).rows(entrants.iter().map(row));
    let section = Section::new("criteria", "Criteria of each model").table(table);
    let how = |one: &Entrant| {
        let method = &one.estimate.method;
        format!("{}: {}, noise {}, loss {}", one.title, method.predictor, method.noise, method.loss)
    };
    let how: Vec<String> = entrants.iter().filter(|one| one.own).map(how).collect();
    let said = [
        (!costs).then(|| format!("The costs are left out, because each is of errors that are weighed in another way ({}).", how.join("; "))),
        (!aics).then(|| "The AIC is left out, because each is of another pre-filter or another number of predicted samples.".to_owned()),
        entrants.iter().any(|one| !one.own).then(|| {
            "An estimate without cost and AIC is of other records, or of a model that has changed since; its verdict is that of its fit."
                .to_owned()
        }),
    ];
    said.into_iter().flatten().fold(section, Section::says)
}

/// Whether this is the same of all estimates.
fn are_alike<T: PartialEq>(all: &[&Summary], of: impl Fn(&Summary) -> T) -> bool {
    all.windows(2).all(|pair| of(pair[0]) == of(pair[1]))
}

/// Which errors the cost of an estimate is of, and the noise levels by which they are divided: none where the noise is predicted, or where
/// that of one output is but a factor of the cost.
fn weighed(one: &Summary) -> (Vec<String>, Vec<f64>) {
    let Method { predictor, loss, weighting, prefilter, noise, .. } = &one.method;
    let has_prior = one.parameters.iter().any(|parameter| parameter.declared.prior.is_some());
    let is_factor = one.outputs.len() == 1 && one.deviance.is_some() && !has_prior;
    let levels = match noise {
        NoiseModel::Predicted => vec![],
        NoiseModel::PerOutput | NoiseModel::Covariance if is_factor => vec![],
        _ => one.outputs.iter().map(|output| output.fit.sigma).collect(),
    };
    ([predictor, loss, weighting, prefilter, &noise.to_string()].map(String::clone).to_vec(), levels)
}
