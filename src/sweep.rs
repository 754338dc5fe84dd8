//! [`Sweep`]: runs pieces of records through a model, with slopes, and returns prediction errors window by window.
//!
//! The implementers of this trait depend on the model's type and on how its equations are evaluated. Its callers
//! (search, noise, covariance, diagnoses) are not generic: they know quantities by position.

mod affine;
mod duals;
mod failure;
mod filtered;
mod loops;
mod made;
mod model_code;
mod programs;
mod rest;
mod states;
mod window;

pub(crate) use duals::DualSweep;
pub(crate) use failure::OVERFLOW;
pub(crate) use loops::Loops;
pub(crate) use made::{compiled, of_equations};
pub(crate) use model_code::{Evaluated, ModelCode, Typed};
pub(crate) use programs::{Derived, Interleaved, ProgramSweep};
pub use states::States;
pub use window::Window;

pub use crate::graph::Seed;
pub use crate::predict::{Guess, Unstable};
pub use rest::{Change, NotAtRest};

use crate::equations::{Diffusion, Term};
use crate::error::{Error, Failure};
use crate::layout::Layout;
use crate::predict::GivenNoise;
use crate::record::{Lengths, Record};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// Quantities that a sweep computes from a record before the search.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// The measured state at each sample, sample by sample, where predictions restart from it; NaN where there is none.
    pub restarts: Vec<f64>,
    /// Columns that programs compute from the record alone.
    pub(crate) derived: Derived,
    /// Columns of records that programs run side by side.
    pub(crate) interleaved: Interleaved,
    /// The lengths of its intervals, where they are crossed exactly.
    pub(crate) lengths: Arc<OnceLock<Lengths>>,
    /// The samples at which an output was not measured, where covariances may settle.
    pub(crate) missing: Arc<OnceLock<Vec<usize>>>,
}

impl Prepared {
    /// The lengths of the intervals of its record.
    pub(crate) fn lengths(&self, record: &Record) -> &Lengths {
        self.lengths.get_or_init(|| Lengths::of(record))
    }

    /// Whether one of these samples of its record misses a measurement.
    pub(crate) fn misses(&self, record: &Record, samples: Range<usize>) -> bool {
        let is_missing = |k: &usize| record.outputs().iter().any(|output| output.values[*k].is_nan());
        let missing = self.missing.get_or_init(|| (0..record.len()).filter(is_missing).collect());
        let first = missing.partition_point(|sample| *sample < samples.start);
        missing.get(first).is_some_and(|sample| *sample < samples.end)
    }
}

/// Consecutive samples of a record, with the carry at the first of them.
#[derive(Clone, Debug)]
pub struct Piece<'a> {
    /// The record.
    pub record: &'a Record,
    /// The quantities that [`Sweep::prepare`] has computed from it.
    pub prepared: &'a Prepared,
    /// Its samples.
    pub samples: Range<usize>,
    /// The carry at the first of them.
    pub carry: Cow<'a, [f64]>,
    /// Slopes of the carry there with respect to the seeds, row by row.
    pub slopes: Cow<'a, [f64]>,
    /// The parameters.
    pub parameters: &'a [f64],
}

impl Piece<'_> {
    /// This piece, with its carry lent.
    pub(crate) fn lent(&self) -> Piece<'_> {
        let (carry, slopes) = (Cow::Borrowed(&*self.carry), Cow::Borrowed(&*self.slopes));
        Piece { samples: self.samples.clone(), carry, slopes, ..*self }
    }
}

/// The carry at the end of a piece: at the sample after its last one, where there is one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reached {
    /// The carry.
    pub carry: Vec<f64>,
    /// Its slopes with respect to the seeds, row by row.
    pub slopes: Vec<f64>,
}

impl Reached {
    /// As it would be after changes of the quantities of the seeds; the slopes stay.
    pub(crate) fn moved(&self, change: &[f64]) -> Self {
        let moved = |row: &[f64]| row.iter().zip(change).map(|(s, d)| s * d).sum::<f64>();
        let rows = self.slopes.chunks_exact(change.len().max(1)).map(moved).chain(std::iter::repeat(0.0));
        Reached {
            carry: self.carry.iter().zip(rows).map(|(x, moved)| x + moved).collect(),
            slopes: self.slopes.clone(),
        }
    }
}

/// Why a piece was not run to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunError {
    /// The sample that could not be reached or predicted.
    Failed {
        /// Its number.
        sample: usize,
    },
    /// The function that is called with each window asked to stop.
    Stopped,
}

/// Why there is no carry at the first sample of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoStart {
    /// The plant has no stationary covariance.
    Unstable(Unstable),
    /// It has no state of rest.
    NotAtRest(NotAtRest),
}

impl From<Unstable> for NoStart {
    fn from(unstable: Unstable) -> Self {
        NoStart::Unstable(unstable)
    }
}

impl From<NotAtRest> for NoStart {
    fn from(moving: NotAtRest) -> Self {
        NoStart::NotAtRest(moving)
    }
}

/// How a piece depends on the piece before it in the same record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coupling {
    /// The record must be run as a whole.
    Uncut,
    /// Each sample is predicted from measurements: nothing is carried from piece to piece.
    Restarted,
    /// The carry at the end of a piece is an affine function of that at its begin.
    Affine,
    /// It is some function of it.
    Nonlinear,
}

/// A sweep of equations with terms that they might lack: each has a further parameter, the factor of it.
#[derive(Clone)]
pub struct Lacking<'s> {
    pub(crate) sweep: Arc<dyn Sweep + 's>,
    pub(crate) terms: Vec<Term>,
    /// How many terms more there would be.
    pub(crate) left_out: usize,
}

/// A sweep of equations without their process noise, and what makes that up.
pub struct Undisturbed<'s> {
    pub(crate) sweep: Arc<dyn Sweep + 's>,
    pub(crate) diffusion: Diffusion,
}

/// Called with each window; returns false to stop.
pub(crate) type Visit<'v> = &'v mut dyn FnMut(&mut Window) -> bool;

/// Evaluates a model along records.
pub trait Sweep: Send + Sync {
    /// The model's quantities.
    fn layout(&self) -> &Layout;

    /// Length of the carry: the numbers that are passed from sample to sample, states first.
    fn carry(&self) -> usize {
        self.layout().states.len()
    }

    /// Whether windows hold variances.
    fn predicts_variance(&self) -> bool {
        false
    }

    /// How many samples lie between a prediction and the measured state that it restarts from; `None` where predictions
    /// do not restart.
    fn restarts(&self) -> Option<usize> {
        None
    }

    /// How many pieces of records like this one run in parallel lanes. [`run`](Sweep::run) is never given more, nor
    /// pieces of records that differ in their holds or in their kind of time.
    fn lanes(&self, record: &Record, seeds: &[Seed]) -> usize {
        let _ = (record, seeds);
        1
    }

    /// How pieces of a record depend on each other.
    fn coupling(&self) -> Coupling {
        Coupling::Uncut
    }

    /// The parameters that decide a choice of the model: an `if`, a limit, an absolute value, a place in a table. `None` where that is not
    /// known.
    fn choosing(&self) -> Option<&[usize]> {
        None
    }

    /// The parameters that stand in the noise of the model alone, as far as that is known: a simulation does not depend on them.
    fn levels(&self) -> &[usize] {
        &[]
    }

    /// Those of the [`levels`](Self::levels) on whose sign no variance depends.
    fn scales(&self) -> &[usize] {
        &[]
    }

    /// Prepares a record, once, with the parameters at their start values.
    ///
    /// # Errors
    /// A record that the predictor cannot predict.
    fn prepare(&self, record: &Record, parameters: &[f64]) -> Result<Prepared, Error> {
        let _ = (record, parameters);
        Ok(Prepared::default())
    }

    /// The carry at the first sample from the initial state, and its slopes with respect to states, then parameters,
    /// row by row.
    ///
    /// # Errors
    /// A plant that is unstable where the predictor cannot start from one that is, or that does not rest where the record begins at rest.
    fn start(&self, record: &Record, state: &[f64], parameters: &[f64]) -> Result<Reached, NoStart> {
        let _ = record;
        Ok(unmoved(state, parameters))
    }

    /// Which states follow from the parameters at the first sample of a record, and are no unknowns.
    fn follows(&self, record: &Record, parameters: &[f64]) -> Vec<bool> {
        let _ = (record, parameters);
        vec![false; self.layout().states.len()]
    }

    /// Runs pieces in parallel lanes and calls `visit` with each window.
    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>>;

    /// The carry at the samples `at`, in ascending order, of a record that is run from its begin.
    ///
    /// # Errors
    /// The sample that could not be reached.
    fn follow(&self, piece: &Piece<'_>, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        follow(&mut |from| self.run(std::slice::from_ref(from), &[], &mut |_| true), piece, at)
    }

    /// The state that follows from the outputs of a sample, whatever the parameters.
    ///
    /// # Errors
    /// Why the outputs do not determine the state.
    fn measured_state(&self, record: &Record, sample: usize, parameters: &[f64]) -> Result<Vec<f64>, String> {
        let _ = (record, sample, parameters);
        Err("the sweep does not solve outputs for states".to_owned())
    }

    /// Of a filter, the constant covariance at samples like this one, with its slopes: what is carried after the state. `None` where there is none, and
    /// where the one in `carry` differs by more than this part.
    fn settled(&self, piece: &Piece<'_>, seeds: &[Seed], sample: usize, carry: &[f64], part: f64) -> Option<Reached> {
        let _ = (piece, seeds, sample, carry, part);
        None
    }

    /// A start for the state at the first sample, from the first measurement of each output.
    ///
    /// # Errors
    /// Equations that are undefined where the state is sought.
    fn guessed_state(&self, record: &Record, parameters: &[f64]) -> Result<Guess, String> {
        let _ = (record, parameters);
        let n = self.layout().states.len();
        Ok(Guess { state: vec![0.0; n], open: vec![true; n], sizes: vec![None; n] })
    }

    /// The slopes of the derivative of a continuous model's state with respect to the state, row by row, at a state and the
    /// inputs of a sample; `None` of other models, and where a sweep does not give them.
    fn state_slopes(&self, record: &Record, sample: usize, state: &[f64], parameters: &[f64]) -> Option<Vec<f64>> {
        let _ = (record, sample, state, parameters);
        None
    }

    /// The slopes of the state after a sample of a model whose samples change it ([`Model::jump`](crate::Model::jump)), row by row; `None` of others,
    /// and where a sweep does not give them.
    fn jump_slopes(&self, record: &Record, sample: usize, state: &[f64], parameters: &[f64]) -> Option<Vec<f64>> {
        let _ = (record, sample, state, parameters);
        None
    }

    /// The dead time of each input that has one (s); empty if none has.
    fn late(&self, parameters: &[f64]) -> Vec<Option<f64>> {
        let _ = parameters;
        vec![]
    }

    /// The exact cause of a failure that was noticed at `sample`: an `Err` where the simulation cannot go on. Where nothing fails,
    /// the error that is largest relative to the noise levels. `None` if `stops` returns true.
    fn locate(
        &self,
        record: &Record,
        state: &[f64],
        parameters: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Option<Result<Failure, Failure>> {
        let _ = (record, state, parameters, sample, sigma, stops);
        None
    }

    /// Whether the integrator chooses its steps by a tolerance, so that the cost jumps where their number changes.
    fn is_adaptive(&self) -> bool {
        false
    }

    /// Whether its equations are linear with constant coefficients, so that they can be run without an error of the step.
    fn is_linear(&self) -> bool {
        false
    }

    /// This sweep with a finer step, if there is one, to run so many samples: whether its equations are worth compiling depends on
    /// their number.
    fn refined<'s>(&'s self, samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let _ = samples;
        None
    }

    /// Of predictions that measurements correct: the simulation by the same equations and method, to run so many samples.
    fn simulating<'s>(&'s self, samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let _ = samples;
        None
    }

    /// The extended filter of the same equations and method with these levels of noise; `None` where the slopes of the equations are not known.
    fn filtering<'s>(&'s self, noise: &GivenNoise) -> Option<Arc<dyn Sweep + 's>> {
        let _ = noise;
        None
    }

    /// The states of a record by a filter of process noise, from the carry at the first sample: after each sample's measurements, or `smoothed` by all of
    /// them; `None` of other predictors. The error is the sample that could not be reached or predicted.
    fn states(
        &self,
        record: &Record,
        carry: &[f64],
        parameters: &[f64],
        smoothed: bool,
    ) -> Option<Result<States, usize>> {
        let _ = (record, carry, parameters, smoothed);
        None
    }

    /// Whether it is a filter that takes a model by its slopes at a state on which choices of the model depend.
    fn linearizes_choices(&self) -> bool {
        false
    }

    /// Of a filter of first order, where the model is not affine in its state: the same to the second order.
    fn second_order<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> {
        None
    }

    /// Of a predictor that takes process noise, or of a simulation: the same with terms that the equations might lack; `None` where these are not
    /// known.
    fn with_terms<'s>(&'s self) -> Option<Lacking<'s>> {
        None
    }

    /// Of a predictor that takes process noise: the same without it. Which of the parameters are its levels depends on which are free, and on the
    /// values of the others. `None` where the equations are not known.
    fn undisturbed<'s>(&'s self, parameters: &[f64], free: &[bool]) -> Option<Undisturbed<'s>> {
        let _ = (parameters, free);
        None
    }

    /// Description of the integrator and its settings.
    fn integrator(&self) -> String;

    /// Description of the predictor and its settings.
    fn predictor(&self) -> String;

    /// Description of how the equations are evaluated, with the reason.
    fn engine(&self) -> String;

    /// Text that identifies the equations; part of a checkpoint's fingerprint.
    fn identity(&self) -> String;
}

/// The state as the carry at the first sample, with its slopes with respect to states, then parameters.
fn unmoved(state: &[f64], parameters: &[f64]) -> Reached {
    let width = state.len() + parameters.len();
    let mut slopes = vec![0.0; state.len() * width];
    slopes.iter_mut().step_by(width + 1).for_each(|slope| *slope = 1.0);
    Reached { carry: state.to_vec(), slopes }
}

/// The carry at some samples, by runs from one to the next. Not a part of the trait, so that it is compiled once.
fn follow(
    run: &mut dyn FnMut(&Piece<'_>) -> Vec<Result<Reached, RunError>>,
    piece: &Piece<'_>,
    at: &[usize],
) -> Result<Vec<Vec<f64>>, RunError> {
    let mut from = Piece { slopes: Cow::default(), ..piece.lent() };
    let mut found = Vec::with_capacity(at.len());
    for &sample in at {
        from.samples.end = sample;
        if !from.samples.is_empty() {
            from.carry = run(&from).into_iter().next().ok_or(RunError::Stopped)??.carry.into();
        }
        from.samples.start = sample;
        found.push(from.carry.to_vec());
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::Reached;

    /// To the first order: `x + sum s d`; without slopes, and without unknowns, it stays.
    #[test]
    fn a_carry_moves_along_its_slopes() {
        let (carry, slopes) = (vec![1.0, 2.0], vec![1.0, -2.0, 3.0, 0.5]);
        let reached = Reached { carry: carry.clone(), slopes: slopes.clone() };
        assert_eq!(reached.moved(&[10.0, 4.0]), Reached { carry: vec![3.0, 34.0], slopes });
        let plain = Reached { slopes: vec![], ..reached };
        assert_eq!([plain.moved(&[10.0, 4.0]).carry, plain.moved(&[]).carry], [carry.clone(), carry]);
    }
}
