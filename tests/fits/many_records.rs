#![cfg(feature = "std")]
//! Several records of one parameter: short ones, and ones that differ.

use crate::common::*;
use greybox::estimate::CovarianceMethod;
use greybox::*;

signals! { pub struct Rate { k: "1/s" } }

/// `di/dt = -k i`.
#[derive(Clone)]
struct Decay;

impl Model for Decay {
    type State = Current;
    type Input = Nothing;
    type Output = Current;
    type Parameters = Rate;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Nothing, p: &Rate<S>) -> Current<S> {
        Current { i: -p.k * x.i }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Nothing, _p: &Rate<S>) -> Current<S> {
        *x
    }
}

/// So many samples over 5 s of a decay from 5 A, with an autoregression of order one of deviation 0.05 A.
fn record(k: f64, samples: usize, correlation: f64, noise: &mut Noise) -> ExperimentOf<Decay> {
    let (step, mut error) = (5.0 / samples as f64, 0.0);
    let output = |n: usize| {
        error = correlation * error + (1.0 - correlation * correlation).sqrt() * noise.gauss();
        Current { i: 5.0 * (-k * step * n as f64).exp() + 0.05 * error }
    };
    let outputs = (0..samples).map(output).collect();
    Experiment::new(&Decay, Time::Uniform { start: 0.0, step }, vec![Nothing; samples], outputs).unwrap()
}

fn fit(records: &[ExperimentOf<Decay>]) -> Estimate<Decay> {
    Fit::new(&Decay, records).parameters(Rate { k: free(1.0) }).run().unwrap()
}

fn said(estimate: &Estimate<Decay>, code: WarningCode) -> Option<&Warning> {
    estimate.warnings.iter().find(|warning| warning.code == code)
}

fn half_width(estimate: &Estimate<Decay>) -> f64 {
    let Knowledge::Known { lower, upper, .. } = estimate.knowledge.k else { panic!("{estimate}") };
    0.5 * (upper - lower)
}

const RATES: [f64; 12] = [0.35, 0.62, 0.48, 0.71, 0.39, 0.55, 0.44, 0.66, 0.31, 0.52, 0.58, 0.41];

/// Twelve records of eleven samples with rates that scatter by a quarter: a standard error of 0.036 by the scatter of what each record moves
/// the rate by, whose own relative error is `1 / sqrt(22)`, a fifth. The records are named, and each that is left to itself is known.
#[test]
fn records_that_differ_are_clusters() {
    let mut noise = Noise(1);
    let records: Vec<_> = RATES.iter().map(|k| record(*k, 11, 0.0, &mut noise)).collect();
    let fixed: Vec<_> = records.iter().map(|one| one.clone().initial(Current { i: fixed(5.0) })).collect();
    for (records, own) in [(&fixed, false), (&records, true)] {
        let estimate = fit(records);
        let error = estimate.knowledge.k.standard_error().unwrap();
        assert!((error / 0.036 - 1.0).abs() < 0.2, "{estimate}");
        assert_eq!(estimate.method.covariance, CovarianceMethod::Clusters { records: 12 });
        assert!(said(&estimate, WarningCode::HoldsZero).is_none(), "{estimate}");
        assert!(said(&estimate, WarningCode::RecordsContradict).is_some(), "{estimate}");
        // By at most 5 A - 4 A, which a rate that is off by a third makes of its first second.
        let known = |unknown: &estimate::Unknown| unknown.knowledge.standard_error().is_some_and(|error| error < 1.0);
        assert!(!own || estimate.unknowns[1..].iter().all(known), "{estimate}");
    }
    // Records of one rate are not clusters, and each of its own rate says nothing of the others.
    let alike: Vec<_> = RATES.iter().map(|_| record(0.5, 11, 0.0, &mut noise)).collect();
    assert_eq!(fit(&alike).method.covariance, CovarianceMethod::Classical);
    let each = Fit::new(&Decay, &fixed).parameters(Rate { k: free(1.0).per_experiment() }).run().unwrap();
    assert_eq!(each.severity(), Severity::Usable, "{each}");
}

/// Three short records, and forty of six samples, that scatter by 30 %: each kind named in all of ten draws.
#[test]
fn few_and_many_records_that_differ_are_named() {
    for (count, samples) in [(3, 11), (12, 6), (40, 6)] {
        for seed in 1..=10 {
            let mut noise = Noise(100 * seed + count);
            // A scatter that no chance makes small.
            let rate = |i: u64| 0.5 * (1.0 + if i.is_multiple_of(2) { 0.3 } else { -0.3 });
            let records: Vec<_> = (0..count).map(|i| record(rate(i), samples, 0.0, &mut noise)).collect();
            let estimate = fit(&records);
            assert!(said(&estimate, WarningCode::RecordsContradict).is_some(), "{count} {seed} {estimate}");
            assert!(estimate.severity() > Severity::Usable);
        }
    }
}

/// A long record beside eleven short ones, of one rate, with errors of correlation 0.7: the interval is about that of the long record alone,
/// and those of the initial states are of the size of the noise, whatever eleven samples say of its color.
#[test]
fn short_records_beside_a_long_one_cost_nothing() {
    for seed in 1..=5 {
        let mut noise = Noise(seed);
        let long = record(0.5, 400, 0.7, &mut noise);
        let alone = half_width(&fit(std::slice::from_ref(&long)));
        let short = (0..11).map(|_| record(0.5, 11, 0.7, &mut noise));
        let records: Vec<_> = std::iter::once(long).chain(short).collect();
        let estimate = fit(&records);
        assert!(half_width(&estimate) < 1.2 * alone, "{alone} {estimate}");
        let wide = |unknown: &&estimate::Unknown| unknown.knowledge.standard_error().is_none_or(|error| error > 0.1);
        assert_eq!(estimate.unknowns[1..].iter().filter(wide).count(), 0, "{estimate}");
    }
}

/// Records of six samples have six values each, and many all together; sensors of two values have two in all of them.
#[test]
fn values_are_those_of_all_records() {
    for count in [1, 3, 4, 8, 20] {
        let mut noise = Noise(count);
        let records: Vec<_> = (0..count).map(|_| record(0.5, 6, 0.0, &mut noise)).collect();
        let estimate = fit(&records);
        assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
        let rounded = |one: &ExperimentOf<Decay>| {
            let outputs = one.outputs().map(|y| Current { i: if y.i > 2.0 { 4.0 } else { 1.0 } }).collect();
            with_outputs(&Decay, one, outputs)
        };
        let coarse = fit(&records.iter().map(rounded).collect::<Vec<_>>());
        // Eight measurements of two values at least.
        assert_eq!(said(&coarse, WarningCode::CoarseOutput).is_some(), count >= 3, "{coarse}");
    }
}
