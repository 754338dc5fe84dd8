//! Predictions with bands: how far the truth, and how far a measurement, may be from what the model says.

use crate::error::Error;
use crate::estimate::{Summary, Unknown, student};
use crate::problem::{Accumulate, Objective, Problem, Simulated};
use crate::sweep::Window;

/// A prediction of one record with the half widths of its bands, a column per output.
#[derive(Clone, Debug)]
pub struct Bands {
    /// Predicted outputs.
    pub outputs: Vec<Vec<f64>>,
    /// Half width of the band that holds the noise-free output, from the uncertainty of the unknowns, in its unit.
    pub confidence: Vec<Vec<f64>>,
    /// Half width of the band that holds a new measurement: that and the noise.
    pub prediction: Vec<Vec<f64>>,
}

/// The bands, each point for itself, that hold with the given probability, to first order in the unknowns (Seber and Wild,
/// *Nonlinear Regression*, 1989, section 5.1), for record number `experiment` of the fit. With a pre-filter they are
/// those of the filtered outputs. Unknowns that are held or not determined count as exact.
///
/// # Errors
/// No such record, a probability not between 0 and 1, an estimate of another problem, a simulation that fails.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// let bands = greybox::diagnose::bands(&problem, &estimate, 0, 0.95)?; // of the first record
/// let (noise_free, new) = (bands.confidence[0][100], bands.prediction[0][100]); // half widths for id, sample 100 (A)
/// assert!(noise_free < new && (new / 1.96 - 0.05).abs() < 0.002); // the noise of the record is 0.05 A
/// # Ok(())
/// # }
/// ```
pub fn bands(problem: &Problem<'_>, estimate: &Summary, experiment: usize, probability: f64) -> Result<Bands, Error> {
    let (objective, best) = problem.at(estimate)?;
    let count = problem.records().len();
    if experiment >= count {
        return Err(Error::Option(format!("there is no record number {experiment}; the fit has {count}, from zero")));
    }
    if !(probability > 0.0 && probability < 1.0) {
        return Err(Error::Option(format!("the probability of a band is {probability}; it must be between 0 and 1")));
    }
    let Simulated { outputs, .. } = objective.predict(experiment, &best)?;
    let Widths { confidence, prediction } = widths(&objective, &best, estimate, experiment, probability)?;
    Ok(Bands { outputs, confidence, prediction })
}

/// Half widths of the bands about a prediction, a column per output; NaN where there is no prediction.
pub(crate) struct Widths {
    pub confidence: Vec<Vec<f64>>,
    pub prediction: Vec<Vec<f64>>,
}

/// The half widths at a place, of record number `experiment`, which must be there.
pub(crate) fn widths(
    objective: &Objective<'_>,
    best: &[f64],
    estimate: &Summary,
    experiment: usize,
    probability: f64,
) -> Result<Widths, Error> {
    // Degrees of freedom of a predicted variance belong to one unknown, and most of the band is noise.
    let counts =
        |unknown: &&Unknown| unknown.knowledge.standard_error().is_some() && !objective.sweep.predicts_variance();
    let degrees = estimate.unknowns.iter().filter(counts);
    let degrees = degrees.map(|unknown| unknown.degrees_of_freedom).fold(estimate.degrees_of_freedom(), f64::min);
    let quantile = |degrees: f64| student::quantile(0.5 + probability / 2.0, degrees);
    let quantiles = [quantile(degrees), quantile(estimate.degrees_of_freedom())];
    // Slopes in the outputs' own units, and the covariance in the optimizer's coordinates.
    let objective = objective.in_units();
    // A filter needs the measurements; else, bands are wanted where nothing was measured, too.
    let filters = objective.sweep.predicts_variance();
    let compared = if filters { objective.problem.clone() } else { objective.problem.against_zero() };
    let objective = objective.of(&compared, objective.sweep);
    let columns: Vec<usize> = objective.problem.unknowns.columns(experiment).collect();
    let slope = |i: usize| estimate.unknowns[i].transform.slope(estimate.unknowns[i].value);
    let n = columns.len();
    let dense = estimate.covariance.dense(&columns);
    let covariance = (0..n * n).map(|ij| dense[(ij / n, ij % n)] / (slope(columns[ij / n]) * slope(columns[ij % n])));
    let (covariance, sigma): (Vec<f64>, Vec<f64>) = (covariance.collect(), estimate.sigma());
    let make = || {
        let none = vec![vec![]; sigma.len()];
        let found = Widths { confidence: none.clone(), prediction: none };
        Gather { covariance: &covariance, quantiles, sigma: &sigma, found }
    };
    let gathered = objective.gather_one(best, experiment, true, make);
    gathered.map(|gather| gather.found).map_err(|_| Error::Simulation(objective.locate(experiment, best, 0)))
}

/// The half widths of the rows of each window.
struct Gather<'g> {
    covariance: &'g [f64],
    /// Of the unknowns' variances, and of the noise, each with its degrees of freedom.
    quantiles: [f64; 2],
    sigma: &'g [f64],
    found: Widths,
}

impl Accumulate for Gather<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let n = window.columns() - 1;
        for k in 0..window.samples[lane] {
            for (j, sigma) in self.sigma.iter().enumerate() {
                let g = |c: usize| window.at(k, j, c, lane);
                let row = |i: usize| (0..n).map(|c| g(c) * self.covariance[i * n + c]).sum::<f64>() * g(i);
                let deviation = (0..n).map(row).sum::<f64>().max(0.0).sqrt();
                // Slopes were divided by the predicted standard deviation, which takes the place of the common one.
                let root = window.variance_root(k, j, lane);
                let noise = if window.has_variances() { root } else { *sigma };
                let [own, of_noise] = if window.is_measured(k, j, lane) { self.quantiles } else { [f64::NAN; 2] };
                self.found.confidence[j].push(own * deviation * root);
                self.found.prediction[j].push((own * deviation * root).hypot(of_noise * noise));
            }
        }
    }

    fn append(&mut self, later: Self) {
        let extend = |all: &mut [Vec<f64>], later: Vec<Vec<f64>>| {
            all.iter_mut().zip(later).for_each(|(all, later)| all.extend(later));
        };
        extend(&mut self.found.confidence, later.found.confidence);
        extend(&mut self.found.prediction, later.found.prediction);
    }
}
