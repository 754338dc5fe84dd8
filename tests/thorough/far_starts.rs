//! Fits of a chaotic plant from far starts.

use crate::lorenz::{Constants, First, Flow, Lorenz};
use crate::random::Random;
use greybox::*;

const TRUTH: Constants = Constants { sigma: 10.0, rho: 28.0, beta: 8.0 / 3.0 };

/// Twenty seconds, in which an error of the start grows by `exp(18)`, from parameters up to three times off, with noise of 5 %. The best minimum has
/// smaller errors than the noise that was drawn; another one has many times that. Of 40 records of the example `far_starts` all end there, 36
/// of them usable; where multiple shooting did not follow a search that is stuck, 38, 20 of them usable.
#[test]
fn a_chaotic_plant_from_one_output() {
    const RECORDS: u64 = 8;
    let (mut best, mut usable) = (0, 0);
    for seed in 0..RECORDS {
        let mut random = Random(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        let time = Time::Uniform { start: 0.0, step: 0.01 };
        let run = |from: &Flow| simulate(&Lorenz, &TRUTH, from, time.clone(), &[Nothing; 2001]).unwrap();
        let from = Flow { x: between(-10.0, 10.0), y: between(-10.0, 10.0), z: between(10.0, 30.0) };
        let exact = run(run(&from).states.last().unwrap());
        let outputs = exact.outputs.clone();
        let record = exact.with_noise(First { x: 0.4 }, seed).experiment(&Lorenz).unwrap();
        let squares = record.outputs().zip(&outputs).map(|(y, exact)| (y.x - exact.x).powi(2)).sum::<f64>();
        let mut off = |truth: f64| free(truth * 3f64.powf(between(-1.0, 1.0)));
        let start = Constants { sigma: off(TRUTH.sigma), rho: off(TRUTH.rho), beta: off(TRUTH.beta) };
        let found = Fit::new(&Lorenz, &record).parameters(start).integrator(Rk4 { substeps: 4 }).run().unwrap();
        let is_best = found.summary().outputs[0].fit.rmse < (squares / 2001.0).sqrt();
        best += u64::from(is_best);
        usable += u64::from(is_best && found.severity() < Severity::NotUsable);
    }
    println!("at the best minimum {best} of {RECORDS}, usable {usable}");
    assert!(best >= 8 && usable >= 6, "{best} {usable}");
}
