//! The test of process noise: its numbers against fits without, its level where there is none, its power where there is, and what it refuses.

use crate::common::Noise;
use crate::walls;
use greybox::diagnose::{ProcessNoise, process_noise};
use greybox::predict::GivenNoise;
use greybox::*;

signals! { pub struct Pair { a: "V", b: "V" } }
signals! { pub struct Drive { u: "V" } }
signals! { pub struct Parts { decay: "1", q: "V", s: "V", r: "V" } }

/// Two decays, each disturbed by its own noise and measured.
#[derive(Clone)]
struct Drifting;

impl Model for Drifting {
    type State = Pair;
    type Input = Drive;
    type Output = Pair;
    type Parameters = Parts;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Pair<S>, u: &Drive<S>, p: &Parts<S>) -> Pair<S> {
        Pair { a: p.decay * x.a + u.u, b: p.decay * x.b - u.u }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Pair<S>, _u: &Drive<S>, _p: &Parts<S>) -> Pair<S> {
        *x
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Pair<S>, _u: &Drive<S>, p: &Parts<S>) -> Pair<S> {
        Pair { a: p.q, b: p.s }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Pair<S>, _u: &Drive<S>, p: &Parts<S>) -> Pair<S> {
        Pair { a: p.r, b: p.r }
    }
}

/// A record with these levels of process noise, and a noise of 0.3 V.
fn drifting(samples: usize, levels: [f64; 2], noise: &mut Noise) -> ExperimentOf<Drifting> {
    let p = Parts { decay: 0.9, q: levels[0], s: levels[1], r: 0.3 };
    let (mut x, mut inputs, mut outputs) = (Pair { a: 0.0, b: 0.0 }, vec![], vec![]);
    for k in 0..samples {
        let u = Drive { u: [1.0, -1.0, 0.3][k / 9 % 3] };
        outputs.push(Pair { a: x.a + p.r * noise.gauss(), b: x.b + p.r * noise.gauss() });
        inputs.push(u);
        x = Drifting.next(0.0, &x, &u, &p);
        (x.a, x.b) = (x.a + p.q * noise.gauss(), x.b + p.s * noise.gauss());
    }
    let record = Experiment::new(&Drifting, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    record.initial(Pair { a: fixed(0.0), b: fixed(0.0) })
}

fn start() -> Parts<Parameter> {
    let level = || free(0.3).log();
    Parts { decay: free(0.8), q: level(), s: level(), r: level() }
}

fn tested(record: &ExperimentOf<Drifting>, parameters: Parts<Parameter>) -> ProcessNoise {
    let problem = Fit::new(&Drifting, record).parameters(parameters).predictor(Kalman).problem().unwrap();
    process_noise(&problem, &problem.run().unwrap()).unwrap()
}

/// The ratio is the difference to a fit whose levels are given as zero, and to one of the simulation whose outputs have one noise. Both by
/// other programs; likelihoods of some hundreds have twelve digits, and searches end within 1e-8 of a standard error.
#[test]
fn the_ratio_is_that_of_fits_without() {
    let record = drifting(120, [0.15, 0.0], &mut Noise(3));
    let found = tested(&record, start());
    let deviance = |q: Parameter, s: Parameter| {
        let fit = Fit::new(&Drifting, &record).parameters(Parts { q, s, ..start() }).predictor(Kalman);
        fit.run().unwrap().deviance.unwrap()
    };
    let full = deviance(free(0.3).log(), free(0.3).log());
    let without = deviance(fixed(0.0), fixed(0.0));
    assert!((found.likelihood_ratio - (without - full)).abs() < 1e-7, "{found:?} {}", without - full);
    // n ln(2 pi r^2) + n with the mean square r^2 of both residuals.
    let simulated = Fit::new(&Drifting, &record)
        .parameters(Parts { q: fixed(0.0), s: fixed(0.0), r: fixed(0.3), decay: free(0.8) })
        .noise(Pair { a: 0.3, b: 0.3 })
        .run()
        .unwrap();
    let square = simulated.outputs.iter().map(|output| output.fit.rmse.powi(2)).sum::<f64>() / 2.0;
    let by_hand = 240.0 * ((core::f64::consts::TAU * square).ln() + 1.0);
    assert!((without - by_hand).abs() < 1e-7, "{without} {by_hand}");
    assert_eq!((&found.levels[..], found.degrees_of_freedom), (&["q".to_owned(), "s".to_owned()][..], 2));
    // One level in two states is one, and a level that stays zero does not count.
    let one = tested(&record, Parts { s: fixed(0.0), ..start() });
    assert_eq!((one.degrees_of_freedom, one.levels), (1, vec!["q".to_owned()]));
    assert!(one.likelihood_ratio <= found.likelihood_ratio + 1e-7);
    let record = walls::record::<true>(Time::Uniform { start: 0.0, step: walls::STEP }, 60);
    let building = walls::Building { p0: fixed(0.5), ..walls::start() };
    let problem = Fit::new(&walls::Heated::<true>, &record).parameters(building).predictor(Kalman).problem().unwrap();
    assert_eq!(process_noise(&problem, &problem.run().unwrap()).unwrap().degrees_of_freedom, 1);
}

/// Without process noise, of one level and of two: p < 0.05 in no more of 200 records than 5 % and three binomial deviations, and zero ratios as
/// often as the mixture has them, or as records of 80 samples have them. With process noise of a third of the noise it is rejected at 1 % in each of 20.
#[test]
fn it_keeps_its_level_and_sees_noise() {
    const RECORDS: usize = 200;
    let mut noise = Noise(17);
    for (parameters, levels) in [(Parts { s: fixed(0.0), ..start() }, 1), (start(), 2)] {
        let found: Vec<ProcessNoise> =
            (0..RECORDS).map(|_| tested(&drifting(80, [0.0; 2], &mut noise), parameters)).collect();
        let share =
            |of: &dyn Fn(&ProcessNoise) -> bool| found.iter().filter(|found| of(found)).count() as f64 / RECORDS as f64;
        let (rejected, zero) = (share(&|found| found.p_value < 0.05), share(&|found| found.likelihood_ratio < 1e-4));
        println!("{levels}: p < 0.05 in {rejected}, zero in {zero}");
        let deviations = |p: f64| (p * (1.0 - p) / RECORDS as f64).sqrt();
        assert!(rejected <= 0.05 + 3.0 * deviations(0.05), "{levels}: {rejected}");
        assert!(rejected > 0.0, "{levels}: a test that never rejects has no level");
        // Of one level a half for long records; of 80 samples with all but the level known, 0.595 (20,000 records, by a filter written elsewhere).
        let (least, most) = (0.5f64.powi(levels), 0.65f64.powi(levels));
        assert!(zero > least - 3.0 * deviations(least) && zero < most + 3.0 * deviations(most), "{levels}: {zero}");
        assert!(found.iter().all(|found| found.degrees_of_freedom == levels as u64));
    }
    for _ in 0..20 {
        let found = tested(&drifting(200, [0.1, 0.1], &mut noise), start());
        assert!(found.p_value < 0.01, "{found:?}");
    }
}

/// A model without types gives the same; each refusal has its type and names what is wrong.
#[test]
fn untyped_fits_and_refusals() {
    let record = drifting(150, [0.2, 0.1], &mut Noise(5));
    let equations = equations::Equations::trace(&Drifting).unwrap();
    let Parts { decay, q, s, r } = start();
    let untyped = Fit::new(&equations, record.record()).parameters(vec![decay, q, s, r]).predictor(Kalman);
    let untyped = untyped.problem().unwrap();
    let found = process_noise(&untyped, &untyped.run().unwrap()).unwrap();
    assert_eq!(found, tested(&record, start()));
    let refused = |problem: Result<Problem<'_>, Error>| {
        let problem = problem.unwrap();
        process_noise(&problem, &problem.run().unwrap()).unwrap_err()
    };
    let fit = |parameters| Fit::new(&Drifting, &record).parameters(parameters);
    let noise = GivenNoise { states: vec![0.2; 2], outputs: vec![0.3; 2] };
    let given = Parts { s: fixed(0.1), ..start() };
    let all_given = Parts { q: fixed(0.0), s: fixed(0.0), ..start() };
    for (problem, word) in [
        (fit(start()).problem(), "simulation"),
        (fit(start()).predictor(noise).problem(), "does not take its diffusion"),
        (fit(given).predictor(Kalman).problem(), "diffusion of `b`"),
        (fit(all_given).predictor(Kalman).problem(), "given as zero"),
    ] {
        let error = refused(problem);
        assert!(matches!(error, Error::NotDisturbed { .. }) && error.to_string().contains(word), "{error}");
    }
    let still = Fit::new(&Still, &still())
        .parameters(Rest { x: free(1.0), r: free(1.0).log() })
        .predictor(Kalman)
        .problem()
        .map(|problem| process_noise(&problem, &problem.run().unwrap()).unwrap_err());
    assert!(matches!(still.unwrap(), Error::NotDisturbed { reason } if reason.contains("the model has none")));
    let robust = refused(fit(start()).predictor(Kalman).loss(loss::Huber::default()).problem());
    assert!(robust.to_string().contains("no likelihood"), "{robust}");
    // At another point than the maximum, a fit without noise is better: of a record without.
    let record = drifting(150, [0.0; 2], &mut Noise(6));
    let problem = Fit::new(&Drifting, &record).parameters(start()).predictor(Kalman).problem().unwrap();
    let off = problem.estimate(&[0.9, 0.0, 0.0, 0.3f64.ln()]).unwrap();
    let error = process_noise(&problem, &off).unwrap_err();
    assert!(error.to_string().contains("no maximum of the likelihood"), "{error}");
}

signals! { pub struct Rest { x: "V", r: "V" } }
signals! { pub struct Value { y: "V" } }

/// A constant, measured.
#[derive(Clone)]
struct Still;

impl Model for Still {
    type State = Value;
    type Input = Nothing;
    type Output = Value;
    type Parameters = Rest;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Value<S>, _u: &Nothing, _p: &Rest<S>) -> Value<S> {
        *x
    }
    fn output<S: Scalar>(&self, _t: S, x: &Value<S>, _u: &Nothing, p: &Rest<S>) -> Value<S> {
        Value { y: x.y + p.x }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Value<S>, _u: &Nothing, p: &Rest<S>) -> Value<S> {
        Value { y: p.r }
    }
}

fn still() -> ExperimentOf<Still> {
    let outputs = (0..50).map(|k| Value { y: 2.0 + 0.1 * (2.4 * f64::from(k)).sin() }).collect();
    let record = Experiment::new(&Still, Time::Uniform { start: 0.0, step: 1.0 }, vec![Nothing; 50], outputs).unwrap();
    record.initial(Value { y: fixed(0.0) })
}

/// The report of a filter says it in a sentence, where the fit without took no more steps; a simulation has no such section.
#[test]
fn a_report_says_it() {
    let record = drifting(150, [0.2, 0.1], &mut Noise(5));
    let fit = || Fit::new(&Drifting, &record).parameters(start());
    let problem = fit().predictor(Kalman).problem().unwrap();
    let estimate = problem.run().unwrap();
    let report = Report::new(&problem, &estimate).unwrap();
    let found = process_noise(&problem, &estimate).unwrap();
    let section = report.sections.iter().find(|section| section.id == "process-noise").expect("a section");
    assert!(
        section.sentences[0].contains("(`q`, `s` zero)") && section.sentences[0].contains("the plant is disturbed")
    );
    // Said once, also where it is added.
    let again = report.clone().with(&found);
    let said = again.sections.iter().filter(|section| section.id == "process-noise");
    assert_eq!(said.map(|section| section.sentences.len()).sum::<usize>(), 1);
    let problem = fit().problem().unwrap();
    let report = Report::new(&problem, &problem.run().unwrap()).unwrap();
    assert!(report.sections.iter().all(|section| section.id != "process-noise"));
}
