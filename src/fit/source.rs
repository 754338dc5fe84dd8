//! [`Source`]: model, records and methods of a fit behind one door.
//!
//! What asks through it (the cost, the search, the noise, the covariance, the conclusion) is compiled once, whatever the
//! model; only the loop over the samples is compiled for each. The twenty models of the NIST problems made 1.3 million lines
//! of intermediate code when all of it was generic, and make 0.46 million so.

use super::unknowns::Place;
use crate::dispatch::has_wide;
use crate::error::Failure;
use crate::experiment::{ExperimentOf, Sample};
use crate::fused::Fused;
use crate::integrate::Integrator;
use crate::interval::Hold;
use crate::lanes::Number;
use crate::model::{Kind, Model};
use crate::predict::{Predictor, Seed, Trajectory, Walk, Window};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use crate::weighting::Weighting;
use std::hash::{DefaultHasher, Hash};
use std::ops::Range;
use std::sync::Arc;

/// Why an experiment could not be walked.
pub(crate) enum Halt {
    Failed { sample: usize },
    Cancelled,
}

/// Shown a window; may end the walk.
pub(crate) type Visit<'v> = &'v mut dyn FnMut(&mut Window) -> Result<(), Halt>;

/// What went wrong in an experiment.
pub(crate) enum Located {
    /// The simulation broke there.
    Broken(Failure),
    /// It did not break; there its error is largest.
    Largest(Failure),
}

/// What a fit asks of model and records. A trait for its one implementer, because a trait object is what hides the types.
pub(crate) trait Source: Send + Sync {
    fn kind(&self) -> Kind;

    /// Number of experiments.
    fn experiments(&self) -> usize;

    /// Number of samples of an experiment.
    fn samples(&self, e: usize) -> usize;

    /// Time of a sample (s).
    fn time(&self, e: usize, sample: usize) -> f64;

    /// The names of the outputs.
    fn outputs(&self) -> &'static [&'static str];

    /// The measured values of an output.
    fn measured(&self, e: usize, output: usize, range: Range<usize>, values: &mut [f64]);

    /// Number of gaps in the time of an experiment, and the first of them.
    fn gaps(&self, e: usize) -> Option<(usize, String)>;

    fn is_weighted(&self) -> bool;

    fn weight(&self, e: usize, sample: usize) -> f64;

    /// Shows each window of an experiment: prediction errors in the units of the outputs, and their slopes.
    fn walk(&self, e: usize, place: &Place, seeds: &[Seed], visit: Visit<'_>) -> Result<(), Halt>;

    /// Shows each window of prediction errors; beside one in `every` the errors with a finer step from the state at its
    /// begin, if the integrator has such a step.
    fn compare(
        &self,
        e: usize,
        place: &Place,
        every: usize,
        visit: &mut dyn FnMut(&Window, Option<&Window>),
    ) -> Result<(), Halt>;

    /// The same with a finer step, if there is one, and its description.
    fn refined<'s>(&'s self) -> Option<(Arc<dyn Source + 's>, String)>;

    /// What exactly fails in an experiment that cannot be evaluated; `sample` is where it was noticed.
    fn locate(&self, e: usize, label: &str, place: &Place, sample: usize, sigma: &[f64]) -> Located;

    /// Adds model and data to a fingerprint.
    fn fingerprint(&self, hash: &mut DefaultHasher);
}

/// The source that a fit is made of.
pub(crate) struct Simulated<'a, M: Model, I: Integrator, P: Predictor<M>> {
    pub model: &'a M,
    pub experiments: &'a [ExperimentOf<M>],
    pub integrator: I,
    pub predictor: &'a P,
    pub prepared: &'a [P::Prepared],
    pub weighting: Option<&'a dyn Weighting<M>>,
}

impl<M: Model, I: Integrator, P: Predictor<M>> Simulated<'_, M, I, P> {
    fn state_and_parameters(place: &Place) -> (Of<M::State, f64>, Of<M::Parameters, f64>) {
        (M::State::from_fn(|i| place.x[i]), M::Parameters::from_fn(|j| place.p[j]))
    }

    fn step<'s>(&'s self, e: usize, integrator: &'s I) -> Walk<'s, M, I> {
        Walk::new(self.model, integrator, &self.experiments[e])
    }

    fn trajectory<'s, const N: usize, T: Scalar + Number>(
        &'s self,
        e: usize,
        integrator: &'s I,
        place: &Place,
        seeds: &[Seed],
    ) -> Trajectory<'s, M, I, P, N, T> {
        let (x, p) = Self::state_and_parameters(place);
        Trajectory::new(self.step(e, integrator), self.predictor, &self.prepared[e], x, p, seeds)
    }

    fn walk_in<const N: usize, T: Scalar + Number>(
        &self,
        e: usize,
        place: &Place,
        seeds: &[Seed],
        visit: Visit<'_>,
    ) -> Result<(), Halt> {
        let mut trajectory = self.trajectory::<N, T>(e, &self.integrator, place, seeds);
        let mut window = Window::new(seeds.len(), M::Output::LEN);
        while trajectory.fill(&mut window).map_err(|sample| Halt::Failed { sample })? {
            visit(&mut window)?;
        }
        Ok(())
    }
}

impl<M: Model, I: Integrator, P: Predictor<M>> Source for Simulated<'_, M, I, P> {
    fn kind(&self) -> Kind {
        M::KIND
    }

    fn experiments(&self) -> usize {
        self.experiments.len()
    }

    fn samples(&self, e: usize) -> usize {
        self.experiments[e].len()
    }

    fn time(&self, e: usize, sample: usize) -> f64 {
        self.experiments[e].time(sample)
    }

    fn outputs(&self) -> &'static [&'static str] {
        M::Output::NAMES
    }

    fn measured(&self, e: usize, output: usize, range: Range<usize>, values: &mut [f64]) {
        for (value, y) in values.iter_mut().zip(&self.experiments[e].outputs()[range]) {
            *value = M::Output::into_array(*y).as_ref()[output];
        }
    }

    fn gaps(&self, e: usize) -> Option<(usize, String)> {
        let gaps = self.experiments[e].gaps();
        gaps.first().map(|first| (gaps.len(), first.to_string()))
    }

    fn is_weighted(&self) -> bool {
        self.weighting.is_some()
    }

    fn weight(&self, e: usize, sample: usize) -> f64 {
        self.weighting.map_or(1.0, |weighting| {
            let record = &self.experiments[e];
            let (t, u, y) = (record.time(sample), record.inputs()[sample], record.outputs()[sample]);
            weighting.weight(&Sample { t, u, y })
        })
    }

    fn walk(&self, e: usize, place: &Place, seeds: &[Seed], visit: Visit<'_>) -> Result<(), Halt> {
        // The wide loop is made for the hold that nearly all records have.
        let wide = has_wide() && self.experiments[e].input_hold() == Hold::Zero;
        // A build that is not made for speed is soon compiled: same numbers, more passes.
        #[cfg(debug_assertions)]
        return match (seeds.len(), wide) {
            (0, _) => self.walk_in::<0, f64>(e, place, seeds, visit),
            (_, false) => self.walk_in::<4, f64>(e, place, seeds, visit),
            (_, true) => self.walk_in::<4, Fused>(e, place, seeds, visit),
        };
        #[cfg(not(debug_assertions))]
        match (seeds.len(), wide) {
            (0, _) => self.walk_in::<0, f64>(e, place, seeds, visit),
            (1..=4, false) => self.walk_in::<4, f64>(e, place, seeds, visit),
            (5 | 6 | 9..=12, false) => self.walk_in::<6, f64>(e, place, seeds, visit),
            (_, false) => self.walk_in::<8, f64>(e, place, seeds, visit),
            (1..=4, true) => self.walk_in::<4, Fused>(e, place, seeds, visit),
            (5 | 6 | 9..=12, true) => self.walk_in::<6, Fused>(e, place, seeds, visit),
            (_, true) => self.walk_in::<8, Fused>(e, place, seeds, visit),
        }
    }

    fn compare(
        &self,
        e: usize,
        place: &Place,
        every: usize,
        visit: &mut dyn FnMut(&Window, Option<&Window>),
    ) -> Result<(), Halt> {
        let refined = self.integrator.refined(M::KIND);
        let mut coarse = self.trajectory::<0, f64>(e, &self.integrator, place, &[]);
        let mut fine = refined.as_ref().map(|refined| self.trajectory::<0, f64>(e, refined, place, &[]));
        let (mut window, mut finer) = (Window::new(0, M::Output::LEN), Window::new(0, M::Output::LEN));
        for number in 0.. {
            let fine = fine.as_mut().filter(|_| number % every == 0);
            let refilled = fine.is_some_and(|fine| {
                fine.restart_at(&coarse);
                matches!(fine.fill(&mut finer), Ok(true))
            });
            if !coarse.fill(&mut window).map_err(|sample| Halt::Failed { sample })? {
                break;
            }
            visit(&window, refilled.then_some(&finer));
        }
        Ok(())
    }

    fn refined<'s>(&'s self) -> Option<(Arc<dyn Source + 's>, String)> {
        let integrator = self.integrator.refined(M::KIND)?;
        let name = integrator.describe(M::KIND);
        Some((Arc::new(Simulated { integrator, ..*self }), name))
    }

    fn locate(&self, e: usize, label: &str, place: &Place, sample: usize, sigma: &[f64]) -> Located {
        let walk = self.step(e, &self.integrator);
        let record = walk.experiment;
        let (start, p) = Self::state_and_parameters(place);
        let failure = |k: usize, signal: String, value: f64, hint: &'static str| Failure {
            experiment: label.to_owned(),
            sample: k,
            time: record.time(k),
            signal,
            value,
            hint,
        };
        let broken = |k, signal, value, hint| Located::Broken(failure(k, signal, value, hint));
        let unsound = |values: &[f64]| {
            let i = values.iter().position(|v| !v.is_finite())?;
            Some((i, values[i], if values[i].is_nan() { UNDEFINED } else { OVERFLOW }))
        };
        let runaway = |x: Of<M::State, f64>| {
            let x = M::State::into_array(x);
            x.as_ref().iter().copied().enumerate().find(|(_, x)| x.abs() >= RUNAWAY)
        };
        let (mut x, mut memory) = (start, I::Memory::default());
        // The error that costs most, in standard deviations.
        let mut largest = (sample, 0, 0.0f64);
        for k in 0..record.len() {
            let state = match self.predictor.state(&walk, &self.prepared[e], k, x, &p, &mut memory) {
                Ok(Some(state)) => state,
                Ok(None) => continue,
                Err(_) => {
                    let before = k.saturating_sub(1);
                    if let Some((i, value)) = runaway(x) {
                        return broken(before, format!("state `{}`", M::State::NAMES[i]), value, OVERFLOW);
                    }
                    let slope = self.model.derivative(record.time(before), &x, &record.inputs()[before], &p);
                    return match unsound(M::State::into_array(slope).as_ref()) {
                        Some((i, value, hint)) => {
                            broken(before, format!("the derivative of state `{}`", M::State::NAMES[i]), value, hint)
                        }
                        None => broken(before, "the progress of the integrator".to_owned(), 0.0, STUCK),
                    };
                }
            };
            if let Some((i, value, hint)) = unsound(M::State::into_array(state).as_ref()) {
                let hint = if runaway(x).is_some() { OVERFLOW } else { hint };
                return broken(k, format!("state `{}`", M::State::NAMES[i]), value, hint);
            }
            if P::CARRIES {
                x = state;
            }
            let y = M::Output::into_array(self.model.output(record.time(k), &state, &record.inputs()[k], &p));
            let found = M::Output::into_array(record.outputs()[k]);
            for (j, (&y, &found)) in y.as_ref().iter().zip(found.as_ref()).enumerate() {
                // What was not measured need not be predicted in a fit; where a prediction was asked for, it stopped here.
                if !y.is_finite() && (!found.is_nan() || k == sample) {
                    let hint = if y.is_nan() { UNDEFINED } else { OVERFLOW };
                    return broken(k, format!("output `{}`", M::Output::NAMES[j]), y, hint);
                }
                if ((found - y) / sigma[j]).abs() > (largest.2 / sigma[largest.1]).abs() {
                    largest = (k, j, found - y);
                }
            }
        }
        let (k, j, error) = largest;
        Located::Largest(failure(k, format!("the error of output `{}`", M::Output::NAMES[j]), error, HUGE))
    }

    fn fingerprint(&self, hash: &mut DefaultHasher) {
        std::any::type_name::<M>().hash(hash);
        (M::Parameters::NAMES, M::State::NAMES, M::Input::NAMES, M::Output::NAMES).hash(hash);
        let mut bits = |value: f64| value.to_bits().hash(hash);
        for record in self.experiments {
            for k in 0..record.len() {
                bits(record.time(k));
                M::Input::into_array(record.inputs()[k]).into_iter().for_each(&mut bits);
                M::Output::into_array(record.outputs()[k]).into_iter().for_each(&mut bits);
            }
        }
        for record in self.experiments {
            (record.name(), record.len(), format!("{:?}{:?}", record.input_hold(), record.initial_state())).hash(hash);
        }
        let weighting = self.weighting.map(|weighting| weighting.describe());
        (weighting, self.integrator.describe(M::KIND), self.predictor.describe()).hash(hash);
    }
}

/// A state as large as this is about to overflow; a method then gets stuck, or computes infinity less infinity.
const RUNAWAY: f64 = 1e100;

const STUCK: &str = "; no step is short enough, or 100,000 of them do not reach the next sample: the model is too stiff for \
                     the method, jumps, or leaves its domain (take Esdirk, or smooth the model)";
const UNDEFINED: &str = "; the equations are undefined there (a division by zero, a root or logarithm out of its domain, \
                         or the `derivative` or `next` that Model::KIND asks for was not written): bound the parameters \
                         or start elsewhere";
pub(super) const OVERFLOW: &str = "; the simulation overflows (an unstable model, or a step too long for its dynamics): \
                                   bound the parameters, take a shorter step or a stiff method, or predict over a shorter \
                                   horizon";
const HUGE: &str = ", whose square overflows: check the units of the record, the noise levels and the start";
