//! E. N. Lorenz, *Deterministic nonperiodic flow*, Journal of the Atmospheric Sciences 20 (1963) 130-141.

use crate::{Ended, Random, Study};
use greybox::{Error, Experiment, Fit, Model, Nothing, Rk4, Scalar, Signals, Time, free, signals, simulate};

signals! {
    pub struct Flow { x: "1", y: "1", z: "1" }
    pub struct First { x: "1" }
    pub struct Constants { sigma: "1/s", rho: "1", beta: "1/s" }
}

fn flow<S: Scalar>(x: &Flow<S>, p: &Constants<S>) -> Flow<S> {
    Flow { x: p.sigma * (x.y - x.x), y: x.x * (p.rho - x.z) - x.y, z: x.x * x.y - p.beta * x.z }
}

#[derive(Clone)]
struct All;

impl Model for All {
    type State = Flow;
    type Input = Nothing;
    type Output = Flow;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, p: &Constants<S>) -> Flow<S> {
        flow(x, p)
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> Flow<S> {
        *x
    }
}

#[derive(Clone)]
struct FirstAlone;

impl Model for FirstAlone {
    type State = Flow;
    type Input = Nothing;
    type Output = First;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, p: &Constants<S>) -> Flow<S> {
        flow(x, p)
    }

    fn output<S: Scalar>(&self, _t: S, x: &Flow<S>, _u: &Nothing, _p: &Constants<S>) -> First<S> {
        First { x: x.x }
    }
}

const TRUTH: Constants = Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 };
const STEP: f64 = 0.01;
/// Of a sample: over twenty time units the error of a step grows by some `exp(18)`.
const STEPS: Rk4 = Rk4 { substeps: 4 };
/// Part of each output's standard deviation.
const NOISE: f64 = 0.05;
/// A parameter that is this far off, relatively, is wrong; noise moves it by some 0.1 %.
const RIGHT: f64 = 0.01;

/// Time, and the flow from a point on its attractor at samples that are a hundredth of a second apart.
fn simulated(random: &mut Random, length: f64) -> Result<(Time, Vec<Flow>), Error> {
    let count = |length: f64| (length / STEP) as usize + 1;
    let time = Time::Uniform { start: 0.0, step: STEP };
    let run = |from: &Flow, length: f64| -> Result<Vec<Flow>, Error> {
        let inputs = vec![Nothing; count(length)];
        Ok(simulate(&All, &TRUTH, from, time.clone(), &inputs)?.outputs)
    };
    let from = Flow { x: random.uniform(-10.0, 10.0), y: random.uniform(-10.0, 10.0), z: random.uniform(10.0, 30.0) };
    let settled = run(&from, 20.0)?.last().copied().unwrap_or(from);
    Ok((time.clone(), run(&settled, length)?))
}

fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (values.map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn measured(random: &mut Random, outputs: &[Flow]) -> Vec<Flow> {
    let noise = |of: fn(&Flow) -> f64| NOISE * deviation(outputs.iter().map(of));
    let (x, y, z) = (noise(|flow| flow.x), noise(|flow| flow.y), noise(|flow| flow.z));
    let noisy = |flow: &Flow| Flow {
        x: flow.x + x * random.normal(),
        y: flow.y + y * random.normal(),
        z: flow.z + z * random.normal(),
    };
    outputs.iter().map(noisy).collect()
}

fn start(random: &mut Random) -> Constants<greybox::Parameter> {
    let mut off = |truth: f64| free(truth * random.log_uniform(1.0 / 3.0, 3.0));
    Constants { sigma: off(TRUTH.sigma), rho: off(TRUTH.rho), beta: off(TRUTH.beta) }
}

fn distance(found: &greybox::Summary) -> f64 {
    let truth = Constants::into_array(TRUTH);
    let off = found.parameters.iter().zip(truth).map(|(found, truth)| (found.value / truth - 1.0).abs());
    off.fold(0.0, f64::max) / RIGHT
}

pub fn all(study: &Study<'_>, mut random: Random, length: f64) -> Result<Ended, Error> {
    let (time, outputs) = simulated(&mut random, length)?;
    let outputs = measured(&mut random, &outputs);
    let record = Experiment::new(&All, time, vec![Nothing; outputs.len()], outputs)?;
    let found = study.of(Fit::new(&All, &record).parameters(start(&mut random)).integrator(STEPS)).run();
    Ok(study.ended(found.as_ref().map(|found| found.summary()), distance))
}

pub fn first_alone(study: &Study<'_>, mut random: Random) -> Result<Ended, Error> {
    let (time, exact) = simulated(&mut random, 20.0)?;
    let outputs: Vec<First> = measured(&mut random, &exact).iter().map(|y| First { x: y.x }).collect();
    let noise = outputs.iter().zip(&exact).map(|(y, exact)| (y.x - exact.x).powi(2)).sum::<f64>() / exact.len() as f64;
    let record = Experiment::new(&FirstAlone, time, vec![Nothing; outputs.len()], outputs)?;
    let found = study.of(Fit::new(&FirstAlone, &record).parameters(start(&mut random)).integrator(STEPS)).run();
    // Noise moves the parameters by up to 1.5 %: the best minimum is told by its errors, which are below the noise that was drawn.
    Ok(study.ended(found.as_ref().map(|found| found.summary()), |found| found.outputs[0].fit.rmse / noise.sqrt()))
}
