//! Every number of an answer against the definitions, with dense matrices: two records of two outputs, each record with an unknown
//! of its own, for all combinations of what a fit can be told.

use crate::common::Noise;
use greybox::estimate::CovarianceMethod;
use greybox::*;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

signals! { pub struct Stimulus { u: "V", w: "V" } }
signals! { pub struct Answers { y: "A", z: "A" } }
signals! { pub struct Bend { a: "A", b: "1/V", c: "A/V" } }

/// `y = a exp(-b u)`, `z = c w + a u`.
#[derive(Clone)]
struct Bending;

impl Model for Bending {
    type State = Nothing;
    type Input = Stimulus;
    type Output = Answers;
    type Parameters = Bend;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Stimulus<S>, p: &Bend<S>) -> Answers<S> {
        Answers { y: p.a * (-p.b * u.u).exp(), z: p.c * u.w + p.a * u.u }
    }
}

const SIGMA: [f64; 2] = [0.05, 0.2];
const PRIOR: (f64, f64) = (0.85, 0.02);
const CLIP: f64 = 1.345;

fn record(seed: u64, samples: usize, c: f64) -> ExperimentOf<Bending> {
    let mut noise = Noise(seed);
    let inputs: Vec<Stimulus> =
        (0..samples).map(|_| Stimulus { u: 2.0 * noise.uniform(), w: noise.uniform() - 0.3 }).collect();
    let mut measured = |(k, u): (usize, &Stimulus)| {
        let exact = Bending.output(0.0, &Nothing {}, u, &Bend { a: 1.5, b: 0.8, c });
        let (y, z) = (exact.y + SIGMA[0] * noise.gauss(), exact.z + SIGMA[1] * noise.gauss());
        Answers { y: if k % 7 == 3 { f64::NAN } else { y }, z }
    };
    let outputs = inputs.iter().enumerate().map(&mut measured).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    Experiment::new(&Bending, time, inputs, outputs).unwrap().named(format!("record {seed}"))
}

fn weight(u: &Stimulus) -> f64 {
    if u.u > 1.8 { 0.0 } else { 0.3 + u.u }
}

/// What a fit is told.
#[derive(Clone, Copy, Debug)]
struct Told {
    noise: bool,
    prior: bool,
    logarithm: bool,
    weights: bool,
    robust: bool,
}

/// A measurement: its error and slopes in standard deviations, its weight, and the sample that it belongs to.
struct Row {
    error: f64,
    slopes: DVector<f64>,
    weight: f64,
    sample: (usize, usize),
    output: usize,
}

fn close(found: f64, expected: f64, relative: f64, what: &str) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{what}: {found} {expected}");
}

#[test]
fn every_number_is_its_definition() {
    let records = [record(3, 30, 0.6), record(4, 21, -0.9)];
    for number in 0..32u32 {
        let bit = |i: u32| number >> i & 1 == 1;
        let told = Told { noise: bit(0), prior: bit(1), logarithm: bit(2), weights: bit(3), robust: bit(4) };
        // What the noise is with weights and losses has tests of its own.
        if told.noise || !(told.weights || told.robust) {
            check(&records, told);
        }
    }
}

fn check(records: &[ExperimentOf<Bending>], told: Told) {
    let b = if told.logarithm { free(0.5).log() } else { free(0.5) };
    let b = if told.prior { b.prior(PRIOR.0, PRIOR.1) } else { b };
    let mut fit = Fit::new(&Bending, records).parameters(Bend { a: free(1.0), b, c: free(0.1).per_experiment() });
    if told.noise {
        fit = fit.noise(Answers { y: SIGMA[0], z: SIGMA[1] });
    }
    if told.weights {
        fit = fit.weighting(|s: &Sample<Bending>| weight(&s.u));
    }
    if told.robust {
        fit = fit.loss(Huber(CLIP));
    }
    let problem = fit.problem().unwrap();
    let found = problem.run().unwrap();
    let names: Vec<&str> = found.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c [record 3]", "c [record 4]"]);
    let values: Vec<f64> = found.unknowns.iter().map(|unknown| unknown.value).collect();
    let chain = if told.logarithm { values[1] } else { 1.0 };

    // Errors and slopes in the units of the outputs.
    let mut rows: [Vec<Row>; 2] = [vec![], vec![]];
    for (e, record) in records.iter().enumerate() {
        for (k, (u, measured)) in record.inputs().zip(record.outputs()).enumerate() {
            let (a, b, c) = (values[0], values[1], values[2 + e]);
            let bend = (-b * u.u).exp();
            let own = |i: usize| if i == e { u.w } else { 0.0 };
            let slopes = [[bend, -a * u.u * bend * chain, 0.0, 0.0], [u.u, 0.0, own(0), own(1)]];
            let errors = [measured.y - a * bend, measured.z - (c * u.w + a * u.u)];
            let weight = if told.weights { weight(&u) } else { 1.0 };
            for j in (0..2).filter(|&j| !errors[j].is_nan()) {
                let slopes = DVector::from_row_slice(&slopes[j]);
                rows[j].push(Row { error: errors[j], slopes, weight, sample: (e, k), output: j });
            }
        }
    }
    // How well the outputs are reproduced counts all measurements.
    let mut ml = SIGMA;
    for (j, output) in found.outputs.iter().enumerate() {
        let squares: f64 = rows[j].iter().map(|row| row.error * row.error).sum();
        let of = |y: Answers| if j == 0 { y.y } else { y.z };
        let y: Vec<f64> = records
            .iter()
            .flat_map(|record| record.outputs().map(of).filter(|y| !y.is_nan()).collect::<Vec<_>>())
            .collect();
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let spread: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
        assert_eq!(output.fit.samples, y.len() as u64);
        let rmse = (squares / y.len() as f64).sqrt();
        close(output.fit.rmse, rmse, 1e-12, "rmse");
        close(output.fit.fit_percent.unwrap(), 100.0 * (1.0 - (squares / spread).sqrt()), 1e-12, "fit");
        if !told.noise {
            ml[j] = rmse;
        }
    }
    let n = rows.iter().flatten().filter(|row| row.weight > 0.0).count() as f64;
    assert_eq!(found.measurements, n as u64, "{told:?}");
    let degrees = n - 4.0;
    assert_eq!(found.degrees_of_freedom(), degrees);
    // Noise is estimated over `n - p`, of each output.
    let wider = if told.noise { 1.0 } else { (n / degrees).sqrt() };
    for (output, ml) in found.outputs.iter().zip(ml) {
        close(output.fit.sigma, ml * wider, 1e-5, "sigma");
    }
    for (rows, ml) in rows.iter_mut().zip(ml) {
        rows.iter_mut().for_each(|row| (row.error, row.slopes) = (row.error / ml, &row.slopes / ml));
    }
    let rows: Vec<Row> = rows.into_iter().flatten().collect();

    let psi = |z: f64| if told.robust { z.clamp(-CLIP, CLIP) } else { z };
    let rho = |z: f64| if psi(z) == z { 0.5 * z * z } else { CLIP * z.abs() - 0.5 * CLIP * CLIP };
    // Error and slope of the prior, which is that of the value, not of its logarithm.
    let prior = if told.prior { [(values[1] - PRIOR.0) / PRIOR.1, chain / PRIOR.1] } else { [0.0; 2] };
    let cost = rows.iter().map(|row| row.weight * rho(row.error)).sum::<f64>() + 0.5 * prior[0] * prior[0];
    // Estimated noise has settled to 1e-6 or better.
    close(found.cost, cost, if told.noise { 1e-12 } else { 1e-5 }, "cost");
    let only = |value: f64| DVector::from_row_slice(&[0.0, value, 0.0, 0.0]);
    let squares = |factor: f64| DMatrix::from_diagonal(&only(factor * prior[1] * prior[1]));
    let gradient =
        rows.iter().fold(only(prior[0] * prior[1]), |sum, row| sum - &row.slopes * (row.weight * psi(row.error)));
    let information = |prior: f64| {
        rows.iter().fold(squares(prior), |sum, row| sum + &row.slopes * row.slopes.transpose() * row.weight)
    };

    let seen: f64 = rows.iter().filter(|row| psi(row.error) == row.error).map(|row| row.weight).sum();
    let curvature = seen / rows.iter().map(|row| row.weight).sum::<f64>();
    let sandwich = told.weights || told.robust;
    let mut own_degrees = [f64::INFINITY; 4];
    let covariance = if sandwich {
        assert_eq!(found.method.covariance, CovarianceMethod::Sandwich);
        let inverse = information(1.0 / curvature).try_inverse().unwrap();
        let leverage = |row: &Row| (row.slopes.transpose() * &inverse * &row.slopes)[(0, 0)] * row.weight;
        // What the others predict of a row has `h / (1 - h)` times the noise of all; 0.4 of it counts.
        let squared: f64 = rows.iter().map(|row| row.weight * psi(row.error).powi(2)).sum();
        let noise = squared / n / (curvature * curvature);
        let predicted = |row: &Row| row.weight * noise * leverage(row) / (1.0 - leverage(row));
        let mut meat = rows
            .iter()
            .fold(squares(1.0), |sum, row| sum + &row.slopes * row.slopes.transpose() * (0.4 * predicted(row)));
        // The variance is a sum of squares, each with a variance of two thirds of its own square, less what the leverage takes.
        let (mut variance, mut spread): (DVector<f64>, DVector<f64>) = (DVector::zeros(4), DVector::zeros(4));
        for (e, record) in records.iter().enumerate() {
            for k in 0..record.len() {
                let score = |root: bool| {
                    let here = rows.iter().filter(|row| row.sample == (e, k));
                    here.fold(DVector::zeros(4), |sum, row| {
                        let less = 1.0 - leverage(row);
                        let less = if root { less.sqrt() } else { less };
                        sum + &row.slopes * (row.weight * psi(row.error) / less)
                    })
                };
                let all = score(false);
                meat += &all * all.transpose();
                // Of an unknown of one record those of its own samples count.
                let counts = DVector::from_fn(4, |i, _| if i < 2 || i == 2 + e { 1.0 } else { 0.0 });
                variance += (&inverse * all).map(|moved| moved.powi(2)).component_mul(&counts);
                spread += (&inverse * score(true)).map(|moved| moved.powi(4) * 2.0 / 3.0).component_mul(&counts);
            }
        }
        own_degrees = std::array::from_fn(|i| (2.0 * (variance[i].powi(2) - spread[i]) / spread[i]).max(1.0));
        &inverse * meat * &inverse / (curvature * curvature)
    } else {
        assert_eq!(found.method.covariance, CovarianceMethod::Classical);
        // A prior is not as uncertain as the noise.
        information(wider * wider).try_inverse().unwrap() * (wider * wider)
    };
    // At a minimum, of the noise of the last round but one.
    let left = (gradient.transpose() * &covariance * &gradient)[(0, 0)].sqrt();
    assert!(left < if told.noise { 1e-5 } else { 1e-3 }, "{told:?}: {left}");

    let unit = information(1.0).try_inverse().unwrap();
    let root = (rows.iter().map(|row| row.error * row.error).sum::<f64>() + prior[0] * prior[0]).sqrt();
    let slopes = [1.0, chain, 1.0, 1.0];
    let matrix = found.covariance.dense(&[0, 1, 2, 3]);
    let correlation = found.correlation(&[0, 1, 2, 3]);
    let tolerance = if told.noise { 1e-6 } else { 1e-5 };
    for (i, unknown) in found.unknowns.iter().enumerate() {
        let what = format!("{told:?} {}", unknown.name);
        let error = covariance[(i, i)].sqrt();
        let Knowledge::Known { standard_error, lower, upper } = unknown.knowledge else { panic!("{found}") };
        close(standard_error, error * slopes[i], tolerance, &what);
        let degrees = degrees.min(own_degrees[i]);
        // Fourth powers of what settled to 1e-6.
        close(unknown.degrees_of_freedom, degrees, 10.0 * tolerance, &what);
        let quantile = StudentsT::new(0.0, 1.0, degrees).unwrap().inverse_cdf(0.975);
        let moved = |by: f64| match told.logarithm && i == 1 {
            true => values[i] * (by * error).exp(),
            false => values[i] + by * error,
        };
        for (end, by) in [(lower, -quantile), (upper, quantile)] {
            assert!((end - moved(by)).abs() < 3.0 * tolerance * standard_error, "{what}: {end} {}", moved(by));
        }
        if !sandwich {
            let index = |error: f64| 100.0 * (root * error * slopes[i] / values[i]).abs();
            close(unknown.error_index.unwrap(), index(unit[(i, i)].sqrt()), tolerance, &what);
            close(unknown.error_index_held.unwrap(), index(information(1.0)[(i, i)].sqrt().recip()), tolerance, &what);
        }
        for j in 0..4 {
            let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            let (in_units, expected) = (matrix[(i, j)] / (slopes[i] * slopes[j]), covariance[(i, j)]);
            assert!((in_units - expected).abs() < tolerance * scale, "{what} {j}: {in_units} {expected}");
            assert!((correlation[(i, j)] - expected / scale).abs() < tolerance, "{what} {j}");
        }
    }
    let least = own_degrees.into_iter().fold(degrees, f64::min);
    let quantiles = [least, degrees].map(|degrees| StudentsT::new(0.0, 1.0, degrees).unwrap().inverse_cdf(0.975));
    bands(&problem, &found, records, (&covariance, quantiles, ml.map(|ml| ml * wider)), tolerance);
    if !told.robust {
        identifiable(&problem, &found, &rows, (prior[1], wider));
    }
    let likelihood = |row: &Row| row.error * row.error;
    let constant =
        |(j, sigma): (usize, &f64)| found.outputs[j].fit.samples as f64 * (core::f64::consts::TAU * sigma * sigma).ln();
    let deviance = rows.iter().map(likelihood).sum::<f64>() + ml.iter().enumerate().map(constant).sum::<f64>();
    match found.deviance {
        None => assert!(sandwich),
        Some(found) => close(found, deviance, 1e-6, "deviance"),
    }
    if !sandwich {
        let p = if told.noise { 4.0 } else { 6.0 };
        close(found.bic().unwrap(), deviance + p * n.ln(), 1e-6, "bic");
    }
}

/// `t sqrt(g' C g)`, and with the noise.
fn bands(
    problem: &Problem<'_>,
    found: &Summary,
    records: &[ExperimentOf<Bending>],
    (covariance, quantiles, sigma): (&DMatrix<f64>, [f64; 2], [f64; 2]),
    tolerance: f64,
) {
    let logarithm = found.unknowns[1].transform == Transform::Log;
    for (e, record) in records.iter().enumerate() {
        let bands = diagnose::bands(problem, found, e, 0.95).unwrap();
        for (k, u) in record.inputs().enumerate() {
            let [a, b, c] = [0, 1, 2 + e].map(|i| found.unknowns[i].value);
            let bend = (-b * u.u).exp();
            let curve = -a * u.u * bend * if logarithm { b } else { 1.0 };
            let own = |i: usize| if i == e { u.w } else { 0.0 };
            let slopes = [[bend, curve, 0.0, 0.0], [u.u, 0.0, own(0), own(1)]];
            for (j, predicted) in [a * bend, c * u.w + a * u.u].into_iter().enumerate() {
                let slopes = DVector::from_row_slice(&slopes[j]);
                let deviation = (slopes.transpose() * covariance * &slopes)[(0, 0)].sqrt();
                let what = format!("{e} {k} {j}");
                assert!((bands.outputs[j][k] - predicted).abs() < 1e-12, "{what}");
                close(bands.confidence[j][k], quantiles[0] * deviation, tolerance, &what);
                let prediction = (quantiles[0] * deviation).hypot(quantiles[1] * sigma[j]);
                close(bands.prediction[j][k], prediction, tolerance, &what);
            }
        }
    }
}

/// Condition of the weighted slopes with columns of length one, their lengths, and the parts of the squared slopes without weights that
/// lie in each output and in each of the ten parts, in whole samples, of each record.
fn identifiable(problem: &Problem<'_>, found: &Summary, rows: &[Row], (prior, wider): (f64, f64)) {
    let said = diagnose::identifiability(problem, found).unwrap();
    let mut weighted: Vec<DVector<f64>> = rows.iter().map(|row| &row.slopes * (row.weight.sqrt() / wider)).collect();
    weighted.push(DVector::from_row_slice(&[0.0, prior, 0.0, 0.0]));
    let jacobian = DMatrix::from_fn(weighted.len(), 4, |i, j| weighted[i][j]);
    let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
    let values = DMatrix::from_fn(weighted.len(), 4, |i, j| jacobian[(i, j)] / norms[j]).singular_values();
    close(said.condition.unwrap(), values[0] / values[3], 1e-5, "condition");
    assert_eq!((said.rank, said.generic_rank), (4, 4));
    for (i, (excited, unknown)) in said.excitation.iter().zip(&found.unknowns).enumerate() {
        close(
            excited.strength,
            norms[i] * (unknown.value / unknown.transform.slope(unknown.value)).abs(),
            1e-5,
            "strength",
        );
        let sum = |of: &dyn Fn(&Row) -> bool| -> f64 {
            rows.iter().filter(|row| of(row)).map(|row| row.slopes[i].powi(2)).sum()
        };
        let all = sum(&|_| true);
        let first = rows.iter().position(|row| row.output == 1).unwrap();
        let of_y: f64 = rows[..first].iter().map(|row| row.slopes[i].powi(2)).sum();
        for ((_, share), expected) in excited.outputs.iter().zip([of_y, all - of_y]) {
            assert!((share - expected / all).abs() < 1e-5, "{share} {expected}");
        }
        let segments = [(0, 10), (1, 7)].into_iter().flat_map(|(e, count)| (0..count).map(move |s| (e, s)));
        let segments: Vec<(usize, usize)> = segments.collect();
        assert_eq!(excited.segments.len(), segments.len());
        for (segment, (e, s)) in excited.segments.iter().zip(segments) {
            let inside = sum(&|row| row.sample.0 == e && row.sample.1 / 3 == s);
            assert_eq!(segment.from, 3.0 * s as f64);
            assert!((segment.share - inside / all).abs() < 1e-5, "{segment:?} {inside} {all}");
        }
    }
}
