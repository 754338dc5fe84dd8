//! Records that are as a fit wants them.

use crate::plants::*;
use crate::random::Random;
use greybox::WarningCode::{self, *};
use greybox::models::Positioning;
use greybox::pmsm::{ExactStep, ExactSurface, HeldIn, Salient};
use greybox::{Hold, Model};

/// A kind of good record, and what is said of it with this seed.
pub struct Good {
    pub name: &'static str,
    pub judged: fn(u64) -> Found,
    /// What is true of it, and may therefore be said with care.
    pub may: &'static [WarningCode],
}

const SAMPLES: usize = 500;

pub const fn good(name: &'static str, judged: fn(u64) -> Found) -> Good {
    Good { name, judged, may: &[] }
}

pub const fn with(name: &'static str, may: &'static [WarningCode], judged: fn(u64) -> Found) -> Good {
    Good { name, judged, may }
}

pub fn noisy(plant: &dyn Plant, samples: usize, part: f64, seed: u64) -> Found {
    plant.fit(&plant.record(seed, samples).noisy(part, 0.0, seed), &How::default(), seed)
}

/// A plant by its number, edited after noise of 2 % was added.
fn edited(seed: u64, how: &How, edit: impl Fn(&mut Columns, &mut Random)) -> Found {
    let plant = plant(seed);
    let mut columns = plant.record(seed, SAMPLES).noisy(0.02, 0.0, seed);
    edit(&mut columns, &mut Random(seed ^ 0xed17));
    plant.fit(&columns, how, seed)
}

fn sizes() -> Vec<Good> {
    vec![
        // The default step is the larger error here.
        with("no noise", &[CoarseStep, CurvedInterval], |s| noisy(&*plant(s), SAMPLES, 0.0, s)),
        with("noise 0.01 %", &[CoarseStep], |s| noisy(&*plant(s), SAMPLES, 1e-4, s)),
        good("noise 0.1 %", |s| noisy(&*plant(s), SAMPLES, 1e-3, s)),
        good("noise 1 %", |s| noisy(&*plant(s), SAMPLES, 1e-2, s)),
        good("noise 10 %", |s| noisy(&*plant(s), SAMPLES, 0.1, s)),
        // Of a friction that is small anyway.
        with("noise 30 %", &[HoldsZero, CurvedInterval], |s| noisy(&*plant(s), SAMPLES, 0.3, s)),
        good("80 samples", |s| noisy(&*plant(s), 80, 0.02, s)),
        good("200 samples", |s| noisy(&*plant(s), 200, 0.02, s)),
        good("5,000 samples", |s| noisy(&*plant(s), 5000, 0.02, s)),
    ]
}

fn noises() -> Vec<Good> {
    vec![
        with("colored noise of 2 %, correlation 0.5", &[ColoredErrors], |s| {
            let plant = plant(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(0.02, 0.5, s), &How::default(), s)
        }),
        with("colored noise of 5 %, correlation 0.9", &[ColoredErrors], |s| {
            let plant = plant(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(0.05, 0.9, s), &How::default(), s)
        }),
        with("colored noise of 30 %, correlation 0.7", &[ColoredErrors, HoldsZero, CurvedInterval], |s| {
            let plant = plant(s);
            plant.fit(&plant.record(s, SAMPLES).noisy(0.3, 0.7, s), &How::default(), s)
        }),
        good("given noise, right", |s| {
            let plant = plant(s);
            let record = plant.record(s, SAMPLES);
            let sigma = record.y.iter().map(|y| 0.02 * deviation(y)).collect();
            plant.fit(&record.noisy(0.02, 0.0, s), &How { noise: Some(sigma), ..How::default() }, s)
        }),
        good("two outputs with one noise", |s| {
            let plant = plant_of_two(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            let sizes: Vec<f64> = record.y.iter().map(|y| 0.03 * deviation(y)).collect();
            for k in 0..SAMPLES {
                let both = random.normal();
                for (y, size) in record.y.iter_mut().zip(&sizes) {
                    y[k] += size * (0.9 * both + 0.19f64.sqrt() * random.normal());
                }
            }
            plant.fit(&record, &How::default(), s)
        }),
        good("noise that grows with the output", |s| {
            let plant = plant(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            for y in &mut record.y {
                let sigma = 0.02 * deviation(y);
                y.iter_mut().for_each(|y| *y += (sigma + 0.02 * y.abs()) * random.normal());
            }
            plant.fit(&record, &How::default(), s)
        }),
        // Correlations of errors with outliers scatter more than the test of whiteness knows.
        with("outliers in one of fifty samples, robust loss", &[ColoredErrors], |s| {
            edited(s, &How { robust: true, ..How::default() }, |c, r| {
                for y in &mut c.y {
                    let sigma = deviation(y);
                    for y in y.iter_mut() {
                        let (size, hit) = (sigma * r.normal(), r.uniform() < 0.02);
                        *y += if hit { size } else { 0.0 };
                    }
                }
            })
        }),
        good("noise of uniform distribution", |s| {
            let plant = plant(s);
            let mut record = plant.record(s, SAMPLES);
            let mut random = Random(s);
            for y in &mut record.y {
                let sigma = 0.1 * deviation(y);
                y.iter_mut().for_each(|y| *y += sigma * (random.uniform() - 0.5));
            }
            plant.fit(&record, &How::default(), s)
        }),
        good("sensor with 200 steps over its range", |s| {
            edited(s, &How::default(), |c, _| {
                for y in &mut c.y {
                    let step = 6.0 * deviation(y) / 200.0;
                    y.iter_mut().for_each(|y| *y = (*y / step).round() * step);
                }
            })
        }),
    ]
}

fn samplings() -> Vec<Good> {
    vec![
        good("one measurement in ten missing", |s| {
            edited(s, &How::default(), |c, r| {
                // The first sample gives the state.
                c.y.iter_mut()
                    .for_each(|y| y.iter_mut().skip(1).filter(|_| r.uniform() < 0.1).for_each(|y| *y = f64::NAN));
            })
        }),
        good("irregular sampling, 0.3 to 1.7 steps", |s| {
            // Static: the samples of a dynamic record cannot be moved after the fact.
            let plant = line();
            let mut record = plant.record(s, SAMPLES).noisy(0.05, 0.0, s);
            let mut random = Random(s);
            let mut t = 0.0;
            let mut tick = || {
                t += 0.1 * (0.3 + 1.4 * random.uniform());
                t
            };
            record.times = Some((0..SAMPLES).map(|_| tick()).collect());
            plant.fit(&record, &How::default(), s)
        }),
        good("irregular sampling of a free decay", |s| {
            let plant = lag();
            let mut random = Random(s);
            let (mut t, mut times) = (0.0, vec![]);
            for _ in 0..300 {
                times.push(t);
                t += 0.02 * (0.3 + 1.4 * random.uniform());
            }
            // Under a step of the input from zero, which is exact at any time.
            let u = vec![times.iter().map(|t| if *t < 0.5 { 1.0 } else { -0.5 }).collect::<Vec<f64>>()];
            let (mut y, mut at, mut before) = (vec![], 0.0, 0.0);
            for (k, t) in times.iter().enumerate() {
                if k > 0 {
                    let goal = 2.0 * u[0][k - 1];
                    at = goal + (at - goal) * (-(t - before) / 0.3f64).exp();
                }
                before = *t;
                y.push(at + 0.02 * random.normal());
            }
            plant.fit(&Columns { step: 0.02, times: Some(times), u, y: vec![y] }, &How::default(), s)
        }),
        good("inputs in straight lines", |s| {
            let plant = Bench { hold: Hold::First, ..lag() };
            noisy(&plant, SAMPLES, 0.02, s)
        }),
        with("step of a constant input", &[ConstantInput], |s| {
            let plant = lag();
            let u = vec![vec![1.0; 300]];
            plant.fit(&plant.simulated(u, &[2.0, 0.3]).noisy(0.02, 0.0, s), &How::default(), s)
        }),
        good("start within a factor of ten", |s| {
            let plant = lag();
            let record = plant.record(s, SAMPLES).noisy(0.02, 0.0, s);
            let far = Bench { truth: vec![0.4, 1.5], ..lag() };
            far.fit(&record, &How::default(), s)
        }),
        // The inertia is known to a quarter of itself.
        with("one output is held constant by a controller", &[CurvedInterval], regulated),
        good("free decay of a model without inputs", |s| {
            let plant = ringing();
            let record = plant.simulated(vec![], &plant.truth()).noisy(0.03, 0.0, s);
            plant.fit(&record, &How::default(), s)
        }),
        good("three records of one plant", |s| {
            let plant = plant(s);
            let record = |s: u64| plant.record(s, 300).noisy(0.05, 0.0, s);
            plant.fit_all(&[record(s), record(s + 100), record(s + 200)], &How::default(), s)
        }),
        good("static model of two outputs", |s| noisy(&plane(), SAMPLES, 0.1, s)),
        // Every measurement is a start, noise included.
        with("predicted one step ahead, little noise", &[RestartNoise], |s| {
            let plant = lag();
            plant.fit(&plant.record(s, SAMPLES).noisy(1e-4, 0.0, s), &How { one_step: true, ..How::default() }, s)
        }),
    ]
}

/// A motor whose speed a controller holds while the load changes.
fn regulated(seed: u64) -> Found {
    let plant = brushed();
    let [r, l, k, j, b] = plant.truth()[..] else { unreachable!() };
    let load: Vec<f64> = plant.inputs(seed, 600)[1].iter().map(|load| 0.3 * load).collect();
    let (mut i, mut w, mut sum, substeps) = (0.0, 100.0, 0.0, 20);
    let mut random = Random(seed);
    let (mut u, mut y) = (vec![vec![], load.clone()], vec![vec![], vec![]]);
    for &load in &load {
        let error = 100.0 - w;
        sum += error;
        let voltage = k * 100.0 + 0.5 * error + 0.02 * sum;
        u[0].push(voltage);
        y[0].push(i + 0.02 * random.normal());
        y[1].push(w + 4.0 * random.normal());
        for _ in 0..substeps {
            let h = plant.step / f64::from(substeps);
            i += h * (voltage - r * i - k * w) / l;
            w += h * (k * i - b * w - load) / j;
        }
    }
    plant.fit(&Columns { step: plant.step, times: None, u, y }, &How::default(), seed)
}

fn shipped<M: Model + 'static>(plant: Bench<M>, seed: u64) -> Found {
    noisy(&plant, SAMPLES, 0.02, seed)
}

fn models() -> Vec<Good> {
    vec![
        good("Surface", |s| shipped(surface(), s)),
        good("DcMotor", |s| shipped(brushed(), s)),
        good("Salient", |s| {
            let truth = vec![0.6, 3e-3, 5e-3, 0.5];
            shipped(of_surface(Salient::new(4).unwrap(), truth), s)
        }),
        good("ExactSurface", |s| {
            shipped(of_surface(ExactSurface(ExactStep::new(4, 5e-4, HeldIn::Rotor).unwrap()), surface().truth), s)
        }),
        // Of an offset of a few standard errors.
        with("Positioning", &[HoldsZero], |s| {
            let drive = vec![(0.0, 3.0, 40)];
            let truth = vec![95.0, 200.0, 20.0, -3.0];
            let plant = Bench {
                model: Positioning { width: 0.01, ..Positioning::EMPS },
                truth,
                step: 2e-3,
                drive,
                initial: vec![0.0, 0.0],
                told: true,
                hold: Hold::default(),
            };
            shipped(plant, s)
        }),
        good("first order", |s| shipped(lag(), s)),
        good("oscillator", |s| shipped(oscillator(), s)),
        good("tank", |s| shipped(tank(), s)),
        good("two masses", |s| shipped(heated(), s)),
        good("recursion", |s| shipped(recursion(), s)),
        good("static line", |s| shipped(line(), s)),
    ]
}

/// A motor with the drive of the surface motor.
fn of_surface<M: Model>(model: M, truth: Vec<f64>) -> Bench<M> {
    let Bench { step, drive, initial, told, hold, .. } = surface();
    Bench { model, truth, step, drive, initial, told, hold }
}

/// All kinds.
pub fn all() -> Vec<Good> {
    [sizes(), noises(), samplings(), models()].into_iter().flatten().collect()
}
