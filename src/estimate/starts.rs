//! [`Starts`]: the minima that searches from several starts found.

use crate::numeral::{counted, number};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Names written out in a sentence.
const NAMED: usize = 6;

/// Results of searches from several starts ([`Fit::starts`](crate::Fit::starts)), asked for or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Starts {
    /// Searches begun, that from the declared start among them.
    pub tried: u64,
    /// Number of searches that ended in the estimate, the estimate's own search among them; 0 if that did not converge.
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
/// unknowns, along what the data determine, by less than a tenth of a standard error. Where the data leave unknowns
/// undetermined, these are not compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Minimum {
    /// Its cost relative to the estimate's. Where noise levels of several outputs are estimated or variances predicted: the
    /// ratio of the estimated noise variances, as a geometric mean over the measurements.
    #[serde(with = "crate::real")]
    pub cost_ratio: f64,
    /// Searches that ended in it.
    pub searches: u64,
    /// Unknowns whose values differ between these searches' ends, because the data do not determine them.
    pub undetermined: Vec<String>,
    /// Names and values of the unknowns there, from the first of its searches.
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
    /// False where the model could not be evaluated there; true also where a limit of time came first.
    pub evaluated: bool,
    /// Why it found none.
    pub reason: String,
}

/// The first names of a list, and how many more there are.
fn listed(names: &[String]) -> String {
    let shown = names.iter().take(NAMED).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
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
        let tried = counted(*tried, "start");
        match minima.first().filter(|minimum| *agreed > 0 && !minimum.undetermined.is_empty()) {
            Some(Minimum { undetermined, .. }) => {
                let names = listed(undetermined);
                write!(f, "{agreed} of {tried} ended at the same cost with other values of {names}")?;
                f.write_str(", which the data do not determine")?;
            }
            None => write!(f, "{agreed} of {tried} agree")?,
        }
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
            n => write!(f, ", {n} found no minimum"),
        }
    }
}
