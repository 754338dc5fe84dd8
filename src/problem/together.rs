//! Passes over the single records of several problems, in parallel lanes.

use super::batches::{Broken, in_batches};
use super::job::Job;
use super::linearize::parts_by_output;
use super::pass::gather;
use super::{Accumulate, AccumulateLanes, Objective, Values};
use crate::optimize::{Infeasible, Linearization};
use crate::sweep::RunError;

/// An objective of one record, and a point.
pub(crate) type At<'o> = (&'o Objective<'o>, &'o [f64]);

/// Cost and triangle of each. One that fails is evaluated alone.
pub(crate) fn linearize_together(points: &[At<'_>]) -> Vec<Result<Linearization, Infeasible>> {
    let mut answers: Vec<Option<Result<Linearization, Infeasible>>> =
        points.iter().map(|(objective, x)| objective.known_at(x).map(Ok)).collect();
    let unknown: Vec<usize> = (0..points.len()).filter(|i| answers[*i].is_none()).collect();
    let asked: Vec<At<'_>> = unknown.iter().map(|&i| points[i]).collect();
    let run = |_: &[usize], jobs: &[&Job<'_>]| parts_by_output(jobs, jobs[0].objective.sets());
    for (i, part) in together(&asked, Slopes::OfQuantities, run) {
        let (objective, x) = asked[i];
        answers[unknown[i]] = Some(objective.linear_of(x, part));
    }
    let alone = |(answer, (objective, x)): (Option<_>, &At<'_>)| answer.unwrap_or_else(|| objective.evaluate(x));
    answers.into_iter().zip(points).map(alone).collect()
}

/// The accumulator of each, in a pass without slopes; `None` for one that fails.
pub(crate) fn gather_together<A: Accumulate>(points: &[At<'_>], make: impl Fn(usize) -> A + Sync) -> Vec<Option<A>> {
    let found = gather_together_beside(points, Slopes::None, make, |_| ());
    found.into_iter().map(|found| found.map(|(one, ())| one)).collect()
}

/// [`gather_together`] in a pass with these slopes, with a second accumulator, which `beside` makes for the points in the lanes of a batch.
pub(crate) fn gather_together_beside<A: Accumulate, L: AccumulateLanes>(
    points: &[At<'_>],
    slopes: Slopes,
    make: impl Fn(usize) -> A + Sync,
    beside: impl Fn(&[usize]) -> L + Sync,
) -> Vec<Option<(A, L::Lane)>> {
    let mut answers: Vec<Option<(A, L::Lane)>> = points.iter().map(|_| None).collect();
    let run = |members: &[usize], jobs: &[&Job<'_>]| {
        let gatherers = members.iter().map(|&i| make(i)).collect();
        gather(jobs, gatherers, beside(members))
    };
    together(points, slopes, run).into_iter().for_each(|(i, gathered)| answers[i] = Some(gathered));
    answers
}

/// The variables with respect to which a pass computes slopes.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Slopes {
    None,
    /// The unknown quantities.
    OfQuantities,
    /// The coordinates of the search.
    OfCoordinates,
}

/// Runs the records of all points; those that fail are left out, and the others run again without them. Nothing where a stop condition holds.
pub(super) fn together<T: Send>(
    points: &[At<'_>],
    slopes: Slopes,
    run: impl Fn(&[usize], &[&Job<'_>]) -> Result<Vec<T>, Broken> + Sync,
) -> Vec<(usize, T)> {
    let of = |(objective, x): &At<'_>| objective.problem.unknowns.of_experiment(0, x);
    let values: Vec<Values> = points.iter().map(of).collect();
    let mut left: Vec<usize> = (0..points.len()).collect();
    while !left.is_empty() {
        let job = |&i: &usize| {
            let (objective, x) = points[i];
            let mut job = objective.job(0, &values[i], x, slopes != Slopes::None);
            if slopes == Slopes::OfQuantities {
                job.scales.clear();
            }
            job
        };
        let jobs: Vec<Job<'_>> = left.iter().map(job).collect();
        let batch = |members: &[usize], jobs: &[&Job<'_>]| {
            run(&members.iter().map(|&member| left[member]).collect::<Vec<_>>(), jobs)
        };
        match in_batches(&jobs, batch) {
            Ok(found) => return left.into_iter().zip(found).collect(),
            Err((_, RunError::Stopped)) => return vec![],
            Err((job, _)) => left.remove(job),
        };
    }
    vec![]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Window;
    use crate::{Experiment, Fit, Kind, Model, Nothing, Scalar, Time, free, signals};

    signals! { struct Position { x: "m" } }

    /// `x = p`, of which there is no number below zero.
    #[derive(Clone)]
    struct Level;

    impl Model for Level {
        type State = Nothing;
        type Input = Nothing;
        type Output = Position;
        type Parameters = Position;
        const KIND: Kind = Kind::Static;

        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, _u: &Nothing, p: &Position<S>) -> Position<S> {
            Position { x: p.x.sqrt() * p.x.sqrt() }
        }
    }

    /// A number that says for which of the points it is, and the sum of the errors.
    struct Sum(usize, f64);

    impl Accumulate for Sum {
        fn add(&mut self, window: &Window, lane: usize) {
            self.1 += (0..window.samples[lane]).map(|k| window.error(k, 0, lane)).sum::<f64>();
        }

        fn append(&mut self, later: Self) {
            self.1 += later.1;
        }
    }

    /// Ten measurements of `i` meters each at the level 1: errors of `i - 1`. One point where the model fails has no sum.
    #[test]
    fn each_point_has_the_sums_of_its_record() {
        let record = |i: usize| {
            let outputs = vec![Position { x: i as f64 }; 10];
            Experiment::new(&Level, Time::Uniform { start: 0.0, step: 1.0 }, vec![Nothing {}; 10], outputs).unwrap()
        };
        let records: Vec<_> = (0..5).map(record).collect();
        let fit = |record| Fit::new(&Level, record).parameters(Position { x: free(1.0) }).noise(Position { x: 1.0 });
        let problems: Vec<_> = records.iter().map(|record| fit(record).problem().unwrap()).collect();
        let objectives: Vec<_> = problems.iter().map(|problem| problem.objective().unwrap()).collect();
        let at = |i: usize| [if i == 3 { -1.0 } else { 1.0 }];
        let places: Vec<_> = (0..5).map(at).collect();
        let points: Vec<At<'_>> = objectives.iter().zip(&places).map(|(one, place)| (one, &place[..])).collect();
        let found = gather_together(&points, |i| Sum(i, 0.0));
        let found: Vec<_> = found.into_iter().map(|sum| sum.map(|Sum(i, sum)| (i, sum.abs()))).collect();
        assert_eq!(found, [Some((0, 10.0)), Some((1, 0.0)), Some((2, 10.0)), None, Some((4, 30.0))]);
    }
}
