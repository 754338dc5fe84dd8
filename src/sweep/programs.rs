//! [`ProgramSweep`]: traced models, run as compiled programs, pieces in parallel lanes.

mod band;
mod columns;
mod crossed;
mod derived;
mod horizon;
mod interleaved;
mod key;
mod late;
mod run;
mod settling;
mod workspace;

use super::made::{of_equations, of_equations_in_duals};
use super::{Coupling, Lacking, NoStart, Piece, Prepared, Reached, RunError, Seed, States, Sweep, Undisturbed, Visit};
use crate::engine::{Program, Sampling, Trajectories};
use crate::equations::{Equations, WithTerms};
use crate::error::{Error, Failure};
use crate::graph::Untraceable;
use crate::integrate::{Method, stepped};
use crate::interval::Hold;
use crate::layout::{Kind, Layout};
use crate::predict::{FreeRun, GivenNoise, Guess, Prediction, numbers, recurrence, settled};
use crate::record::{Holds, Initial, Record, Time};
use crate::recurrence::Recurrence;
use crossed::{Crossed, Crossing};
pub(crate) use derived::Derived;
pub(crate) use interleaved::Interleaved;
use key::{Key, Purpose};
use late::Late;
use run::Run;
use settling::Settling;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use workspace::Compiled;

/// Equations run by compiled programs.
pub(crate) struct ProgramSweep<'a> {
    programs: Arc<Programs>,
    /// What the programs have after the parameters.
    numbers: Vec<f64>,
    /// These equations in dual numbers, for all that is not a pass over many samples.
    plain: Arc<dyn Sweep + 'a>,
}

/// Equations by a method, and the programs that were made of them.
struct Programs {
    equations: Arc<Equations>,
    method: Arc<dyn Method>,
    predictor: Arc<dyn Prediction>,
    coupling: Coupling,
    /// By the holds of the inputs.
    recurrences: Mutex<Vec<(Holds, Arc<Recurrence>)>>,
    /// Those that were asked for, with the reason where there can be none.
    compiled: Mutex<Vec<(Key, MaybeCompiled)>>,
    /// The transition that all programs read, of linear equations that are crossed exactly.
    crossed: Option<Arc<Crossed>>,
    /// This sweep with a finer step, if there is one.
    refined: OnceLock<Option<Arc<Programs>>>,
    /// Filters with given levels of noise, if there can be any.
    filtering: OnceLock<Option<Arc<Programs>>>,
    /// The sweep with terms that the equations might lack, made when it is first needed.
    lacking: OnceLock<Option<Lacking<'static>>>,
}

/// A program, or the reason why there is none.
type MaybeCompiled = Result<Arc<Compiled>, String>;

/// Why a record has no program.
const UNEVEN: &str = "inputs have dead times and samples are not evenly spaced";

/// Number of samples that take as long in dual numbers as a program takes to be compiled.
const WORTH_COMPILING: usize = 4_000;

impl<'a> ProgramSweep<'a> {
    /// Compiles the equations, to values and to slopes with respect to all parameters.
    ///
    /// # Errors
    /// Why they cannot be compiled.
    pub fn new(
        equations: Arc<Equations>,
        method: Arc<dyn Method>,
        predictor: Arc<dyn Prediction>,
        plain: Arc<dyn Sweep + 'a>,
    ) -> Result<Self, Untraceable> {
        let numbers = numbers(&equations, &*predictor);
        let programs = Arc::new(Programs::new(equations, method, predictor)?);
        Ok(ProgramSweep { programs, numbers, plain })
    }
}

impl ProgramSweep<'_> {
    /// The parameters of pieces as the programs have them.
    fn parameters(&self, pieces: &[Piece<'_>]) -> Vec<Vec<f64>> {
        pieces.iter().map(|piece| [piece.parameters, &self.numbers].concat()).collect()
    }
}

/// Pieces with other parameters.
fn with_parameters<'p>(pieces: &'p [Piece<'_>], parameters: &'p [Vec<f64>]) -> impl Iterator<Item = Piece<'p>> {
    pieces.iter().zip(parameters).map(|(piece, parameters)| Piece { parameters, ..piece.lent() })
}

impl Programs {
    fn new(
        equations: Arc<Equations>,
        method: Arc<dyn Method>,
        predictor: Arc<dyn Prediction>,
    ) -> Result<Self, Untraceable> {
        let coupling = match predictor.restarts() {
            Some(_) => Coupling::Restarted,
            None if equations.layout().kind == Kind::Static => Coupling::Restarted,
            None if predictor.is_simulation() && equations.is_affine() => Coupling::Affine,
            None => Coupling::Nonlinear,
        };
        let linear = method.is_exact().then(|| equations.linear()).flatten();
        let programs = Programs {
            equations,
            method,
            predictor,
            coupling,
            recurrences: Mutex::default(),
            compiled: Mutex::default(),
            crossed: linear.map(|linear| Arc::new(Crossed::new(linear))),
            refined: OnceLock::new(),
            filtering: OnceLock::new(),
            lacking: OnceLock::new(),
        };
        programs.recurrence(&Holds::All(Hold::Zero))?;
        Ok(programs)
    }

    /// The programs with a finer step, made when they are first needed.
    fn refined(&self) -> Option<Arc<Programs>> {
        let make = || {
            let method = self.method.refined(self.equations.layout().kind)?;
            Programs::new(self.equations.clone(), method, self.predictor.clone()).ok().map(Arc::new)
        };
        self.refined.get_or_init(make).clone()
    }

    fn recurrence(&self, holds: &Holds) -> Result<Arc<Recurrence>, Untraceable> {
        let mut all = self.recurrences.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = all.iter().find(|(known, _)| known == holds) {
            return Ok(known.clone());
        }
        let made = Arc::new(recurrence(&self.equations, &*self.method, &*self.predictor, holds)?);
        all.push((holds.clone(), made.clone()));
        Ok(made)
    }

    /// Filters of such records after their covariances have settled, if they may.
    fn settling(&self, Key { holds, sampling, seeds, purpose, .. }: &Key) -> Option<Settling> {
        self.crossed.as_ref()?;
        let (recurrence, covariance) = settled(&self.equations, &*self.method, &*self.predictor, holds)?;
        match purpose {
            Purpose::Rows => Settling::new(recurrence, covariance, seeds, *sampling, Trajectories::Many),
            Purpose::Carry => {
                Settling::new(recurrence.without_outputs(), covariance, &[], *sampling, Trajectories::One)
            }
        }
    }

    /// The program for records like this one; `None` where there can be none.
    fn program(&self, record: &Record, seeds: &[Seed], purpose: Purpose) -> Option<Arc<Compiled>> {
        let sampling = match record.times() {
            // A run stops where the length of an interval changes that is crossed exactly.
            Time::Stamps(_) if self.crossed.is_none() => Sampling::Irregular,
            _ => Sampling::Uniform,
        };
        let at_rest = *record.initial_state() == Initial::Steady;
        let key = Key { holds: record.holds.clone(), sampling, seeds: seeds.to_vec(), purpose, at_rest };
        let mut compiled = self.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, program)) = compiled.iter().find(|(known, _)| *known == key) {
            return program.clone().ok();
        }
        let recurrence = self.recurrence(&key.holds).ok()?;
        let recurrence = match at_rest {
            true => Arc::new(recurrence.started_at_rest(self.equations.layout().parameters.len())),
            false => recurrence,
        };
        let is_late = self.equations.late().contains(&true);
        let program = match purpose {
            // How often a dead time cuts an interval differs from one to the next.
            _ if is_late && sampling == Sampling::Irregular => Err(UNEVEN.to_owned()),
            Purpose::Rows => Ok(Program::compile(&recurrence, seeds, sampling, Trajectories::Many)),
            Purpose::Carry => Ok(Program::compile(&recurrence.without_outputs(), &[], sampling, Trajectories::One)),
        };
        let program = program.and_then(|program| program.map_err(|too_large| too_large.to_string()));
        let late = is_late.then(|| Late::new(self.equations.clone()));
        let settling = self.settling(&key);
        let program = program.map(|program| Arc::new(Compiled::new(program, late, self.crossed.clone(), settling)));
        compiled.push((key, program.clone()));
        program.ok()
    }
}

impl Sweep for ProgramSweep<'_> {
    fn layout(&self) -> &Layout {
        self.programs.equations.layout()
    }

    fn carry(&self) -> usize {
        self.plain.carry()
    }

    fn predicts_variance(&self) -> bool {
        self.programs.predictor.predicts_variance()
    }

    fn restarts(&self) -> Option<usize> {
        self.plain.restarts()
    }

    fn lanes(&self, record: &Record, seeds: &[Seed]) -> usize {
        match self.programs.predictor.restarts() {
            Some(_) => 1,
            None => self.programs.program(record, seeds, Purpose::Rows).map_or(1, |compiled| compiled.program.lanes()),
        }
    }

    fn coupling(&self) -> Coupling {
        self.programs.coupling
    }

    fn choosing(&self) -> Option<&[usize]> {
        self.plain.choosing()
    }

    fn levels(&self) -> &[usize] {
        self.plain.levels()
    }

    fn scales(&self) -> &[usize] {
        self.plain.scales()
    }

    fn linearizes_choices(&self) -> bool {
        self.plain.linearizes_choices()
    }

    fn prepare(&self, record: &Record, parameters: &[f64]) -> Result<Prepared, Error> {
        self.plain.prepare(record, parameters)
    }

    fn start(&self, record: &Record, state: &[f64], parameters: &[f64]) -> Result<Reached, NoStart> {
        self.plain.start(record, state, parameters)
    }

    fn follows(&self, record: &Record, parameters: &[f64]) -> Vec<bool> {
        self.plain.follows(record, parameters)
    }

    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let Some(first) = pieces.first() else { return vec![] };
        let Some(program) = self.programs.program(first.record, seeds, Purpose::Rows) else {
            return self.plain.run(pieces, seeds, visit);
        };
        let parameters = self.parameters(pieces);
        let pieces: Vec<Piece<'_>> = with_parameters(pieces, &parameters).collect();
        match self.programs.predictor.restarts() {
            Some(horizon) => {
                let one = |piece| horizon::run(&program, piece, horizon.steps, visit);
                pieces.iter().map(one).collect()
            }
            None => Run::new(&program, pieces).all(visit),
        }
    }

    fn follow(&self, piece: &Piece<'_>, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        match self.programs.program(piece.record, &[], Purpose::Carry) {
            Some(program) => {
                let parameters = self.parameters(std::slice::from_ref(piece));
                let piece = with_parameters(std::slice::from_ref(piece), &parameters);
                Run::new(&program, piece.collect()).follow(at)
            }
            None => self.plain.follow(piece, at),
        }
    }

    fn settled(&self, piece: &Piece<'_>, seeds: &[Seed], sample: usize, carry: &[f64], part: f64) -> Option<Reached> {
        self.programs.crossed.as_ref().filter(|_| self.programs.predictor.is_filter())?;
        let compiled = self.programs.program(piece.record, seeds, Purpose::Rows)?;
        let length = piece.prepared.lengths(piece.record).after(sample);
        let numbers = Crossing::new(compiled.crossed.as_ref()?, &[piece]).settled(0, length)?;
        compiled.settling.as_ref()?.covariance(numbers, carry, part)
    }

    fn states(
        &self,
        record: &Record,
        carry: &[f64],
        parameters: &[f64],
        smoothed: bool,
    ) -> Option<Result<States, usize>> {
        self.plain.states(record, carry, parameters, smoothed)
    }

    fn measured_state(&self, record: &Record, sample: usize, p: &[f64]) -> Result<Vec<f64>, String> {
        self.plain.measured_state(record, sample, p)
    }

    fn guessed_state(&self, record: &Record, p: &[f64]) -> Result<Guess, String> {
        self.plain.guessed_state(record, p)
    }

    fn state_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        self.plain.state_slopes(record, sample, state, p)
    }

    fn jump_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        self.plain.jump_slopes(record, sample, state, p)
    }

    fn late(&self, parameters: &[f64]) -> Vec<Option<f64>> {
        self.plain.late(parameters)
    }

    fn locate(
        &self,
        record: &Record,
        state: &[f64],
        parameters: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Option<Result<Failure, Failure>> {
        self.plain.locate(record, state, parameters, sample, sigma, stops)
    }

    fn is_linear(&self) -> bool {
        self.programs.equations.is_linear()
    }

    fn refined<'s>(&'s self, samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let plain = self.plain.refined(samples)?;
        let programs = if samples >= WORTH_COMPILING { self.programs.refined() } else { None };
        Some(match programs {
            Some(programs) => Arc::new(ProgramSweep { programs, numbers: self.numbers.clone(), plain }),
            None => plain,
        })
    }

    fn simulating<'s>(&'s self, samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let plain = self.plain.simulating(samples)?;
        if samples < WORTH_COMPILING {
            return Some(plain);
        }
        let (equations, method) = (self.programs.equations.clone(), self.programs.method.clone());
        Some(match ProgramSweep::new(equations, method, Arc::new(FreeRun), plain.clone()) {
            Ok(sweep) => Arc::new(sweep),
            Err(_) => plain,
        })
    }

    fn filtering<'s>(&'s self, noise: &GivenNoise) -> Option<Arc<dyn Sweep + 's>> {
        let equations = &self.programs.equations;
        let predictor: Arc<dyn Prediction> = Arc::new(noise.clone());
        predictor.check(equations.layout()).ok()?;
        let method = stepped(&self.programs.method);
        let plain = of_equations_in_duals(equations, &method, &predictor);
        let numbers = numbers(equations, &*predictor);
        let make = || Programs::new(equations.clone(), method, predictor).ok().map(Arc::new);
        // With dead times, levels are constants of the programs.
        let programs = if numbers.is_empty() { make() } else { self.programs.filtering.get_or_init(make).clone() };
        Some(match programs {
            Some(programs) => Arc::new(ProgramSweep { programs, numbers, plain }),
            None => plain,
        })
    }

    fn with_terms<'s>(&'s self) -> Option<Lacking<'s>> {
        let make = || {
            let Programs { equations, method, predictor, .. } = &*self.programs;
            let WithTerms { equations, terms, left_out } = equations.with_terms(predictor.is_simulation());
            let sweep = of_equations(&Arc::new(equations), &stepped(method), predictor).ok()?;
            Some(Lacking { sweep, terms, left_out })
        };
        self.programs.lacking.get_or_init(make).clone()
    }

    fn undisturbed<'s>(&'s self, parameters: &[f64], free: &[bool]) -> Option<Undisturbed<'s>> {
        let Programs { equations, method, predictor, .. } = &*self.programs;
        if !predictor.takes_diffusion() {
            return None;
        }
        let sweep = of_equations(&Arc::new(equations.undisturbed()), method, predictor).ok()?;
        Some(Undisturbed { sweep, diffusion: equations.process_noise(parameters, free) })
    }

    fn second_order<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> {
        let (plain, predictor) = (self.plain.second_order()?, self.programs.predictor.second_order()?);
        let (equations, method) = (self.programs.equations.clone(), self.programs.method.clone());
        Some(match ProgramSweep::new(equations, method, predictor, plain.clone()) {
            Ok(sweep) => Arc::new(sweep),
            Err(_) => plain,
        })
    }

    fn integrator(&self) -> String {
        self.plain.integrator()
    }

    fn predictor(&self) -> String {
        self.plain.predictor()
    }

    fn engine(&self) -> String {
        let compiled = self.programs.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        let made = || compiled.iter().filter_map(|(_, compiled)| compiled.as_ref().ok());
        let engine = match made().any(|compiled| compiled.program.machine_code() > 0) {
            true => "read as a graph, run as machine code",
            false => "read as a graph, run by the interpreter",
        };
        // What is too large runs in dual numbers, and may be all of it.
        match compiled.iter().find_map(|(_, compiled)| compiled.as_ref().err()) {
            None => engine.to_owned(),
            Some(reason) if made().next().is_none() => format!("dual numbers ({reason})"),
            Some(reason) => format!("{engine}; slopes in dual numbers ({reason})"),
        }
    }

    fn identity(&self) -> String {
        self.plain.identity()
    }
}

#[cfg(test)]
mod tests;
