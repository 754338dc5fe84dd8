//! The second derivative of the errors along a direction.

use super::absorb::Absorber;
use super::batches::{Broken, in_batches, run};
use super::job::Job;
use super::together::{At, Slopes, gather_together, together};
use super::{Accumulate, Objective};
use crate::information::Information;
use crate::optimize::{Infeasible, Linearization};
use crate::sweep::Window;
use crate::wide::{self, Task, Wide};

/// Step of the finite difference, as a fraction of the direction (Transtrum and Sethna 2012, section 4).
const FAR: f64 = 0.1;

/// Where second derivatives are asked for, and along which direction.
pub(crate) struct Bend<'o> {
    pub objective: &'o Objective<'o>,
    pub x: &'o [f64],
    pub along: &'o [f64],
}

impl Bend<'_> {
    /// A tenth of the direction away.
    fn far(&self) -> Vec<f64> {
        self.x.iter().zip(self.along).map(|(x, along)| x + FAR * along).collect()
    }

    /// The rows of all experiments and those of the priors.
    fn linear(&self, far: &[f64], mut blocks: Vec<Information>) -> Linearization {
        let unknowns = &self.objective.problem.unknowns;
        for ((i, slope, error), (_, _, beyond)) in unknowns.priors(self.x).zip(unknowns.priors(far)) {
            let e = unknowns.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect();
            blocks[e].absorb_row(&row, 2.0 / (FAR * FAR) * (beyond - error + FAR * slope * self.along[i]));
        }
        let cost = blocks.iter().map(|block| 0.5 * block.residual_at_zero()).sum();
        Linearization::new(cost, unknowns.shared(), blocks)
    }
}

/// [`Objective::second_along`] of each, in passes over parallel lanes; of objectives of one record each. `None` where variances are predicted.
pub(crate) fn curvatures_together(bends: &[Bend<'_>]) -> Vec<Option<Result<Linearization, Infeasible>>> {
    if bends.iter().any(|bend| bend.objective.sweep.predicts_variance()) {
        return bends.iter().map(|_| None).collect();
    }
    let far: Vec<Vec<f64>> = bends.iter().map(Bend::far).collect();
    let points: Vec<At<'_>> = bends.iter().zip(&far).map(|(bend, far)| (bend.objective, &far[..])).collect();
    let beyond = gather_together(&points, |_| Errors(vec![]));
    let found = beyond.iter().enumerate().filter_map(|(i, errors)| errors.as_ref().map(|Errors(errors)| (i, errors)));
    let (numbers, beyond): (Vec<usize>, Vec<&Vec<f64>>) = found.unzip();
    let points: Vec<At<'_>> = numbers.iter().map(|i| (bends[*i].objective, bends[*i].x)).collect();
    let scales = |i: usize| bends[i].objective.problem.unknowns.scales(0, bends[i].x);
    // Slopes of jobs that run together are those with respect to the quantities themselves.
    let along = |i: &usize| {
        let columns = bends[*i].objective.problem.unknowns.columns(0);
        columns.zip(scales(*i)).map(|(column, scale)| bends[*i].along[column] * scale).collect()
    };
    let along: Vec<Vec<f64>> = numbers.iter().map(along).collect();
    let parts = together(&points, Slopes::OfQuantities, |members, jobs| {
        let further = |member: &usize| Further { beyond: beyond[*member], along: &along[*member] };
        triangles(jobs, members.iter().map(further).collect())
    });
    let mut answers: Vec<Option<Linearization>> = bends.iter().map(|_| None).collect();
    for (member, mut triangle) in parts {
        let i = numbers[member];
        triangle.scale_columns(&scales(i));
        answers[i] = Some(bends[i].linear(&far[i], vec![triangle]));
    }
    let alone = |(answer, bend): (Option<Linearization>, &Bend<'_>)| {
        Some(answer.map_or_else(|| bend.objective.second_along(bend.x, bend.along), Ok))
    };
    answers.into_iter().zip(bends).map(alone).collect()
}

impl Objective<'_> {
    /// Slopes at a point, and in the place of the errors their second derivatives along a direction: by the errors a
    /// tenth of the direction away, with the slopes. Not for predicted variances.
    pub(crate) fn second_along(&self, x: &[f64], along: &[f64]) -> Result<Linearization, Infeasible> {
        let bend = Bend { objective: self, x, along };
        let far = bend.far();
        let beyond = self.gather(&far, false, |_| Errors(vec![]))?;
        let found = self.second_blocks(&bend, &beyond);
        let found = match (&found, self.inside_bounds(x)) {
            (Err(Infeasible::Failed(_)), Some(inside)) => inside.second_blocks(&bend, &beyond).or(found),
            _ => found,
        };
        Ok(bend.linear(&far, found?))
    }

    /// The triangle of each experiment.
    fn second_blocks(&self, bend: &Bend<'_>, beyond: &[Errors]) -> Result<Vec<Information>, Infeasible> {
        let values = self.values(bend.x);
        let borders = self.borders(bend.x, &values, true)?;
        let jobs: Vec<Job<'_>> = (0..self.experiments())
            .flat_map(|e| self.segments(e, &values[e], bend.x, true, borders.as_deref()))
            .collect();
        let columns = |e: usize| self.problem.unknowns.columns(e).map(|column| bend.along[column]).collect();
        let along: Vec<Vec<f64>> = (0..self.experiments()).map(columns).collect();
        let batch = |_: &[usize], jobs: &[&Job<'_>]| {
            let further = |job: &&Job<'_>| Further { beyond: &beyond[job.experiment].0, along: &along[job.experiment] };
            triangles(jobs, jobs.iter().map(further).collect())
        };
        let found = in_batches(&jobs, batch).map_err(|(job, error)| self.infeasible(jobs[job].experiment, error))?;
        let mut blocks: Vec<Information> = along.iter().map(|along| Information::new(along.len())).collect();
        for (job, triangle) in jobs.iter().zip(found) {
            blocks[job.experiment].merge(&triangle);
        }
        Ok(blocks)
    }
}

/// Standardized errors of an experiment, sample by sample, output by output.
struct Errors(Vec<f64>);

impl Accumulate for Errors {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            self.0.extend((0..window.outputs()).map(|j| window.error(k, j, lane)));
        }
    }

    fn append(&mut self, later: Self) {
        self.0.extend(later.0);
    }
}

/// Of a job: the standardized errors of its record further along, and the direction.
struct Further<'f> {
    beyond: &'f [f64],
    along: &'f [f64],
}

/// Triangles of jobs that run in parallel lanes.
fn triangles(jobs: &[&Job<'_>], further: Vec<Further<'_>>) -> Result<Vec<Information>, Broken> {
    let mut absorber = Absorber::new(jobs, 1);
    let (mut beyond, mut along) = (vec![], vec![]);
    run(jobs, &mut |window| {
        let (lanes, outputs, columns) = (window.lanes(), window.outputs(), window.columns());
        if along.is_empty() {
            along.resize((columns - 1) * lanes, 0.0);
            for (lane, Further { along: from, .. }) in further.iter().enumerate() {
                along[lane..].iter_mut().step_by(lanes).zip(*from).for_each(|(to, from)| *to = *from);
            }
        }
        beyond.clear();
        beyond.resize(window.len() * outputs * lanes, 0.0);
        for (lane, Further { beyond: from, .. }) in further.iter().enumerate() {
            // A lane that has ended begins after its last sample.
            let from = from.iter().skip(window.begin[lane] * outputs).take(window.samples[lane] * outputs);
            beyond[lane..].iter_mut().step_by(lanes).zip(from).for_each(|(to, from)| *to = *from);
        }
        absorber.absorb_instead(window, &mut beyond, |window, beyond| {
            wide::run(window.width, Seconds { rows: window.rows_mut(), beyond, along: &along, columns, lanes });
        });
    })?;
    Ok((0..jobs.len()).flat_map(|lane| absorber.part(lane).1).collect())
}

/// Puts the second derivatives of the errors in their place, by the errors there and further along, and the slopes of the predictions. Where nothing
/// was measured all of them are zero, and stay so.
struct Seconds<'s> {
    rows: &'s mut [f64],
    /// Row, lane.
    beyond: &'s [f64],
    /// Column, lane.
    along: &'s [f64],
    columns: usize,
    lanes: usize,
}

impl Task for Seconds<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Seconds { rows, beyond, along, columns, lanes } = self;
        let (width, last) = (columns * lanes, (columns - 1) * lanes);
        let (far, twice) = (W::splat(FAR), W::splat(2.0 / (FAR * FAR)));
        for (row, beyond) in rows.chunks_exact_mut(width).zip(beyond.chunks_exact(lanes)) {
            for first in (0..lanes - lanes % W::LANES).step_by(W::LANES) {
                let mut slope = W::splat(0.0);
                for at in (first..last).step_by(lanes) {
                    slope = W::load(&row[at..]).mul_add(W::load(&along[at..]), slope);
                }
                let moved = W::load(&beyond[first..]).sub(W::load(&row[last + first..]));
                far.mul_add(slope, moved).mul(twice).store(&mut row[last + first..]);
            }
            for lane in lanes - lanes % W::LANES..lanes {
                let slopes = row[lane..last].iter().step_by(lanes).zip(along[lane..].iter().step_by(lanes));
                let slope: f64 = slopes.map(|(slope, along)| slope * along).sum();
                row[last + lane] = 2.0 / (FAR * FAR) * (beyond[lane] - row[last + lane] + FAR * slope);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::Problem;
    use crate::tests::{Current, Voltage};
    use crate::{Experiment, Fit, Huber, Kind, Model, Nothing, Sample, Scalar, Time, free, signals};

    signals! { struct Factors { a: "1", b: "1" } }

    /// `i = a^2 u + a b`.
    #[derive(Clone)]
    struct Square;

    impl Model for Square {
        type State = Nothing;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Factors;
        const KIND: Kind = Kind::Static;

        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Factors<S>) -> Current<S> {
            Current { i: p.a * p.a * u.u + p.a * p.b }
        }
    }

    const SIGMA: f64 = 0.5;
    const HUBER: f64 = 1.0;

    fn u(k: usize) -> f64 {
        0.1 * (k * 37 % 21) as f64
    }

    /// Every seventh is missing.
    fn y(k: usize, record: usize) -> f64 {
        if k % 7 == 3 { f64::NAN } else { (k * (11 + record) % 17) as f64 * 0.1 }
    }

    fn problem(samples: usize, record: usize, weighted: bool) -> Problem<'static> {
        let inputs = (0..samples).map(|k| Voltage { u: u(k) }).collect();
        let outputs = (0..samples).map(|k| Current { i: y(k, record) }).collect();
        let record = Experiment::new(&Square, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit =
            Fit::new(&Square, std::slice::from_ref(&record)).parameters(Factors { a: free(0.7).log(), b: free(0.2) });
        let fit = fit.noise(Current { i: SIGMA });
        match weighted {
            true => fit.loss(Huber(HUBER)).weighting(|s: &Sample<Square>| 1.0 + s.u.u).problem(),
            false => fit.problem(),
        }
        .unwrap()
    }

    /// The gradient where second derivatives stand in the place of errors, measured less predicted, and half the sum of their squares, by hand. The coordinate of `a` is its logarithm.
    fn by_hand(samples: usize, record: usize, weighted: bool, [x, along]: [[f64; 2]; 2]) -> [f64; 3] {
        let mut found = [0.0; 3];
        for k in (0..samples).filter(|k| k % 7 != 3) {
            let z = |t: f64| {
                let (a, b) = ((x[0] + t * along[0]).exp(), x[1] + t * along[1]);
                (y(k, record) - a * a * u(k) - a * b) / SIGMA
            };
            let (a, b) = (x[0].exp(), x[1]);
            let slopes = [(2.0 * a * u(k) + b) * a / SIGMA, a / SIGMA];
            let slope = slopes[0] * along[0] + slopes[1] * along[1];
            let second = (z(FAR) - z(0.0) + FAR * slope) * 2.0 / (FAR * FAR);
            let weight = if weighted { (1.0 + u(k)) * (HUBER / z(0.0).abs()).min(1.0) } else { 1.0 };
            found[0] -= weight * slopes[0] * second;
            found[1] -= weight * slopes[1] * second;
            found[2] += 0.5 * weight * second * second;
        }
        found
    }

    /// One by one and together, in lanes that end at different samples, of records in one window and in several; with weights and a robust loss.
    #[test]
    fn second_derivatives_by_hand() {
        for weighted in [false, true] {
            let lengths = [150, 40, 64, 129, 200, 90, 65];
            let problems: Vec<Problem<'_>> =
                lengths.iter().enumerate().map(|(i, samples)| problem(*samples, i, weighted)).collect();
            let objectives: Vec<Objective<'_>> = problems.iter().map(|problem| problem.objective().unwrap()).collect();
            let place = |i: usize| [[0.1 * i as f64 - 0.4, 0.3], [0.2, 0.05 * i as f64 - 0.1]];
            let places: Vec<[[f64; 2]; 2]> = (0..lengths.len()).map(place).collect();
            let bends = objectives.iter().zip(&places);
            let bends: Vec<Bend<'_>> = bends.map(|(objective, [x, along])| Bend { objective, x, along }).collect();
            for (i, together) in curvatures_together(&bends).into_iter().enumerate() {
                let alone = bends[i].objective.second_along(bends[i].x, bends[i].along).unwrap();
                let expected = by_hand(lengths[i], i, weighted, places[i]);
                for found in [alone, together.unwrap().unwrap()] {
                    let gradient = found.gradient();
                    for (found, expected) in [gradient[0], gradient[1], found.cost].into_iter().zip(expected) {
                        // Differences of errors, whose rounding the step of a tenth enlarges two hundred times.
                        assert!((found - expected).abs() < 1e-11 * (1.0 + expected.abs()), "{i}: {found} {expected}");
                    }
                }
            }
        }
    }
}
