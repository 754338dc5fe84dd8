//! Default diagnostics of a fit against the passes of the fit itself: `cargo bench --bench diagnose`.
//!
//! Default diagnostics, all that `Report::new` makes, must take less time than twenty passes with slopes. Compare process
//! time, not the clock, on a machine that does other things.

use cpu_time::ProcessTime;
use divan::Bencher;
use greybox::diagnose::{identifiability, residuals};
use greybox::optimize::LeastSquares;
use greybox::{Experiment, Fit, Model, Report, Scalar, Time, free, signals, simulate};

const SAMPLES: usize = 200_000;

signals! { struct Currents { id: "A", iq: "A" } }
signals! { struct Drive { ud: "V", uq: "V", w: "rad/s" } }
signals! { struct Winding { rs: "ohm", ls: "H", ke: "V s/rad" } }

#[derive(Clone)]
struct Pmsm;

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = u.w * 4.0;
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w) / p.ls - we * x.id,
        }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

fn record() -> Experiment<Currents, Drive, Currents> {
    let wave = |k: usize, period: usize| if (k / period).is_multiple_of(2) { 1.0 } else { -1.0 };
    let noise = |k: usize| (k as f64 * 0.754_877_666_246_693).fract() - 0.5;
    let inputs = (0..SAMPLES).map(|k| Drive {
        ud: wave(k, 400),
        uq: 30.0 + wave(k, 700),
        w: 40.0 + 2.0 * wave(k, 9000) + noise(k),
    });
    let (time, inputs) = (Time::Uniform { start: 0.0, step: 125e-6 }, inputs.collect::<Vec<_>>());
    let truth = Winding { rs: 0.5, ls: 2e-3, ke: 0.7 };
    let outputs = simulate(&Pmsm, &truth, &Currents { id: 0.0, iq: 0.0 }, time.clone(), &inputs).unwrap().outputs;
    let noisy =
        outputs.iter().enumerate().map(|(k, y)| Currents { id: y.id + noise(3 * k), iq: y.iq + noise(5 * k + 1) });
    Experiment::new(&Pmsm, time, inputs, noisy.collect()).unwrap()
}

const GUESS: Winding<f64> = Winding { rs: 0.6, ls: 2.2e-3, ke: 0.65 };

/// Process time of both sides of the comparison first, then each by the clock.
fn main() {
    let record = record();
    let parameters = Winding { rs: free(GUESS.rs), ls: free(GUESS.ls), ke: free(GUESS.ke) };
    let problem = Fit::new(&Pmsm, &record).parameters(parameters).problem().unwrap();
    let estimate = problem.run().unwrap();
    let objective = problem.objective().unwrap();
    let place = objective.start();
    let took = |work: &dyn Fn()| {
        let begin = ProcessTime::now();
        work();
        begin.elapsed().as_secs_f64()
    };
    let passes = took(&|| (0..20).for_each(|_| drop(objective.linearize(&place).unwrap())));
    let report = took(&|| drop(Report::new(&problem, &estimate).unwrap()));
    println!(
        "process time: twenty passes {passes:.3} s, default diagnostics {report:.3} s, ratio {:.2}",
        report / passes
    );
    divan::main();
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn twenty_passes_with_slopes(bencher: Bencher) {
    let record = record();
    let parameters = Winding { rs: free(GUESS.rs), ls: free(GUESS.ls), ke: free(GUESS.ke) };
    let problem = Fit::new(&Pmsm, &record).parameters(parameters).problem().unwrap();
    let objective = problem.objective().unwrap();
    let place = objective.start();
    bencher.bench_local(|| (0..20).map(|_| objective.linearize(&place).unwrap().cost).sum::<f64>());
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn default_diagnostics(bencher: Bencher) {
    let record = record();
    let parameters = Winding { rs: free(GUESS.rs), ls: free(GUESS.ls), ke: free(GUESS.ke) };
    let problem = Fit::new(&Pmsm, &record).parameters(parameters).problem().unwrap();
    let estimate = problem.run().unwrap();
    bencher.bench_local(|| Report::new(&problem, &estimate).unwrap());
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn examination_of_residuals(bencher: Bencher) {
    let record = record();
    let parameters = Winding { rs: free(GUESS.rs), ls: free(GUESS.ls), ke: free(GUESS.ke) };
    let estimate = Fit::new(&Pmsm, &record).parameters(parameters).run().unwrap();
    let prediction = estimate.predict(&Pmsm, &record).unwrap();
    bencher.bench_local(|| residuals::examine(&prediction.columns, record.record()).unwrap());
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn identifiability_of_parameters(bencher: Bencher) {
    let record = record();
    let parameters = Winding { rs: free(GUESS.rs), ls: free(GUESS.ls), ke: free(GUESS.ke) };
    let problem = Fit::new(&Pmsm, &record).parameters(parameters).problem().unwrap();
    let estimate = problem.run().unwrap();
    bencher.bench_local(|| identifiability(&problem, &estimate).unwrap());
}
