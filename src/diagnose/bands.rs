//! Predictions with bands: how far the truth, and how far a measurement, may be from what the model says.

use crate::error::Error;
use crate::estimate::{Estimate, Prediction, student};
use crate::fit::{FitProblem, Objective, Rows};
use crate::integrate::Integrator;
use crate::model::Model;
use crate::predict::{Predictor, WINDOW};
use crate::signals::{Of, Signals};

/// A prediction of one record with the half widths of its bands.
#[derive(Debug)]
pub struct Bands<M: Model> {
    /// Time of each sample (s).
    pub t: Vec<f64>,
    /// Predicted outputs.
    pub outputs: Vec<Of<M::Output, f64>>,
    /// Half width of the band that holds the noise-free output, from the uncertainty of the unknowns, in its unit.
    pub confidence: Vec<Of<M::Output, f64>>,
    /// Half width of the band that holds a new measurement: that and the noise.
    pub prediction: Vec<Of<M::Output, f64>>,
}

/// The bands, each point for itself, that hold with the given probability, to first order in the unknowns (Seber and Wild,
/// *Nonlinear Regression*, 1989, section 5.1), for record number `experiment` of the fit. With a pre-filter they are
/// those of the filtered outputs. Unknowns that are held or not determined count as exact.
///
/// # Errors
/// No such record, a probability not between 0 and 1, an estimate of another problem, a simulation that fails.
pub fn bands<M: Model, I: Integrator, P: Predictor<M>, O>(
    problem: &FitProblem<'_, M, I, P, O>,
    estimate: &Estimate<M, I, P>,
    experiment: usize,
    probability: f64,
) -> Result<Bands<M>, Error> {
    let (objective, best) = problem.at(estimate)?;
    if experiment >= problem.experiments().len() {
        let count = problem.experiments().len();
        return Err(Error::Option(format!("there is no record number {experiment}; the fit has {count}, from zero")));
    }
    if !(probability > 0.0 && probability < 1.0) {
        return Err(Error::Option(format!("the probability of a band is {probability}; it must be between 0 and 1")));
    }
    let Prediction { t, outputs, .. } = problem.prediction(&objective, experiment, &best)?;
    let Widths { confidence, prediction } = widths(&objective, &best, estimate, experiment, probability)?;
    Ok(Bands { t, outputs, confidence, prediction })
}

/// Half widths of the bands about a prediction.
pub(crate) struct Widths<M: Model> {
    pub confidence: Vec<Of<M::Output, f64>>,
    pub prediction: Vec<Of<M::Output, f64>>,
}

/// The half widths at a place, of record number `experiment`, which must be there.
pub(crate) fn widths<M: Model, I, P>(
    objective: &Objective<'_>,
    best: &[f64],
    estimate: &Estimate<M, I, P>,
    experiment: usize,
    probability: f64,
) -> Result<Widths<M>, Error> {
    let sigma = M::Output::into_array(M::Output::map(estimate.quality, |quality| quality.sigma));
    let quantile = student::quantile(0.5 + probability / 2.0, estimate.degrees_of_freedom());
    // Slopes in the outputs' own units, and the covariance in the optimizer's coordinates.
    let objective = objective.in_units();
    let columns: Vec<usize> = objective.unknowns.columns(experiment).collect();
    let slope = |i: usize| estimate.unknowns[i].transform.slope(estimate.unknowns[i].value);
    let n = columns.len();
    let covariance: Vec<f64> = (0..n * n)
        .map(|ij| {
            let (i, j) = (columns[ij / n], columns[ij % n]);
            estimate.covariance[(i, j)] / (slope(i) * slope(j))
        })
        .collect();
    let zero = vec![M::Output::splat(0.0); objective.source.samples(experiment)];
    let mut found = Widths { confidence: zero.clone(), prediction: zero };
    let rows = M::Output::LEN * WINDOW;
    let mut g = vec![0.0; n];
    let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
        let slopes = window.data_mut();
        for k in 0..samples {
            let variance = M::Output::array_from_fn(|j| {
                g.iter_mut().enumerate().for_each(|(c, g)| *g = slopes[c * rows + j * WINDOW + k]);
                let row = |i: usize| g.iter().zip(&covariance[i * n..]).map(|(g, c)| g * c).sum::<f64>() * g[i];
                (0..n).map(row).sum::<f64>().max(0.0)
            });
            let variance = variance.as_ref();
            found.confidence[begin + k] = M::Output::from_fn(|j| quantile * variance[j].sqrt());
            found.prediction[begin + k] =
                M::Output::from_fn(|j| quantile * variance[j].sqrt().hypot(sigma.as_ref()[j]));
        }
    };
    if objective.walk(experiment, best, true, visit).is_err() {
        return Err(Error::Simulation(objective.locate(experiment, best, 0)));
    }
    Ok(found)
}
