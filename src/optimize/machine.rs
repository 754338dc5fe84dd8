//! [`Machine`]: a search that asks for evaluations instead of making them.

use super::{Infeasible, LeastSquares, LeastSquaresState, Linearization, Outcome};
use argmin::core::{Error, KV, Problem, TerminationReason, TerminationStatus};

/// The evaluation that a search needs next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request<'a> {
    /// Cost and slopes at this point: [`LeastSquares::linearize`]; the answer goes to [`Machine::tell`].
    Linearize(&'a [f64]),
    /// The second derivative at `x` along a direction: [`LeastSquares::curvature`]; the answer goes to
    /// [`Machine::tell_curvature`].
    Curvature {
        /// The point.
        x: &'a [f64],
        /// The direction.
        along: &'a [f64],
    },
    /// Nothing: the search has ended.
    Ended(Outcome),
}

/// Declarations of the unknowns before a search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Domain {
    /// Lower and upper bound of each unknown; missing ones are infinite.
    pub bounds: Vec<(f64, f64)>,
    /// The size of those unknowns whose magnitude does not tell it (one for a logarithm); missing ones are `None`.
    pub sizes: Vec<Option<f64>>,
    /// Which unknowns are logarithms; missing ones are none.
    pub logarithms: Vec<bool>,
}

impl Domain {
    /// The declarations of a problem's unknowns.
    pub fn of(problem: &impl LeastSquares) -> Self {
        Domain { bounds: problem.bounds(), sizes: problem.sizes(), logarithms: problem.logarithms() }
    }
}

/// A search that does not call its problem: it returns the evaluation that it needs next, and is given the result. So many searches can go
/// step by step together, each evaluation of all of them in one sweep.
///
/// ```
/// # use greybox::optimize::{Domain, LeastSquares, LevenbergMarquardt, Machine, Outcome, Request};
/// fn minimize(problem: &impl LeastSquares, start: Vec<f64>) -> (Vec<f64>, Outcome) {
///     let mut search: LevenbergMarquardt = LevenbergMarquardt::default();
///     search.begin(start, Domain::of(problem));
///     loop {
///         match search.request() {
///             Request::Linearize(x) => search.tell(problem.linearize(x)),
///             Request::Curvature { x, along } => search.tell_curvature(problem.curvature(x, along)),
///             Request::Ended(outcome) => return (search.place().to_vec(), outcome),
///         }
///     }
/// }
/// ```
///
/// A search is serialized with its point and its settings, without the slopes there: after [`resume`](Machine::resume) it asks
/// for them again, and goes on as if it had not been interrupted.
pub trait Machine {
    /// Begins anew at a point.
    fn begin(&mut self, start: Vec<f64>, domain: Domain);

    /// Goes on where it stood, after it was read back.
    fn resume(&mut self, domain: Domain);

    /// The evaluation that it needs next.
    fn request(&self) -> Request<'_>;

    /// Answers [`Request::Linearize`]. A point without a cost is answered by a shorter step, a cancelled evaluation ends the
    /// search; so does a start that cannot be evaluated.
    fn tell(&mut self, answer: Result<Linearization, Infeasible>);

    /// Answers [`Request::Curvature`]; `None` where the problem has no second derivatives, and it will not be asked again.
    fn tell_curvature(&mut self, answer: Option<Result<Linearization, Infeasible>>);

    /// The point where it stands; the best it knows once it has ended.
    fn place(&self) -> &[f64];

    /// Cost and slopes where it stands; `None` before they were told.
    fn linearization(&self) -> Option<&Linearization>;

    /// How it ended; `None` while it runs.
    fn outcome(&self) -> Option<Outcome>;
}

/// Gives a search the evaluation it asks for, and those that this leads to, until one trial point has been judged.
fn evaluate<O: LeastSquares>(search: &mut impl Machine, problem: &mut Problem<O>) -> Result<Option<Infeasible>, Error> {
    // The counter of both kinds of evaluation.
    const PASSES: &str = "linearization_count";
    loop {
        match search.request() {
            Request::Ended(_) => return Ok(None),
            Request::Curvature { x, along } => {
                let answer = problem.problem(PASSES, |problem| Ok(problem.curvature(x, along)))?;
                search.tell_curvature(answer);
            }
            Request::Linearize(x) => {
                let answer = problem.problem(PASSES, |problem| Ok(problem.linearize(x)))?;
                let failed = answer.as_ref().err().cloned();
                search.tell(answer);
                return Ok(failed);
            }
        }
    }
}

fn state_of(search: &impl Machine, state: LeastSquaresState) -> LeastSquaresState {
    let state = state.param(search.place().to_vec());
    match search.linearization() {
        Some(linear) => state.cost(linear.cost).gradient(linear.gradient()),
        None => state,
    }
}

/// The start of a search as a solver of argmin. A search that was read back goes on if it is at this point.
pub(super) fn init<O: LeastSquares>(
    search: &mut impl Machine,
    problem: &mut Problem<O>,
    mut state: LeastSquaresState,
) -> Result<(LeastSquaresState, Option<KV>), Error> {
    let start = state.take_param().ok_or_else(|| Error::msg("the search needs an initial parameter vector"))?;
    let domain = problem.problem("bounds_count", |problem| Ok(Domain::of(problem)))?;
    match search.place() == start && search.outcome().is_none() {
        true => search.resume(domain),
        false => search.begin(start, domain),
    }
    match evaluate(search, problem)? {
        Some(infeasible) => Err(infeasible.into()),
        None => Ok((state_of(search, state), None)),
    }
}

/// One trial step of a search as a solver of argmin.
pub(super) fn next_iter<O: LeastSquares>(
    search: &mut impl Machine,
    problem: &mut Problem<O>,
    state: LeastSquaresState,
) -> Result<LeastSquaresState, Error> {
    // Read back by argmin, which then leaves out the start.
    if search.linearization().is_none() {
        let domain = problem.problem("bounds_count", |problem| Ok(Domain::of(problem)))?;
        search.resume(domain);
    }
    evaluate(search, problem)?;
    Ok(state_of(search, state))
}

/// How argmin is to call the end of a search.
pub(super) fn termination(search: &impl Machine) -> TerminationStatus {
    TerminationStatus::Terminated(match search.outcome() {
        None => return TerminationStatus::NotTerminated,
        Some(Outcome::Cancelled) => TerminationReason::Interrupt,
        Some(Outcome::IterationLimit { .. } | Outcome::OwnLimit { .. }) => TerminationReason::MaxItersReached,
        Some(outcome) if outcome.converged() => TerminationReason::SolverConverged,
        Some(outcome) => TerminationReason::SolverExit(outcome.to_string()),
    })
}

/// Makes a [`Machine`] one of argmin's solvers: `[type parameters] search, name, |search| numbers`, the last those that
/// argmin's observers see after each step.
macro_rules! solver {
    ([$($parameters:tt)*] $search:ty, $name:literal, |$this:ident| $numbers:expr) => {
        impl<O: LeastSquares, $($parameters)*> Solver<O, LeastSquaresState> for $search {
            fn name(&self) -> &str {
                $name
            }

            fn init(
                &mut self,
                problem: &mut Problem<O>,
                state: LeastSquaresState,
            ) -> Result<(LeastSquaresState, Option<KV>), Error> {
                machine::init(self, problem, state)
            }

            fn next_iter(
                &mut self,
                problem: &mut Problem<O>,
                state: LeastSquaresState,
            ) -> Result<(LeastSquaresState, Option<KV>), Error> {
                let state = machine::next_iter(self, problem, state)?;
                let $this = &*self;
                Ok((state, Some($numbers)))
            }

            fn terminate(&mut self, _state: &LeastSquaresState) -> TerminationStatus {
                machine::termination(self)
            }
        }
    };
}
pub(super) use solver;
