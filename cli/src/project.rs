//! The project file: options by their long names, which stand before those of the command line.
//!
//! ```toml
//! model = "motor.toml"
//! records = ["bench3.csv"]
//! column = { w = "speed_rpm" }
//! unit = { w = "rpm" }
//! starts = 20
//! report = "report.html"
//! ```

use crate::arguments::Arguments;
use clap::{CommandFactory, Parser};
use std::ffi::OsString;
use std::path::Path;
use toml::Value;

/// The file's name, in the current folder.
const FILE: &str = "greybox.toml";

/// Options that mean something else in these commands: those of a project are for `fit` and `fleet`.
const OTHERS: [(&str, &str); 5] =
    [("simulate", "noise"), ("simulate", "out"), ("convert", "out"), ("export", "out"), ("compare", "report")];

/// Why there are no arguments.
pub enum Refused {
    Usage(clap::Error),
    Project(String),
}

/// The arguments of the command line, after those of the project file that its command takes.
pub fn arguments(words: Vec<OsString>) -> Result<Arguments, Refused> {
    let usage = |words: &[OsString]| Arguments::try_parse_from(words).map_err(Refused::Usage);
    let path = Path::new(FILE);
    if !path.is_file() {
        return usage(&words);
    }
    let said = |text: String| Refused::Project(format!("{FILE}: {text}"));
    let text = std::fs::read_to_string(path).map_err(|error| said(error.to_string()))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| said(error.to_string()))?;
    let command = Arguments::command();
    if words.get(1).is_some_and(|word| word == "help") {
        return usage(&words);
    }
    let Some(at) = words.iter().position(|word| command.find_subcommand(word).is_some()) else { return usage(&words) };
    let Some(subcommand) = command.find_subcommand(&words[at]) else { return usage(&words) };
    let options: Vec<&str> = subcommand.get_arguments().filter_map(|option| option.get_long()).collect();
    let takes_model = subcommand.get_positionals().any(|one| one.get_id() == "model");
    // Its models and records are named by options; it takes the others.
    if !takes_model && subcommand.get_name() != "compare" {
        return usage(&words);
    }
    let means_another = |key: &str| OTHERS.contains(&(subcommand.get_name(), key));
    let (mut before, mut positionals) = (words[..=at].to_vec(), vec![]);
    let known: Vec<&str> = command
        .get_subcommands()
        .flat_map(|subcommand| subcommand.get_arguments())
        .filter_map(|option| option.get_long())
        .chain(["model", "records", "strict", "quiet"])
        .collect();
    for (key, value) in &table {
        let words = words_of(key, value).map_err(said)?;
        match key.as_str() {
            "model" | "records" => positionals.push((key.clone(), words)),
            _ if options.contains(&key.as_str()) && !means_another(key) || key == "strict" || key == "quiet" => {
                before.extend(words)
            }
            // An option of another command.
            _ if known.contains(&key.as_str()) => {}
            _ => return Err(said(format!("there is no option `{key}`; `greybox help fit` lists them"))),
        }
    }
    before.extend_from_slice(&words[at + 1..]);
    // Model and records of the command line stand in the place of the file's.
    let given = usage(&before)?;
    if model_of(&given) {
        return Ok(given);
    }
    positionals.sort_by_key(|(key, _)| key != "model");
    before.extend(positionals.into_iter().flat_map(|(_, words)| words));
    usage(&before)
}

/// Whether the command line names a model.
fn model_of(arguments: &Arguments) -> bool {
    use crate::arguments::Command;
    match &arguments.command {
        Command::Fit(one) => one.fitting.model.is_some(),
        Command::Residuals(one) => one.fitting.model.is_some(),
        Command::Profile(one) => one.refit.fitting.model.is_some(),
        Command::Bootstrap(one) => one.refit.fitting.model.is_some(),
        Command::Simulate(one) => one.model.is_some(),
        Command::Fleet(one) => one.model.is_some(),
        Command::Check(one) => one.model.is_some(),
        Command::Convert(one) => one.model.is_some(),
        Command::Export(one) => one.model.is_some(),
        Command::Compare(_) | Command::New(_) | Command::Models(_) | Command::Completions(_) | Command::Man(_) => true,
    }
}

/// An entry as words of the command line.
fn words_of(key: &str, value: &Value) -> Result<Vec<OsString>, String> {
    let plain = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        other => Err(format!("`{key}`: a {} does not belong here", other.type_str())),
    };
    let positional = key == "model" || key == "records";
    let word = |text: String| {
        if positional { OsString::from(text) } else { OsString::from(format!("--{key}={text}")) }
    };
    match value {
        Value::Boolean(true) => Ok(vec![format!("--{key}").into()]),
        Value::Boolean(false) => Ok(vec![]),
        Value::Array(values) => values.iter().map(|value| plain(value).map(word)).collect(),
        Value::Table(table) => {
            let pair = |(name, value): (&String, &Value)| {
                let text = match value {
                    Value::Array(parts) => {
                        let parts = parts.iter().map(plain).collect::<Result<Vec<_>, _>>()?;
                        parts.join(if key == "bounds" { ".." } else { "," })
                    }
                    value => plain(value)?,
                };
                Ok(word(format!("{name}={text}")))
            };
            table.iter().map(pair).collect()
        }
        value => Ok(vec![word(plain(value)?)]),
    }
}
