//! Passes over the single records of several problems, in parallel lanes.

use super::batches::in_batches;
use super::linearize::parts;
use super::pass::{Job, gather};
use super::{Accumulate, Objective, Values};
use crate::optimize::{Infeasible, Linearization};

/// An objective of one record, and a point.
pub(crate) type At<'o> = (&'o Objective<'o>, &'o [f64]);

/// Cost and triangle of each. One that fails is evaluated alone.
pub(crate) fn linearize_together(points: &[At<'_>]) -> Vec<Result<Linearization, Infeasible>> {
    let mut answers: Vec<Option<Result<Linearization, Infeasible>>> = points.iter().map(|_| None).collect();
    let run = |_: &[usize], jobs: &[&Job<'_>]| parts(jobs);
    for (i, part) in together(points, true, run) {
        let (objective, x) = points[i];
        answers[i] = Some(objective.linear_of(x, part));
    }
    let alone = |(answer, (objective, x)): (Option<_>, &At<'_>)| answer.unwrap_or_else(|| objective.evaluate(x));
    answers.into_iter().zip(points).map(alone).collect()
}

/// The accumulator of each, in a pass without slopes; `None` for one that fails.
pub(crate) fn gather_together<A: Accumulate>(points: &[At<'_>], make: impl Fn(usize) -> A + Sync) -> Vec<Option<A>> {
    let mut answers: Vec<Option<A>> = points.iter().map(|_| None).collect();
    let run = |members: &[usize], jobs: &[&Job<'_>]| gather(jobs, members.iter().map(|&i| make(i)).collect());
    together(points, false, run).into_iter().for_each(|(i, gathered)| answers[i] = Some(gathered));
    answers
}

/// Runs the records of all points; those that fail are left out, and the others run again without them.
fn together<T: Send>(
    points: &[At<'_>],
    slopes: bool,
    run: impl Fn(&[usize], &[&Job<'_>]) -> Result<Vec<T>, super::batches::Broken> + Sync,
) -> Vec<(usize, T)> {
    let of = |(objective, x): &At<'_>| objective.problem.unknowns.of_experiment(0, x);
    let values: Vec<Values> = points.iter().map(of).collect();
    let mut left: Vec<usize> = (0..points.len()).collect();
    while !left.is_empty() {
        let job = |&i: &usize| {
            let (objective, x) = points[i];
            let mut job = objective.job(0, &values[i], x, slopes);
            job.scales.clear();
            job
        };
        let jobs: Vec<Job<'_>> = left.iter().map(job).collect();
        let batch = |members: &[usize], jobs: &[&Job<'_>]| {
            run(&members.iter().map(|&member| left[member]).collect::<Vec<_>>(), jobs)
        };
        match in_batches(&jobs, batch) {
            Ok(found) => return left.into_iter().zip(found).collect(),
            Err((job, _)) => left.remove(job),
        };
    }
    vec![]
}
