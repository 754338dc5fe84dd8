//! Filtered and smoothed states, against the whole trajectory as one Gaussian vector, and against the truth.

use crate::common::Noise;
use crate::walls::{Building, Heat, Heated, Matrix, Plant, Probes, ROWS, Record, STEP, Walls, record, start};
use greybox::*;
use nalgebra::DMatrix;

/// Mean and covariance of the states of the first `samples` samples, given all measurements of these: by the information of the first state, of
/// each step and of each measurement, in one matrix.
fn whole(
    record: &Record,
    plant: &Plant<f64>,
    covariance: &Matrix<f64>,
    samples: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = 2 * samples;
    let (mut information, mut vector) = (DMatrix::zeros(n, n), DMatrix::zeros(n, 1));
    // Adds `|| b x - c ||^2` in the metric of a covariance.
    let mut add = |b: &DMatrix<f64>, c: &DMatrix<f64>, covariance: &DMatrix<f64>| {
        let weight = covariance.clone().try_inverse().unwrap();
        information += b.transpose() * &weight * b;
        vector += b.transpose() * &weight * c;
    };
    let dense = |of: &Matrix<f64>| DMatrix::from_fn(of.len(), of[0].len(), |i, j| of[i][j]);
    let part = |k: usize, of: &DMatrix<f64>| {
        let mut all = DMatrix::zeros(of.nrows(), n);
        all.view_mut((0, 2 * k), (of.nrows(), 2)).copy_from(of);
        all
    };
    let one = DMatrix::identity(2, 2);
    add(&part(0, &one), &dense(&plant.x0), &dense(covariance));
    let steps = plant.steps(record);
    for (k, (u, probes)) in record.inputs().zip(record.outputs()).enumerate().take(samples) {
        for (y, (row, r)) in [probes.y, probes.z].into_iter().zip(ROWS.iter().zip(plant.r)) {
            if !y.is_nan() {
                add(
                    &part(k, &DMatrix::from_row_slice(1, 2, row)),
                    &DMatrix::from_element(1, 1, y),
                    &DMatrix::from_element(1, 1, r),
                );
            }
        }
        if k + 1 < samples {
            let step = &steps[k];
            add(&(part(k + 1, &one) - part(k, &dense(&step.phi))), &(dense(&step.gamma) * u.u), &dense(&step.noise));
        }
    }
    let covariance = information.try_inverse().unwrap();
    (&covariance * vector, covariance)
}

/// Of a continuous plant with uneven samples by Runge-Kutta's 40 steps, which leave 3e-11, and of a discrete one.
fn is_the_whole_trajectory<const DISCRETE: bool>(time: Time) {
    let samples = 45;
    let record = record::<DISCRETE>(time, samples).initial(Walls { a: fixed(0.4), b: fixed(-0.1) });
    let fit = || {
        let fit = Fit::new(&Heated::<DISCRETE>, &record).parameters(Building { p0: fixed(0.5), ..start() });
        let fit = fit.predictor(Kalman);
        if DISCRETE { fit } else { fit.integrator(Rk4 { substeps: 40 }) }
    };
    let estimate = fit().run().unwrap();
    let Building { tau, lose, gain, q, r, p0 } = estimate.parameters;
    let plant = Plant::new(&[tau.ln(), lose.ln(), gain, q.ln(), r.ln(), p0.ln(), 0.4, -0.1], DISCRETE);
    let close = |found: (&Walls, &[f64]), exact: &(DMatrix<f64>, DMatrix<f64>), k: usize| {
        let (mean, covariance) = found;
        for (i, mean) in [mean.a, mean.b].into_iter().enumerate() {
            let exact = exact.0[2 * k + i];
            assert!((mean - exact).abs() < 1e-9, "sample {k}, state {i}: {mean} {exact}");
        }
        for (at, found) in covariance.iter().enumerate() {
            let exact = exact.1[(2 * k + at / 2, 2 * k + at % 2)];
            assert!((found - exact).abs() < 1e-9, "sample {k}, entry {at}: {found} {exact}");
        }
    };
    let exact = whole(&record, &plant, &plant.p0, samples);
    let smoothed = fit().smoothed(&estimate, &record).unwrap();
    let filtered = fit().filtered(&estimate, &record).unwrap();
    for k in 0..samples {
        close((&smoothed.means[k], &smoothed.columns.covariances[k]), &exact, k);
        let until = whole(&record, &plant, &plant.p0, k + 1);
        close((&filtered.means[k], &filtered.columns.covariances[k]), &until, k);
        let Walls { a, b } = smoothed.deviations[k];
        assert_eq!(
            [a * a, b * b].map(|x| (x * 1e12).round()),
            [0, 3].map(|at| (smoothed.columns.covariances[k][at] * 1e12).round())
        );
    }
    assert_eq!(smoothed.means[samples - 1], filtered.means[samples - 1]);
    assert_eq!((smoothed.t.len(), smoothed.t[7]), (samples, record.time(7)));
    // Without types, by the same names.
    let problem = fit().problem().unwrap();
    let untyped = problem.smoothed(estimate.summary(), record.record()).unwrap();
    assert_eq!((untyped.means, untyped.names), (smoothed.columns.means, vec!["a".to_owned(), "b".to_owned()]));
}

#[test]
fn of_a_continuous_plant() {
    is_the_whole_trajectory::<false>(Time::Stamps(
        (0..45).map(|k| 0.1 * f64::from(k) + if k % 3 == 1 { 0.03 } else { 0.0 }).collect(),
    ));
}

#[test]
fn of_a_discrete_plant() {
    is_the_whole_trajectory::<true>(Time::Uniform { start: 0.0, step: STEP });
}

/// An initial state that is exact stays so, where no covariance has an inverse; and only a filter is asked.
#[test]
fn exact_begins_and_refusals() {
    let record =
        record::<true>(Time::Uniform { start: 0.0, step: STEP }, 60).initial(Walls { a: fixed(0.4), b: fixed(-0.1) });
    let fit = || Fit::new(&Heated::<true>, &record).parameters(Building { p0: fixed(0.0), ..start() });
    let estimate = fit().predictor(Kalman).run().unwrap();
    let smoothed = fit().predictor(Kalman).smoothed(&estimate, &record).unwrap();
    assert_eq!((smoothed.means[0], smoothed.deviations[0]), (Walls { a: 0.4, b: -0.1 }, Walls { a: 0.0, b: 0.0 }));
    assert!(smoothed.deviations[1..].iter().all(|deviation| deviation.a > 0.0 && deviation.b > 0.0));
    let Err(error @ Error::NotFiltered { .. }) = fit().smoothed(&estimate, &record) else { panic!() };
    let message = error.to_string();
    assert!(message.contains("simulation") && message.contains("Kalman"), "{message}");
}

/// A level that falls by its cube, `x+ = x - c x^3`, or a whole interval of `dx/dt = -c x^3`, seen by its square.
#[derive(Clone)]
struct Cubic<const DISCRETE: bool>;

signals! { pub struct Falling { c: "1/(m^2 s)", q: "m/s^0.5", r: "m^2" } }

impl<const DISCRETE: bool> Model for Cubic<DISCRETE> {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Falling;
    const KIND: Kind = if DISCRETE { Kind::Discrete } else { Kind::Continuous };

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, p: &Falling<S>) -> Level<S> {
        Level { x: -p.c * x.x * x.x * x.x }
    }
    fn next<S: Scalar>(&self, t: S, x: &Level<S>, u: &Nothing, p: &Falling<S>) -> Level<S> {
        Level { x: x.x + self.derivative(t, x, u, p).x }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Falling<S>) -> Level<S> {
        Level { x: x.x * x.x }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Falling<S>) -> Level<S> {
        Level { x: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Falling<S>) -> Level<S> {
        Level { x: p.r }
    }
}

/// To the second order, against the filter and the smoother of Rauch, Tung and Striebel by hand. In continuous time by 2,000 steps of Heun's method for
/// mean, variance and covariance with the state before, which leave some 1e-8 of what changes.
fn of_second_order<const DISCRETE: bool>(close: f64) {
    let (c, q, r, h) = (0.1, 0.2, 0.15, 0.7);
    let seen = |k: usize| if k % 4 == 2 { f64::NAN } else { 1.0 + 0.4 * (k as f64 * 0.9).sin() };
    let outputs: Vec<Level> = (0..25).map(|k| Level { x: seen(k) }).collect();
    let time = Time::Uniform { start: 0.0, step: h };
    let record = Experiment::new(&Cubic::<DISCRETE>, time, vec![Nothing; 25], outputs).unwrap();
    let record = record.initial(Level { x: fixed(1.2) });
    let start = Falling { c: fixed(c), q: fixed(q), r: free(r) };
    let fit = || {
        let fit = Fit::new(&Cubic::<DISCRETE>, &record).parameters(start).predictor(SecondOrder);
        if DISCRETE { fit } else { fit.integrator(Rk4 { substeps: 60 }) }
    };
    let estimate = fit().run().unwrap();
    let r = estimate.parameters.r;
    // Means of f and f', and their curvature, of a state with this mean and variance.
    let of = |m: f64, p: f64| (-c * (m * m * m + 3.0 * m * p), -c * 3.0 * (m * m + p), -c * 6.0 * m);
    let next = |m: f64, p: f64| {
        if DISCRETE {
            let (f, slope, curvature) = of(m, p);
            let a = 1.0 + slope;
            return (m + f, a * a * p + 0.5 * (curvature * p).powi(2) + q * q, a * p);
        }
        let rate = |[m, p, s]: [f64; 3]| {
            let (f, a, _) = of(m, p);
            [f, 2.0 * a * p + q * q, a * s]
        };
        let (steps, mut z) = (2000, [m, p, p]);
        for _ in 0..steps {
            let h = h / steps as f64;
            let first = rate(z);
            let second = rate([0, 1, 2].map(|i| z[i] + h * first[i]));
            z = [0, 1, 2].map(|i| z[i] + 0.5 * h * (first[i] + second[i]));
        }
        (z[0], z[1], z[2])
    };
    let (mut m, mut p, mut filtered, mut crossed) = (1.2, 0.0, vec![], vec![]);
    for k in 0..25 {
        if !seen(k).is_nan() {
            // y = x^2 has the mean m^2 + p, the slope 2 m, and its curvature adds 2 p^2.
            let variance = 4.0 * m * m * p + 2.0 * p * p + r * r;
            let gain = 2.0 * m * p / variance;
            m += gain * (seen(k) - m * m - p);
            p -= gain * gain * variance;
        }
        filtered.push((m, p));
        let (mean, variance, covariance) = next(m, p);
        crossed.push((mean, variance, covariance));
        (m, p) = (mean, variance);
    }
    let mut smoothed = filtered.clone();
    for k in (0..24).rev() {
        let (mean, variance, covariance) = crossed[k];
        let gain = covariance / variance;
        smoothed[k].0 += gain * (smoothed[k + 1].0 - mean);
        smoothed[k].1 += gain * gain * (smoothed[k + 1].1 - variance);
    }
    for (found, expected) in [
        (fit().filtered(&estimate, &record).unwrap(), filtered),
        (fit().smoothed(&estimate, &record).unwrap(), smoothed),
    ] {
        for (k, (m, p)) in expected.into_iter().enumerate() {
            let (mean, variance) = (found.means[k].x, found.columns.covariances[k][0]);
            assert!((mean - m).abs() < close && (variance - p).abs() < close, "{k}: {mean} {m}, {variance} {p}");
        }
    }
}

#[test]
fn of_second_order_in_steps() {
    of_second_order::<true>(1e-12);
}

#[test]
fn of_second_order_in_continuous_time() {
    // Steps of 0.00035 s of a plant that changes within a second.
    of_second_order::<false>(1e-6);
}

/// Of 60 records of a plant that was at rest, the states lie within 1.96 deviations of the smoothed ones at 95 % of the samples, and of the
/// filtered ones. A state is correlated over some ten samples of 60: 60 * 6 * 2 independent ones scatter by 0.8 %. The smoothed deviations are
/// smaller.
#[test]
fn bands_hold_the_truth() {
    let truth = Building { tau: 0.8, lose: 2.5, gain: 1.0, q: 0.2, r: 0.15, p0: 0.0 };
    let mut noise = Noise(9);
    let mut simulated = |samples: usize| {
        let (mut x, mut states, mut inputs, mut outputs) = (Walls { a: 0.0, b: 0.0 }, vec![], vec![], vec![]);
        for k in 0..200 + samples {
            let u = Heat { u: if k < 200 { 0.0 } else { [1.0, -0.5, 0.0, 2.0][k / 11 % 4] } };
            if k >= 200 {
                let seen = Probes { y: x.a + truth.r * noise.gauss(), z: x.a + x.b + 2.0 * truth.r * noise.gauss() };
                outputs.push(Probes { z: if k % 3 == 0 { seen.z } else { f64::NAN }, ..seen });
                inputs.push(u);
                states.push(x);
            }
            x = Heated::<true>.next(0.0, &x, &u, &truth);
            (x.a, x.b) = (x.a + truth.q * noise.gauss(), x.b + 0.5 * truth.q * noise.gauss());
        }
        let time = Time::Uniform { start: 0.0, step: STEP };
        let record = Experiment::new(&Heated::<true>, time, inputs, outputs).unwrap();
        (record.initial(Walls { a: fixed(0.0), b: fixed(0.0) }), states)
    };
    let (long, _) = simulated(3000);
    let fit = || {
        let fit = Fit::new(&Heated::<true>, &long).parameters(Building { p0: fixed(0.0), ..start() });
        fit.predictor(Kalman::starting(InitialCovariance::Stationary))
    };
    let estimate = fit().run().unwrap();
    let (mut inside, mut all, mut spread) = ([0.0; 2], 0.0, [0.0; 2]);
    for _ in 0..60 {
        let (record, states) = simulated(60);
        let found = [fit().filtered(&estimate, &record).unwrap(), fit().smoothed(&estimate, &record).unwrap()];
        for (k, x) in states.iter().enumerate() {
            for (which, found) in found.iter().enumerate() {
                let (mean, deviation) = (found.means[k], found.deviations[k]);
                let within =
                    |x: f64, mean: f64, deviation: f64| f64::from(u8::from((x - mean).abs() < 1.96 * deviation));
                inside[which] += within(x.a, mean.a, deviation.a) + within(x.b, mean.b, deviation.b);
                spread[which] += deviation.a + deviation.b;
            }
            all += 2.0;
        }
    }
    println!("{:?} {:?}", inside.map(|inside| inside / all), spread.map(|spread| spread / all));
    for inside in inside {
        // Four deviations.
        assert!((inside / all - 0.95).abs() < 0.033, "{}", inside / all);
    }
    // Measured: 10 % smaller; each covariance is compared with the exact one above.
    assert!(spread[1] < 0.9 * spread[0], "{spread:?}");
}

signals! { pub struct Level { x: "m" } }
signals! { pub struct Levels { r: "m" } }

/// A level that stays as it is, and of which nothing is known before its measurements: to a thousand kilometers.
#[derive(Clone)]
struct Still;

impl Model for Still {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Levels;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Levels<S>) -> Level<S> {
        *x
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Levels<S>) -> Level<S> {
        *x
    }

    fn initial_noise<S: Scalar>(&self, _p: &Levels<S>) -> Level<S> {
        Level { x: S::from(1e6) }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> {
        Level { x: p.r }
    }
}

/// Before the first measurement, the variance of 1e12 that the later ones lower to 1e-6 / 9 leaves no digit of the difference: the deviation is then
/// that of rounding, 1e6 sqrt(2^-52), and not zero. After it, the filter's own variance has its digits.
#[test]
fn a_deviation_is_not_rounded_to_zero() {
    let outputs: Vec<Level> =
        (0..10).map(|k| Level { x: if k == 0 { f64::NAN } else { 5.0 + 1e-3 * f64::from(k % 2) } }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&Still, time, vec![Nothing; 10], outputs).unwrap().initial(Level { x: fixed(0.0) });
    let fit = || Fit::new(&Still, &record).parameters(Levels { r: free(2e-3).log() }).predictor(Kalman);
    let estimate = fit().run().unwrap();
    let (r, smoothed) = (estimate.parameters.r, fit().smoothed(&estimate, &record).unwrap());
    let deviation = |k: usize| smoothed.deviations[k].x;
    assert!((deviation(0) - 1e6 * f64::EPSILON.sqrt()).abs() < 1e-6, "{}", deviation(0));
    // Of nine measurements, but for the roundings of a variance of 1e12 that the first one lowers.
    assert!((deviation(5) / (r / 3.0) - 1.0).abs() < 1e-3, "{} {r}", deviation(5));
}
