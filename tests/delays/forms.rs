//! Simulations and slopes by their closed forms.

use crate::{Excess, Heated, Process, Sensor, Valve};
use argmin::core::{CostFunction, Gradient};
use greybox::*;

/// The answer to a step of the input at time `at` by one, or to a ramp of one per second from then on, of which `hold` is each.
fn answer<S: Scalar>(p: &Process<S>, hold: Hold, at: f64, t: f64) -> S {
    let since = -p.theta + (t - at);
    let decay = (-since / p.tau).exp();
    let form = match hold {
        Hold::Zero => -decay + 1.0,
        Hold::First => since - p.tau * (-decay + 1.0),
    };
    // At its first instant the slope is that of a longer dead time.
    let before = since.value() <= 0.0;
    p.k * if before { S::from(0.0) } else { form }
}

fn uneven(samples: usize) -> Time {
    Time::Stamps((0..samples).map(|k| k as f64 + if k % 3 == 1 { 0.3 } else { 0.0 }).collect())
}

/// A step (held) or a ramp (interpolated) at sample 3; dead times between samples, at whole numbers of them and zero; even and uneven
/// time. Values and gradient are those of the closed form; at a whole number the slope is that of a longer dead time. 50 steps of fourth
/// order per sample, of 1/250 of the time constant each (three times as many between uneven samples), err by some (1/250)^4/120 = 2e-12.
#[test]
fn steps_and_ramps_by_their_closed_forms() {
    for time in [Time::Uniform { start: 0.0, step: 1.0 }, uneven(40)] {
        for (hold, theta) in
            [Hold::Zero, Hold::First].into_iter().flat_map(|hold| [0.0, 0.4, 2.0, 4.7].map(|theta| (hold, theta)))
        {
            let truth = Process { y0: 2.0, k: 1.5, tau: 5.0, theta };
            let at = time.at(3);
            let input = |k: usize| match hold {
                Hold::Zero => f64::from(u8::from(k >= 3)),
                Hold::First => (time.at(k) - at).max(0.0),
            };
            let inputs: Vec<Valve> = (0..40).map(|k| Valve { u: input(k) }).collect();
            let fine = Rk4 { substeps: 50 };
            let run = Simulator::new(&Heated)
                .hold(hold)
                .integrator(fine)
                .run(&truth, &Excess { z: 0.0 }, time.clone(), &inputs)
                .unwrap();
            for (k, y) in run.outputs.iter().enumerate() {
                let exact = 2.0 + answer(&truth, hold, at, time.at(k));
                assert!((y.y - exact).abs() < 1e-10, "{hold:?} {theta} {k}: {} {exact}", y.y);
            }
            // Against outputs of zero, with a noise of one, the cost is half the sum of squares.
            let outputs = vec![Sensor { y: 0.0 }; 40];
            let record = Experiment::new(&Heated, time.clone(), inputs, outputs).unwrap().hold(hold);
            let record = record.initial(Excess { z: fixed(0.0) });
            let parameters = Process { y0: free(2.0), k: free(1.5), tau: free(5.0), theta: free(theta) };
            let fit = Fit::new(&Heated, &record).parameters(parameters).noise(Sensor { y: 1.0 });
            let problem = fit.integrator(fine).problem().unwrap();
            let objective = problem.objective().unwrap();
            let p: Vec<Dual<4>> =
                [2.0, 1.5, 5.0, theta].into_iter().enumerate().map(|(i, p)| Dual::variable(p, i)).collect();
            let p = Process { y0: p[0], k: p[1], tau: p[2], theta: p[3] };
            let square = |k: usize| {
                let y = p.y0 + answer(&p, hold, at, time.at(k));
                y * y * 0.5
            };
            let exact = (0..40).map(square).reduce(|a, b| a + b).unwrap();
            let found = (objective.cost(&objective.start()).unwrap(), objective.gradient(&objective.start()).unwrap());
            assert!((found.0 / exact.value - 1.0).abs() < 1e-10, "{hold:?} {theta}: {} {}", found.0, exact.value);
            for (found, exact) in found.1.iter().zip(exact.slopes) {
                assert!((found - exact).abs() < 1e-9 * exact.abs().max(1.0), "{hold:?} {theta}: {found} {exact}");
            }
        }
    }
}
