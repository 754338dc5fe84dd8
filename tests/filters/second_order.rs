//! [`SecondOrder`]: against a filter that is written out for its plant, against [`Kalman`], and where the order of the filter decides.

use crate::common::Noise;
use crate::hardening::{Hardening, Pull, STRONG, Spring, TRUTH, disturbed, driven, runge_kutta, start};
use argmin::core::{CostFunction, Gradient};
use core::f64::consts::TAU;
use greybox::*;

/// `-ln` of the likelihood by moments of a Gaussian state, by hand: `E x^3 = m^3 + 3 m P`, `E 3 x^2 = 3 (m^2 + P)`, `E x^2 = m^2 + P`, of
/// variance `4 m^2 P + 2 P^2`; by Runge-Kutta's method with so many steps per sample.
fn written_out(record: &ExperimentOf<Hardening>, [a, b, c, q, r, mut x]: [f64; 6], steps: u32) -> f64 {
    let (q, r) = ((q * 2.0).exp(), (r * 2.0).exp());
    let (mut p, mut sum) = (0.0, 0.0);
    for (k, (u, gauges)) in record.inputs().zip(record.outputs()).enumerate() {
        for (second, y) in [(false, gauges.y), (true, gauges.z)] {
            if y.is_nan() {
                continue;
            }
            let (mean, slope, noise) = match second {
                false => (x, 1.0, r),
                true => (x + (x * x + p) / 2.0, 1.0 + x, 4.0 * r + p * p / 2.0),
            };
            let (error, variance): (f64, f64) = (y - mean, slope * slope * p + noise);
            sum += (error * error / variance + (variance * TAU).ln()) / 2.0;
            (x, p) = (x + p * slope * error / variance, p * noise / variance);
        }
        if k + 1 == record.len() {
            break;
        }
        let h = (record.time(k + 1) - record.time(k)) / f64::from(steps);
        let rate = |[x, p]: [f64; 2]| {
            [c * u.u - a * x - b * (x * x * x + 3.0 * x * p), 2.0 * (-a - 3.0 * b * (x * x + p)) * p + q]
        };
        [x, p] = runge_kutta([x, p], h, steps, rate);
    }
    sum
}

const AT: [f64; 6] = [0.9, 0.6, 1.1, -0.1, -1.2, 0.0];

fn even(step: f64) -> Time {
    Time::Uniform { start: 0.0, step }
}

/// The same arithmetic in another order: 12 digits are left of the likelihood of 260 measurements, by programs. Node by node, by an adaptive
/// method of tolerance 1e-10, nine are left; the extended filter's differs in the third.
#[test]
fn likelihood_of_a_filter_written_out() {
    let record = disturbed(even(0.3), 200, 3, &mut Noise(3));
    let measured = record.outputs().flat_map(|y| [y.y, y.z]).filter(|y| !y.is_nan()).count();
    let constant = 0.5 * measured as f64 * TAU.ln();
    let of = |fit: Fit<'_, Hardening>| {
        fit.problem().unwrap().objective().unwrap().cost(&AT[..5].to_vec()).unwrap() + constant
    };
    let fit = || Fit::new(&Hardening, &record).parameters(start()).integrator(Rk4 { substeps: 4 });
    let (found, exact) = (of(fit().predictor(SecondOrder)), written_out(&record, AT, 4));
    assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
    assert!((of(fit().predictor(Kalman)) / exact - 1.0).abs() > 1e-3);
    let adaptive = fit().predictor(SecondOrder).integrator(Rk45 { relative: 1e-10, absolute: 1e-12 });
    let (found, exact) = (of(adaptive), written_out(&record, AT, 64));
    assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
}

/// Slopes against central differences of fourth order, whose steps of 1e-3 leave nine digits.
#[test]
fn its_slopes_are_exact() {
    let record = disturbed(even(0.3), 200, 3, &mut Noise(3));
    let problem = Fit::new(&Hardening, &record).parameters(start()).predictor(SecondOrder).problem().unwrap();
    let objective = problem.objective().unwrap();
    let slopes = objective.gradient(&AT[..5].to_vec()).unwrap();
    for i in 0..5 {
        let cost = |by: f64| {
            let mut at = AT[..5].to_vec();
            at[i] += by;
            objective.cost(&at).unwrap()
        };
        let h = 1e-3;
        let difference = (8.0 * (cost(h) - cost(-h)) - (cost(2.0 * h) - cost(-2.0 * h))) / (12.0 * h);
        assert!((slopes[i] - difference).abs() < 1e-7 * (1.0 + difference.abs()), "{i}: {} {difference}", slopes[i]);
    }
}

/// Of an affine model it is the Kalman filter, to the roundings of another order of sums.
#[test]
fn affine_models_are_filtered_exactly() {
    let record = disturbed(even(0.1), 200, usize::MAX, &mut Noise(4));
    let start = Spring { b: fixed(0.0), ..start() };
    let cost = |fit: Fit<'_, Hardening>| {
        fit.problem().unwrap().objective().unwrap().cost(&vec![0.9, 1.1, -0.1, -1.2]).unwrap()
    };
    let fit = || Fit::new(&Hardening, &record).parameters(start);
    let (first, second) = (cost(fit().predictor(Kalman)), cost(fit().predictor(SecondOrder)));
    assert!((second / first - 1.0).abs() < 1e-13, "{first} {second}");
}

/// With strong noise the extended filter is biased, and each of its fits says so; those of second order do not. With weak noise neither says
/// anything.
#[test]
fn the_order_is_said_where_it_decides() {
    let severity = |truth: &Spring, step: f64, seed: u64, second: bool| {
        let record = driven(truth, even(step), 1000, usize::MAX, &mut Noise(seed));
        let fit = Fit::new(&Hardening, &record).parameters(start());
        let fit = if second { fit.predictor(SecondOrder) } else { fit.predictor(Kalman) };
        let estimate = fit.run().unwrap();
        let said = estimate.warnings.iter().any(|warning| warning.code == WarningCode::FilterOrder);
        (said, estimate.severity())
    };
    for seed in 1..=10 {
        let (said, found) = severity(&STRONG, 0.3, seed, false);
        assert!(said && found > Severity::Usable);
        assert!(!severity(&STRONG, 0.3, seed, true).0);
        assert!(!severity(&TRUTH, 0.1, seed, false).0);
    }
}

signals! { pub struct Pair { x: "1", v: "1" } }
signals! { pub struct Push { u: "1" } }
signals! { pub struct Rates { a: "1", b: "1", q: "1", r: "1" } }

/// `x+ = a x + b v^2 / 2 + u`, `v+ = x v`, both seen.
#[derive(Clone)]
struct Coupled;

impl Model for Coupled {
    type State = Pair;
    type Input = Push;
    type Output = Pair;
    type Parameters = Rates;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, z: &Pair<S>, u: &Push<S>, p: &Rates<S>) -> Pair<S> {
        Pair { x: p.a * z.x + p.b * z.v * z.v * 0.5 + u.u, v: z.x * z.v }
    }
    fn output<S: Scalar>(&self, _t: S, z: &Pair<S>, _u: &Push<S>, _p: &Rates<S>) -> Pair<S> {
        *z
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Pair<S>, _u: &Push<S>, p: &Rates<S>) -> Pair<S> {
        Pair { x: p.q, v: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Pair<S>, _u: &Push<S>, p: &Rates<S>) -> Pair<S> {
        Pair { x: p.r, v: p.r }
    }
}

/// Moments of a discrete model whose states are coupled, by Isserlis' theorem: with the covariance `[P, C; C, V]` of the state,
/// `E v^2 = v^2 + V`, `E x v = x v + C`, `cov(v^2 / 2, v^2 / 2) = v^2 V + V^2 / 2`, `cov(v^2 / 2, x v) = x v V + v^2 C + C V` and
/// `cov(x v, x v) = x^2 V + v^2 P + 2 x v C + P V + C^2`: the terms without `x` and `v` are those of curvature. 12 digits are left of 40
/// measurements.
#[test]
fn moments_of_coupled_states() {
    let mut noise = Noise(5);
    let inputs: Vec<Push> = (0..20).map(|k| Push { u: [0.3, -0.2, 0.1][k % 3] }).collect();
    let outputs: Vec<Pair> = (0..20).map(|_| Pair { x: 0.3 * noise.gauss(), v: 0.5 + 0.3 * noise.gauss() }).collect();
    let record = Experiment::new(&Coupled, even(1.0), inputs.clone(), outputs.clone()).unwrap();
    let record = record.initial(Pair { x: fixed(0.1), v: fixed(0.6) });
    let [a, b, q, r] = [0.5f64, 0.4, 0.3, 0.2];
    let start = Rates { a: free(a), b: free(b), q: free(q), r: free(r) };
    let fit = Fit::new(&Coupled, &record).parameters(start).predictor(SecondOrder);
    let found = fit.problem().unwrap().objective().unwrap().cost(&vec![a, b, q, r]).unwrap();
    let (mut z, mut covariance, mut sum) = ([0.1, 0.6], [0.0, 0.0, 0.0], 0.0);
    for (u, y) in inputs.iter().zip(&outputs) {
        for (i, y) in [y.x, y.v].into_iter().enumerate() {
            let [xx, xv, vv] = covariance;
            let column = if i == 0 { [xx, xv] } else { [xv, vv] };
            let (error, variance) = (y - z[i], column[i] + r * r);
            sum += 0.5 * (error * error / variance + variance.ln());
            let gain = column.map(|entry| entry / variance);
            z = [z[0] + gain[0] * error, z[1] + gain[1] * error];
            covariance = [xx - gain[0] * column[0], xv - gain[0] * column[1], vv - gain[1] * column[1]];
        }
        let ([x, v], [xx, xv, vv]) = (z, covariance);
        let squares = v * v * vv + vv * vv / 2.0;
        let across = x * v * vv + v * v * xv + xv * vv;
        let products = x * x * vv + v * v * xx + 2.0 * x * v * xv + xx * vv + xv * xv;
        z = [a * x + b * (v * v + vv) / 2.0 + u.u, x * v + xv];
        covariance = [
            a * a * xx + 2.0 * a * b * v * xv + b * b * squares + q * q,
            a * (v * xx + x * xv) + b * across,
            products + q * q,
        ];
    }
    assert!((found / sum - 1.0).abs() < 1e-12, "{found} {sum}");
}

signals! { pub struct Slide { a: "1/s", f: "m/s^2", c: "m/(N s)", q: "m/s^1.5", r: "m/s" } }
signals! { pub struct Speed { v: "m/s" } }

/// `dv = (c u - a v - f (dry sign(v) + smooth tanh(v / 0.2))) dt + q dw`.
#[derive(Clone)]
struct Dry {
    dry: f64,
    smooth: f64,
}

impl Model for Dry {
    type State = Speed;
    type Input = Pull;
    type Output = Speed;
    type Parameters = Slide;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Pull<S>, p: &Slide<S>) -> Speed<S> {
        let mut direction = (x.v * 5.0).tanh() * self.smooth;
        if self.dry != 0.0 {
            direction += x.v.signum() * self.dry;
        }
        Speed { v: p.c * u.u - p.a * x.v - p.f * direction }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Pull<S>, _p: &Slide<S>) -> Speed<S> {
        *x
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Speed<S>, _u: &Pull<S>, p: &Slide<S>) -> Speed<S> {
        Speed { v: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Speed<S>, _u: &Pull<S>, p: &Slide<S>) -> Speed<S> {
        Speed { v: p.r }
    }
}

/// Dry friction has no curvature where the state is, so that a filter of either order takes its sign for certain: no fit of it is usable
/// without care. In a smooth form its curvature is compared, beside a choice, too, so that a choice is not a milder verdict.
#[test]
fn choices_by_the_state_ask_for_care() {
    let said = |dry: f64, smooth: f64, seed: u64, second: bool| {
        let (mut noise, mut v, mut inputs, mut outputs) = (Noise(seed), 0.0f64, vec![], vec![]);
        for k in 0..1000 {
            let u = [2.0, -1.0, 0.5, -2.0, 1.0][k / 15 % 5];
            outputs.push(Speed { v: v + 0.1 * noise.gauss() });
            inputs.push(Pull { u });
            for _ in 0..50 {
                let direction = dry * v.signum() + smooth * (v * 5.0).tanh();
                v += 0.002 * (u - v - 0.8 * direction) + 0.3 * 0.002f64.sqrt() * noise.gauss();
            }
        }
        let model = Dry { dry, smooth };
        let record = Experiment::new(&model, even(0.1), inputs, outputs).unwrap().initial(Speed { v: fixed(0.0) });
        let start = Slide { a: free(0.7), f: free(0.5), c: free(0.8), q: free(0.6).log(), r: free(0.2).log() };
        let fit = Fit::new(&model, &record).parameters(start).integrator(Rk4 { substeps: 4 });
        let fit = if second { fit.predictor(SecondOrder) } else { fit.predictor(Kalman) };
        let estimate = fit.run().unwrap();
        let said = estimate.warnings.iter().filter(|warning| warning.code == WarningCode::FilterOrder).count();
        (said, estimate.severity())
    };
    for seed in 1..=3 {
        for second in [false, true] {
            let (said, severity) = said(1.0, 0.0, seed, second);
            assert!(said > 0 && severity > Severity::Usable);
        }
        let (kalman, second) = (said(0.0, 1.0, seed, false), said(0.0, 1.0, seed, true));
        assert!(kalman.0 == 1 && kalman.1 > Severity::Usable);
        assert_eq!(second.0, 0);
        let both = said(1e-9, 1.0, seed, false);
        assert_eq!((both.0, both.1), (2, kalman.1));
    }
}
