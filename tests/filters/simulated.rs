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

/// Equations draw what the Rust model draws from the same seed, by the same steps; without levels in the call, their own noise is added to the
/// outputs.
fn equations_draw_the_same<const DISCRETE: bool>() {
    let model = Heated::<DISCRETE>;
    let equations = equations::Equations::trace(&model).unwrap();
    // Intervals of three lengths.
    let times: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k) + 0.04 * f64::from(k % 3)).collect();
    let time = if DISCRETE { Time::Uniform { start: 0.0, step: STEP } } else { Time::Stamps(times) };
    let inputs: Vec<Heat> = (0..400).map(|k| Heat { u: [1.0, -0.5][k / 20 % 2] }).collect();
    let from = Walls { a: 0.5, b: -0.3 };
    let typed = Simulator::new(&model).integrator(Automatic::default()).disturbed(7);
    let typed = typed.run(&TRUTH, &from, time, &inputs).unwrap();
    let record = typed.experiment(&model).unwrap().record().clone();
    let none: [record::Record; 0] = [];
    let parameters = Building::into_array(TRUTH).map(fixed).to_vec();
    let fit = Fit::new(&equations, &none).parameters(parameters).integrator(Automatic::default());
    let simulated = |noise: &[Option<f64>]| fit.simulate_noisy(&[0.5, -0.3], &record, noise, 7).unwrap();
    let (silent, one, noisy) =
        (simulated(&[Some(0.0), Some(0.0)]), simulated(&[Some(0.0), None]), simulated(&[None, None]));
    let mut squares = [0.0; 2];
    for (k, y) in typed.outputs.iter().enumerate() {
        let at = |record: &record::Record| [0, 1].map(|j| record.outputs()[j].values[k]);
        let [found, one, noisy] = [&silent, &one, &noisy].map(at);
        // Some 400 steps, each with rounding.
        assert!((found[0] - y.y).abs() < 1e-12 && (found[1] - y.z).abs() < 1e-12, "{k}: {found:?} {y:?}");
        assert_eq!([one[0], one[1]], [found[0], noisy[1]]);
        (0..2).for_each(|j| squares[j] += (noisy[j] - found[j]).powi(2) / 400.0);
    }
    // Variances of 400 numbers within four deviations, 4 sqrt(2 / 400).
    let parts = [squares[0] / TRUTH.r.powi(2), squares[1] / (2.0 * TRUTH.r).powi(2)];
    assert!(parts.iter().all(|part| (part - 1.0).abs() < 0.29), "{parts:?}");
    let errors = [
        fit.simulate_noisy(&[0.5, -0.3], &record, &[Some(-1.0), None], 7),
        fit.simulate_noisy(&[0.5, -0.3], &record, &[], 7),
    ];
    let errors = errors.map(|error| error.unwrap_err().to_string());
    assert_eq!(errors[0], "the noise of output `y` is -1; give zero or a positive number");
    assert_eq!(errors[1], "0 noise level(s) are given for 2 output(s)");
}

#[test]
fn equations_draw_what_a_model_draws() {
    equations_draw_the_same::<false>();
    equations_draw_the_same::<true>();
}

/// A level of noise that is declared positive is searched by its logarithm: where the plant is not disturbed, it is held at zero with care, and what
/// is declared without stays as it is. A search for it as it is ends at the precision of the cost, of a right model.
#[test]
fn a_level_of_zero_is_held() {
    let model = Heated::<false>;
    let time = Time::Uniform { start: 0.0, step: 0.3 };
    let inputs: Vec<Heat> = (0..600).map(|k| Heat { u: [1.0, -0.5, 2.0][k / 20 % 3] }).collect();
    let start = |level: Parameter| Building {
        tau: free(1.0),
        lose: free(2.0),
        gain: free(1.2),
        q: level,
        r: free(0.1).positive(),
        p0: fixed(0.0),
    };
    let mut held = 0;
    for seed in 1..=8 {
        let run = Simulator::new(&model).integrator(Rk45::default());
        let run = run.run(&TRUTH, &Walls { a: 0.5, b: -0.3 }, time.clone(), &inputs).unwrap();
        let record = run.with_noise(Probes { y: 0.15, z: 0.3 }, seed).experiment(&model).unwrap();
        let fit = |level| Fit::new(&model, &record).parameters(start(level)).predictor(Kalman).run().unwrap();
        let positive = fit(free(0.2).positive());
        let [q, r] = [3, 4].map(|i| &positive.unknowns[i]);
        assert_eq!((q.transform, r.transform), (Transform::Log, Transform::Log));
        assert!(positive.severity() <= Severity::UsableWithCare, "{seed}: {positive}");
        held += usize::from(matches!(q.knowledge, Knowledge::Held { bound: 0.0, .. }));
        assert_eq!(fit(free(0.2)).unknowns[3].transform, Transform::Identity);
    }
    // Of an unknown at a bound half of the estimates are there.
    assert!((2..=7).contains(&held), "{held}");
}

/// Steps are as fine as the disturbed plant asks for, also where it would rest without noise: a cubic decay with ten and twenty time constants between two
/// samples forgets its state from one to the next. Its variance is, to the first order in the cubic part, that of the linear plant.
#[test]
fn steps_follow_the_disturbed_plant() {
    let text = "greybox = 1\n[inputs]\nu = \"V\"\n[parameters]\na = { start = 1.0 }\nq = { start = 1.0 }\n[states]\n\
        x = { unit = \"V\", derivative = \"u - a*(x + 0.1*x^3)\", diffusion = \"q\" }\n[outputs]\nx = \"x\"\n";
    let model = text::Model::named("decay", text).unwrap();
    let (time, states) = (Time::Uniform { start: 0.0, step: 0.05 }, model.equations().layout().states.clone());
    let channel = record::Channel::new("u", "V", vec![0.0; 5000]);
    let inputs = record::Record::new(states, time, vec![channel], vec![]).unwrap();
    let none: [record::Record; 0] = [];
    for a in [200.0, 400.0] {
        let fit = Fit::new(&**model.equations(), &none).parameters(vec![fixed(a), fixed(1.0)]);
        let run = fit.simulate_noisy(&[0.0], &inputs, &[None], 1).unwrap();
        let x = &run.outputs()[0].values;
        let variance = x.iter().map(|x| x * x).sum::<f64>() / 5000.0;
        let neighbors = x.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / 5000.0 / variance;
        // Four deviations of 5,000 independent numbers.
        assert!((2.0 * a * variance - 1.0).abs() < 0.08 && neighbors.abs() < 0.057, "{a}: {variance} {neighbors}");
    }
}
