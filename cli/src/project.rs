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

mod subject;

use crate::arguments::Arguments;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command, CommandFactory, Parser};
use std::ffi::OsString;
use std::path::Path;
use subject::Subject;
use toml::{Table, Value};

/// The file's name, in the current folder.
pub const FILE: &str = "greybox.toml";

/// Why there are no arguments.
pub enum Refused {
    Usage(clap::Error),
    Project(String),
}

/// The arguments of the command line, after those of the project file that its command takes.
pub fn arguments(words: Vec<OsString>) -> Result<Arguments, Refused> {
    let command = Arguments::command();
    // Help, the version and what is wrong with the command line itself need no project.
    let given = command.clone().try_get_matches_from(&words);
    let given = given.map_err(|error| Refused::Usage(explained(error, &command)))?;
    let words = with_project(&command, &given, words).map_err(|text| Refused::Project(format!("{FILE}: {text}")))?;
    // The command line by itself is right: what is wrong now is of the file.
    let of_file =
        |error: clap::Error| format!("{FILE}: {}", error.to_string().trim_start_matches("error: ").trim_end());
    Arguments::try_parse_from(words).map_err(|error| Refused::Project(of_file(error)))
}

/// The error of an option that only other commands have, which names them.
fn explained(mut error: clap::Error, command: &Command) -> clap::Error {
    let Some(ContextValue::String(said)) = error.get(ContextKind::InvalidArg) else { return error };
    let named = said.trim_start_matches("--");
    let has = |one: &&Command| one.get_arguments().any(|option| option.get_long() == Some(named));
    let names: Vec<&str> = command.get_subcommands().filter(has).map(Command::get_name).collect();
    if error.kind() == ErrorKind::UnknownArgument && !names.is_empty() {
        let tip = format!("it has no meaning here; it is an option of {}", names.join(", "));
        error.remove(ContextKind::SuggestedArg);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// The words of the command line, with the options of the project before them, and its model and records behind.
fn with_project(command: &Command, given: &ArgMatches, words: Vec<OsString>) -> Result<Vec<OsString>, String> {
    let named = given.subcommand().and_then(|(name, given)| Some((command.find_subcommand(name)?, given)));
    let Some((subcommand, given)) = named else { return Ok(words) };
    // A comparison names its models by options; it takes the other options of a project.
    let [takes_model, takes_records] =
        ["model", "records"].map(|name| subcommand.get_positionals().any(|one| one.get_id() == name));
    let Some(at) = words.iter().position(|word| word == subcommand.get_name()) else { return Ok(words) };
    let Some(table) = (takes_model || takes_records).then(read).transpose()?.flatten() else { return Ok(words) };
    let mut all = words[..=at].to_vec();
    all.extend(options(command, subcommand, given, &table)?);
    all.extend_from_slice(&words[at + 1..]);
    // A model of the command line stands in the place of the file's model and records.
    if takes_model
        && !given.contains_id("model")
        && let Some(model) = table.get("model")
    {
        let records = table.get("records").filter(|_| takes_records);
        let records = records.map_or(Ok(vec![]), |records| listed("records", records))?;
        all.extend(listed("model", model)?.into_iter().chain(records).map(OsString::from));
    }
    Ok(all)
}

/// The entries of the file, if it is there.
fn read() -> Result<Option<Table>, String> {
    if !Path::new(FILE).is_file() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(FILE).map_err(|error| error.to_string())?;
    text.parse().map(Some).map_err(|error: toml::de::Error| error.to_string())
}

/// The options of the project that a command takes, but for those about which the command line says something else.
fn options(
    command: &Command,
    subcommand: &Command,
    given: &ArgMatches,
    table: &Table,
) -> Result<Vec<OsString>, String> {
    let said: Vec<Subject> = subcommand.get_arguments().flat_map(|option| said(option, given)).collect();
    let own = || [subcommand, command].into_iter().flat_map(Command::get_arguments);
    let mut words = vec![];
    for (key, value) in table.iter().filter(|(key, _)| *key != "model" && *key != "records") {
        let named = |option: &&Arg| option.get_long() == Some(key.as_str());
        let mut all = own().chain(command.get_subcommands().flat_map(Command::get_arguments));
        let Some(option) = all.find(named) else {
            return Err(format!("there is no option `{key}`; `greybox help fit` lists them"));
        };
        let values = values(key, option, value)?;
        if !own().any(|option| named(&option)) || is_for_another(subcommand.get_name(), key) {
            continue;
        }
        let kept = values.into_iter().filter(|value| {
            let subject = Subject::new(option, value);
            !said.iter().any(|said| said.meets(&subject))
        });
        words.extend(kept.map(|value| match takes_value(option) {
            true => format!("--{key}={value}").into(),
            false => format!("--{key}").into(),
        }));
    }
    Ok(words)
}

/// Whether an option of a project is for another command than this one, which has an option of the same name: results are for the
/// command that they are of, noise is what a fit knows of its records, and each record of a fleet has all for itself.
fn is_for_another(command: &str, key: &str) -> bool {
    match key {
        "report" => command != "fit",
        "out" => command != "fleet",
        "noise" => command == "simulate",
        "per-record" => command == "fleet",
        _ => false,
    }
}

/// What the command line says by an option.
fn said(option: &Arg, given: &ArgMatches) -> Vec<Subject> {
    let id = option.get_id().as_str();
    if option.get_long().is_none() || given.value_source(id) != Some(ValueSource::CommandLine) {
        return vec![];
    }
    given.get_raw(id).into_iter().flatten().map(|value| Subject::new(option, &value.to_string_lossy())).collect()
}

fn takes_value(option: &Arg) -> bool {
    option.get_action().takes_values()
}

/// The values that an entry gives an option; `true` gives one to an option that takes none.
fn values(key: &str, option: &Arg, value: &Value) -> Result<Vec<String>, String> {
    match value {
        Value::Boolean(flag) if !takes_value(option) => Ok(flag.then(|| flag.to_string()).into_iter().collect()),
        _ if !takes_value(option) => Err(format!("`{key}` is true or false; it takes no other value")),
        Value::Boolean(flag) => Err(format!("`{key} = {flag}`: the option takes {}", kind(key, option))),
        Value::Table(table) => {
            let pair = |(name, value): (&String, &Value)| {
                let parts = listed(key, value)?;
                Ok(format!("{name}={}", parts.join(if key == "bounds" { ".." } else { "," })))
            };
            table.iter().map(pair).collect()
        }
        value => listed(key, value),
    }
}

/// What an option takes, as the file has it.
fn kind(key: &str, option: &Arg) -> String {
    let value = option.get_value_names().and_then(|names| names.first()).map_or("VALUE", |name| name.as_str());
    match value.split_once('=') {
        Some((name, value)) => format!("values by name: {key} = {{ {name} = \"{value}\" }}"),
        None if matches!(option.get_action(), ArgAction::Append) => format!("names: {key} = [\"{value}\"]"),
        None => format!("a value: {key} = \"{value}\""),
    }
}

/// The texts and numbers of a list, or the one that there is instead.
fn listed(key: &str, value: &Value) -> Result<Vec<String>, String> {
    let plain = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        Value::Float(number) => Ok(number.to_string()),
        other => Err(format!("`{key}`: a {} does not belong here", other.type_str())),
    };
    match value {
        Value::Array(values) => values.iter().map(plain).collect(),
        value => Ok(vec![plain(value)?]),
    }
}
