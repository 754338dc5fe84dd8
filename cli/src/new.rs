//! `new`: a commented model file to begin with.

use crate::arguments::New;
use crate::fitting::shipped;
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output};
use greybox::text::Model;
use std::io::{BufRead, IsTerminal, Write};

/// A tank that drains, with a remark for each thing that can be said.
const EXAMPLE: &str = include_str!("new.toml");

pub fn run(one: &New, terminal: &Terminal) -> Result<Verdict, Failure> {
    let text = match &one.from {
        Some(name) => shipped(name)?.to_owned(),
        None if one.ask => asked()?,
        None => EXAMPLE.to_owned(),
    };
    if let Some(path) = one.file.as_deref().filter(|path| path.exists() && !one.force) {
        return Err(format!("{}: the file is there already; name another, or add --force", path.display()).into());
    }
    output::write(one.file.as_deref(), text.as_bytes())?;
    if let Some(path) = &one.file {
        terminal.remark(format_args!("{0}: a model; next: greybox check {0}", path.display()));
    }
    Ok(Verdict::Usable)
}

/// A model of the answers at a terminal.
fn asked() -> Result<String, Failure> {
    if !std::io::stdin().is_terminal() {
        return Err("--ask needs a terminal; without it an example is written".into());
    }
    let mut text = String::from("greybox = 1\n");
    text += &format!("name = {:?}\n", ask("Name of the system")?);
    for (table, what) in [("inputs", "Inputs"), ("parameters", "Parameters")] {
        text += &format!("\n[{table}]\n");
        for (name, unit) in quantities(what)? {
            match table {
                "inputs" => text += &format!("{name} = {unit:?}\n"),
                _ => {
                    let start = ask(&format!("Where the search for {name} starts ({unit})"))?;
                    text += &format!(
                        "{name} = {{ unit = {unit:?}, start = {} }}\n",
                        crate::fitting::number(&name, &start)?
                    );
                }
            }
        }
    }
    text += "\n[states]\n";
    let states = quantities("States")?;
    for (name, unit) in &states {
        let derivative = ask(&format!("d({name})/dt ="))?;
        text += &format!("{name} = {{ unit = {unit:?}, derivative = {derivative:?} }}\n");
    }
    text += "\n[outputs]\n";
    for (name, unit) in quantities("Measured outputs")? {
        let value = ask(&format!("{name} ="))?;
        text += &format!("{name} = {{ unit = {unit:?}, value = {value:?} }}\n");
    }
    Model::named("the model", &text)?;
    Ok(text)
}

/// Names with their units, as `ud V, uq V, w rad/s`.
fn quantities(what: &str) -> Result<Vec<(String, String)>, Failure> {
    let answer = ask(&format!("{what}, each with its unit (ud V, w rad/s)"))?;
    let one = |text: &str| {
        let (name, unit) = text.trim().split_once(' ').unwrap_or((text.trim(), "1"));
        (name.to_owned(), unit.trim().to_owned())
    };
    Ok(answer.split(',').filter(|text| !text.trim().is_empty()).map(one).collect())
}

fn ask(question: &str) -> Result<String, Failure> {
    eprint!("{question}: ");
    std::io::stderr().flush()?;
    let mut answer = String::new();
    if std::io::stdin().lock().read_line(&mut answer)? == 0 {
        return Err("the questions were not answered to the end; nothing was written".into());
    }
    Ok(answer.trim().to_owned())
}
