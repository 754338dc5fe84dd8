//! Records that no fit can make sense of, or whose fit misleads.

use crate::plants::*;
use crate::random::Random;
use greybox::WarningCode;

/// A kind of fault, and what is said of it with this seed.
pub struct Junk {
    pub name: &'static str,
    pub judged: fn(u64) -> Found,
    /// What must be named every time.
    pub named: Option<WarningCode>,
    /// Why it cannot be seen in principle, where that is so.
    pub unseen: Option<&'static str>,
}

/// Samples of a record.
pub const SAMPLES: usize = 400;
/// Noise, as a part of the standard deviation of each output.
pub const NOISE: f64 = 0.02;

/// A record of the plant of this number with a little noise, and what a fault makes of it.
pub fn spoiled(seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    spoil(plant(seed), seed, fault)
}

/// The same of a plant with two outputs.
pub fn spoiled_two(seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    spoil(plant_of_two(seed), seed, fault)
}

pub fn spoil(plant: Box<dyn Plant>, seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    let mut columns = plant.record(seed, SAMPLES).noisy(NOISE, 0.0, seed);
    fault(&mut columns, &mut Random(seed ^ 0xfa17));
    plant.fit(&columns, &How::default(), seed)
}

/// The record of one plant given to the model of another.
pub fn mistaken<A: greybox::Model, B: greybox::Model>(measured: Bench<A>, model: Bench<B>, seed: u64) -> Found {
    let record = measured.record(seed, SAMPLES).noisy(NOISE, 0.0, seed);
    model.fit(&Columns { step: model.step, ..record }, &How::default(), seed)
}

pub fn shuffle(values: &mut [f64], random: &mut Random) {
    for k in (1..values.len()).rev() {
        values.swap(k, (random.uniform() * (k + 1) as f64) as usize);
    }
}

pub fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

/// Each column delayed by so many samples.
pub fn delayed(columns: &mut [Vec<f64>], by: usize) {
    for column in columns {
        let first = column[0];
        column.rotate_right(by);
        column[..by].fill(first);
    }
}

pub const fn seen(name: &'static str, judged: fn(u64) -> Found) -> Junk {
    Junk { name, judged, named: None, unseen: None }
}

/// A fault that is named every time.
pub const fn named(name: &'static str, code: WarningCode, judged: fn(u64) -> Found) -> Junk {
    Junk { name, judged, named: Some(code), unseen: None }
}

pub const fn unseen(name: &'static str, why: &'static str, judged: fn(u64) -> Found) -> Junk {
    Junk { name, judged, named: None, unseen: Some(why) }
}
