//! Numbers and words of identifiability, of models whose sensitivities are known by hand.

use crate::random::Random;
use greybox::diagnose::{Identifiability, identifiability};
use greybox::{Experiment, Fit, Kind, Model, Nothing, Parameter, Scalar, Time, fixed, free, signals};

signals! { struct Drive { u: "V", w: "V" } }
signals! { struct Reading { y: "V", z: "V" } }
signals! { struct Four { a: "V", b: "V", c: "ohm", d: "V" } }

/// How the parameters come together.
#[derive(Clone, Copy)]
enum Form {
    /// `y = a u + b w`, `z = b u + a w`.
    Apart,
    /// `y = (a + b) u`, `z = c w`.
    Sum,
    /// `y = a / c u`, `z = b w`.
    Ratio,
    /// `y = (a + b) u`, `z = (a + d) w`.
    Shift,
    /// `y = (a + b) u`, `z = (d - a) w`.
    Turned,
    /// `y = (a - 2 c) u`, `z = b w`.
    Mixed,
    /// `y = a u + b (u + w / 100)`.
    Alike,
    /// `y = a u + b w`, `z = b`.
    Moment,
}

#[derive(Clone)]
struct Joined(Form);

impl Model for Joined {
    type State = Nothing;
    type Input = Drive;
    type Output = Reading;
    type Parameters = Four;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Drive<S>, p: &Four<S>) -> Reading<S> {
        match self.0 {
            Form::Apart => Reading { y: p.a * u.u + p.b * u.w, z: p.b * u.u + p.a * u.w },
            Form::Sum => Reading { y: (p.a + p.b) * u.u, z: p.c * u.w },
            Form::Ratio => Reading { y: p.a / p.c * u.u, z: p.b * u.w },
            Form::Shift => Reading { y: (p.a + p.b) * u.u, z: (p.a + p.d) * u.w },
            Form::Turned => Reading { y: (p.a + p.b) * u.u, z: (p.d - p.a) * u.w },
            Form::Mixed => Reading { y: (p.a - p.c * 2.0) * u.u, z: p.b * u.w },
            Form::Alike => Reading { y: p.a * u.u + p.b * (u.u + u.w * 0.01), z: p.c * u.w },
            Form::Moment => Reading { y: p.a * u.u + p.b * u.w, z: p.b + u.u * 0.0 },
        }
    }
}

const SIGMA: Reading = Reading { y: 0.5, z: 0.25 };

fn found(form: Form, parameters: Four<Parameter>, samples: usize, drive: impl Fn(usize) -> Drive) -> Identifiability {
    let model = Joined(form);
    let mut random = Random(17);
    let truth = Four { a: 2.0, b: 1.0, c: 2.0, d: 4.0 };
    let inputs: Vec<Drive> = (0..samples).map(drive).collect();
    let outputs = inputs.iter().map(|u| {
        let y = model.output(0.0, &Nothing, u, &truth);
        Reading { y: y.y + 1e-3 * random.normal(), z: y.z + 1e-3 * random.normal() }
    });
    let outputs = outputs.collect();
    let record = Experiment::new(&model, Time::Uniform { start: 5.0, step: 0.1 }, inputs, outputs).unwrap();
    let record = record.named("run");
    let problem = Fit::new(&model, &record).parameters(parameters).noise(SIGMA).problem().unwrap();
    let estimate = problem.run().unwrap();
    identifiability(&problem, &estimate).unwrap()
}

fn moving(k: usize) -> Drive {
    Drive { u: (0.7 * k as f64).sin(), w: (1.9 * k as f64).cos() * (1.0 + k as f64 / 3000.0) }
}

fn held() -> Four<Parameter> {
    Four { a: fixed(2.0), b: fixed(1.0), c: fixed(2.0), d: fixed(4.0) }
}

/// The change of the outputs in standard deviations of their noise by a relative change of one, also of a logarithm; its parts
/// by output and by tenth of the record.
#[test]
fn excitation_is_the_sum_of_squares() {
    let parameters = Four { a: free(1.5), b: free(1.5).log(), ..held() };
    let found = found(Form::Apart, parameters, 5000, moving);
    let (u, w) = (|k: usize| (moving(k).u / SIGMA.y).powi(2), |k: usize| (moving(k).w / SIGMA.z).powi(2));
    let (uz, wy) = (|k: usize| (moving(k).u / SIGMA.z).powi(2), |k: usize| (moving(k).w / SIGMA.y).powi(2));
    let sum = |f: &dyn Fn(usize) -> f64, from: usize, to: usize| (from..to).map(f).sum::<f64>();
    type Term<'t> = &'t dyn Fn(usize) -> f64;
    let cases: [(f64, Term<'_>, Term<'_>); 2] = [(2.0, &u, &w), (1.0, &wy, &uz)];
    for (excited, (value, by_y, by_z)) in found.excitation.iter().zip(cases) {
        let (y, z) = (sum(by_y, 0, 5000), sum(by_z, 0, 5000));
        // Estimates are off by 1e-3 / sqrt(5000).
        assert!((excited.strength / (value * (y + z).sqrt()) - 1.0).abs() < 1e-4, "{excited:?}");
        assert!((excited.outputs[0].1 - y / (y + z)).abs() < 1e-9 && (excited.outputs[1].1 - z / (y + z)).abs() < 1e-9);
        assert_eq!(excited.segments.len(), 10);
        for (s, segment) in excited.segments.iter().enumerate() {
            let (from, to) = (500 * s, 500 * (s + 1));
            let expected = (sum(by_y, from, to) + sum(by_z, from, to)) / (y + z);
            assert!((segment.share - expected).abs() < 1e-9, "{s}: {segment:?} {expected}");
            assert!((segment.from - (5.0 + 0.1 * from as f64)).abs() < 1e-9, "{segment:?}");
        }
    }
    assert_eq!((found.rank, found.generic_rank, found.advice.len()), (2, 2, 0), "{:?}", found.advice);
}

/// A sum, a ratio (of two values of one size in different units), a common shift of three in either direction, and two that are
/// nearly the same, each in its words.
#[test]
fn what_is_known_together_is_named() {
    let says = |form: Form, parameters: Four<Parameter>, parts: &[&str]| {
        let found = found(form, parameters, 200, moving);
        println!("{:#?}", found.advice);
        let all = |advice: &String| parts.iter().all(|part| advice.contains(part));
        assert!(found.advice.iter().any(all), "{parts:?}: {:#?}", found.advice);
        found
    };
    let sum = Four { a: free(1.7), b: free(1.3), ..held() };
    let together =
        says(Form::Sum, sum, &["are known only as their sum: ", "+1 V", "−1 V", "together change no prediction"]);
    assert!(together.advice[0].contains("have rank 1: with these inputs"), "{:?}", together.advice);
    assert!(together.advice[0].contains("fix 1 of them"), "{:?}", together.advice);
    let ratio = Four { a: free(2.0), c: free(2.0), ..held() };
    says(Form::Ratio, ratio, &["are known only as their ratio: ", "`a` +1 %", "`c` +1 %"]);
    // Both rise, by unequal parts of themselves: no ratio.
    let mixed = Four { a: free(2.0), c: free(2.0), ..held() };
    says(Form::Mixed, mixed, &["are known only together: ", "`a` +1 %", "`c` +0.5 %"]);
    let shift = Four { a: free(2.2), b: free(1.1), d: free(3.9), ..held() };
    for form in [Form::Shift, Form::Turned] {
        says(form, shift, &["`a`", "`b`", "`d`", "are known only up to a common shift: "]);
    }
    let alike =
        says(Form::Alike, Four { a: free(1.9), b: free(1.1), ..held() }, &["are hardly known but", "alone would"]);
    assert!(alike.collinear[0].index.is_some_and(|index| index > 100.0), "{:?}", alike.collinear);
}

/// What moves the outputs in the third tenth alone is known from there, 2 s after the record's begin.
#[test]
fn a_moment_that_tells_all_is_named() {
    let drive = |k: usize| Drive { u: if (20..30).contains(&k) { 1.0 } else { 0.0 }, ..moving(k) };
    let found = found(Form::Moment, Four { a: free(1.0), b: free(0.5), ..held() }, 100, drive);
    let says = |text: &str| found.advice.iter().any(|advice| advice.starts_with(text));
    assert!(says("`a` is known from one tenth of `run` alone, 2 s after its start (100 %)"), "{:#?}", found.advice);
    assert!(!says("`b`"), "{:#?}", found.advice);
}
