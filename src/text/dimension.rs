//! The check of units: each expression's dimension from those of what it names. Nothing is converted; what does not fit is a
//! warning.

use super::document::{Declared, Document};
use super::expression::{At, Expression, Operation, Sign};
use super::names::{Callable, Meaning, Names, function, items, names, order};
use super::remark::{Remark, Source};
use crate::graph::{Function, Function2};
use crate::layout::Kind;
use crate::unit::Unit;
use std::sync::Arc;

/// What is known of the unit of a value.
#[derive(Clone, Debug)]
enum Of {
    /// A number without a unit, which fits any; as a factor it is a ratio.
    Number,
    /// Nothing, because something that it is made of has no unit.
    Unknown,
    Unit(Unit),
}

impl Of {
    fn declared(declared: &Declared) -> Of {
        declared.dimension.clone().map_or(Of::Unknown, Of::Unit)
    }
}

/// Warnings of a document whose names are right.
pub(super) fn check(document: &Document, source: &Arc<Source>) -> Vec<Remark> {
    let names = names(document);
    let Ok(order) = order(document, &names, source) else { return vec![] };
    let expressions = items(document);
    let constants = document.constants.iter().map(|one| &one.quantity);
    let quantities: Vec<&Declared> = constants.chain(document.definitions.iter().map(|one| &one.quantity)).collect();
    let mut checker = Checker { document, source, names, items: vec![Of::Unknown; quantities.len()], warnings: vec![] };
    for item in order {
        let found = checker.unit(expressions[item]);
        let declared = quantities[item];
        checker.items[item] = match (&declared.dimension, found) {
            (Some(unit), found) => {
                checker.compare(expressions[item], found, unit, &format!("`{}`", declared.name), &declared.unit);
                Of::Unit(unit.clone())
            }
            // A constant without a unit is a number.
            (None, _) if item < document.constants.len() && declared.unit.is_empty() => Of::Number,
            (None, _) if !declared.unit.is_empty() => Of::Unknown,
            (None, found) => found,
        };
    }
    for state in &document.states {
        let per_second = document.kind == Kind::Continuous;
        let rate =
            |unit: &Unit, power: f64| if per_second { unit.over(&Unit::second().power(power)) } else { unit.clone() };
        let said = |over: &str| {
            if per_second { format!("{}{over}", state.quantity.unit) } else { state.quantity.unit.clone() }
        };
        let name = &state.quantity.name;
        let of_rate = state.rate.as_ref().map(|rate| (rate, checker.unit(rate)));
        let of_jump = state.jump.as_ref().map(|jump| (jump, checker.unit(jump)));
        if let Some(unit) = &state.quantity.dimension {
            if let Some((expression, found)) = of_rate {
                let what =
                    if per_second { format!("the derivative of `{name}`") } else { format!("the next `{name}`") };
                checker.compare(expression, found, &rate(unit, 1.0), &what, &said("/s"));
            }
            if let Some((jump, found)) = of_jump {
                checker.compare(jump, found, unit, &format!("`{name}` after a sample"), &state.quantity.unit);
            }
            if let Some(diffusion) = &state.diffusion {
                let found = checker.unit(diffusion);
                checker.compare(
                    diffusion,
                    found,
                    &rate(unit, 0.5),
                    &format!("the diffusion of `{name}`"),
                    &said("/s^0.5"),
                );
            }
            if let Some(initial) = state.initial() {
                let found = checker.unit(initial);
                checker.compare(initial, found, unit, &format!("the initial `{name}`"), &state.quantity.unit);
            }
            if let Some(initial) = &state.initial_noise {
                let found = checker.unit(initial);
                let what = format!("the initial noise of `{name}`");
                checker.compare(initial, found, unit, &what, &state.quantity.unit);
            }
        }
    }
    for input in &document.inputs {
        let Some(delay) = &input.delay else { continue };
        let found = checker.unit(delay);
        checker.compare(delay, found, &Unit::second(), &format!("the dead time of `{}`", input.quantity.name), "s");
    }
    for output in &document.outputs {
        let found = checker.unit(&output.value);
        let noise = output.noise.as_ref().map(|noise| (noise, checker.unit(noise)));
        let Some(unit) = &output.quantity.dimension else { continue };
        let (name, said) = (&output.quantity.name, &output.quantity.unit);
        checker.compare(&output.value, found, unit, &format!("output `{name}`"), said);
        if let Some((noise, found)) = noise {
            checker.compare(noise, found, unit, &format!("the noise of `{name}`"), said);
        }
    }
    checker.warnings
}

struct Checker<'d> {
    document: &'d Document,
    source: &'d Arc<Source>,
    names: Names<'d>,
    items: Vec<Of>,
    warnings: Vec<Remark>,
}

impl Checker<'_> {
    fn warn(&mut self, expression: &Expression, at: At, title: String, help: Option<String>) {
        let span = expression.span(&self.source.text, at);
        self.warnings.push(Remark::warning(self.source, span, title).help(help));
    }

    /// Warns where an expression is not in the unit of what it defines.
    fn compare(&mut self, expression: &Expression, found: Of, unit: &Unit, what: &str, said: &str) {
        let Of::Unit(found) = found else { return };
        let said = if said.trim().is_empty() { "1" } else { said };
        let title = if !found.same_dimension(unit) {
            format!("{what} is in {said}, this is in {found}")
        } else if !found.same_size(unit) {
            format!("{what} is in {said}, this is in units of {found}")
        } else {
            return;
        };
        let help =
            found.same_dimension(unit).then(|| "nothing is converted: multiply by the factor between them".to_owned());
        let span = expression.span(&self.source.text, expression.root());
        self.warnings.push(Remark::warning(self.source, span, title).help(help));
    }

    /// The unit of two values that stand for the same thing, as in a sum.
    fn same(&mut self, expression: &Expression, (a, b): (At, At), at: At, (x, y): (&Of, &Of)) -> Of {
        match (x, y) {
            (Of::Unit(x), Of::Unit(y)) => {
                let text = |at: At| expression.text[expression.nodes[at].span.clone()].trim();
                if !x.same_dimension(y) {
                    let title = format!("`{}` is in {x}, `{}` is in {y}", short(text(a)), short(text(b)));
                    self.warn(expression, at, title, None);
                    return Of::Unknown;
                }
                if !x.same_size(y) {
                    let title = format!("`{}` is in units of {x}, `{}` of {y}", short(text(a)), short(text(b)));
                    let help = "nothing is converted: multiply one by the factor between them".to_owned();
                    self.warn(expression, at, title, Some(help));
                    return Of::Unit(x.clone().of_any_size());
                }
                Of::Unit(if x.factor.is_some() { x.clone() } else { y.clone() })
            }
            (Of::Unknown, _) | (_, Of::Unknown) => match (x, y) {
                (Of::Unit(unit), _) | (_, Of::Unit(unit)) => Of::Unit(unit.clone()),
                _ => Of::Unknown,
            },
            (Of::Number, other) | (other, Of::Number) => other.clone(),
        }
    }

    /// The unit of an expression.
    fn unit(&mut self, expression: &Expression) -> Of {
        let mut units: Vec<Of> = Vec::with_capacity(expression.nodes.len());
        for (at, node) in expression.nodes.iter().enumerate() {
            let unit = match &node.operation {
                Operation::Number(_) => Of::Number,
                Operation::Name(name) => self.named(name),
                Operation::Negate(a) => units[*a].clone(),
                Operation::Binary(Sign::Add | Sign::Sub, a, b) => {
                    self.same(expression, (*a, *b), at, (&units[*a], &units[*b]))
                }
                Operation::Binary(Sign::Mul, a, b) => product(&units[*a], &units[*b], 1.0),
                Operation::Binary(Sign::Div, a, b) => product(&units[*a], &units[*b], -1.0),
                Operation::Binary(Sign::Power, a, b) => self.power(expression, (*a, *b), &units),
                Operation::Call { name, order, arguments } => {
                    self.call(expression, at, (name, *order, arguments), &units)
                }
                Operation::If([_, a, b]) => self.same(expression, (*a, *b), at, (&units[*a], &units[*b])),
                Operation::Compare(_, a, b) => self.same(expression, (*a, *b), at, (&units[*a], &units[*b])),
                Operation::And(..) | Operation::Or(..) | Operation::Not(_) => Of::Unknown,
            };
            units.push(unit);
        }
        units.pop().unwrap_or(Of::Unknown)
    }

    fn named(&self, name: &str) -> Of {
        match self.names.get(name) {
            Some(Meaning::Number(_)) => Of::Number,
            Some(Meaning::Time) => Of::Unit(Unit::second()),
            Some(Meaning::Input(i)) => Of::declared(&self.document.inputs[*i as usize].quantity),
            Some(Meaning::Parameter(i)) => Of::declared(&self.document.parameters[*i as usize].quantity),
            Some(Meaning::State(i)) => Of::declared(&self.document.states[*i as usize].quantity),
            Some(Meaning::Item(item)) => self.items[*item].clone(),
            _ => Of::Unknown,
        }
    }

    fn power(&mut self, expression: &Expression, (a, n): (At, At), units: &[Of]) -> Of {
        self.ratio(expression, n, &units[n], "a power");
        match (&units[a], constant(expression, n)) {
            (Of::Number, _) => Of::Number,
            (Of::Unit(unit), Some(n)) => Of::Unit(unit.power(n)),
            (Of::Unit(unit), None) if unit.is_dimensionless() => Of::Unit(Unit::one().of_any_size()),
            _ => Of::Unknown,
        }
    }

    /// Warns of what is no ratio.
    fn ratio(&mut self, expression: &Expression, at: At, unit: &Of, what: &str) {
        let Of::Unit(unit) = unit else { return };
        if !unit.is_dimensionless() {
            self.warn(expression, at, format!("{what} takes a number without a unit, this is in {unit}"), None);
        } else if !unit.same_size(&Unit::one()) {
            let title = format!("{what} takes radians or a ratio, this is in units of {unit}");
            let help = "nothing is converted: multiply by the factor (pi/180 for degrees, 0.01 for %)".to_owned();
            self.warn(expression, at, title, Some(help));
        }
    }

    fn call(
        &mut self,
        expression: &Expression,
        at: At,
        (name, order, arguments): (&str, [u8; 2], &[At]),
        units: &[Of],
    ) -> Of {
        if let Some(Meaning::Table(table)) = self.names.get(name) {
            return self.table(expression, *table, order, arguments, units);
        }
        let (Some(callable), Some(&first)) = (function(name), arguments.first()) else { return Of::Unknown };
        let one = || Of::Unit(Unit::one());
        match callable {
            Callable::One(function) => self.function(expression, first, function, &units[first], name),
            Callable::Max
            | Callable::Min
            | Callable::Clamp
            | Callable::Two(Function2::Hypot | Function2::RemEuclid) => {
                let mut unit = units[first].clone();
                for other in &arguments[1..] {
                    unit = self.same(expression, (first, *other), at, (&unit, &units[*other]));
                }
                unit
            }
            Callable::Two(Function2::Atan2) => {
                self.same(expression, (first, arguments[1]), at, (&units[first], &units[arguments[1]]));
                one()
            }
            Callable::Two(Function2::Pow) => self.power(expression, (first, arguments[1]), units),
            Callable::Two(_) | Callable::Fract => units[first].clone(),
        }
    }

    fn function(&mut self, expression: &Expression, at: At, function: Function, unit: &Of, name: &str) -> Of {
        use Function::{Abs, Cbrt, Ceil, Floor, Recip, Round, Signum, Sqrt, Trunc};
        match (function, unit) {
            (Abs | Floor | Ceil | Round | Trunc, _) => unit.clone(),
            (Signum, _) => Of::Unit(Unit::one()),
            (_, Of::Number) => Of::Number,
            (Sqrt | Cbrt | Recip, Of::Unknown) => Of::Unknown,
            (Sqrt, Of::Unit(unit)) => Of::Unit(unit.power(0.5)),
            (Cbrt, Of::Unit(unit)) => Of::Unit(unit.power(1.0 / 3.0)),
            (Recip, Of::Unit(unit)) => Of::Unit(unit.power(-1.0)),
            _ => {
                self.ratio(expression, at, unit, &format!("`{name}`"));
                Of::Unit(Unit::one())
            }
        }
    }

    fn table(&mut self, expression: &Expression, table: usize, order: [u8; 2], arguments: &[At], units: &[Of]) -> Of {
        let table = &self.document.tables[table];
        let mut found = Of::declared(&table.quantity);
        for ((at, axis), order) in arguments.iter().zip(&table.axes).zip(order) {
            let Some(axis) = axis else {
                found = if order > 0 { Of::Unknown } else { found };
                continue;
            };
            if let Of::Unit(unit) = &units[*at] {
                let name = &table.quantity.name;
                if !unit.same_dimension(axis) || !unit.same_size(axis) {
                    self.warn(expression, *at, format!("table `{name}` is over {axis}, this is in {unit}"), None);
                }
            }
            if order > 0 {
                found = product(&found, &Of::Unit(axis.power(f64::from(order))), -1.0);
            }
        }
        found
    }
}

/// A product (`sign` 1) or a quotient (-1).
fn product(a: &Of, b: &Of, sign: f64) -> Of {
    match (a, b) {
        (Of::Unit(a), Of::Unit(b)) => Of::Unit(if sign > 0.0 { a.times(b) } else { a.over(b) }),
        (Of::Unit(unit), Of::Number) => Of::Unit(unit.clone().of_any_size()),
        (Of::Number, Of::Unit(unit)) => Of::Unit(unit.power(sign).of_any_size()),
        (Of::Number, Of::Number) => Of::Number,
        _ => Of::Unknown,
    }
}

/// The number that a part of an expression is, if it is one: `2`, `-1`, `1/3`.
fn constant(expression: &Expression, at: At) -> Option<f64> {
    let literal = |at: At| match expression.nodes[at].operation {
        Operation::Number(value) => Some(value),
        _ => None,
    };
    let signed = |at: At| match expression.nodes[at].operation {
        Operation::Negate(a) => literal(a).map(|value| -value),
        _ => literal(at),
    };
    match expression.nodes[at].operation {
        Operation::Binary(Sign::Div, a, b) => Some(signed(a)? / literal(b)?),
        _ => signed(at),
    }
}

/// An expression that is not too long for a sentence.
fn short(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
