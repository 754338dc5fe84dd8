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
        let names = || flat.iter().map(|j| format!("`{}`", parameters[*j].name)).collect::<Vec<_>>().join(", ");
        let value = format!("{} = {}", derived.name, Cell::number(derived.value, 6).text());
        let is_known = |j: &usize| flat.contains(j) || parameters[*j].knowledge.standard_error().is_some();
        let text = match (derived.standard_error, derived.interval) {
            _ if !derived.value.is_finite() => {
                format!("{}: its expression is no finite number at the estimate", derived.name)
            }
            (Some(_), Some(_)) if !flat.is_empty() && flat.len() == unknown.len() => {
                format!("{value}, the same within the 95 % intervals of {}", names())
            }
            (Some(error), Some(interval)) => with_interval(&derived, error, interval),
            _ if !flat.is_empty() && unknown.iter().all(is_known) => format!(
                "{value}, not known: it changes within what is known of {}, but has no slope there at the estimate (an `if`, a limit, a \
                 rounding)",
                names()
            ),
            _ => format!("{value}, not known: it depends on a parameter that is not"),
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
    fn flat(&self, unknown: &[usize], parameters: &[ParameterEstimate]) -> Vec<usize> {
        let slope = |place: usize| {
            let leaf = |j: usize| Dual::<1>::variable(parameters[j].value, if j == place { 0 } else { 1 });
            self.evaluate(leaf).slopes[0]
        };
        unknown.iter().copied().filter(|place| slope(*place) == 0.0).collect()
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

/// A quantity with the digits that its standard error leaves.
fn with_interval(one: &Derived, error: f64, (lower, upper): (f64, f64)) -> String {
    let [value, lower, upper] = [one.value, lower, upper].map(|number| Cell::resolved(number, error));
    let (value, error, lower, upper) = (value.text(), Cell::error(error), lower.text(), upper.text());
    format!("{} = {value}, std. error {}, 95 % interval {lower} … {upper}", one.name, error.text())
}
