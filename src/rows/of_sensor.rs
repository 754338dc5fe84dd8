//! Sums over the errors that remain when the unknowns have taken their step beside a regressor of a sensor.

use super::of_pieces::Run;
use super::sensors::Regressors;
use crate::problem::{AccumulateLanes, Objective};
use crate::sweep::Window;

/// The step beside a regressor.
pub(crate) struct Steps {
    pub output: usize,
    pub kind: usize,
    pub value: f64,
    /// For each unknown of each experiment: its step beside the regressor, and its coefficient in the regression of the regressor on the slopes.
    pub of: Vec<Vec<(f64, f64)>>,
}

/// Sums over the errors `e` that remain with the regressor, and the part `z` of the regressor that is orthogonal to the unknowns' slopes.
#[derive(Clone)]
pub(crate) struct OfSensor {
    /// Of `z^2`, `z^4`, `e^2 z^2` and `e^2`.
    pub sums: [f64; 4],
    pub errors: Vec<Run>,
}

/// These sums while they are made, lane by lane.
pub(crate) struct SumOfSensor<'s> {
    regressors: Regressors<'s>,
    steps: &'s Steps,
    experiments: Vec<usize>,
    of: Vec<OfSensor>,
}

impl<'s> SumOfSensor<'s> {
    pub fn new(objective: &'s Objective<'s>, steps: &'s Steps, experiments: &[usize]) -> Self {
        let none = OfSensor { sums: [0.0; 4], errors: vec![Run::new(); objective.outputs()] };
        let regressors = Regressors::new(experiments.iter().map(|experiment| (objective, *experiment)).collect());
        let of = vec![none; experiments.len()];
        SumOfSensor { regressors, steps, experiments: experiments.to_vec(), of }
    }
}

impl AccumulateLanes for SumOfSensor<'_> {
    type Lane = OfSensor;

    fn add(&mut self, window: &Window) {
        let SumOfSensor { regressors, steps: Steps { output, kind, value, of: steps }, experiments, of } = self;
        regressors.take(window);
        let mut run = vec![];
        for (lane, OfSensor { sums, errors }) in of.iter_mut().enumerate() {
            for (j, errors) in errors.iter_mut().enumerate() {
                run.clear();
                for k in 0..window.samples[lane] {
                    let (roots, slopes) = regressors.at(k * window.outputs() + j);
                    let root = roots[lane];
                    if root <= 0.0 {
                        continue;
                    }
                    let own = if j == *output { slopes[*kind * window.lanes() + lane] } else { 0.0 };
                    let (mut error, mut z) = (window.error(k, j, lane) - own * *value, own);
                    for (c, (step, replaced)) in steps[experiments[lane]].iter().enumerate() {
                        let slope = window.at(k, j, c, lane);
                        error -= slope * step;
                        z -= slope * replaced;
                    }
                    let (error, square) = (root * error, (root * z) * (root * z));
                    let terms = [square, square * square, error * error * square, error * error];
                    sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                    run.push(error);
                }
                errors.add(&run);
            }
        }
    }

    fn lane(&self, lane: usize) -> OfSensor {
        self.of[lane].clone()
    }

    fn append(lane: &mut OfSensor, later: OfSensor) {
        lane.sums.iter_mut().zip(later.sums).for_each(|(sum, later)| *sum += later);
        lane.errors.iter_mut().zip(&later.errors).for_each(|(errors, later)| errors.follow(later));
    }
}
