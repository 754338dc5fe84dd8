//! [`Starts`]: the minima that searches from several starts found.

use crate::numeral::{counted, number};
use core::fmt;
use serde::{Deserialize, Serialize};

/// What searches from several starts found ([`Fit::starts`](crate::Fit::starts)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Starts {
    /// Searches begun, that from the declared start among them.
    pub tried: u64,
    /// Those that ended in the estimate, the estimate's own search among them; 0 if that did not converge.
    pub agreed: u64,
    /// The minima found, by rising cost. If the estimate's search converged, the first is the estimate.
    pub minima: Vec<Minimum>,
    /// The index among them of the one that the declared start led to.
    pub declared: Option<usize>,
    /// The searches that found no minimum.
    pub failed: Vec<FailedStart>,
    /// Evaluations of all searches together.
    pub evaluations: u64,
}

/// A minimum that searches ended in. Ends are the same minimum if their costs differ by less than a part of 1e-6 and their
/// unknowns, along what the data determine, by less than a tenth of a standard error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Minimum {
    /// Its cost relative to the estimate's. Where noise levels of several outputs are estimated or variances predicted: the
    /// ratio of the estimated noise variances, as a geometric mean over the measurements.
    #[serde(with = "crate::real")]
    pub cost_ratio: f64,
    /// Searches that ended in it.
    pub searches: u64,
    /// Names and values of the unknowns there.
    #[serde(with = "crate::real")]
    pub unknowns: Vec<(String, f64)>,
}

/// A search that found no minimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedStart {
    /// Names and values of the unknowns where it began.
    #[serde(with = "crate::real")]
    pub start: Vec<(String, f64)>,
    /// Why it found none.
    pub reason: String,
}

/// A cost relative to the estimate's, in words.
pub(crate) fn times_the_cost(ratio: f64) -> String {
    match number(ratio, 3).as_str() {
        "1" => "the same cost".to_owned(),
        ratio => format!("{ratio} times the cost"),
    }
}

impl fmt::Display for Starts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Starts { tried, agreed, minima, failed, .. } = self;
        write!(f, "{agreed} of {} agree", counted(*tried, "start"))?;
        let others: &[Minimum] = if *agreed > 0 { &minima[1..] } else { minima };
        if let Some(next) = others.first() {
            let searches = others.iter().map(|minimum| minimum.searches).sum::<u64>();
            let cost = times_the_cost(next.cost_ratio);
            match others.len() {
                1 => write!(f, ", {searches} ended in another minimum of {cost}")?,
                n => write!(f, ", {searches} ended in {n} other minima of {cost} or more")?,
            }
        }
        match failed.len() {
            0 => Ok(()),
            n => write!(f, ", {n} found none"),
        }
    }
}
