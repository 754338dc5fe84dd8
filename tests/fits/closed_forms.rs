#![cfg(feature = "std")]
//! Fits against textbook formulas: regression, information criteria, error index, covariances of dense problems, slopes.

use crate::common::*;
use argmin::core::{CostFunction, Gradient, Hessian, Jacobian, Operator};
use greybox::information::Covariance;
use greybox::*;
use greybox::{estimate::Unknown, loss::SoftL1, regress::Regression};
use nalgebra::{DMatrix, DVector};

#[track_caller]
fn assert_close(a: f64, b: f64, relative: f64) {
    assert!((a - b).abs() <= relative * b.abs(), "{a} {b}");
}

const SIGMA: Pair = Pair { y: 0.3, z: 0.2 };
const TRUTH: Affine = Affine { slope: 1.5, offset: -0.7 };

fn line(samples: usize) -> ExperimentOf<Line> {
    let inputs = levels(samples, 1, 5).into_iter().map(|u| Voltage { u }).collect();
    noisy(&Line, &simulated(&Line, 1.0, inputs, Nothing, TRUTH), SIGMA, &mut Noise(1))
}

fn line_free() -> Affine<Parameter> {
    Affine { slope: free(1.0), offset: free(0.5) }
}

/// Three records of a lag with own initial states and gains.
fn lags() -> Vec<ExperimentOf<Lag>> {
    let one = |e: usize| {
        let inputs = levels(150, 12, 20 + e as u64).into_iter().map(|u| Voltage { u }).collect();
        let truth = Branch { gain: 1.6 + 0.5 * e as f64, tau: 0.05 };
        let record = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, truth).named(format!("run {e}"));
        noisy(&Lag, &record.initial(Current { i: free(0.4) }), Current { i: 0.1 }, &mut Noise(e as u64 + 1))
    };
    (0..3).map(one).collect()
}

fn lags_free() -> Branch<Parameter> {
    Branch { gain: free(1.5).per_experiment(), tau: free(0.06).log() }
}

fn dense(rows: Vec<Vec<f64>>) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

#[test]
fn a_linear_model_fits_as_regression_does() {
    // One output at a time, the other never measured but once, so that both have N - p degrees of freedom.
    let record = line(40);
    let sigma = 0.3;
    let mut regression = Regression::<Affine>::new();
    for (u, y) in record.inputs().zip(record.outputs()) {
        regression.row(Affine { slope: u.u / sigma, offset: 1.0 / sigma }, y.y / sigma);
        regression.row(Affine { slope: -1.0 / sigma, offset: u.u / sigma }, y.z / sigma);
    }
    let reference = regression.solve().unwrap();
    let estimate = Fit::new(&Line, &record).parameters(line_free()).noise(Pair { y: sigma, z: sigma }).run().unwrap();
    let widening = reference.rms * (80.0f64 / 78.0).sqrt();
    let columns = [
        (0, estimate.parameters.slope, reference.parameters.slope, reference.standard_errors.slope),
        (1, estimate.parameters.offset, reference.parameters.offset, reference.standard_errors.offset),
    ];
    for (i, value, expected, error) in columns {
        assert_close(value, expected, 1e-9);
        // The fit was told the noise, the regression measured it.
        assert_close(estimate.unknowns[i].knowledge.standard_error().unwrap() * widening, error, 1e-9);
    }
    assert_close(estimate.unknowns[0].error_index.unwrap(), reference.index.slope, 1e-9);
    assert_close(estimate.unknowns[1].error_index.unwrap(), reference.index.offset, 1e-9);
    assert_close(estimate.unknowns[0].error_index_held.unwrap(), reference.index_others_held.slope, 1e-9);
}

#[test]
fn criteria_are_those_of_the_textbook() {
    let record = line(40);
    // A missing output takes its own share of the determinant along.
    let mut outputs: Vec<Pair> = record.outputs().collect();
    outputs[3].z = f64::NAN;
    outputs[4] = Pair { y: f64::NAN, z: f64::NAN };
    let record = with_outputs(&Line, &record, outputs);
    let given = Fit::new(&Line, &record).parameters(line_free()).noise(SIGMA).run().unwrap();
    let deviance = |p: Affine, sigma: Pair| -> f64 {
        let term = |error: f64, s: f64| (core::f64::consts::TAU * s * s).ln() + (error / s).powi(2);
        let pairs = record.inputs().zip(record.outputs());
        pairs
            .flat_map(|(u, y)| {
                [(y.y - (p.slope * u.u + p.offset), sigma.y), (y.z - (p.offset * u.u - p.slope), sigma.z)]
            })
            .filter(|(error, _)| !error.is_nan())
            .map(|(error, s)| term(error, s))
            .sum()
    };
    let (n, k) = (77.0, 2.0);
    assert_eq!(given.measurements, 77);
    let d = deviance(given.parameters, SIGMA);
    assert_close(given.deviance.unwrap(), d, 1e-12);
    assert_close(given.aic().unwrap(), d + 2.0 * k, 1e-12);
    assert_close(given.aicc().unwrap(), d + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0), 1e-12);
    assert_close(given.bic().unwrap(), d + k * f64::ln(n), 1e-12);

    let estimated = Fit::new(&Line, &record).parameters(line_free()).run().unwrap();
    let ml = Pair { y: estimated.quality.y.rmse, z: estimated.quality.z.rmse };
    let d = deviance(estimated.parameters, ml);
    // The noise has settled to 1e-8.
    assert_close(estimated.deviance.unwrap(), d, 1e-7);
    assert_close(estimated.aic().unwrap(), estimated.deviance.unwrap() + 2.0 * 4.0, 1e-12);
    let fpe = (ml.y * ml.z).powi(2) * (1.0 + 2.0 / 39.0) / (1.0 - 2.0 / 39.0);
    assert_close(estimated.fpe().unwrap(), fpe, 1e-12);
    let correlated = Fit::new(&Line, &record).parameters(line_free()).noise_covariance().run().unwrap();
    assert!(correlated.deviance.unwrap() <= d, "more freedom, more likely");
}

#[test]
fn the_error_index_doubles_the_squared_residual() {
    let record = line(40);
    let fit = |parameters| Fit::new(&Line, &record).parameters(parameters).noise(SIGMA).run().unwrap();
    let best = fit(line_free());
    let p = best.parameters;
    let (a, b) = (best.unknowns[0].error_index.unwrap() / 100.0, best.unknowns[1].error_index.unwrap() / 100.0);
    for sign in [-1.0, 1.0] {
        let slope = fit(Affine { slope: fixed(p.slope * (1.0 + sign * a)), ..line_free() });
        let offset = fit(Affine { offset: fixed(p.offset * (1.0 + sign * b)), ..line_free() });
        assert_close(slope.cost / best.cost, 2.0, 1e-6);
        assert_close(offset.cost / best.cost, 2.0, 1e-6);
    }
}

/// Rows of own and shared unknowns: the covariance from the triangles is that of the dense Jacobian.
#[test]
fn covariances_of_several_experiments_are_the_dense_ones() {
    let records = lags();
    let sigma = Current { i: 0.1 };
    let fit = || Fit::new(&Lag, &records).parameters(lags_free()).noise(sigma);
    let estimate = fit().run().unwrap();
    let at =
        |unknowns: &[Unknown]| -> Vec<f64> { unknowns.iter().map(|u| u.transform.to_coordinate(u.value)).collect() };
    let chain = |unknowns: &[Unknown]| {
        DMatrix::from_diagonal(&DVector::from_vec(unknowns.iter().map(|u| u.transform.slope(u.value)).collect()))
    };
    let check = |found: &Covariance, expected: DMatrix<f64>| {
        for i in 0..expected.nrows() {
            for j in 0..expected.ncols() {
                let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
                assert!((found.get(i, j) - expected[(i, j)]).abs() < 1e-9 * scale, "{i} {j}: {found:?} {expected}");
            }
        }
    };
    let problem = fit().problem().unwrap();
    let jacobian = dense(problem.objective().unwrap().jacobian(&at(&estimate.unknowns)).unwrap());
    let inverse = (jacobian.transpose() * &jacobian).try_inverse().unwrap();
    let slopes = chain(&estimate.unknowns);
    check(&estimate.covariance, &slopes * &inverse * &slopes);

    // Weighted: each row's score, by one less its leverage `h`, and 0.4 of the variance that the other rows' prediction has,
    // `h / (1 - h)` times that of all.
    let weight = |s: &Sample<Lag>| 0.1 + s.u.u.abs();
    let weighted = fit().weighting(weight).run().unwrap();
    let problem = fit().weighting(weight).problem().unwrap();
    let at = at(&weighted.unknowns);
    let objective = problem.objective().unwrap();
    let rows = dense(objective.jacobian(&at).unwrap());
    let residuals = DVector::from_vec(objective.apply(&at).unwrap());
    let bread = (rows.transpose() * &rows).try_inverse().unwrap();
    let noise = residuals.norm_squared() / weighted.measurements as f64;
    let mut meat = DMatrix::zeros(rows.ncols(), rows.ncols());
    for (g, r) in rows.row_iter().zip(residuals.iter()) {
        let leverage = (g * &bread * g.transpose())[(0, 0)];
        let predicted = noise * leverage / (1.0 - leverage);
        meat += g.transpose() * g * ((r / (1.0 - leverage)).powi(2) + 0.4 * predicted);
    }
    let slopes = chain(&weighted.unknowns);
    check(&weighted.covariance, &slopes * &bread * meat * &bread * &slopes);
}

/// Impulse response of a Butterworth low-pass of order 4, cut-off in cycles per sample: the analog pole pairs through the
/// bilinear transform, as difference equations.
fn butterworth_4(cutoff: f64, samples: usize) -> Vec<f64> {
    let g = (std::f64::consts::PI * cutoff).tan();
    let mut h: Vec<f64> = (0..samples).map(|k| f64::from(u8::from(k == 0))).collect();
    for pole in [1.0, 3.0] {
        let damping = 2.0 * (pole * std::f64::consts::PI / 8.0).sin();
        let (a0, a1, a2) = (1.0 + g * (g + damping), 2.0 * (g * g - 1.0), 1.0 + g * (g - damping));
        let (mut u, mut y) = ([0.0; 2], [0.0; 2]);
        for h in &mut h {
            let next = (g * g * (*h + 2.0 * u[0] + u[1]) - a1 * y[0] - a2 * y[1]) / a0;
            (u, y) = ([*h, u[0]], [next, y[0]]);
            *h = next;
        }
    }
    h
}

/// A pre-filtered fit of a linear model: `L` as a matrix gives every covariance.
#[test]
fn the_covariance_behind_a_pre_filter_is_the_dense_one() {
    let samples = 60;
    let record = line(samples);
    let filter = Butterworth::low_pass(4, 0.1, 1.0).unwrap();
    let estimate = Fit::new(&Line, &record)
        .parameters(line_free())
        .noise(Pair { y: 0.1, z: 0.1 })
        .prefilter(filter)
        .run()
        .unwrap();
    let h = butterworth_4(0.1, samples);
    let l = DMatrix::from_fn(samples, samples, |k, i| if k < i { 0.0 } else { h[k - i] });
    let u = DVector::from_iterator(samples, record.inputs().map(|u| u.u));
    let ones = DVector::from_element(samples, 1.0);
    let p = DVector::from_vec(vec![estimate.parameters.slope, estimate.parameters.offset]);
    let of = |columns: [DVector<f64>; 2], y: DVector<f64>| {
        let g = DMatrix::from_columns(&columns);
        let errors = &l * (y - &g * &p);
        (&l * g, errors)
    };
    let y = |f: fn(Pair) -> f64| DVector::from_iterator(samples, record.outputs().map(f));
    let both = [of([u.clone(), ones.clone()], y(|y| y.y)), of([-ones, u], y(|y| y.z))];
    let hessian: DMatrix<f64> = both.iter().map(|(g, _)| g.transpose() * g).sum();
    let inverse = hessian.try_inverse().unwrap();
    let energy = (&l * l.transpose()).trace();
    // Covariance of the white errors between the outputs, from the filtered ones.
    let noise = DMatrix::from_fn(2, 2, |i, j| both[i].1.dot(&both[j].1) / energy);
    let back: Vec<DMatrix<f64>> = both.iter().map(|(g, _)| l.transpose() * g).collect();
    let mut meat = DMatrix::zeros(2, 2);
    for i in 0..2 {
        for j in 0..2 {
            meat += back[i].transpose() * &back[j] * noise[(i, j)];
        }
    }
    let taken: f64 = back.iter().map(|v| (v * &inverse * v.transpose()).trace()).sum();
    let expected = &inverse * meat * &inverse * (2.0 * energy / (2.0 * energy - taken));
    for (found, expected) in estimate.covariance.dense(&[0, 1]).rows().flatten().zip(expected.transpose().iter()) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1e-4), "{found} {expected}");
    }
}

#[test]
fn gradient_and_hessian_are_those_of_the_cost() {
    let records = lags();
    let sigma = Current { i: 0.1 };
    let prior = Branch { gain: free(1.5).per_experiment().prior(2.0, 0.4), tau: free(0.06).log().prior(0.055, 0.01) };
    let fit = |parameters| Fit::new(&Lag, &records).parameters(parameters).noise(sigma);
    let weight = |s: &Sample<Lag>| s.u.u.abs();
    let fits = [
        fit(lags_free()),
        fit(prior),
        fit(prior).loss(Huber(1.345)),
        fit(prior).loss(SoftL1(1.3)).weighting(weight),
        fit(lags_free()).prefilter(Butterworth::low_pass(2, 20.0, 5e-3).unwrap()),
    ];
    for (number, fit) in fits.into_iter().enumerate() {
        let problem = fit.problem().unwrap();
        let objective = problem.objective().unwrap();
        let at = objective.start();
        let gradient = objective.gradient(&at).unwrap();
        for i in 0..at.len() {
            let h = 1e-5 * at[i].abs().max(0.1);
            let moved = |by: f64| {
                let mut to = at.clone();
                to[i] += by;
                objective.cost(&to).unwrap()
            };
            // Fourth-order differences; the kinks of Huber's slope leave an error of the second order.
            let slope = (8.0 * (moved(h) - moved(-h)) - moved(2.0 * h) + moved(-2.0 * h)) / (12.0 * h);
            assert!((gradient[i] - slope).abs() < 1e-6 * slope.abs().max(1.0), "{number} {i}: {} {slope}", gradient[i]);
        }
        let (jacobian, residuals) = (dense(objective.jacobian(&at).unwrap()), objective.apply(&at).unwrap());
        let expected = jacobian.transpose() * &jacobian;
        let hessian = objective.hessian(&at).unwrap();
        let from_rows = jacobian.transpose() * DVector::from_vec(residuals);
        for i in 0..at.len() {
            assert_close(from_rows[i], gradient[i], 1e-9);
            for j in 0..at.len() {
                let scale = (expected[(i, i)] * expected[(j, j)]).sqrt();
                assert!((hessian[i][j] - expected[(i, j)]).abs() < 1e-12 * scale, "{number} {i} {j}");
            }
        }
    }
}

#[test]
fn an_estimate_comes_back_from_json() {
    let parameters = Branch { tau: free(0.06).within(0.01, 1.0), ..lags_free() };
    let estimate = Fit::new(&Lag, &lags()).parameters(parameters).run().unwrap();
    let text = serde_json::to_string(&estimate).unwrap();
    let back: Estimate<Lag> = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    assert_eq!(back.covariance, estimate.covariance);
}

/// Only the course of a weight matters: its scale changes neither the noise nor the covariance.
#[test]
fn the_scale_of_a_weighting_does_not_matter() {
    let records = lags();
    let fit = |scale: f64| {
        let weight = move |s: &Sample<Lag>| scale * (0.1 + s.u.u.abs());
        Fit::new(&Lag, &records).parameters(lags_free()).weighting(weight).run().unwrap()
    };
    let (one, hundred) = (fit(1.0), fit(100.0));
    assert_close(hundred.quality.i.sigma, one.quality.i.sigma, 1e-9);
    let variances = [&hundred, &one].map(|fit| fit.covariance.diagonal());
    assert_eq!(variances.each_ref().map(Vec::len), [one.unknowns.len(); 2]);
    for (i, (a, b)) in variances[0].iter().zip(&variances[1]).enumerate() {
        assert_close(*a, *b, 1e-8);
        assert_eq!(*b, one.covariance.get(i, i));
    }
    // The errors are those of the noise, 0.1 A, known to one part in sqrt(2 * 450): 3.3 %.
    assert!((one.quality.i.sigma / 0.1 - 1.0).abs() < 0.1, "{one}");
}

mod product {
    use greybox::*;

    signals! {
        struct Factors { a: "1", b: "1" }
        struct Force { u: "1" }
        struct Answer { y: "1" }
    }

    /// Two parameters that appear as their product alone.
    struct Product;

    impl Model for Product {
        type State = Nothing;
        type Input = Force;
        type Output = Answer;
        type Parameters = Factors;
        const KIND: Kind = Kind::Static;

        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, p: &Factors<S>) -> Answer<S> {
            Answer { y: p.a * p.b * u.u }
        }
    }

    /// Rounding that the triangles of several records leave together in the direction that nothing is known of would
    /// move a nearly undamped step as far as one likes.
    #[test]
    fn a_product_is_found_from_any_number_of_records() {
        for count in [1, 2, 3, 6, 12] {
            let record = |r: usize| {
                let time = Time::Uniform { start: 0.0, step: 0.01 };
                let inputs: Vec<Force> = (0..500).map(|k| Force { u: (0.37 * (k + 31 * r) as f64).sin() }).collect();
                let run = simulate(&Product, &Factors { a: 2.0, b: 1.5 }, &Nothing {}, time, &inputs).unwrap();
                run.with_noise(Answer { y: 0.1 }, r as u64).experiment(&Product).unwrap().named(format!("{r}"))
            };
            let records: Vec<_> = (0..count).map(record).collect();
            let estimate = Fit::new(&Product, &records).parameters(Factors::splat(free(0.7))).run().unwrap();
            assert!(estimate.outcome.converged(), "{count}: {estimate}");
            assert_eq!(estimate.directions.len(), 1, "{estimate}");
            // Three standard errors of the product, 0.1 / sqrt(500 / 2) for one record.
            let product = estimate.parameters.a * estimate.parameters.b;
            assert!((product - 3.0).abs() < 0.02, "{count}: {product}");
            assert!((estimate.quality.y.sigma / 0.1 - 1.0).abs() < 0.1, "{estimate}");
        }
    }
}
