//! Dead times in compiled code, by segments and lanes, against one record at a time and against dual numbers.

use crate::common::Noise;
use crate::{Excess, Heated, Process, Sensor, Valve};
use greybox::*;

/// A plant of its own for each seed, its input held for some samples each.
fn record(samples: usize, time: Time, seed: u64) -> ExperimentOf<Heated> {
    let mut noise = Noise(seed);
    let mut u = 0.0;
    let mut input = |k: usize| {
        if k % 7 == 3 {
            u = noise.uniform() * 50.0;
        }
        Valve { u }
    };
    let inputs: Vec<Valve> = (0..samples).map(&mut input).collect();
    let truth = Process { y0: 20.0, k: 0.6, tau: 15.0, theta: 1.3 + seed as f64 };
    let run = simulate(&Heated, &truth, &Excess { z: 0.0 }, time, &inputs).unwrap();
    run.with_noise(Sensor { y: 0.3 }, seed).experiment(&Heated).unwrap().initial(Excess { z: fixed(0.0) })
}

fn start() -> Process<Parameter> {
    let theta = free(4.0).within(0.0, 60.0);
    Process { y0: free(18.0), k: free(1.0), tau: free(10.0).log(), theta }
}

/// Values and standard errors agree to a part of the latter.
fn agree(one: &Estimate<Heated>, other: &Estimate<Heated>) {
    for (one, other) in one.unknowns.iter().zip(&other.unknowns) {
        let error = one.knowledge.standard_error().unwrap();
        assert!((one.value - other.value).abs() < 1e-4 * error, "{}: {} {}", one.name, one.value, other.value);
        let ratio = other.knowledge.standard_error().unwrap() / error;
        assert!((ratio - 1.0).abs() < 1e-5, "{}: {error} {ratio}", one.name);
    }
}

/// Evenly spaced, a long record is cut into segments that run side by side; by its time stamps it runs in dual numbers, as a whole. Where an
/// input does not jump, programs make two steps for one, of a sixtieth of the time constant: (1/60)^4/120 = 6e-10 of what the output moves.
#[test]
fn a_long_record_in_segments_and_in_duals() {
    let step = Time::Uniform { start: 0.0, step: 1.0 };
    let stamps = Time::Stamps((0..3_000).map(f64::from).collect());
    let [even, stamped] = [step, stamps].map(|time| {
        let record = record(3_000, time, 3);
        Fit::new(&Heated, &record).parameters(start()).integrator(Rk4 { substeps: 4 }).run().unwrap()
    });
    assert!(even.method.engine.starts_with("read as a graph"), "{}", even.method.engine);
    assert!(stamped.method.engine.contains("samples are not evenly spaced"), "{}", stamped.method.engine);
    agree(&even, &stamped);
}

/// Plants with dead times of 1.3 to 12.3 samples side by side, each as by itself.
#[test]
fn a_fleet_with_dead_times_of_its_own() {
    let records: Vec<_> = (0..12).map(|seed| record(400, Time::Uniform { start: 0.0, step: 1.0 }, seed)).collect();
    let fleet = Fleet::new(&Heated).parameters(start()).fleet().unwrap();
    let found: Vec<_> = fleet.run(records.clone()).collect();
    for (seed, (found, record)) in found.into_iter().zip(&records).enumerate() {
        let (found, alone) = (found.unwrap(), Fit::new(&Heated, record).parameters(start()).run().unwrap());
        agree(&alone, &found);
        assert!((found.parameters.theta - 1.3 - seed as f64).abs() < 0.2, "{seed}: {found}");
    }
}
