//! Eigenvalues of the model about some points along the records.

use crate::problem::{Objective, Role};
use crate::record::Record;
use crate::transition::Transition;
use nalgebra::{Complex, DMatrix, Schur};

/// Number of points that are examined, of models with at most so many states; of larger ones fewer, since the eigenvalues take a time that grows
/// with the third power of the states.
const POINTS: usize = 8;
const STATES: usize = 300;
const ITERATIONS: usize = 10_000;

/// Relative change of a parameter for a slope.
const CHANGE: f64 = 1e-4;
/// Steps of the change of unknowns towards another number, and how far off it may be at their end (relative).
const STEPS: usize = 50;
const ARRIVED: f64 = 1e-3;

/// The state at a sample of an experiment.
pub(crate) struct StateAt {
    pub experiment: usize,
    pub sample: usize,
    pub state: Vec<f64>,
}

/// Those of the points that are examined.
pub(crate) fn some(points: &[StateAt]) -> impl Iterator<Item = &StateAt> {
    let states = points.first().map_or(0, |point| point.state.len());
    let fewer = (states as f64 / STATES as f64).powi(3).max(1.0);
    let examined = ((POINTS as f64 / fewer) as usize).max(1);
    let step = points.len().div_ceil(examined).max(1);
    // Of few points not the first ones, where a record may be at rest.
    let first = if examined < POINTS { step / 2 } else { 0 };
    points.iter().skip(first).step_by(step)
}

/// The eigenvalues of the state's Jacobian at a point (1/s).
pub(crate) fn eigenvalues(objective: &Objective<'_>, coordinates: &[f64], at: &StateAt) -> Option<Vec<Complex<f64>>> {
    let n = at.state.len();
    slopes(objective, coordinates, at, |record, p| objective.sweep.state_slopes(record, at.sample, &at.state, p))
        .and_then(|slopes| eigenvalues_of(n, &slopes))
}

/// The eigenvalues at a point, if any of them may have an imaginary part beyond a limit (1/s).
pub(crate) fn oscillating(
    objective: &Objective<'_>,
    coordinates: &[f64],
    at: &StateAt,
    limit: f64,
) -> Option<Vec<Complex<f64>>> {
    let n = at.state.len();
    let jacobian = |record: &Record, p: &[f64]| objective.sweep.state_slopes(record, at.sample, &at.state, p);
    let slopes = slopes(objective, coordinates, at, jacobian)?;
    (imaginary_bound(n, &slopes) > limit).then(|| eigenvalues_of(n, &slopes))?
}

/// Beyond which no eigenvalue has an imaginary part: the norm of half the difference between a matrix and its transpose (Bendixson, Acta
/// Mathematica 25 (1902) 359), and the norm of the matrix itself; both as the largest sum of magnitudes in a row.
fn imaginary_bound(n: usize, matrix: &[f64]) -> f64 {
    let sum = |i: usize, entry: fn(f64, f64) -> f64| -> f64 {
        (0..n).map(|j| entry(matrix[i * n + j], matrix[j * n + i]).abs()).sum()
    };
    let norm = |entry: fn(f64, f64) -> f64| (0..n).map(|i| sum(i, entry)).fold(0.0, f64::max);
    norm(|a, _| a).min(norm(|a, transposed| 0.5 * (a - transposed)))
}

/// The decays of the state about a point (1/s), negative where it decays; of a model whose samples change the state, from one sample to the next.
pub(crate) fn decays(objective: &Objective<'_>, coordinates: &[f64], at: &StateAt, interval: f64) -> Option<Vec<f64>> {
    let n = at.state.len();
    let jump = |record: &Record, p: &[f64]| objective.sweep.jump_slopes(record, at.sample, &at.state, p);
    let Some(jump) = slopes(objective, coordinates, at, jump) else {
        return Some(eigenvalues(objective, coordinates, at)?.iter().map(|value| value.re).collect());
    };
    let state = |record: &Record, p: &[f64]| objective.sweep.state_slopes(record, at.sample, &at.state, p);
    let a = slopes(objective, coordinates, at, state)?;
    let step = Transition::over(n, &a, &vec![0.0; n * n], interval).after(&jump).kept();
    Some(eigenvalues_of(n, &step)?.iter().map(|value| value.norm().ln() / interval).collect())
}

/// Slopes at a point; `None` where there are none, or not numbers.
fn slopes(
    objective: &Objective<'_>,
    coordinates: &[f64],
    at: &StateAt,
    of: impl Fn(&Record, &[f64]) -> Option<Vec<f64>>,
) -> Option<Vec<f64>> {
    let parameters = objective.problem.unknowns.of_experiment(at.experiment, coordinates).p;
    let slopes = of(&objective.problem.records[at.experiment], &parameters)?;
    slopes.iter().all(|slope| slope.is_finite()).then_some(slopes)
}

fn eigenvalues_of(n: usize, slopes: &[f64]) -> Option<Vec<Complex<f64>>> {
    let finite = slopes.iter().all(|slope| slope.is_finite());
    let schur = Schur::try_new(finite.then(|| DMatrix::from_row_slice(n, n, slopes))?, f64::EPSILON, ITERATIONS)?;
    Some(schur.complex_eigenvalues().iter().copied().collect())
}

/// The slopes of the logarithm of a number with respect to the logarithms of the unknowns, by differences, at a point of an experiment. `of` gives the
/// number divided by that at the point. Initial states, and what another experiment has of its own, have the slope zero.
pub(crate) fn relative_slopes(
    objective: &Objective<'_>,
    (experiment, coordinates): (usize, &[f64]),
    of: &dyn Fn(&[f64]) -> Option<f64>,
) -> Option<Vec<f64>> {
    let unknowns = &objective.problem.unknowns;
    let slope = |(i, value): (usize, f64)| {
        let unknown = &unknowns.row[i];
        if matches!(unknown.role, Role::InitialState(_)) || unknown.experiment.is_some_and(|e| e != experiment) {
            return Some(0.0);
        }
        let mut changed = coordinates.to_vec();
        changed[i] = unknown.parameter.transform.to_coordinate(value * (1.0 + CHANGE));
        Some(of(&changed)?.ln() / CHANGE)
    };
    unknowns.values(coordinates).into_iter().enumerate().map(slope).collect()
}

/// Newton's steps of some unknowns to where a number at a point of an experiment has another value, each step the least in logarithms; `None` if they
/// come to their bounds, or to where they do not move the number. `of` gives the number at a point, of several that which is nearest to its second
/// argument; `needed` the logarithm by which it has to grow; `largest` the most of that in one step.
pub(crate) fn reached<N: Copy>(
    objective: &Objective<'_>,
    (experiment, coordinates): (usize, &[f64]),
    moving: &[usize],
    (near, largest): (N, f64),
    of: &dyn Fn(&[f64], N) -> Option<N>,
    needed: impl Fn(N) -> f64,
) -> Option<Vec<f64>> {
    let (unknowns, mut x) = (&objective.problem.unknowns, coordinates.to_vec());
    let bounds = unknowns.bounds();
    let mut here = of(&x, near)?;
    for _ in 0..STEPS {
        let lacks = needed(here);
        if lacks.abs() < ARRIVED {
            return Some(x);
        }
        let grown = |x: &[f64]| Some((lacks - needed(of(x, here)?)).exp());
        let slopes = relative_slopes(objective, (experiment, &x), &grown)?;
        let slopes: Vec<f64> = moving.iter().map(|&i| slopes[i]).collect();
        let (steps, values) = (least(&slopes, lacks.clamp(-largest, largest))?, unknowns.values(&x));
        let before = x.clone();
        for (&i, step) in moving.iter().zip(steps) {
            let (changed, (lower, upper)) = (values[i] * step.exp(), bounds[i]);
            x[i] = unknowns.row[i].parameter.transform.to_coordinate(changed).max(lower).min(upper);
        }
        if x == before {
            return None;
        }
        here = of(&x, here)?;
    }
    None
}

/// The least changes that change by so much what has these slopes; `None` without a slope.
fn least(slopes: &[f64], needed: f64) -> Option<Vec<f64>> {
    let squares: f64 = slopes.iter().map(|slope| slope * slope).sum();
    (squares > 0.0).then(|| slopes.iter().map(|slope| slope * needed / squares).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Current, Gain, Voltage};
    use crate::{Experiment, Fit, Model, Scalar, Time, fixed};

    /// A current that decays with `a`, and that each sample divides by four.
    #[derive(Clone)]
    struct Divided;

    impl Model for Divided {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: u.u - p.a * x.i }
        }
        fn jump<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            Current { i: x.i * 0.25 }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    /// From sample to sample `e^{-a h} / 4`: a decay of `a + ln 4 / h`.
    #[test]
    fn decays_from_sample_to_sample() {
        let (h, a) = (0.5, 0.3);
        let record = Experiment::new(
            &Divided,
            Time::Uniform { start: 0.0, step: h },
            vec![Voltage { u: 1.0 }; 20],
            vec![Current { i: 1.0 }; 20],
        )
        .unwrap();
        let problem = Fit::new(&Divided, &record).parameters(Gain { a: fixed(a) }).problem().unwrap();
        let objective = problem.objective().unwrap();
        let at = StateAt { experiment: 0, sample: 3, state: vec![0.7] };
        let found = decays(&objective, &objective.start(), &at, h).unwrap();
        assert!((found[0] + a + 4f64.ln() / h).abs() < 1e-14, "{found:?}");
        let open = eigenvalues(&objective, &objective.start(), &at).unwrap();
        assert!((open[0].re + a).abs() < 1e-14, "{open:?}");
    }

    /// The bound is reached by a rotation, and is zero where a matrix is symmetric; no matrix has an eigenvalue beyond it.
    #[test]
    fn imaginary_parts_are_bounded() {
        assert_eq!(imaginary_bound(2, &[-0.5, 3.0, -3.0, -0.5]), 3.0);
        assert_eq!(imaginary_bound(2, &[-1.0, 7.0, 7.0, 2.0]), 0.0);
        assert_eq!(imaginary_bound(2, &[0.0, 1.0, -100.0, 0.0]), 50.5);
        for n in 2..12 {
            let matrix: Vec<f64> = (0..n * n).map(|k| ((k * k * 7919 + 13 * k) % 101) as f64 - 50.0).collect();
            let largest = eigenvalues_of(n, &matrix).unwrap().iter().map(|value| value.im).fold(0.0, f64::max);
            assert!(largest <= imaginary_bound(n, &matrix), "{n}: {largest}");
        }
    }

    #[test]
    fn changes_are_the_least() {
        assert_eq!(least(&[3.0, -4.0], 0.5), Some(vec![0.06, -0.08]));
        assert_eq!([least(&[0.0, 0.0], 0.5), least(&[], 0.5)], [None, None]);
    }
}
