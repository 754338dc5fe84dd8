//! Model, records and choices of the command line, made into a fit.

use crate::arguments::{FitOptions, Fitting, ModelOptions};
use crate::terminal::Terminal;
use crate::{Failure, records};
use argmin::core::observers::ObserverMode;
use greybox::equations::Equations;
use greybox::layout::{Layout, Quantity};
use greybox::record::Record;
use greybox::text::{self, Model};
use greybox::{Fit, Fleet, Initial, Parameter, Summary, fixed, free};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A model, the records, and what was said of both.
pub struct Loaded {
    pub model: Model,
    /// The files that it was read from.
    pub files: Vec<PathBuf>,
    pub records: Vec<Record>,
    pub parameters: Vec<Parameter>,
}

/// The files that a fit reads.
pub fn read(fitting: &Fitting) -> Result<Vec<PathBuf>, Failure> {
    let of_model = fitting.model.iter().map(PathBuf::from).filter(|path| path.exists());
    Ok(of_model.chain(expanded(&fitting.records)?).collect())
}

/// Reads the model and the records of a fit.
pub fn load(fitting: &Fitting, terminal: &Terminal) -> Result<Loaded, Failure> {
    let model = model(fitting.model.as_deref(), &fitting.of_model.values.constant, terminal)?;
    let parameters = declared(&model, &fitting.of_model)?;
    if fitting.records.is_empty() {
        return Err("no record is named; write its file after the model: greybox fit MODEL RECORD.csv".into());
    }
    let records =
        records::all(&fitting.records, &model, &fitting.of_records, &fitting.of_model.values.initial, terminal)?;
    Ok(Loaded { model, files: read(fitting)?, records, parameters })
}

/// Reads a model file, or one that ships, with its constants.
pub fn model(name: Option<&str>, constants: &[(String, String)], terminal: &Terminal) -> Result<Model, Failure> {
    let Some(name) = name else {
        return Err("no model is named; write its file, or the name of one that ships (greybox models)".into());
    };
    let mut model = match Path::new(name).exists() {
        true => Model::read(name)?,
        false => Model::shipped(name).map_err(|error| format!("there is no file `{name}`, and {error}"))?,
    };
    for (name, value) in constants {
        model.set_constant(name, number(&format!("--constant {name}"), value)?)?;
    }
    for warning in model.warnings() {
        terminal.remark(warning);
    }
    Ok(model)
}

/// The text of a model that ships.
pub fn shipped(name: &str) -> Result<&'static str, Failure> {
    let found = text::shipped().iter().find(|one| one.name == name);
    let available = || text::shipped().iter().map(|one| one.name.to_owned()).collect();
    let unknown = || greybox::Error::Unknown { what: "model".into(), name: name.into(), available: available() };
    Ok(found.ok_or_else(unknown)?.text)
}

/// The declarations of the parameters, with those of the command line.
pub fn declared(model: &Model, options: &ModelOptions) -> Result<Vec<Parameter>, Failure> {
    let layout = model.equations().layout();
    let mut all = model.parameters().to_vec();
    let mut change = |name: &str, change: &dyn Fn(Parameter) -> Parameter| -> Result<(), Failure> {
        let at = position(layout, name)?;
        all[at] = change(all[at]);
        Ok(())
    };
    for name in &options.free {
        change(name, &|one| Parameter { free: true, ..one })?;
    }
    for (name, value) in &options.values.set {
        let start = number(&format!("--set {name}"), value)?;
        change(name, &|one| Parameter { start, ..one })?;
    }
    for (name, value) in &options.values.fix {
        let start = number(&format!("--fix {name}"), value)?;
        change(name, &|one| Parameter { start, free: false, ..one })?;
    }
    for (name, value) in &options.bounds {
        let (lower, upper) = range(&format!("--bounds {name}"), value)?;
        let (lower, upper) = (lower.unwrap_or(f64::NEG_INFINITY), upper.unwrap_or(f64::INFINITY));
        change(name, &|one| one.within(lower, upper))?;
    }
    for (name, value) in &options.prior {
        let option = format!("--prior {name}");
        let Some((mean, std)) = value.split_once(',') else {
            return Err(format!("{option}: write mean and standard deviation, as in {name}=0.6,0.05").into());
        };
        let (mean, std) = (number(&option, mean)?, number(&option, std)?);
        change(name, &|one| one.prior(mean, std))?;
    }
    for name in &options.log {
        change(name, &Parameter::log)?;
    }
    for name in &options.positive {
        change(name, &Parameter::positive)?;
    }
    for name in &options.per_record {
        change(name, &Parameter::per_experiment)?;
    }
    Ok(all)
}

/// Where a parameter stands.
fn position(layout: &Layout, name: &str) -> Result<usize, Failure> {
    let names = layout.parameters.iter().map(|one| one.name.clone());
    let place = layout.parameters.iter().position(|one| one.name == name);
    let unknown =
        || greybox::Error::Unknown { what: "parameter".into(), name: name.into(), available: names.collect() };
    Ok(place.ok_or_else(unknown)?)
}

/// The state at the first sample, as the command line says it; `None` if it does not.
pub fn initial(layout: &Layout, said: &[String], before: &Initial) -> Result<Option<Initial>, Failure> {
    if said.is_empty() {
        return Ok(None);
    }
    match said {
        [one] if one == "first" => return Ok(Some(Initial::FirstSample)),
        [one] if one == "steady" => return Ok(Some(Initial::Steady)),
        _ => {}
    }
    if let Some(all) = said.iter().find(|one| *one == "first" || *one == "steady") {
        return Err(format!("--initial {all}: it is all that may be said of the initial state").into());
    }
    let mut all = match before {
        Initial::Given(given) => given.clone(),
        _ => vec![free(0.0); layout.states.len()],
    };
    for one in said {
        let (name, known, value) = match (one.split_once('='), one.split_once('~')) {
            (Some((name, value)), _) => (name, true, value),
            (None, Some((name, value))) => (name, false, value),
            _ => return Err(format!("--initial {one}: write NAME=VALUE, NAME~VALUE, first or steady").into()),
        };
        let value = number(&format!("--initial {name}"), value)?;
        let available = layout.states.iter().map(|state| state.name.clone()).collect();
        let unknown = || greybox::Error::Unknown { what: "state".into(), name: name.into(), available };
        let at = layout.states.iter().position(|state| state.name == name).ok_or_else(unknown)?;
        all[at] = if known { fixed(value) } else { free(value) };
    }
    Ok(Some(Initial::Given(all)))
}

/// The fit of these records with these choices.
pub fn fit<'a>(
    model: &'a Model,
    records: &[Record],
    parameters: &[Parameter],
    options: &FitOptions,
) -> Result<Fit<'a, Equations>, Failure> {
    let equations: &Equations = model.equations();
    let mut fit = match records {
        [] => Fleet::new(equations).parameters(parameters.to_vec()),
        records => Fit::new(equations, records).parameters(parameters.to_vec()),
    };
    if let Some(name) = options.integrator.as_deref().or(model.integrator()) {
        fit = fit.integrator_by_name(name)?;
    }
    if let Some(name) = options.predictor.as_deref().or(model.predictor()) {
        fit = fit.predictor_by_name(name)?;
    }
    fit = match options.predictor.as_deref().or(model.predictor()).filter(|name| is_filter(name)) {
        Some(filter) => without_noise(options, filter).map(|()| fit)?,
        None if options.noise_covariance => fit.noise_covariance(),
        None => fit.noise_by_name(pairs(&noise(model, &options.noise)?))?,
    };
    let input_noise = numbers("--input-noise", &options.input_noise)?;
    if !input_noise.is_empty() {
        fit = fit.input_noise_by_name(pairs(&input_noise))?;
    }
    if let Some(text) = &options.loss {
        fit = fit.loss_by_name(text)?;
    }
    if let Some(text) = &options.weight {
        let (graph, root) = model.weight(text)?;
        fit = fit.weighting_by(&graph, root);
    }
    if let Some(text) = &options.prefilter {
        fit = fit.prefilter_by_name(text)?;
    }
    if let Some(text) = &options.optimizer {
        fit = fit.optimizer_by_name(text)?;
    }
    if let Some(count) = options.starts {
        fit = fit.starts(count);
    }
    if options.staged {
        fit = fit.staged();
    }
    if options.multiple_shooting {
        fit = fit.multiple_shooting();
    }
    if let Some(limit) = time_limit(options)? {
        fit = fit.time_limit(limit);
    }
    if let Some(path) = &options.checkpoint {
        fit = fit.checkpoint(path, 10);
    }
    Ok(fit)
}

/// Whether a predictor is a filter, which takes the noise of the model.
fn is_filter(predictor: &str) -> bool {
    ["kalman", "second-order"].contains(&predictor.split(':').next().unwrap_or_default().trim())
}

/// Refuses noise of outputs that is said beside a filter.
fn without_noise(options: &FitOptions, filter: &str) -> Result<(), Failure> {
    let option = match (options.noise.first(), options.noise_covariance) {
        (Some((name, value)), _) => format!("--noise {name}={value}"),
        (None, true) => "--noise-covariance".to_owned(),
        (None, false) => return Ok(()),
    };
    Err(format!("{option} has no effect on the predictor {filter}, a filter: it takes `noise` of the model file")
        .into())
}

/// The noise of the outputs as the model file has it, and as it was said, which goes before.
fn noise(model: &Model, said: &[(String, String)]) -> Result<Vec<(String, f64)>, Failure> {
    let mut said = numbers("--noise", said)?;
    // The last one counts, as of other options.
    said.reverse();
    let mut known = std::collections::HashSet::new();
    said.retain(|(output, _)| known.insert(output.clone()));
    let outputs = model.equations().layout().outputs.iter().map(|output| output.name.clone());
    let declared = outputs.zip(model.noise()).filter_map(|(output, noise)| Some((output, noise?)));
    let mut all: Vec<(String, f64)> =
        declared.filter(|(output, _)| said.iter().all(|(name, _)| name != output)).collect();
    all.extend(said);
    Ok(all)
}

/// The same that shows its progress and ends by Ctrl-C.
pub fn watched<'a>(
    loaded: &'a Loaded,
    options: &FitOptions,
    terminal: &Terminal,
) -> Result<Fit<'a, Equations>, Failure> {
    let fit = fit(&loaded.model, &loaded.records, &loaded.parameters, options)?;
    let search = terminal.search(time_limit(options)?);
    Ok(fit.cancel(terminal.stop()).observe(search, ObserverMode::Always))
}

fn time_limit(options: &FitOptions) -> Result<Option<Duration>, Failure> {
    let limit = |seconds: f64| {
        Duration::try_from_secs_f64(seconds).map_err(|_| format!("--time-limit {seconds}: it must be positive seconds"))
    };
    Ok(options.time_limit.map(limit).transpose()?)
}

/// Reads an estimate that `fit --json` wrote.
pub fn estimate(path: &Path) -> Result<Summary, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(Summary::from_json(&text).map_err(|error| format!("{}: {error}", path.display()))?)
}

/// Refuses an estimate of a model that had other parameters.
pub fn same_parameters(path: &Path, found: &Summary, layout: &Layout) -> Result<(), Failure> {
    same("parameter", path, &found.layout.parameters, &layout.parameters)
}

/// Refuses an estimate of a model that had other states.
pub fn same_states(path: &Path, found: &Summary, layout: &Layout) -> Result<(), Failure> {
    same("state", path, &found.layout.states, &layout.states)
}

fn same(what: &str, path: &Path, found: &[Quantity], of_model: &[Quantity]) -> Result<(), Failure> {
    if found == of_model {
        return Ok(());
    }
    let unit = |one: &Quantity| if one.unit.is_empty() { "no unit".to_owned() } else { format!("\"{}\"", one.unit) };
    let difference = |one: &Quantity| match of_model.iter().find(|now| now.name == one.name) {
        None => Some(format!("it has `{}`, which is not in the model", one.name)),
        Some(now) if now.unit != one.unit => {
            Some(format!("`{}` is in {} in it and in {} in the model", one.name, unit(one), unit(now)))
        }
        Some(_) => None,
    };
    let added = of_model.iter().filter(|one| !found.iter().any(|before| before.name == one.name));
    let added = added.map(|one| format!("it has no `{}`, which is in the model", one.name));
    let mut differences: Vec<String> = found.iter().filter_map(difference).chain(added).collect();
    if differences.is_empty() {
        differences.push("they stand in another order".to_owned());
    }
    Err(format!(
        "{}: the estimate is of a model with other {what}s: {}; fit this model, or take the model of the estimate",
        path.display(),
        differences.join(", ")
    )
    .into())
}

/// Numbers by name.
pub fn numbers(option: &str, said: &[(String, String)]) -> Result<Vec<(String, f64)>, Failure> {
    said.iter().map(|(name, value)| Ok((name.clone(), number(&format!("{option} {name}"), value)?))).collect()
}

fn pairs(numbers: &[(String, f64)]) -> impl Iterator<Item = (&str, f64)> {
    numbers.iter().map(|(name, value)| (name.as_str(), *value))
}

pub fn number(what: &str, text: &str) -> Result<f64, Failure> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{what}: `{text}` is not a number").into()),
    }
}

/// `a..b`, of which either may be missing.
pub fn range(what: &str, text: &str) -> Result<(Option<f64>, Option<f64>), Failure> {
    let Some((from, to)) = text.split_once("..") else {
        return Err(format!("{what}: write two numbers with two points between, as in 0.01..10").into());
    };
    let end = |text: &str| if text.trim().is_empty() { Ok(None) } else { number(what, text).map(Some) };
    Ok((end(from)?, end(to)?))
}

/// The files of patterns such as `data/*.csv`, which some shells hand over as they are.
pub fn expanded(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut all = vec![];
    for path in paths {
        let text = path.to_string_lossy();
        if path.exists() || !text.contains(['*', '?', '[']) {
            all.push(path.clone());
            continue;
        }
        let before = all.len();
        for found in glob::glob(&text).map_err(|error| format!("{text}: {error}"))? {
            all.push(found.map_err(|error| error.to_string())?);
        }
        if all.len() == before {
            return Err(format!("{text}: no file has such a name").into());
        }
    }
    Ok(all)
}
