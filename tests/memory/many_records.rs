//! Records in one problem: the memory of steps, covariances and whole fits is linear in their number.

use crate::allocator::most_bytes;
use crate::common::{Coil, Current, Rl, Voltage};
use greybox::information::{Elimination, Information};
use greybox::{Experiment, ExperimentOf, Fit, Time, free};
use std::time::Instant;

const SHARED: usize = 3;
const OWN: usize = 2;

fn triangles(records: usize) -> Vec<Information> {
    let mut bits = 1u64;
    let mut next = || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut triangle = || {
        let mut triangle = Information::new(OWN + SHARED);
        (0..6).for_each(|_| triangle.absorb_row(&[next(), next(), next(), next(), next()], next()));
        triangle
    };
    (0..records).map(|_| triangle()).collect()
}

/// Bytes held at most by all that a fit asks of the tree, and a few of the answers.
fn work(records: usize) -> (isize, [f64; 4]) {
    let triangles = triangles(records);
    let n = SHARED + OWN * records;
    let begin = Instant::now();
    let (answers, most) = most_bytes(|| {
        let scores = triangles.clone();
        let tree = Elimination::of_records(SHARED, triangles);
        let damping: Vec<f64> = tree.column_norms().iter().map(|norm| 1e-3 * norm).collect();
        let step = tree.step_within(&damping, &[], &vec![(-0.5, 0.5); n]).expect("it is determined");
        let held = tree.undetermined(&[], 1e-11).held;
        let covariance = tree.covariance(&held).expect("it is determined");
        let sandwich = tree.sandwich(&held, &scores).expect("it is determined");
        let errors: f64 = (0..n).map(|i| covariance.standard_error(i)).sum();
        [step[0], errors / n as f64, covariance.get(n - 1, SHARED), sandwich.get(n - 1, SHARED)]
    });
    println!("{records} records: {:.2} s, {most} bytes, {answers:?}", begin.elapsed().as_secs_f64());
    (most, answers)
}

#[test]
fn memory_is_linear_in_the_records() {
    let records = if cfg!(debug_assertions) { 10_000 } else { 100_000 };
    let (few, _) = work(records / 10);
    let (many, [step, error, apart, sandwich]) = work(records);
    // The dense matrix of 20,003 unknowns would take 320,000 bytes a record.
    assert!(many < 4_000 * records as isize, "{many} bytes");
    assert!(many < 11 * few, "{few} and {many} bytes");
    assert!(step.abs() < 0.5 && error > 0.0);
    // Rows of unit weight are the scores of white errors: both covariances are the same to rounding.
    assert!(apart != 0.0 && (sandwich / apart - 1.0).abs() < 1e-9, "{apart} and {sandwich}");
}

/// Experiments of 50 samples, each with an initial current of its own.
fn coils(count: usize) -> Vec<ExperimentOf<Rl>> {
    let (Coil { r, l }, h) = (TRUTH, 1e-3);
    let mut bits = 1u64;
    let mut noise = move || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let one = |e: usize| {
        let mut i = noise();
        let (mut inputs, mut outputs) = (vec![], vec![]);
        for k in 0..50 {
            let u = if (k + e) % 20 < 10 { 10.0 } else { -4.0 };
            inputs.push(Voltage { u });
            outputs.push(Current { i: i + 0.05 * noise() });
            i = u / r + (i - u / r) * f64::exp(-h * r / l);
        }
        let time = Time::Uniform { start: 0.0, step: h };
        Experiment::new(&Rl, time, inputs, outputs).unwrap().initial(Current { i: free(0.0) })
    };
    (0..count).map(one).collect()
}

const TRUTH: Coil<f64> = Coil { r: 2.0, l: 0.02 };

/// Bytes held at most by the fit of so many experiments, with its conclusions.
fn fit(experiments: usize) -> isize {
    let experiments = coils(experiments);
    let work = || Fit::new(&Rl, &experiments).parameters(Coil { r: free(1.0), l: free(0.03) }).run().unwrap();
    let (estimate, most) = most_bytes(work);
    println!("{} experiments: {most} bytes\n{estimate}", experiments.len());
    assert!(estimate.outcome.converged());
    for (name, truth) in [("r", TRUTH.r), ("l", TRUTH.l)] {
        let (lower, upper) = estimate.interval(name, 0.999_9).unwrap();
        assert!(lower < truth && truth < upper, "{name}: {lower} {upper}");
    }
    // The errors are independent; what each record's own unknown leaves in them is no color (without the allowance for it
    // p = 1.3e-12 at 1,000 experiments).
    assert!(estimate.warnings.is_empty(), "{:?}", estimate.warnings);
    most
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow without optimization")]
fn a_fit_of_thousands_of_experiments_is_linear_in_their_number() {
    let (few, many) = (fit(1_000), fit(8_000));
    // The dense matrix of 8,002 unknowns would take 64,000 bytes an experiment.
    assert!(many < 16_000 * 8_000, "{many} bytes");
    assert!(many < 9 * few, "{few} and {many} bytes");
}
