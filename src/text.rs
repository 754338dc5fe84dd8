//! Models as text: equations, parameters and units in a TOML file.
//!
//! ```
//! use greybox::text::Model;
//! let model: Model = r#"
//!     greybox = 1
//!     name = "Draining tank"
//!     outputs = ["h"]
//!     [constants]
//!     g = { value = 9.81, unit = "m/s^2" }
//!     [inputs]
//!     q = "m^3/s"
//!     [parameters]
//!     area = { unit = "m^2", start = 1.0 }
//!     outlet = { unit = "m^2", start = 1e-4, within = [0, 1] }
//!     [states]
//!     h = { unit = "m", derivative = "(q - outlet*sqrt(2*g*h))/area" }
//! "#
//! .parse()?;
//! assert_eq!(model.equations().layout().parameters[1].name, "outlet");
//! assert!(model.warnings().is_empty());
//! # Ok::<(), greybox::text::Error>(())
//! ```
//!
//! A text says what a Rust model says, and gives the same answers at the same speed: both are read into
//! [`Equations`].

mod apart;
mod compile;
mod dimension;
mod document;
mod expression;
mod factor;
mod latex;
mod lex;
mod markdown;
mod names;
mod parse;
mod read;
mod remark;
mod remedies;
mod rust;
mod section;
mod shipped;
mod string;
mod thinned;
mod toml_value;
mod write;

pub use factor::factor;
pub use remark::{Error, Remark};
pub use remedies::renamed;
pub use shipped::{Shipped, shipped};

use crate::equations::Equations;
use crate::fit::Fit;
use crate::interval::Hold;
use crate::parameter::{Parameter, free};
use crate::record::{Initial, Record};
use document::{Begin, Document};
use expression::Operation;
use remark::Source;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

/// A model that was read from a text: its equations, and what the text declares besides.
#[derive(Clone, Debug)]
pub struct Model {
    source: Arc<Source>,
    document: Document,
    equations: Arc<Equations>,
    parameters: Vec<Parameter>,
    warnings: Vec<Remark>,
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// A file that cannot be read, or is no model; each mistake with its line, its column and the remedy.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| Error::File { path: path.to_owned(), source })?;
        Model::named(&path.display().to_string(), &text)
    }

    /// Reads a model from a text, which is called `name` in messages.
    ///
    /// # Errors
    /// As [`read`](Model::read).
    pub fn named(name: &str, text: &str) -> Result<Self, Error> {
        let source = Arc::new(Source { name: name.to_owned(), text: text.to_owned() });
        let (document, mut warnings) = read::read(&source).map_err(Error::Wrong)?;
        let equations = Arc::new(compile::compile(&document, &source).map_err(Error::Wrong)?);
        warnings.extend(dimension::check(&document, &source));
        warnings.extend(unused(&document, &source));
        let parameters = document.parameters.iter().map(|one| one.parameter).collect();
        let model = Model { source, document, equations, parameters, warnings };
        model.check_solver()?;
        Ok(model)
    }

    /// The model of equations that were made elsewhere, such as those of a Rust model that was traced, with a declaration for each
    /// parameter.
    ///
    /// # Errors
    /// A name that stands for two quantities or has a meaning in expressions; not one declaration for each parameter.
    pub fn of(equations: &Equations, name: &str, parameters: &[Parameter]) -> Result<Self, Error> {
        Model::named(name, &write::file(equations, name, parameters)?)
    }

    /// The model as a file: the text that it was read from, constants with the values that they were given.
    pub fn to_toml(&self) -> String {
        let mut text = self.source.text.clone();
        let set = |constant: &document::Constant| Some((constant.value.whole(), constant.set?));
        let mut set: Vec<_> = self.document.constants.iter().filter_map(set).collect();
        set.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
        set.into_iter().for_each(|(at, value)| text.replace_range(at, &format!("{value:?}")));
        text
    }

    /// Whether there is an integrator and a predictor as the text asks for.
    fn check_solver(&self) -> Result<(), Error> {
        let solver = &self.document.solver;
        let fit = || Fit::new(&*self.equations, &[] as &[Record]).parameters(self.parameters.clone());
        let integrator = solver.integrator.as_ref().map(|(name, at)| (fit().integrator_by_name(name).err(), at));
        let predictor = solver.predictor.as_ref().map(|(name, at)| (fit().predictor_by_name(name).err(), at));
        let wrong = |(error, at): (Option<crate::error::Error>, &remark::Span)| {
            Some(Remark::error(&self.source, at.clone(), error?.to_string()))
        };
        let wrong: Vec<Remark> = integrator.into_iter().chain(predictor).filter_map(wrong).collect();
        if wrong.is_empty() { Ok(()) } else { Err(Error::Wrong(wrong)) }
    }

    /// The name that the text gives it; empty if it gives none.
    pub fn name(&self) -> &str {
        &self.document.name
    }

    /// The description that the text gives it; empty if it gives none.
    pub fn description(&self) -> &str {
        &self.document.description
    }

    /// Quantities and arithmetic.
    pub fn equations(&self) -> &Arc<Equations> {
        &self.equations
    }

    /// The declaration of each parameter, in the order of the layout.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// What is odd in the text: units that do not fit, quantities that are not used.
    pub fn warnings(&self) -> &[Remark] {
        &self.warnings
    }

    /// Name, value and unit of each constant.
    pub fn constants(&self) -> Vec<(&str, f64, &str)> {
        let compiler = compile::Compiler::new(&self.document, &self.source).ok();
        let value = |i: usize| compiler.as_ref().and_then(|compiler| compiler.constant(i)).unwrap_or(f64::NAN);
        let quantities = self.document.constants.iter().map(|constant| &constant.quantity);
        quantities.enumerate().map(|(i, one)| (one.name.as_str(), value(i), one.unit.as_str())).collect()
    }

    /// Gives a constant another value, as `--constant np=4` of the command does.
    ///
    /// # Errors
    /// A name that no constant has, a value that is not finite, equations that the value makes meaningless.
    pub fn set_constant(&mut self, name: &str, value: f64) -> Result<(), Error> {
        if !value.is_finite() {
            return Err(Error::NotFinite { name: name.to_owned(), value });
        }
        let mut document = self.document.clone();
        let Some(constant) = document.constants.iter_mut().find(|constant| constant.quantity.name == name) else {
            let known = document.constants.iter().map(|constant| constant.quantity.name.clone()).collect();
            return Err(Error::Unknown { what: "constant", name: name.to_owned(), known });
        };
        constant.set = Some(value);
        self.equations = Arc::new(compile::compile(&document, &self.source).map_err(Error::Wrong)?);
        self.document = document;
        Ok(())
    }

    /// How each input behaves between samples, where the text says so.
    pub fn holds(&self) -> Vec<Option<Hold>> {
        self.document.inputs.iter().map(|input| input.hold).collect()
    }

    /// What is known of the states at the first sample.
    pub fn initial(&self) -> Initial {
        let begins: Vec<&Begin> =
            self.document.states.iter().filter_map(|state| Some(&state.begin.as_ref()?.0)).collect();
        match begins.first() {
            None => Initial::Estimated,
            Some(Begin::FirstSample) => Initial::FirstSample,
            Some(Begin::Steady) => Initial::Steady,
            // Functions are a part of the equations.
            _ if begins.iter().all(|begin| matches!(begin, Begin::Estimated | Begin::Said(_))) => Initial::Estimated,
            _ => {
                let given = |state: &document::State| match &state.begin {
                    Some((Begin::Given(parameter), _)) => *parameter,
                    _ => free(0.0),
                };
                Initial::Given(self.document.states.iter().map(given).collect())
            }
        }
    }

    /// The standard deviation of the noise of each output for which the text gives a number.
    pub fn noise(&self) -> Vec<Option<f64>> {
        let value = |output: &document::Output| match output.noise.as_ref()?.nodes.as_slice() {
            [single] => match single.operation {
                Operation::Number(value) => Some(value),
                _ => None,
            },
            _ => None,
        };
        self.document.outputs.iter().map(value).collect()
    }

    /// The integrator that the text asks for, as `rk4:4`.
    pub fn integrator(&self) -> Option<&str> {
        self.document.solver.integrator.as_ref().map(|(name, _)| name.as_str())
    }

    /// The predictor that the text asks for, as `horizon:5`.
    pub fn predictor(&self) -> Option<&str> {
        self.document.solver.predictor.as_ref().map(|(name, _)| name.as_str())
    }

    /// A record with the holds and the initial state that the text declares.
    ///
    /// # Errors
    /// A record without an input of the model, or with another number of states.
    pub fn prepare(&self, record: Record) -> Result<Record, crate::error::Error> {
        let said = self.document.inputs.iter().filter_map(|input| Some((input.quantity.name.as_str(), input.hold?)));
        let record = said.into_iter().try_fold(record, |record, (name, hold)| record.hold_of(name, hold))?;
        match self.initial() {
            Initial::Estimated => Ok(record),
            initial => record.initial(initial),
        }
    }

    /// The fit of records with all that the text declares: parameters, holds, initial states, noise, integrator, predictor. What is
    /// said of the fit afterwards stands in place of it.
    ///
    /// # Errors
    /// As [`prepare`](Model::prepare); an integrator or a predictor that there is none of.
    pub fn fit(&self, records: &[Record]) -> Result<Fit<'_, Equations>, crate::error::Error> {
        let records = records.iter().map(|record| self.prepare(record.clone())).collect::<Result<Vec<Record>, _>>()?;
        let mut fit = Fit::new(&*self.equations, &records).parameters(self.parameters.clone());
        if let Some(integrator) = self.integrator() {
            fit = fit.integrator_by_name(integrator)?;
        }
        if let Some(predictor) = self.predictor() {
            fit = fit.predictor_by_name(predictor)?;
        }
        // A filter reads it from the equations.
        Ok(if fit.filters() { fit } else { fit.noise_of_some(self.noise()) })
    }
}

impl FromStr for Model {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Model::named("model", text)
    }
}

/// Quantities that no equation uses, but for states and inputs, which a record may have anyway.
fn unused(document: &Document, source: &Arc<Source>) -> Vec<Remark> {
    let rates = document.states.iter().flat_map(|one| {
        [&one.rate, &one.jump, &one.diffusion, &one.initial_noise]
            .map(Option::as_ref)
            .into_iter()
            .chain([one.initial()])
    });
    let outputs = document.outputs.iter().flat_map(|output| [Some(&output.value), output.noise.as_ref()]);
    let delays = document.inputs.iter().map(|input| input.delay.as_ref());
    let all = rates.chain(outputs).chain(delays).flatten().chain(names::items(document));
    let mut used = std::collections::HashSet::new();
    for node in all.flat_map(|expression| &expression.nodes) {
        if let Operation::Name(name) | Operation::Call { name, .. } = &node.operation {
            used.insert(name.as_str());
        }
    }
    let unused = document
        .named()
        .filter(|(role, quantity)| !used.contains(quantity.name.as_str()) && !["a state", "an input"].contains(role));
    let remark = |(role, quantity): (&str, &document::Declared)| {
        let role = role.trim_start_matches("a ").trim_start_matches("an ");
        Remark::warning(source, quantity.at.clone(), format!("{role} `{}` is in no equation", quantity.name))
    };
    unused.map(remark).collect()
}
