//! Dead times of a whole number of samples under held inputs: the cost has a kink there, whose slopes from both sides may lead back to it.

use crate::{Excess, Heated, Process, Sensor, Valve};
use greybox::*;

/// 240 samples of a lag of `tau` behind a dead time of `theta` (s), whose input is held for 4 to 7 s at a time.
fn record(seed: u64, tau: f64, theta: f64) -> ExperimentOf<Heated> {
    let (mut level, mut left, mut state) = (1.0, 0, seed);
    let mut input = |k: usize| {
        if left == 0 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (level, left) = (-level, 4 + (state >> 62) as usize);
        }
        left -= 1;
        Valve { u: if k < 7 { 0.0 } else { level } }
    };
    let inputs: Vec<Valve> = (0..240).map(&mut input).collect();
    let truth = Process { y0: 0.0, k: 2.0, tau, theta };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let run = Simulator::new(&Heated).integrator(Rk4 { substeps: 8 }).run(&truth, &Excess { z: 0.0 }, time, &inputs);
    let record = run.unwrap().with_noise(Sensor { y: 0.05 }, seed).experiment(&Heated).unwrap();
    record.initial(Excess { z: fixed(0.0) })
}

fn fit(record: &ExperimentOf<Heated>, theta: Parameter) -> Estimate<Heated> {
    let parameters = Process { y0: fixed(0.0), k: free(1.0), tau: free(6.0), theta };
    Fit::new(&Heated, record).parameters(parameters).run().unwrap()
}

/// Of thirty records, each has a minimum that is found, at the kink in some, beside it in others. None is worse than with the dead time known, and the
/// others are as well known as then: the sum of squares is the same to a part of 1e-6 where the estimate is at the kink.
#[test]
fn minima_at_a_whole_number_of_samples() {
    let mut at_the_kink = 0;
    for seed in 0..30 {
        let record = record(seed, 4.0, 3.0);
        let found = fit(&record, free(2.0).within(0.0, 20.0));
        assert!(found.outcome.converged(), "{seed}: {found}");
        assert!(found.severity() < Severity::NotUsable, "{seed}: {found}");
        assert!((found.parameters.theta - 3.0).abs() < 0.2, "{seed}: {found}");
        let known = fit(&record, fixed(3.0));
        let (found_deviance, known_deviance) = (found.deviance.unwrap(), known.deviance.unwrap());
        assert!(found_deviance < known_deviance + 1e-4, "{seed}: {found_deviance} {known_deviance}");
        if (found.parameters.theta - 3.0).abs() < 1e-6 {
            at_the_kink += 1;
            assert!((found.parameters.tau / known.parameters.tau - 1.0).abs() < 1e-5, "{seed}: {found}");
        }
    }
    assert!((2..29).contains(&at_the_kink), "{at_the_kink}");
}

/// A lag shorter than a sample: the slope with respect to a dead time twenty times as long changes over a small part of it, and searches by a finer step
/// creep towards the kink.
#[test]
fn minima_of_a_fast_plant() {
    let mut rivals = 0;
    for seed in 0..30 {
        let found = fit(&record(seed, 0.8, 15.0), free(10.0).within(0.0, 60.0));
        // In few the data do not tell the estimate from a minimum on the other side of 15 s.
        let rival = found.warnings.iter().any(|warning| warning.code == WarningCode::RivalMinimum);
        let severity = if rival { Severity::UsableWithCare } else { Severity::Usable };
        assert!(found.severity() == severity, "{seed}: {found}");
        rivals += u32::from(rival);
        let errors = [(found.parameters.tau, 0.8, 1), (found.parameters.theta, 15.0, 2)]
            .map(|(value, truth, i)| (value - truth).abs() / found.unknowns[i].knowledge.standard_error().unwrap());
        // Four standard errors: one of 500 such fits by chance.
        assert!(errors.into_iter().all(|errors| errors < 4.0), "{seed}: {errors:?} {found}");
    }
    assert!(rivals <= 5, "{rivals}");
}

/// An input that changes at every sample: the cost has a minimum between any two whole numbers of samples, of which a single search may end in
/// a wrong one. A start 1.3 samples off leads to the estimate of a start at the truth.
#[test]
fn minima_between_whole_numbers_of_samples() {
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut elsewhere = 0;
    for seed in 0..20 {
        let inputs: Vec<Valve> = (0..400).map(|_| Valve { u: random() }).collect();
        let truth = Process { y0: 0.0, k: 2.0, tau: 10.0, theta: 3.3 };
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let run =
            Simulator::new(&Heated).integrator(Rk4 { substeps: 4 }).run(&truth, &Excess { z: 0.0 }, time, &inputs);
        let record = run.unwrap().with_noise(Sensor { y: 0.15 }, seed).experiment(&Heated).unwrap();
        let record = record.initial(Excess { z: fixed(0.0) });
        let [found, right] = [2.0, 3.3].map(|theta| fit(&record, free(theta).within(0.0, 20.0)));
        let plain = Process { y0: fixed(0.0), k: free(1.0), tau: free(6.0), theta: free(2.0).within(0.0, 20.0) };
        let single = Fit::new(&Heated, &record).parameters(plain).starts(1).run().unwrap();
        elsewhere += u32::from((single.parameters.theta - right.parameters.theta).abs() > 0.1);
        assert!((found.parameters.theta - right.parameters.theta).abs() < 1e-4, "{seed}: {found} {right}");
    }
    assert!(elsewhere >= 3, "{elsewhere}");
}
