//! [`Method`]: how an estimate was made.

use crate::numeral::counted;
use core::fmt;
use serde::{Deserialize, Serialize};

/// Where the noise levels came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// They were given.
    Given,
    /// So many were given; of the other outputs they were estimated.
    SomeGiven(usize),
    /// Estimated per output.
    #[default]
    PerOutput,
    /// Estimated as a full covariance.
    Covariance,
    /// The predictor predicted the variances.
    Predicted,
}

impl fmt::Display for NoiseModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoiseModel::Given => "given",
            NoiseModel::SomeGiven(count) => return write!(f, "given for {count} output(s), estimated for the others"),
            NoiseModel::PerOutput => "estimated per output",
            NoiseModel::Covariance => "estimated as a full covariance",
            NoiseModel::Predicted => "predicted",
        })
    }
}

/// How the covariance of the unknowns was made; in JSON with its name as `code`, in small letters with underscores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum CovarianceMethod {
    /// From the curvature of the cost, for white errors.
    #[default]
    Classical,
    /// The sandwich, for errors that are independent from sample to sample; those of several outputs may be correlated.
    Sandwich,
    /// The sandwich, for errors that are white before the pre-filter.
    FilteredSandwich,
    /// The sandwich with each record as one cluster, for errors that are correlated in any way within a record and independent from record
    /// to record; of unknowns that one record has for itself as without clusters.
    Clusters {
        /// Number of records.
        records: u64,
    },
    /// For autocorrelated errors: of stationary ones, or, where it certainly says more, Newey and West's, prewhitened.
    Hac {
        /// Lags over which correlation is allowed for, beyond the autoregression; zero where all records are short.
        lags: u64,
    },
}

impl fmt::Display for CovarianceMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CovarianceMethod::Classical => f.write_str("classical (white errors)"),
            CovarianceMethod::Sandwich => f.write_str("sandwich (errors independent from sample to sample)"),
            CovarianceMethod::FilteredSandwich => f.write_str("sandwich (white errors before the pre-filter)"),
            CovarianceMethod::Clusters { records } => {
                let records = counted(*records, "record");
                write!(f, "sandwich ({records} as clusters: errors correlated within a record in any way)")
            }
            CovarianceMethod::Hac { lags: 0 } => f.write_str("by an autoregression of the errors (colored errors)"),
            CovarianceMethod::Hac { lags } => {
                let lags = counted(*lags, "lag");
                write!(f, "HAC (Newey-West over {lags}, prewhitened, for colored errors)")
            }
        }
    }
}

/// How an estimate was made; enough to make it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// The search.
    pub optimizer: String,
    /// How the model was stepped.
    pub integrator: String,
    /// How many times a fit whose integrator was not chosen went on to a finer one; zero if it was chosen.
    #[serde(default)]
    pub refinement: usize,
    /// Which prediction error.
    pub predictor: String,
    /// How the equations were evaluated.
    pub engine: String,
    /// The loss.
    pub loss: String,
    /// The weighting.
    pub weighting: String,
    /// The pre-filter.
    pub prefilter: String,
    /// Where the noise levels came from.
    pub noise: NoiseModel,
    /// How the covariance was made.
    pub covariance: CovarianceMethod,
    /// Version of this library.
    pub version: String,
}
