//! Simulations with process noise, against exact covariances.

use crate::walls::{Building, Heat, Heated, Matrix, Plant, Probes, STEP, Walls};
use greybox::*;

const TRUTH: Building = Building { tau: 0.8, lose: 2.5, gain: 1.0, q: 0.4, r: 0.15, p0: 0.0 };

/// The state after one interval of `h` (s) from `x`, disturbed or not.
fn after<const DISCRETE: bool>(h: f64, x: Walls, seed: Option<u64>) -> Walls {
    let model = Heated::<DISCRETE>;
    let simulator = Simulator::new(&model).integrator(Automatic::default());
    let simulator = seed.map_or(simulator.clone(), |seed| simulator.disturbed(seed));
    let time = Time::Uniform { start: 0.0, step: h };
    simulator.run(&TRUTH, &x, time, &[Heat { u: 1.0 }; 2]).unwrap().states[1]
}

/// Of 4,000 draws, means and covariances lie within four of their deviations of the exact ones, for a tenth of a time constant and for three.
fn is_exact<const DISCRETE: bool>(h: f64, exact: &Matrix<f64>) {
    const DRAWS: u64 = 4000;
    let x = Walls { a: 0.5, b: -0.3 };
    let still = after::<DISCRETE>(h, x, None);
    let (mut mean, mut product) = ([0.0; 2], [0.0; 3]);
    for seed in 0..DRAWS {
        let found = after::<DISCRETE>(h, x, Some(seed));
        let [a, b] = [found.a - still.a, found.b - still.b];
        mean.iter_mut().zip([a, b]).for_each(|(sum, x)| *sum += x / DRAWS as f64);
        product.iter_mut().zip([a * a, a * b, b * b]).for_each(|(sum, x)| *sum += x / DRAWS as f64);
    }
    let deviation = |i: usize| (exact[i][i] / DRAWS as f64).sqrt();
    assert!((0..2).all(|i| mean[i].abs() < 4.0 * deviation(i)), "{mean:?}");
    for (found, (i, j)) in product.into_iter().zip([(0, 0), (0, 1), (1, 1)]) {
        // The variance of a product of two normal numbers.
        let spread = (exact[i][i] * exact[j][j] + exact[i][j] * exact[i][j]).sqrt() / (DRAWS as f64).sqrt();
        assert!((found - exact[i][j]).abs() < 4.0 * spread, "{h} s, {i} {j}: {found} {}", exact[i][j]);
    }
}

#[test]
fn covariances_of_one_interval() {
    let at = [TRUTH.tau.ln(), TRUTH.lose.ln(), TRUTH.gain, TRUTH.q.ln(), TRUTH.r.ln(), 0.0, 0.0, 0.0];
    let plant = Plant::new(&at, false);
    for h in [0.1, 2.5] {
        is_exact::<false>(h, &plant.over(h).noise);
    }
    is_exact::<true>(STEP, &plant.q);
}

/// The same seed draws the same, other samples are independent, and the noise of the measurements is other noise.
#[test]
fn seeds() {
    let model = Heated::<true>;
    let time = Time::Uniform { start: 0.0, step: STEP };
    let run = |seed: u64| {
        let simulator = Simulator::new(&model).disturbed(seed);
        simulator.run(&TRUTH, &Walls { a: 0.0, b: 0.0 }, time.clone(), &[Heat { u: 0.0 }; 2000]).unwrap()
    };
    let (first, again, other) = (run(1), run(1), run(2));
    assert_eq!(first.states, again.states);
    assert!(first.states[1..].iter().zip(&other.states[1..]).all(|(a, b)| a != b));
    // What is added at each step to a, and at the next, and to b, and to y by measurement noise of the same seed.
    let added = |k: usize| {
        let next = model.next(0.0, &first.states[k], &Heat { u: 0.0 }, &TRUTH);
        [(first.states[k + 1].a - next.a) / TRUTH.q, (first.states[k + 1].b - next.b) / (0.5 * TRUTH.q)]
    };
    let noisy = first.clone().with_noise(Probes { y: 1.0, z: 1.0 }, 1);
    let sum = |f: &dyn Fn(usize) -> f64| (0..1990).map(f).sum::<f64>() / 1990.0;
    let correlations = [
        sum(&|k| added(k)[0] * added(k + 1)[0]),
        sum(&|k| added(k)[0] * added(k)[1]),
        sum(&|k| added(k)[0] * (noisy.outputs[k].y - first.outputs[k].y)),
        sum(&|k| added(k)[0] * (noisy.outputs[k + 1].y - first.outputs[k + 1].y)),
    ];
    // Four deviations of 1 / sqrt(1990).
    assert!(correlations.iter().all(|correlation| correlation.abs() < 0.09), "{correlations:?}");
    assert!((sum(&|k| added(k)[0] * added(k)[0]) - 1.0).abs() < 0.13);
}
