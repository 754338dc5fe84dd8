//! Starts of searches, and places of which the best become starts: a Latin hypercube in the scale of each unknown.

use crate::optimize::{LeastSquares, Linearization};
use crate::parameter::{Parameter, Prior, Transform};
use crate::problem::{Objective, Role};
use crate::random::Random;
use statrs::distribution::{ContinuousCDF, Normal};

/// How far a start without bounds or prior is drawn to either side, as a factor.
pub(super) const REACH: f64 = 10.0;
/// Bounds of one sign whose ratio is at least this are a range of magnitudes.
const DECADE: f64 = 10.0;
pub(super) const SEED: u64 = 0x5354_4152_5453;

/// The coordinates of `count` starts, the declared one first; those of unknowns without bounds or prior within a factor `reach` of it.
pub(super) fn starts(plain: &Objective<'_>, count: usize, reach: f64, seed: u64) -> Vec<Vec<f64>> {
    let unknowns = &plain.problem.unknowns;
    let declared = unknowns.start();
    let others = count - 1;
    let mut starts = vec![declared.clone(); count];
    let sizes = sizes(plain, &declared);
    for (i, (unknown, bounds)) in unknowns.row.iter().zip(unknowns.bounds()).enumerate() {
        let Parameter { lower, upper, prior, transform, .. } = unknown.parameter;
        let open = !(lower.is_finite() && upper.is_finite());
        if matches!(unknown.role, Role::InitialState(_)) && prior.is_none() && open {
            continue;
        }
        let mut random = Random::stream(seed, i as u64);
        for (start, part) in starts[1..].iter_mut().zip(strata(others, &mut random)) {
            let value = drawn(&unknown.parameter, part, sizes[i], reach);
            start[i] = transform.to_coordinate(value).max(bounds.0).min(bounds.1);
        }
    }
    starts
}

/// One number of each of `n` strata of zero to one, in random order.
fn strata(n: usize, random: &mut Random) -> Vec<f64> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, random.below(i + 1));
    }
    order.into_iter().map(|stratum| (stratum as f64 + random.uniform()) / n as f64).collect()
}

/// The change of each unknown that alone changes the prediction by the errors at the declared start; looked at only where an
/// unknown starts at zero.
fn sizes(plain: &Objective<'_>, declared: &[f64]) -> Vec<f64> {
    let size = |linear: &Linearization| {
        let left = linear.sum_of_squares().sqrt();
        let size = |norm: f64| if norm > 0.0 { left / norm } else { 0.0 };
        linear.column_norms().into_iter().map(size).collect::<Vec<f64>>()
    };
    let found = declared.contains(&0.0).then(|| plain.linearize(declared).ok()).flatten();
    found.as_ref().map_or(vec![0.0; declared.len()], size)
}

/// The value at a part (0 to 1) of what is known of a parameter.
fn drawn(parameter: &Parameter, part: f64, size: f64, reach: f64) -> f64 {
    let Parameter { start, upper, prior, transform, .. } = *parameter;
    let is_log = transform == Transform::Log;
    let lower = if is_log || parameter.positive { parameter.lower.max(0.0) } else { parameter.lower };
    let between = |low: f64, high: f64| low + part * (high - low);
    let geometric = |low: f64, high: f64| low * (high / low).powf(part);
    let whole = lower.is_finite() && upper.is_finite();
    let spans = |small: f64, large: f64| small > 0.0 && (is_log || large / small >= DECADE);
    if let Some(prior) = prior {
        return quantile(prior, lower, upper, part).unwrap_or(start);
    }
    if whole && spans(lower, upper) {
        geometric(lower, upper)
    } else if whole && spans(-upper, -lower) {
        -geometric(-lower, -upper)
    } else if whole && !is_log {
        between(lower, upper)
    } else if start > 0.0 {
        geometric((start / reach).max(lower), (start * reach).min(upper))
    } else if start < 0.0 {
        -geometric((-start / reach).max(-upper), (-start * reach).min(-lower))
    } else {
        between(lower.max(-size), upper.min(size))
    }
}

/// The quantile of a prior that is cut off at bounds; `None` where they leave next to nothing of it.
fn quantile(prior: Prior, lower: f64, upper: f64, part: f64) -> Option<f64> {
    let normal = Normal::new(prior.mean, prior.std).ok()?;
    let (below, above) = (normal.cdf(lower), normal.cdf(upper));
    let value = normal.inverse_cdf(below + part * (above - below));
    (above - below > 1e-12 && value.is_finite()).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Experiment, Fit, Model, Scalar, Time, fixed, free, signals};

    /// A quarter of the way through what is known of a parameter: evenly between bounds; by magnitude where these span a decade,
    /// of either sign, and about a start without bounds, a factor of ten to either side, cut off at a bound; about a start of zero
    /// by its size; by the quantiles of a prior, cut off at bounds.
    #[test]
    fn what_is_known_is_drawn_from() {
        let quarter = |parameter: Parameter| drawn(&parameter, 0.25, 3.0, REACH);
        let prior = |parameter: Parameter| parameter.prior(5.0, 2.0);
        let cases = [
            (free(1.0).within(-1.0, 3.0), 0.0),
            (free(2.0).within(1.0, 9.0), 3.0),
            (free(2.0).within(1.0, 16.0), 2.0),
            (free(2.0).within(1.0, 9.0).log(), 3f64.sqrt()),
            (free(-2.0).within(-16.0, -1.0), -8.0),
            (free(2.0), 2.0 / 10f64.sqrt()),
            (free(-2.0), -2.0 / 10f64.sqrt()),
            (free(2.0).within(2.0, f64::INFINITY), 2.0 * 10f64.powf(0.25)),
            (free(-2.0).within(f64::NEG_INFINITY, -2.0), -2.0 * 10f64.powf(0.25)),
            (free(0.0), -1.5),
            (free(0.0).within(-1.0, f64::INFINITY), 0.0),
            (free(0.0).within(-1.0, 9.0).positive(), 2.25),
            // The lower quartile of a normal distribution.
            (prior(free(5.0)), 5.0 - 2.0 * 0.674_489_750_196_081_7),
            // Half of it, above the mean: the part 0.625.
            (prior(free(5.0)).within(5.0, f64::INFINITY), 5.0 + 2.0 * 0.318_639_363_964_375_1),
            (prior(free(5.0)).within(1e3, f64::INFINITY), 5.0),
        ];
        for (parameter, expected) in cases {
            // statrs has the quantile to 1e-10.
            assert!((quarter(parameter) - expected).abs() < 1e-8, "{parameter:?}: {}", quarter(parameter));
        }
    }

    /// One of each stratum.
    #[test]
    fn each_stratum_is_drawn_once() {
        let mut parts: Vec<usize> =
            strata(40, &mut Random::stream(1, 1)).into_iter().map(|part| (40.0 * part).floor() as usize).collect();
        assert!(!parts.is_sorted());
        parts.sort_unstable();
        assert_eq!(parts, (0..40).collect::<Vec<usize>>());
    }

    signals! { struct Input { u: "V" } }
    signals! { struct Level { x: "V" } }
    signals! { struct Curve { a: "1/s", b: "V", c: "1" } }

    /// `dx/dt = -a x`, `y = x + b u`, whatever `c`.
    #[derive(Clone)]
    struct Decay;

    impl Model for Decay {
        type State = Level;
        type Input = Input;
        type Output = Level;
        type Parameters = Curve;

        fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Input<S>, p: &Curve<S>) -> Level<S> {
            Level { x: -p.a * x.x }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Input<S>, p: &Curve<S>) -> Level<S> {
            Level { x: x.x + p.b * u.u }
        }
    }

    fn record(initial: Parameter) -> Experiment<Level, Input, Level> {
        let inputs: Vec<Input> = (0..8).map(|k| Input { u: f64::from(k) }).collect();
        let outputs = (0..8).map(|k| Level { x: 1.0 + f64::from(k % 3) }).collect();
        let record = Experiment::new(&Decay, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
        record.initial(Level { x: initial })
    }

    /// Of an unknown that starts at zero, the change that alone is as large as the errors there: with predictions of zero, the root
    /// of `sum y^2 / sum u^2`. Of one without influence, and where none starts at zero, nothing.
    #[test]
    fn sizes_by_hand() {
        let record = record(fixed(0.0));
        let of = |b: f64| {
            let parameters = Curve { a: fixed(1.0), b: free(b), c: free(0.5 * b) };
            let problem = Fit::new(&Decay, &record).parameters(parameters).noise(Level { x: 0.3 }).problem().unwrap();
            let objective = problem.objective().unwrap();
            sizes(&objective, &objective.start())
        };
        let squares: f64 = (0..8).map(|k| (1.0 + f64::from(k % 3)).powi(2)).sum();
        let found = of(0.0);
        assert!((found[0] - (squares / 140.0).sqrt()).abs() < 1e-12 && found[1] == 0.0, "{found:?}");
        assert_eq!(of(2.0), [0.0, 0.0]);
    }

    /// An initial state is drawn where bounds or a prior say from what; else all searches start from the declared one.
    #[test]
    fn initial_states_are_drawn_within_what_is_known() {
        let drawn = |initial: Parameter| {
            let record = record(initial);
            let parameters = Curve { a: free(1.0), b: fixed(0.0), c: fixed(0.0) };
            let problem = Fit::new(&Decay, &record).parameters(parameters).noise(Level { x: 0.3 }).problem().unwrap();
            let starts = starts(&problem.objective().unwrap(), 5, REACH, SEED);
            starts.iter().filter(|start| start[1] != 0.5).count()
        };
        assert_eq!(drawn(free(0.5)), 0);
        assert_eq!(drawn(free(0.5).within(0.0, f64::INFINITY)), 0);
        assert_eq!(drawn(free(0.5).within(-1.0, 1.0)), 4);
        assert_eq!(drawn(free(0.5).prior(0.0, 1.0)), 4);
    }
}
