//! Jobs run in parallel lanes, and batches of them on threads.

use super::job::Job;
use super::standardize::Standardize;
use crate::record::Time;
use crate::sweep::{Piece, Reached, RunError, Window};
#[cfg(feature = "parallel")]
use std::sync::{Mutex, PoisonError};

/// The lane whose piece was not run to its end, and why.
pub(super) struct Broken {
    pub lane: usize,
    pub error: RunError,
}

/// The number of samples times columns from which on a batch is run on a thread of its own. What a pass does for a sample without
/// its slopes takes about as long as [`BESIDE`] slopes, and counts as so many columns.
const WORTH_A_THREAD: usize = 80_000;
const BESIDE: usize = 4;

/// Runs jobs of one sweep in batches of compatible ones; the results are in the order of the jobs.
///
/// # Errors
/// The first job that was not run to its end, and why.
pub(super) fn in_batches<T: Send>(
    jobs: &[Job<'_>],
    batch: impl Fn(&[usize], &[&Job<'_>]) -> Result<Vec<T>, Broken> + Sync,
) -> Result<Vec<T>, (usize, RunError)> {
    let batches = batches(jobs);
    let one = |b: usize| {
        let members: Vec<&Job<'_>> = batches[b].iter().map(|&i| &jobs[i]).collect();
        batch(&batches[b], &members)
    };
    let work = jobs.iter().map(|job| job.piece.samples.len() * (job.seeds.len() + BESIDE)).sum::<usize>();
    let results = match work / batches.len().max(1) > WORTH_A_THREAD || work > 8 * WORTH_A_THREAD {
        true => each(batches.len(), one),
        false => (0..batches.len()).map(one).collect(),
    };
    let mut found: Vec<Option<T>> = (0..jobs.len()).map(|_| None).collect();
    for (members, result) in batches.iter().zip(results) {
        let result = result.map_err(|Broken { lane, error }| (members[lane], error))?;
        members.iter().zip(result).for_each(|(&i, value)| found[i] = Some(value));
    }
    Ok(found.into_iter().flatten().collect())
}

/// The indices of the jobs of each batch: same hold, same kind of time, same seeds, longest first.
fn batches(jobs: &[Job<'_>]) -> Vec<Vec<usize>> {
    let alike = |a: &Job<'_>, b: &Job<'_>| {
        let (one, other) = (a.piece.record, b.piece.record);
        let uniform = |time: &Time| matches!(time, Time::Uniform { .. });
        one.holds == other.holds && uniform(one.times()) == uniform(other.times()) && a.seeds == b.seeds
    };
    let mut kinds: Vec<Vec<usize>> = vec![];
    for (i, job) in jobs.iter().enumerate() {
        match kinds.iter_mut().find(|kind| alike(&jobs[kind[0]], job)) {
            Some(kind) => kind.push(i),
            None => kinds.push(vec![i]),
        }
    }
    let mut batches = vec![];
    for mut kind in kinds {
        let first = &jobs[kind[0]];
        let lanes = first.objective.sweep.lanes(first.piece.record, &first.seeds).max(1);
        if lanes > 1 {
            kind.sort_by_key(|&i| std::cmp::Reverse(jobs[i].piece.samples.len()));
        }
        batches.extend(kind.chunks(lanes).map(<[usize]>::to_vec));
    }
    batches
}

/// Runs the jobs of a batch and calls `show` with their windows of standardized errors.
pub(super) fn run(jobs: &[&Job<'_>], show: &mut dyn FnMut(&mut Window)) -> Result<Vec<Reached>, Broken> {
    let pieces: Vec<Piece<'_>> = jobs.iter().map(|job| job.piece.lent()).collect();
    let mut standardize: Option<Standardize<'_>> = None;
    let mut failed = None;
    let visit = &mut |window: &mut Window| {
        if jobs.iter().any(|job| job.objective.control.stops()) {
            return false;
        }
        let standardize = standardize.get_or_insert_with(|| Standardize::new(jobs, window.lanes()));
        if let Err((lane, sample)) = standardize.apply(window) {
            failed = Some(Broken { lane, error: RunError::Failed { sample } });
            return false;
        }
        show(window);
        true
    };
    let reached = jobs[0].objective.sweep.run(&pieces, &jobs[0].seeds, visit);
    match failed {
        Some(failed) => Err(failed),
        None => {
            let lanes = reached.into_iter().enumerate();
            lanes.map(|(lane, reached)| reached.map_err(|error| Broken { lane, error })).collect()
        }
    }
}

/// Runs the jobs of a batch for the carries at their ends alone.
pub(super) fn ends(jobs: &[&Job<'_>]) -> Vec<Result<Reached, RunError>> {
    let pieces: Vec<Piece<'_>> = jobs.iter().map(|job| job.piece.lent()).collect();
    let Job { objective, seeds, .. } = jobs[0];
    objective.sweep.run(&pieces, seeds, &mut |_| !objective.control.stops())
}

/// `f(0), f(1), ...`, in parallel where the feature `parallel` is on; in order.
pub(crate) fn each<T: Send>(n: usize, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if n > 1 {
        let results: Vec<Mutex<Option<T>>> = (0..n).map(|_| Mutex::new(None)).collect();
        in_parallel(n, &|i| {
            let result = f(i);
            *results[i].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        let taken = results.into_iter().map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner));
        return taken.flatten().collect();
    }
    (0..n).map(f).collect()
}

/// Not generic: threads of rayon for each closure of the library would be a tenth of its machine code.
#[cfg(feature = "parallel")]
fn in_parallel(n: usize, f: &(dyn Fn(usize) + Sync)) {
    use rayon::prelude::*;
    (0..n).into_par_iter().for_each(f);
}
