//! Estimates side by side, tests between nested ones, and data not used for the fit.

mod section;

use super::Test;
use crate::error::Error;
use crate::estimate::{Estimate, OutputFit, Summary};
use crate::experiment::ExperimentOf;
use crate::fit::Fit;
use crate::model::Model;
use crate::parameter::fixed;
use crate::predict::Horizon;
use crate::signals::Signals;
use crate::whiteness::chi_squared_tail;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// An estimate under a title, to be compared with others of the same data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Candidate {
    /// Its name for the reader.
    pub title: String,
    /// The estimate.
    pub estimate: Summary,
}

impl Candidate {
    /// An estimate under a title.
    pub fn new(title: impl Into<String>, estimate: &Summary) -> Self {
        Candidate { title: title.into(), estimate: estimate.clone() }
    }

    fn same_data(&self, other: &Candidate) -> Result<(), Error> {
        let data = |c: &Candidate| {
            let experiments = c.estimate.experiments.iter().map(|e| (e.name.clone(), e.samples));
            (c.estimate.measurements, experiments.collect::<Vec<_>>(), c.estimate.method.predictor.clone())
        };
        if data(self) == data(other) {
            return Ok(());
        }
        let (mine, its) = (&self.estimate, &other.estimate);
        Err(Error::Option(format!(
            "`{}` and `{}` are not fits of the same data by the same prediction error ({} measurements by {}, {} by {}): \
             their likelihoods do not compare",
            self.title, other.title, mine.measurements, mine.method.predictor, its.measurements, its.method.predictor
        )))
    }
}

/// Tests whether the unknowns that `full` has beyond `restricted` are worth having, by the likelihood ratio (Wilks, Annals
/// of Mathematical Statistics 9 (1938) 60). Failed means: they are.
///
/// # Errors
/// Fits of other data, weighted or robust ones (which have no likelihood), and a `full` that has no more unknowns.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// use greybox::diagnose::{Candidate, likelihood_ratio};
/// let fixed = Winding { ls: greybox::fixed(4.1e-3), ..start }; // the data sheet's inductance
/// let restricted = Fit::new(&model, &record).parameters(fixed).run()?;
/// let test = likelihood_ratio(&Candidate::new("data sheet", &restricted), &Candidate::new("all free", &estimate))?;
/// assert!(!test.passed && test.p_value < 1e-6); // the record contradicts the data sheet
/// # Ok(())
/// # }
/// ```
pub fn likelihood_ratio(restricted: &Candidate, full: &Candidate) -> Result<Test, Error> {
    let more = nested(restricted, full)?;
    let (Some(one), Some(other)) = (restricted.estimate.deviance, full.estimate.deviance) else {
        return Err(Error::Option("weighted and robust fits have no likelihood to compare".to_owned()));
    };
    let statistic = one - other;
    let p_value = chi_squared_tail(statistic, more);
    Ok(verdict(format!("likelihood ratio, {more} more unknown(s)"), statistic, p_value, restricted, full))
}

/// Nested models compared by the F test on the sums of squares (Seber and Wild, *Nonlinear Regression*, 1989, section 5.3): for one
/// output, noise estimated; better than the likelihood ratio on short records.
///
/// # Errors
/// As [`likelihood_ratio`], and fits of several outputs.
///
/// ```
/// use greybox::diagnose::{Candidate, f_test};
/// use greybox::{Kind, Model, Nothing, Scalar, Time, fixed, free, signals, simulate, Fit};
/// signals! {
///     pub struct Load { f: "N" }
///     pub struct Length { y: "m" }
///     pub struct Spring { stiffness: "N/m", rest: "m" }
/// }
/// # #[derive(Clone)]
/// # struct Hooke;
/// # impl Model for Hooke {
/// #     type State = Nothing; type Input = Load; type Output = Length; type Parameters = Spring;
/// #     const KIND: Kind = Kind::Static;
/// #     fn output<S: Scalar>(&self, _: S, _: &Nothing, u: &Load<S>, p: &Spring<S>) -> Length<S> {
/// #         Length { y: p.rest + u.f / p.stiffness }
/// #     }
/// # }
/// # fn main() -> Result<(), greybox::Error> {
/// let loads: Vec<Load> = (0..20).map(|k| Load { f: f64::from(k) }).collect();
/// let time = Time::Uniform { start: 0.0, step: 1.0 };
/// let run = simulate(&Hooke, &Spring { stiffness: 40.0, rest: 0.1 }, &Nothing, time, &loads)?;
/// let record = run.with_noise(Length { y: 0.01 }, 1).experiment(&Hooke)?;
/// let fit = |rest| Fit::new(&Hooke, &record).parameters(Spring { stiffness: free(10.0), rest }).run();
/// let (without, with) = (fit(fixed(0.0))?, fit(free(0.0))?);
/// assert!(!f_test(&Candidate::new("no rest length", &without), &Candidate::new("rest length", &with))?.passed);
/// # Ok(())
/// # }
/// ```
pub fn f_test(restricted: &Candidate, full: &Candidate) -> Result<Test, Error> {
    let more = nested(restricted, full)?;
    let ([one], [other], true) = (
        restricted.estimate.outputs.as_slice(),
        full.estimate.outputs.as_slice(),
        restricted.estimate.deviance.is_some() && full.estimate.deviance.is_some(),
    ) else {
        return Err(Error::Option("the F test is for unweighted fits of one output; use likelihood_ratio".to_owned()));
    };
    let n = other.fit.samples as f64;
    let degrees = n - full.estimate.unknowns.len() as f64;
    // Mean squares, of the same number of errors.
    let square = |fit: &OutputFit| fit.rmse * fit.rmse;
    let statistic = (square(&one.fit) - square(&other.fit)) / more / (square(&other.fit) / degrees);
    let p_value = FisherSnedecor::new(more, degrees)
        .map_err(|_| Error::Option(format!("{n} measurements leave the F test no degree of freedom")))?
        .sf(statistic.max(0.0));
    Ok(verdict(format!("F test, {more} and {degrees} degrees of freedom"), statistic, p_value, restricted, full))
}

fn nested(restricted: &Candidate, full: &Candidate) -> Result<f64, Error> {
    restricted.same_data(full)?;
    let (few, many) = (restricted.estimate.unknowns.len(), full.estimate.unknowns.len());
    if many <= few {
        return Err(Error::Option(format!(
            "`{}` has {many} unknowns and `{}` has {few}: the second must have more than the first it is nested in",
            full.title, restricted.title
        )));
    }
    Ok((many - few) as f64)
}

fn verdict(name: String, statistic: f64, p_value: f64, restricted: &Candidate, full: &Candidate) -> Test {
    let passed = format!("`{}` says as much as `{}` with fewer unknowns: keep it", restricted.title, full.title);
    let failed =
        format!("`{}` says more than chance would let it: `{}` misses something", full.title, restricted.title);
    Test::new(name, statistic, p_value, &passed, &failed)
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
type NamedQualities = Vec<(String, OutputFit)>;

/// Simulates a record with the estimate's parameters, and predicts it each number of samples of `steps` ahead. What the
/// record leaves open of its initial state is estimated from it.
///
/// # Errors
/// As [`Estimate::predict`]; predicting ahead needs outputs that give the state.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let (first, second) = record.split(0.6)?;
/// let estimate = Fit::new(&model, &first).parameters(start).run()?;
/// let validation = greybox::diagnose::validate(&estimate, &model, &second, &[10])?; // simulated, and 10 samples ahead
/// let (_, simulated) = &validation.qualities[0];
/// assert!(simulated[0].1.fit_percent.unwrap() > 98.0); // of id
/// # Ok(())
/// # }
/// ```
pub fn validate<M: Model>(
    estimate: &Estimate<M>,
    model: &M,
    record: &ExperimentOf<M>,
    steps: &[usize],
) -> Result<Validation, Error> {
    let fit = || Fit::new(model, record).parameters(M::Parameters::map(estimate.parameters, fixed));
    let quality = |fit: Fit<'_, M>| -> Result<NamedQualities, Error> {
        let prediction = fit.predict(estimate, record)?;
        Ok(prediction.columns.names.into_iter().zip(M::Output::into_array(prediction.quality)).collect())
    };
    let mut qualities = vec![(None, quality(fit())?)];
    for &steps in steps {
        qualities.push((Some(steps as u64), quality(fit().predictor(Horizon::new(steps)))?));
    }
    Ok(Validation { experiment: record.name().to_owned(), qualities })
}

/// Fits all records but one, simulates that one, and so through all of them. Blocks of one record make records by
/// [`Experiment::slice`](crate::Experiment::slice) or [`cycles`](crate::Experiment::cycles).
///
/// # Errors
/// Fewer than two records, and those of the fits and simulations.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let blocks: Vec<_> = (0..4).map(|k| record.slice(k * 500..(k + 1) * 500)).collect::<Result<_, _>>()?;
/// let fit = |others: &[_]| Fit::new(&model, others).parameters(start).run();
/// let left_out = greybox::diagnose::cross_validate(&model, &blocks, fit)?;
/// assert_eq!(left_out.len(), 4);
/// # Ok(())
/// # }
/// ```
pub fn cross_validate<M: Model>(
    model: &M,
    records: &[ExperimentOf<M>],
    fit: impl Fn(&[ExperimentOf<M>]) -> Result<Estimate<M>, Error>,
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
