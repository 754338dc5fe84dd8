//! Drift: how estimates of one model go from record to record.

use super::Test;
use crate::estimate::{Summary, Unknown};
use crate::whiteness::chi_squared_tail;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// How a parameter changes from record to record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Value and standard error in each of the estimates that know it.
    #[serde(with = "crate::real")]
    pub values: Vec<(f64, f64)>,
    /// Mean, weighted by the inverse variances.
    #[serde(with = "crate::real")]
    pub mean: f64,
    /// Whether they are one value (Cochran, Biometrics 10 (1954) 101).
    pub change: Test,
    /// Whether they show no trend, by the weighted regression on their number.
    pub trend: Test,
    /// Change from estimate to estimate, in the unit.
    #[serde(with = "crate::real")]
    pub slope: f64,
}

/// Drift of each parameter over estimates in order of time, of one model and different records; parameters that fewer than
/// three of them know are left out.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let hours: Vec<_> = (0..4)
///     .map(|k| Ok(Fit::new(&model, &record.slice(k * 500..(k + 1) * 500)?).parameters(start).run()?.into_summary()))
///     .collect::<Result<_, greybox::Error>>()?;
/// let drift = greybox::diagnose::drift(&hours);
/// assert_eq!(drift[0].name, "rs");
/// assert!(drift[0].trend.passed); // the record was simulated with one resistance
/// # Ok(())
/// # }
/// ```
pub fn drift(summaries: &[Summary]) -> Vec<Drift> {
    let Some(first) = summaries.first() else { return vec![] };
    let of = |unknown: &Unknown| {
        let mut points = vec![];
        for (i, summary) in summaries.iter().enumerate() {
            if let Some(found) = summary.unknowns.iter().find(|u| u.name == unknown.name)
                && let Some(error) = found.knowledge.standard_error().filter(|error| *error > 0.0)
            {
                points.push((i as f64, found.value, error));
            }
        }
        if points.len() < 3 {
            return None;
        }
        let sum = |f: &dyn Fn(f64, f64) -> f64| points.iter().map(|(x, y, s)| f(*x, *y) / (s * s)).sum::<f64>();
        let weight = sum(&|_, _| 1.0);
        let (middle, mean) = (sum(&|x, _| x) / weight, sum(&|_, y| y) / weight);
        let statistic = sum(&|_, y| (y - mean).powi(2));
        let spread = sum(&|x, _| (x - middle).powi(2));
        let slope = sum(&|x, y| (x - middle) * (y - mean)) / spread;
        let z = slope * spread.sqrt();
        let name = &unknown.name;
        let change = Test::new(
            "Cochran's Q",
            statistic,
            chi_squared_tail(statistic, points.len() as f64 - 1.0),
            &format!("`{name}` is one value in all records, as far as they can tell"),
            &format!(
                "`{name}` differs from record to record by more than its intervals: it changes (temperature, wear), or \
                      the intervals are too narrow"
            ),
        );
        let trend = Test::new(
            "weighted trend",
            z,
            2.0 * Normal::standard().sf(z.abs()),
            &format!("`{name}` shows no trend"),
            &format!("`{name}` goes {} from record to record", if slope > 0.0 { "up" } else { "down" }),
        );
        let values = points.iter().map(|(_, y, s)| (*y, *s)).collect();
        Some(Drift { name: name.clone(), unit: unknown.unit.clone(), values, mean, change, trend, slope })
    };
    first.unknowns.iter().filter_map(of).collect()
}
