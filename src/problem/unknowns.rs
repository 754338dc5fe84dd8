//! [`Unknowns`]: the vector of the free quantities of a fit, and the parameters and initial states that follow from it.
//!
//! The vector holds the parameters that all experiments share, then for each experiment its free initial states and its
//! local parameters. The optimizer works on coordinates: values, or their logarithms.

use crate::error::{Error, short};
use crate::information::Information;
use crate::layout::{Kind, Layout, Quantity};
use crate::numeral::exact;
use crate::parameter::{Parameter, Transform, fixed, free};
use crate::record::{Initial, Record};
use crate::sweep::{Change, Guess, NoStart, NotAtRest, Seed, Sweep, Unstable};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Role of an unknown in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(tag = "code", content = "number", rename_all = "snake_case")]
pub enum Role {
    /// Parameter number.
    Parameter(usize),
    /// State number, at the first sample.
    InitialState(usize),
}

/// One free quantity.
#[derive(Clone, Debug)]
pub(crate) struct Free {
    /// Name with its experiment, if it belongs to one of several.
    pub name: String,
    pub unit: String,
    pub role: Role,
    /// Index of the experiment that it belongs to; `None` if all share it.
    pub experiment: Option<usize>,
    pub parameter: Parameter,
    /// Whether it is an initial state whose start nobody gave: neither the user nor the outputs.
    pub guessed: bool,
    /// Its size, if that is known otherwise than by its magnitude.
    pub size: Option<f64>,
}

/// Initial state and parameters of one experiment.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub x: Vec<f64>,
    pub p: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Unknowns {
    /// The name of each experiment in reports and errors.
    pub labels: Vec<String>,
    pub parameters: Vec<Parameter>,
    /// Declarations of each experiment's initial state.
    initial: Vec<Vec<Parameter>>,
    /// Whether some of it follows from the parameters.
    follows: Vec<bool>,
    pub row: Vec<Free>,
    /// Index of the first local unknown of each experiment, then the number of unknowns.
    begins: Vec<usize>,
    /// The quantity with respect to which each column of an experiment's slopes is computed.
    seeds: Vec<Arc<[Seed]>>,
}

impl Unknowns {
    pub fn new(sweep: &dyn Sweep, records: &[Record], parameters: &[Parameter]) -> Result<Self, Error> {
        let layout = sweep.layout();
        for (quantity, parameter) in layout.parameters.iter().zip(parameters) {
            check(&quantity.name, parameter)?;
        }
        let labels = labels(records);
        let labeled = |name: &str, e: usize| match records.len() {
            1 => name.to_owned(),
            _ => format!("{name} [{}]", labels[e]),
        };
        let free_of = |i: usize, experiment: Option<usize>| {
            let Quantity { name, unit } = layout.parameters[i].clone();
            let name = experiment.map_or(name.clone(), |e| format!("{name} [{}]", labels[e]));
            Free {
                name,
                unit,
                role: Role::Parameter(i),
                experiment,
                parameter: parameters[i],
                guessed: false,
                size: None,
            }
        };
        let chosen = |own: bool| {
            (0..parameters.len()).filter(move |&i| parameters[i].free && parameters[i].per_experiment == own)
        };
        let mut row: Vec<Free> = chosen(false).map(|i| free_of(i, None)).collect();
        let (mut begins, mut initial, mut follows) = (vec![], vec![], vec![]);
        for (e, record) in records.iter().enumerate() {
            begins.push(row.len());
            let InitialState { state, open, sizes, follow } = InitialState::of(sweep, record, parameters)?;
            for (i, (&known, Quantity { name, unit })) in state.iter().zip(&layout.states).enumerate() {
                let name = labeled(&format!("{name}(0)"), e);
                check(&name, &known)?;
                if known.per_experiment {
                    let problem =
                        "every experiment has an initial state of its own; leave .per_experiment() out".to_owned();
                    return Err(Error::Parameter { parameter: name, problem });
                }
                if known.free {
                    let (unit, role, experiment) = (unit.clone(), Role::InitialState(i), Some(e));
                    row.push(Free { name, unit, role, experiment, parameter: known, guessed: open[i], size: sizes[i] });
                }
            }
            row.extend(chosen(true).map(|i| free_of(i, Some(e))));
            initial.push(state);
            follows.push(follow);
        }
        begins.push(row.len());
        let (parameters, seeds) = (parameters.to_vec(), vec![]);
        let mut unknowns = Unknowns { labels, parameters, initial, follows, row, begins, seeds };
        unknowns.seeds = unknowns.all_seeds();
        Ok(unknowns)
    }

    /// How many unknowns all experiments share; they come first.
    pub fn shared(&self) -> usize {
        self.begins[0]
    }

    /// The unknowns that one experiment depends on, in the order of its columns: its own, then the shared ones.
    pub fn columns(&self, experiment: usize) -> impl Iterator<Item = usize> + Clone + use<> {
        (self.begins[experiment]..self.begins[experiment + 1]).chain(0..self.begins[0])
    }

    /// The coordinates where the search starts.
    pub fn start(&self) -> Vec<f64> {
        self.row.iter().map(|u| u.parameter.transform.to_coordinate(u.parameter.start)).collect()
    }

    /// Whether the predictor can start where the search does.
    pub fn check_starts(&self, sweep: &dyn Sweep, records: &[Record]) -> Result<(), Error> {
        let (start, layout) = (self.start(), sweep.layout());
        for (e, record) in records.iter().enumerate() {
            let Values { x, p } = self.of_experiment(e, &start);
            sweep.start(record, &x, &p).map_err(|none| self.no_start(layout, record, e, none))?;
        }
        Ok(())
    }

    /// The error of an experiment that has no carry at its first sample.
    pub fn no_start(&self, layout: &Layout, record: &Record, e: usize, none: NoStart) -> Error {
        let name = |state: usize| layout.states.get(state).map_or_else(String::new, |state| state.name.clone());
        let experiment = self.labels[e].clone();
        let per = if layout.kind == Kind::Discrete { "sample" } else { record.time_unit().base() }.to_owned();
        match none {
            NoStart::Unstable(Unstable { state, rate }) => {
                Error::NotStationary { experiment, state: name(state), rate, per }
            }
            NoStart::NotAtRest(NotAtRest { state, change }) => {
                let unit = layout.states.get(state).map_or_else(String::new, |state| state.unit.clone());
                let reason = match change {
                    Change::Rate(by) | Change::AtSample(by) if by.is_nan() => {
                        "the equations are undefined where the search for it ends".to_owned()
                    }
                    Change::Rate(by) => format!("it still changes by {} {unit} per {per}", short(by)),
                    Change::AtSample(by) => format!("the first sample changes it by {} {unit}", short(by)),
                    Change::Free => "it rests at any value".to_owned(),
                };
                Error::NotAtRest { experiment, state: name(state), reason }
            }
        }
    }

    /// Whether some of an experiment's initial state follows from the parameters.
    pub fn follows(&self, experiment: usize) -> bool {
        self.follows[experiment]
    }

    /// The bounds of each coordinate.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let coordinate = |u: &Free, bound: f64| match u.parameter.transform {
            Transform::Log if bound <= 0.0 => f64::NEG_INFINITY,
            transform => transform.to_coordinate(bound),
        };
        self.row.iter().map(|u| (coordinate(u, u.parameter.lower), coordinate(u, u.parameter.upper))).collect()
    }

    /// The value of each unknown.
    pub fn values(&self, coordinates: &[f64]) -> Vec<f64> {
        self.row.iter().zip(coordinates).map(|(u, &c)| u.parameter.transform.to_value(c)).collect()
    }

    /// Whether the values of all unknowns that were declared positive are positive.
    pub fn have_declared_signs(&self, values: impl IntoIterator<Item = f64>) -> bool {
        self.row.iter().zip(values).all(|(u, value)| !u.parameter.positive || value > 0.0)
    }

    /// Initial state and parameters of one experiment; of states that follow from the parameters, that of the start.
    pub fn of_experiment(&self, experiment: usize, coordinates: &[f64]) -> Values {
        let start = |known: &[Parameter]| known.iter().map(|p| p.start).collect::<Vec<f64>>();
        let mut values = Values { x: start(&self.initial[experiment]), p: start(&self.parameters) };
        for i in self.columns(experiment) {
            let value = self.row[i].parameter.transform.to_value(coordinates[i]);
            match self.row[i].role {
                Role::InitialState(s) => values.x[s] = value,
                Role::Parameter(j) => values.p[j] = value,
            }
        }
        values
    }

    /// The quantity with respect to which each column of one experiment's slopes is computed.
    pub fn seeds(&self, experiment: usize) -> &Arc<[Seed]> {
        &self.seeds[experiment]
    }

    /// The seeds of all experiments. Consecutive experiments with the same seeds share an allocation.
    fn all_seeds(&self) -> Vec<Arc<[Seed]>> {
        let seed = |i: usize| match self.row[i].role {
            Role::InitialState(s) => Seed::Carry(s),
            Role::Parameter(j) => Seed::Parameter(j),
        };
        let mut all: Vec<Arc<[Seed]>> = Vec::with_capacity(self.initial.len());
        for e in 0..self.initial.len() {
            let seeds = self.columns(e).map(seed);
            match all.last().filter(|last| last.iter().copied().eq(seeds.clone())) {
                Some(same) => all.push(same.clone()),
                None => all.push(seeds.collect()),
            }
        }
        all
    }

    /// Derivative of the quantity of each column with respect to its coordinate.
    pub fn scales(&self, experiment: usize, coordinates: &[f64]) -> Vec<f64> {
        let scale = |i: usize| {
            let transform = self.row[i].parameter.transform;
            transform.slope(transform.to_value(coordinates[i]))
        };
        self.columns(experiment).map(scale).collect()
    }

    /// The prior of each unknown that has one: its index, the slope of its standardized error and the error itself.
    pub fn priors(&self, coordinates: &[f64]) -> impl Iterator<Item = (usize, f64, f64)> {
        self.row.iter().zip(coordinates).enumerate().filter_map(|(i, (unknown, &c))| {
            let Parameter { prior, transform, .. } = unknown.parameter;
            let value = transform.to_value(c);
            prior.map(|prior| (i, transform.slope(value) / prior.std, (prior.mean - value) / prior.std))
        })
    }

    /// Adds the priors to the triangles of the experiments that they count with, as rows times a factor.
    pub fn add_priors(&self, coordinates: &[f64], factor: f64, triangles: &mut [Information]) {
        for (i, slope, error) in self.priors(coordinates) {
            let e = self.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = self.columns(e).map(|c| if c == i { factor * slope } else { 0.0 }).collect();
            triangles[e].absorb_row(&row, factor * error);
        }
    }
}

/// The names of the experiments; those that share one are numbered from 1 in their order.
fn labels(records: &[Record]) -> Vec<String> {
    let mut twins = std::collections::HashMap::<&str, usize>::new();
    for record in records {
        *twins.entry(record.name()).or_default() += 1;
    }
    let mut numbers = std::collections::HashMap::<&str, usize>::new();
    let label = |record| {
        let name = Record::name(record);
        if twins[name] == 1 {
            return name.to_owned();
        }
        let number = numbers.entry(name).or_default();
        *number += 1;
        format!("{name} #{number}")
    };
    records.iter().map(label).collect()
}

/// Declaration of the state at an experiment's first sample.
struct InitialState {
    state: Vec<Parameter>,
    /// Which entries are a start that nobody gave: neither the user nor the outputs.
    open: Vec<bool>,
    sizes: Vec<Option<f64>>,
    /// Whether some of it follows from the parameters.
    follow: bool,
}

impl InitialState {
    fn of(sweep: &dyn Sweep, record: &Record, parameters: &[Parameter]) -> Result<Self, Error> {
        let p: Vec<f64> = parameters.iter().map(|p| p.start).collect();
        let unknown = |reason, remedy| Error::StateNotMeasured { experiment: record.name().to_owned(), reason, remedy };
        let known = |state: Vec<Parameter>| {
            let n = state.len();
            InitialState { state, open: vec![false; n], sizes: vec![None; n], follow: false }
        };
        match record.initial_state() {
            Initial::Given(state) => Ok(known(state.clone())),
            Initial::FirstSample => {
                let remedy =
                    "leave initial_from_first_sample out to have it estimated, or give it with Experiment::initial";
                let x = sweep.measured_state(record, 0, &p).map_err(|reason| unknown(reason, remedy))?;
                Ok(known(x.into_iter().map(fixed).collect()))
            }
            Initial::Estimated | Initial::Free | Initial::Steady => {
                let remedy = "give a start for it with Experiment::initial";
                let guess = sweep.guessed_state(record, &p).map_err(|reason| unknown(reason, remedy))?;
                let (Guess { state, open, sizes }, follows) = (guess, sweep.follows(record, &p));
                let declared = |(x, follows): (f64, &bool)| if *follows { fixed(x) } else { free(x) };
                let state = state.into_iter().zip(&follows).map(declared).collect();
                Ok(InitialState { state, open, sizes, follow: follows.contains(&true) })
            }
        }
    }
}

fn check(name: &str, parameter: &Parameter) -> Result<(), Error> {
    let Parameter { start, free, lower, upper, prior, transform, per_experiment, positive } = *parameter;
    let wrong = |problem: String| Err(Error::Parameter { parameter: name.to_owned(), problem });
    if !start.is_finite() {
        return wrong(format!("its value is {}; give a finite start", exact(start)));
    }
    if lower.is_nan() || upper.is_nan() || lower > upper || free && lower == upper {
        let (lower, upper) = (exact(lower), exact(upper));
        return wrong(format!("its bounds are {lower} and {upper}; the lower must be below the upper (or use fixed)"));
    }
    if start < lower || start > upper {
        return wrong(format!(
            "its start {} lies outside its bounds {} to {}; move the start, or the bounds",
            exact(start),
            exact(lower),
            exact(upper)
        ));
    }
    // The start is no higher than the upper bound.
    if positive && start <= 0.0 {
        return wrong(format!(
            "it is declared positive, but its start is {} and its upper bound {}; start above zero, or leave .positive() out",
            exact(start),
            exact(upper)
        ));
    }
    if !free {
        let said = [(prior.is_some(), "prior"), (per_experiment, "value per experiment")];
        return match said.into_iter().find(|(said, _)| *said) {
            Some((_, what)) => {
                wrong(format!("its {what} has no effect because it is fixed; declare it free, or leave that out"))
            }
            None => Ok(()),
        };
    }
    if transform == Transform::Log && lower < 0.0 && lower.is_finite() {
        return wrong(format!(
            "its lower bound {} has no effect because its logarithm is estimated; bound it above zero, or leave .log() out",
            exact(lower)
        ));
    }
    if transform == Transform::Log && start <= 0.0 {
        return wrong(format!("its start {} has no logarithm; start above zero or leave .log() out", exact(start)));
    }
    match prior {
        Some(p) if !(p.mean.is_finite() && p.std > 0.0 && p.std.is_finite()) => wrong(format!(
            "its prior is {} +- {}; mean and standard deviation must be finite, the latter positive",
            exact(p.mean),
            exact(p.std)
        )),
        _ => Ok(()),
    }
}

/// Refuses a value per experiment where there is one experiment, whose value the shared one is, too.
pub(super) fn check_own(layout: &Layout, parameters: &[Parameter], experiments: usize) -> Result<(), Error> {
    let own = |(_, parameter): &(&Quantity, &Parameter)| parameter.free && parameter.per_experiment;
    match layout.parameters.iter().zip(parameters).find(own) {
        Some((Quantity { name, .. }, _)) if experiments == 1 => Err(Error::Parameter {
            parameter: name.clone(),
            problem:
                "its value per experiment has no effect because there is one experiment; add the others, or leave \
                      .per_experiment() out"
                    .to_owned(),
        }),
        _ => Ok(()),
    }
}

/// The quantities by name.
pub(crate) fn names(layout: &[Quantity]) -> Vec<String> {
    layout.iter().map(|quantity| quantity.name.clone()).collect()
}

/// The declarations, where levels of noise that were declared positive, and on whose sign nothing depends, are estimated by their logarithms. The likelihood
/// depends on the square of a level, whose slope vanishes at zero: where zero is best, a search for the level itself converges slowly, and its standard error has no limit.
pub(crate) fn with_scales(sweep: &dyn Sweep, parameters: &[Parameter]) -> Vec<Parameter> {
    let mut parameters = parameters.to_vec();
    let scales = if sweep.predicts_variance() { sweep.scales() } else { &[] };
    for i in scales {
        let parameter = &mut parameters[*i];
        if parameter.free
            && parameter.positive
            && parameter.start > 0.0
            && [0.0, f64::NEG_INFINITY].contains(&parameter.lower)
        {
            parameter.transform = Transform::Log;
        }
    }
    parameters
}

/// Whether as many parameters were declared as the layout has.
pub(crate) fn check_count(layout: &Layout, parameters: &[Parameter]) -> Result<(), Error> {
    if parameters.len() == layout.parameters.len() {
        return Ok(());
    }
    Err(Error::Option(format!(
        "{} parameter(s) are declared, but the model has {}: {}",
        parameters.len(),
        layout.parameters.len(),
        names(&layout.parameters).join(", ")
    )))
}
