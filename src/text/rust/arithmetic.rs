//! Expressions as Rust code. What is made of numbers and constants alone is an `f64`, all else a generic `S`; between the two, the `f64`
//! stands to the right, as [`Scalar`](crate::Scalar) asks for.

use super::{number, variable};
use crate::graph::Function2;
use crate::text::document::Document;
use crate::text::expression::{At, Expression, Operation, Relation, Sign};
use crate::text::names::{Callable, Meaning, Names, function};

/// How tightly code holds together.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Tight {
    Sum,
    Product,
    Sign,
    Atom,
}

#[derive(Clone)]
struct Code {
    text: String,
    tight: Tight,
    /// Whether it is an `f64`.
    is_number: bool,
}

impl Code {
    fn atom(text: String, is_number: bool) -> Self {
        Code { text, tight: Tight::Atom, is_number }
    }

    fn within(&self, least: Tight) -> String {
        if self.tight < least { format!("({})", self.text) } else { self.text.clone() }
    }

    fn scalar(&self) -> Code {
        match self.is_number {
            true => Code::atom(format!("S::from({})", self.text), false),
            false => self.clone(),
        }
    }

    fn receiver(&self) -> String {
        self.scalar().within(Tight::Atom)
    }
}

pub(super) struct Arithmetic<'d> {
    document: &'d Document,
    names: &'d Names<'d>,
    /// Whether each item is an `f64`; constants are.
    is_number: Vec<bool>,
}

/// Whether code names a variable.
pub(super) fn reads(code: &str, name: &str) -> bool {
    code.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '.')
        .any(|word| word == name || word.split('.').next() == Some(name))
}

impl<'d> Arithmetic<'d> {
    pub fn new(document: &'d Document, names: &'d Names<'d>) -> Self {
        let is_number = vec![true; document.constants.len() + document.definitions.len()];
        Arithmetic { document, names, is_number }
    }

    /// The code of a definition, after those that it names.
    pub fn definition(&mut self, item: usize, expression: &Expression) -> String {
        let code = self.code(expression);
        self.is_number[item] = code.is_number;
        code.text
    }

    /// The code of a value of type `S`.
    pub fn scalar(&self, expression: &Expression) -> String {
        self.code(expression).scalar().text
    }

    fn code(&self, expression: &Expression) -> Code {
        let mut codes: Vec<Code> = Vec::with_capacity(expression.nodes.len());
        for node in &expression.nodes {
            let code = match &node.operation {
                Operation::Number(value) => Code::atom(number(*value), true),
                Operation::Name(name) => self.named(name),
                Operation::Negate(a) => Code {
                    text: format!("-{}", codes[*a].within(Tight::Sign)),
                    tight: Tight::Sign,
                    is_number: codes[*a].is_number,
                },
                Operation::Binary(Sign::Power, a, n) => power(&codes[*a], &codes[*n]),
                Operation::Binary(sign, a, b) => binary(*sign, &codes[*a], &codes[*b]),
                Operation::Call { name, order, arguments } => {
                    self.call(name, *order, &arguments.iter().map(|at| codes[*at].clone()).collect::<Vec<_>>())
                }
                Operation::If([condition, then, otherwise]) => {
                    branches(expression, &codes, *condition, &codes[*then], &codes[*otherwise])
                }
                _ => condition(&node.operation, &codes),
            };
            codes.push(code);
        }
        codes.pop().unwrap_or_else(|| Code::atom("f64::NAN".to_owned(), true))
    }

    fn named(&self, name: &str) -> Code {
        match self.names.get(name) {
            Some(Meaning::Number(value)) if *value == core::f64::consts::PI => {
                Code::atom("core::f64::consts::PI".to_owned(), true)
            }
            Some(Meaning::Number(value)) => Code::atom(number(*value), true),
            Some(Meaning::Time) => Code::atom("t".to_owned(), false),
            Some(Meaning::Input(_)) => Code::atom(format!("u.{name}"), false),
            Some(Meaning::Parameter(_)) => Code::atom(format!("p.{name}"), false),
            Some(Meaning::State(_)) => Code::atom(format!("x.{name}"), false),
            Some(Meaning::Item(item)) if *item < self.document.constants.len() => {
                Code::atom(format!("self.{}", variable(name)), true)
            }
            Some(Meaning::Item(item)) => Code::atom(variable(name), self.is_number[*item]),
            _ => Code::atom("f64::NAN".to_owned(), true),
        }
    }

    fn call(&self, name: &str, order: [u8; 2], arguments: &[Code]) -> Code {
        let scalar = |i: usize| arguments[i].scalar().text;
        if let Some(Meaning::Table(_)) = self.names.get(name) {
            let table = format!("self.{}", variable(name));
            let all: Vec<String> = (0..arguments.len()).map(scalar).collect();
            let text = match (order, all.as_slice()) {
                ([0, 0], [x]) => format!("{table}.at({x})"),
                ([0, 0], _) => format!("{table}.at2({})", all.join(", ")),
                (_, [x]) => format!("S::look_up(&{table}.grid(), [{x}, S::from(0.0)], {order:?})"),
                _ => format!("S::look_up(&{table}.grid(), [{}], {order:?})", all.join(", ")),
            };
            return Code::atom(text, false);
        }
        let numbers = arguments.iter().all(|one| one.is_number);
        let on_numbers = |name: &str| {
            Code::atom(
                format!(
                    "f64::{name}({})",
                    arguments.iter().map(|one| one.text.as_str()).collect::<Vec<_>>().join(", ")
                ),
                true,
            )
        };
        let method = |receiver: &Code, name: &str, argument: &Code| {
            Code::atom(format!("{}.{name}({})", receiver.receiver(), argument.scalar().text), false)
        };
        match function(name) {
            Some(Callable::One(_) | Callable::Fract) if numbers => on_numbers(name),
            Some(Callable::One(_) | Callable::Fract) => {
                Code::atom(format!("{}.{name}()", arguments[0].receiver()), false)
            }
            Some(Callable::Two(Function2::Pow)) => power(&arguments[0], &arguments[1]),
            Some(Callable::Two(_)) if numbers => on_numbers(name),
            Some(Callable::Two(Function2::RemEuclid)) => {
                Code::atom(format!("{}.rem_euclid({})", arguments[0].receiver(), arguments[1].text), false)
            }
            Some(Callable::Two(_)) => method(&arguments[0], name, &arguments[1]),
            Some(Callable::Max | Callable::Min) => {
                arguments[1..].iter().fold(arguments[0].clone(), |a, b| match a.is_number && b.is_number {
                    true => Code::atom(format!("f64::{name}({}, {})", a.text, b.text), true),
                    false => method(&a, name, b),
                })
            }
            Some(Callable::Clamp) if arguments[1].is_number && arguments[2].is_number => Code::atom(
                format!("{}.clamp({}, {})", arguments[0].receiver(), arguments[1].text, arguments[2].text),
                false,
            ),
            Some(Callable::Clamp) => {
                let all = [scalar(0), scalar(1), scalar(2)].join(", ");
                let above = "S::select(Comparison::Less, value, low, low, value)";
                Code::atom(
                    format!(
                        "{{ let (value, low, high) = ({all}); S::select(Comparison::Less, high, value, high, {above}) }}"
                    ),
                    false,
                )
            }
            None => Code::atom("f64::NAN".to_owned(), true),
        }
    }
}

fn binary(sign: Sign, a: &Code, b: &Code) -> Code {
    let (symbol, own, next) = match sign {
        Sign::Add => ("+", Tight::Sum, Tight::Product),
        Sign::Sub => ("-", Tight::Sum, Tight::Product),
        Sign::Mul => ("*", Tight::Product, Tight::Sign),
        _ => ("/", Tight::Product, Tight::Sign),
    };
    let (a, b) = match (a.is_number, b.is_number, sign) {
        (true, false, Sign::Add | Sign::Mul) => (b.clone(), a.clone()),
        (true, false, _) => (a.scalar(), b.clone()),
        _ => (a.clone(), b.clone()),
    };
    let is_number = a.is_number && b.is_number;
    Code { text: format!("{} {symbol} {}", a.within(own), b.within(next)), tight: own, is_number }
}

fn power(a: &Code, n: &Code) -> Code {
    let whole = n.text.parse::<f64>().ok().filter(|n| n.fract() == 0.0 && n.abs() <= 1024.0);
    let text = match (whole, a.is_number, n.is_number) {
        (Some(n), true, _) => return Code::atom(format!("f64::powi({}, {n})", a.text), true),
        (Some(n), false, _) => format!("{}.powi({n})", a.receiver()),
        (None, true, true) => return Code::atom(format!("f64::powf({}, {})", a.text, n.text), true),
        (None, false, true) => format!("{}.powf({})", a.receiver(), n.text),
        (None, _, false) => format!("{}.pow({})", a.receiver(), n.text),
    };
    Code::atom(text, false)
}

/// A select for one comparison, which is read in one pass; an `if` for several.
fn branches(expression: &Expression, codes: &[Code], condition: At, then: &Code, otherwise: &Code) -> Code {
    let (then, otherwise) = (then.scalar().text, otherwise.scalar().text);
    let text = match expression.nodes[condition].operation {
        Operation::Compare(relation, a, b) => {
            let (a, b) = (codes[a].scalar().text, codes[b].scalar().text);
            let (comparison, a, b) = match relation {
                Relation::Less => ("Less", a, b),
                Relation::LessOrEqual => ("LessOrEqual", a, b),
                Relation::Greater => ("Less", b, a),
                Relation::GreaterOrEqual => ("LessOrEqual", b, a),
            };
            format!("S::select(Comparison::{comparison}, {a}, {b}, {then}, {otherwise})")
        }
        _ => format!("(if {} {{ {then} }} else {{ {otherwise} }})", codes[condition].text),
    };
    Code::atom(text, false)
}

fn condition(operation: &Operation, codes: &[Code]) -> Code {
    let text = match operation {
        Operation::Compare(relation, a, b) => {
            let sign = match relation {
                Relation::Less => "<",
                Relation::LessOrEqual => "<=",
                Relation::Greater => ">",
                Relation::GreaterOrEqual => ">=",
            };
            format!("{} {sign} {}", codes[*a].receiver(), codes[*b].within(Tight::Sum))
        }
        Operation::And(a, b) => format!("({}) && ({})", codes[*a].text, codes[*b].text),
        Operation::Or(a, b) => format!("({}) || ({})", codes[*a].text, codes[*b].text),
        Operation::Not(a) => format!("!({})", codes[*a].text),
        _ => String::new(),
    };
    Code::atom(text, false)
}
