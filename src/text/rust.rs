//! A model as Rust: a struct of its constants that implements [`Model`](crate::Model), and the declarations of its parameters.

mod arithmetic;
mod declarations;

use super::Model;
use super::document::{Declared, Definition, Document};
use super::expression::{Expression, Operation};
use super::lex::is_name;
use super::names::{Meaning, Names, items, names, order};
use super::remark::Error;
use crate::interval::Hold;
use crate::layout::Kind;
use crate::scalar::{Extrapolation, Interpolation, Table};
use arithmetic::Arithmetic;
use core::fmt::Write;
use std::collections::BTreeSet;

/// Words that cannot name a field or a variable.
const KEYWORDS: &[&str] = &[
    "as", "async", "await", "break", "const", "continue", "crate", "dyn", "enum", "extern", "false", "fn", "for",
    "gen", "impl", "in", "let", "loop", "match", "mod", "move", "mut", "pub", "ref", "return", "self", "Self",
    "static", "struct", "super", "trait", "true", "type", "unsafe", "use", "where", "while", "abstract", "become",
    "box", "do", "final", "macro", "override", "priv", "try", "typeof", "unsized", "virtual", "yield",
];

impl Model {
    /// The model as a Rust module, which gives the same fit.
    ///
    /// # Errors
    /// A quantity whose name is no name in Rust.
    pub fn to_rust(&self) -> Result<String, Error> {
        let document = &self.document;
        check(document)?;
        let names = names(document);
        let order = order(document, &names, &self.source).map_err(|circle| Error::Wrong(vec![circle]))?;
        let values: Vec<f64> = self.constants().into_iter().map(|(_, value, _)| value).collect();
        let module = Module { document, names, order, values, name: type_name(&document.name) };
        Ok(module.write())
    }
}

/// Quantities are fields of structs, and so must have names that fields can have.
fn check(document: &Document) -> Result<(), Error> {
    let inputs = document.inputs.iter().map(|one| &one.quantity);
    let parameters = document.parameters.iter().map(|one| &one.quantity);
    let states = document.states.iter().map(|one| &one.quantity);
    let outputs = document.outputs.iter().map(|one| &one.quantity);
    let mut all = inputs.chain(parameters).chain(states).chain(outputs);
    match all.find(|one| !is_name(&one.name) || KEYWORDS.contains(&one.name.as_str())) {
        Some(one) => Err(Error::Unwritable(format!("`{}` can name no field in Rust; rename it", one.name))),
        None => Ok(()),
    }
}

/// Names that mean something else in the module, or in Rust.
const TAKEN: [&str; 20] = [
    "Clone",
    "Comparison",
    "Copy",
    "Debug",
    "Default",
    "Extrapolation",
    "Hold",
    "Interpolation",
    "Kind",
    "Model",
    "None",
    "Nothing",
    "Of",
    "Option",
    "Parameter",
    "PartialEq",
    "Scalar",
    "Self",
    "Signals",
    "Some",
];

/// `PMSM with surface magnets` as `PmsmWithSurfaceMagnets`.
fn type_name(name: &str) -> String {
    let word = |word: &str| -> String {
        let mut letters = word.chars();
        let first = letters.next().map(|c| c.to_ascii_uppercase());
        first.into_iter().chain(letters.map(|c| c.to_ascii_lowercase())).collect()
    };
    let found: String = name.split(|c: char| !c.is_ascii_alphanumeric()).map(word).collect();
    match found.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true if TAKEN.contains(&found.as_str()) => format!("{found}Plant"),
        true => found,
        false => format!("Plant{found}"),
    }
}

/// A name that a variable or a field of the model itself may have.
pub(super) fn variable(name: &str) -> String {
    let letters = name.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' });
    let mut found: String = letters.collect();
    if KEYWORDS.contains(&found.as_str())
        || ["t", "x", "u", "p", "S", "_", ""].contains(&found.as_str())
        || found.starts_with(|c: char| c.is_numeric())
    {
        found.insert_str(0, "the_");
    }
    found
}

struct Module<'d> {
    document: &'d Document,
    names: Names<'d>,
    order: Vec<usize>,
    /// Of the constants.
    values: Vec<f64>,
    name: String,
}

/// A line of a comment.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl Module<'_> {
    fn write(&self) -> String {
        let mut text = String::new();
        let (document, name) = (self.document, &self.name);
        let title = if document.name.is_empty() { "A model" } else { document.name.as_str() };
        let _ = writeln!(text, "// {}, written by greybox from a text model.", one_line(title));
        let mut used = vec!["Model", "Of", "Scalar", "signals"];
        if document.kind != Kind::Continuous {
            used.push("Kind");
        }
        if !document.parameters.is_empty() || self.begin().is_some() {
            used.push("Parameter");
        }
        if !document.tables.is_empty() {
            used.push("Table");
        }
        let body = self.model();
        let declarations = self.declarations();
        for function in ["free", "fixed"] {
            if declarations.contains(&format!("{function}(")) {
                used.push(function);
            }
        }
        if [document.states.is_empty(), document.inputs.is_empty(), document.parameters.is_empty()].contains(&true) {
            used.push("Nothing");
        }
        let _ = writeln!(text, "\n#[allow(unused_imports)]\nuse greybox::{{{}}};", used.join(", "));
        if body.contains("Comparison::") {
            text += "use greybox::scalar::Comparison;\n";
        }
        if !document.tables.is_empty() {
            text += "use greybox::scalar::{Extrapolation, Interpolation};\n";
        }
        text += "\nsignals! {\n";
        self.signals(&mut text, "State", "States", document.states.iter().map(|one| &one.quantity));
        self.signals(&mut text, "Input", "Inputs", document.inputs.iter().map(|one| &one.quantity));
        self.signals(&mut text, "Output", "Outputs", document.outputs.iter().map(|one| &one.quantity));
        self.signals(&mut text, "Parameters", "Parameters", document.parameters.iter().map(|one| &one.quantity));
        text += "}\n\n";
        let _ = writeln!(text, "/// {}.", one_line(title));
        if !document.description.is_empty() {
            let _ = writeln!(text, "///\n/// {}", one_line(&document.description));
        }
        for input in &document.inputs {
            let Some(hold) = input.hold else { continue };
            let hold = if hold == Hold::Zero { "Zero" } else { "First" };
            let _ = writeln!(text, "///\n/// Records are to hold `{}` by `Hold::{hold}`.", input.quantity.name);
        }
        let _ = writeln!(text, "#[derive(Clone, Debug, PartialEq)]\npub struct {name} {{");
        for constant in &document.constants {
            self.comment(&mut text, &constant.quantity);
            let _ = writeln!(text, "    pub {}: f64,", variable(&constant.quantity.name));
        }
        for table in &document.tables {
            self.comment(&mut text, &table.quantity);
            let _ = writeln!(text, "    pub {}: Table,", variable(&table.quantity.name));
        }
        text += "}\n\n";
        self.defaults(&mut text);
        text + &body + &declarations
    }

    fn comment(&self, text: &mut String, quantity: &Declared) {
        let unit = if quantity.unit.is_empty() { "1" } else { quantity.unit.as_str() };
        let what = if quantity.description.is_empty() { &quantity.name } else { &quantity.description };
        let _ = writeln!(text, "    /// {} ({})", one_line(what), one_line(unit));
    }

    fn signals<'q>(&self, text: &mut String, role: &str, title: &str, all: impl Iterator<Item = &'q Declared>) {
        let mut all = all.peekable();
        if all.peek().is_none() {
            return;
        }
        let _ = writeln!(text, "    /// {title}.\n    pub struct {}{role} {{", self.name);
        for quantity in all {
            let what = if quantity.description.is_empty() { &quantity.name } else { &quantity.description };
            let _ = writeln!(text, "        /// {}\n        {}: {:?},", one_line(what), quantity.name, quantity.unit);
        }
        text.push_str("    }\n");
    }

    /// The constants and tables of the file.
    fn defaults(&self, text: &mut String) {
        let name = &self.name;
        let _ = writeln!(text, "impl Default for {name} {{\n    fn default() -> Self {{\n        {name} {{");
        for (constant, value) in self.document.constants.iter().zip(&self.values) {
            let _ = writeln!(text, "            {}: {value:?},", variable(&constant.quantity.name));
        }
        for table in &self.document.tables {
            let _ = writeln!(text, "            {}: {},", variable(&table.quantity.name), made(&table.table));
        }
        text.push_str("        }\n    }\n}\n\n");
    }

    fn model(&self) -> String {
        let (document, name) = (self.document, &self.name);
        let signals =
            |role: &str, is_empty: bool| if is_empty { "Nothing".to_owned() } else { format!("{name}{role}") };
        let mut text = format!("impl Model for {name} {{\n");
        let types = [
            ("State", signals("State", document.states.is_empty())),
            ("Input", signals("Input", document.inputs.is_empty())),
            ("Output", signals("Output", document.outputs.is_empty())),
            ("Parameters", signals("Parameters", document.parameters.is_empty())),
        ];
        for (role, signals) in types {
            let _ = writeln!(text, "    type {role} = {signals};");
        }
        if document.kind != Kind::Continuous {
            let _ = writeln!(text, "    const KIND: Kind = Kind::{:?};", document.kind);
        }
        let full = "_t: S, _x: &Of<Self::State, S>, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>";
        let rates: Vec<(&str, Option<&Expression>)> =
            document.states.iter().map(|one| (one.quantity.name.as_str(), one.rate.as_ref())).collect();
        if document.kind != Kind::Static {
            let function = if document.kind == Kind::Discrete { "next" } else { "derivative" };
            self.function(&mut text, (function, "State", full), &rates, "S::from(0.0)");
        }
        let outputs: Vec<_> =
            document.outputs.iter().map(|one| (one.quantity.name.as_str(), Some(&one.value))).collect();
        self.function(&mut text, ("output", "Output", full), &outputs, "");
        let (of_parameters, of_first) =
            ("_p: &Of<Self::Parameters, S>", "_u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>");
        let mut levels =
            |signature: (&str, &str, &str), entries: Vec<(&Declared, Option<&Expression>)>, unsaid: &str| {
                let entries: Vec<_> = entries.into_iter().map(|(one, level)| (one.name.as_str(), level)).collect();
                if entries.iter().any(|one| one.1.is_some()) {
                    self.function(&mut text, signature, &entries, unsaid);
                }
            };
        let states = || document.states.iter();
        let jump = states().map(|one| (&one.quantity, one.jump.as_ref()));
        levels(("jump", "State", full), jump.collect(), "x.{name}");
        let diffusion = states().map(|one| (&one.quantity, one.diffusion.as_ref()));
        levels(("diffusion", "State", full), diffusion.collect(), "S::from(0.0)");
        let noise = document.outputs.iter().map(|one| (&one.quantity, one.noise.as_ref()));
        levels(("noise", "Output", full), noise.collect(), "S::from(f64::NAN)");
        let initial = states().map(|one| (&one.quantity, one.initial_noise.as_ref()));
        let begin = states().map(|one| (&one.quantity, one.initial()));
        levels(("initial", "State", of_first), begin.collect(), "S::from(f64::NAN)");
        levels(("initial_noise", "State", of_parameters), initial.collect(), "S::from(0.0)");
        let delay = document.inputs.iter().map(|one| (&one.quantity, one.delay.as_ref()));
        levels(("delay", "Input", of_parameters), delay.collect(), "S::from(0.0)");
        text + "}\n"
    }

    /// A function of the model: the definitions that it needs, then its vector, with `unsaid` for an entry (`{name}`) that has no value.
    fn function(
        &self,
        text: &mut String,
        (function, role, arguments): (&str, &str, &str),
        entries: &[(&str, Option<&Expression>)],
        unsaid: &str,
    ) {
        let mut arithmetic = Arithmetic::new(self.document, &self.names);
        let needed = self.needed(entries.iter().filter_map(|(_, value)| *value));
        let mut lines = vec![];
        for item in &self.order {
            let Some(definition) = self.definition(*item) else { continue };
            let code = arithmetic.definition(*item, &definition.value);
            if needed.contains(item) {
                lines.push(format!("        let {} = {code};", variable(&definition.quantity.name)));
            }
        }
        let value = |(name, value): &(&str, Option<&Expression>)| {
            let code = value.map_or_else(|| unsaid.replace("{name}", name), |value| arithmetic.scalar(value));
            format!("            {name}: {code},")
        };
        let fields: Vec<String> = entries.iter().map(value).collect();
        let body = lines.iter().chain(&fields).map(String::as_str).collect::<Vec<_>>().join("\n");
        let mut arguments = arguments.to_owned();
        let reads = |word: &str| arithmetic::reads(&body, word);
        for (unused, name, is_read) in [
            ("_t:", "t:", reads("t")),
            ("_x:", "x:", body.contains("x.")),
            ("_u:", "u:", body.contains("u.")),
            ("_p:", "p:", body.contains("p.")),
        ] {
            if is_read {
                arguments = arguments.replace(unused, name);
            }
        }
        let _ = writeln!(
            text,
            "\n    #[inline]\n    fn {function}<S: Scalar>(&self, {arguments}) -> Of<Self::{role}, S> {{"
        );
        lines.iter().for_each(|line| {
            let _ = writeln!(text, "{line}");
        });
        let _ = writeln!(text, "        {}{role} {{\n{}\n        }}\n    }}", self.name, fields.join("\n"));
    }

    fn definition(&self, item: usize) -> Option<&Definition> {
        item.checked_sub(self.document.constants.len()).map(|definition| &self.document.definitions[definition])
    }

    /// The items that expressions are made of.
    fn needed<'e>(&self, expressions: impl Iterator<Item = &'e Expression>) -> BTreeSet<usize> {
        let items = items(self.document);
        let named = |expression: &Expression| -> Vec<usize> {
            let item = |node: &super::expression::Node| match &node.operation {
                Operation::Name(name) => match self.names.get(name.as_str()) {
                    Some(Meaning::Item(item)) => Some(*item),
                    _ => None,
                },
                _ => None,
            };
            expression.nodes.iter().filter_map(item).collect()
        };
        let mut open: Vec<usize> = expressions.flat_map(named).collect();
        let mut found = BTreeSet::new();
        while let Some(item) = open.pop() {
            if found.insert(item) {
                open.extend(named(items[item]));
            }
        }
        found
    }
}

/// A number as Rust writes it.
fn number(value: f64) -> String {
    match value {
        value if value.is_nan() => "f64::NAN".to_owned(),
        f64::INFINITY => "f64::INFINITY".to_owned(),
        f64::NEG_INFINITY => "f64::NEG_INFINITY".to_owned(),
        value => format!("{value:?}"),
    }
}

/// The code that makes a table, of numbers that make one.
fn made(table: &Table) -> String {
    let grid = table.grid();
    let [x, y] = grid.axes();
    let method = if grid.interpolation() == Interpolation::Smooth { "Smooth" } else { "Linear" };
    let outside = if grid.extrapolation() == Extrapolation::Hold { "Hold" } else { "Linear" };
    let (kind, axes) = if y.is_empty() { ("curve", format!("&{x:?}")) } else { ("surface", format!("&{x:?}, &{y:?}")) };
    let values = grid.values();
    format!(
        "Table::{kind}({axes}, &{values:?}, Interpolation::{method}, Extrapolation::{outside}).expect(\"the points rise\")"
    )
}
