#![cfg(feature = "std")]
//! What single columns of a record make of a verdict: constant inputs, clipped outputs, copies.

use crate::common::*;
use greybox::*;

signals! { pub struct Filter { il: "A", vc: "V" } }
signals! { pub struct Duty { d: "1", vin: "V", iload: "A" } }
signals! { pub struct Parts { l: "H", c: "F", rl: "ohm" } }

/// A buck converter, averaged over its switching period.
#[derive(Clone)]
struct Converter;

impl Model for Converter {
    type State = Filter;
    type Input = Duty;
    type Output = Filter;
    type Parameters = Parts;

    fn derivative<S: Scalar>(&self, _t: S, x: &Filter<S>, u: &Duty<S>, p: &Parts<S>) -> Filter<S> {
        Filter { il: (u.d * u.vin - p.rl * x.il - x.vc) / p.l, vc: (x.il - u.iload) / p.c }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Filter<S>, _u: &Duty<S>, _p: &Parts<S>) -> Filter<S> {
        *x
    }
}

const TRUTH: Parts = Parts { l: 7.93e-5, c: 2.015e-4, rl: 0.1475 };

fn record(seed: u64) -> ExperimentOf<Converter> {
    let duty = levels(400, 20, seed).into_iter().zip(levels(400, 35, seed + 100));
    let inputs = duty.map(|(d, load)| Duty { d: 0.55 + 0.15 * d, vin: 12.0, iload: 2.5 + 0.5 * load }).collect();
    let clean = simulated(&Converter, 2e-5, inputs, Filter { il: 2.5, vc: 6.6 }, TRUTH);
    noisy(&Converter, &clean, Filter { il: 0.02, vc: 0.02 }, &mut Noise(seed))
}

fn fit(record: &ExperimentOf<Converter>) -> Estimate<Converter> {
    let parameters = Parts { l: free(1e-4), c: free(1e-4), rl: free(0.1) };
    Fit::new(&Converter, record).parameters(parameters).run().unwrap()
}

fn codes(estimate: &Estimate<Converter>) -> Vec<WarningCode> {
    estimate.warnings.iter().map(|warning| warning.code).collect()
}

/// The bus voltage never moves, but multiplies a duty cycle that does: nothing is said, and all is known.
#[test]
fn a_constant_that_multiplies_what_moves_is_no_offset() {
    for seed in 1..=5 {
        let estimate = fit(&record(seed));
        assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
        assert!(!codes(&estimate).contains(&WarningCode::ConstantInput), "{estimate}");
        let off = (estimate.parameters.c - TRUTH.c) / estimate.knowledge.c.standard_error().unwrap();
        assert!(off.abs() < 4.0, "{estimate}");
    }
}

/// An output that stops at 7.2 V stands still there, which is said once; elsewhere its errors are not those of measurements that were held.
#[test]
fn clipped_samples_are_named_once() {
    for seed in 1..=5 {
        let good = record(seed);
        let clipped =
            with_outputs(&Converter, &good, good.outputs().map(|y| Filter { vc: y.vc.min(7.2), ..y }).collect());
        let estimate = fit(&clipped);
        let said = codes(&estimate);
        assert_eq!(said.iter().filter(|code| **code == WarningCode::Clipped).count(), 1, "{estimate}");
        assert!(!said.contains(&WarningCode::Frozen) && !said.contains(&WarningCode::Outliers), "{estimate}");
    }
}

/// A column that is another one is named with it: two outputs, an output of an input, two inputs.
#[test]
fn copies_are_named() {
    let good = record(1);
    let (inputs, outputs): (Vec<Duty>, Vec<Filter>) = (good.inputs().collect(), good.outputs().collect());
    let of = |inputs: Vec<Duty>, outputs: Vec<Filter>| {
        let record = Experiment::new(&Converter, good.times().clone(), inputs, outputs).unwrap();
        let estimate = fit(&record);
        let copies = estimate.warnings.iter().filter(|warning| warning.code == WarningCode::IdenticalColumns);
        let texts: Vec<String> = copies.map(|warning| warning.text.clone()).collect();
        assert!(texts.is_empty() || estimate.severity() > Severity::Usable, "{estimate}");
        texts
    };
    let begins = |said: &[String], text: &str| said.len() == 1 && said[0].starts_with(text);
    assert_eq!(of(inputs.clone(), outputs.clone()), Vec::<String>::new());
    let twice = outputs.iter().map(|y| Filter { vc: y.il, ..*y }).collect();
    let said = of(inputs.clone(), twice);
    assert!(begins(&said, "the output `vc` is the output `il` sample by sample"), "{said:?}");
    let fed = inputs.iter().zip(&outputs).map(|(u, y)| Duty { iload: y.il, ..*u }).collect();
    let said = of(fed, outputs.clone());
    assert!(begins(&said, "the output `il` is the input `iload` sample by sample"), "{said:?}");
    let same = inputs.iter().map(|u| Duty { iload: u.d, ..*u }).collect();
    let said = of(same, outputs);
    assert!(begins(&said, "the input `iload` is the input `d` sample by sample"), "{said:?}");
}
