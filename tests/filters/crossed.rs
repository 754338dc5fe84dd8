//! Fits of filters that cross intervals exactly: predictions after them, and fleets.

use crate::walls::{Building, Heated, record, start};
use greybox::estimate::Prediction;
use greybox::*;

pub const EXACT: &str = "exact transition of linear equations";

/// At twice the shortest time constant, where a step of Runge-Kutta's method is twice the decay: a simulation with the estimate is that of an adaptive
/// method of tolerance 1e-12, to what that leaves.
#[test]
fn a_simulation_after_an_exact_filter_is_exact() {
    let record = record::<false>(Time::Uniform { start: 0.0, step: 0.9 }, 200);
    let estimate = Fit::new(&Heated::<false>, &record).parameters(start()).predictor(Kalman).run().unwrap();
    assert_eq!(estimate.method.integrator, EXACT);
    let plain = || Fit::new(&Heated::<false>, &record).parameters(Building::map(estimate.parameters, fixed));
    let fine = plain().integrator(Rk45 { relative: 1e-12, absolute: 1e-13 }).predict(&estimate, &record).unwrap();
    let coarse = plain().integrator(Rk4::default()).predict(&estimate, &record).unwrap();
    let far = |other: &Prediction<Heated<false>>| {
        let each = other.outputs.iter().zip(&fine.outputs);
        each.map(|(other, fine)| (other.z - fine.z).abs()).fold(0.0, f64::max)
    };
    let found = estimate.predict(&Heated::<false>, &record).unwrap();
    assert!(far(&found) < 1e-9 && far(&coarse) > 1e-3, "{} {}", far(&found), far(&coarse));
}

/// Records whose samples are evenly spaced and others in one fleet: each is fitted as it is alone, exactly.
#[test]
fn fleets_of_even_and_uneven_records() {
    let few = |samples: usize| (0..samples).map(|k| 0.1 * k as f64 + if k % 3 == 1 { 0.03 } else { 0.0 }).collect();
    let many = |samples: usize| (0..samples).map(|k| 0.1 * k as f64 + 0.03 * (1.7 * k as f64).sin()).collect();
    let times = [
        Time::Uniform { start: 0.0, step: 0.1 },
        Time::Stamps(few(300)),
        Time::Uniform { start: 0.0, step: 0.2 },
        Time::Stamps(many(250)),
    ];
    let records = times.map(|time| {
        let samples = if let Time::Stamps(stamps) = &time { stamps.len() } else { 300 };
        record::<false>(time, samples)
    });
    let fleet = Fleet::new(&Heated::<false>).parameters(start()).predictor(Kalman).fleet().unwrap();
    let found: Vec<_> = fleet.run(records.to_vec()).map(Result::unwrap).collect();
    for (found, record) in found.iter().zip(&records) {
        let alone = Fit::new(&Heated::<false>, record).parameters(start()).predictor(Kalman).run().unwrap();
        assert_eq!([&found.method.integrator, &alone.method.integrator], [EXACT; 2]);
        for (found, alone) in found.unknowns.iter().zip(&alone.unknowns) {
            // Two searches of one minimum, that the cost tells to half its digits.
            let size = alone.knowledge.standard_error().unwrap_or(1.0);
            assert!((found.value - alone.value).abs() < 1e-4 * size, "{} {}", found.value, alone.value);
        }
    }
}
