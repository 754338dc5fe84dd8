//! Reading generic Rust code: it is run with [`Symbol`]s for numbers, once for each way through its comparisons.
//!
//! A comparison of symbols has no answer of its own. It is answered yes, and the code is run again for no; what the runs
//! come to is merged to selects. A question whose answer follows from the earlier ones of the same run is no question. The
//! symbols' graph belongs to the thread while a trace runs, and to nobody else.

use super::symbol::Symbol;
use super::{Graph, Id};
use crate::scalar::Comparison;
use core::any::Any;
use core::cell::RefCell;
use rustc_hash::FxHashMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Runs of the code, one for each way through it.
const MAX_PATHS: usize = 64;
/// Open questions in one run.
const MAX_QUESTIONS: usize = 48;
/// Operations in one run, answered questions included: a loop that comes to no end exceeds it.
const MAX_OPERATIONS: usize = 2_000_000;

/// Why code cannot be read as a graph.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot be read as a graph: {reason}")]
pub struct Untraceable {
    /// In a sentence: "the model calls `value()`".
    pub reason: String,
}

impl Untraceable {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Untraceable { reason: reason.into() }
    }
}

/// Thrown to leave the code that is read; no message is printed for it.
struct Abandoned;

/// A question and the answer that a run was given.
#[derive(Clone, Copy)]
struct Decision {
    comparison: Comparison,
    a: Id,
    b: Id,
    holds: bool,
}

/// Possible orders of two numbers, as bits.
const LESS: u8 = 1;
const EQUAL: u8 = 2;
const GREATER: u8 = 4;
const UNORDERED: u8 = 8;

/// The state of a trace.
pub(super) struct Arena {
    pub graph: Graph,
    /// Tells the symbols of one trace from those of another.
    pub number: u64,
    /// The answers to be given, then those given on top.
    path: Vec<Decision>,
    asked: usize,
    /// The orders of each two numbers that are still possible in this run.
    relations: FxHashMap<(Id, Id), u8>,
    operations: usize,
    failure: Option<String>,
}

thread_local! {
    static ARENA: RefCell<Option<Arena>> = const { RefCell::new(None) };
    static TRACES: RefCell<u64> = const { RefCell::new(0) };
}

/// Puts back what there was before a trace, however it ends.
struct Restore(Option<Arena>);

impl Drop for Restore {
    fn drop(&mut self) {
        ARENA.with(|arena| *arena.borrow_mut() = self.0.take());
    }
}

/// Does something with this thread's trace, if there is one. May leave the code that is read.
pub(super) fn with<R>(f: impl FnOnce(&mut Arena) -> R) -> Option<R> {
    let (result, failed) = ARENA.with(|arena| {
        let mut arena = arena.try_borrow_mut().ok()?;
        let arena = arena.as_mut()?;
        arena.operations += 1;
        if arena.operations > MAX_OPERATIONS {
            arena.fail("it takes more than two million operations");
        }
        let result = f(arena);
        Some((result, arena.failure.is_some()))
    })?;
    if failed && cfg!(panic = "unwind") && !std::thread::panicking() {
        resume_unwind(Box::new(Abandoned));
    }
    Some(result)
}

impl Arena {
    /// Notes why the trace cannot go on; the first reason counts.
    pub fn fail(&mut self, reason: &str) {
        self.failure.get_or_insert_with(|| reason.to_owned());
    }

    /// The answer to a question in this run.
    pub fn ask(&mut self, comparison: Comparison, a: Id, b: Id) -> bool {
        if let (Some(x), Some(y)) = (self.graph.known(a), self.graph.known(b)) {
            return comparison.holds(x, y);
        }
        if cfg!(panic = "abort") {
            // Odd answers could make the code panic, which nothing would catch. All are no, as for what is not a number;
            // but a loop that goes on for long gets answers of both kinds, in no order.
            self.fail("it compares numbers, which a program built with panic = \"abort\" cannot follow both ways");
            self.asked += 1;
            let scattered = (self.asked as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63;
            return self.asked > 10_000 && scattered == 1;
        }
        let (pair, swapped) = if a <= b { ((a, b), false) } else { ((b, a), true) };
        let yes = match comparison {
            Comparison::Equal => EQUAL,
            Comparison::Less if swapped => GREATER,
            Comparison::Less => LESS,
            Comparison::LessOrEqual if swapped => GREATER | EQUAL,
            Comparison::LessOrEqual => LESS | EQUAL,
        };
        let all = if a == b { EQUAL | UNORDERED } else { LESS | EQUAL | GREATER | UNORDERED };
        let open = self.relations.get(&pair).copied().unwrap_or(all);
        let holds = match (open & yes, open & !yes) {
            (0, _) => return false,
            (_, 0) => return true,
            _ => self.decide(Decision { comparison, a, b, holds: true }),
        };
        self.relations.insert(pair, if holds { open & yes } else { open & !yes });
        holds
    }

    fn decide(&mut self, decision: Decision) -> bool {
        if self.asked == self.path.len() {
            if self.asked == MAX_QUESTIONS {
                self.fail("one way through it has more than 48 open comparisons");
            } else {
                self.path.push(decision);
            }
        }
        self.asked += 1;
        self.path.get(self.asked - 1).is_some_and(|known| known.holds)
    }
}

/// Result of one run: the answers to its comparisons, and its outputs.
struct Run {
    path: Vec<Decision>,
    roots: Vec<Id>,
}

impl Graph {
    /// Reads what the code computes from leaves ([`Symbol::leaf`]) and numbers: its results, as nodes of this graph.
    ///
    /// # Errors
    /// [`Untraceable`], if the code asks a symbol for its value, has too many ways through it, or panics. Code that
    /// panics prints its message, as ever.
    ///
    /// ```
    /// use greybox::graph::{Graph, Leaf, Symbol};
    /// let mut graph = Graph::default();
    /// let roots = graph.trace(|| {
    ///     let x = Symbol::leaf(Leaf::State(0));
    ///     vec![if x > 1.0 { x * x } else { x }]
    /// });
    /// assert_eq!(graph.evaluate(&roots.unwrap(), |_| 3.0), [9.0]);
    /// ```
    pub fn trace(&mut self, mut code: impl FnMut() -> Vec<Symbol>) -> Result<Vec<Id>, Untraceable> {
        self.trace_all_paths(&mut code)
    }

    fn trace_all_paths(&mut self, code: &mut dyn FnMut() -> Vec<Symbol>) -> Result<Vec<Id>, Untraceable> {
        let number = TRACES.with(|traces| {
            *traces.borrow_mut() += 1;
            *traces.borrow()
        });
        let _restore = Restore(ARENA.with(|arena| arena.borrow_mut().take()));
        let (mut path, mut runs) = (vec![], vec![]);
        loop {
            let graph = core::mem::take(self);
            let fresh = Arena {
                graph,
                number,
                path: core::mem::take(&mut path),
                asked: 0,
                relations: FxHashMap::default(),
                operations: 0,
                failure: None,
            };
            ARENA.with(|arena| *arena.borrow_mut() = Some(fresh));
            let outcome = catch_unwind(AssertUnwindSafe(&mut *code));
            let Some(arena) = ARENA.with(|arena| arena.borrow_mut().take()) else {
                return Err(Untraceable::new("it ends the trace that it is read by"));
            };
            *self = arena.graph;
            if let Some(reason) = arena.failure {
                return Err(Untraceable::new(reason));
            }
            let results = outcome.map_err(|payload| Untraceable::new(panicked(&*payload)))?;
            let Some(roots) = results.iter().map(|symbol| symbol.of(number)).collect::<Option<Vec<Id>>>() else {
                return Err(Untraceable::new("it returns a number that was kept from elsewhere"));
            };
            path.clone_from(&arena.path);
            runs.push(Run { path: arena.path, roots });
            // The last question that has been answered yes only is answered no.
            while path.last().is_some_and(|last| !last.holds) {
                path.pop();
            }
            match path.last_mut() {
                Some(last) => last.holds = false,
                None => return self.merged(&runs),
            }
            if runs.len() == MAX_PATHS {
                return Err(Untraceable::new("its comparisons have more than 64 paths"));
            }
        }
    }

    /// One result of all runs: selects by what they were asked.
    fn merged(&mut self, runs: &[Run]) -> Result<Vec<Id>, Untraceable> {
        // Each run with the roots so far; the last two that differ in their last question only become one, again and again.
        let mut open: Vec<(&[Decision], Vec<Id>)> = vec![];
        for run in runs {
            let (mut path, mut roots) = (run.path.as_slice(), run.roots.clone());
            while let Some((last, before)) = path.split_last() {
                if last.holds {
                    break;
                }
                let Some((_, then)) = open.pop() else { break };
                if then.len() != roots.len() {
                    return Err(Untraceable::new("it returns vectors of different lengths"));
                }
                let select =
                    |(then, otherwise): (Id, Id)| self.select(last.comparison, last.a, last.b, then, otherwise);
                roots = then.into_iter().zip(roots).map(select).collect();
                path = before;
            }
            open.push((path, roots));
        }
        Ok(open.pop().map(|(_, roots)| roots).unwrap_or_default())
    }
}

fn panicked(payload: &(dyn Any + Send)) -> String {
    let message = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
    match message {
        Some(message) => format!("it panics when its comparisons are answered both ways: {message}"),
        None => "it panics when its comparisons are answered both ways".to_owned(),
    }
}
