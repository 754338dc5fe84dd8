//! The command `greybox`: physical parameters, with their intervals, from a model file and records, in a shell.
//!
//! A command is a file of this folder. All take the model, the records and the choices of a fit by the same options
//! (`arguments`), which a project file may hold as well (`project`).

mod arguments;
mod bootstrap;
mod check;
mod compare;
mod convert;
mod derived;
mod describe;
mod export;
mod fit;
mod fitting;
mod fleet;
mod models;
mod new;
mod output;
mod profile;
mod project;
mod records;
mod remedies;
mod residuals;
mod shell;
mod simulate;
mod terminal;

use arguments::{Arguments, Command};
use greybox::Severity;
use std::process::ExitCode;
use terminal::{Terminal, note};

/// Why a command has no result, as a sentence.
type Failure = Box<dyn std::error::Error>;

/// How well a command went: what scripts ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    /// The result may be used.
    Usable,
    /// It may be used with care: warnings say with what.
    WithCare,
    /// It is not to be used.
    NotUsable,
}

impl From<Severity> for Verdict {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Usable => Verdict::Usable,
            Severity::UsableWithCare => Verdict::WithCare,
            Severity::NotUsable => Verdict::NotUsable,
        }
    }
}

impl Verdict {
    /// The exit code; with `strict`, care is an error like the rest.
    fn code(self, strict: bool) -> u8 {
        match self {
            Verdict::Usable => 0,
            Verdict::WithCare if strict => 3,
            Verdict::WithCare => 2,
            Verdict::NotUsable => 3,
        }
    }
}

fn main() -> ExitCode {
    let arguments = match project::arguments(std::env::args_os().collect()) {
        Ok(arguments) => arguments,
        Err(project::Refused::Usage(error)) => {
            // Help and version are no errors; their text goes to standard output.
            let code = u8::from(error.use_stderr());
            let _ = error.print();
            return code.into();
        }
        Err(project::Refused::Project(text)) => {
            note(format_args!("error: {text}"));
            return 1.into();
        }
    };
    let terminal = Terminal::new(arguments.quiet);
    match run(&arguments, &terminal) {
        Ok(verdict) => verdict.code(arguments.strict).into(),
        Err(error) => {
            let text = remedies::in_shell(&error.to_string());
            // A mistake in a model file is shown with its place, after the same word.
            let word = if text.starts_with("error: ") { "" } else { "error: " };
            note(format_args!("{word}{text}"));
            1.into()
        }
    }
}

fn run(arguments: &Arguments, terminal: &Terminal) -> Result<Verdict, Failure> {
    match &arguments.command {
        Command::Fit(one) => fit::run(one, terminal),
        Command::Simulate(one) => simulate::run(one, terminal),
        Command::Compare(one) => compare::run(one, terminal),
        Command::Residuals(one) => residuals::run(one, terminal),
        Command::Profile(one) => profile::run(one, terminal),
        Command::Bootstrap(one) => bootstrap::run(one, terminal),
        Command::Fleet(one) => fleet::run(one, terminal),
        Command::Check(one) => check::run(one, terminal),
        Command::Convert(one) => convert::run(one, terminal),
        Command::New(one) => new::run(one, terminal),
        Command::Models(one) => models::run(one),
        Command::Export(one) => export::run(one, terminal),
        Command::Completions(one) => shell::completions(one),
        Command::Man(one) => shell::man(one),
    }
}
