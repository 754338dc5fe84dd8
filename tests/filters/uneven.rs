//! Filters of linear equations whose samples are not evenly spaced: gaps, clocks that jitter, several measurements at one instant.

use crate::common::Noise;
use crate::crossed::EXACT;
use crate::house;
use crate::house::{House, QUARTER, TRUTH, Thermal};
use crate::initial::agrees;
use crate::walls::{Heated, record, start};
use greybox::*;

/// Each tenth of a second, as a product, but for a tenth of the rows.
fn gaps(samples: usize) -> Vec<f64> {
    let mut noise = Noise(9);
    let all = (0..).map(|k: u32| f64::from(k) * 0.1).filter(|_| noise.gauss() < 1.28);
    all.take(samples).collect()
}

/// Likelihood and gradient are those of a filter with the exact transition of each interval by itself, up to the rounding of sums of a thousand terms:
/// with gaps; with stamps to a hundredth of a second, in segments and without; with a clock that jitters, so that each interval has a length of its own, of
/// few samples and of many; with two measurements at one instant. Outputs are missing in all of them.
#[test]
fn likelihoods_by_exact_transitions() {
    let hundredths =
        |samples: usize| -> Vec<f64> { (0..samples).map(|k| 0.1 * k as f64 + 0.01 * (k * 7 % 5) as f64).collect() };
    let jitter =
        |samples: usize| -> Vec<f64> { (0..samples).map(|k| 0.3 * k as f64 + 0.1 * (1.7 * k as f64).sin()).collect() };
    let instants = (0..80usize).map(|k| 0.2 * (k - usize::from(k % 11 == 6)) as f64).collect();
    for stamps in [gaps(60), gaps(1200), hundredths(60), hundredths(1200), jitter(30), jitter(1200), instants] {
        let record = record::<false>(Time::Stamps(stamps.clone()), stamps.len());
        let fit = || Fit::new(&Heated::<false>, &record).parameters(start());
        agrees(fit().predictor(Kalman), &record, |plant| plant.p0.clone(), 1e-11);
        agrees(fit().predictor(SecondOrder), &record, |plant| plant.p0.clone(), 1e-11);
    }
}

/// Lengths that are half of the tolerance off one another move the likelihood by no larger part.
#[test]
fn lengths_that_are_nearly_one() {
    let off = |k: usize| 0.1 * k as f64 + if k.is_multiple_of(2) { 2.5e-11 } else { 0.0 };
    let stamps = (0..1200).map(|k| off(k) + if k > 600 { 0.7 } else { 0.0 }).collect();
    let record = record::<false>(Time::Stamps(stamps), 1200);
    agrees(
        Fit::new(&Heated::<false>, &record).parameters(start()).predictor(Kalman),
        &record,
        |plant| plant.p0.clone(),
        1e-9,
    );
}

fn fitted(stamps: Vec<f64>) -> Estimate<House> {
    let record = house::record(stamps);
    Fit::new(&House, &record).parameters(house::start()).predictor(Kalman).run().unwrap()
}

/// A sensor of a minute at quarters of an hour, where a step of Runge-Kutta's method is 15 time constants long and explodes: evenly spaced, with gaps of
/// a quarter and more, and of a clock that jitters by half a minute, the first method is exact and finds the truth.
#[test]
fn a_stiff_house_needs_no_finer_steps() {
    let mut noise = Noise(2);
    let even: Vec<f64> = (0..900).map(|k| QUARTER * f64::from(k)).collect();
    let with_gaps = even.iter().copied().filter(|_| noise.gauss() < 1.5).collect();
    let jittered = even.iter().map(|t| t + 30.0 * noise.gauss().clamp(-3.0, 3.0)).collect();
    for stamps in [even, with_gaps, jittered] {
        let found = fitted(stamps);
        assert_eq!((found.method.integrator.as_str(), found.method.refinement), (EXACT, 0), "{found}");
        assert!(found.outcome.converged() && found.severity() < Severity::NotUsable, "{found}");
        let truth = Thermal::into_array(TRUTH);
        let knowledge = Thermal::into_array(found.knowledge);
        for ((value, truth), knowledge) in Thermal::into_array(found.parameters).iter().zip(truth).zip(knowledge) {
            let Some(error) = knowledge.standard_error() else { continue };
            // Of 21 values none is as far off by chance in one of a thousand records.
            assert!((value - truth).abs() < 4.0 * error, "{value} {truth} {error}: {found}");
        }
    }
}
