//! [`Unknowns`]: the free quantities of a fit in a row, and the way from there to parameters and initial states.
//!
//! The row holds the parameters that all experiments share, then for each experiment its free initial states and its own
//! parameters. The optimizer sees coordinates: values, or their logarithms.

use crate::error::Error;
use crate::experiment::{Experiment, ExperimentOf, Initial};
use crate::model::Model;
use crate::parameter::{Parameter, Transform, fixed, free};
use crate::predict::{Seed, Target, measured};
use crate::signals::{Of, Signals};

/// One free quantity.
#[derive(Clone, Debug)]
pub(crate) struct Unknown {
    /// Name with its experiment, if it belongs to one.
    pub name: String,
    pub unit: &'static str,
    pub target: Target,
    /// Index of the experiment that it belongs to; `None` if all share it.
    pub experiment: Option<usize>,
    pub parameter: Parameter,
}

/// Initial state and parameters of one experiment.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    pub x: Vec<f64>,
    pub p: Vec<f64>,
}

pub(crate) struct Unknowns {
    /// What each experiment is called in reports and errors.
    pub labels: Vec<String>,
    pub parameters: Vec<Parameter>,
    /// What is known of each experiment's initial state.
    initial: Vec<Vec<Parameter>>,
    pub row: Vec<Unknown>,
    /// Where in the row each experiment's own unknowns begin, and the end of the row.
    begins: Vec<usize>,
}

impl Unknowns {
    pub fn new<M: Model>(
        model: &M,
        experiments: &[ExperimentOf<M>],
        parameters: Of<M::Parameters, Parameter>,
    ) -> Result<Self, Error> {
        let declared = M::Parameters::into_array(parameters);
        let declared = declared.as_ref();
        for (i, parameter) in declared.iter().enumerate() {
            check(M::Parameters::NAMES[i], parameter)?;
        }
        let labels = labels(experiments);
        let parameter = |i: usize, experiment: Option<usize>| Unknown {
            name: match experiment {
                Some(e) => format!("{} [{}]", M::Parameters::NAMES[i], labels[e]),
                None => M::Parameters::NAMES[i].to_owned(),
            },
            unit: M::Parameters::UNITS[i],
            target: Target::Parameter(i),
            experiment,
            parameter: declared[i],
        };
        let chosen =
            |own: bool| (0..declared.len()).filter(move |&i| declared[i].free && declared[i].per_experiment == own);
        let mut row: Vec<Unknown> = chosen(false).map(|i| parameter(i, None)).collect();
        let (mut begins, mut initial) = (vec![], vec![]);
        for (e, experiment) in experiments.iter().enumerate() {
            begins.push(row.len());
            let state = initial_state(model, experiment, &parameters)?;
            for (i, &known) in M::State::into_array(state).as_ref().iter().enumerate() {
                let name = match experiments.len() {
                    1 => format!("{}(0)", M::State::NAMES[i]),
                    _ => format!("{}(0) [{}]", M::State::NAMES[i], labels[e]),
                };
                check(&name, &known)?;
                if known.free {
                    let unit = M::State::UNITS[i];
                    row.push(Unknown { name, unit, target: Target::State(i), experiment: Some(e), parameter: known });
                }
            }
            row.extend(chosen(true).map(|i| parameter(i, Some(e))));
            initial.push(M::State::into_array(state).as_ref().to_vec());
        }
        begins.push(row.len());
        Ok(Unknowns { labels, parameters: declared.to_vec(), initial, row, begins })
    }

    /// How many unknowns all experiments share; they come first.
    pub fn shared(&self) -> usize {
        self.begins[0]
    }

    /// The unknowns that one experiment depends on, in the order of its columns: its own, then the shared ones.
    pub fn columns(&self, experiment: usize) -> impl Iterator<Item = usize> {
        (self.begins[experiment]..self.begins[experiment + 1]).chain(0..self.begins[0])
    }

    /// The coordinates where the search starts.
    pub fn start(&self) -> Vec<f64> {
        self.row.iter().map(|u| u.parameter.transform.to_coordinate(u.parameter.start)).collect()
    }

    /// The bounds of each coordinate.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let coordinate = |u: &Unknown, bound: f64| match u.parameter.transform {
            Transform::Log if bound <= 0.0 => f64::NEG_INFINITY,
            transform => transform.to_coordinate(bound),
        };
        self.row.iter().map(|u| (coordinate(u, u.parameter.lower), coordinate(u, u.parameter.upper))).collect()
    }

    /// The value of each unknown.
    pub fn values(&self, coordinates: &[f64]) -> Vec<f64> {
        self.row.iter().zip(coordinates).map(|(u, &c)| u.parameter.transform.to_value(c)).collect()
    }

    /// Initial state and parameters of one experiment.
    pub fn place(&self, experiment: usize, coordinates: &[f64]) -> Place {
        let start = |known: &[Parameter]| known.iter().map(|p| p.start).collect::<Vec<f64>>();
        let mut place = Place { x: start(&self.initial[experiment]), p: start(&self.parameters) };
        for i in self.columns(experiment) {
            let value = self.row[i].parameter.transform.to_value(coordinates[i]);
            match self.row[i].target {
                Target::State(s) => place.x[s] = value,
                Target::Parameter(j) => place.p[j] = value,
            }
        }
        place
    }

    /// What each column of one experiment's slopes belongs to.
    pub fn seeds(&self, experiment: usize, coordinates: &[f64]) -> Vec<Seed> {
        let seed = |i: usize| {
            let Unknown { target, parameter: Parameter { transform, .. }, .. } = self.row[i];
            Seed { target, slope: transform.slope(transform.to_value(coordinates[i])) }
        };
        self.columns(experiment).map(seed).collect()
    }

    /// The prior of each unknown that has one: its index, the slope of its standardized error and the error itself.
    pub fn priors(&self, coordinates: &[f64]) -> impl Iterator<Item = (usize, f64, f64)> {
        self.row.iter().zip(coordinates).enumerate().filter_map(|(i, (unknown, &c))| {
            let Parameter { prior, transform, .. } = unknown.parameter;
            let value = transform.to_value(c);
            prior.map(|prior| (i, transform.slope(value) / prior.std, (prior.mean - value) / prior.std))
        })
    }
}

/// The names of the experiments; those that share one are numbered from 1 in their order.
fn labels<X: Signals, U: Signals, Y: Signals>(experiments: &[Experiment<X, U, Y>]) -> Vec<String> {
    let name = |e: usize| experiments[e].name();
    let twins = |range: std::ops::Range<usize>, e: usize| range.filter(|&other| name(other) == name(e)).count();
    let label = |e: usize| match twins(0..experiments.len(), e) {
        1 => name(e).to_owned(),
        _ => format!("{} #{}", name(e), twins(0..e, e) + 1),
    };
    (0..experiments.len()).map(label).collect()
}

/// What is known of the state at an experiment's first sample.
fn initial_state<M: Model>(
    model: &M,
    experiment: &ExperimentOf<M>,
    parameters: &Of<M::Parameters, Parameter>,
) -> Result<Of<M::State, Parameter>, Error> {
    let how: fn(f64) -> Parameter = match experiment.initial_state() {
        Initial::Given(state) => return Ok(*state),
        Initial::FirstSample => fixed,
        Initial::Estimated => free,
    };
    let p = M::Parameters::map(*parameters, |p| p.start);
    let (t, u, y) = (experiment.time(0), &experiment.inputs()[0], &experiment.outputs()[0]);
    let unknown = |reason| Error::StateNotMeasured { experiment: experiment.name().to_owned(), reason };
    let x = measured::state(model, t, u, y, &p).map_err(unknown)?;
    if let (Initial::FirstSample, Some(name)) =
        (experiment.initial_state(), measured::depends_on_parameter(model, t, &x, u, &p))
    {
        return Err(unknown(format!("the outputs depend on the parameter `{name}`, too")));
    }
    Ok(M::State::map(x, how))
}

fn check(name: &str, parameter: &Parameter) -> Result<(), Error> {
    let Parameter { start, free, lower, upper, prior, transform, .. } = *parameter;
    let wrong = |problem: String| Err(Error::Parameter { parameter: name.to_owned(), problem });
    if !start.is_finite() {
        return wrong(format!("its value is {start}; give a finite start"));
    }
    if lower.is_nan() || upper.is_nan() || lower > upper || free && lower == upper {
        return wrong(format!("its bounds are {lower} and {upper}; the lower must be below the upper (or use fixed)"));
    }
    if start < lower || start > upper {
        return wrong(format!(
            "its start {start} lies outside its bounds {lower} to {upper}; move the start, or the bounds"
        ));
    }
    if !free {
        return Ok(());
    }
    if transform == Transform::Log && start <= 0.0 {
        return wrong(format!("its start {start} has no logarithm; start above zero or leave .log() out"));
    }
    match prior {
        Some(p) if !(p.mean.is_finite() && p.std > 0.0 && p.std.is_finite()) => wrong(format!(
            "its prior is {} +- {}; mean and standard deviation must be finite, the latter positive",
            p.mean, p.std
        )),
        _ => Ok(()),
    }
}
