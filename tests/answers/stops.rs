//! Time limit and flag hold for what is asked of an estimate, too, where that is further searches.

use greybox::diagnose::{Resampling, bootstrap, profile};
use greybox::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

signals! { pub struct Force { u: "N" } }
signals! { pub struct Speed { v: "m/s" } }
signals! { pub struct Drag { a: "1/s", b: "1/kg" } }

#[derive(Clone)]
struct Body;

impl Model for Body {
    type State = Speed;
    type Input = Force;
    type Output = Speed;
    type Parameters = Drag;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Force<S>, p: &Drag<S>) -> Speed<S> {
        Speed { v: p.b * u.u - p.a * x.v }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Force<S>, _p: &Drag<S>) -> Speed<S> {
        *x
    }
}

#[test]
fn diagnoses_that_search_stop_with_the_fit() {
    let input: Vec<Force> = (0..200).map(|k| Force { u: f64::from(k / 20 % 2) }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let truth = Drag { a: 1.0, b: 2.0 };
    let run = Simulator::new(&Body).run(&truth, &Speed { v: 0.0 }, time, &input).unwrap();
    let record = run.with_noise(Speed { v: 0.01 }, 3).experiment(&Body).unwrap();
    let fit = || Fit::new(&Body, &record).parameters(Drag { a: free(2.0), b: free(1.0) });
    let estimate = fit().run().unwrap().into_summary();
    let limited = fit().time_limit(Duration::ZERO).problem().unwrap();
    let cancelled = fit().cancel(Arc::new(AtomicBool::new(true))).problem().unwrap();
    for (problem, word) in [(&limited, "the time limit of 0 s"), (&cancelled, "cancelled")] {
        let errors = [
            profile(problem, &estimate, "a", 0.95).unwrap_err().to_string(),
            bootstrap(problem, &estimate, Resampling::Residuals, 100, 1).unwrap_err().to_string(),
        ];
        for error in errors {
            assert!(error.contains(word), "{error}");
        }
    }
    // A limit that no clock reaches is none.
    let patient = fit().time_limit(Duration::MAX).problem().unwrap();
    assert!(profile(&patient, &estimate, "a", 0.95).unwrap().covers(1.0));
    assert!(patient.run().unwrap().outcome.converged());
}

/// A start that cannot be simulated is not looked into after the fit was stopped.
#[test]
fn what_fails_is_not_looked_for_after_a_stop() {
    let input = vec![Force { u: 1.0 }; 2_000];
    let output = vec![Speed { v: 1.0 }; 2_000];
    let record = Experiment::new(&Body, Time::Uniform { start: 0.0, step: 1.0 }, input, output).unwrap();
    let fit = || Fit::new(&Body, &record).parameters(Drag { a: free(-10.0), b: free(1.0) });
    let error = fit().run().unwrap_err();
    assert!(matches!(error, Error::Start(_)), "{error}");
    let error = fit().cancel(Arc::new(AtomicBool::new(true))).run().unwrap_err().to_string();
    assert!(error.contains("cancelled"), "{error}");
}
