//! [`Step`]: a recurrence with its slopes, ready to be scheduled.

use super::fusion::instructions;
use crate::graph::{Function, Graph, Id, Leaf, Node, Pattern, Seed, Tangent, Tape, Variables, Way, slopes};
use crate::recurrence::Recurrence;

/// Everything computed at a sample: rows, and what is carried on.
///
/// Slopes are carried as further entries of the state.
pub(super) struct Step {
    pub tape: Tape,
    /// Values, then slopes, as the pattern numbers them.
    pub next: Vec<Id>,
    /// For each output the slopes, then the mean; for each variance the same. None: always zero.
    pub rows: Vec<Option<Id>>,
    pub pattern: Pattern,
}

/// The ways that are tried.
const WAYS: [Way; 3] = [Way::Carried, Way::Forward, Way::Reverse];

/// A tape with the slopes of rows and of what is carried.
struct Attempt {
    tape: Tape,
    rows: Vec<Tangent>,
    next: Vec<Tangent>,
    zero: Id,
}

impl Step {
    pub fn new(recurrence: &Recurrence, seeds: &[Seed], uniform: bool) -> Self {
        let mut tape = Tape::new(uniform);
        let all = [recurrence.next(), recurrence.mean(), recurrence.variance()].concat();
        let roots = tape.import(recurrence.graph(), &all);
        let (next, outputs) = roots.split_at(recurrence.next().len());
        let starts = |entry: usize, leaf: Leaf| recurrence.starts_from(entry, leaf);
        let pattern = Pattern::new(&mut tape, next, seeds, recurrence.following(), &starts);
        let variables = |tape: &mut Tape| Variables::new(tape, seeds, &pattern, recurrence.following());
        let attempt = best(&tape, [outputs, next], seeds.len(), &variables);
        let mut values: Vec<Id> = next.to_vec();
        for (row, tangent) in pattern.rows.iter().zip(&attempt.next) {
            let there = row.iter().zip(tangent).filter(|(at, _)| at.is_some());
            values.extend(there.map(|(_, slope)| slope.unwrap_or(attempt.zero)));
        }
        let with_slopes = outputs.iter().zip(&attempt.rows);
        let rows = with_slopes.flat_map(|(value, tangent)| tangent.iter().copied().chain([Some(*value)])).collect();
        Step { tape: attempt.tape, next: values, rows, pattern }.lowered()
    }

    /// This step in operations that registers have.
    fn lowered(self) -> Self {
        let roots: Vec<Id> = self.next.iter().chain(self.rows.iter().flatten()).copied().collect();
        let (tape, new) = lowered(&self.tape, &roots);
        let (next, rest) = new.split_at(self.next.len());
        let mut rest = rest.iter();
        let rows = self.rows.iter().map(|row| row.and_then(|_| rest.next().copied())).collect();
        Step { tape, next: next.to_vec(), rows, pattern: self.pattern }
    }
}

/// The slopes of fewest instructions, of rows and of what is carried.
fn best(tape: &Tape, [outputs, next]: [&[Id]; 2], seeds: usize, variables: &dyn Fn(&mut Tape) -> Variables) -> Attempt {
    let attempt = |of_rows: Way, of_next: Way| {
        let mut tape = tape.clone();
        let variables = variables(&mut tape);
        let zero = tape.constant(0.0);
        let rows = slopes(&mut tape, outputs, &variables, of_rows);
        let next = slopes(&mut tape, next, &variables, of_next);
        Attempt { tape, rows, next, zero }
    };
    if seeds == 0 {
        return attempt(Way::Carried, Way::Carried);
    }
    let count = |attempt: &Attempt, tangents: &[Tangent], values: &[Id]| {
        let roots: Vec<Id> = tangents.iter().flatten().flatten().chain(values).copied().collect();
        let (tape, roots) = lowered(&attempt.tape, &roots);
        instructions(&tape, &roots)
    };
    let attempts: Vec<(Way, Attempt)> = WAYS.map(|way| (way, attempt(way, way))).into();
    let costs: Vec<(usize, usize)> = attempts
        .iter()
        .map(|(_, attempt)| (count(attempt, &attempt.rows, outputs), count(attempt, &attempt.next, next)))
        .collect();
    let of_rows = (0..WAYS.len()).min_by_key(|way| costs[*way].0).unwrap_or(0);
    let of_next = (0..WAYS.len()).min_by_key(|way| costs[*way].1).unwrap_or(0);
    if of_rows != of_next {
        return attempt(WAYS[of_rows], WAYS[of_next]);
    }
    let chosen = attempts.into_iter().nth(of_next).map(|(_, attempt)| attempt);
    chosen.unwrap_or_else(|| attempt(Way::Carried, Way::Carried))
}

/// Quotients as products with reciprocals, whole powers as products.
fn lowered(tape: &Tape, roots: &[Id]) -> (Tape, Vec<Id>) {
    let mut lower = Tape::new(tape.uniform);
    lower.graph.share_tables(&tape.graph);
    let reached = tape.graph.reached(roots);
    let mut new = vec![Id::default(); tape.graph.len()];
    for (i, node) in tape.graph.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
        let node = node.with_operands(|id| new[id.index()]);
        let build = |graph: &mut Graph| match node {
            Node::Div(a, b) => {
                let reciprocal = graph.function(Function::Recip, b);
                graph.mul(a, reciprocal)
            }
            Node::Power(a, n) => power(graph, a, n),
            _ => graph.put(node),
        };
        new[i] = if tape.relaxed[i] { lower.free(build) } else { lower.strict(build) };
    }
    let roots = roots.iter().map(|root| new[root.index()]).collect();
    (lower, roots)
}

/// A whole power by squares, in the order of `f64::powi`.
fn power(graph: &mut Graph, a: Id, n: i32) -> Id {
    let (mut left, mut square, mut result) = (n.unsigned_abs(), a, None);
    loop {
        if left & 1 == 1 {
            result = Some(match result {
                None => square,
                Some(result) => graph.mul(result, square),
            });
        }
        left >>= 1;
        if left == 0 {
            break;
        }
        square = graph.mul(square, square);
    }
    let result = result.unwrap_or_else(|| graph.constant(1.0));
    if n < 0 { graph.function(Function::Recip, result) } else { result }
}
