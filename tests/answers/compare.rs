//! Comparison, validation, drift and derived quantities against values known beforehand.

use crate::random::Random;
use greybox::diagnose::{
    Candidate, Resampling, Test, bootstrap, cross_validate, derived, derived_by, drift, f_test, likelihood_ratio,
    tested, validate,
};
use greybox::graph::{Graph, Leaf};
use greybox::{
    Error, Estimate, Experiment, Fit, Kind, Model, Nothing, Parameter, Sample, Scalar, Severity, Summary, Time, fixed,
    free, signals,
};

signals! { struct Input { u: "V" } }
signals! { struct Output { y: "A" } }
signals! { struct Cubic { a: "A", b: "A/V", c: "A/V^2" } }

/// `y = a + b u + c u^2`.
#[derive(Clone)]
struct Polynomial;

impl Model for Polynomial {
    type State = Nothing;
    type Input = Input;
    type Output = Output;
    type Parameters = Cubic;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Input<S>, p: &Cubic<S>) -> Output<S> {
        Output { y: p.a + p.b * u.u + p.c * u.u * u.u }
    }
}

type Record = Experiment<Nothing, Input, Output>;

fn record(seed: u64, b: f64, c: f64) -> Record {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let inputs: Vec<Input> = (0..40).map(|k| Input { u: k as f64 * 0.05 - 1.0 }).collect();
    let outputs = inputs.iter().map(|u| Output { y: 1.0 + b * u.u + c * u.u * u.u + 0.1 * random.normal() }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    Experiment::new(&Polynomial, time, inputs, outputs).unwrap().named(format!("record {seed}"))
}

fn fit(records: &[Record], c: Parameter) -> Result<Estimate<Polynomial>, Error> {
    Fit::new(&Polynomial, records).parameters(Cubic { a: free(0.0), b: free(0.0), c }).run()
}

/// Both tests refuse a true restriction once in a hundred times (0.2 to 2.2 % over 1,000 records: four deviations; the
/// likelihood ratio, which is for long records, up to 2.6 %), and see a false one.
#[test]
fn nested_models_are_told_apart() {
    let (mut by_ratio, mut by_f) = (0, 0);
    for seed in 0..1000 {
        let record = [record(seed, 2.0, 0.0)];
        let line = Candidate::new("line", &fit(&record, fixed(0.0)).unwrap());
        let parabola = Candidate::new("parabola", &fit(&record, free(0.1)).unwrap());
        by_ratio += u32::from(!likelihood_ratio(&line, &parabola).unwrap().passed);
        by_f += u32::from(!f_test(&line, &parabola).unwrap().passed);
        assert!(likelihood_ratio(&parabola, &line).is_err());
    }
    println!("refused {by_ratio} by likelihood ratio, {by_f} by F");
    assert!((2..=22).contains(&by_f) && (2..=26).contains(&by_ratio), "{by_f} {by_ratio}");

    let record = [record(1, 2.0, 0.3)];
    let line = Candidate::new("line", &fit(&record, fixed(0.0)).unwrap());
    let parabola = Candidate::new("parabola", &fit(&record, free(0.1)).unwrap());
    let test = f_test(&line, &parabola).unwrap();
    assert!(!test.passed && test.meaning.contains("`line` misses something"), "{test:?}");
    // Two unknowns more than a constant: (S0 - S1) / 2 over S1 / (40 - 3).
    let parameters = Cubic { a: free(0.0), b: fixed(0.0), c: fixed(0.0) };
    let constant = Candidate::new("constant", &Fit::new(&Polynomial, &record).parameters(parameters).run().unwrap());
    let squares = |candidate: &Candidate| candidate.estimate.outputs[0].fit.rmse.powi(2);
    let expected = (squares(&constant) / squares(&parabola) - 1.0) / 2.0 * 37.0;
    let statistic = f_test(&constant, &parabola).unwrap().statistic;
    assert!((statistic / expected - 1.0).abs() < 1e-12, "{statistic} {expected}");
    let (few, many) = (&line.estimate, &parabola.estimate);
    assert!(many.aicc() < few.aicc() && many.bic() < few.bic());
    let table = greybox::report::Section::from(&[line, parabola][..]).tables[0].to_string();
    println!("{table}");
    assert!(table.lines().any(|line| line.starts_with("c ") && line.contains(" - ")), "{table}");
}

/// The variance of a product by hand: `(b sa)^2 + (a sb)^2 + 2 a b cov`.
#[test]
fn delta_method_by_hand() {
    let estimate = fit(&[record(3, 2.0, 0.4)], free(0.1)).unwrap();
    let (p, c) = (estimate.parameters, &estimate.covariance);
    let product = derived(&estimate, "a b", |p| p.a * p.b);
    let expected = (p.b * p.b * c.get(0, 0) + p.a * p.a * c.get(1, 1) + 2.0 * p.a * p.b * c.get(0, 1)).sqrt();
    assert!((product.value - p.a * p.b).abs() < 1e-15);
    assert!((product.standard_error.unwrap() / expected - 1.0).abs() < 1e-12);
    let (lower, upper) = product.interval.unwrap();
    assert!(lower < product.value && product.value < upper);
    // A root of a negative number has no error, and is not taken for one.
    assert_eq!(derived(&estimate, "root", |p| (-p.a).sqrt()).standard_error, None);
}

/// Of a parameter that each experiment has for itself, value and error are those of the first: the second is half as long, and
/// knows its slope less well. The slope of `2 b` is two, to the last bit.
#[test]
fn a_derived_quantity_takes_local_parameters_from_the_first_experiment() {
    let records = [record(3, 2.0, 0.4), record(4, 5.0, 0.4).slice(..20).unwrap()];
    let parameters = Cubic { a: free(0.0), b: free(0.0).per_experiment(), c: free(0.1) };
    let estimate = Fit::new(&Polynomial, &records).parameters(parameters).run().unwrap();
    let of = |e: usize| estimate.unknowns.iter().position(|unknown| unknown.experiment == Some(e)).unwrap();
    let (first, second) = (estimate.covariance.standard_error(of(0)), estimate.covariance.standard_error(of(1)));
    assert!(second > 1.1 * first, "{first} {second}");
    let double = derived(&estimate, "2 b", |p| p.b + p.b);
    assert!((double.value / (2.0 * estimate.experiments[0].parameters.b) - 1.0).abs() < 1e-15, "{double:?}");
    assert!((double.standard_error.unwrap() / (2.0 * first) - 1.0).abs() < 1e-12, "{double:?} {first}");
}

/// An experiment of the fit is predicted with its own parameters, which leave the residuals that the fit has left: a static model
/// has no others. There is no third experiment.
#[test]
fn an_experiment_of_the_fit_is_predicted_with_its_own_parameters() {
    let records = [record(3, 2.0, 0.4), record(4, 5.0, 0.4)];
    let parameters = Cubic { a: free(0.0), b: free(0.0).per_experiment(), c: free(0.1) };
    let estimate = Fit::new(&Polynomial, &records).parameters(parameters).run().unwrap();
    for (k, record) in records.iter().enumerate() {
        let own = estimate.predict_own(&Polynomial, record, k).unwrap().unwrap();
        let p = estimate.experiments[k].parameters;
        for (u, y) in record.inputs().zip(&own.outputs) {
            assert!((p.a + p.b * u.u + p.c * u.u * u.u - y.y).abs() < 1e-14 * 6.0, "{p:?} {u:?} {y:?}");
        }
        // 40 samples of a noise of 0.1.
        assert!((own.quality.y.rmse / 0.1 - 1.0).abs() < 0.4, "{:?}", own.quality);
    }
    assert!(estimate.predict_own(&Polynomial, &records[0], 2).is_none());
}

/// A record of the fit is known by its name; of another, nobody knows whose parameters it has.
#[test]
fn a_record_has_the_parameters_of_the_experiment_of_its_name() {
    let records = [record(3, 2.0, 0.4).named("cold"), record(4, 5.0, 0.4).named("warm")];
    let parameters = Cubic { a: free(0.0), b: free(0.0).per_experiment(), c: free(0.1) };
    let problem = Fit::new(&Polynomial, &records).parameters(parameters).problem().unwrap();
    let estimate = Fit::new(&Polynomial, &records).parameters(parameters).run().unwrap();
    for (k, record) in records.iter().enumerate() {
        let own = estimate.predict_own(&Polynomial, record, k).unwrap().unwrap();
        assert_eq!(estimate.predict(&Polynomial, record).unwrap().outputs, own.outputs);
        let untyped = problem.predict(estimate.summary(), record.record()).unwrap();
        assert!(untyped.outputs[0].iter().zip(&own.outputs).all(|(one, typed)| *one == typed.y));
    }
    let error = estimate.predict(&Polynomial, &record(5, 2.0, 0.4)).map(|_| ()).unwrap_err().to_string();
    assert!(["`record 5`", "`b`", "(cold, warm;"].iter().all(|part| error.contains(part)), "{error}");
    // The slope of `b` is one: value and error are those of the second.
    let mut graph = Graph::default();
    let b = graph.leaf(Leaf::Parameter(1));
    let second = derived_by(estimate.summary(), 1, "b", &graph, b);
    let of = estimate.unknowns.iter().position(|unknown| unknown.experiment == Some(1)).unwrap();
    assert_eq!(second.value, estimate.experiments[1].parameters.b);
    assert!(
        (second.standard_error.unwrap() / estimate.covariance.standard_error(of) - 1.0).abs() < 1e-12,
        "{second:?}"
    );
    // The same of the estimate for that experiment alone, whose parameters say how well they are known there.
    let own = estimate.summary().of_experiment(1).unwrap();
    assert_eq!(derived_by(&own, 0, "b", &graph, b), second);
    assert_eq!(own.parameters[1].knowledge, estimate.unknowns[of].knowledge);
    // There is no third one, and `b` is none of all; `c` is.
    let missing = derived_by(estimate.summary(), 2, "b", &graph, b);
    assert!(missing.value.is_nan() && missing.standard_error.is_none(), "{missing:?}");
    let c = graph.leaf(Leaf::Parameter(2));
    assert_eq!(derived_by(estimate.summary(), 2, "c", &graph, c).value, estimate.parameters.c);
}

/// What a user changes in a summary is what predictions and derived quantities are of: shared parameters by their values, those that experiments
/// have for themselves by the experiments.
#[test]
fn an_estimate_may_be_edited() {
    let records = [record(3, 2.0, 0.4).named("cold"), record(4, 5.0, 0.4).named("warm")];
    for (records, b) in [(&records[..], free(0.0).per_experiment()), (&records[..1], free(0.0))] {
        let parameters = Cubic { a: free(0.0), b, c: free(0.1) };
        let mut edited = Fit::new(&Polynomial, records).parameters(parameters).run().unwrap().into_summary();
        edited.parameters[0].value = 7.0;
        assert_eq!(edited.of_record(records[0].record()).unwrap().parameters[0].value, 7.0);
        let mut graph = Graph::default();
        let a = graph.leaf(Leaf::Parameter(0));
        assert_eq!(derived_by(&edited, 0, "a", &graph, a).value, 7.0);
        let b = graph.leaf(Leaf::Parameter(1));
        assert_eq!(derived_by(&edited, 0, "b", &graph, b).value, edited.experiments[0].parameters[1]);
    }
}

/// Refits of resampled residuals scatter as the standard errors of a model that is linear say: of 400 to 3.5 %, here four times
/// that; so do their intervals, which lie about the estimate, with the share of the residuals that the fit has taken put back.
#[test]
fn a_bootstrap_scatters_as_the_errors_say() {
    let record = [record(5, 2.0, 0.3)];
    let parameters = Cubic { a: free(0.0), b: free(0.0), c: free(0.0) };
    let problem = Fit::new(&Polynomial, &record).parameters(parameters).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = bootstrap(&problem, &estimate, Resampling::Residuals, 400, 1).unwrap();
    assert_eq!((found.converged, found.tried), (400, 400));
    for (i, unknown) in estimate.unknowns.iter().enumerate() {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((found.standard_errors[i] / error - 1.0).abs() < 0.14, "{found:?} {error}");
        // The mean of 400.
        assert!(found.bias[i].abs() < 4.0 * error / 20.0, "{found:?} {error}");
        let (lower, upper) = found.intervals[i];
        // Each end to 0.13 of a standard error.
        for (end, side) in [(lower, -1.0), (upper, 1.0)] {
            assert!((end - unknown.value - side * 1.96 * error).abs() < 0.5 * error, "{found:?} {unknown:?}");
        }
    }
}

/// Two halves of noise 0.1 and 2, weighted by the inverse of their squares: refits scatter as the standard errors say, not as residuals of both
/// sizes in either half would make them, 5 times as much.
#[test]
fn a_bootstrap_of_weighted_records() {
    let (quiet, other) = (record(7, 2.0, 0.3), record(8, 2.0, 0.3));
    let louder = |(u, y): (Input, Output)| {
        let clean = 1.0 + 2.0 * u.u + 0.3 * u.u * u.u;
        Output { y: clean + 20.0 * (y.y - clean) }
    };
    let inputs: Vec<Input> = quiet.inputs().chain(other.inputs()).collect();
    let outputs: Vec<Output> = quiet.outputs().chain(other.inputs().zip(other.outputs()).map(louder)).collect();
    let half = quiet.len() as f64;
    let joined = Experiment::new(&Polynomial, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = Fit::new(&Polynomial, &joined).parameters(Cubic { a: free(0.0), b: free(0.0), c: free(0.0) });
    let weight = move |sample: &Sample<Polynomial>| if sample.t < half { 100.0 } else { 0.25 };
    let problem = fit.weighting(weight).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = bootstrap(&problem, &estimate, Resampling::Residuals, 400, 1).unwrap();
    for (i, unknown) in estimate.unknowns.iter().enumerate() {
        let error = unknown.knowledge.standard_error().unwrap();
        // Of 400 to 3.5 %, and the sandwich of 80 measurements, of which half count, to some 15 %.
        assert!((found.standard_errors[i] / error - 1.0).abs() < 0.5, "{found:?} {error}");
    }
}

/// On data not used the error is the noise, a little more by the parameters' own.
#[test]
fn unseen_data_and_drift() {
    let records: Vec<Record> = (0..6).map(|seed| record(seed, 2.0, 0.3)).collect();
    for validation in cross_validate(&Polynomial, &records, |records| fit(records, free(0.0))).unwrap() {
        let (_, outputs) = &validation.qualities[0];
        // 40 samples: the deviation of a standard deviation is 11 %.
        assert!((outputs[0].1.rmse / 0.1 - 1.0).abs() < 0.4, "{validation:?}");
    }
    assert_eq!(cross_validate(&Polynomial, &records[..2], |records| fit(records, free(0.0))).unwrap().len(), 2);
    assert!(cross_validate(&Polynomial, &records[..1], |records| fit(records, free(0.0))).is_err());
    let estimate = fit(&records[..1], free(0.0)).unwrap();
    assert_eq!(validate(&estimate, &Polynomial, &records[1], &[]).unwrap().experiment, "record 1");

    let each = |first: u64, b: &dyn Fn(u64) -> f64| -> Vec<Summary> {
        let estimates = (0..8).map(|day| fit(&[record(first + day, b(day), 0.3)], free(0.0)).unwrap());
        estimates.map(Estimate::into_summary).collect()
    };
    // Nothing drifts: each test refuses about once in a hundred times; 300 of each, three deviations above 1.4 % (the tail of
    // Student's t with 37 degrees of freedom where a normal one has 1 %).
    let steady: Vec<_> = (0..100).flat_map(|batch| drift(&each(100 + 8 * batch, &|_| 2.0))).collect();
    let (changed, trended) =
        (steady.iter().filter(|d| !d.change.passed).count(), steady.iter().filter(|d| !d.trend.passed).count());
    println!("of {}: {changed} changes, {trended} trends", steady.len());
    assert!(steady.len() == 300 && changed <= 10 && trended <= 10, "{changed} {trended}");
    // Three estimates are enough, two are not.
    assert_eq!([2, 3].map(|days| drift(&each(20, &|_| 2.0)[..days]).len()), [0, 3]);
    let warming = drift(&each(20, &|day| 2.0 + 0.05 * day as f64));
    let b = warming.iter().find(|drift| drift.name == "b").unwrap();
    assert!(!b.trend.passed && !b.change.passed && (b.slope - 0.05).abs() < 0.02, "{b:?}");
    assert!(b.trend.meaning.contains("`b` goes up"), "{b:?}");
    let cooling = drift(&each(20, &|day| 2.0 - 0.05 * day as f64));
    assert!(cooling[1].trend.meaning.contains("`b` goes down"), "{:?}", cooling[1]);

    // The weighted regression on 1 and the number of the record, by its normal equations; Cochran's Q is the weighted sum of
    // squares about the weighted mean, chi-square with seven degrees of freedom.
    let (mut normal, mut right) = (nalgebra::Matrix2::<f64>::zeros(), nalgebra::Vector2::<f64>::zeros());
    let (mut total, mut weighted, mut squares) = (0.0, 0.0, 0.0);
    for (x, (y, s)) in b.values.iter().enumerate() {
        let (row, weight) = (nalgebra::Vector2::new(1.0, x as f64), 1.0 / (s * s));
        normal += row * row.transpose() * weight;
        right += row * *y * weight;
        (total, weighted, squares) = (total + weight, weighted + weight * y, squares + weight * y * y);
    }
    let inverse = normal.try_inverse().unwrap();
    let slope = (inverse * right)[1];
    let (z, q) = (slope / inverse[(1, 1)].sqrt(), squares - weighted * weighted / total);
    assert!((b.slope / slope - 1.0).abs() < 1e-9 && (b.trend.statistic / z - 1.0).abs() < 1e-9, "{b:?} {slope} {z}");
    assert!(
        (b.mean / (weighted / total) - 1.0).abs() < 1e-12 && (b.change.statistic / q - 1.0).abs() < 1e-9,
        "{b:?} {q}"
    );
    let tail = statrs::function::gamma::gamma_ur(3.5, q / 2.0);
    assert!((b.change.p_value / tail - 1.0).abs() < 1e-6, "{b:?} {tail}");
    let tail = statrs::function::erf::erfc(z.abs() / std::f64::consts::SQRT_2);
    assert!((b.trend.p_value / tail - 1.0).abs() < 1e-6, "{b:?} {tail}");
}

signals! { struct Level { x: "V" } }
signals! { struct Lag { k: "1", tau: "s" } }

/// `tau dx/dt = k u - x`.
struct FirstOrder;

impl Model for FirstOrder {
    type State = Level;
    type Input = Input;
    type Output = Level;
    type Parameters = Lag;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Input<S>, p: &Lag<S>) -> Level<S> {
        Level { x: (p.k * u.u - x.x) / p.tau }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Input<S>, _p: &Lag<S>) -> Level<S> {
        *x
    }
}

/// Predicted n samples ahead of a state measured with noise of deviation s, the error has the variance
/// `s^2 (1 + a^(2n))`, `a = exp(-step / tau)`: the new noise, and what is left of the old. Simulated, it has `s^2`.
#[test]
fn prediction_ahead_by_hand() {
    let (step, tau, samples, sigma) = (0.01, 0.05, 20_000, 0.1);
    let a = f64::exp(-step / tau);
    let record = |seed: u64| {
        let mut random = Random(seed);
        let inputs: Vec<Input> = (0..samples).map(|k| Input { u: if k / 90 % 2 == 0 { 1.0 } else { -1.0 } }).collect();
        let mut x = 0.0;
        let outputs = inputs.iter().map(|u| {
            let y = Level { x: x + sigma * random.normal() };
            x = 2.0 * u.u + (x - 2.0 * u.u) * a;
            y
        });
        let outputs = outputs.collect();
        Experiment::new(&FirstOrder, Time::Uniform { start: 0.0, step }, inputs, outputs).unwrap()
    };
    let parameters = Lag { k: free(1.0), tau: free(0.1).log() };
    let estimate = Fit::new(&FirstOrder, &record(1)).parameters(parameters).run().unwrap();
    let found = validate(&estimate, &FirstOrder, &record(2), &[1, 5, 50]).unwrap();
    let steps: Vec<Option<u64>> = found.qualities.iter().map(|(steps, _)| *steps).collect();
    assert_eq!(steps, [None, Some(1), Some(5), Some(50)]);
    for (steps, outputs) in &found.qualities {
        let left = steps.map_or(0.0, |n| a.powi(2 * n as i32));
        let expected = sigma * f64::sqrt(1.0 + left);
        let (_, quality) = &outputs[0];
        // Four deviations of a standard deviation from 20,000 samples (neighbors correlated by a^n), and the parameters' own.
        assert!((quality.rmse / expected - 1.0).abs() < 0.025, "{steps:?}: {} {expected}", quality.rmse);
    }
    let refused = validate(&estimate, &FirstOrder, &record(2), &[samples]).unwrap_err().to_string();
    assert!(refused.contains("20000 sample(s) ahead makes no sense"), "{refused}");
}

/// A test that failed is a reason for care, with its meaning; one that passed is none.
#[test]
fn failed_tests_are_reasons() {
    let test = |passed: bool| Test {
        name: "F test".to_owned(),
        statistic: 1.0,
        p_value: 0.5,
        passed,
        meaning: format!("passed: {passed}"),
    };
    let section = tested("models", [&test(true), &test(false), &test(true)]);
    let reasons = section.all_reasons();
    assert_eq!(reasons.len(), 1, "{reasons:?}");
    assert!(reasons[0].1.contains("passed: false") && reasons[0].0 == Severity::UsableWithCare);
}
