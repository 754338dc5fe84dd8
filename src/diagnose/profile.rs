//! Profile likelihood: how the best cost grows as one unknown is moved and all others are refitted. Intervals from it
//! follow the curvature of the model, respect bounds, and end on one side only where the data say no more (Bates and
//! Watts, *Nonlinear Regression Analysis and Its Applications*, 1988, section 6.1; Raue et al., Bioinformatics 25 (2009)
//! 1923).

mod section;

use super::{Pinned, check_complete, linearize, minimize};
use crate::error::Error;
use crate::estimate::{Knowledge, Summary, student};
use crate::judge::undetermined;
use crate::numeral::number;
use crate::optimize::{LeastSquares, Severity};
use crate::parameter::Transform;
use crate::problem::Problem;
use serde::{Deserialize, Serialize};
use std::time::Instant;

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
    /// What came up on the way.
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

/// Most points on each side.
const POINTS: usize = 40;
/// After so many points that a root of the rise below this part of the threshold's shows no end.
const FLAT: (usize, f64) = (8, 1e-3);
/// The curve goes on to this many times the threshold.
const HEIGHT: f64 = 1.5;
/// The ends are found to this part of the root of the threshold.
const CLOSE: f64 = 1e-3;

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
/// # let record = Experiment::from_csv(&model, "examples/data/pmsm.csv")?;
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
    // How far one standard error is, and how the others go along.
    let error = covariance.as_ref().map(|c| c.standard_error(index)).filter(|e| e.is_finite() && *e > 0.0);
    let along: Vec<f64> = (0..best.len())
        .map(|j| match (&covariance, error) {
            (Some(c), Some(error)) if !held[j] => c.get(j, index) / (error * error),
            _ => 0.0,
        })
        .collect();
    let said = unknown.knowledge.standard_error().map(|s| s / unknown.transform.slope(unknown.value).abs());
    let inflation = match (said, error) {
        (Some(said), Some(error)) => (said / error).powi(2),
        _ => 1.0,
    };
    let scale = error.unwrap_or((0.1 * best[index]).abs().max(1e-6)) * inflation.sqrt();
    let quantile = student::quantile(0.5 + probability / 2.0, unknown.degrees_of_freedom);
    let bounds = objective.bounds();
    let values = |coordinates: &[f64]| -> Vec<f64> {
        estimate.unknowns.iter().zip(coordinates).map(|(u, &c)| u.transform.to_value(c)).collect()
    };
    let value = |coordinate: f64| unknown.transform.to_value(coordinate);

    let mut points = vec![ProfilePoint { value: unknown.value, rise: 0.0, unknowns: values(&best) }];
    let (mut failed, mut lowest) = (false, 0.0f64);
    let mut side = |sign: f64, bound: f64| -> End {
        // The root of the rise at a coordinate, starting from a point of the profile.
        let mut root = |coordinate: f64, from: &[f64]| -> Option<(f64, Vec<f64>)> {
            let mut start = from.to_vec();
            for (j, start) in start.iter_mut().enumerate() {
                let (lower, upper) = bounds[j];
                *start = (*start + along[j] * (coordinate - from[index])).clamp(lower, upper);
            }
            start[index] = coordinate;
            let mut pinned = bounds.clone();
            pinned[index] = (coordinate, coordinate);
            let (place, cost) = minimize(Pinned { problem: &objective, bounds: pinned }, start)?;
            let rise = 2.0 * (cost - linear.cost) / inflation;
            lowest = lowest.min(rise);
            points.push(ProfilePoint { value: value(coordinate), rise: rise.max(0.0), unknowns: values(&place) });
            Some((rise.max(0.0).sqrt(), place))
        };
        let (mut inside, mut place) = ((best[index], 0.0), best.clone());
        let mut step = sign * scale * quantile / 2.0;
        for number in 0..POINTS {
            // Flat so far: the interval is open on this side.
            if number >= FLAT.0 && bound.is_infinite() && inside.1 < FLAT.1 * quantile {
                break;
            }
            let mut next = inside.0 + step;
            let at_bound = sign * (next - bound) >= 0.0;
            if at_bound {
                next = bound;
            }
            if next == inside.0 {
                return End::Bound(value(bound));
            }
            let Some((reached, there)) = root(next, &place) else {
                failed = true;
                step /= 2.0;
                continue;
            };
            if reached < quantile {
                if at_bound {
                    return End::Bound(value(bound));
                }
                // Half a quantile further by the slope so far, at most twice as far.
                let slope = (reached - inside.1) / (next - inside.0).abs();
                let wanted = (0.5 * quantile / slope.max(f64::MIN_POSITIVE)).clamp(0.5 * step.abs(), 2.0 * step.abs());
                (inside, place, step) = ((next, reached), there, sign * wanted);
                continue;
            }
            // Between what is inside and what is outside.
            let (mut outside, mut end, highest) = ((next, reached), None, reached);
            for _ in 0..30 {
                let part = ((quantile - inside.1) / (outside.1 - inside.1)).clamp(0.05, 0.95);
                let middle = inside.0 + part * (outside.0 - inside.0);
                let Some((reached, there)) = root(middle, &place) else {
                    failed = true;
                    break;
                };
                if (reached - quantile).abs() <= CLOSE * quantile {
                    end = Some(middle);
                    break;
                }
                match reached < quantile {
                    true => (inside, place) = ((middle, reached), there),
                    false => outside = (middle, reached),
                }
            }
            let end = end.unwrap_or(inside.0 + (outside.0 - inside.0) / 2.0);
            // Both sides are drawn to one height; a failure there costs a part of the drawing only.
            let beyond = end + (HEIGHT.sqrt() - 1.0) * (end - best[index]);
            if highest < HEIGHT.sqrt() * quantile && sign * (beyond - bound) < 0.0 {
                let _ = root(beyond, &place);
            }
            return End::At(value(end));
        }
        End::Open(value(inside.0))
    };
    let lower = side(-1.0, bounds[index].0);
    let upper = side(1.0, bounds[index].1);
    check_complete(problem, &control, "the profile")?;
    points.sort_by(|a, b| a.value.total_cmp(&b.value));

    let (mut severity, mut remark) = (Severity::Usable, String::new());
    if failed {
        severity = Severity::UsableWithCare;
        remark = format!(
            "the profile of `{name}` could not be computed everywhere: the simulation fails beside the estimate"
        );
    }
    if -lowest > 1e-3 {
        severity = Severity::NotUsable;
        remark = format!(
            "a better minimum than the estimate was met on the profile of `{name}` (deviance lower by {}): start there",
            number(-lowest, 3)
        );
    }
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
