//! Restarts: whether a search from elsewhere ends in a better minimum.

use super::{Pinned, check_complete, linearize, minimize, searches};
use crate::error::Error;
use crate::estimate::Summary;
use crate::numeral::number;
use crate::optimize::{LeastSquares, Severity};
use crate::parameter::Transform;
use crate::problem::Problem;
use crate::random::Random;
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What searches from other starts found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restarts {
    /// Searches started.
    pub tried: u64,
    /// Those that could not be simulated at their start or did not end.
    pub failed: u64,
    /// Those that came back to the estimate's cost.
    pub same: u64,
    /// Those that ended in a worse minimum.
    pub worse: u64,
    /// The best of those that ended in a better one.
    pub better: Option<Better>,
    /// Where the searches ended, by rising cost.
    pub minima: Vec<Minimum>,
    /// How bad it is.
    pub severity: Severity,
    /// What it means.
    pub meaning: String,
}

/// A minimum better than the estimate's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Better {
    /// Its sum of squares as a part of the estimate's.
    #[serde(with = "crate::real")]
    pub cost_ratio: f64,
    /// Names and values of the unknowns there.
    #[serde(with = "crate::real")]
    pub unknowns: Vec<(String, f64)>,
}

/// A minimum that searches ended in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Minimum {
    /// Its cost as a part of the estimate's, which is one.
    #[serde(with = "crate::real")]
    pub cost_ratio: f64,
    /// Searches that ended in it.
    pub searches: u64,
    /// Names and values of the unknowns there.
    #[serde(with = "crate::real")]
    pub unknowns: Vec<(String, f64)>,
}

/// Costs that differ by less than this part are one minimum.
const SAME: f64 = 1e-6;

/// Searches again from `count` random places: within its bounds, if both are finite, else within a factor of `reach`
/// (above one) of the estimate, either sign kept; zero is moved by ten standard errors.
///
/// # Errors
/// A reach that is not above one, an estimate of another problem; a time limit or a flag that stops it.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_csv(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// let found = greybox::diagnose::restarts(&problem, &estimate, 10, 3.0, 1)?; // within a factor of 3, seed 1
/// assert!(found.better.is_none() && found.same > 0, "{}", found.meaning);
/// # Ok(())
/// # }
/// ```
pub fn restarts(
    problem: &Problem<'_>,
    estimate: &Summary,
    count: usize,
    reach: f64,
    seed: u64,
) -> Result<Restarts, Error> {
    if !(reach > 1.0 && reach.is_finite()) {
        return Err(Error::Option(format!("the reach of restarts is {reach}; it is a factor above one")));
    }
    let control = problem.control(Instant::now());
    let (objective, best) = problem.at_within(estimate, &control)?;
    let cost = linearize(&objective, &best, "the search from other starts")?.cost;
    let bounds = objective.bounds();
    let start = |attempt: usize| -> Vec<f64> {
        let mut random = Random::stream(seed, attempt as u64);
        estimate
            .unknowns
            .iter()
            .zip(&bounds)
            .zip(&best)
            .map(|((unknown, &(lower, upper)), &c)| {
                let part = random.uniform();
                let factor = reach.powf(2.0 * part - 1.0);
                let place = if lower.is_finite() && upper.is_finite() {
                    lower + part * (upper - lower)
                } else if unknown.transform == Transform::Log {
                    c + factor.ln()
                } else if c == 0.0 {
                    unknown.knowledge.standard_error().unwrap_or(1.0) * 20.0 * (part - 0.5)
                } else {
                    c * factor
                };
                place.clamp(lower, upper)
            })
            .collect()
    };
    let found = searches(problem, count, |attempt| {
        minimize(Pinned { problem: &objective, bounds: bounds.clone() }, start(attempt))
    });
    check_complete(problem, &control, "the search from other starts")?;
    let mut result = Restarts {
        tried: count as u64,
        failed: 0,
        same: 0,
        worse: 0,
        better: None,
        minima: vec![],
        severity: Severity::Usable,
        meaning: String::new(),
    };
    let mut ends: Vec<(Vec<f64>, f64)> = found.into_iter().flatten().collect();
    result.failed = (count - ends.len()) as u64;
    ends.sort_by(|a, b| a.1.total_cmp(&b.1));
    let named = |(u, &c): (&crate::estimate::Unknown, &f64)| (u.name.clone(), u.transform.to_value(c));
    for (place, found) in ends {
        // Without any error there is no cost to compare with.
        let cost_ratio = if cost > 0.0 { found / cost } else { f64::from(u8::from(found == 0.0)) };
        match result.minima.last_mut().filter(|minimum| cost_ratio <= minimum.cost_ratio * (1.0 + SAME)) {
            Some(minimum) => minimum.searches += 1,
            None => {
                let unknowns = estimate.unknowns.iter().zip(&place).map(named).collect();
                result.minima.push(Minimum { cost_ratio, searches: 1, unknowns });
            }
        }
    }
    for minimum in &result.minima {
        match minimum.cost_ratio {
            ratio if ratio < 1.0 - SAME => {}
            ratio if ratio > 1.0 + SAME => result.worse += minimum.searches,
            _ => result.same += minimum.searches,
        }
    }
    let best = result.minima.first().filter(|minimum| minimum.cost_ratio < 1.0 - SAME);
    result.better = best.map(|best| Better { cost_ratio: best.cost_ratio, unknowns: best.unknowns.clone() });
    result.meaning = match &result.better {
        Some(better) => {
            result.severity = Severity::NotUsable;
            let places: Vec<String> =
                better.unknowns.iter().map(|(name, value)| format!("`{name}` = {}", number(*value, 6))).collect();
            format!(
                "the estimate is a wrong minimum: from another start the cost is {} times as large, at {}; start there",
                number(better.cost_ratio, 3),
                places.join(", ")
            )
        }
        None if result.same == 0 => {
            result.severity = Severity::UsableWithCare;
            "no other start came back to the estimate: it depends on where the search begins; start closer by, predict over \
             a shorter horizon, or give bounds"
                .to_owned()
        }
        None => {
            format!("{} of {count} searches from elsewhere came back to the estimate, none found better", result.same)
        }
    };
    Ok(result)
}

/// The minima as a table, and the searches by rising cost as a stair (a waterfall plot).
impl From<&Restarts> for Section {
    fn from(found: &Restarts) -> Section {
        const LISTED: usize = 10;
        let Restarts { tried, failed, minima, severity, meaning, .. } = found;
        let section = Section::new("starts", "Searches from other starts");
        let section = match severity {
            Severity::Usable => section.says(format!("{meaning}.")),
            _ => section.because(*severity, meaning.clone()),
        };
        let section = match failed {
            0 => section,
            failed => section.says(format!("{failed} of {tried} searches could not begin or did not end.")),
        };
        let row = |minimum: &Minimum| {
            let places = minimum.unknowns.iter().map(|(name, value)| format!("{name} = {}", number(*value, 4)));
            let places: Vec<String> = places.collect();
            [Cell::number(minimum.cost_ratio, 5), minimum.searches.into(), places.join(", ").into()]
        };
        let columns = ["cost / estimate's", "searches", "at"];
        let table = Table::new("Minima found", columns).rows(minima.iter().map(row)).at_most(LISTED);
        section.table(table).plot(waterfall(minima))
    }
}

fn waterfall(minima: &[Minimum]) -> Option<Plot> {
    let mut points = vec![];
    let mut before = 0.0;
    for minimum in minima {
        let after = before + minimum.searches as f64;
        points.extend([(before, minimum.cost_ratio), (after, minimum.cost_ratio)]);
        before = after;
    }
    let layers =
        vec![Layer::Line { style: Style::Main, points }, Layer::Level { value: 1.0, label: "the estimate".to_owned() }];
    let drawing = Curves {
        x: Axis::new("searches, the best first", "").from(0.0),
        y: Axis::new("cost / estimate's", "").logarithmic(),
        layers,
    };
    let title = "Cost at the end of each search from another start, by rising cost, relative to the estimate's";
    let caption = "Cost where each search ended; a step is a minimum";
    (!minima.is_empty()).then(|| Plot::new("starts", caption, title, Drawing::Curves(drawing)))
}

impl From<Restarts> for Section {
    fn from(found: Restarts) -> Section {
        Section::from(&found)
    }
}
