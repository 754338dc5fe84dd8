//! Records of other plants than the model's, in other units, of other noise.

use crate::junk::*;
use crate::plants::*;
use greybox::WarningCode::*;
use greybox::pmsm::Surface;

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
        seen("speed in revolutions per minute", |s| {
            spoil(Box::new(surface()), s, |c, _| c.u[2].iter_mut().for_each(|w| *w *= 60.0 / std::f64::consts::TAU))
        }),
        named("wrong pole pairs", WrongShape, |s| {
            let plant = surface();
            let record = plant.record(s, SAMPLES).noisy(NOISE, 0.0, s);
            let wrong = Bench { model: Surface::new(8).unwrap(), ..surface() };
            wrong.fit(&record, &How::default(), s)
        }),
    ]
}

/// All kinds.
pub fn all() -> Vec<Junk> {
    [plants()].into_iter().flatten().collect()
}
