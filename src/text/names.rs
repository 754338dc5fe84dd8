//! What each name of a document stands for, and the order in which definitions follow from each other.

use super::document::Document;
use super::expression::{Expression, Operation};
use super::remark::{Remark, Source};
use crate::graph::{Function, Function2};
use std::collections::HashMap;
use std::sync::Arc;

/// What a name stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    Number(f64),
    Time,
    Input(u32),
    Parameter(u32),
    State(u32),
    /// An output as it was measured.
    Measured(u32),
    /// Among the items: constants, then definitions.
    Item(usize),
    Table(usize),
}

pub(super) type Names<'d> = HashMap<&'d str, Meaning>;

fn number(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

/// The names that the equations of a document may use.
pub(super) fn names(document: &Document) -> Names<'_> {
    let mut names = Names::from([
        ("t", Meaning::Time),
        ("pi", Meaning::Number(core::f64::consts::PI)),
        ("inf", Meaning::Number(f64::INFINITY)),
        ("nan", Meaning::Number(f64::NAN)),
    ]);
    let constants = document.constants.iter().map(|one| one.quantity.name.as_str());
    let definitions = document.definitions.iter().map(|one| one.quantity.name.as_str());
    names.extend(constants.chain(definitions).enumerate().map(|(i, name)| (name, Meaning::Item(i))));
    names.extend(
        document.inputs.iter().enumerate().map(|(i, one)| (one.quantity.name.as_str(), Meaning::Input(number(i)))),
    );
    names.extend(
        document
            .parameters
            .iter()
            .enumerate()
            .map(|(i, one)| (one.quantity.name.as_str(), Meaning::Parameter(number(i)))),
    );
    names.extend(
        document.states.iter().enumerate().map(|(i, one)| (one.quantity.name.as_str(), Meaning::State(number(i)))),
    );
    names.extend(document.tables.iter().enumerate().map(|(i, one)| (one.quantity.name.as_str(), Meaning::Table(i))));
    names
}

/// The expressions of the items: constants, then definitions.
pub(super) fn items(document: &Document) -> Vec<&Expression> {
    let constants = document.constants.iter().map(|one| &one.value);
    constants.chain(document.definitions.iter().map(|one| &one.value)).collect()
}

/// The name of an item.
pub(super) fn item_name(document: &Document, item: usize) -> &str {
    match item.checked_sub(document.constants.len()) {
        None => &document.constants[item].quantity.name,
        Some(definition) => &document.definitions[definition].quantity.name,
    }
}

/// The items in an order in which each comes after those that it names; an item that leads back to itself is an error.
pub(super) fn order(document: &Document, names: &Names<'_>, source: &Arc<Source>) -> Result<Vec<usize>, Remark> {
    let items = items(document);
    let named = |item: usize| -> Vec<(usize, usize)> {
        let used = |(at, node): (usize, &super::expression::Node)| match &node.operation {
            Operation::Name(name) => match names.get(name.as_str()) {
                Some(Meaning::Item(other)) => Some((*other, at)),
                _ => None,
            },
            _ => None,
        };
        items[item].nodes.iter().enumerate().filter_map(used).collect()
    };
    let (mut found, mut seen) = (vec![], vec![false; items.len()]);
    for first in 0..items.len() {
        // Each open item with those that it names, last first.
        let mut open: Vec<(usize, Vec<(usize, usize)>)> = vec![];
        if !seen[first] {
            seen[first] = true;
            open.push((first, named(first)));
        }
        while let Some((item, rest)) = open.last_mut() {
            let item = *item;
            let Some((next, at)) = rest.pop() else {
                found.push(item);
                open.pop();
                continue;
            };
            if let Some(begin) = open.iter().position(|(open, _)| *open == next) {
                let circle: Vec<&str> = open[begin..]
                    .iter()
                    .map(|(item, _)| *item)
                    .chain([next])
                    .map(|item| item_name(document, item))
                    .collect();
                let title = format!("`{}` is defined by itself: {}", item_name(document, next), circle.join(" -> "));
                let span = items[item].span(&source.text, at);
                return Err(Remark::error(source, span, title).help("make it a state, if it has a memory".to_owned()));
            }
            if !seen[next] {
                seen[next] = true;
                open.push((next, named(next)));
            }
        }
    }
    Ok(found)
}

/// A function that expressions may call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Callable {
    One(Function),
    Two(Function2),
    /// Of two arguments or more.
    Max,
    Min,
    /// `x` kept within two others.
    Clamp,
    Fract,
}

/// The function of a name.
pub(super) fn function(name: &str) -> Option<Callable> {
    match name {
        "max" => return Some(Callable::Max),
        "min" => return Some(Callable::Min),
        "clamp" => return Some(Callable::Clamp),
        "fract" => return Some(Callable::Fract),
        _ => {}
    }
    let one = Function::ALL.into_iter().find(|function| function.name() == name).map(Callable::One);
    one.or_else(|| Function2::ALL.into_iter().find(|function| function.name() == name).map(Callable::Two))
}

/// The names of all functions.
pub(super) fn functions() -> impl Iterator<Item = &'static str> {
    let named = Function::ALL.into_iter().map(Function::name).chain(Function2::ALL.into_iter().map(Function2::name));
    named.chain(["clamp", "fract"])
}

/// What stands for a function of another language.
pub(super) fn foreign(name: &str) -> Option<&'static str> {
    Some(match name {
        "log" => "write `ln` for the natural logarithm, `log10` for that to base 10",
        "sign" | "sgn" => "write `signum(x)`, which is 1 or -1; a smooth one is `tanh(x/width)`",
        "mod" | "fmod" | "rem" => "write `rem_euclid(x, period)`",
        "power" => "write `x^2`",
        "sqr" | "square" => "write `x^2`",
        "arcsin" => "write `asin`",
        "arccos" => "write `acos`",
        "arctan" => "write `atan`",
        "arctan2" => "write `atan2`",
        "fabs" => "write `abs`",
        "expm1" => "write `exp_m1`",
        "log1p" => "write `ln_1p`",
        "sat" => "write `clamp(x, low, high)`",
        "where" | "ifelse" | "select" | "iif" => "write `if a < b then c else d`",
        "sum" | "mean" | "integral" | "diff" | "der" | "derivative" => {
            "an expression knows the present values only; what has a memory is a state"
        }
        _ => return None,
    })
}
