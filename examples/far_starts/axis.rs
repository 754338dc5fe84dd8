//! The axis of the EMPS benchmark (nonlinearbenchmark.org) from far starts: its record, and simulated records as in the study of nlgreyfast
//! (KU Leuven).

use crate::{Ended, Random, Study};
use greybox::models::{AxisMotion, AxisParameters, Command, Position, Positioning, PositioningLoop};
use greybox::{Error, Experiment, ExperimentOf, Fit, Model, Rk4, Scalar, Simulator, Summary, Time, fixed, free};
use std::f64::consts::TAU;
use std::path::Path;

const TRUTH: AxisParameters = AxisParameters { m: 95.1089, fv: 203.5034, fc: 20.3935, offset: -3.1648 };
const GTAU: f64 = Positioning::EMPS.gtau;

/// The axis of the study: dry friction turns over within a speed that depends on it.
#[derive(Clone)]
struct Axis;

impl Model for Axis {
    type State = AxisMotion;
    type Input = Command;
    type Output = Position;
    type Parameters = AxisParameters;

    fn derivative<S: Scalar>(&self, _t: S, x: &AxisMotion<S>, u: &Command<S>, p: &AxisParameters<S>) -> AxisMotion<S> {
        let dry = p.fc * (x.v * 1e4 / p.fc).tanh();
        AxisMotion { q: x.v, v: (u.vir * GTAU - p.fv * x.v - dry - p.offset) / p.m }
    }

    fn output<S: Scalar>(&self, _t: S, x: &AxisMotion<S>, _u: &Command<S>, _p: &AxisParameters<S>) -> Position<S> {
        Position { qm: x.q }
    }
}

/// Two periods of a multisine with random phases, 1 to 4 Hz, from a random state, without noise; the start is unstable.
pub fn replica(study: &Study<'_>, mut random: Random) -> Result<Ended, Error> {
    const PERIOD: usize = 5000;
    const RATE: f64 = 1000.016;
    let lines: Vec<usize> = (1..PERIOD).filter(|&k| (1.0..=4.0).contains(&(k as f64 * RATE / PERIOD as f64))).collect();
    let phases: Vec<f64> = lines.iter().map(|_| random.uniform(0.0, TAU)).collect();
    let amplitude = 900.0 * 2.0 / PERIOD as f64;
    let value = |k: usize| {
        let one = |(line, phase): (&usize, &f64)| (TAU * (line * k % PERIOD) as f64 / PERIOD as f64 + phase).cos();
        amplitude * lines.iter().zip(&phases).map(one).sum::<f64>()
    };
    let inputs: Vec<Command> = (0..2 * PERIOD).map(|k| Command { vir: value(k) }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 / RATE };
    let from = AxisMotion { q: 0.3 * random.normal(), v: 0.3 * random.normal() };
    let method = Rk4 { substeps: 10 };
    let record = Simulator::new(&Axis).integrator(method).run(&TRUTH, &from, time, &inputs)?.experiment(&Axis)?;
    let start = AxisParameters { m: free(0.2), fv: free(-10.0), fc: free(0.2), offset: free(10.0) };
    let found = study.of(Fit::new(&Axis, &record).parameters(start).integrator(method)).run();
    Ok(study.ended(found.as_ref().map(|found| found.summary()), |found| {
        // A relative error of the position of 0.1 %.
        let rms = (record.outputs().map(|y| y.qm * y.qm).sum::<f64>() / record.len() as f64).sqrt();
        found.outputs[0].fit.rmse / rms / 1e-3
    }))
}

fn start(random: &mut Random) -> AxisParameters<greybox::Parameter> {
    AxisParameters {
        m: free(random.log_uniform(5.0, 500.0)),
        fv: free(random.log_uniform(10.0, 1000.0)),
        fc: free(random.log_uniform(1.0, 100.0)),
        offset: free(random.uniform(-20.0, 20.0)),
    }
}

pub fn open_record(path: &Path) -> Result<ExperimentOf<Positioning>, Error> {
    Experiment::from_file(&Positioning::EMPS, path)
}

pub fn open(study: &Study<'_>, record: &ExperimentOf<Positioning>, mut random: Random) -> Result<Ended, Error> {
    let record = record.clone().initial(AxisMotion { q: free(0.0), v: fixed(0.0) });
    let found = study.of(Fit::new(&Positioning::EMPS, &record).parameters(start(&mut random))).run();
    // The best known minimum has 2.451 mm.
    Ok(study.ended(found.as_ref().map(|found| found.summary()), |found| found.outputs[0].fit.rmse / 2.4575e-3))
}

pub fn closed_record(path: &Path) -> Result<ExperimentOf<PositioningLoop>, Error> {
    Experiment::from_file(&PositioningLoop::EMPS, path)
}

pub fn closed(study: &Study<'_>, record: &ExperimentOf<PositioningLoop>, mut random: Random) -> Result<Ended, Error> {
    let found = study.of(Fit::new(&PositioningLoop::EMPS, record).parameters(start(&mut random))).run();
    Ok(study.ended(found.as_ref().map(|found| found.summary()), distance))
}

/// The minimum of the closed loop: what every fit from a good start finds.
fn distance(found: &Summary) -> f64 {
    const BEST: [f64; 4] = [95.204, 206.41, 20.216, -3.1676];
    found.parameters.iter().zip(BEST).map(|(found, best)| (found.value / best - 1.0).abs()).fold(0.0, f64::max) / 0.05
}
