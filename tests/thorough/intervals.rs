//! Whether intervals cover the truth as often as they say, by simulation. Seeds are fixed.

use crate::common::{Branch, Current, Lag, Voltage};
use crate::random::Random;
use greybox::diagnose::{Resampling, bands, bootstrap};
use greybox::{
    Butterworth, Estimate, Experiment, Fit, Knowledge, Sample, Signals, Time, estimate::CovarianceMethod, free,
};

const TRUTH: Branch = Branch { gain: 2.0, tau: 0.05 };
const STEP: f64 = 0.01;

/// A record of slow random steps with noise of unit innovations and this autoregression.
fn record(samples: usize, rho: f64, seed: u64) -> Experiment<Current, Voltage, Current> {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (mut inputs, mut outputs) = (vec![], vec![]);
    let (mut x, mut noise, mut u) = (0.0, random.normal() / (1.0 - rho * rho).sqrt(), 1.0);
    let decay = (-STEP / TRUTH.tau).exp();
    for k in 0..samples {
        if k % 40 == 0 {
            u = 1.0 + random.uniform();
        }
        inputs.push(Voltage { u });
        outputs.push(Current { i: x + 0.05 * noise });
        x = TRUTH.gain * u + (x - TRUTH.gain * u) * decay;
        noise = rho * noise + random.normal();
    }
    Experiment::new(&Lag, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap()
}

fn fit(samples: usize, rho: f64, seed: u64) -> Estimate<Lag> {
    let record = record(samples, rho, seed);
    Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.1).log() }).run().unwrap()
}

/// Part of the repetitions whose intervals cover the truth, for each parameter: as said, and classical ones (which the
/// parametric error index holds).
fn coverage(samples: usize, rho: f64, repetitions: u64) -> [(f64, f64); 2] {
    let truth = Branch::<f64>::into_array(TRUTH);
    let mut covered = [(0.0, 0.0); 2];
    for seed in 0..repetitions {
        let estimate = fit(samples, rho, seed);
        assert!(estimate.outcome.converged(), "{}", estimate.outcome);
        let part = |covers: bool| f64::from(u8::from(covers)) / repetitions as f64;
        for (j, (said, classical)) in covered.iter_mut().enumerate() {
            let unknown = &estimate.unknowns[j];
            let Knowledge::Known { lower, upper, .. } = unknown.knowledge else { panic!("{:?}", unknown.knowledge) };
            *said += part(lower <= truth[j] && truth[j] <= upper);
            let error = unknown.error_index.unwrap() / 100.0 * unknown.value / estimate.degrees_of_freedom().sqrt();
            *classical += part((unknown.value - truth[j]).abs() <= 1.96 * error);
        }
    }
    covered
}

/// With white noise the intervals are classical (but for the one in a hundred that the test refuses by chance) and cover
/// 95 %; over 1,000 repetitions the binomial spread is 0.7 %.
#[test]
fn classical_intervals_cover_white_noise() {
    for (covered, classical) in coverage(500, 0.0, 1000) {
        println!("white noise, 500 samples: {covered}, classical {classical}");
        assert!((0.93..=0.97).contains(&covered), "{covered}");
    }
}

/// With colored noise the fit says so, and its intervals cover 93 to 97 % of the time at 5,000 samples.
#[test]
fn colored_noise_is_seen_and_allowed_for() {
    let estimate = fit(5000, 0.9, 7);
    let covariance = estimate.method.covariance;
    assert!(matches!(covariance, CovarianceMethod::Hac { .. }), "{covariance}");
    println!("{estimate}");
    for samples in [500, 5000] {
        for (covered, classical) in coverage(samples, 0.9, 1000) {
            println!("AR(1) 0.9, {samples} samples: {covered}, classical {classical}");
            assert!(classical < 0.7, "{samples}: {classical}");
            assert!(samples < 5000 || (0.93..=0.97).contains(&covered), "{samples}: {covered}");
        }
    }
}

/// Refits of resampled records, single residuals for white noise and blocks for colored, say the same as the intervals; and
/// the same again from the same seed.
#[test]
fn bootstraps_agree() {
    for (rho, resampling, tolerance) in [(0.0, Resampling::Residuals, 0.1), (0.9, Resampling::Blocks(100), 0.25)] {
        let record = record(5000, rho, 3);
        let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.1).log() });
        let problem = fit.problem().unwrap();
        let estimate = problem.run().unwrap();
        let found = bootstrap(&problem, &estimate, resampling, 400, 1).unwrap();
        assert_eq!(found.converged, 400);
        for i in 0..2 {
            let ratio = found.standard_errors[i] / estimate.unknowns[i].knowledge.standard_error().unwrap();
            println!("{rho} {}: {ratio} {:?}", found.unknowns[i], found.intervals[i]);
            // 400 refits know a standard deviation to 3.5 %; a block covariance from 50 blocks to some 10 %.
            assert!((ratio - 1.0).abs() < tolerance, "{rho} {}: {ratio}", found.unknowns[i]);
        }
        let again = bootstrap(&problem, &estimate, resampling, 20, 1).unwrap();
        assert_eq!(again, bootstrap(&problem, &estimate, resampling, 20, 1).unwrap());
    }
}

/// With a weighting, and with a pre-filter, refits agree with the sandwich that the estimate says: 400 refits know a standard
/// deviation to 3.5 %, the sandwich knows its middle from 3,000 samples to some 5 %.
#[test]
fn bootstraps_agree_with_sandwiches() {
    let record = record(3000, 0.0, 11);
    let parameters = Branch { gain: free(1.5), tau: free(0.1).log() };
    let plain = || Fit::new(&Lag, &record).parameters(parameters);
    let filter = Butterworth::low_pass(2, 10.0, STEP).unwrap();
    let weighted = plain().weighting(|s: &Sample<Lag>| (s.u.u - 1.0).powi(2));
    for (what, fit, covariance) in [
        ("weighting", weighted, CovarianceMethod::Sandwich),
        ("pre-filter", plain().prefilter(filter), CovarianceMethod::FilteredSandwich),
    ] {
        let problem = fit.problem().unwrap();
        let estimate = problem.run().unwrap();
        assert_eq!(estimate.method.covariance, covariance);
        let found = bootstrap(&problem, &estimate, Resampling::Residuals, 400, 2).unwrap();
        assert_eq!(found.converged, 400);
        for (unknown, error) in estimate.unknowns.iter().zip(&found.standard_errors) {
            let ratio = error / unknown.knowledge.standard_error().unwrap();
            println!("{what}, {}: {ratio}", unknown.name);
            assert!((ratio - 1.0).abs() < 0.12, "{what}, {}: {ratio}", unknown.name);
        }
    }
}

/// Percentiles of refits cover 93 to 97 % of the time: 400 records of 300 samples, 200 refits each; binomial spread 1.1 %.
#[test]
fn bootstrap_covers() {
    let truth = [TRUTH.gain, TRUTH.tau];
    let mut covered = [0.0; 2];
    for seed in 0..400 {
        let record = record(300, 0.0, seed);
        let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.1).log() });
        let problem = fit.problem().unwrap();
        let estimate = problem.run().unwrap();
        let found = bootstrap(&problem, &estimate, Resampling::Residuals, 200, seed).unwrap();
        for (j, covered) in covered.iter_mut().enumerate() {
            let (lower, upper) = found.intervals[j];
            *covered += f64::from(u8::from(lower <= truth[j] && truth[j] <= upper)) / 400.0;
        }
    }
    println!("bootstrap: {covered:?}");
    assert!(covered.iter().all(|covered| (0.93..=0.97).contains(covered)), "{covered:?}");
}

/// Bands hold the noise-free output, and new measurements, as often as they say; 400 records, at one sample each.
#[test]
fn bands_cover() {
    let (mut confident, mut predicted) = (0.0, 0.0);
    for seed in 0..400 {
        let record = record(300, 0.0, seed);
        let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.5), tau: free(0.1).log() });
        let problem = fit.problem().unwrap();
        let estimate = problem.run().unwrap();
        let bands = bands(&problem, &estimate, 0, 0.95).unwrap();
        // The truth: simulated without noise, which does not depend on the seed of the noise but on the inputs.
        let (mut x, decay) = (0.0, (-STEP / TRUTH.tau).exp());
        let at = 200 + seed as usize % 90;
        for k in 0..at {
            let steady = TRUTH.gain * record.input(k).u;
            x = steady + (x - steady) * decay;
        }
        let error = (bands.outputs[0][at] - x).abs();
        confident += f64::from(u8::from(error <= bands.confidence[0][at])) / 400.0;
        let measured = x + 0.05 * Random(seed.wrapping_mul(77) + 5).normal();
        let error = (bands.outputs[0][at] - measured).abs();
        predicted += f64::from(u8::from(error <= bands.prediction[0][at])) / 400.0;
    }
    println!("bands: {confident}, {predicted}");
    for covered in [confident, predicted] {
        assert!((0.92..=0.98).contains(&covered), "{covered}");
    }
}
