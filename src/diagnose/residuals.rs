//! Residuals: measured less predicted outputs. If the model is complete, they are noise.
//!
//! Tests of the mean and the spread, and those of the shape where residuals are not white, take their correlation into account
//! by their effective number: `n / (1 + 2 sum rho(k))`, the sum over the lags up to the first that is not positive (Bayley and
//! Hammersley, J. Royal Statistical Society suppl. 8 (1946) 184).

mod correlation;
mod normality;
mod outliers;
mod period;
mod signal_role;
mod spread;

pub use correlation::Correlation;
pub use outliers::Outlier;
pub use period::{Period, Spectrum};
pub use signal_role::SignalRole;
pub use spread::Spread;

use super::{LEVEL, Test};
use crate::error::Error;
use crate::problem::Simulated;
use crate::record::{Channel, Record};
use crate::whiteness::ljung_box;
use core::cell::OnceCell;
use serde::{Deserialize, Serialize};

/// Lags of correlations: up to 25, and never more than a quarter of the samples.
const LAGS: usize = 25;
/// The fewest residuals that tests say anything of.
const FEWEST: u64 = 20;

/// Examination of the residuals of one output.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Residuals {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the output.
    pub output: String,
    /// Unit of the residuals.
    pub unit: String,
    /// Residuals there are.
    pub samples: u64,
    /// How many independent ones they are worth.
    #[serde(with = "crate::real")]
    pub effective_samples: f64,
    /// Mean, in the unit.
    #[serde(with = "crate::real")]
    pub mean: f64,
    /// Standard deviation, in the unit.
    #[serde(with = "crate::real")]
    pub standard_deviation: f64,
    /// Third standardized moment; zero for a symmetric distribution.
    #[serde(with = "crate::real")]
    pub skewness: f64,
    /// Fourth standardized moment less three; zero for a normal distribution.
    #[serde(with = "crate::real")]
    pub excess_kurtosis: f64,
    /// Correlation with the residuals 1, 2, ... samples before.
    #[serde(with = "crate::real")]
    pub autocorrelation: Vec<f64>,
    /// White residuals stay within plus and minus this at 99 of 100 lags, each lag for itself; the test of Ljung and Box
    /// judges all lags together.
    #[serde(with = "crate::real")]
    pub autocorrelation_band: f64,
    /// Whether the test of Ljung and Box calls them white; `None` if it was not made.
    pub white: Option<bool>,
    /// Correlation with each input and measured output that is not constant.
    pub correlations: Vec<Correlation>,
    /// Inputs that do not change in this record: what they drive cannot be told.
    pub constant_inputs: Vec<String>,
    /// How the spread depends on each input, predicted output and time.
    pub spreads: Vec<Spread>,
    /// The residuals furthest out, beyond what a normal distribution allows; furthest first, twenty at most.
    pub outliers: Vec<Outlier>,
    /// How many outliers there are.
    pub outlier_count: u64,
    /// Where their power lies; empty where samples are not evenly spaced.
    pub spectrum: Spectrum,
    /// The strongest line of the spectrum, if it stands out.
    pub period: Option<Period>,
    /// Tests of the residuals.
    pub tests: Vec<Test>,
}

/// Examines the residuals of a prediction of a record, output by output. Those of a filter are divided by their predicted deviations first, and
/// multiplied by the rms of these: a noise level that varies as predicted is no finding. Outliers are in the unit of the output.
///
/// # Errors
/// A prediction that is not of this record, or a prediction that is infinite. Too few residuals for a test (fewer than
/// 20), and residuals that do not vary, are not errors: the tests are left out.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let estimate = Fit::new(&model, &record).parameters(start).run()?;
/// let prediction = estimate.predict(&model, &record)?;
/// let [id, iq] = &greybox::diagnose::residuals::examine(&prediction.columns, record.record())?[..] else { panic!() };
/// assert!((id.standard_deviation - 0.05).abs() < 0.001 && iq.autocorrelation[0].abs() < 0.05);
/// # Ok(())
/// # }
/// ```
pub fn examine(prediction: &Simulated, record: &Record) -> Result<Vec<Residuals>, Error> {
    let found = prediction.residuals.first().map_or(0, Vec::len);
    if found != record.len() {
        return Err(Error::Lengths {
            experiment: record.name().to_owned(),
            what: "the prediction".to_owned(),
            found,
            reference: "the record".to_owned(),
            expected: record.len(),
        });
    }
    let series = |channel: &Channel, values: &[f64]| Series::new(&channel.name, &channel.unit, values);
    let inputs: Vec<Series> = record.inputs().iter().map(|channel| series(channel, &channel.values)).collect();
    let outputs: Vec<Series> = record.outputs().iter().map(|channel| series(channel, &channel.values)).collect();
    let predicted = record.outputs().iter().zip(&prediction.outputs);
    let predicted: Vec<Series> = predicted.map(|(channel, values)| series(channel, values)).collect();
    let times: Vec<f64> = (0..record.len()).map(|k| record.time(k)).collect();
    let time = Series::new("t", "s", &times);
    let even = record.gaps().is_empty();
    record
        .outputs()
        .iter()
        .zip(&prediction.residuals)
        .enumerate()
        .map(|(j, (channel, residuals))| {
            if let Some(k) = residuals.iter().position(|e| e.is_infinite()) {
                return Err(Error::NotFinite {
                    experiment: record.name().to_owned(),
                    signal: format!("residual of {}", channel.name),
                    value: residuals[k],
                    sample: k,
                    time: record.moment(k),
                });
            }
            let standardized = prediction.deviations.get(j).map(|deviations| standardized(residuals, deviations));
            let tested = standardized.as_ref().unwrap_or(residuals);
            let output = series(channel, tested);
            let mut result = output.examine(record.name(), &inputs, &outputs, &predicted, &time);
            if result.samples >= FEWEST && output.deviation > 0.0 {
                if even {
                    let (spectrum, period, test) = period::find(&output, record.sample_time(), record.time_unit());
                    (result.spectrum, result.period) = (spectrum, period);
                    result.tests.push(test);
                }
                (result.outliers, result.outlier_count) = outliers::find(tested, &times);
                result.outliers.iter_mut().for_each(|one| one.residual = residuals[one.sample as usize]);
            }
            Ok(result)
        })
        .collect()
}

/// Residuals divided by their deviations, times the root of the mean square of these.
fn standardized(residuals: &[f64], deviations: &[f64]) -> Vec<f64> {
    let (sum, count) = deviations
        .iter()
        .filter(|deviation| deviation.is_finite())
        .fold((0.0, 0.0), |(sum, count), deviation| (sum + deviation * deviation, count + 1.0));
    let level = if count > 0.0 { f64::sqrt(sum / count) } else { 1.0 };
    residuals.iter().zip(deviations).map(|(residual, deviation)| residual / deviation * level).collect()
}

/// A signal less its mean, zero where missing.
struct Series {
    name: String,
    unit: String,
    values: Vec<f64>,
    /// Whether each value was there; empty if all were.
    missing: Vec<bool>,
    count: u64,
    mean: f64,
    /// Standard deviation (`n` in the denominator); zero for a constant.
    deviation: f64,
    /// Made when first asked for.
    autocorrelation: OnceCell<Vec<f64>>,
}

impl Series {
    fn new(name: &str, unit: &str, raw: &[f64]) -> Self {
        let count = raw.iter().filter(|v| v.is_finite()).count();
        let missing = if count < raw.len() { raw.iter().map(|v| !v.is_finite()).collect() } else { vec![] };
        let n = count.max(1) as f64;
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in raw.iter().filter(|v| v.is_finite()) {
            (lowest, highest) = (lowest.min(*v), highest.max(*v));
        }
        // From the first value, so that a large mean costs no digits.
        let first = raw.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
        let mean = first + raw.iter().filter(|v| v.is_finite()).map(|v| v - first).sum::<f64>() / n;
        let values: Vec<f64> = raw.iter().map(|v| if v.is_finite() { v - mean } else { 0.0 }).collect();
        let deviation = if highest > lowest { (values.iter().map(|v| v * v).sum::<f64>() / n).sqrt() } else { 0.0 };
        Series {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
            missing,
            count: count as u64,
            mean,
            deviation,
            autocorrelation: OnceCell::new(),
        }
    }

    fn is_missing(&self, k: usize) -> bool {
        self.missing.get(k).copied().unwrap_or(false)
    }

    fn lags(&self) -> usize {
        LAGS.min(self.count as usize / 4)
    }

    /// At lag 1, 2, ...; zeros for a constant.
    fn autocorrelation(&self) -> &[f64] {
        self.autocorrelation.get_or_init(|| {
            let sums = correlation::lagged(&self.values, &self.values, self.lags());
            let whole = if sums[0] > 0.0 { sums[0] } else { f64::INFINITY };
            sums[1..].iter().map(|sum| sum / whole).collect()
        })
    }

    /// The numbers of these residuals, and their tests but that for a period.
    fn examine<'s>(
        &self,
        experiment: &str,
        inputs: &'s [Series],
        outputs: &'s [Series],
        predicted: &'s [Series],
        time: &'s Series,
    ) -> Residuals {
        let autocorrelation = self.autocorrelation().to_vec();
        let correlated: f64 = autocorrelation.iter().take_while(|rho| **rho > 0.0).sum();
        let effective = self.count as f64 / (1.0 + 2.0 * correlated);
        let constant = inputs.iter().filter(|u| u.deviation == 0.0).map(|u| u.name.to_owned()).collect();
        let mut result = Residuals {
            experiment: experiment.to_owned(),
            output: self.name.to_owned(),
            unit: self.unit.to_owned(),
            samples: self.count,
            effective_samples: effective,
            mean: if self.count > 0 { self.mean } else { 0.0 },
            standard_deviation: self.deviation,
            skewness: 0.0,
            excess_kurtosis: 0.0,
            autocorrelation,
            autocorrelation_band: 2.576 / (self.count.max(1) as f64).sqrt(),
            white: None,
            correlations: vec![],
            constant_inputs: constant,
            spreads: vec![],
            outliers: vec![],
            outlier_count: 0,
            spectrum: Spectrum::default(),
            period: None,
            tests: vec![],
        };
        if self.count < FEWEST || self.deviation == 0.0 {
            return result;
        }
        let (q, p) = ljung_box(&result.autocorrelation, self.count);
        let lags = result.autocorrelation.len();
        result.white = Some(p >= LEVEL);
        result.tests.push(Test::new(
            format!("Ljung-Box, {lags} lags"),
            q,
            p,
            "the residuals are white: none can be predicted from those before",
            "the residuals follow from those before: the model misses dynamics, or the noise enters before the states \
             (predict over a shorter horizon); classical intervals are too narrow",
        ));
        result.tests.push(normality::mean(self, effective));
        normality::shape(self, p >= LEVEL, &mut result);
        let with = |role: SignalRole, of: &'s [Series]| {
            of.iter().filter(|signal| signal.deviation > 0.0).map(move |signal| (role, signal))
        };
        let inputs = || with(SignalRole::Input, inputs);
        for (role, signal) in inputs().chain(with(SignalRole::MeasuredOutput, outputs)) {
            let (correlation, test) = correlation::between(self, &result.autocorrelation, role, signal);
            result.correlations.push(correlation);
            result.tests.push(test);
        }
        let predicted = with(SignalRole::PredictedOutput, predicted);
        for (role, signal) in inputs().chain(predicted).chain(with(SignalRole::Time, std::slice::from_ref(time))) {
            if let Some((spread, test)) = spread::over(self, effective, role, signal) {
                result.spreads.push(spread);
                result.tests.push(test);
            }
        }
        result
    }
}
