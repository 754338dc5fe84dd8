//! Faults of sensors.

use crate::junk::*;
use crate::plants::*;
use greybox::WarningCode::*;

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
        named("one measurement in ten is the one before, held", Frozen, |s| {
            spoil(Box::new(surface()), s, |c, r| {
                for y in &mut c.y {
                    (1..SAMPLES)
                        .filter(|_| r.uniform() < 0.1)
                        .collect::<Vec<_>>()
                        .into_iter()
                        .for_each(|k| y[k] = y[k - 1]);
                }
            })
        }),
        named("sensor that measures at each fourth sample", HeldOutput, |s| {
            spoiled(s, |c, _| c.y.iter_mut().for_each(|y| (0..SAMPLES).for_each(|k| y[k] = y[k - k % 4])))
        }),
        seen("sensor stuck for the second half", |s| {
            spoiled(s, |c, _| {
                for y in &mut c.y {
                    let stuck = y[SAMPLES / 2];
                    y[SAMPLES / 2..].fill(stuck);
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

/// All kinds.
pub fn all() -> Vec<Junk> {
    [sensors(), pairs()].into_iter().flatten().collect()
}
