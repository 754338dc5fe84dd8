//! From a TOML file to a [`Document`].

mod checks;
mod declarations;
mod quantities;
mod tables;

use super::document::{Declared, Document, Output, Solver, State};
use super::expression::{Expression, Node, Operation};
use super::remark::{Remark, Source};
use super::string::Place;
use super::toml_value::{Entry, Values, entries};
use crate::layout::Kind;
use crate::unit::{NoUnit, Unit};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use toml::de::DeTable;

/// The version of the format that this library reads.
const FORMAT: f64 = 1.0;

/// Names that every expression has.
pub(super) const RESERVED: [&str; 4] = ["t", "pi", "inf", "nan"];

const GROUPS: [&str; 12] = [
    "greybox",
    "name",
    "description",
    "units",
    "constants",
    "inputs",
    "parameters",
    "tables",
    "let",
    "states",
    "outputs",
    "solver",
];

/// The document of a file, and what is odd in it.
pub(super) fn read(source: &Arc<Source>) -> Result<(Document, Vec<Remark>), Vec<Remark>> {
    let file = DeTable::parse(&source.text).map_err(|error| {
        let at = error.span().unwrap_or(0..0);
        let title = error.message().lines().collect::<Vec<_>>().join("; ");
        vec![Remark::error(source, at, title).help(
            "expressions and units stand in quotes, and numbers have digits on both sides of the point".to_owned(),
        )]
    })?;
    let values = Values { source: source.clone(), errors: vec![], warnings: vec![] };
    let mut reader = Reader { values, units: BTreeMap::new(), unknown: BTreeSet::new() };
    let document = reader.document(&entries(file.get_ref()));
    let Values { errors, warnings, .. } = reader.values;
    match document {
        Some(document) if errors.is_empty() => Ok((document, warnings)),
        _ => Err(errors),
    }
}

struct Reader {
    values: Values,
    units: BTreeMap<String, Unit>,
    /// Symbols that have been warned of.
    unknown: BTreeSet<String>,
}

impl Reader {
    fn document(&mut self, file: &[Entry<'_>]) -> Option<Document> {
        self.values.only(file, "a model file", &GROUPS);
        let group = |key: &str| file.iter().find(|entry| entry.key == key);
        self.version(group("greybox"));
        let name = group("name").and_then(|entry| self.values.text(entry)).unwrap_or_default().to_owned();
        let description = group("description").and_then(|entry| self.values.text(entry)).unwrap_or_default().to_owned();
        self.own_units(group("units"));
        let mut all = |key: &str| group(key).and_then(|entry| self.values.table(entry)).unwrap_or_default();
        let [constants, inputs, parameters, tables, definitions, states, solver] =
            ["constants", "inputs", "parameters", "tables", "let", "states", "solver"].map(&mut all);
        let constants = constants.iter().filter_map(|entry| self.constant(entry)).collect();
        let inputs = inputs.iter().filter_map(|entry| self.input(entry)).collect();
        let parameters = parameters.iter().filter_map(|entry| self.parameter(entry)).collect();
        let tables = tables.iter().filter_map(|entry| self.table(entry)).collect();
        let definitions = definitions.iter().filter_map(|entry| self.definition(entry)).collect();
        let kind = self.kind(&states);
        let states: Vec<State> = states.iter().filter_map(|entry| self.state(entry, kind)).collect();
        let outputs = self.outputs(group("outputs"), &states);
        let solver = self.solver(&solver);
        self.check_begins(&states);
        let mut document = Document {
            name,
            description,
            kind,
            constants,
            inputs,
            parameters,
            definitions,
            tables,
            states,
            outputs,
            solver,
        };
        outputs_have_units(&mut document);
        self.check_names(&document);
        Some(document)
    }

    fn version(&mut self, entry: Option<&Entry<'_>>) {
        let Some(entry) = entry else {
            let remark =
                Remark::error(&self.values.source, 0..0, "the file does not say which version of the format it has");
            return self.values.errors.push(remark.help("let it begin with `greybox = 1`".to_owned()));
        };
        if self.values.number(entry).is_some_and(|version| version != FORMAT) {
            self.values.error(entry.span.clone(), format!("this library reads version {FORMAT} of the format"));
        }
    }

    /// `symbol = "unit"`, or `""` for a unit that consists of no others.
    fn own_units(&mut self, entry: Option<&Entry<'_>>) {
        for entry in entry.and_then(|entry| self.values.table(entry)).unwrap_or_default() {
            let Some(text) = self.values.text(&entry) else { continue };
            if !entry.key.chars().all(|c| c.is_alphabetic() || "_%°".contains(c)) || entry.key.is_empty() {
                self.values.error(entry.at.clone(), format!("`{}` is no symbol of a unit; take letters", entry.key));
                continue;
            }
            let unit = if text.trim().is_empty() { Some(Unit::base(entry.key)) } else { self.read_unit(text, &entry) };
            if let Some(unit) = unit {
                self.units.insert(entry.key.to_owned(), unit);
            }
        }
    }

    fn read_unit(&mut self, text: &str, entry: &Entry<'_>) -> Option<Unit> {
        match Unit::read(text, &self.units) {
            Ok(unit) => Some(unit),
            Err(NoUnit::Wrong(title)) => {
                self.values.error(entry.span.clone(), title);
                None
            }
            Err(NoUnit::Unknown(symbol)) => {
                if self.unknown.insert(symbol.clone()) {
                    let at = text.find(&symbol).map_or(entry.span.clone(), |at| {
                        let place = Place::quoted(entry.span.clone());
                        place.span(&self.values.source.text, at..at + symbol.len())
                    });
                    let remark = Remark::warning(&self.values.source, at, format!("unit `{symbol}` is not known"));
                    let help = format!(
                        "what depends on it is not checked; declare it under [units]: {symbol} = \"...\" by known units, or \"\" for one of its own"
                    );
                    self.values.warnings.push(remark.help(help));
                }
                None
            }
        }
    }

    /// Name, unit and description; the entries of the quantity, or none if its value is its unit or equation alone.
    fn declared<'a>(
        &mut self,
        entry: &Entry<'a>,
        unit: Option<&Entry<'a>>,
        description: Option<&Entry<'a>>,
    ) -> Option<Declared> {
        let (name, at) = (entry.key.to_owned(), entry.at.clone());
        let text = match unit {
            Some(unit) => self.values.text(unit)?,
            None => "",
        };
        let dimension = unit.and_then(|entry| self.read_unit(text, entry));
        let description = description.and_then(|entry| self.values.text(entry)).unwrap_or_default().to_owned();
        Some(Declared { name, at, unit: text.to_owned(), dimension, description })
    }

    /// A quantity whose entries are in a table.
    fn in_table<'a>(&mut self, entry: &Entry<'a>, of: &str, keys: &[&str]) -> Option<(Declared, Vec<Entry<'a>>)> {
        let fields = self.values.table(entry)?;
        let mut known = vec!["unit", "description"];
        known.extend(keys);
        self.values.only(&fields, of, &known);
        let declared = self.declared(entry, field(&fields, "unit"), field(&fields, "description"))?;
        Some((declared, fields))
    }

    /// An expression that a quantity must have.
    fn required(&mut self, entry: &Entry<'_>, fields: &[Entry<'_>], key: &str, of: &str) -> Option<Expression> {
        match field(fields, key) {
            Some(found) => self.values.expression(found),
            None => {
                self.values.error(entry.at.clone(), format!("{of} `{}` has no `{key}`", entry.key));
                None
            }
        }
    }

    /// Which of these words an entry is.
    fn choice(
        &mut self,
        entry: Option<&Entry<'_>>,
        what: &str,
        words: &[&str],
        unsaid: Option<usize>,
    ) -> Option<usize> {
        let Some(entry) = entry else { return unsaid };
        let text = self.values.text(entry)?;
        let found = words.iter().position(|word| *word == text);
        if found.is_none() {
            let remark = Remark::error(&self.values.source, entry.span.clone(), format!("there is no {what} `{text}`"));
            self.values.errors.push(remark.help(format!("take one of: {}", words.join(", "))));
        }
        found
    }

    /// Continuous or discrete, as the first state says; static without a state.
    fn kind(&mut self, states: &[Entry<'_>]) -> Kind {
        let has = |entry: &Entry<'_>, key: &str| entry.value.get(key).is_some();
        match states.iter().find(|entry| has(entry, "derivative") || has(entry, "next")) {
            _ if states.is_empty() => Kind::Static,
            Some(entry) if has(entry, "next") => Kind::Discrete,
            _ => Kind::Continuous,
        }
    }

    fn solver(&mut self, fields: &[Entry<'_>]) -> Solver {
        self.values.only(fields, "[solver]", &["integrator", "predictor"]);
        let mut text = |key: &str| {
            field(fields, key).and_then(|found| Some((self.values.text(found)?.to_owned(), found.span.clone())))
        };
        Solver { integrator: text("integrator"), predictor: text("predictor") }
    }
}

/// An output without a unit of its own that is a mere quantity has the unit of that.
fn outputs_have_units(document: &mut Document) {
    let units: BTreeMap<String, (String, Option<Unit>)> =
        document.named().map(|(_, one)| (one.name.clone(), (one.unit.clone(), one.dimension.clone()))).collect();
    for Output { quantity, value, .. } in &mut document.outputs {
        if let (true, [Node { operation: Operation::Name(name), .. }]) = (quantity.unit.is_empty(), &value.nodes[..])
            && let Some((unit, dimension)) = units.get(name).cloned()
        {
            (quantity.unit, quantity.dimension) = (unit, dimension);
        }
    }
}

fn field<'f, 'a>(fields: &'f [Entry<'a>], key: &str) -> Option<&'f Entry<'a>> {
    fields.iter().find(|entry| entry.key == key)
}
