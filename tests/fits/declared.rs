//! What is declared of parameters holds, and what has no effect is refused.

use crate::shared::shared;
use greybox::models::{AxisMotion, AxisParameters, Command, ControlledAxisOutput, Positioning, Reference};
use greybox::*;

signals! { pub struct Push { u: "N" } }
signals! { pub struct Speed { v: "m/s" } }
signals! { pub struct Cart { m: "kg", f: "N s/m" } }

/// `m dv/dt = u - f v`.
#[derive(Clone)]
struct Rolling;

impl Model for Rolling {
    type State = Speed;
    type Input = Push;
    type Output = Speed;
    type Parameters = Cart;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Push<S>, p: &Cart<S>) -> Speed<S> {
        Speed { v: (u.u - p.f * x.v) / p.m }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Push<S>, _p: &Cart<S>) -> Speed<S> {
        *x
    }
}

fn record(f: f64) -> ExperimentOf<Rolling> {
    let input: Vec<Push> = (0..300).map(|k| Push { u: if k / 40 % 2 == 0 { 1.0 } else { -1.0 } }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.01 };
    let run = Simulator::new(&Rolling).run(&Cart { m: 1.0, f }, &Speed { v: 0.0 }, time, &input).unwrap();
    run.with_noise(Speed { v: 0.002 }, 1).experiment(&Rolling).unwrap()
}

#[test]
fn a_positive_parameter_that_is_not_makes_the_estimate_unusable() {
    for (truth, usable) in [(0.4, true), (-0.4, false)] {
        let record = record(truth);
        for f in [free(0.1).positive(), free(0.1)] {
            let fit = Fit::new(&Rolling, &record).parameters(Cart { m: free(2.0).positive(), f }).run().unwrap();
            let found = fit.warnings.iter().find(|warning| warning.code == WarningCode::NotPositive);
            assert!((fit.parameters.f - truth).abs() < 0.02, "the search is not bounded: {fit}");
            assert_eq!(found.is_some(), f.positive && !usable, "{fit}");
            if let Some(warning) = found {
                assert!(fit.severity() == Severity::NotUsable && warning.text.contains("`f` is -0.4"), "{fit}");
            }
        }
    }
}

/// The logarithm of a quantity whose least cost is below zero: the quantity shrinks until it is negligible, and the answer is that with a
/// bound at zero, up to what the quantity still changes: a part of 1e-9 of the errors. The interval reaches from zero, too.
#[test]
fn a_logarithm_that_vanishes_is_a_bound_at_zero() {
    let record = record(-0.05);
    let fit = |f: Parameter| Fit::new(&Rolling, &record).parameters(Cart { m: free(1.0), f }).run().unwrap();
    let (logarithm, bound) = (fit(free(0.1).log()), fit(free(0.1).within(0.0, f64::INFINITY)));
    println!("{logarithm}\n{bound}");
    assert!(logarithm.outcome.converged() && logarithm.iterations < 100, "{logarithm}");
    let end = |fit: &Estimate<Rolling>| match fit.knowledge.f {
        Knowledge::Held { bound: 0.0, end } => end,
        _ => panic!("{fit}"),
    };
    let error = |fit: &Estimate<Rolling>| fit.knowledge.m.standard_error().unwrap();
    assert!((logarithm.parameters.m - bound.parameters.m).abs() < 1e-8 * error(&bound), "{logarithm} {bound}");
    assert!((error(&logarithm) / error(&bound) - 1.0).abs() < 1e-6, "{logarithm} {bound}");
    assert_eq!(end(&logarithm).is_some(), end(&bound).is_some());
    assert!(logarithm.warnings.iter().any(|one| one.text.contains("its logarithm has no minimum")), "{logarithm}");
}

/// Bounds within the interval end it, at any probability; where the estimate is at one, its interval ends at the other.
#[test]
fn no_interval_reaches_beyond_bounds() {
    let record = record(0.4);
    let fit = |f: Parameter| Fit::new(&Rolling, &record).parameters(Cart { m: free(1.0), f }).run().unwrap();
    let free_of_bounds = fit(free(0.3));
    let (value, error) = (free_of_bounds.parameters.f, free_of_bounds.knowledge.f.standard_error().unwrap());
    let at = |errors: f64| value + errors * error;
    let inside = fit(free(value).within(at(-0.5), at(0.7)));
    let Knowledge::Known { standard_error, lower, upper } = inside.knowledge.f else { panic!("{inside}") };
    assert!((lower, upper) == (at(-0.5), at(0.7)) && (standard_error / error - 1.0).abs() < 1e-6, "{inside}");
    assert_eq!(inside.interval("f", 0.999), Some((at(-0.5), at(0.7))));
    // A tenth of a standard error to either side has a probability of 8 %.
    let (lower, upper) = inside.interval("f", 0.07).unwrap();
    assert!(lower > at(-0.1) && upper < at(0.1), "{lower} {upper}");
    let one_side = fit(free(value).within(at(-0.5), f64::INFINITY));
    let (lower, upper) = (one_side.interval("f", 0.95).unwrap(), free_of_bounds.interval("f", 0.95).unwrap());
    assert!(lower.0 == at(-0.5) && (lower.1 - upper.1).abs() < 1e-6 * error, "{one_side}");
    let held = fit(free(at(0.6)).within(at(0.5), at(0.6)));
    assert_eq!(held.knowledge.f, Knowledge::Held { bound: at(0.5), end: Some(at(0.6)) }, "{held}");
}

signals! { pub struct LaggingMotion { q: "m", v: "m/s", vm: "m/s" } }

/// The axis of the benchmark EMPS under a controller in continuous time, whose speed lags by 1 ms.
#[derive(Clone)]
struct LaggingLoop;

impl LaggingLoop {
    fn command<S: Scalar>(x: &LaggingMotion<S>, u: &Reference<S>) -> S {
        (((u.qg - x.q) * 160.18 - x.vm) * 243.45).clamp(-10.0, 10.0)
    }
}

impl Model for LaggingLoop {
    type State = LaggingMotion;
    type Input = Reference;
    type Output = ControlledAxisOutput;
    type Parameters = AxisParameters;
    fn derivative<S: Scalar>(
        &self,
        t: S,
        x: &LaggingMotion<S>,
        u: &Reference<S>,
        p: &AxisParameters<S>,
    ) -> LaggingMotion<S> {
        let vir = Self::command(x, u);
        let axis = Positioning::EMPS.derivative(t, &AxisMotion { q: x.q, v: x.v }, &Command { vir }, p);
        LaggingMotion { q: axis.q, v: axis.v, vm: (x.v - x.vm) * 1e3 }
    }
    fn output<S: Scalar>(
        &self,
        _t: S,
        x: &LaggingMotion<S>,
        u: &Reference<S>,
        _p: &AxisParameters<S>,
    ) -> ControlledAxisOutput<S> {
        ControlledAxisOutput { qm: x.q, vir: Self::command(x, u) }
    }
}

#[test]
fn the_wrong_hold_of_the_benchmark_is_not_usable() {
    let Some(path) = shared("emps/emps.csv") else { return };
    let rest = LaggingMotion { q: free(0.0), v: fixed(0.0), vm: fixed(0.0) };
    let axis = AxisParameters {
        m: free(80.0).positive(),
        fv: free(150.0).positive(),
        fc: free(15.0).positive(),
        offset: free(0.0),
    };
    let record = Experiment::from_file(&LaggingLoop, path).unwrap().initial(rest);
    let wrong = Fit::new(&LaggingLoop, &record).parameters(axis).run().unwrap();
    assert!(wrong.severity() == Severity::NotUsable && wrong.parameters.fv < 0.0, "{wrong}");
    let right = Fit::new(&LaggingLoop, &record.hold(Hold::First)).parameters(axis).run().unwrap();
    assert!(right.warnings.iter().all(|warning| warning.code != WarningCode::NotPositive), "{right}");
}

#[test]
fn what_has_no_effect_is_refused() {
    let record = record(0.4);
    for (parameter, word) in [
        (fixed(0.4).prior(0.4, 0.1), "its prior has no effect because it is fixed"),
        (fixed(0.4).per_experiment(), "its value per experiment has no effect"),
        (free(0.4).log().within(-1.0, 1.0), "its lower bound -1 has no effect"),
        (free(-0.4).positive(), "declared positive, but its start is -0.4"),
    ] {
        let fit = Fit::new(&Rolling, &record).parameters(Cart { m: free(2.0), f: parameter });
        let error = fit.run().unwrap_err().to_string();
        assert!(error.contains(word) && error.contains("`f`"), "{error}");
    }
}
