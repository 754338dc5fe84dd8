//! Standard errors of an initial state.

use crate::plants::*;
use greybox::{Fit, WarningCode, free};

/// One sample of 25 is measured, with noise that is correlated to nine tenths from one to the next: the first alone determines the
/// initial state, which is then known as well as a measurement is. The noise is estimated from 500 measurements, some 25 of them
/// independent: its variance to a third, or its size to a seventh. With leverage counted twice, the error was three times as large.
#[test]
fn an_initial_state_that_one_measurement_determines() {
    let plant = lag();
    for seed in 0..4 {
        let clean = plant.record(seed, 12_500);
        let sigma = 0.1 * deviation(&clean.y[0]);
        let mut record = clean.noisy(0.1, 0.9f64.powf(1.0 / 25.0), seed);
        record.y[0].iter_mut().enumerate().filter(|(k, _)| k % 25 > 0).for_each(|(_, y)| *y = f64::NAN);
        let record = plant.experiment(&record);
        let fit = Fit::new(&plant.model, &record).parameters(Lag { k: free(1.5), tau: free(0.4) }).run().unwrap();
        assert!(fit.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors), "{fit}");
        let initial = fit.unknowns.iter().find(|unknown| unknown.name == "y(0)").unwrap();
        let error = initial.knowledge.standard_error().unwrap();
        assert!((error / sigma).ln().abs() < 0.4, "{} {fit}", error / sigma);
    }
}
