//! The equations of a model in LaTeX.

use super::Model;
use super::document::{Document, NamedTable};
use super::expression::{At, Expression, Operation, Relation, Sign};
use crate::layout::Kind;
use crate::scalar::Interpolation;
use std::collections::HashSet;

/// How tightly a formula holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Tight {
    Condition,
    Sum,
    Product,
    Power,
    Atom,
}

type Formula = (String, Tight);

const GREEK: [&str; 24] = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu", "xi",
    "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega", "pi", "Omega",
];
/// Functions that LaTeX has a name for.
const NAMED: [&str; 14] =
    ["exp", "ln", "sin", "cos", "tan", "sinh", "cosh", "tanh", "max", "min", "arcsin", "arccos", "arctan", "log"];

impl Model {
    /// The equations as lines of LaTeX, in an `aligned` environment: states, definitions, tables, outputs, noise.
    pub fn to_latex(&self) -> String {
        let (document, printer) = (&self.document, Printer::new(&self.document));
        let formula = |one: &Expression| printer.formula(one);
        let mut lines = vec![];
        for state in &document.states {
            let x = printer.symbol(&state.quantity.name);
            let left = match document.kind {
                Kind::Discrete => format!("{x}[k+1]"),
                _ => format!("\\frac{{d{x}}}{{dt}}"),
            };
            lines.push(format!("{left} &= {}", state.rate.as_ref().map_or("0".to_owned(), formula)));
            let further = [
                (format!("{x}(t_k^+)"), state.jump.as_ref()),
                (format!("{x}(t_0)"), state.initial()),
                (level("initial noise", &x), state.initial_noise.as_ref()),
                (level("diffusion", &x), state.diffusion.as_ref()),
            ];
            lines.extend(further.into_iter().filter_map(|(left, one)| Some(format!("{left} &= {}", formula(one?)))));
        }
        for one in &document.definitions {
            lines.push(format!("{} &= {}", printer.symbol(&one.quantity.name), formula(&one.value)));
        }
        lines.extend(document.tables.iter().map(reference));
        for one in &document.inputs {
            let Some(delay) = &one.delay else { continue };
            let u = printer.symbol(&one.quantity.name);
            lines.push(format!("{u}(t) &= {u}_{{\\mathrm{{record}}}}(t - ({}))", formula(delay)));
        }
        for one in &document.outputs {
            // What is measured is told from the state of the same name.
            let y = format!("\\hat{{y}}_{{{}}}", plain(&one.quantity.name));
            lines.push(format!("{y} &= {}", formula(&one.value)));
            lines.extend(one.noise.as_ref().map(|noise| format!("{} &= {}", level("noise", &y), formula(noise))));
        }
        format!("\\begin{{aligned}}\n{}\n\\end{{aligned}}\n", lines.join(" \\\\\n"))
    }
}

/// The level of a noise of a quantity.
fn level(name: &str, of: &str) -> String {
    format!("\\text{{{name}}}\\left({of}\\right)")
}

/// What a table is like, in place of its numbers.
fn reference(one: &NamedTable) -> String {
    let grid = one.table.grid();
    let points: Vec<String> =
        grid.axes().iter().filter(|axis| !axis.is_empty()).map(|axis| axis.len().to_string()).collect();
    let ends = |at: fn(&[f64]) -> f64| {
        let ends = grid.axes().into_iter().filter(|axis| !axis.is_empty()).map(|axis| number(at(axis)).0);
        ends.collect::<Vec<_>>().join(",\\ ")
    };
    let between = match grid.interpolation() {
        Interpolation::Linear => "linear",
        Interpolation::Smooth => "smooth",
    };
    let (first, last) = (ends(|axis| axis[0]), ends(|axis| axis[axis.len() - 1]));
    format!(
        "{} &: \\text{{{between} table of {} points from }} {first} \\text{{ to }} {last}",
        operator(&one.quantity.name),
        points.join(" by ")
    )
}

fn plain(name: &str) -> String {
    format!("\\mathrm{{{}}}", name.replace('_', "\\_").replace(['{', '}', '\\', '$', '%', '#', '&'], " "))
}

/// The name of a function.
fn operator(name: &str) -> String {
    format!("\\operatorname{{{}}}", name.replace('_', "\\_"))
}

/// The index of a slope of a table.
fn slope([x, y]: [u8; 2]) -> String {
    let index = ["x".repeat(x.into()), "y".repeat(y.into())].concat();
    if index.is_empty() { index } else { format!("_{{{index}}}") }
}

/// The quantities of a document, each of which has a symbol of its own.
pub(super) struct Printer<'d> {
    names: HashSet<&'d str>,
    tables: HashSet<&'d str>,
}

impl<'d> Printer<'d> {
    pub fn new(document: &'d Document) -> Self {
        let names = document.named().map(|(_, quantity)| quantity.name.as_str()).collect();
        Printer { names, tables: document.tables.iter().map(|one| one.quantity.name.as_str()).collect() }
    }

    /// `psi_m` as a Greek letter with an index, `rs` as a letter with an index unless there is an `r_s`, longer words upright.
    pub fn symbol(&self, name: &str) -> String {
        if self.tables.contains(name) {
            return operator(name);
        }
        if name == "inf" {
            return "\\infty".to_owned();
        }
        let letter = |word: &str| GREEK.contains(&word).then(|| format!("\\{word}"));
        let (head, index) = match name.split_once('_') {
            Some((head, index)) if !head.is_empty() && !index.is_empty() => (head, index),
            _ if letter(name).is_some() => (name, ""),
            _ => match name.char_indices().nth(1) {
                Some((at, _)) if name.len() <= 3 && name.is_ascii() && !name.starts_with('_') => {
                    let (head, index) = name.split_at(at);
                    if self.names.contains(format!("{head}_{index}").as_str()) {
                        return format!("\\mathit{{{}}}", name.replace('_', "\\_"));
                    }
                    (head, index)
                }
                _ => (name, ""),
            },
        };
        let single = |head: &str| if head.chars().count() == 1 { head.to_owned() } else { plain(head) };
        let head = letter(head).unwrap_or_else(|| single(head));
        if index.is_empty() { head } else { format!("{head}_{{{}}}", plain(index)) }
    }

    fn formula(&self, expression: &Expression) -> String {
        let mut all: Vec<Formula> = Vec::with_capacity(expression.nodes.len());
        for node in &expression.nodes {
            let one = self.part(&node.operation, &all);
            all.push(one);
        }
        all.pop().map(|(text, _)| text).unwrap_or_default()
    }

    fn part(&self, operation: &Operation, all: &[Formula]) -> Formula {
        let text = |at: &At| all[*at].0.as_str();
        let within = |at: &At, least: Tight| match all[*at].1 < least {
            true => format!("\\left({}\\right)", text(at)),
            false => text(at).to_owned(),
        };
        match operation {
            Operation::Number(value) => number(*value),
            Operation::Name(name) => (self.symbol(name), Tight::Atom),
            Operation::Negate(a) => (format!("-{}", within(a, Tight::Product)), Tight::Sum),
            Operation::Binary(Sign::Add, a, b) => {
                (format!("{} + {}", within(a, Tight::Sum), within(b, Tight::Product)), Tight::Sum)
            }
            Operation::Binary(Sign::Sub, a, b) => {
                (format!("{} - {}", within(a, Tight::Sum), within(b, Tight::Product)), Tight::Sum)
            }
            Operation::Binary(Sign::Mul, a, b) => {
                let (a, b) = (within(a, Tight::Product), within(b, Tight::Product));
                let between = if b.starts_with(|c: char| c.is_ascii_digit()) { " \\cdot " } else { " \\, " };
                (format!("{a}{between}{b}"), Tight::Product)
            }
            Operation::Binary(Sign::Div, a, b) => (format!("\\frac{{{}}}{{{}}}", text(a), text(b)), Tight::Power),
            Operation::Binary(Sign::Power, a, b) => {
                (format!("{{{}}}^{{{}}}", within(a, Tight::Atom), text(b)), Tight::Power)
            }
            Operation::Call { name, order, arguments } => {
                call(name, *order, &arguments.iter().map(text).collect::<Vec<_>>())
            }
            Operation::If([condition, a, b]) => (
                format!(
                    "\\begin{{cases}} {} & {} \\\\ {} & \\text{{otherwise}} \\end{{cases}}",
                    text(a),
                    text(condition),
                    text(b)
                ),
                Tight::Condition,
            ),
            Operation::Compare(relation, a, b) => {
                let sign = match relation {
                    Relation::Less => "<",
                    Relation::LessOrEqual => "\\le",
                    Relation::Greater => ">",
                    Relation::GreaterOrEqual => "\\ge",
                };
                (format!("{} {sign} {}", text(a), text(b)), Tight::Sum)
            }
            Operation::And(a, b) => {
                (format!("{} \\land {}", within(a, Tight::Sum), within(b, Tight::Sum)), Tight::Condition)
            }
            Operation::Or(a, b) => {
                (format!("{} \\lor {}", within(a, Tight::Sum), within(b, Tight::Sum)), Tight::Condition)
            }
            Operation::Not(a) => (format!("\\lnot \\left({}\\right)", text(a)), Tight::Sum),
        }
    }
}

fn number(value: f64) -> Formula {
    let text = format!("{value:?}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    match text.split_once('e') {
        Some((digits, exponent)) => {
            let digits = if digits == "1" { String::new() } else { format!("{digits} \\cdot ") };
            (format!("{digits}10^{{{exponent}}}"), Tight::Product)
        }
        None => (text.to_owned(), Tight::Atom),
    }
}

fn call(name: &str, order: [u8; 2], arguments: &[&str]) -> Formula {
    let all = arguments.join(", ");
    let text = match name {
        "sqrt" => format!("\\sqrt{{{all}}}"),
        "cbrt" => format!("\\sqrt[3]{{{all}}}"),
        "abs" => format!("\\left|{all}\\right|"),
        "floor" => format!("\\left\\lfloor {all} \\right\\rfloor"),
        "ceil" => format!("\\left\\lceil {all} \\right\\rceil"),
        "recip" => format!("\\frac{{1}}{{{all}}}"),
        "asin" | "acos" | "atan" => format!("\\arc{}\\left({all}\\right)", &name[1..]),
        _ if NAMED.contains(&name) => format!("\\{name}\\left({all}\\right)"),
        _ => format!("{}{}\\left({all}\\right)", operator(name), slope(order)),
    };
    (text, Tight::Power)
}
