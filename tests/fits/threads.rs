//! Same bits for any number of threads: records long enough, or enough of them, that their passes are distributed.
//!
//! A pass is distributed if it has several batches and more than 640,000 samples times columns (the slopes and four more).

use crate::common::{Branch, Current, Lag, Noise, Voltage, levels, noisy, simulated};
use greybox::*;

/// The results on one, two and three threads are the same texts.
fn same_on_any_number(what: &str, run: impl Fn() -> Vec<Summary> + Sync) {
    let texts = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let text = |summary| serde_json::to_string(&Summary { seconds: 0.0, ..summary }).unwrap();
        pool.install(&run).into_iter().map(text).collect::<Vec<_>>()
    };
    let one = texts(1);
    for threads in [2, 3] {
        assert!(texts(threads) == one, "{what} on {threads} threads: other bits than on one");
    }
}

fn start() -> Branch<Parameter> {
    Branch { gain: free(1.0), tau: free(0.1) }
}

fn run(e: u64, samples: usize) -> ExperimentOf<Lag> {
    let inputs = levels(samples, 12, 20 + e).into_iter().map(|u| Voltage { u }).collect();
    let truth = Branch { gain: 2.0 + 0.01 * e as f64, tau: 0.05 };
    let record = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, truth);
    noisy(&Lag, &record.named(format!("run {e}")), Current { i: 0.1 }, &mut Noise(e + 1))
}

signals! { struct Speed { w: "rad/s" } struct Torque { m: "N m" } struct Brake { d: "1/s", c: "1/s^2" } }

/// A rotor with friction that is not linear.
#[derive(Clone)]
struct Rotor;

#[rustfmt::skip]
impl Model for Rotor {
    type State = Speed; type Input = Torque; type Output = Speed; type Parameters = Brake;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Torque<S>, p: &Brake<S>) -> Speed<S> {
        Speed { w: u.m - x.w * p.d - (x.w * 2.0).tanh() * p.c }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Torque<S>, _p: &Brake<S>) -> Speed<S> { *x }
}

/// 64 segments, more than there are lanes: 140,000 samples with the slopes of a carry and two parameters.
const LONG: usize = 140_000;

#[test]
fn a_long_affine_record_does_not_depend_on_threads() {
    let record = run(0, LONG);
    let fit = || Fit::new(&Lag, &record).parameters(start()).integrator(Rk4::default());
    same_on_any_number("64 affine segments", || vec![fit().run().unwrap().into_summary()]);
}

#[test]
fn a_long_nonlinear_record_does_not_depend_on_threads() {
    let inputs: Vec<Torque> = levels(LONG, 12, 3).into_iter().map(|m| Torque { m }).collect();
    let (truth, time) = (Brake { d: 3.0, c: 0.4 }, Time::Uniform { start: 0.0, step: 5e-3 });
    let rotor = simulate(&Rotor, &truth, &Speed { w: 0.0 }, time, &inputs).unwrap();
    let record = rotor.with_noise(Speed { w: 0.02 }, 5).experiment(&Rotor).unwrap();
    let fit = || Fit::new(&Rotor, &record).parameters(Brake { d: free(2.0), c: free(0.2) }).integrator(Rk4::default());
    same_on_any_number("64 segments", || vec![fit().run().unwrap().into_summary()]);
}

#[test]
fn a_joint_fit_does_not_depend_on_threads() {
    let records: Vec<_> = (0..40).map(|e| run(e, 3_000)).collect();
    let fit = || Fit::new(&Lag, &records).parameters(start()).integrator(Rk4::default()).loss(Huber(1.345));
    same_on_any_number("40 records", || vec![fit().run().unwrap().into_summary()]);
}

/// Five groups of 32 records at most, of a default method, which is refined.
#[test]
fn a_fleet_does_not_depend_on_threads() {
    let records: Vec<_> = (0..150).map(|e| run(e, 150 + 10 * (e as usize % 7))).collect();
    let fleet = Fleet::new(&Lag).parameters(start()).fleet().unwrap();
    same_on_any_number("150 records", || {
        fleet.run(records.iter().cloned()).map(|answer| answer.unwrap().into_summary()).collect()
    });
}
