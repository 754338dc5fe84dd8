//! A first-order plant with dead time: sampled every second, dead time 12.4 s, lag 48 s.

use crate::{Excess, Heated, Process, Sensor, Valve, record};
use greybox::Severity;
use greybox::*;

fn fitted(record: &ExperimentOf<Heated>, theta: f64) -> Estimate<Heated> {
    let theta = free(theta).within(0.0, 60.0);
    let parameters = Process { y0: free(20.0), k: free(1.0), tau: free(20.0).log(), theta };
    Fit::new(&Heated, record).parameters(parameters).run().unwrap()
}

/// `tau` and `theta` with their standard errors.
fn known(estimate: &Estimate<Heated>) -> [(f64, f64); 2] {
    ["tau", "theta"].map(|name| {
        let unknown = estimate.unknowns.iter().find(|unknown| unknown.name == name).unwrap();
        (unknown.value, unknown.knowledge.standard_error().unwrap())
    })
}

/// The record, and its original in full digits where the shared records are beside the library.
#[test]
fn a_first_order_plant_with_dead_time() {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/field/fopdt.csv");
    let mut records = vec![record()];
    if std::path::Path::new(shared).exists() {
        records.push(Experiment::from_file(&Heated, shared).unwrap().initial(Excess { z: fixed(0.0) }));
    }
    for record in records {
        for theta in [1.0, 5.0, 20.0, 30.0] {
            let estimate = fitted(&record, theta);
            println!("{estimate}");
            assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
            assert!(estimate.method.engine.starts_with("read as a graph"), "{}", estimate.method.engine);
            for ((value, error), truth) in known(&estimate).into_iter().zip([48.0, 12.4]) {
                assert!((value - truth).abs() < 2.0 * error, "{truth}: {value} +- {error}");
            }
        }
    }
}

/// 40 twins of it with dead times of their own: errors of estimates over their standard errors have a mean square of one. By chance the mean
/// square of 40 is below 0.51 or above 1.73 in one of 300.
#[test]
fn standard_errors_of_dead_times() {
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let level = |k: usize| [0.0, 30.0, 70.0, 10.0, 50.0][[20, 120, 200, 300].iter().filter(|at| k >= **at).count()];
    let inputs: Vec<Valve> = (0..400).map(|k| Valve { u: level(k) }).collect();
    let mut squares = [0.0; 2];
    for seed in 0..40 {
        let truth = Process { y0: 22.0, k: 0.6, tau: 48.0, theta: 3.0 + 0.37 * seed as f64 };
        let run = simulate(&Heated, &truth, &Excess { z: 0.0 }, time.clone(), &inputs).unwrap();
        let record = run.with_noise(Sensor { y: 0.2 }, seed).experiment(&Heated).unwrap();
        let found = known(&fitted(&record.initial(Excess { z: fixed(0.0) }), 10.0));
        for (square, ((value, error), truth)) in squares.iter_mut().zip(found.into_iter().zip([48.0, truth.theta])) {
            *square += ((value - truth) / error).powi(2) / 40.0;
        }
    }
    assert!(squares.iter().all(|square| (0.51..1.73).contains(square)), "{squares:?}");
}
