//! How many passes over the data the verdict takes, counted by a sweep that counts its samples.

use super::conclude;
use crate::covariance::SearchEnd;
use crate::error::{Error, Failure};
use crate::estimate::{CovarianceMethod, Summary};
use crate::layout::Layout;
use crate::pmsm::{Currents, Surface, Winding};
use crate::problem::{Memory, Problem};
use crate::random::Random;
use crate::record::Record;
use crate::sweep::{Coupling, Guess, NoStart, Piece, Prepared, Reached, RunError, Seed, Sweep, Visit};
use crate::{Experiment, Fit, Model, Scalar, Time, free, signals, simulate};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Samples in values, and samples with slopes.
type Counts = Arc<[AtomicUsize; 2]>;

/// A sweep that counts its samples.
struct Counting<'c> {
    sweep: Arc<dyn Sweep + 'c>,
    counts: Counts,
}

#[rustfmt::skip]
impl Sweep for Counting<'_> {
    fn layout(&self) -> &Layout { self.sweep.layout() }
    fn carry(&self) -> usize { self.sweep.carry() }
    fn predicts_variance(&self) -> bool { self.sweep.predicts_variance() }
    fn restarts(&self) -> Option<usize> { self.sweep.restarts() }
    fn lanes(&self, record: &Record, seeds: &[Seed]) -> usize { self.sweep.lanes(record, seeds) }
    fn coupling(&self) -> Coupling { self.sweep.coupling() }
    fn choosing(&self) -> Option<&[usize]> { self.sweep.choosing() }
    fn linearizes_choices(&self) -> bool { self.sweep.linearizes_choices() }
    fn second_order<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> { self.sweep.second_order() }
    fn prepare(&self, record: &Record, p: &[f64]) -> Result<Prepared, Error> { self.sweep.prepare(record, p) }
    fn follows(&self, record: &Record, p: &[f64]) -> Vec<bool> { self.sweep.follows(record, p) }
    fn start(&self, record: &Record, state: &[f64], p: &[f64]) -> Result<Reached, NoStart> { self.sweep.start(record, state, p) }
    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let samples = pieces.iter().map(|piece| piece.samples.len()).sum();
        self.counts[usize::from(!seeds.is_empty())].fetch_add(samples, Ordering::Relaxed);
        self.sweep.run(pieces, seeds, visit)
    }
    fn guessed_state(&self, record: &Record, p: &[f64]) -> Result<Guess, String> { self.sweep.guessed_state(record, p) }
    fn state_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        self.sweep.state_slopes(record, sample, state, p)
    }
    fn jump_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        self.sweep.jump_slopes(record, sample, state, p)
    }
    fn locate(
        &self, record: &Record, state: &[f64], p: &[f64], sample: usize, sigma: &[f64], stops: &dyn Fn() -> bool,
    ) -> Option<Result<Failure, Failure>> {
        self.sweep.locate(record, state, p, sample, sigma, stops)
    }
    fn is_adaptive(&self) -> bool { self.sweep.is_adaptive() }
    fn refined<'s>(&'s self, samples: usize) -> Option<Arc<dyn Sweep + 's>> { self.sweep.refined(samples) }
    fn integrator(&self) -> String { self.sweep.integrator() }
    fn predictor(&self) -> String { self.sweep.predictor() }
    fn engine(&self) -> String { self.sweep.engine() }
    fn identity(&self) -> String { self.sweep.identity() }
}

signals! { struct Voltage { u: "V" } }
signals! { struct Current { i: "A" } }
signals! { struct Rates { a: "1/s", b: "A/(V s)" } }

#[derive(Clone)]
struct Decay;

impl Model for Decay {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Rates;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Rates<S>) -> Current<S> {
        Current { i: p.b * u.u - p.a * x.i }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Rates<S>) -> Current<S> {
        *x
    }
}

const SAMPLES: usize = 400;

/// The verdict on a record with errors of unit noise, with the samples that it takes in values and with slopes.
fn judged(seed: u64, mut error: impl FnMut(f64, f64) -> f64) -> (Summary, [usize; 2]) {
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let inputs: Vec<Voltage> = (0..SAMPLES).map(|k| Voltage { u: if k / 25 % 2 == 0 { 1.0 } else { -1.0 } }).collect();
    let clean =
        simulate(&Decay, &Rates { a: 1.0, b: 2.0 }, &Current { i: 0.5 }, time.clone(), &inputs).unwrap().outputs;
    let mut random = Random::stream(36, seed);
    let mut noisy = |y: &Current| Current { i: y.i + error(y.i, 0.05 * random.normal()) };
    let outputs = clean.iter().map(&mut noisy).collect();
    let record = Experiment::new(&Decay, time, inputs, outputs).unwrap();
    let problem = Fit::new(&Decay, &record).parameters(Rates { a: free(0.8), b: free(1.5) }).problem().unwrap();
    let found = problem.run().unwrap();
    let counts = Counts::default();
    let counting = Counting { sweep: problem.sweep.clone(), counts: counts.clone() };
    let problem = Problem { sweep: Arc::new(counting), ..problem.clone() };
    let (objective, coordinates) = problem.at(&found).unwrap();
    let linear = Some(objective.evaluate(&coordinates).unwrap());
    let end = SearchEnd {
        coordinates,
        whitening: objective.whitening.clone(),
        linear,
        outcome: found.outcome,
        iterations: 0,
        evaluations: 0,
        name: String::new(),
        write_error: None,
        memory: Memory::default(),
        starts: None,
    };
    counts.iter().for_each(|count| count.store(0, Ordering::Relaxed));
    let summary = conclude(&objective, &end, 0.0).unwrap();
    (summary, [0, 1].map(|kind: usize| counts[kind].load(Ordering::Relaxed)))
}

/// White errors take one pass in values and one with slopes; those whose size follows the output one more with slopes, for a sandwich.
#[test]
fn white_errors_take_two_passes() {
    let (summary, passes) = judged(0, |_, normal| normal);
    assert_eq!((summary.method.covariance, passes), (CovarianceMethod::Classical, [SAMPLES, SAMPLES]));
    let (summary, passes) = judged(0, |y, normal| y * normal);
    assert_eq!((summary.method.covariance, passes), (CovarianceMethod::Sandwich, [SAMPLES, 2 * SAMPLES]));
}

/// Colored ones take one more with slopes, for the moving sums of their scores and, if sizes differ, for a sandwich; and one more where parts seem
/// to differ or a sensor to be wrong.
#[test]
fn colored_errors_take_three_passes_with_slopes_at_most() {
    let mut with_slopes = [0; 4];
    for seed in 0..60 {
        let mut before = 0.0;
        let (summary, [values, slopes]) = judged(seed, |_, normal| {
            before = 0.8 * before + normal;
            before
        });
        assert!(matches!(summary.method.covariance, CovarianceMethod::Hac { .. }), "{}", summary.method.covariance);
        assert_eq!((values, slopes % SAMPLES), (SAMPLES, 0), "{seed}");
        with_slopes[slopes / SAMPLES] += 1;
    }
    assert!(with_slopes[2] > 0 && with_slopes[3] > 0 && with_slopes[..2] == [0, 0], "{with_slopes:?}");
}

/// Passes of a motor's fit, in values and with slopes, where the noise is estimated and where it is given.
#[test]
fn noise_that_is_estimated_takes_two_more_passes_at_most() {
    let model = Surface::new(4).unwrap();
    let record = Experiment::from_file(&model, "examples/data/pmsm.csv").unwrap();
    let fit = || Fit::new(&model, &record).parameters(Winding { rs: free(1.2), ls: free(1.75e-3), ke: free(0.63) });
    let passes = |fit: Fit<'_, Surface>| {
        let (problem, counts) = (fit.problem().unwrap(), Counts::default());
        let counting = Counting { sweep: problem.sweep.clone(), counts: counts.clone() };
        let found = Problem { sweep: Arc::new(counting), ..problem.clone() }.run().unwrap();
        assert!(found.outcome.converged());
        let samples = record.len() as f64;
        (found, [0, 1].map(|kind: usize| counts[kind].load(Ordering::Relaxed) as f64 / samples))
    };
    let (found, estimated) = passes(fit());
    let [id, iq] = [0, 1].map(|j: usize| found.outputs[j].fit.sigma);
    let (_, given) = passes(fit().noise(Currents { id, iq }));
    // The estimate states no evaluation that took no pass; one pass with slopes is that of the verdict.
    assert!(found.evaluations as f64 <= estimated[1] - 1.0, "{} {estimated:?}", found.evaluations);
    // Where a search begins, values are simulated for a part of the record.
    assert!(estimated[1] <= given[1] + 2.0 && estimated[0] <= given[0] + 0.5, "{estimated:?} {given:?}");
}
