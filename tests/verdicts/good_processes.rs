//! Good records of more plants, and of more conditions.

use crate::good::{Good, good, with};
use crate::plants::*;
use crate::processes::*;
use crate::random::Random;
use greybox::WarningCode::*;
use greybox::{Model, free};

const SAMPLES: usize = 400;

fn plain<M: Model + 'static>(plant: Bench<M>, part: f64, seed: u64) -> Found {
    plant.fit(&plant.record(seed, SAMPLES).noisy(part, 0.0, seed), &How::default(), seed)
}

fn few<M: Model + 'static>(plant: Bench<M>, samples: usize, part: f64, seed: u64) -> Found {
    plant.fit(&plant.record(seed, samples).first(samples).noisy(part, 0.0, seed), &How::default(), seed)
}

/// A plant by its number, edited after noise of 2 % was added.
fn edited(seed: u64, how: &How, edit: impl Fn(&mut Columns, &mut Random)) -> Found {
    let plant = process(seed);
    let mut columns = plant.record(seed, SAMPLES).noisy(0.02, 0.0, seed);
    edit(&mut columns, &mut Random(seed ^ 0xed17));
    plant.fit(&columns, how, seed)
}

fn models() -> Vec<Good> {
    vec![
        good("battery, overvoltage not measured", |s| plain(battery(), 0.02, s)),
        // From one start a search may end where the animals do not swing.
        good("predator and prey, from eight starts", |s| {
            let how = How { starts: 8, ..How::default() };
            predator_prey().fit(&predator_prey().record(s, SAMPLES).first(200).noisy(0.02, 0.0, s), &how, s)
        }),
        good("stirred reactor", |s| plain(reactor(), 0.02, s)),
        good("bicycle, slip not measured", |s| plain(bicycle(), 0.02, s)),
        good("active low-pass, slope not measured", |s| plain(low_pass(), 0.02, s)),
        good("pendulum, speed not measured", |s| plain(pendulum(), 0.02, s)),
        good("house, walls not measured", |s| plain(house(), 0.02, s)),
        good("logistic growth", |s| plain(logistic(), 0.02, s)),
        good("two tanks, upper level not measured", |s| plain(two_tanks(), 0.02, s)),
        // From one start in ten a search ends where the cells are washed out.
        good("chemostat, from eight starts", |s| {
            let how = How { starts: 8, ..How::default() };
            chemostat().fit(&chemostat().record(s, SAMPLES).noisy(0.02, 0.0, s), &how, s)
        }),
        good("drug in three compartments, one measured", |s| plain(compartments(), 0.02, s)),
        good("hydraulic piston", |s| plain(hydraulic(), 0.02, s)),
    ]
}

fn curves() -> Vec<Good> {
    vec![
        with("Michaelis-Menten, 12 points", &[CurvedInterval, HoldsZero], |s| few(michaelis_menten(), 12, 0.05, s)),
        good("Michaelis-Menten, 50 points", |s| few(michaelis_menten(), 50, 0.05, s)),
        good("sine, 60 samples", |s| few(sine(), 60, 0.05, s)),
        good("sine, 100 samples, 30 % noise", |s| few(sine(), 100, 0.3, s)),
        good("decay, 12 samples", |s| few(exponential(), 12, 0.01, s)),
        good("decay, 30 samples", |s| few(exponential(), 30, 0.02, s)),
        // A model without states, whose classical intervals are a third as wide as they should be.
        with("decay, noise of a tenth of the value", &[UnevenErrors], |s| {
            let plant = Bench { step: 0.02, ..exponential() };
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s ^ 0x9a);
            record.y[0].iter_mut().for_each(|y| *y += 0.1 * (*y - 0.49) * random.normal());
            plant.fit(&record, &How::default(), s)
        }),
        // Of an intercept of a few standard errors.
        with("line, 8 points", &[HoldsZero], |s| few(line(), 8, 0.1, s)),
        good("Michaelis-Menten, 10 points, 3 % noise", |s| few(michaelis_menten(), 10, 0.03, s)),
        good("logarithm of the parameters", |s| {
            let how = How { declare: Some(|_, p| p.log()), ..How::default() };
            michaelis_menten().fit(&michaelis_menten().record(s, 50).noisy(0.05, 0.0, s), &how, s)
        }),
    ]
}

fn conditions() -> Vec<Good> {
    vec![
        with("noise 0.1 %", &[CoarseStep], |s| {
            let plant = process(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(1e-3, 0.0, s), &How::default(), s)
        }),
        good("half of the measurements missing, the first, too", |s| {
            edited(s, &How::default(), |c, r| {
                for y in &mut c.y {
                    y.iter_mut().filter(|_| r.uniform() < 0.5).for_each(|y| *y = f64::NAN);
                    y[0] = f64::NAN;
                }
            })
        }),
        good("second output measured every tenth sample", |s| {
            let plant: Box<dyn Plant> = if s % 2 == 0 { Box::new(reactor()) } else { Box::new(heated()) };
            let mut columns = plant.record(s, SAMPLES).noisy(0.02, 0.0, s);
            columns.y[1].iter_mut().enumerate().filter(|(k, _)| k % 10 != 3).for_each(|(_, y)| *y = f64::NAN);
            plant.fit(&columns, &How::default(), s)
        }),
        good("irregular sampling of a dynamic plant", |s| {
            let (plant, mut random) = (process(s), Random(s));
            let step = plant.record(s, 2).step;
            let mut t = 0.0;
            let mut tick = || {
                t += step * (0.3 + 1.4 * random.uniform());
                t
            };
            let times: Vec<f64> = (0..SAMPLES).map(|_| tick()).collect();
            let record = plant.simulated_at(Some(times), plant.inputs(s, SAMPLES), &plant.truth());
            plant.fit(&record.noisy(0.02, 0.0, s), &How::default(), s)
        }),
        good("noise given, right", |s| {
            let plant = process(s);
            let record = plant.record(s, SAMPLES);
            let sigma = record.y.iter().map(|y| 0.05 * deviation(y)).collect();
            plant.fit(&record.noisy(0.05, 0.0, s), &How { noise: Some(sigma), ..How::default() }, s)
        }),
        good("outliers, robust loss", |s| {
            edited(s, &How { robust: true, ..How::default() }, |c, r| {
                for y in &mut c.y {
                    let sigma = deviation(y);
                    y.iter_mut().for_each(|y| *y += if r.uniform() < 0.02 { 0.4 * sigma } else { 0.0 });
                }
            })
        }),
        good("two records, one parameter of each its own", |s| {
            let plant = battery();
            let mut cold = plant.truth();
            cold[0] *= 1.7;
            let first = plant.record(s, SAMPLES).noisy(0.02, 0.0, s);
            let second = plant.simulated(plant.inputs(s + 50, SAMPLES), &cold).noisy(0.02, 0.0, s + 50);
            let declare = |i, p: greybox::Parameter| if i == 0 { p.per_experiment() } else { p };
            plant.fit_all(&[first, second], &How { declare: Some(declare), ..How::default() }, s)
        }),
        good("four short records", |s| {
            let plant = process(s);
            let record = |s: u64| plant.record(s, 120).first(120).noisy(0.02, 0.0, s);
            plant.fit_all(&[record(s), record(s + 10), record(s + 20), record(s + 30)], &How::default(), s)
        }),
        good("priors about the truth", |s| {
            let how = How { declare: Some(|_, p| free(p.start).prior(p.start, 0.5 * p.start.abs())), ..How::default() };
            edited(s, &how, |_, _| ())
        }),
        good("noise of Student's t with five degrees of freedom", |s| {
            let plant = process(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s ^ 0x57d);
            for y in &mut record.y {
                let sigma = 0.03 * deviation(y);
                y.iter_mut().for_each(|y| {
                    let chi: f64 = (0..5).map(|_| random.normal().powi(2)).sum();
                    *y += sigma * random.normal() / (chi / 5.0).sqrt();
                });
            }
            plant.fit(&record, &How::default(), s)
        }),
        with("colored noise of 5 %, correlation 0.8", &[ColoredErrors], |s| {
            let plant = process(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(0.05, 0.8, s), &How::default(), s)
        }),
        good("covariance of the noise estimated, outputs correlated", |s| {
            let plant = plant_of_two(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s ^ 0xc0);
            let sigma: Vec<f64> = record.y.iter().map(|y| 0.03 * deviation(y)).collect();
            for k in 0..SAMPLES {
                let common = random.normal();
                for (y, sigma) in record.y.iter_mut().zip(&sigma) {
                    y[k] += sigma * (0.8 * common + 0.6 * random.normal());
                }
            }
            plant.fit(&record, &How { covariance: true, ..How::default() }, s)
        }),
        good("positive parameters", |s| {
            edited(s, &How { declare: Some(|_, p| p.positive()), ..How::default() }, |_, _| ())
        }),
        good("20,000 samples", |s| {
            let plant = process([3, 4, 6][s as usize % 3]);
            plant.fit(&plant.record(s, 20_000).noisy(0.1, 0.0, s), &How::default(), s)
        }),
    ]
}

/// All kinds.
pub fn all() -> Vec<Good> {
    [models(), curves(), conditions()].into_iter().flatten().collect()
}
