//! Running a problem: search, estimate at a given point, objective, prediction, states.

use super::further::{self, leaves_unexplained};
use super::moves::{LEAST_NOISE, Moves};
use super::predict::asked;
use super::refine::{Attempt, Start, after, with_work_of};
use super::search::{at_end, search, settled};
use super::staged::{after_stages, noted};
use super::stages::Led;
use super::start_error::start_error;
use super::starts::search_from_many;
use crate::covariance::SearchEnd;
use crate::error::Error;
use crate::estimate::{OutputEstimate, Summary};
use crate::judge::conclude;
use crate::optimize::{Domain, LeastSquares, LevenbergMarquardt, Outcome};
use crate::problem::{Control, Lead, Objective, Problem, SearchPlan, Settings, Simulated, Whitening, noise};
use crate::record::Record;
use crate::sweep::States;
use std::time::Instant;

/// Most trial steps of the search by the default step after a fit by the exact transition: a search that the data of that step lead to its minimum takes some
/// ten to twenty.
const COARSER_TRIALS: u64 = 50;

static NEVER: Control = Control::NEVER;

impl Problem<'_> {
    /// Estimates the unknowns and their uncertainty.
    ///
    /// A search that does not converge is an outcome of the estimate, not an error.
    ///
    /// # Errors
    /// A start that cannot be simulated, a checkpoint that cannot be read.
    pub fn run(&self) -> Result<Summary, Error> {
        self.run_since(Instant::now())
    }

    /// [`run`](Self::run) with a time limit that counts from `begin`. A default method whose step moves the answer, or with which the start
    /// cannot be simulated, is followed by finer ones. For linear equations whose cost at the start the default step decides, the fit begins with their exact
    /// transition.
    pub(super) fn run_since(&self, begin: Instant) -> Result<Summary, Error> {
        let control = self.control(begin);
        match self.crossed(&control) {
            Some(exact) => {
                let found = exact.run_by_methods(begin, &control)?;
                self.with_coarser(found, begin, &control)
            }
            None => self.run_by_methods(begin, &control),
        }
    }

    /// This problem with the exact transition of linear equations, where the default step decides the cost at the start.
    fn crossed(&self, control: &Control) -> Option<Problem<'_>> {
        let start = self.unknowns.start();
        let wrong = || self.in_units(control).step_decides(&start).unwrap_or(true);
        if self.finer.is_none() || !self.sweep.is_linear() || !wrong() {
            return None;
        }
        let exact = self.finer(0).filter(|finer| finer.steps == 1 && !finer.sweep.is_adaptive())?;
        exact.in_units(control).cost_at(&start).ok()?;
        Some(Problem { settings: self.settings.clone(), ..exact.clone() })
    }

    /// An estimate by the exact transition, with a note where a search by the default step explains the data better, or as well. Where that search reproduces
    /// the data to their rounding they were simulated with this step, and its estimate is taken. It begins at the exact estimate, or at the declared
    /// start if that is no minimum.
    fn with_coarser(&self, found: Summary, begin: Instant, control: &Control) -> Result<Summary, Error> {
        let trials = self.settings.optimizer.most().saturating_sub(found.iterations).min(COARSER_TRIALS);
        if trials == 0 || found.outcome == Outcome::Exact || control.stops() {
            return Ok(found);
        }
        let coordinates = if found.outcome.converged() { found.coordinates() } else { self.unknowns.start() };
        let settings = Settings { searches: SearchPlan::Single, checkpoint: None, ..self.settings.clone() };
        let start = Start { coordinates, trials, ends: None, stages: None };
        match (Problem { settings, ..self.clone() }).run_within(begin, control, start) {
            Ok(coarser) if coarser.outcome == Outcome::Exact => Ok(after(&found, coarser)),
            Ok(coarser) => Attempt::new(Ok(with_work_of(found, &coarser))).beside(&coarser).answer(),
            Err(_) => Ok(found),
        }
    }

    /// The estimate by this method, or by a finer one, and by further searches where it leaves an output unexplained.
    fn run_by_methods(&self, begin: Instant, control: &Control) -> Result<Summary, Error> {
        let (found, led) = self.run_first(begin, control);
        // Before finer methods, each of which takes several times as long.
        let explained = led.as_ref().is_some_and(Led::explains);
        let further = found.as_ref().ok().filter(|_| !explained);
        let further = further.and_then(|found| self.search_further(found, control));
        let found = found.map(|found| further::with_work_of(found, further.as_ref()));
        let found = match further.as_ref().zip(found.as_ref().ok()).and_then(|(further, found)| further.usable(found)) {
            Some(usable) => usable,
            None => self.or_in_stages(self.refined(found, 0, begin, control), control)?,
        };
        // Pieces that are explained have an estimate of their own.
        let found = match explained && leaves_unexplained(&found) {
            true => found,
            false => self.searched_elsewhere(&found, further.as_ref(), control).unwrap_or(found),
        };
        let led = led.as_ref().or(further.as_ref().and_then(|further| further.led()));
        Ok(self.or_by_pieces(found, led, control))
    }

    /// The estimate from the declared start, or from the end of stages if they were asked for.
    fn run_first(&self, begin: Instant, control: &Control) -> (Result<Summary, Error>, Option<Led>) {
        let (start, note) = self.first_start(control);
        let led = start.stages.clone();
        let found = self.run_from(start, begin, control);
        let found = found.map(|found| self.shot_further(&found, led.as_ref(), control).unwrap_or(found));
        (found.map(|found| noted(found, note)), led)
    }

    fn run_from(&self, start: Start, begin: Instant, control: &Control) -> Result<Summary, Error> {
        match self.run_within(begin, control, start.clone()) {
            // Stages that were stopped leave no time to evaluate their end, which is the best point so far; the first evaluation of many starts, which is
            // one for all, may take longer than the limit.
            Err(_) if self.takes_long_to_begin() && control.stops() => {
                let settings = Settings { searches: SearchPlan::Single, ..self.settings.clone() };
                let problem = Problem { settings, ..self.clone() };
                let found = problem.run_within(begin, &NEVER, Start { trials: 1, ..start })?;
                Ok(Summary { outcome: control.named(Outcome::Cancelled), ..found })
            }
            found => found,
        }
    }

    fn takes_long_to_begin(&self) -> bool {
        self.settings.lead != Lead::Declared || self.settings.searches.count() > 1
    }

    /// The estimate by a method, numbered as in [`by_method`](Self::by_method), or by a finer one, as long as a finer step would
    /// move an unknown.
    pub(super) fn refined(
        &self,
        found: Result<Summary, Error>,
        method: usize,
        begin: Instant,
        control: &Control,
    ) -> Result<Summary, Error> {
        let mut attempt = Attempt::new(found);
        for finer in self.by_method().skip(method + 1) {
            if !attempt.is_coarse() || control.stops() {
                break;
            }
            let most = self.settings.optimizer.most();
            if let Some(start) = attempt.start(finer, most, control) {
                let trials = start.trials;
                let again = finer.run_on(finer.run_within(begin, control, start), trials, begin, control);
                let again = attempt.again_from_start(finer, (again, most), begin, control);
                attempt = attempt.or(again, finer.sweep.is_adaptive());
            }
        }
        attempt.answer()
    }

    /// The estimate by this method alone, from this start.
    pub(super) fn run_within(&self, begin: Instant, control: &Control, start: Start) -> Result<Summary, Error> {
        let settings = &self.settings;
        settings.optimizer.check()?;
        let (plain, optimizer) = (self.in_units(control), settings.optimizer.limited(start.trials));
        let end = match settings.searches.count() {
            1 => SearchEnd { starts: start.ends, ..search(&plain, &optimizer, start.coordinates)? },
            count => search_from_many(&plain, &optimizer, count, start.ends.as_ref())?,
        };
        let end = settled(&plain, end);
        let found = conclude(&at_end(&plain, &end), &end, begin.elapsed().as_secs_f64())?;
        Ok(after_stages(found, start.stages.as_ref()))
    }

    /// The stop conditions of a run that began then: flag and time limit.
    pub(crate) fn control(&self, begin: Instant) -> Control {
        let deadline = self.settings.time_limit.and_then(|limit| begin.checked_add(limit));
        Control { cancel: self.settings.cancel.clone(), deadline }
    }

    /// The cost to minimize, for argmin's solvers. Noise levels that were not given are estimated from the errors at
    /// the start.
    ///
    /// # Errors
    /// A start that cannot be simulated.
    pub fn objective(&self) -> Result<Objective<'_>, Error> {
        let (plain, start) = (self.in_units(&NEVER), self.unknowns.start());
        let found = noise::first_whitening(&plain, &start);
        let (whitening, _) = found.map_err(|error| start_error(&plain, &start, error))?;
        Ok(plain.with(whitening))
    }

    /// The estimate at a point that another solver has found; its outcome states whether the point is a minimum.
    ///
    /// # Errors
    /// A point of another length, or one that cannot be simulated.
    pub fn estimate(&self, coordinates: &[f64]) -> Result<Summary, Error> {
        self.estimate_at(coordinates, "search by argmin")
    }

    /// The estimate at a point that this has found.
    pub(super) fn estimate_at(&self, coordinates: &[f64], by: &str) -> Result<Summary, Error> {
        let begin = Instant::now();
        let expected = self.unknowns.row.len();
        if coordinates.len() != expected {
            let found = coordinates.len();
            return Err(Error::Option(format!(
                "the point has {found} coordinates, but the fit has {expected} unknowns"
            )));
        }
        let objective = self.objective()?;
        let linear = objective.linearize(coordinates).map_err(|error| start_error(&objective, coordinates, error))?;
        let outcome = LevenbergMarquardt::default().judge(coordinates, &linear, &Domain::of(&objective));
        let whitening = match noise::is_estimated(&objective) {
            true => noise::estimate(&objective, coordinates).unwrap_or_else(|_| objective.whitening.clone()),
            false => objective.whitening.clone(),
        };
        let end = SearchEnd {
            coordinates: coordinates.to_vec(),
            whitening: whitening.clone(),
            linear: None,
            outcome,
            iterations: 0,
            evaluations: 1,
            name: by.to_owned(),
            write_error: None,
            memory: objective.memory.clone(),
            starts: None,
        };
        conclude(&objective.with(whitening), &end, begin.elapsed().as_secs_f64())
    }

    /// The cost with the estimated noise of an estimate of this problem, and the coordinates of that estimate.
    ///
    /// # Errors
    /// An estimate of another problem.
    pub(crate) fn at(&self, estimate: &Summary) -> Result<(Objective<'_>, Vec<f64>), Error> {
        // The search's stop conditions do not apply to the evaluation of its result.
        self.at_within(estimate, &NEVER)
    }

    /// [`at`](Self::at) for further searches, with their own stop conditions.
    ///
    /// # Errors
    /// An estimate of another problem.
    pub(crate) fn at_within<'p>(
        &'p self,
        estimate: &Summary,
        control: &'p Control,
    ) -> Result<(Objective<'p>, Vec<f64>), Error> {
        self.check_estimate(estimate)?;
        let problem = self.by_number(estimate.method.refinement);
        let sigma = estimate.sigma();
        let full = estimate.noise_covariance.clone().and_then(Whitening::full);
        // An output without any error gives no noise level.
        let noisy = sigma.iter().all(|sigma| *sigma > 0.0);
        // Errors of predicted variance are divided by that, whatever these are.
        let whitening = match noisy {
            true => full.unwrap_or(Whitening::Diagonal(sigma)),
            false => problem.objective()?.whitening,
        };
        Ok((problem.in_units(control).with(whitening), estimate.coordinates()))
    }

    /// Whether this model predicts these records with an estimate as well as the estimate says: the root mean square error of each output is the same, up to
    /// a part of 1e-4. If not, the estimate is of another model, of other records or of other options. Not compared, and true, with weights or a pre-filter,
    /// which count errors differently.
    ///
    /// # Errors
    /// An estimate with other unknowns, or with which these records cannot be predicted.
    pub fn reproduces(&self, estimate: &Summary) -> Result<bool, Error> {
        // Rounding on another processor changes errors by less; those of another record of 2,000 samples with equal noise differ by a part of 0.02.
        const APART: f64 = 1e-4;
        if self.settings.weights.is_some() || self.settings.prefilter.is_some() {
            return Ok(true);
        }
        let (objective, x) = self.at(estimate)?;
        let errors = noise::errors(&objective, &x).map_err(|error| start_error(&objective, &x, error))?;
        let moves = |j: usize| Moves::of(self.records.iter().map(|record| (record, &record.outputs()[j]))).half;
        let is_same = |(j, (found, output)): (usize, (f64, &OutputEstimate))| {
            (found - output.fit.rmse).abs() <= APART * output.fit.rmse + LEAST_NOISE * moves(j)
        };
        Ok(errors.into_iter().zip(&estimate.outputs).enumerate().all(is_same))
    }

    fn check_estimate(&self, estimate: &Summary) -> Result<(), Error> {
        let row = &self.unknowns.row;
        let same = row.len() == estimate.unknowns.len()
            && row.iter().zip(&estimate.unknowns).all(|(mine, its)| mine.name == its.name);
        if !same {
            let names: Vec<&str> = estimate.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
            return Err(Error::Option(format!(
                "the estimate is of another problem: it has the unknowns {}, the problem has {}",
                names.join(", "),
                self.unknowns().join(", ")
            )));
        }
        let (mine, its) = (&self.records, &estimate.experiments);
        if mine.len() == its.len() && mine.iter().zip(its).all(|(mine, its)| mine.len() as u64 == its.samples) {
            return Ok(());
        }
        Err(Error::Option(format!(
            "the estimate is of other records: it has {:?} samples, the problem has {:?} samples",
            its.iter().map(|one| one.samples).collect::<Vec<_>>(),
            mine.iter().map(|record| record.len()).collect::<Vec<_>>()
        )))
    }

    /// Predicts the outputs of a record with the parameters of an estimate, by the integrator and predictor of this
    /// problem. Free initial states are estimated from the record; the parameters stay fixed.
    ///
    /// # Errors
    /// As [`run`](Self::run), and a simulation that fails.
    pub fn predict(&self, estimate: &Summary, record: &Record) -> Result<Simulated, Error> {
        let problem = self.by_number(estimate.method.refinement);
        asked(problem.sweep.clone(), record, estimate, |objective, at| objective.predict(0, at))
    }

    /// The state of a record after each sample's measurements, by the filter of this problem with the parameters of an estimate, as
    /// [`Fit::filtered`](crate::Fit::filtered).
    ///
    /// # Errors
    /// As [`predict`](Self::predict); a predictor other than [`Kalman`](crate::Kalman) and [`SecondOrder`](crate::SecondOrder).
    pub fn filtered(&self, estimate: &Summary, record: &Record) -> Result<States, Error> {
        let problem = self.by_number(estimate.method.refinement);
        asked(problem.sweep.clone(), record, estimate, |objective, at| objective.states(0, at, false))
    }

    /// The state at each sample by all measurements of the record, as [`Fit::smoothed`](crate::Fit::smoothed).
    ///
    /// # Errors
    /// As [`filtered`](Self::filtered).
    pub fn smoothed(&self, estimate: &Summary, record: &Record) -> Result<States, Error> {
        let problem = self.by_number(estimate.method.refinement);
        asked(problem.sweep.clone(), record, estimate, |objective, at| objective.states(0, at, true))
    }
}
