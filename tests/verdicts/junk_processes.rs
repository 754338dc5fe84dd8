//! Faults in records of more plants.

use crate::junk::{Junk, delayed, named, range, seen, shuffle};
use crate::plants::*;
use crate::processes::*;
use crate::random::Random;
use greybox::Model;
use greybox::WarningCode::*;

const SAMPLES: usize = 400;
const NOISE: f64 = 0.02;

fn spoiled(seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    spoil(&*process(seed), seed, fault)
}

fn spoil(plant: &dyn Plant, seed: u64, fault: impl Fn(&mut Columns, &mut Random)) -> Found {
    let mut columns = plant.record(seed, SAMPLES).noisy(NOISE, 0.0, seed);
    fault(&mut columns, &mut Random(seed ^ 0xfa17));
    plant.fit(&columns, &How::default(), seed)
}

/// One with inputs.
fn driven(seed: u64) -> Box<dyn Plant> {
    process([0, 2, 3, 4, 6, 8][seed as usize % 6])
}

/// A static curve from a formula of its input (or time), instead of its own.
fn curve<M: Model + 'static>(
    plant: Bench<M>,
    samples: usize,
    seed: u64,
    formula: impl Fn(f64, f64, &mut Random) -> f64,
) -> Found {
    let mut columns = plant.record(seed, samples).first(samples);
    let mut random = Random(seed ^ 0xc0de);
    for k in 0..samples {
        columns.y[0][k] = formula(k as f64 * plant.step, columns.u.first().map_or(0.0, |u| u[k]), &mut random);
    }
    plant.fit(&columns, &How::default(), seed)
}

/// Plants of flows.
fn flow(number: u64) -> Box<dyn Plant> {
    match number % 3 {
        0 => Box::new(chemostat()),
        1 => Box::new(compartments()),
        _ => Box::new(hydraulic()),
    }
}

fn sensors() -> Vec<Junk> {
    vec![
        seen("processes: outputs are white noise", |s| {
            spoiled(s, |c, r| c.y.iter_mut().flatten().for_each(|y| *y = r.normal()))
        }),
        seen("processes: outputs are a random walk", |s| {
            spoiled(s, |c, r| {
                for y in &mut c.y {
                    let (mut at, sigma) = (y[0], deviation(y));
                    y.iter_mut().for_each(|y| {
                        at += 0.2 * sigma * r.normal();
                        *y = at;
                    });
                }
            })
        }),
        named("outliers of 20 sigma in one of fifty samples, squared loss", Outliers, |s| {
            spoiled(s, |c, r| {
                for y in &mut c.y {
                    let sigma = NOISE * deviation(y);
                    y.iter_mut().for_each(|y| *y += if r.uniform() < 0.02 { 20.0 * sigma } else { 0.0 });
                }
            })
        }),
        seen("sensor behind a slow filter", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let mut at = y[0];
                    y.iter_mut().for_each(|y| {
                        at += 0.08 * (*y - at);
                        *y = at;
                    });
                }
            })
        }),
        seen("sensor of the magnitude", |s| {
            spoil(&*process([4, 5][s as usize % 2]), s, |c, _| c.y.iter_mut().flatten().for_each(|y| *y = y.abs()))
        }),
        seen("sensor with a dead zone", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let (mean, sigma) = (y.iter().sum::<f64>() / y.len() as f64, deviation(y));
                    let dead = |y: f64| mean + (y - mean).signum() * ((y - mean).abs() - 0.6 * sigma).max(0.0);
                    y.iter_mut().for_each(|y| *y = dead(*y));
                }
            })
        }),
        seen("sensor limited to nine tenths of its range", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let (low, high) = range(y);
                    y.iter_mut().for_each(|y| *y = y.min(high - 0.2 * (high - low)));
                }
            })
        }),
        seen("unrelated random walk, predicted one step ahead", |s| {
            let plant: Box<dyn Plant> = if s % 2 == 0 { Box::new(lag()) } else { Box::new(tank()) };
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s ^ 0x3a1c);
            for y in &mut record.y {
                let (mut at, step) = (y[0], 0.1 * deviation(y));
                y.iter_mut().for_each(|y| {
                    at = (at + step * random.normal()).abs();
                    *y = at;
                });
            }
            plant.fit(&record, &How { one_step: true, ..How::default() }, s)
        }),
        seen("unrelated sine, predicted one step ahead", |s| {
            let plant: Box<dyn Plant> = if s % 2 == 0 { Box::new(lag()) } else { Box::new(tank()) };
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s ^ 0x51e);
            for y in &mut record.y {
                let (middle, rate) = (2.0 * deviation(y), 0.02 + 0.05 * random.uniform());
                let wave = |k: usize| middle * (1.5 + (rate * k as f64).sin());
                y.iter_mut().enumerate().for_each(|(k, y)| *y = wave(k) + 0.01 * middle * random.normal());
            }
            plant.fit(&record, &How { one_step: true, ..How::default() }, s)
        }),
        named("the same record twice", Repeated, |s| {
            let plant = process(s);
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            plant.fit_all(&[record.clone(), record], &How::default(), s)
        }),
        seen("measurements shuffled", |s| spoiled(s, |c, r| c.y.iter_mut().for_each(|y| shuffle(y, r)))),
    ]
}

fn inputs() -> Vec<Junk> {
    vec![
        seen("processes: inputs of another record", |s| {
            let plant = driven(s);
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            plant.fit(&Columns { u: plant.inputs(s + 31, SAMPLES), ..record }, &How::default(), s)
        }),
        seen("processes: inputs thirty samples late", |s| spoil(&*driven(s), s, |c, _| delayed(&mut c.u, 30))),
        seen("battery: current in milliampere", |s| {
            spoil(&battery(), s, |c, _| c.u[0].iter_mut().for_each(|u| *u *= 1e3))
        }),
        seen("chemostat, drug, piston: inputs twelve samples late", |s| {
            spoil(&*flow(s), s, |c, _| delayed(&mut c.u, 12))
        }),
        seen("chemostat, drug, piston: sensor behind a slow filter", |s| {
            spoil(&*flow(s), s, |c, _| {
                for y in &mut c.y {
                    let mut at = y[0];
                    y.iter_mut().for_each(|y| {
                        at += 0.1 * (*y - at);
                        *y = at;
                    });
                }
            })
        }),
        seen("bicycle: steering angle in degrees", |s| {
            spoil(&bicycle(), s, |c, _| c.u[0].iter_mut().for_each(|u| *u = u.to_degrees()))
        }),
        seen("house: sun through the windows, not recorded", |s| {
            let plant = house();
            let mut u = plant.inputs(s, SAMPLES);
            let sun = |k: usize| (5.0 * (k as f64 * 0.25 * std::f64::consts::TAU / 24.0).sin()).max(0.0);
            let recorded = u.clone();
            u[0].iter_mut().enumerate().for_each(|(k, u)| *u += sun(k));
            let record = plant.simulated(u, &plant.truth()).noisy(NOISE, 0.0, s);
            plant.fit(&Columns { u: recorded, ..record }, &How::default(), s)
        }),
        seen("reactor: temperatures in degrees Celsius", |s| {
            spoil(&reactor(), s, |c, _| {
                c.y[1].iter_mut().for_each(|y| *y -= 273.15);
                c.u[1].iter_mut().for_each(|u| *u -= 273.15);
            })
        }),
    ]
}

fn models() -> Vec<Junk> {
    vec![
        seen("predator and prey swapped", |s| spoil(&predator_prey(), s, |c, _| c.y.swap(0, 1))),
        seen("two decays taken for one, 60 samples", |s| {
            curve(exponential(), 60, s, |t, _, r| 2.0 * (-t / 0.6).exp() + 1.5 * (-t / 5.0).exp() + 0.02 * r.normal())
        }),
        seen("growth in a straight line taken for logistic growth", |s| {
            spoil(&logistic(), s, |c, r| {
                c.y[0].iter_mut().enumerate().for_each(|(k, y)| *y = 0.2 + 0.02 * k as f64 + 0.05 * r.normal())
            })
        }),
        seen("rate with inhibition taken for Michaelis-Menten", |s| {
            curve(michaelis_menten(), 50, s, |_, u, r| 2.0 * u / (0.7 + u + 0.8 * u * u) + 0.02 * r.normal())
        }),
        seen("Michaelis-Menten: noise", |s| curve(michaelis_menten(), 40, s, |_, _, r| 1.0 + 0.3 * r.normal())),
        seen("sine: noise", |s| curve(sine(), 200, s, |_, _, r| r.normal())),
        seen("sine: another frequency", |s| curve(sine(), 400, s, |t, _, r| (7.3 * t).sin() + 0.02 * r.normal())),
        seen("sine: two frequencies", |s| {
            curve(sine(), 400, s, |t, _, r| (2.0 * t).sin() + 0.5 * (3.1 * t).sin() + 0.02 * r.normal())
        }),
        seen("decay: noise", |s| curve(exponential(), 30, s, |_, _, r| r.normal())),
        seen("decay: as many samples as parameters", |s| curve(exponential(), 3, s, |t, _, _| (-t).exp())),
        seen("processes: the plant changes at half time", |s| {
            let plant = process(s);
            let truth = plant.truth();
            let other: Vec<f64> = truth.iter().map(|p| p * 1.5).collect();
            let u = plant.inputs(s, SAMPLES);
            let (mut a, b) = (plant.simulated(u.clone(), &truth), plant.simulated(u, &other));
            for (a, b) in a.y.iter_mut().zip(&b.y) {
                a[SAMPLES / 2..].copy_from_slice(&b[SAMPLES / 2..]);
            }
            plant.fit(&a.noisy(NOISE, 0.0, s), &How::default(), s)
        }),
        seen("processes: a pause that the times do not show", |s| {
            let plant = driven(s);
            let mut columns = plant.record(s, SAMPLES + 60).noisy(NOISE, 0.0, s);
            for column in columns.u.iter_mut().chain(&mut columns.y) {
                column.drain(200..260);
            }
            plant.fit(&columns, &How::default(), s)
        }),
    ]
}

/// All kinds.
pub fn all() -> Vec<Junk> {
    [sensors(), inputs(), models()].into_iter().flatten().collect()
}
