//! Faults of inputs, and records that are told to the fit otherwise than they were made.

use crate::junk::*;
use crate::plants::*;
use crate::random::Random;
use greybox::Hold;
use greybox::WarningCode::*;

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
        // The interval of a gain that is truly zero holds zero in 95 % of records only.
        named("constant input, plant at rest", ConstantInput, |s| {
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
        named("noise a hundred times the signal", Unexplained, |s| {
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

/// All kinds.
pub fn all() -> Vec<Junk> {
    [inputs(), told_wrong()].into_iter().flatten().collect()
}
