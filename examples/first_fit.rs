//! The first program: a motor's equations, a record, and the parameters with their intervals.
//!
//! The record is simulated here, with known parameters and noise, so that the truth can stand beside the estimate:
//! `cargo run --release --example first_fit`. With `-- --save motor.csv` it is kept as a file.

use greybox::{Experiment, ExperimentOf, Fit, Model, Scalar, Time, free, signals, simulate};
use rand_distr::{Distribution, Normal};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use std::{error::Error, process::ExitCode};

signals! { /// Stator currents in the rotor frame, phase peak.
struct Currents { id: "A", iq: "A" } }
signals! { /// Voltages in the rotor frame, phase peak, and mechanical speed.
struct Drive { ud: "V", uq: "V", w: "rad/s" } }
signals! { /// Phase resistance, inductance, line-to-line rms back-EMF.
struct Winding { rs: "ohm", ls: "H", ke: "V s/rad" } }

/// A permanent magnet synchronous motor.
struct Pmsm {
    pole_pairs: f64,
}

const SQRT_2_3: f64 = 0.816_496_580_927_726;

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = u.w * self.pole_pairs;
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * SQRT_2_3) / p.ls - we * x.id,
        }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let model = Pmsm { pole_pairs: 4.0 };
    let truth = Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
    let record = simulated(&model, truth)?;
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => {}
        ["--save", path] => return Ok(record.to_csv(path)?),
        _ => return Err("usage: first_fit [--save FILE.csv]".into()),
    }

    let estimate = Fit::new(&model, &record)
        .parameters(Winding { rs: free(1.0).within(0.01, 10.0), ls: free(2e-3), ke: free(0.7) })
        .run()?;
    println!("{estimate}\n\nTrue values: {truth:?}");
    Ok(())
}

/// What a drive would log in half a second: speed to and fro, current steps, noise of 0.05 A, six digits.
fn simulated(model: &Pmsm, truth: Winding) -> Result<ExperimentOf<Pmsm>, Box<dyn Error>> {
    let time = Time::Uniform { start: 0.0, step: 0.25e-3 };
    let digits = |value: f64| format!("{value:.5e}").parse::<f64>();
    let mut inputs = vec![];
    for k in 0..2000 {
        let w = 150.0 * (12.0 * 0.25e-3 * k as f64).sin();
        let step = if k / 100 % 2 == 0 { 8.0 } else { -8.0 };
        inputs.push(Drive { ud: digits(-0.4 * step)?, uq: digits(0.63 * step + 0.95 * SQRT_2_3 * w)?, w: digits(w)? });
    }
    let currents = simulate(model, &truth, &Currents { id: 0.0, iq: 0.0 }, time.clone(), &inputs)?.outputs;
    let (mut random, noise) = (Xoshiro256PlusPlus::seed_from_u64(2011), Normal::new(0.0, 0.05)?);
    let mut measured = |current: f64| digits(current + noise.sample(&mut random));
    let outputs: Result<_, _> = currents
        .iter()
        .map(|i| Ok::<_, std::num::ParseFloatError>(Currents { id: measured(i.id)?, iq: measured(i.iq)? }))
        .collect();
    Ok(Experiment::new(model, time, inputs, outputs?)?.named("simulated drive"))
}
