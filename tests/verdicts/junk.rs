//! Records that no fit can make sense of, or whose fit misleads.

use crate::plants::*;
use crate::random::Random;
use greybox::Hold;
use greybox::WarningCode::{self, *};
use greybox::pmsm::Surface;

/// A kind of fault, and what is said of it with this seed.
pub struct Junk {
    pub name: &'static str,
    pub judged: fn(u64) -> Found,
    /// What must be named every time.
    pub named: Option<WarningCode>,
    /// Why it cannot be seen in principle, where that is so.
    pub unseen: Option<&'static str>,
}

const SAMPLES: usize = 400;
/// Noise, as a part of the standard deviation of each output.
const NOISE: f64 = 0.02;

/// A record of the plant of this number with a little noise, and what a fault makes of it.
fn spoiled(seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    spoil(plant(seed), seed, fault)
}

/// The same of a plant with two outputs.
fn spoiled_two(seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    spoil(plant_of_two(seed), seed, fault)
}

fn spoil(plant: Box<dyn Plant>, seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    let mut columns = plant.record(seed, SAMPLES).noisy(NOISE, 0.0, seed);
    fault(&mut columns, &mut Random(seed ^ 0xfa17));
    plant.fit(&columns, &How::default(), seed)
}

/// The record of one plant given to the model of another.
fn mistaken<A: greybox::Model, B: greybox::Model>(measured: Bench<A>, model: Bench<B>, seed: u64) -> Found {
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

fn sensors() -> Vec<Junk> {
    vec![
        named("dead sensors: all outputs zero", ConstantOutput, |s| {
            spoiled(s, |c, _| c.y.iter_mut().for_each(|y| y.fill(0.0)))
        }),
        named("stuck sensors: all outputs one", ConstantOutput, |s| {
            spoiled(s, |c, _| c.y.iter_mut().for_each(|y| y.fill(1.0)))
        }),
        named("one of two outputs dead", ConstantOutput, |s| spoiled_two(s, |c, _| c.y[(s % 2) as usize].fill(0.0))),
        named("outputs are white noise", Unexplained, |s| {
            spoiled(s, |c, r| c.y.iter_mut().flatten().for_each(|y| *y = r.normal()))
        }),
        seen("outputs are a random walk", |s| {
            spoiled(s, |c, r| {
                for y in &mut c.y {
                    let mut at = 0.0;
                    y.iter_mut().for_each(|y| {
                        at += r.normal();
                        *y = at;
                    });
                }
            })
        }),
        seen("outputs are a sine of their own", |s| {
            spoiled(s, |c, r| {
                for y in &mut c.y {
                    let (rate, sigma) = (0.02 + 0.1 * r.uniform(), deviation(y));
                    y.iter_mut()
                        .enumerate()
                        .for_each(|(k, y)| *y = sigma * ((rate * k as f64).sin() + 0.02 * r.normal()));
                }
            })
        }),
        seen("one of two outputs is noise", |s| {
            spoiled_two(s, |c, r| {
                let y = &mut c.y[(s % 2) as usize];
                let sigma = deviation(y);
                y.iter_mut().for_each(|y| *y = sigma * r.normal());
            })
        }),
        seen("sensor stuck for the last third", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let stuck = y[2 * SAMPLES / 3];
                    y[2 * SAMPLES / 3..].fill(stuck);
                }
            })
        }),
        named("sensor clipped to the middle half of its range", Clipped, |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let (low, high) = range(y);
                    let quarter = 0.25 * (high - low);
                    y.iter_mut().for_each(|y| *y = y.clamp(low + quarter, high - quarter));
                }
            })
        }),
        named("sensor of two values", CoarseOutput, |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let (middle, sigma) = (y.iter().sum::<f64>() / y.len() as f64, deviation(y));
                    y.iter_mut().for_each(|y| *y = middle + if *y > middle { sigma } else { -sigma });
                }
            })
        }),
        named("sentinels -999 in one of fifty samples", Sentinel, |s| {
            spoiled(s, |c, r| c.y.iter_mut().flatten().filter(|_| r.uniform() < 0.02).for_each(|y| *y = -999.0))
        }),
        named("a block of the outputs repeated", Repeated, |s| {
            spoiled(s, |c, _| c.y.iter_mut().for_each(|y| y.copy_within(50..200, 230)))
        }),
        seen("sensor rectified", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let middle = y.iter().sum::<f64>() / y.len() as f64;
                    y.iter_mut().for_each(|y| *y = middle + (*y - middle).abs());
                }
            })
        }),
        seen("drift as large as the signal", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let sigma = deviation(y);
                    y.iter_mut().enumerate().for_each(|(k, y)| *y += 3.0 * sigma * k as f64 / SAMPLES as f64);
                }
            })
        }),
        seen("hum of half the signal", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let sigma = deviation(y);
                    y.iter_mut().enumerate().for_each(|(k, y)| *y += 0.7 * sigma * (0.9 * k as f64).sin());
                }
            })
        }),
    ]
}

fn pairs() -> Vec<Junk> {
    vec![
        seen("outputs swapped", |s| spoiled_two(s, |c, _| c.y.swap(0, 1))),
        seen("one of two outputs with a gain of 1.25", |s| {
            spoiled_two(s, |c, _| c.y[(s % 2) as usize].iter_mut().for_each(|y| *y *= 1.25))
        }),
        seen("one of two outputs with the wrong sign", |s| {
            spoiled_two(s, |c, _| c.y[(s % 2) as usize].iter_mut().for_each(|y| *y = -*y))
        }),
        seen("one of two outputs ten samples late", |s| spoiled_two(s, |c, _| delayed(&mut c.y[..1], 10))),
        seen("inputs swapped", |s| {
            let plant = surface();
            let mut record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            record.u.swap(0, 1);
            plant.fit(&record, &How::default(), s)
        }),
    ]
}

fn inputs() -> Vec<Junk> {
    vec![
        seen("inputs shuffled", |s| spoiled(s, |c, r| c.u.iter_mut().for_each(|u| shuffle(u, r)))),
        seen("inputs of another record", |s| {
            let plant = plant(s);
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            plant.fit(&Columns { u: plant.inputs(s + 77, SAMPLES), ..record }, &How::default(), s)
        }),
        seen("inputs reversed in time", |s| spoiled(s, |c, _| c.u.iter_mut().for_each(|u| u.reverse()))),
        named("plant at rest, inputs zero", Unexplained, |s| {
            let plant = surface();
            let mut random = Random(s);
            let rest = Columns { step: 5e-4, times: None, u: vec![vec![0.0; SAMPLES]; 3], y: vec![] };
            let noise = |_| (0..SAMPLES).map(|_| 0.05 * random.normal()).collect();
            let y = (0..2).map(noise).collect();
            plant.fit(&Columns { y, ..rest }, &How::default(), s)
        }),
        named("constant input, plant at rest", HoldsZero, |s| {
            let plant = lag();
            let mut random = Random(s);
            let y = vec![(0..SAMPLES).map(|_| 0.1 * random.normal()).collect()];
            let rest = Columns { step: 0.05, times: None, u: vec![vec![0.7; SAMPLES]], y };
            plant.fit(&rest, &How::default(), s)
        }),
        seen("constant input, outputs noise about a level", |s| {
            let plant = lag();
            let mut random = Random(s);
            let y = vec![(0..SAMPLES).map(|_| 3.0 + 0.1 * random.normal()).collect()];
            let rest = Columns { step: 0.05, times: None, u: vec![vec![0.7; SAMPLES]], y };
            plant.fit(&rest, &How::default(), s)
        }),
        seen("inputs twenty samples late", |s| spoiled(s, |c, _| delayed(&mut c.u, 20))),
        named("inputs with noise of their own size", ColoredErrors, |s| {
            spoiled(s, |c, r| {
                for u in &mut c.u {
                    let sigma = deviation(u);
                    u.iter_mut().for_each(|u| *u += sigma * r.normal());
                }
            })
        }),
        seen("wrong sign of all inputs", |s| {
            spoiled(s + u64::from(s % 7 == 6 || s % 7 == 4), |c, _| c.u.iter_mut().flatten().for_each(|u| *u = -*u))
        }),
        named("sentinels 9999 in the inputs", Sentinel, |s| {
            spoiled(s, |c, _| c.u.iter_mut().flatten().step_by(90).for_each(|u| *u = 9999.0))
        }),
    ]
}

/// Records that are told to the fit otherwise than they were made.
fn told_wrong() -> Vec<Junk> {
    vec![
        seen("inputs limited, which the record does not say", |s| {
            let plant = plant(s);
            let u = plant.inputs(s, SAMPLES);
            let limited = |u: &Vec<f64>| {
                let (low, high) = range(u);
                let third = (high - low) / 3.0;
                u.iter().map(|u| u.clamp(low + third, high - third)).collect()
            };
            let record = plant.simulated(u.iter().map(limited).collect(), &plant.truth()).noisy(NOISE, 0.0, s);
            plant.fit(&Columns { u, ..record }, &How::default(), s)
        }),
        seen("hold of first order for one of zeroth", |s| {
            let record = lag().record(s, SAMPLES).noisy(NOISE, 0.0, s);
            Bench { hold: Hold::First, ..lag() }.fit(&record, &How::default(), s)
        }),
        seen("inputs half a sample late", |s| {
            let (plant, fine) = (lag(), Bench { step: 0.025, ..lag() });
            let u = plant.inputs(s, SAMPLES);
            let late = vec![(0..2 * SAMPLES).map(|k| u[0][k.saturating_sub(1) / 2]).collect()];
            let twice = fine.simulated(late, &fine.truth()).noisy(0.002, 0.0, s);
            let y = vec![twice.y[0].iter().step_by(2).copied().collect()];
            plant.fit(&Columns { step: plant.step, times: None, u, y }, &How::default(), s)
        }),
        seen("offset of the size of the signal", |s| {
            let plant = lag();
            let mut record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let sigma = deviation(&record.y[0]);
            record.y[0].iter_mut().for_each(|y| *y += sigma);
            plant.fit(&record, &How::default(), s)
        }),
        seen("wrong state given for the first sample", |s| {
            let record = oscillator().record(s, SAMPLES).noisy(NOISE, 0.0, s);
            Bench { initial: vec![0.8, -1.0], ..oscillator() }.fit(&record, &How::default(), s)
        }),
        named("start of the opposite sign, and so is the gain", SignChanged, |s| {
            let record = line().record(s, SAMPLES).noisy(NOISE, 0.0, s);
            line().fit(&record, &How { opposite: true, ..How::default() }, s)
        }),
        seen("unrelated output, predicted one step ahead", |s| {
            let plant = plant(if s % 2 == 0 { 0 } else { 1 });
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            record.y.iter_mut().flatten().for_each(|y| *y = random.normal());
            plant.fit(&record, &How { one_step: true, ..How::default() }, s)
        }),
        seen("unrelated output with a robust loss", |s| {
            let plant = plant(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            record.y.iter_mut().flatten().for_each(|y| *y = random.normal());
            plant.fit(&record, &How { robust: true, ..How::default() }, s)
        }),
        seen("static line of an unrelated input", |s| {
            let plant = line();
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            plant.fit(&Columns { u: plant.inputs(s + 5, SAMPLES), ..record }, &How::default(), s)
        }),
        named("static outputs that contradict each other", OutputsContradict, |s| {
            let mut record = plane().record(s, SAMPLES).noisy(NOISE, 0.0, s);
            record.y[0].iter_mut().for_each(|y| *y += 0.5);
            plane().fit(&record, &How::default(), s)
        }),
        seen("one sample in twenty an outlier, squared loss", |s| {
            spoiled(s, |c, r| {
                for y in &mut c.y {
                    let sigma = deviation(y);
                    y.iter_mut().for_each(|y| *y += if r.uniform() < 0.05 { 30.0 * sigma * r.normal() } else { 0.0 });
                }
            })
        }),
        named("noise a hundred times the signal", HoldsZero, |s| {
            let plant = plant(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(100.0, 0.0, s), &How::default(), s)
        }),
        seen("excitation of a hundredth of a step", |s| {
            let plant = Bench { drive: vec![(0.5, 0.0, 1)], ..lag() };
            let record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            let y = vec![record.y[0].iter().map(|_| 1.0 + 0.05 * random.normal()).collect()];
            let u = vec![(0..SAMPLES).map(|k| 0.5 + 1e-4 * (k as f64 * 0.3).sin()).collect()];
            plant.fit(&Columns { u, y, ..record }, &How::default(), s)
        }),
    ]
}

fn plants() -> Vec<Junk> {
    vec![
        seen("an oscillator taken for a lag", |s| mistaken(oscillator(), lag(), s)),
        seen("two masses taken for a tank", |s| mistaken(heated(), tank(), s)),
        seen("records of two plants joined", |s| {
            let plant = plant(s);
            let truth: Vec<f64> = plant.truth();
            let other: Vec<f64> = truth.iter().map(|p| p * 1.8).collect();
            let u = plant.inputs(s, SAMPLES);
            let (mut a, b) = (plant.simulated(u.clone(), &truth), plant.simulated(u, &other));
            for (a, b) in a.y.iter_mut().zip(&b.y) {
                a[SAMPLES / 2..].copy_from_slice(&b[SAMPLES / 2..]);
            }
            plant.fit(&a.noisy(NOISE, 0.0, s), &How::default(), s)
        }),
        seen("two records, one of another plant", |s| {
            let plant = plant(s);
            let other: Vec<f64> = plant.truth().iter().map(|p| p * 1.5).collect();
            let first = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let second = plant.simulated(plant.inputs(s + 1, SAMPLES), &other).noisy(NOISE, 0.0, s + 1);
            plant.fit_all(&[first, second], &How::default(), s)
        }),
        named("static curve taken for a line", WrongShape, |s| {
            let plant = line();
            let mut record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            record.y[0].iter_mut().zip(&record.u[0]).for_each(|(y, u)| *y += 0.3 * u * u);
            plant.fit(&record, &How::default(), s)
        }),
        seen("more unknowns than the record tells: three samples", |s| {
            spoiled(s, |c, _| c.u.iter_mut().chain(&mut c.y).for_each(|column| column.truncate(3)))
        }),
        // Not the recursion, to which time is nothing.
        seen("unit of time wrong by 1,000", |s| {
            spoil(if s % 7 == 5 { plant(0) } else { plant(s) }, s, |c, _| c.step *= 1e3)
        }),
        named("unit of the outputs wrong by 1,000", FarFromStart, |s| {
            // Only where a parameter scales all outputs.
            let plant = lag();
            let mut record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            record.y[0].iter_mut().for_each(|y| *y *= 1e3);
            plant.fit(&record, &How::default(), s)
        }),
        seen("aliasing: every fortieth sample of a fast plant", |s| {
            spoiled(s, |c, _| {
                let thin = |column: &mut Vec<f64>| *column = column.iter().step_by(40).copied().collect();
                c.u.iter_mut().chain(&mut c.y).for_each(thin);
                c.step *= 40.0;
            })
        }),
        named("given noise 1e9 times the errors", GivenNoise, |s| {
            let plant = plant(s);
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let sigma = record.y.iter().map(|y| 1e9 * deviation(y)).collect();
            plant.fit(&record, &How { noise: Some(sigma), ..How::default() }, s)
        }),
        named("given noise a hundredth of the errors", GivenNoise, |s| {
            let plant = plant(s);
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let sigma = record.y.iter().map(|y| 0.01 * NOISE * deviation(y)).collect();
            plant.fit(&record, &How { noise: Some(sigma), ..How::default() }, s)
        }),
        unseen("time scaled by a tenth", "time constants scale with it: another plant, right in itself", |s| {
            spoil(Box::new(lag()), s, |c, _| c.step *= 1.1)
        }),
        unseen("outputs scaled by a tenth", "the gain scales with them: another plant, right in itself", |s| {
            spoil(Box::new(lag()), s, |c, _| c.y[0].iter_mut().for_each(|y| *y *= 1.1))
        }),
        seen("wrong pole pairs", |s| {
            let plant = surface();
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let wrong = Bench { model: Surface::new(8).unwrap(), ..surface() };
            wrong.fit(&record, &How::default(), s)
        }),
    ]
}

/// All kinds.
pub fn all() -> Vec<Junk> {
    [sensors(), pairs(), inputs(), told_wrong(), plants()].into_iter().flatten().collect()
}
