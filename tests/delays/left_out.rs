//! Dead times that a model leaves out: said at every size, and a longer one never with the milder verdict.

use crate::common::Noise;
use crate::{Excess, Heated, Process, Sensor, Valve};
use greybox::Severity;
use greybox::*;

signals! { pub struct Quick { y0: "K", k: "K/%", tau: "s" } }

/// The plant without its dead time.
#[derive(Clone)]
struct Prompt;

impl Model for Prompt {
    type State = Excess;
    type Input = Valve;
    type Output = Sensor;
    type Parameters = Quick;
    fn derivative<S: Scalar>(&self, _t: S, x: &Excess<S>, u: &Valve<S>, p: &Quick<S>) -> Excess<S> {
        Excess { z: (p.k * u.u - x.z) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Excess<S>, _u: &Valve<S>, p: &Quick<S>) -> Sensor<S> {
        Sensor { y: p.y0 + x.z }
    }
}

/// Levels of 0 to 50 % for 5 to 45 s each.
fn levels(samples: usize, seed: u64) -> Vec<Valve> {
    let mut noise = Noise(seed);
    let (mut left, mut u) = (0.0, 0.0);
    let mut next = || {
        if left < 1.0 {
            (left, u) = (5.0 + 40.0 * noise.uniform(), 50.0 * noise.uniform());
        }
        left -= 1.0;
        Valve { u }
    };
    (0..samples).map(|_| next()).collect()
}

/// Of 1, 2, 4, 8, 16 and 32 samples, with a lag of 20 and noise of 1 % of what the output moves.
#[test]
fn a_dead_time_left_out_is_said() {
    let sizes = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
    for seed in 1..=3 {
        let inputs = levels(600, seed);
        let judged = sizes.map(|theta| {
            let truth = Process { y0: 20.0, k: 0.6, tau: 20.0, theta };
            let time = Time::Uniform { start: 0.0, step: 1.0 };
            let run = simulate(&Heated, &truth, &Excess { z: 0.0 }, time, &inputs).unwrap();
            let record =
                run.with_noise(Sensor { y: 0.1 }, seed).experiment(&Heated).unwrap().initial(Excess { z: fixed(0.0) });
            let start = Quick { y0: free(18.0), k: free(1.0), tau: free(10.0).log() };
            Fit::new(&Prompt, &record).parameters(start).run().unwrap()
        });
        for (estimate, theta) in judged.iter().zip(sizes) {
            println!("{seed} {theta}: {estimate}");
            assert!(estimate.severity() > Severity::Usable, "{theta}: {estimate}");
            let named = |warning: &Warning| {
                ["delay", " samples after what the model predicts"].iter().any(|text| warning.text.contains(text))
            };
            assert!(estimate.warnings.iter().any(named), "{theta}: {estimate}");
        }
        let order: Vec<Severity> = judged.iter().map(|estimate| estimate.severity()).collect();
        assert!(order.is_sorted(), "{order:?}");
        assert_eq!(order[5], Severity::NotUsable);
    }
}
