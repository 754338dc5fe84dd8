//! An estimate as text and back: signals by name, so that a file says what its numbers are.

use super::{Direction, Estimate, Knowledge, Method, Quality, Share, Unknown, Warning};
use crate::information::SquareMatrix;
use crate::model::Model;
use crate::optimize::Outcome;
use crate::parameter::Parameter;
use crate::signals::{Entry, Of, Signals};
use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A vector of signals as pairs of name and entry.
#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct Named<T>(Vec<(String, T)>);

impl<T: Entry> Named<T> {
    fn of<S: Signals>(signals: Of<S, T>) -> Self {
        Named(S::NAMES.iter().map(|name| (*name).to_owned()).zip(S::into_array(signals)).collect())
    }

    fn signals<S: Signals, E: Error>(self) -> Result<Of<S, T>, E> {
        let names: Vec<&str> = self.0.iter().map(|(name, _)| name.as_str()).collect();
        if names != S::NAMES {
            return Err(E::custom(format!("the signals are {names:?}, but the model has {:?}", S::NAMES)));
        }
        Ok(S::from_fn(|i| self.0[i].1))
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredShare {
    name: String,
    samples: usize,
    parameters: Named<f64>,
    initial_state: Named<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored<I, P> {
    parameters: Named<f64>,
    knowledge: Named<Knowledge>,
    declared: Named<Parameter>,
    experiments: Vec<StoredShare>,
    quality: Named<Quality>,
    unknowns: Vec<Unknown>,
    covariance: SquareMatrix,
    noise_covariance: Option<SquareMatrix>,
    directions: Vec<Direction>,
    outcome: Outcome,
    warnings: Vec<Warning>,
    cost: f64,
    measurements: u64,
    deviance: Option<f64>,
    iterations: u64,
    evaluations: u64,
    seconds: f64,
    method: Method,
    integrator: I,
    predictor: P,
}

impl<M: Model, I: Serialize + Clone, P: Serialize + Clone> Serialize for Estimate<M, I, P> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let share = |share: &Share<M>| StoredShare {
            name: share.name.clone(),
            samples: share.samples,
            parameters: Named::of::<M::Parameters>(share.parameters),
            initial_state: Named::of::<M::State>(share.initial_state),
        };
        Stored {
            parameters: Named::of::<M::Parameters>(self.parameters),
            knowledge: Named::of::<M::Parameters>(self.knowledge),
            declared: Named::of::<M::Parameters>(self.declared),
            experiments: self.experiments.iter().map(share).collect(),
            quality: Named::of::<M::Output>(self.quality),
            unknowns: self.unknowns.clone(),
            covariance: self.covariance.clone(),
            noise_covariance: self.noise_covariance.clone(),
            directions: self.directions.clone(),
            outcome: self.outcome,
            warnings: self.warnings.clone(),
            cost: self.cost,
            measurements: self.measurements,
            deviance: self.deviance,
            iterations: self.iterations,
            evaluations: self.evaluations,
            seconds: self.seconds,
            method: self.method.clone(),
            integrator: self.integrator.clone(),
            predictor: self.predictor.clone(),
        }
        .serialize(serializer)
    }
}

impl<'de, M: Model, I: DeserializeOwned, P: DeserializeOwned> Deserialize<'de> for Estimate<M, I, P> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let stored = Stored::<I, P>::deserialize(deserializer)?;
        let share = |share: StoredShare| {
            Ok(Share {
                name: share.name,
                samples: share.samples,
                parameters: share.parameters.signals::<M::Parameters, D::Error>()?,
                initial_state: share.initial_state.signals::<M::State, D::Error>()?,
            })
        };
        Ok(Estimate {
            parameters: stored.parameters.signals::<M::Parameters, D::Error>()?,
            knowledge: stored.knowledge.signals::<M::Parameters, D::Error>()?,
            declared: stored.declared.signals::<M::Parameters, D::Error>()?,
            experiments: stored.experiments.into_iter().map(share).collect::<Result<_, _>>()?,
            quality: stored.quality.signals::<M::Output, D::Error>()?,
            unknowns: stored.unknowns,
            covariance: stored.covariance,
            noise_covariance: stored.noise_covariance,
            directions: stored.directions,
            outcome: stored.outcome,
            warnings: stored.warnings,
            cost: stored.cost,
            measurements: stored.measurements,
            deviance: stored.deviance,
            iterations: stored.iterations,
            evaluations: stored.evaluations,
            seconds: stored.seconds,
            method: stored.method,
            integrator: stored.integrator,
            predictor: stored.predictor,
        })
    }
}
