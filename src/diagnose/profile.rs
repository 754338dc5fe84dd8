//! Profile likelihood: how the best cost grows as one unknown is moved and all others are refitted. Intervals from it
//! follow the curvature of the model, respect bounds, and end on one side only where the data say no more (Bates and
//! Watts, *Nonlinear Regression Analysis and Its Applications*, 1988, section 6.1; Raue et al., Bioinformatics 25 (2009)
//! 1923).

mod section;
mod trace;

use super::{check_complete, linearize};
use crate::covariance::undetermined;
use crate::error::Error;
use crate::estimate::{Knowledge, Summary, student};
use crate::numeral::number;
use crate::optimize::Severity;
use crate::parameter::Transform;
use crate::problem::Problem;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use trace::Trace;

/// The profile of one unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name of the unknown.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its estimate.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Probability with which the interval covers the truth.
    #[serde(with = "crate::real")]
    pub probability: f64,
    /// Lower end of the interval.
    pub lower: End,
    /// Upper end of the interval.
    pub upper: End,
    /// Its standard error by the slopes at the estimate, where it has one: the curve's quadratic approximation is
    /// `((z - z0) / s)^2` with the coordinate `z` that the optimizer worked in.
    #[serde(with = "crate::real")]
    pub standard_error: Option<f64>,
    /// That coordinate.
    pub transform: Transform,
    /// The curve, by rising value.
    pub points: Vec<ProfilePoint>,
    /// The interval ends where the rise reaches this.
    #[serde(with = "crate::real")]
    pub threshold: f64,
    /// By how much the rise is divided, because the errors are colored, weighted or bent: the square of the standard error
    /// said by the estimate over the classical one.
    #[serde(with = "crate::real")]
    pub inflation: f64,
    /// Severity of the problems met during the computation.
    pub severity: Severity,
    /// The same in words; empty if nothing did.
    pub remark: String,
}

/// One point of a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfilePoint {
    /// Value of the unknown.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Rise of the deviance (twice the cost) over its minimum, divided by the inflation.
    #[serde(with = "crate::real")]
    pub rise: f64,
    /// Values of all unknowns there.
    #[serde(with = "crate::real")]
    pub unknowns: Vec<f64>,
}

/// Where an interval ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum End {
    /// The data exclude what is beyond.
    At(#[serde(with = "crate::real")] f64),
    /// They do not: the interval goes on to this bound of the parameter.
    Bound(#[serde(with = "crate::real")] f64),
    /// They do not as far as was looked, and no bound is declared; the last value tried.
    Open(#[serde(with = "crate::real")] f64),
}

impl End {
    /// Whether a value on the inner side of this lower end is in the interval.
    fn inside_lower(self, value: f64) -> bool {
        match self {
            End::At(end) | End::Bound(end) => value >= end,
            End::Open(_) => true,
        }
    }

    fn inside_upper(self, value: f64) -> bool {
        match self {
            End::At(end) | End::Bound(end) => value <= end,
            End::Open(_) => true,
        }
    }
}

impl Profile {
    /// Whether the interval holds a value.
    pub fn covers(&self, value: f64) -> bool {
        self.lower.inside_lower(value) && self.upper.inside_upper(value)
    }
}

/// The profile of an unknown of this name.
///
/// # Errors
/// A name that no unknown has, a probability not between 0 and 1, an estimate of another problem; a time limit or a flag that
/// stops it.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// let profile = greybox::diagnose::profile(&problem, &estimate, "rs", 0.95)?;
/// assert!(profile.covers(0.63)); // the truth
/// assert!(!profile.covers(0.64));
/// # Ok(())
/// # }
/// ```
pub fn profile(problem: &Problem<'_>, estimate: &Summary, name: &str, probability: f64) -> Result<Profile, Error> {
    let control = problem.control(Instant::now());
    let (objective, best) = problem.at_within(estimate, &control)?;
    let Some(index) = estimate.unknowns.iter().position(|unknown| unknown.name == name) else {
        let available = estimate.unknowns.iter().map(|unknown| unknown.name.clone()).collect();
        return Err(Error::UnknownSignal { signal: name.to_owned(), available });
    };
    if !(probability > 0.0 && probability < 1.0) {
        return Err(Error::Option(format!(
            "the probability of an interval is {probability}; it must be between 0 and 1"
        )));
    }
    let unknown = &estimate.unknowns[index];
    let linear = linearize(&objective, &best, "the profile")?;
    let at_bound = |i: usize| i != index && matches!(estimate.unknowns[i].knowledge, Knowledge::Held { end: None, .. });
    let held = undetermined(&linear, &(0..best.len()).map(at_bound).collect::<Vec<bool>>()).held;
    let covariance = linear.covariance(&held);
    let error = covariance.as_ref().map(|c| c.standard_error(index)).filter(|e| e.is_finite() && *e > 0.0);
    let along = |j: usize| match (&covariance, error) {
        (Some(c), Some(error)) if !held[j] => c.get(j, index) / (error * error),
        _ => 0.0,
    };
    let known = unknown.knowledge.standard_error().map(|s| s / unknown.transform.slope(unknown.value).abs());
    let inflation = known.zip(error).map_or(1.0, |(known, error)| (known / error).powi(2));
    let quantile = student::quantile(0.5 + probability / 2.0, unknown.degrees_of_freedom);
    let mut trace = Trace {
        objective: &objective,
        estimate,
        index,
        along: (0..best.len()).map(along).collect(),
        scale: error.unwrap_or((0.1 * best[index]).abs().max(1e-6)) * inflation.sqrt(),
        best,
        cost: linear.cost,
        quantile,
        inflation,
        points: vec![],
        failed: false,
        lowest: 0.0,
    };
    trace.add(&trace.best.clone(), 0.0);
    let (lower, upper) = (trace.side(-1.0), trace.side(1.0));
    let Trace { mut points, failed, lowest, .. } = trace;
    check_complete(problem, &control, "the profile")?;
    points.sort_by(|a, b| a.value.total_cmp(&b.value));
    let (severity, remark) = remark(name, failed, lowest);
    Ok(Profile {
        name: unknown.name.clone(),
        unit: unknown.unit.clone(),
        value: unknown.value,
        probability,
        lower,
        upper,
        standard_error: error.map(|error| error * inflation.sqrt() * unknown.transform.slope(unknown.value).abs()),
        transform: unknown.transform,
        points,
        threshold: quantile * quantile,
        inflation,
        severity,
        remark,
    })
}

/// Conclusions from a profile on its estimate beyond the interval, with their severity.
fn remark(name: &str, failed: bool, lowest: f64) -> (Severity, String) {
    if -lowest > 1e-3 {
        let lower = number(-lowest, 3);
        let text = format!(
            "a better minimum than the estimate was met on the profile of `{name}` (deviance lower by {lower}): start there"
        );
        return (Severity::NotUsable, text);
    }
    if failed {
        let text = format!(
            "the profile of `{name}` could not be computed everywhere: the simulation fails beside the estimate"
        );
        return (Severity::UsableWithCare, text);
    }
    (Severity::Usable, String::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A better minimum matters more than a profile with a gap; a deviance lower by a thousandth is rounding.
    #[test]
    fn a_better_minimum_is_named_first() {
        for (failed, lowest, severity, says) in [
            (true, -0.5, Severity::NotUsable, "(deviance lower by 0.5)"),
            (true, -1e-3, Severity::UsableWithCare, "could not be computed everywhere"),
            (false, -1e-3, Severity::Usable, ""),
        ] {
            let (found, text) = remark("tau", failed, lowest);
            assert!(found == severity && text.contains(says) && text.is_empty() == says.is_empty(), "{lowest}: {text}");
        }
    }
}
