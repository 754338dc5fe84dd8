#![cfg(feature = "std")]
//! Records whose sensor begins to measure when the initial state has died out.

use crate::common::{self, Branch, Current, Noise, Voltage, levels, noisy, simulated};
use greybox::*;

signals! { pub struct Level { x: "1" } }
signals! { pub struct Drive { u: "1" } }
signals! { pub struct Lag { gain: "1", tau: "s" } }

/// `tau dx/dt = gain u - x - x^3`.
#[derive(Clone)]
struct Cubic;

impl Model for Cubic {
    type State = Level;
    type Input = Drive;
    type Output = Level;
    type Parameters = Lag;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Drive<S>, p: &Lag<S>) -> Level<S> {
        Level { x: (p.gain * u.u - x.x - x.x.powi(3)) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Drive<S>, _p: &Lag<S>) -> Level<S> {
        *x
    }
}

/// After 15 and more time constants a change of the initial state by itself moves the outputs by 1e-5 of their noise or less: it is said not to be
/// known, the parameters are.
#[test]
fn an_initial_state_that_has_died_out_does_not_keep_a_fit_from_its_end() {
    for (seed, late) in [(1, 100), (2, 150), (3, 200), (4, 300), (5, 60), (6, 70), (7, 80)] {
        let mut noise = Noise(seed);
        let inputs: Vec<Drive> = levels(400, 15, seed).into_iter().map(|u| Drive { u: 2.0 * u }).collect();
        let time = Time::Uniform { start: 0.0, step: 0.1 };
        let run = simulate(&Cubic, &Lag { gain: 1.5, tau: 0.4 }, &Level { x: 0.3 }, time.clone(), &inputs).unwrap();
        let measured =
            |(k, y): (usize, &Level)| Level { x: if k < late { f64::NAN } else { y.x + 0.02 * noise.gauss() } };
        let outputs = run.outputs.iter().enumerate().map(measured).collect();
        let record = Experiment::new(&Cubic, time, inputs, outputs).unwrap();
        let fit = Fit::new(&Cubic, &record).parameters(Lag { gain: free(0.8), tau: free(0.3) }).run().unwrap();
        assert!(fit.outcome.converged() && fit.severity() == Severity::Usable, "{late}: {fit}");
        let [gain, tau, start] = &fit.unknowns[..] else { panic!("{fit}") };
        for (unknown, truth) in [(gain, 1.5), (tau, 0.4)] {
            let error = unknown.knowledge.standard_error().unwrap();
            assert!((unknown.value - truth).abs() < 4.0 * error, "{late}: {fit}");
        }
        assert_eq!(start.knowledge, Knowledge::Unidentified, "{late}: {fit}");
        let said =
            |warning: &Warning| warning.code == WarningCode::Unidentified && warning.text.contains("has died out");
        assert!(fit.warnings.iter().any(said), "{late}: {fit}");
    }
}

/// Of a linear plant between 14 and 20 time constants, where a search would still change the initial state by many times its size.
#[test]
fn an_initial_state_that_has_nearly_died_out_is_held() {
    for seed in 0..40 {
        let mut noise = Noise(seed);
        let late = 112 + 12 * (seed as usize % 5);
        let inputs = levels(500, 20, seed).into_iter().map(|u| Voltage { u }).collect();
        let run = simulated(&common::Lag, 0.1, inputs, Current { i: 0.3 }, Branch { gain: 1.5, tau: 0.8 });
        let record = noisy(&common::Lag, &run, Current { i: 0.02 }, &mut noise);
        let hidden = |(k, y): (usize, Current)| if k < late { Current { i: f64::NAN } } else { y };
        let outputs = record.outputs().enumerate().map(hidden).collect();
        let record = Experiment::new(&common::Lag, record.times().clone(), record.inputs().collect(), outputs).unwrap();
        let start = Branch { gain: free(1.0), tau: free(0.5) };
        let fit = Fit::new(&common::Lag, &record).parameters(start).run().unwrap();
        assert!(fit.severity() < Severity::NotUsable, "{seed} {late}: {fit}");
        assert_eq!(fit.unknowns[2].knowledge, Knowledge::Unidentified, "{seed} {late}: {fit}");
    }
}

/// A plant that is at rest at first, whose first measurement is zero but for rounding: a start without size. The initial state is told by the
/// measurements after it, whether these begin at once or two samples late.
#[test]
fn a_start_next_to_zero_is_not_taken_as_died_out() {
    for late in [0, 2] {
        let mut noise = Noise(7);
        let level = |(k, u): (usize, f64)| Drive { u: if k < 3 { 0.0 } else { 2.0 * u } };
        let inputs: Vec<Drive> = levels(200, 15, 7).into_iter().enumerate().map(level).collect();
        let time = Time::Uniform { start: 0.0, step: 0.1 };
        let run = simulate(&Cubic, &Lag { gain: 1.5, tau: 0.4 }, &Level::default(), time.clone(), &inputs).unwrap();
        let measured = |(k, y): (usize, &Level)| match k {
            k if k < late => Level { x: f64::NAN },
            k if k == late => Level { x: 1e-17 },
            _ => Level { x: y.x + 0.02 * noise.gauss() },
        };
        let outputs = run.outputs.iter().enumerate().map(measured).collect();
        let record = Experiment::new(&Cubic, time, inputs, outputs).unwrap();
        let start = Lag { gain: free(1.2), tau: free(0.5) };
        let fit = Fit::new(&Cubic, &record).parameters(start).run().unwrap();
        let error = fit.unknowns[2].knowledge.standard_error().unwrap_or_else(|| panic!("{late}: {fit}"));
        // The first measurement tells it to 0.02, by a decay of `exp(0.2 / 0.4)` where it is two samples late.
        assert!(error < 0.04 && fit.severity() == Severity::Usable, "{late}: {fit}");
    }
}
