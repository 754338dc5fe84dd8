//! Estimates side by side, tests between nested ones, and data not used for the fit.

mod section;

use super::Test;
use crate::error::Error;
use crate::estimate::{Direction, Estimate, Method, Quality, Unknown, Warning};
use crate::experiment::ExperimentOf;
use crate::fit::Fit;
use crate::information::SquareMatrix;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::numeral::or_nan;
use crate::optimize::Severity;
use crate::parameter::fixed;
use crate::predict::{FreeRun, Horizon, Predictor};
use crate::signals::Signals;
use crate::whiteness::chi_squared_tail;
use core::fmt;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// An estimate of any model without its types, to be kept, compared and reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// What the reader calls it.
    pub title: String,
    /// All free quantities.
    pub unknowns: Vec<Unknown>,
    /// Names, units and quality of the outputs.
    pub outputs: Vec<(String, String, Quality)>,
    /// Names and samples of the experiments.
    pub experiments: Vec<(String, u64)>,
    /// Measurements used.
    pub measurements: u64,
    /// The minimized cost.
    #[serde(deserialize_with = "or_nan")]
    pub cost: f64,
    /// `-2 ln` of the likelihood, where there is one.
    pub deviance: Option<f64>,
    /// Parameters of the likelihood: unknowns and estimated standard deviations of the noise.
    pub likelihood_parameters: Option<f64>,
    /// Akaike's criterion.
    pub aic: Option<f64>,
    /// The same, corrected for short records.
    pub aicc: Option<f64>,
    /// Bayes' criterion.
    pub bic: Option<f64>,
    /// Akaike's final prediction error.
    pub fpe: Option<f64>,
    /// Measurements less what was estimated from them.
    #[serde(deserialize_with = "or_nan")]
    pub degrees_of_freedom: f64,
    /// Covariance of the unknowns, in products of their units; zero where there is no interval.
    pub covariance: SquareMatrix,
    /// What the data cannot tell apart.
    pub directions: Vec<Direction>,
    /// What the reader must know.
    pub warnings: Vec<Warning>,
    /// How the search ended, in words.
    pub outcome: String,
    /// Whether it ended in a minimum.
    pub converged: bool,
    /// What to do, if it did not.
    pub advice: String,
    /// The worst that is said of it.
    pub severity: Severity,
    /// Trial steps of the search.
    pub iterations: u64,
    /// Passes over the data with slopes.
    pub evaluations: u64,
    /// Time taken (s).
    #[serde(deserialize_with = "or_nan")]
    pub seconds: f64,
    /// How it was made.
    pub method: Method,
}

impl Summary {
    /// The summary of an estimate under a title.
    pub fn of<M: Model, I, P>(title: impl Into<String>, estimate: &Estimate<M, I, P>) -> Self {
        let quality = M::Output::into_array(estimate.quality);
        let output = |j: usize| (M::Output::NAMES[j].to_owned(), M::Output::UNITS[j].to_owned(), quality.as_ref()[j]);
        Summary {
            title: title.into(),
            unknowns: estimate.unknowns.clone(),
            outputs: (0..M::Output::LEN).map(output).collect(),
            experiments: estimate.experiments.iter().map(|e| (e.name.clone(), e.samples as u64)).collect(),
            measurements: estimate.measurements,
            cost: estimate.cost,
            deviance: estimate.deviance,
            likelihood_parameters: estimate.aic().zip(estimate.deviance).map(|(aic, deviance)| (aic - deviance) / 2.0),
            aic: estimate.aic(),
            aicc: estimate.aicc(),
            bic: estimate.bic(),
            fpe: estimate.fpe(),
            degrees_of_freedom: estimate.degrees_of_freedom(),
            covariance: estimate.covariance.clone(),
            directions: estimate.directions.clone(),
            warnings: estimate.warnings.clone(),
            outcome: estimate.outcome.to_string(),
            converged: estimate.outcome.converged(),
            advice: estimate.outcome.advice().to_owned(),
            severity: estimate.severity(),
            iterations: estimate.iterations,
            evaluations: estimate.evaluations,
            seconds: estimate.seconds,
            method: estimate.method.clone(),
        }
    }

    fn same_data(&self, other: &Summary) -> Result<(), Error> {
        let data = |s: &Summary| (s.measurements, s.experiments.clone(), s.method.predictor.clone());
        if data(self) == data(other) {
            return Ok(());
        }
        Err(Error::Option(format!(
            "`{}` and `{}` are not fits of the same data by the same prediction error ({} measurements by {}, {} by {}): \
             their likelihoods do not compare",
            self.title,
            other.title,
            self.measurements,
            self.method.predictor,
            other.measurements,
            other.method.predictor
        )))
    }
}

/// Tests whether the unknowns that `full` has beyond `restricted` are worth having, by the likelihood ratio (Wilks, Annals
/// of Mathematical Statistics 9 (1938) 60). Failed means: they are.
///
/// # Errors
/// Fits of other data, weighted or robust ones (which have no likelihood), and a `full` that has no more unknowns.
pub fn likelihood_ratio(restricted: &Summary, full: &Summary) -> Result<Test, Error> {
    let more = nested(restricted, full)?;
    let (Some(one), Some(other)) = (restricted.deviance, full.deviance) else {
        return Err(Error::Option("weighted and robust fits have no likelihood to compare".to_owned()));
    };
    let statistic = one - other;
    let p_value = chi_squared_tail(statistic, more);
    Ok(verdict(format!("likelihood ratio, {more} more unknown(s)"), statistic, p_value, restricted, full))
}

/// The same by the F test on the sums of squares (Seber and Wild, *Nonlinear Regression*, 1989, section 5.3): for one
/// output, noise estimated; better than the likelihood ratio on short records.
///
/// # Errors
/// As [`likelihood_ratio`], and fits of several outputs.
pub fn f_test(restricted: &Summary, full: &Summary) -> Result<Test, Error> {
    let more = nested(restricted, full)?;
    let ([(_, _, one)], [(_, _, other)], true) = (
        restricted.outputs.as_slice(),
        full.outputs.as_slice(),
        restricted.deviance.is_some() && full.deviance.is_some(),
    ) else {
        return Err(Error::Option("the F test is for unweighted fits of one output; use likelihood_ratio".to_owned()));
    };
    let n = other.samples as f64;
    let degrees = n - full.unknowns.len() as f64;
    let squares = |quality: &Quality| quality.rmse * quality.rmse * n;
    let statistic = (squares(one) - squares(other)) / more / (squares(other) / degrees);
    let p_value = FisherSnedecor::new(more, degrees)
        .map_err(|_| Error::Option(format!("{n} measurements leave the F test no degree of freedom")))?
        .sf(statistic.max(0.0));
    Ok(verdict(format!("F test, {more} and {degrees} degrees of freedom"), statistic, p_value, restricted, full))
}

fn nested(restricted: &Summary, full: &Summary) -> Result<f64, Error> {
    restricted.same_data(full)?;
    let (few, many) = (restricted.unknowns.len(), full.unknowns.len());
    if many <= few {
        return Err(Error::Option(format!(
            "`{}` has {many} unknowns and `{}` has {few}: the second must have more than the first it is nested in",
            full.title, restricted.title
        )));
    }
    Ok((many - few) as f64)
}

fn verdict(name: String, statistic: f64, p_value: f64, restricted: &Summary, full: &Summary) -> Test {
    let passed = format!("`{}` says as much as `{}` with fewer unknowns: keep it", restricted.title, full.title);
    let failed =
        format!("`{}` says more than chance would let it: `{}` misses something", full.title, restricted.title);
    Test::new(name, statistic, p_value, &passed, &failed)
}

/// Summaries side by side; prints as a table, and is a section of a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison(pub Vec<Summary>);

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.table(), f)
    }
}

/// How an estimate does on a record that it was not made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Validation {
    /// Name of the record.
    pub experiment: String,
    /// Samples predicted ahead, `None` for a simulation; and names and quality of the outputs.
    pub qualities: Vec<(Option<u64>, NamedQualities)>,
}

/// Name and quality of each output.
pub type NamedQualities = Vec<(String, Quality)>;

/// Simulates a record with the estimate's parameters, and predicts it each number of samples of `steps` ahead. What the
/// record leaves open of its initial state is estimated from it.
///
/// # Errors
/// As [`Estimate::predict`]; predicting ahead needs outputs that give the state.
pub fn validate<M: Model, I: Integrator, P>(
    estimate: &Estimate<M, I, P>,
    model: &M,
    record: &ExperimentOf<M>,
    steps: &[usize],
) -> Result<Validation, Error> {
    fn quality<M: Model, I: Integrator, P, Q: Predictor<M>>(
        estimate: &Estimate<M, I, P>,
        model: &M,
        record: &ExperimentOf<M>,
        predictor: Q,
    ) -> Result<Vec<(String, Quality)>, Error> {
        let prediction = Fit::new(model, record)
            .parameters(M::Parameters::map(estimate.parameters, fixed))
            .noise(M::Output::map(estimate.quality, |quality| quality.sigma))
            .integrator(estimate.integrator.clone())
            .predictor(predictor)
            .simulate()?;
        let quality = M::Output::into_array(prediction.quality);
        Ok((0..M::Output::LEN).map(|j| (M::Output::NAMES[j].to_owned(), quality.as_ref()[j])).collect())
    }
    let mut qualities = vec![(None, quality(estimate, model, record, FreeRun)?)];
    for &steps in steps {
        qualities.push((Some(steps as u64), quality(estimate, model, record, Horizon::new(steps))?));
    }
    Ok(Validation { experiment: record.name().to_owned(), qualities })
}

/// Fits all records but one, simulates that one, and so through all of them. Blocks of one record make records by
/// [`Experiment::slice`](crate::Experiment::slice) or [`cycles`](crate::Experiment::cycles).
///
/// # Errors
/// Fewer than two records, and those of the fits and simulations.
pub fn cross_validate<M: Model, I: Integrator, P>(
    model: &M,
    records: &[ExperimentOf<M>],
    fit: impl Fn(&[ExperimentOf<M>]) -> Result<Estimate<M, I, P>, Error>,
) -> Result<Vec<Validation>, Error> {
    if records.len() < 2 {
        return Err(Error::Option(format!(
            "{} record(s) cannot be cross-validated; two or more are needed",
            records.len()
        )));
    }
    let left_out = |out: usize| {
        let others: Vec<_> = records.iter().enumerate().filter(|(e, _)| *e != out).map(|(_, r)| r.clone()).collect();
        validate(&fit(&others)?, model, &records[out], &[])
    };
    (0..records.len()).map(left_out).collect()
}
