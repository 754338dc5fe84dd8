#![cfg(feature = "std")]
//! What contradicts a model although the errors are white over time: a curve that it leaves out, parts of a record that differ, and the
//! same behind a filter.

use crate::common::Noise;
use greybox::*;

signals! { pub struct Level { x: "1" } }
signals! { pub struct Drive { u: "1" } }
signals! { pub struct Map { a: "1", b: "1" } }

/// `x[k+1] = a x[k] + b u[k]`, measured.
#[derive(Clone)]
struct Lag;

impl Model for Lag {
    type State = Level;
    type Input = Drive;
    type Output = Level;
    type Parameters = Map;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Drive<S>, p: &Map<S>) -> Level<S> {
        Level { x: p.a * x.x + p.b * u.u }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Drive<S>, _p: &Map<S>) -> Level<S> {
        *x
    }
}

/// A record with inputs that are independent of each other, so that its errors are nearly white whatever the model misses: with the
/// square of the input times `curve`, and a gain `b` of its own in the second half. The noise grows with the level by `grows`.
fn record(seed: u64, curve: f64, second: f64, grows: f64) -> ExperimentOf<Lag> {
    delayed(seed, curve, second, grows, 0.0)
}

/// The same with a part of the input that acts two samples later.
fn delayed(seed: u64, curve: f64, second: f64, grows: f64, late: f64) -> ExperimentOf<Lag> {
    let mut noise = Noise(seed);
    let (mut x, mut inputs, mut outputs) = (0.0, vec![], vec![]);
    for k in 0..SAMPLES {
        let u = noise.gauss() + 1.0;
        inputs.push(Drive { u });
        outputs.push(Level { x: x + (0.2 + grows * f64::abs(x)) * noise.gauss() });
        let b = if k < SAMPLES / 2 { 1.0 } else { second };
        let before = inputs.get(k.wrapping_sub(2)).map_or(0.0, |before| before.u);
        x = 0.1 * x + b * u + curve * u * u + late * before;
    }
    Experiment::new(&Lag, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

const SAMPLES: usize = 1_000;

fn fit(record: &ExperimentOf<Lag>) -> Estimate<Lag> {
    Fit::new(&Lag, record).parameters(Map { a: free(0.3), b: free(0.8) }).run().unwrap()
}

fn severity(estimate: &Estimate<Lag>, code: WarningCode) -> Option<Severity> {
    estimate.warnings.iter().find(|warning| warning.code == code).map(|warning| warning.severity)
}

/// A curve that makes 3 % of what the output moves: its square adds `0.02^2 2 / 0.2^2 = 2 %` to the noise's variance, which correlations over
/// time do not show, but 1,000 errors times their predictions do.
#[test]
fn a_curve_left_out_is_said() {
    let mut colored = 0;
    for seed in 1..=10 {
        let estimate = fit(&record(seed, 0.05, 1.0, 0.0));
        assert_eq!(severity(&estimate, WarningCode::WrongShape), Some(Severity::UsableWithCare), "{estimate}");
        colored += usize::from(severity(&estimate, WarningCode::ColoredErrors).is_some());
    }
    assert!(colored <= 5, "{colored}");
}

/// A tenth of the input acts two samples later: a quarter of the errors' square, which is as white as the input and follows from it.
#[test]
fn a_delay_left_out_is_said() {
    for seed in 1..=10 {
        let estimate = fit(&delayed(seed, 0.0, 1.0, 0.1, 0.1));
        assert_eq!(severity(&estimate, WarningCode::WrongShape), Some(Severity::UsableWithCare), "{estimate}");
        let text = &estimate.warnings.iter().find(|warning| warning.code == WarningCode::WrongShape).unwrap().text;
        assert!(text.contains("from what the input `u` was at the samples before"), "{text}");
    }
}

/// The delay above, and the gain below, by a robust loss and by weights: the tests are those of the errors by their weights.
#[test]
fn a_loss_and_weights_hide_nothing() {
    for seed in 1..=5 {
        for (code, record) in [
            (WarningCode::WrongShape, delayed(seed, 0.0, 1.0, 0.1, 0.1)),
            (WarningCode::HalvesContradict, record(seed, 0.0, 1.1, 0.0)),
        ] {
            let fit = || Fit::new(&Lag, &record).parameters(Map { a: free(0.3), b: free(0.8) });
            for fit in [fit().loss(Huber::default()), fit().weighting(|_: &Sample<Lag>| 1.0)] {
                let estimate = fit.run().unwrap();
                assert_eq!(severity(&estimate, code), Some(Severity::UsableWithCare), "{estimate}");
            }
        }
    }
}

/// A gain that is 10 % larger in the second half.
#[test]
fn halves_that_differ_are_said() {
    for seed in 1..=10 {
        let estimate = fit(&record(seed, 0.0, 1.1, 0.0));
        assert_eq!(severity(&estimate, WarningCode::HalvesContradict), Some(Severity::UsableWithCare), "{estimate}");
        let warning = estimate.warnings.iter().find(|warning| warning.code == WarningCode::HalvesContradict).unwrap();
        let gains: Vec<f64> = warning.text.split(' ').filter_map(|word| word.parse().ok()).collect();
        // `b` is one +- its standard error by the first half, and the other +- its own by the second.
        let [one, first, other, second, ..] = gains[..] else { panic!("{}", warning.text) };
        assert!((one - 1.0).abs() < 4.0 * first && (other - 1.1).abs() < 4.0 * second, "{}", warning.text);
    }
}

/// Right models, with noise of one size and with noise that grows with the level: at the level of 1e-4 one of the 400 is a chance
/// of 4 %.
#[test]
fn right_models_are_not_contradicted() {
    let mut said = 0;
    for seed in 100..300 {
        for grows in [0.0, 0.2] {
            let estimate = fit(&record(seed, 0.0, 1.0, grows));
            let codes = [WarningCode::WrongShape, WarningCode::HalvesContradict, WarningCode::Outliers];
            said += codes.iter().filter(|code| severity(&estimate, **code) == Some(Severity::UsableWithCare)).count();
        }
    }
    assert!(said <= 1, "{said}");
}

signals! { pub struct Filtered { a: "1", b: "1", drift: "1", sensor: "1" } }

/// `x[k+1] = a x[k] + b u[k] + w`, measured with noise.
#[derive(Clone)]
struct Walk;

impl Model for Walk {
    type State = Level;
    type Input = Drive;
    type Output = Level;
    type Parameters = Filtered;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Drive<S>, p: &Filtered<S>) -> Level<S> {
        Level { x: p.a * x.x + p.b * u.u }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Drive<S>, p: &Filtered<S>) -> Level<S> {
        Level { x: p.drift }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Drive<S>, p: &Filtered<S>) -> Level<S> {
        Level { x: p.sensor }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Drive<S>, _p: &Filtered<S>) -> Level<S> {
        *x
    }
}

/// What a fit by a filter says with care or more, of a record whose measurements were edited.
fn filtered(seed: u64, edit: impl Fn(usize, f64, f64) -> f64) -> Vec<(WarningCode, Severity)> {
    let mut noise = Noise(seed);
    let (mut x, mut u, mut inputs, mut outputs) = (0.0, 0.0, vec![], vec![]);
    for k in 0..400 {
        if k % 10 == 0 {
            u = 2.0 * noise.uniform() - 1.0;
        }
        inputs.push(Drive { u });
        let y = x + 0.1 * noise.gauss();
        outputs.push(Level { x: edit(k, y, noise.uniform()) });
        x = 0.8 * x + 0.5 * u + 0.1 * noise.gauss();
    }
    let record = Experiment::new(&Walk, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let parameters = Filtered { a: free(0.6), b: free(0.3), drift: free(0.2).log(), sensor: free(0.2).log() };
    let estimate = Fit::new(&Walk, &record).parameters(parameters).predictor(Kalman).run().unwrap();
    let warnings = estimate.warnings.iter().map(|warning| (warning.code, warning.severity));
    warnings.filter(|(_, severity)| *severity > Severity::Usable).collect()
}

/// A sensor whose gain doubles at half, which a filter takes as more noise of both kinds; and one of twenty measurements far out.
#[test]
fn a_filter_does_not_hide_what_contradicts_it() {
    let says = |found: &[(WarningCode, Severity)], code| found.iter().any(|(said, _)| *said == code);
    let mut wrong = 0;
    for seed in 1..=20 {
        let doubled = filtered(seed, |k, y, _| if k < 200 { y } else { 2.0 * y });
        // In one record the level of the sensor goes to zero, whose estimate has no halves to compare.
        let unbounded = says(&doubled, WarningCode::UnboundedLikelihood);
        assert!(unbounded || says(&doubled, WarningCode::HalvesContradict), "{seed} {doubled:?}");
        let far = filtered(seed, |_, y, one| if one < 0.05 { y + 3.0 } else { y });
        assert!(says(&far, WarningCode::Outliers), "{seed} {far:?}");
        let good = filtered(seed, |_, y, _| y);
        wrong += usize::from(says(&good, WarningCode::HalvesContradict) || says(&good, WarningCode::Outliers));
    }
    assert_eq!(wrong, 0);
}

/// A plant whose gain changes by 25 % at a time that nothing says, and runs of two such plants that were joined, the second from another
/// state: named in nine of ten at least, of 20 each, with the values before and after.
#[test]
fn a_change_at_any_time_is_named() {
    let run = |seed: u64, joined: bool| {
        let mut noise = Noise(seed);
        let change = 250 + (500.0 * noise.uniform()) as usize;
        let (mut x, mut u, mut inputs, mut outputs) = (0.0, 0.0, vec![], vec![]);
        for k in 0..SAMPLES {
            if k % 25 == 0 {
                u = noise.gauss() + 1.0;
            }
            if joined && k == change {
                x = 10.0 * noise.gauss();
            }
            inputs.push(Drive { u });
            outputs.push(Level { x: x + 0.1 * noise.gauss() });
            x = 0.9 * x + u * if k < change { 1.0 } else { 1.25 };
        }
        let record = Experiment::new(&Lag, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        severity(&fit(&record), WarningCode::HalvesContradict).is_some()
    };
    for joined in [false, true] {
        let named = (1..=20).filter(|seed| run(*seed, joined)).count();
        assert!(named >= 18, "{joined}: {named} of 20");
    }
}
