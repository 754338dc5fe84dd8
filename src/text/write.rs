//! From [`Equations`] to a model file.

use super::lex::is_name;
use super::read::RESERVED;
use super::remark::Error;
use crate::equations::{Equations, Roots};
use crate::graph::{Id, Leaf};
use crate::layout::{Kind, Layout, Quantity};
use crate::parameter::{Parameter, Transform};
use crate::scalar::{Extrapolation, Interpolation, Table};
use core::fmt::Write;
use std::collections::HashMap;

/// The file of equations and of a declaration for each parameter.
pub(super) fn file(equations: &Equations, name: &str, parameters: &[Parameter]) -> Result<String, Error> {
    let layout = equations.layout();
    check(layout, parameters)?;
    let (shared, table) = (free_word(layout, "_"), free_word(layout, "table"));
    let Roots { state, output, diffusion, noise, initial_noise, initial, delay, jump } = equations.roots();
    let counts = [state, output, diffusion, noise, initial_noise, initial, delay, jump].map(Vec::len);
    let lines = lines(equations, [&shared, &table]);
    let (definitions, roots) = lines.split_at(lines.len() - counts.iter().sum::<usize>());
    let mut rest = roots.iter().map(|(_, text)| text.as_str());
    let [rates, outputs, diffusion, noise, initial_noise, initial, delay, jump] =
        counts.map(|count| rest.by_ref().take(count).collect::<Vec<&str>>());

    let mut file = Writer { text: String::from("greybox = 1\n") };
    if !name.is_empty() {
        file.line(&format!("name = {}", quoted(name)));
    }
    let input = |(i, one): (usize, &'_ Quantity)| {
        let delay = delay.get(i).filter(|delay| **delay != "0");
        let text = delay.map(|delay| format!("{{ unit = {}, delay = {} }}", unit(one), quoted(delay)));
        (one.name.clone(), text.unwrap_or_else(|| unit(one)))
    };
    file.group("inputs", layout.inputs.iter().enumerate().map(input));
    let parameter = |(one, declared): (&'_ Quantity, &Parameter)| (one.name.clone(), declaration(one, declared));
    file.group("parameters", layout.parameters.iter().zip(parameters).map(parameter));
    for (i, one) in equations.graph().tables().iter().enumerate() {
        file.table(&format!("{table}{i}"), one);
    }
    file.group("let", definitions.iter().map(|(name, text)| (name.as_str(), quoted(text))));
    let key = if layout.kind == Kind::Discrete { "next" } else { "derivative" };
    let jumping = equations.jumping();
    let state = |(i, (one, rate)): (usize, (&'_ Quantity, &&str))| {
        let level =
            |name: &str, of: &[&str]| of.get(i).map_or(String::new(), |level| format!(", {name} = {}", quoted(level)));
        let begin = initial.get(i).filter(|initial| **initial != "nan");
        let begin = begin.map_or(String::new(), |initial| format!(", initial = {}", quoted(initial)));
        let levels = begin + &level("diffusion", &diffusion) + &level("initial_noise", &initial_noise);
        let jump = jump.get(i).filter(|_| jumping[i].is_some());
        let jump = jump.map_or(String::new(), |jump| format!(", jump = {}", quoted(jump)));
        (one.name.clone(), format!("{{ unit = {}, {key} = {}{jump}{levels} }}", unit(one), quoted(rate)))
    };
    file.group("states", layout.states.iter().zip(&rates).enumerate().map(state));
    let output = |(i, (one, value)): (usize, (&'_ Quantity, &&str))| {
        let noise = noise.get(i).filter(|level| **level != "nan");
        let noise = noise.map_or(String::new(), |level| format!(", noise = {}", quoted(level)));
        (one.name.clone(), format!("{{ value = {}, unit = {}{noise} }}", quoted(value), unit(one)))
    };
    file.group("outputs", layout.outputs.iter().zip(&outputs).enumerate().map(output));
    Ok(file.text)
}

/// Definitions, then the roots in their order.
fn lines(equations: &Equations, words: [&str; 2]) -> Vec<(String, String)> {
    let layout = equations.layout();
    let name = |leaf: Leaf| match leaf {
        Leaf::State(i) => in_expression(&layout.states[i as usize].name),
        Leaf::Input(i) => in_expression(&layout.inputs[i as usize].name),
        Leaf::Parameter(i) => in_expression(&layout.parameters[i as usize].name),
        _ => "t".to_owned(),
    };
    let roots: Vec<(String, Id)> = equations.roots().all().into_iter().map(|id| (String::new(), id)).collect();
    equations.graph().lines(&name, words, &roots)
}

/// A name as an expression has it.
fn in_expression(name: &str) -> String {
    if is_name(name) { name.to_owned() } else { format!("`{name}`") }
}

/// Each name must stand for one quantity, and be none of the words of expressions.
fn check(layout: &Layout, parameters: &[Parameter]) -> Result<(), Error> {
    let (found, expected) = (parameters.len(), layout.parameters.len());
    if found != expected {
        return Err(Error::Unwritable(format!("{found} parameter(s) are declared, the equations have {expected}")));
    }
    let mut roles: HashMap<&str, &str> = HashMap::new();
    let inputs = layout.inputs.iter().map(|one| ("an input", one));
    let parameters = layout.parameters.iter().map(|one| ("a parameter", one));
    let states = layout.states.iter().map(|one| ("a state", one));
    for (role, Quantity { name, .. }) in inputs.chain(parameters).chain(states) {
        if RESERVED.contains(&name.as_str()) {
            return Err(Error::Unwritable(format!(
                "{role} is called `{name}`, which is a word of expressions; rename it"
            )));
        }
        if name.contains('`') {
            return Err(Error::Unwritable(format!("{role} is called {name:?}; leave out the backtick")));
        }
        if let Some(other) = roles.insert(name, role) {
            return Err(Error::Unwritable(format!("`{name}` is {other} and {role}; rename one")));
        }
    }
    Ok(())
}

/// A word that begins no quantity's name.
fn free_word(layout: &Layout, word: &str) -> String {
    let mut word = word.to_owned();
    let all = || layout.states.iter().chain(&layout.inputs).chain(&layout.parameters);
    while all().any(|one| one.name.strip_prefix(&word).is_some_and(|rest| rest.parse::<u32>().is_ok())) {
        word.push('_');
    }
    word
}

fn unit(quantity: &Quantity) -> String {
    quoted(&quantity.unit)
}

/// A parameter's entries.
fn declaration(quantity: &Quantity, declared: &Parameter) -> String {
    let mut text = format!(
        "{{ unit = {}, {} = {:?}",
        unit(quantity),
        if declared.free { "start" } else { "fixed" },
        declared.start
    );
    if declared.lower > f64::NEG_INFINITY || declared.upper < f64::INFINITY {
        text += &format!(", within = [{:?}, {:?}]", declared.lower, declared.upper);
    }
    for (is_so, key) in [
        (declared.positive, "positive"),
        (declared.transform == Transform::Log, "log"),
        (declared.per_experiment, "per_experiment"),
    ] {
        if is_so {
            text += &format!(", {key} = true");
        }
    }
    if let Some(prior) = declared.prior {
        text += &format!(", prior = {{ mean = {:?}, sd = {:?} }}", prior.mean, prior.std);
    }
    text + " }"
}

struct Writer {
    text: String,
}

impl Writer {
    fn line(&mut self, line: &str) {
        self.text += line;
        self.text.push('\n');
    }

    fn group(&mut self, name: &str, entries: impl Iterator<Item = (impl AsRef<str>, String)>) {
        let mut entries = entries.peekable();
        if entries.peek().is_some() {
            self.line(&format!("\n[{name}]"));
        }
        entries.for_each(|(name, value)| self.line(&format!("{} = {value}", key(name.as_ref()))));
    }

    fn table(&mut self, name: &str, table: &Table) {
        let grid = table.grid();
        let [x, y] = grid.axes();
        self.line(&format!("\n[tables.{}]", key(name)));
        self.line(&format!("x = {x:?}"));
        let values = grid.values();
        if y.is_empty() {
            self.line(&format!("values = {values:?}"));
        } else {
            self.line(&format!("y = {y:?}"));
            self.line("values = [");
            values.chunks(y.len()).for_each(|row| self.line(&format!("  {row:?},")));
            self.line("]");
        }
        let method = if grid.interpolation() == Interpolation::Smooth { "smooth" } else { "linear" };
        let outside = if grid.extrapolation() == Extrapolation::Hold { "hold" } else { "linear" };
        self.line(&format!("method = \"{method}\"\noutside = \"{outside}\""));
    }
}

/// A key as TOML has it.
fn key(name: &str) -> String {
    let is_bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if is_bare { name.to_owned() } else { quoted(name) }
}

/// A text as TOML has it.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        // A string takes what is written.
        let _ = match c {
            '"' | '\\' => write!(quoted, "\\{c}"),
            c if c.is_control() => write!(quoted, "\\U{:08X}", c as u32),
            c => write!(quoted, "{c}"),
        };
    }
    quoted + "\""
}
