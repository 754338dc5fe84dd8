//! A model for readers: its equations in LaTeX, and a page of Markdown with its quantities.

use super::Model;
use super::document::Declared;
use super::expression::{At, Expression, Operation, Relation, Sign};
use crate::layout::Kind;
use core::fmt::Write;

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
    /// The equations as lines of LaTeX, in an `aligned` environment: states, definitions, outputs.
    pub fn to_latex(&self) -> String {
        let document = &self.document;
        let mut lines = vec![];
        for state in &document.states {
            let x = symbol(&state.quantity.name);
            let left = match document.kind {
                Kind::Discrete => format!("{x}[k+1]"),
                _ => format!("\\frac{{d{x}}}{{dt}}"),
            };
            lines.push(format!("{left} &= {}", state.rate.as_ref().map_or("0".to_owned(), formula)));
            if let Some(jump) = &state.jump {
                lines.push(format!("{x}(t_k^+) &= {}", formula(jump)));
            }
        }
        for one in &document.definitions {
            lines.push(format!("{} &= {}", symbol(&one.quantity.name), formula(&one.value)));
        }
        for one in &document.inputs {
            let Some(delay) = &one.delay else { continue };
            let u = symbol(&one.quantity.name);
            lines.push(format!("{u}(t) &= {u}_{{\\mathrm{{record}}}}(t - ({}))", formula(delay)));
        }
        for one in &document.outputs {
            // What is measured is told from the state of the same name.
            lines.push(format!("\\hat{{y}}_{{{}}} &= {}", plain(&one.quantity.name), formula(&one.value)));
        }
        format!("\\begin{{aligned}}\n{}\n\\end{{aligned}}\n", lines.join(" \\\\\n"))
    }

    /// A page of Markdown: name, equations, and a table of all quantities.
    pub fn to_markdown(&self) -> String {
        let document = &self.document;
        let title = if self.name().is_empty() { "Model" } else { self.name() };
        let mut text = format!("# {title}\n\n");
        if !document.description.is_empty() {
            let _ = writeln!(text, "{}\n", document.description);
        }
        let _ = writeln!(text, "$$\n{}$$\n\n| symbol | | unit | |\n|---|---|---|---|", self.to_latex());
        let mut row = |role: &str, quantity: &Declared, value: &str| {
            let about = [quantity.description.as_str(), value]
                .into_iter()
                .filter(|one| !one.is_empty())
                .collect::<Vec<_>>()
                .join("; ");
            let unit = if quantity.unit.is_empty() { "1" } else { quantity.unit.as_str() };
            let _ = writeln!(text, "| ${}$ | {role} `{}` | {unit} | {about} |", symbol(&quantity.name), quantity.name);
        };
        document.states.iter().for_each(|one| row("state", &one.quantity, ""));
        document.inputs.iter().for_each(|one| row("input", &one.quantity, ""));
        document.parameters.iter().for_each(|one| row("parameter", &one.quantity, ""));
        let values: Vec<f64> = self.constants().into_iter().map(|(_, value, _)| value).collect();
        document
            .constants
            .iter()
            .zip(values)
            .for_each(|(one, value)| row("constant", &one.quantity, &crate::numeral::exact(value)));
        document.tables.iter().for_each(|one| row("table", &one.quantity, ""));
        text
    }
}

fn plain(name: &str) -> String {
    format!("\\mathrm{{{}}}", name.replace('_', "\\_").replace(['{', '}', '\\', '$', '%', '#', '&'], " "))
}

/// `psi_m` as a Greek letter with an index, `rs` as a letter with an index, longer words upright.
fn symbol(name: &str) -> String {
    let letter = |word: &str| GREEK.contains(&word).then(|| format!("\\{word}"));
    let (head, index) = match name.split_once('_') {
        Some((head, index)) if !head.is_empty() && !index.is_empty() => (head, index),
        _ if letter(name).is_some() => (name, ""),
        _ => match name.char_indices().nth(1) {
            Some((at, _)) if name.chars().count() <= 3 && name.is_ascii() => name.split_at(at),
            _ => (name, ""),
        },
    };
    let head = letter(head).unwrap_or_else(|| if head.chars().count() == 1 { head.to_owned() } else { plain(head) });
    if index.is_empty() { head } else { format!("{head}_{{{}}}", plain(index)) }
}

fn formula(expression: &Expression) -> String {
    let mut all: Vec<Formula> = Vec::with_capacity(expression.nodes.len());
    for node in &expression.nodes {
        let one = part(&node.operation, &all);
        all.push(one);
    }
    all.pop().map(|(text, _)| text).unwrap_or_default()
}

fn part(operation: &Operation, all: &[Formula]) -> Formula {
    let text = |at: &At| all[*at].0.as_str();
    let within = |at: &At, least: Tight| match all[*at].1 < least {
        true => format!("\\left({}\\right)", text(at)),
        false => text(at).to_owned(),
    };
    match operation {
        Operation::Number(value) => number(*value),
        Operation::Name(name) => (symbol(name), Tight::Atom),
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
        Operation::Call { name, arguments, .. } => call(name, &arguments.iter().map(text).collect::<Vec<_>>()),
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
        Operation::Or(a, b) => (format!("{} \\lor {}", within(a, Tight::Sum), within(b, Tight::Sum)), Tight::Condition),
        Operation::Not(a) => (format!("\\lnot \\left({}\\right)", text(a)), Tight::Sum),
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

fn call(name: &str, arguments: &[&str]) -> Formula {
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
        _ => format!("\\operatorname{{{}}}\\left({all}\\right)", name.replace('_', "\\_")),
    };
    (text, Tight::Power)
}
