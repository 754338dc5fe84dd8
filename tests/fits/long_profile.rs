//! An interval that is too short though the model is close to linear near the estimate.

use crate::common::*;
use greybox::diagnose::{self, End};
use greybox::estimate::{Knowledge, WarningCode};
use greybox::*;

signals! {
    struct Plasma { g: "mg/dl", x: "1/min" }
    struct Insulin { i: "uU/ml" }
    struct Glucose { g: "mg/dl" }
    struct Minimal { sg: "1/min", p2: "1/min", si: "ml/uU/min", gb: "mg/dl" }
}

/// The minimal model of glucose (Bergman et al. 1979): the state `x`, which no output gives, replaces what `sg` does.
#[derive(Clone)]
struct Bergman;

impl Model for Bergman {
    type State = Plasma;
    type Input = Insulin;
    type Output = Glucose;
    type Parameters = Minimal;

    fn derivative<S: Scalar>(&self, _t: S, x: &Plasma<S>, u: &Insulin<S>, p: &Minimal<S>) -> Plasma<S> {
        Plasma { g: p.sg * (p.gb - x.g) - x.x * x.g, x: p.p2 * (p.si * (u.i - 7.0) - x.x) }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Plasma<S>, _u: &Insulin<S>, _p: &Minimal<S>) -> Glucose<S> {
        Glucose { g: x.g }
    }
}

/// Six of 400 records with noise of a fifth: the curvature at the estimate is small, but further on `sg`, `p2` and `si` replace each other.
/// Before the cost at the ends was looked at, the first four were usable, as the last two are.
#[test]
fn an_interval_is_named_where_the_profile_is_twice_as_long() {
    let truth = Minimal { sg: 0.026, p2: 0.025, si: 5e-4, gb: 93.0 };
    for (seed, named) in [(53, true), (224, true), (312, true), (374, true), (72, false), (215, false)] {
        let inputs: Vec<Insulin> =
            levels(400, 8, seed).into_iter().map(|level| Insulin { i: 30.0 + 23.0 * level }).collect();
        let time = Time::Uniform { start: 0.0, step: 2.0 };
        let run = simulate(&Bergman, &truth, &Plasma { g: 280.0, x: 0.0 }, time, &inputs).unwrap();
        let record = run.with_noise(Glucose { g: 6.5 }, seed).experiment(&Bergman).unwrap();
        let start = Minimal { sg: free(0.03), p2: free(0.02), si: free(6e-4), gb: free(90.0) };
        let problem = Fit::new(&Bergman, &record).parameters(start).problem().unwrap();
        let estimate = problem.run().unwrap();
        let longest =
            ["sg", "p2", "si", "gb"].map(|name| longer(&problem, &estimate, name)).into_iter().fold(0.0, f64::max);
        assert_eq!(longest > 2.0, named, "record {seed}: {longest} times as long");
        let curved = estimate.warnings.iter().any(|warning| warning.code == WarningCode::CurvedInterval);
        assert_eq!(curved, named, "record {seed}: {estimate}");
    }
}

/// How many times as far the profile of a parameter reaches as its interval, on the longer side.
fn longer(problem: &Problem<'_>, estimate: &Summary, name: &str) -> f64 {
    let unknown = estimate.unknowns.iter().find(|unknown| unknown.name == name).unwrap();
    let Knowledge::Known { lower, upper, .. } = unknown.knowledge else { panic!("{estimate}") };
    let profile = diagnose::profile(problem, estimate, name, 0.95).unwrap();
    let (End::At(low), End::At(high)) = (profile.lower, profile.upper) else { return f64::INFINITY };
    let (below, above) = (unknown.value - lower, upper - unknown.value);
    ((unknown.value - low) / below).max((high - unknown.value) / above)
}
