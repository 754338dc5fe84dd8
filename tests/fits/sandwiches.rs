#![cfg(feature = "std")]
//! Covariances that allow for weights, losses, correlated outputs and autocorrelated errors, of one unknown by hand.

use crate::common::*;
use greybox::estimate::CovarianceMethod;
use greybox::*;

signals! { pub struct Factor { a: "1" } }

/// `y = a u`.
#[derive(Clone)]
pub struct Gain;

impl Model for Gain {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Factor;
    // Not static: the order of the samples matters.
    const KIND: Kind = Kind::Discrete;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Factor<S>) -> Current<S> {
        Current { i: p.a * u.u }
    }
}

fn record(inputs: &[f64], error: impl Fn(usize) -> f64) -> ExperimentOf<Gain> {
    let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 2.0 * u + error(k) }).collect();
    let inputs = inputs.iter().map(|u| Voltage { u: *u }).collect();
    Experiment::new(&Gain, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

fn fit(record: &ExperimentOf<Gain>) -> Fit<'_, Gain> {
    Fit::new(&Gain, record).parameters(Factor { a: free(1.0) })
}

fn errors(estimate: &Estimate<Gain>, record: &ExperimentOf<Gain>) -> Vec<f64> {
    record.outputs().zip(record.inputs()).map(|(y, u)| y.i - estimate.parameters.a * u.u).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `(sum (w u)^2 v + q^2) / (c sum w u^2 + q^2)^2` in units of the noise, with the mean slope `c` of psi and the precision `q^2` of
/// a prior. `v` is `(psi(z) / (1 - h))^2`, and 0.4 of the variance of what the others predict, `s^2 h / (1 - h)`, with the leverage
/// `h` of the weights and the noise `s^2 = mean(w psi^2) / (c^2 w)`. One input is ten times as large, with a leverage of a tenth.
#[test]
fn a_sandwich_by_hand() {
    const COUNT: usize = 700;
    let mut noise = Noise(3);
    let mut inputs: Vec<f64> = (0..COUNT).map(|_| 0.5 + noise.uniform()).collect();
    inputs[350] = 10.0;
    let spikes: Vec<f64> = (0..COUNT).map(|k| if k % 9 == 4 { 0.8 } else { 0.1 } * noise.gauss()).collect();
    let record = record(&inputs, |k| spikes[k]);
    let sigma = 0.1;
    let with = |a: Parameter| Fit::new(&Gain, &record).parameters(Factor { a }).noise(Current { i: sigma });
    let clipped = |z: f64| z.clamp(-1.345, 1.345);
    let plain = |z: f64| z;
    let squares = (|u| u * u) as fn(f64) -> f64;
    let prior = 0.004;
    for (fit, weight, psi, q) in [
        (with(free(1.0)).weighting(|s: &Sample<Gain>| s.u.u * s.u.u), squares, &plain as &dyn Fn(f64) -> f64, 0.0),
        (with(free(1.0)).loss(Huber(1.345)), |_| 1.0, &clipped, 0.0),
        (with(free(1.0).prior(2.0, prior)).loss(Huber(1.345)), |_| 1.0, &clipped, 1.0 / prior),
    ] {
        let estimate = fit.run().unwrap();
        assert_eq!(estimate.method.covariance, CovarianceMethod::Sandwich);
        let z: Vec<f64> = errors(&estimate, &record).iter().map(|e| e / sigma).collect();
        let w: Vec<f64> = inputs.iter().map(|u| weight(*u)).collect();
        let inside = |k: &usize| psi(z[*k]) == z[*k];
        let curvature = (0..COUNT).filter(inside).map(|k| w[k]).sum::<f64>() / w.iter().sum::<f64>();
        let squares = inputs.iter().zip(&w).map(|(u, w)| w * u * u / (sigma * sigma)).sum::<f64>();
        let bread = squares + q * q / curvature;
        let mean = (0..COUNT).map(|k| w[k] * psi(z[k]).powi(2)).sum::<f64>() / COUNT as f64;
        let part = |k: usize| {
            let slope = inputs[k] / sigma;
            let h = w[k] * slope * slope / bread;
            let predicted = mean / (curvature * curvature * w[k]) * h / (1.0 - h);
            (w[k] * slope).powi(2) * ((psi(z[k]) / (1.0 - h)).powi(2) + 0.4 * predicted)
        };
        let meat: f64 = (0..COUNT).map(part).sum::<f64>() + q * q;
        let expected = meat.sqrt() / (curvature * bread);
        let found = estimate.unknowns[0].knowledge.standard_error().unwrap();
        // The estimate is a minimum to 1e-8 of a standard error.
        assert!((found / expected - 1.0).abs() < 1e-7, "{q}: {found} {expected}");
    }
}

/// After a filter, which looks back only, samples of weight zero at the end of a record are as if they were not there.
#[test]
fn samples_without_weight_at_the_end_do_not_count() {
    const COUNT: usize = 300;
    let mut noise = Noise(5);
    let inputs: Vec<f64> = (0..400).map(|_| 0.5 + noise.uniform()).collect();
    let errors: Vec<f64> = (0..400).map(|k| if k < COUNT { 0.1 } else { 0.7 } * noise.gauss()).collect();
    let filter = Butterworth::low_pass(2, 0.1, 1.0).unwrap();
    let of = |count: usize| {
        let record = record(&inputs[..count], |k| errors[k]);
        let weight = |s: &Sample<Gain>| if s.t < COUNT as f64 { 1.0 + s.u.u } else { 0.0 };
        fit(&record).weighting(weight).prefilter(filter).noise(Current { i: 0.1 }).run().unwrap().into_summary()
    };
    let (whole, cut) = (of(400), of(COUNT));
    assert_eq!(whole.method.covariance, CovarianceMethod::FilteredSandwich);
    let numbers = |estimate: &Summary| {
        let unknown = &estimate.unknowns[0];
        [unknown.value, unknown.knowledge.standard_error().unwrap(), estimate.cost]
    };
    for (found, expected) in numbers(&whole).into_iter().zip(numbers(&cut)) {
        // Sums of 300 products in another order, and minima to 1e-8 of a standard error.
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
}

/// Errors that are autocorrelated and follow the input: prewhitened by an autoregression, with its bias corrected, summed with
/// Bartlett's weights over 1.3 roots of the number of scores, and recolored (Andrews and Monahan 1992). The degrees of freedom
/// follow from the errors of autoregression and sums.
#[test]
fn autocorrelated_scores_by_hand() {
    const COUNT: usize = 3000;
    let mut noise = Noise(11);
    let inputs: Vec<f64> = (0..COUNT).map(|k| if k % 40 < 4 { 3.0 } else { 0.3 }).collect();
    let mut before = 0.0;
    let colored: Vec<f64> = (0..COUNT)
        .map(|k| {
            before = 0.9 * before + 0.1 * noise.gauss();
            before * inputs[k]
        })
        .collect();
    let record = record(&inputs, |k| colored[k]);
    let estimate = fit(&record).run().unwrap();
    let bread = dot(&inputs, &inputs);
    let e = errors(&estimate, &record);
    let scores: Vec<f64> = (0..COUNT).map(|k| inputs[k] * e[k] / (1.0 - inputs[k].powi(2) / bread).sqrt()).collect();
    let n = COUNT as f64;
    let size = (dot(&scores, &scores) / n).sqrt();
    let z: Vec<f64> = scores.iter().map(|s| s / size).collect();
    let (one, two) = (dot(&z[1..], &z) / n, dot(&z[2..], &z) / n);
    let a = one + (1.0 + 3.0 * one) / n;
    let variance = 1.0 - 2.0 * a * one + a * a;
    let left = (one - two * a - a + a * a * one) / variance;
    let andrews = 1.1447 * (4.0 * left * left / (1.0 - left * left).powi(2) * n).cbrt();
    let window = andrews.max(1.3 * n.sqrt()).ceil() as usize + 1;
    assert_eq!(estimate.method.covariance, CovarianceMethod::Hac { lags: window as u64 - 1 });
    let fresh: Vec<f64> = (0..COUNT).map(|t| z[t] - if t > 0 { a * z[t - 1] } else { 0.0 }).collect();
    let part = window as f64 / n;
    let lag = |k: usize| if k == 0 { 1.0 } else { 2.0 * (1.0 - k as f64 / window as f64) } * dot(&fresh[k..], &fresh);
    let sums = (0..window).map(lag).sum::<f64>() / (1.0 - part + part * part / 3.0);
    let expected = size * sums.sqrt() / (1.0 - a) / bread;
    let found = estimate.unknowns[0].knowledge.standard_error().unwrap();
    // Sums of 3,000 products, and an estimate that is a minimum to 1e-8.
    assert!((found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
    let degrees = 2.0 / (4.0 * variance / ((1.0 - a).powi(2) * n) + 4.0 / 3.0 * part);
    let found = estimate.unknowns[0].degrees_of_freedom;
    assert!((found / degrees - 1.0).abs() < 1e-7, "{found} {degrees}");
}

/// Two outputs of which the errors are one: white over time, so that scores are summed sample by sample; the correlation is said.
#[test]
fn correlated_outputs_have_a_sandwich() {
    let inputs: Vec<Voltage> = levels(200, 1, 5).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Line, 1.0, inputs, Nothing, Affine { slope: 1.5, offset: -0.7 });
    let mut noise = Noise(4);
    let disturbed = |y: Pair| {
        let (one, two) = (noise.gauss(), noise.gauss());
        Pair { y: y.y + 0.1 * one, z: y.z + 0.1 * (one + two) }
    };
    let record = with_outputs(&Line, &exact, exact.outputs().map(disturbed).collect());
    let fit = Fit::new(&Line, &record).parameters(Affine { slope: free(1.0), offset: free(0.5) });
    let estimate = fit.run().unwrap();
    assert_eq!(estimate.method.covariance, CovarianceMethod::Sandwich);
    let Affine { slope, offset } = estimate.parameters;
    let pairs = record.inputs().zip(record.outputs());
    let (y, z): (Vec<f64>, Vec<f64>) =
        pairs.map(|(u, y)| (y.y - slope * u.u - offset, y.z - offset * u.u + slope)).unzip();
    let correlation = dot(&y, &z) / (dot(&y, &y) * dot(&z, &z)).sqrt();
    let said = estimate.warnings.iter().find(|warning| warning.code == WarningCode::CorrelatedOutputs).unwrap();
    assert!(said.text.contains(&format!("({correlation:.2}, ")), "{correlation} {}", said.text);
    // Scores of each sample by hand, against the reported covariance.
    let (sy, sz) = (estimate.quality.y.sigma, estimate.quality.z.sigma);
    let (mut bread, mut meat) = (nalgebra::Matrix2::<f64>::zeros(), nalgebra::Matrix2::<f64>::zeros());
    let rows: Vec<[nalgebra::Vector2<f64>; 2]> = record
        .inputs()
        .map(|u| [nalgebra::Vector2::new(u.u, 1.0) / sy, nalgebra::Vector2::new(-1.0, u.u) / sz])
        .collect();
    rows.iter().flatten().for_each(|row| bread += row * row.transpose());
    let inverse = bread.try_inverse().unwrap();
    let noise = (dot(&y, &y) / (sy * sy) + dot(&z, &z) / (sz * sz)) / 400.0;
    for (k, [one, two]) in rows.iter().enumerate() {
        let less = |row: &nalgebra::Vector2<f64>| 1.0 - (row.transpose() * inverse * row)[(0, 0)];
        let score = one * (y[k] / sy / less(one)) + two * (z[k] / sz / less(two));
        meat += score * score.transpose();
        for row in [one, two] {
            meat += row * row.transpose() * (0.4 * noise * (1.0 / less(row) - 1.0));
        }
    }
    let expected = inverse * meat * inverse;
    for i in 0..2 {
        let found = estimate.unknowns[i].knowledge.standard_error().unwrap();
        assert!((found / expected[(i, i)].sqrt() - 1.0).abs() < 1e-6, "{i}: {found} {expected}");
    }
}
