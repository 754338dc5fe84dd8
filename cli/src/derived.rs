//! `--derived`: quantities computed from the parameters.

use crate::Failure;
use greybox::diagnose::{Derived, derived_by};
use greybox::estimate::ParameterEstimate;
use greybox::graph::{Graph, Id, Leaf};
use greybox::report::Cell;
use greybox::text::Model;
use greybox::{Dual, Knowledge, Scalar, Summary};

/// A quantity by its expression.
pub struct Expression {
    name: String,
    graph: Graph,
    root: Id,
}

/// A quantity at an estimate, and the line that says it.
pub struct Computed {
    pub derived: Derived,
    pub text: String,
}

/// An unknown parameter in which a quantity has no slope, and the ends of what it may be.
struct Flat<'a> {
    place: usize,
    name: &'a str,
    ends: [f64; 2],
}

/// Reads what the command line says, before a fit.
pub fn expressions(said: &[(String, String)], model: &Model) -> Result<Vec<Expression>, Failure> {
    let read = |(k, (name, text)): (usize, &(String, String))| -> Result<Expression, Failure> {
        let refused = |why: String| format!("--derived {name}={text}: {why}; give the quantity another name");
        if let Some(what) = meaning(name, model) {
            return Err(refused(format!("the model has the {what} `{name}`")).into());
        }
        if said[..k].iter().any(|(before, _)| before == name) {
            return Err(refused(format!("another quantity is called `{name}`")).into());
        }
        let (graph, root) = model.derived(text)?;
        Ok(Expression { name: name.clone(), graph, root })
    };
    said.iter().enumerate().map(read).collect()
}

/// What a name stands for in the model.
fn meaning(name: &str, model: &Model) -> Option<&'static str> {
    let layout = model.equations().layout();
    let quantities = [
        ("parameter", &layout.parameters),
        ("state", &layout.states),
        ("input", &layout.inputs),
        ("output", &layout.outputs),
    ];
    let of_layout = quantities.into_iter().find(|(_, all)| all.iter().any(|one| one.name == name));
    let is_constant = || model.constants().iter().any(|(constant, ..)| *constant == name);
    of_layout.map(|(what, _)| what).or_else(|| is_constant().then_some("constant"))
}

/// The quantities at an estimate; of each record, where these have parameters for themselves.
pub fn computed(expressions: &[Expression], estimate: &Summary) -> Vec<Computed> {
    let records = match estimate.own_parameters().is_empty() {
        true => estimate.experiments.len().min(1),
        false => estimate.experiments.len(),
    };
    let of_record = |k: usize| {
        let own = estimate.of_experiment(k);
        let parameters = own.map_or_else(Vec::new, |own| own.parameters);
        let name = |name: &str| match records {
            1 => name.to_owned(),
            _ => format!("{name} [{}]", estimate.experiments[k].name),
        };
        let of =
            |one: &Expression| one.at(derived_by(estimate, k, &name(&one.name), &one.graph, one.root), &parameters);
        expressions.iter().map(of).collect::<Vec<_>>()
    };
    (0..records).flat_map(of_record).collect()
}

impl Expression {
    /// The quantity, as it was computed by its slopes, where these tell how well it is known.
    fn at(&self, derived: Derived, parameters: &[ParameterEstimate]) -> Computed {
        let unknown = self.unknown(parameters);
        let flat = self.flat(&unknown, parameters);
        let names = || flat.iter().map(|one| format!("`{}`", one.name)).collect::<Vec<_>>().join(", ");
        let value = || format!("{} = {}", derived.name, Cell::number(derived.value, 6).text());
        if !derived.value.is_finite() {
            let text = format!("{}: its expression is no finite number at the estimate", derived.name);
            return Computed { derived, text };
        }
        if self.changes(&flat, parameters) {
            let text = format!(
                "{}, not known: it changes within what is known of {}, but has no slope there at the estimate (an `if`, a limit, a rounding)",
                value(),
                names()
            );
            return Computed { derived: Derived { standard_error: None, interval: None, ..derived }, text };
        }
        let text = match (derived.standard_error, derived.interval) {
            (Some(_), Some(_)) if !flat.is_empty() && flat.len() == unknown.len() => {
                format!("{}, the same within the 95 % intervals of {}", value(), names())
            }
            (Some(error), Some(interval)) => with_interval(&derived, error, interval),
            _ => format!("{}, not known: it depends on a parameter that is not", value()),
        };
        Computed { derived, text }
    }

    /// The unknown parameters that it is an expression of.
    fn unknown(&self, parameters: &[ParameterEstimate]) -> Vec<usize> {
        let mut found = vec![];
        self.evaluate(|j| {
            found.push(j);
            f64::NAN
        });
        found.retain(|j| parameters.get(*j).is_some_and(|one| one.knowledge != Knowledge::Fixed));
        found
    }

    /// Those in which it has no slope at the estimate.
    fn flat<'a>(&self, unknown: &[usize], parameters: &'a [ParameterEstimate]) -> Vec<Flat<'a>> {
        let slope = |place: usize| {
            let leaf = |j: usize| Dual::<1>::variable(parameters[j].value, if j == place { 0 } else { 1 });
            self.evaluate(leaf).slopes[0]
        };
        let flat = unknown.iter().filter(|place| slope(**place) == 0.0);
        flat.map(|&place| Flat { place, name: &parameters[place].name, ends: ends(&parameters[place]) }).collect()
    }

    /// Whether other values of one or two of these change it.
    fn changes(&self, flat: &[Flat<'_>], parameters: &[ParameterEstimate]) -> bool {
        let at = |moved: [(usize, f64); 2]| {
            let value = |j: usize| moved.iter().find(|(place, _)| *place == j).map(|(_, end)| *end);
            self.evaluate(|j| value(j).unwrap_or(parameters[j].value))
        };
        let corners = |one: &Flat<'_>, other: &Flat<'_>| {
            let with = |end: f64| other.ends.map(|other_end| at([(one.place, end), (other.place, other_end)]));
            one.ends.map(with).concat()
        };
        let here = self.evaluate(|j| parameters[j].value);
        flat.iter().any(|one| flat.iter().any(|other| corners(one, other).iter().any(|value| *value != here)))
    }

    /// Its value in numbers of any type, by those of the parameters in their places.
    fn evaluate<S: Scalar>(&self, mut parameter: impl FnMut(usize) -> S) -> S {
        let leaf = |leaf: Leaf| match leaf {
            Leaf::Parameter(j) => parameter(j as usize),
            _ => S::from(f64::NAN),
        };
        self.graph.evaluate(&[self.root], leaf).first().copied().unwrap_or(S::from(f64::NAN))
    }
}

/// The ends of what a parameter may be: its 95 % interval, or its bounds where it has none.
fn ends(one: &ParameterEstimate) -> [f64; 2] {
    match one.knowledge {
        Knowledge::Known { lower, upper, .. } => [lower, upper],
        Knowledge::Held { bound, end } => [bound, end.unwrap_or(bound)],
        Knowledge::Fixed => [one.value; 2],
        Knowledge::Unidentified => [one.declared.lower, one.declared.upper],
    }
}

/// A quantity with the digits that its standard error leaves.
fn with_interval(one: &Derived, error: f64, (lower, upper): (f64, f64)) -> String {
    let [value, lower, upper] = [one.value, lower, upper].map(|number| Cell::resolved(number, error));
    let (value, error, lower, upper) = (value.text(), Cell::error(error), lower.text(), upper.text());
    format!("{} = {value}, std. error {}, 95 % interval {lower} … {upper}", one.name, error.text())
}
