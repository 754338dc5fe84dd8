//! Fits that are cancelled at any of their evaluations: what was left out is said.

use greybox::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};

signals! { struct Voltage { u: "V" } }
signals! { struct Current { i: "A" } }
signals! { struct Circuit { a: "1/s", b: "A/(V s)" } }

#[derive(Clone)]
struct Lag;

impl Model for Lag {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Circuit;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Circuit<S>) -> Current<S> {
        Current { i: p.b * u.u - p.a * x.i }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Circuit<S>) -> Current<S> {
        *x
    }
}

/// The flag is set by the weighting, which is asked in each pass over the data. Wherever that is, there is no estimate yet, or one that says
/// what was left out, and that is not usable without care; where the flag is not set, nothing is said.
#[test]
fn a_fit_that_is_cancelled_says_so() {
    let input: Vec<Voltage> = (0..100).map(|k| Voltage { u: f64::from(k / 10 % 2) }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let run = simulate(&Lag, &Circuit { a: 1.0, b: 2.0 }, &Current { i: 0.0 }, time, &input).unwrap();
    let record = run.with_noise(Current { i: 0.05 }, 3).experiment(&Lag).unwrap();
    let calls = Arc::new(AtomicUsize::new(0));
    let cancelled_at = |last: usize| {
        let flag = Arc::new(AtomicBool::new(false));
        let (count, raise) = (calls.clone(), flag.clone());
        count.store(0, SeqCst);
        let weighting = move |_: &Sample<Lag>| {
            if count.fetch_add(1, SeqCst) == last {
                raise.store(true, SeqCst);
            }
            1.0
        };
        let fit = Fit::new(&Lag, &record).parameters(Circuit { a: free(2.0), b: free(1.0) });
        fit.loss(Huber::default()).weighting(weighting).cancel(flag).run()
    };
    let whole = cancelled_at(usize::MAX).unwrap();
    let said = |found: &Estimate<Lag>| found.warnings.iter().any(|warning| warning.code == WarningCode::NotExamined);
    assert!(whole.outcome.converged() && !said(&whole), "{whole}");
    let (all, mut converged) = (calls.load(SeqCst), 0);
    for last in (0..all).step_by(37) {
        let Ok(found) = cancelled_at(last) else { continue };
        assert!(said(&found) && found.severity() > Severity::Usable, "{last} of {all}: {found}");
        converged += usize::from(found.outcome.converged());
    }
    assert!(converged > 0);
}
