//! Failures that other programs do not report: each is named here.

use crate::common::{Branch, Current, Lag, Voltage};
use greybox::diagnose::{Resampling, bootstrap};
use greybox::optimize::Severity;
use greybox::{
    Error, Estimate, Experiment, Fit, Kind, Knowledge, Model, Nothing, Report, Scalar, Time, fixed, free, signals,
};

/// Steps of 0.01 s with `gain = 2 A/V`, `tau = 0.05 s` and a little noise; the samples in `lost` are cut out.
fn record(lost: std::ops::Range<usize>) -> Experiment<Current, Voltage, Current> {
    let (mut x, decay) = (0.0, (-0.2f64).exp());
    let (mut times, mut inputs, mut outputs) = (vec![], vec![], vec![]);
    for k in 0..2000usize {
        let u = if (k / 37) % 2 == 0 { 1.0 } else { -0.5 };
        if !lost.contains(&k) {
            times.push(k as f64 * 0.01);
            inputs.push(Voltage { u });
            outputs.push(Current { i: x + 0.02 * ((k as f64 * 0.754_877_666_246_693).fract() - 0.5) });
        }
        x = 2.0 * u + (x - 2.0 * u) * decay;
    }
    Experiment::new(&Lag, Time::from_stamps(times), inputs, outputs).unwrap()
}

#[test]
fn a_gap_in_time_is_named() {
    let parameters = Branch { gain: free(1.0), tau: free(0.1).log() };
    let whole = Fit::new(&Lag, &record(0..0)).parameters(parameters).run().unwrap();
    assert!(whole.warnings.iter().all(|w| !w.text.contains("time jumps")), "{whole}");
    let torn = Fit::new(&Lag, &record(700..760)).parameters(parameters).run().unwrap();
    let warning = torn.warnings.iter().find(|w| w.text.contains("time jumps")).unwrap();
    assert!(warning.text.contains("no sample from 6.99 s to 7.6"), "{}", warning.text);
    assert!(torn.severity() >= Severity::UsableWithCare);
}

#[test]
fn a_parameter_on_its_bound_has_no_interval() {
    let parameters = Branch { gain: free(1.0).within(0.0, 1.8), tau: free(0.1).log() };
    let estimate = Fit::new(&Lag, &record(0..0)).parameters(parameters).run().unwrap();
    assert_eq!(estimate.knowledge.gain, Knowledge::Held { bound: 1.8, end: None });
    assert_eq!(estimate.covariance.get(0, 0), 0.0);
    assert!(estimate.warnings.iter().any(|w| w.text.contains("`gain` is held at its bound 1.8")), "{estimate}");
}

/// From a thousand times too much or too little the search arrives, or the estimate is not called usable.
#[test]
fn a_guess_far_off_arrives_or_is_named() {
    for guess in [50.0, 5e-5] {
        for transformed in [false, true] {
            let tau = if transformed { free(guess).log() } else { free(guess) };
            let record = record(0..0);
            let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.0), tau });
            match fit.starts(16).run() {
                Ok(estimate) => {
                    let arrived = (estimate.parameters.tau / 0.05 - 1.0).abs() < 0.01;
                    let (tau, starts) = (estimate.parameters.tau, &estimate.starts);
                    println!("{guess} {transformed}: tau = {tau} {:?} {starts:?}", estimate.severity());
                    assert!(arrived || estimate.severity() == Severity::NotUsable, "{estimate}\n{starts:?}");
                }
                Err(error) => {
                    println!("{guess} {transformed}: {error}");
                    assert!(matches!(error, Error::Start(_)), "{error}");
                }
            }
        }
    }
}

/// An unstable simulation is an error with its place, not a fit of nothing.
#[test]
fn no_success_on_what_is_not_a_number() {
    let parameters = Branch { gain: free(1.0), tau: fixed(-1e-3) };
    let error = Fit::new(&Lag, &record(0..0)).parameters(parameters).run().unwrap_err();
    assert!(
        matches!(&error, Error::Start(failure) if failure.signal == "state `i`" && failure.time.time > 0.0),
        "{error}"
    );
}

/// Of blocks as long as the record there is one resample only, whose refits do not scatter.
#[test]
fn blocks_as_long_as_the_record_are_refused() {
    let parameters = Branch { gain: free(1.0), tau: free(0.1) };
    let record = record(0..0);
    let problem = Fit::new(&Lag, &record).parameters(parameters).problem().unwrap();
    let summary = problem.run().unwrap();
    let error = bootstrap(&problem, &summary, Resampling::Blocks(1001), 20, 1).unwrap_err().to_string();
    assert!(error.contains("blocks of 1001 residuals") && error.contains("which has 2000"), "{error}");
    assert!(bootstrap(&problem, &summary, Resampling::Blocks(1000), 20, 1).is_ok());
}

signals! { struct Amplified { g: "1", b: "V", c: "V", idle: "1" } }

/// `y = g u + b + c + 0 idle`.
#[derive(Clone)]
struct Offsets;

impl Model for Offsets {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Amplified;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Amplified<S>) -> Current<S> {
        Current { i: p.g * u.u + p.b + p.c + p.idle * 0.0 }
    }
}

fn amplified() -> Experiment<Nothing, Voltage, Current> {
    let inputs: Vec<Voltage> = (0..400).map(|k| Voltage { u: 1.0 + (k as f64 * 0.37).sin() }).collect();
    let noise = |k: usize| 0.1 * ((k as f64 * 0.754_877_666_246_693).fract() - 0.5);
    let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 3.0 * u.u + 1.0 + noise(k) }).collect();
    Experiment::new(&Offsets, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap()
}

/// A search may converge although an unknown moves nothing; the report does not lead with a mere "usable".
#[test]
fn an_unknown_without_influence_is_named() {
    let record = amplified();
    let parameters = Amplified { g: free(1.0), b: free(0.0), c: fixed(0.0), idle: free(2.0) };
    let problem = Fit::new(&Offsets, &record).parameters(parameters).problem().unwrap();
    let estimate = Estimate::<Offsets>::of(problem.run().unwrap()).unwrap();
    assert!(estimate.outcome.converged());
    assert_eq!(estimate.knowledge.idle, Knowledge::Unidentified);
    let report = Report::new(&problem, &estimate).unwrap();
    assert!(report.severity >= Severity::UsableWithCare);
    let text = report.to_string();
    assert!(text.contains("The data do not determine 1 of the 3 unknowns."), "{text}");
    assert!(text.contains("`idle` has no influence") && text.contains("`idle` moves no output by a slope"), "{text}");
}

/// What only a sum is known of does not make the rest look better known than it is: the gain has the standard error that it
/// has with one of the two offsets fixed, and not the smaller one of both fixed.
#[test]
fn what_is_known_together_still_counts() {
    let record = amplified();
    let error = |b, c| {
        let parameters = Amplified { g: free(1.0), b, c, idle: fixed(0.0) };
        let estimate = Fit::new(&Offsets, &record).parameters(parameters).run().unwrap();
        (estimate.knowledge.g.standard_error().unwrap(), estimate.knowledge.b)
    };
    let (both, b) = error(free(0.4), free(0.3));
    assert_eq!(b, Knowledge::Unidentified);
    let (one, _) = error(free(0.4), fixed(0.3));
    let (neither, _) = error(fixed(0.5), fixed(0.5));
    // The same degrees of freedom and the same minimum: equal to rounding.
    assert!((both / one - 1.0).abs() < 1e-6, "{both} {one}");
    assert!(neither < 0.7 * one, "{neither} {one}");
}

#[cfg(not(debug_assertions))]
mod emps {
    use super::*;
    use crate::shared::shared;

    signals! { struct Motion { q: "m", v: "m/s" } }
    signals! { struct Position { q: "m" } }
    signals! { struct Command { vir: "V" } }
    signals! { struct Slide { m: "kg", fv: "N s/m", fc: "N", offset: "N" } }

    #[derive(Clone)]
    struct Emps;

    impl Model for Emps {
        type State = Motion;
        type Input = Command;
        type Output = Position;
        type Parameters = Slide;

        fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Command<S>, p: &Slide<S>) -> Motion<S> {
            let friction = p.fv * x.v + p.fc * (x.v * 500.0).tanh();
            Motion { q: x.v, v: (u.vir * 35.150_651_88 - friction - p.offset) / p.m }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Command<S>, _p: &Slide<S>) -> Position<S> {
            Position { q: x.q }
        }
    }

    /// Simulated from a bad start, the search may end at some mass that is wrong; then it says so.
    #[test]
    fn a_wrong_mass_is_named() {
        let Some(path) = shared("emps/emps.csv") else { return };
        let text = std::fs::read_to_string(path).unwrap();
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
        let inputs = rows.iter().map(|row| Command { vir: row[1] }).collect();
        let outputs = rows.iter().map(|row| Position { q: row[2] }).collect();
        let record = Experiment::new(&Emps, Time::Uniform { start: 0.0, step: 1e-3 }, inputs, outputs).unwrap();
        let record = record.initial(Motion { q: fixed(rows[0][2]), v: fixed(0.0) });
        for m in [13.0, 500.0] {
            let parameters = Slide { m: free(m), fv: free(100.0), fc: free(10.0), offset: free(0.0) };
            let estimate = Fit::new(&Emps, &record).parameters(parameters).starts(6).run().unwrap();
            println!("{estimate}");
            let found = (estimate.parameters.m / 95.1 - 1.0).abs() < 0.05;
            assert!(found || estimate.severity() == Severity::NotUsable, "{estimate}\n{:?}", estimate.starts);
        }
    }
}
