//! How often the comparisons of outputs and of halves, and the test of a given noise, are wrong about good records.

use crate::plants::*;
use greybox::WarningCode::{self, *};
use rayon::prelude::*;

/// Of so many records, those of which one of the codes is said with care.
fn said(records: u64, codes: &[WarningCode], judged: impl Fn(u64) -> Found + Sync) -> usize {
    let says = |seed: &u64| judged(*seed).codes.iter().any(|code| codes.contains(code));
    (1000..1000 + records).into_par_iter().filter(says).count()
}

/// At the level of 1e-4, 500 records give 0.05 false alarms; two would be one chance in a thousand.
#[test]
fn outputs_of_one_plant_do_not_contradict_each_other() {
    let judged = |seed| {
        let plant = plane();
        plant.fit(&plant.record(seed, 200).noisy(0.2, 0.0, seed), &How::default(), seed)
    };
    assert!(said(500, &[OutputsContradict, SensorContradicts], judged) <= 1);
}

/// Noise that is correlated over time counts for fewer measurements, and raises no alarm either.
#[test]
fn colored_noise_is_no_contradiction() {
    let judged = |seed| {
        let plant = surface();
        plant.fit(&plant.record(seed, 300).noisy(0.1, 0.8, seed), &How::default(), seed)
    };
    assert!(said(100, &[OutputsContradict, HalvesContradict, SensorContradicts], judged) <= 1);
}

/// The right noise is not contradicted; one of two fifths or of two and a half times it is, every time.
#[test]
fn a_given_noise_is_tested() {
    let fit = |seed, factor| {
        let plant = line();
        let record = plant.record(seed, 200);
        let sigma = record.y.iter().map(|y| factor * 0.1 * deviation(y)).collect();
        plant.fit(&record.noisy(0.1, 0.0, seed), &How { noise: Some(sigma), ..How::default() }, seed)
    };
    assert_eq!(said(200, &[GivenNoise], |seed| fit(seed, 1.0)), 0);
    assert_eq!(said(200, &[GivenNoise], |seed| fit(seed, 0.4)), 200);
    assert_eq!(said(200, &[GivenNoise], |seed| fit(seed, 2.5)), 200);
}
