//! How filters begin: initial covariances against an exact filter, and refusals.

use crate::walls::{AT, Building, D, Heated, Matrix, Plant, STEP, Walls, likelihood, record, start, zeros};
use argmin::core::{CostFunction, Gradient};
use core::f64::consts::TAU;
use greybox::*;

/// The stationary covariance by its linear equations of `p11, p12, p22`: `A P + P A' + Q = 0`.
fn at_rest(plant: &Plant<D>) -> Matrix<D> {
    let (a, q, zero) = (&plant.a, &plant.q, D::from(0.0));
    solved([
        [a[0][0] * 2.0, a[0][1] * 2.0, zero, -q[0][0]],
        [a[1][0], a[0][0] + a[1][1], a[0][1], -q[0][1]],
        [zero, a[1][0] * 2.0, a[1][1] * 2.0, -q[1][1]],
    ])
}

/// The same of `P = F P F' + Q`.
fn at_rest_in_steps(plant: &Plant<D>) -> Matrix<D> {
    let (f, q) = (plant.stepped().phi, &plant.q);
    let row = |i: usize, j: usize| {
        let own = |m: usize, n: usize| D::from(f64::from(u8::from((i, j) == (m, n))));
        let cross = f[i][0] * f[j][1] + f[i][1] * f[j][0];
        [f[i][0] * f[j][0] - own(0, 0), cross - own(0, 1), f[i][1] * f[j][1] - own(1, 1), -q[i][j]]
    };
    solved([row(0, 0), row(0, 1), row(1, 1)])
}

/// By Gauss's elimination.
fn solved(mut rows: [[D; 4]; 3]) -> Matrix<D> {
    for i in 0..3 {
        let pivot = rows[i];
        for (_, row) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let factor = row[i] / pivot[i];
            (0..4).for_each(|k| row[k] -= factor * pivot[k]);
        }
    }
    let [p11, p12, p22] = [0, 1, 2].map(|i| rows[i][3] / rows[i][i]);
    vec![vec![p11, p12], vec![p12, p22]]
}

/// Likelihood and gradient of a fit at a point against those of the exact filter from a covariance, to this part of the largest.
pub fn agrees<const DISCRETE: bool>(
    fit: Fit<'_, Heated<DISCRETE>>,
    record: &ExperimentOf<Heated<DISCRETE>>,
    exact: impl Fn(&Plant<D>) -> Matrix<D>,
    tolerance: f64,
) {
    let problem = fit.problem().unwrap();
    let objective = problem.objective().unwrap();
    let seeded: Vec<D> = AT.iter().enumerate().map(|(i, x)| Dual::variable(*x, i)).collect();
    let plant = Plant::new(&seeded, DISCRETE);
    let exact = likelihood(record, &plant, exact(&plant));
    let measured = record.outputs().flat_map(|probes| [probes.y, probes.z]).filter(|y| !y.is_nan()).count();
    let found = objective.cost(&AT.to_vec()).unwrap() + 0.5 * measured as f64 * TAU.ln();
    println!("{found} {} {:e}", exact.value, found / exact.value - 1.0);
    assert!((found / exact.value - 1.0).abs() < tolerance, "{found} {}", exact.value);
    let found = objective.gradient(&AT.to_vec()).unwrap();
    let size = exact.slopes.iter().fold(1.0, |size: f64, slope| size.max(slope.abs()));
    for (found, exact) in found.iter().zip(exact.slopes) {
        println!("{found} {exact} {:e}", (found - exact) / size);
        assert!((found - exact).abs() < tolerance * size, "{found} {exact}");
    }
}

/// From each covariance, in programs and in dual numbers. Runge-Kutta's 40 steps leave `40 (2 h / 40 tau)^5 / 120`, with `h / tau` of 0.2 some
/// 3e-11, of the covariance; the adaptive method, of tolerance 1e-12, the same.
fn from_each<const DISCRETE: bool>(time: &Time, samples: usize, at_rest: fn(&Plant<D>) -> Matrix<D>) {
    let record = record::<DISCRETE>(time.clone(), samples);
    let first = |plant: &Plant<D>| match DISCRETE {
        true => plant.q.clone(),
        false => plant.over(record.time(1) - record.time(0)).noise,
    };
    for in_duals in [false, true] {
        let fit = || {
            let fit = Fit::new(&Heated::<DISCRETE>, &record).parameters(start());
            match (in_duals, DISCRETE) {
                (_, true) => fit,
                (true, false) => fit.integrator(Rk45 { relative: 1e-12, absolute: 1e-13 }),
                (false, false) => fit.integrator(Rk4 { substeps: 40 }),
            }
        };
        agrees(fit().predictor(Kalman), &record, |plant| plant.p0.clone(), 1e-9);
        agrees(fit().predictor(Kalman::starting(InitialCovariance::Stationary)), &record, at_rest, 1e-9);
        agrees(fit().predictor(Kalman::starting(InitialCovariance::FirstInterval)), &record, first, 1e-9);
        agrees(fit().predictor(SecondOrder::starting(InitialCovariance::Stationary)), &record, at_rest, 1e-9);
        if DISCRETE {
            break;
        }
    }
}

fn uneven(samples: usize) -> Time {
    Time::Stamps((0..samples).map(|k| 0.1 * k as f64 + if k % 3 == 1 { 0.03 } else { 0.0 }).collect())
}

#[test]
fn likelihoods_of_a_continuous_plant() {
    from_each::<false>(&uneven(60), 60, at_rest);
}

/// A record that is cut into segments, whose first one alone begins with it.
#[test]
fn likelihoods_of_a_discrete_plant() {
    from_each::<true>(&Time::Uniform { start: 0.0, step: STEP }, 1200, at_rest_in_steps);
}

/// By default, evenly spaced samples of linear equations are crossed exactly, at a fifth and at twice the shortest time constant, in
/// segments and without: what is left is the rounding of sums of a thousand terms.
#[test]
fn likelihoods_by_exact_transitions() {
    for (step, samples) in [(0.1, 60), (0.1, 1200), (0.9, 60)] {
        let record = record::<false>(Time::Uniform { start: 0.0, step }, samples);
        let fit = || Fit::new(&Heated::<false>, &record).parameters(start());
        agrees(fit().predictor(Kalman), &record, |plant| plant.p0.clone(), 1e-11);
        agrees(fit().predictor(SecondOrder), &record, |plant| plant.p0.clone(), 1e-11);
        agrees(fit().predictor(Kalman::starting(InitialCovariance::Stationary)), &record, at_rest, 1e-11);
        let first = |plant: &Plant<D>| plant.over(step).noise;
        agrees(fit().predictor(Kalman::starting(InitialCovariance::FirstInterval)), &record, first, 1e-11);
    }
}

/// Several measurements at the first instant have one interval, which is that from the last of them.
#[test]
fn the_first_interval_is_longer_than_zero() {
    let time = Time::Stamps((0..40usize).map(|k| 0.1 * k.saturating_sub(2) as f64).collect());
    let record = record::<false>(time, 40);
    let fit = Fit::new(&Heated::<false>, &record).parameters(start()).integrator(Rk4 { substeps: 40 });
    let fit = fit.predictor(Kalman::starting(InitialCovariance::FirstInterval));
    agrees(fit, &record, |plant| plant.over(0.1).noise, 1e-9);
}

/// Numbers instead of unknowns: none, and given. Sums of some hundred terms in another order.
#[test]
fn given_and_none() {
    let record = record::<true>(Time::Uniform { start: 0.0, step: STEP }, 60);
    let measured = record.outputs().flat_map(|probes| [probes.y, probes.z]).filter(|y| !y.is_nan()).count();
    for p0 in [0.0, 0.7] {
        let fit = Fit::new(&Heated::<true>, &record).parameters(Building { p0: fixed(p0), ..start() });
        let problem = fit.predictor(Kalman).problem().unwrap();
        let found = problem.objective().unwrap().cost(&[&AT[..5], &AT[6..]].concat()).unwrap();
        let plant = Plant::new(&[&AT[..5], &[f64::ln(0.7)], &AT[6..]].concat(), true);
        let covariance = if p0 == 0.0 { zeros(2, 2) } else { plant.p0.clone() };
        let exact = likelihood(&record, &plant, covariance) - 0.5 * measured as f64 * TAU.ln();
        assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
    }
}

/// A plant that grows is refused by the name of the state in which it does, with the rate of it; one that is stable where the search starts is
/// not evaluated where it is not.
#[test]
fn plants_that_do_not_come_to_rest() {
    let record = record::<false>(uneven(60), 60);
    let fit = |lose: Parameter, covariance| {
        let parameters = Building { lose, gain: fixed(1.0), p0: fixed(0.0), ..start() };
        Fit::new(&Heated::<false>, &record).parameters(parameters).predictor(Kalman::starting(covariance))
    };
    let Err(Error::NotStationary { state, rate, experiment, .. }) =
        fit(free(-0.5), InitialCovariance::Stationary).problem()
    else {
        panic!("an unstable plant has a stationary covariance")
    };
    assert_eq!((&*state, &*experiment), ("b", record.record().name()));
    // The eigenvalue of [[-1/0.9, 1/0.9], [1/1.8, -1/1.8 + 2]].
    let (trace, determinant) = (-1.0 / 0.9 - 1.0 / 1.8 + 2.0, -1.0 / 0.9 * (-1.0 / 1.8 + 2.0) - 1.0 / 0.9 / 1.8);
    let exact = trace / 2.0 + f64::sqrt(trace * trace / 4.0 - determinant);
    assert!((rate / exact - 1.0).abs() < 0.05, "{rate} {exact}");
    let message = fit(free(-0.5), InitialCovariance::Stationary).problem().err().unwrap().to_string();
    for word in ["`b`", "1/s", "FirstInterval", "initial_noise"] {
        assert!(message.contains(word), "{message}");
    }
    assert!(fit(free(-0.5), InitialCovariance::FirstInterval).problem().is_ok());
    let stable = fit(free(2.0), InitialCovariance::Stationary).problem().unwrap();
    let objective = stable.objective().unwrap();
    let at = |lose: f64| vec![-0.2, lose, -0.8, -1.8, 0.3, -0.2];
    assert!(objective.cost(&at(2.0)).unwrap().is_finite());
    // What cannot be evaluated costs without limit.
    assert_eq!(objective.cost(&at(-0.5)).unwrap(), f64::INFINITY);
}

/// By name, in the words of the estimate.
#[test]
fn by_name() {
    let record = record::<false>(uneven(60), 60).initial(Walls { a: fixed(0.0), b: fixed(0.0) });
    let said = |name: &str| {
        let fit = Fit::new(&Heated::<false>, &record).parameters(Building { p0: fixed(0.0), ..start() });
        fit.predictor_by_name(name).map(|fit| fit.run().unwrap().method.predictor.clone())
    };
    let kalman = "one-step prediction by a Kalman filter";
    assert_eq!(said("kalman").unwrap(), kalman);
    assert_eq!(said("kalman:stationary").unwrap(), format!("{kalman} that starts from the stationary covariance"));
    let second = "one-step prediction by a Gaussian filter of second order";
    let first = "that starts from the diffusion of the first interval";
    assert_eq!(said("second-order: first-interval").unwrap(), format!("{second} {first}"));
    let error = said("kalman:stationery").unwrap_err().to_string();
    assert!(error.contains("stationary"), "{error}");
    assert!(said("simulation:stationary").is_err());
}
