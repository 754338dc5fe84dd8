//! Estimates as JSON; `schema/estimate.schema.json` describes it.

use super::{Estimate, Format, Summary, Version};
use crate::error::Error;
use crate::model::Model;

impl Summary {
    /// The estimate as JSON, numbers to the last bit. A number that is not a number is null; the infinities are the texts
    /// `"Infinity"` and `"-Infinity"`. `schema/estimate.schema.json` in the repository describes it.
    ///
    /// # Errors
    /// None for an estimate that this library made.
    pub fn to_json(&self) -> Result<String, Error> {
        serde_json::to_string_pretty(self).map_err(|error| Error::Option(format!("the estimate as JSON: {error}")))
    }

    /// An estimate from its JSON.
    ///
    /// # Errors
    /// A text that is no estimate, or one of another version, with its line and column; one that contradicts itself.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        let summary: Summary = crate::format::read::<Format, Version, _>(text)
            .map_err(|error| Error::Option(format!("no estimate: {error}")))?;
        summary.check()?;
        Ok(summary)
    }

    /// Whether each quantity of the layout is there.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let layout = &self.layout;
        let parameters: (Vec<&String>, _) = (self.parameters.iter().map(|one| &one.name).collect(), &layout.parameters);
        let outputs = (self.outputs.iter().map(|one| &one.name).collect(), &layout.outputs);
        for (what, (found, declared)) in [("parameters", parameters), ("outputs", outputs)] {
            let declared = declared.iter().map(|one| &one.name);
            if !declared.clone().eq(found.iter().copied()) {
                let declared: Vec<&String> = declared.collect();
                return Err(Error::Option(format!(
                    "no estimate: its {what} are {found:?}, but its layout has {declared:?}; read the file as it was written"
                )));
            }
        }
        let sizes = |one: &&super::ExperimentEstimate| {
            (one.parameters.len(), one.initial_state.len()) != (layout.parameters.len(), layout.states.len())
        };
        let wrong = match self.experiments.iter().find(sizes) {
            Some(one) => format!("experiment `{}` has values of other quantities than its layout", one.name),
            None if self.covariance.size() != self.unknowns.len() => {
                format!("its covariance is of {} unknowns, but it has {}", self.covariance.size(), self.unknowns.len())
            }
            None => return Ok(()),
        };
        Err(Error::Option(format!("no estimate: {wrong}; read the file as it was written")))
    }
}

impl<M: Model> Estimate<M> {
    /// An estimate from the JSON that [`to_json`](Summary::to_json) wrote.
    ///
    /// # Errors
    /// The errors of [`Summary::from_json`], and an estimate of another model.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        Self::of(Summary::from_json(text)?)
    }
}
