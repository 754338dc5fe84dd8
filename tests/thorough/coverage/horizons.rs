//! Predictions over a horizon of a lag whose current is disturbed and measured exactly.

use super::Trial;
use super::cases::{LAG, autoregressive, levels};
use crate::common::{Branch, Current, Lag, Voltage};
use crate::random::Random;
use greybox::{Experiment, Fit, Horizon, Time, free};

/// Of each sample's disturbance, `rho` is that of the sample before.
pub fn disturbed(random: &mut Random, steps: usize, rho: f64) -> Trial {
    let (samples, step) = (1000, 0.01);
    let inputs: Vec<Voltage> = levels(random, samples, 20).into_iter().map(|u| Voltage { u: 1.5 + 0.5 * u }).collect();
    let noise = autoregressive(random, samples, rho);
    let stays = (-step / LAG.tau).exp();
    let mut i = 0.0;
    let outputs = inputs.iter().zip(noise).map(|(u, e)| {
        let now = Current { i };
        i = stays * i + (1.0 - stays) * LAG.gain * u.u + 0.05 * e;
        now
    });
    let outputs = outputs.collect();
    let record = Experiment::new(&Lag, Time::Uniform { start: 0.0, step }, inputs, outputs).unwrap();
    let record = record.initial_from_first_sample();
    let parameters = Branch { gain: free(1.8), tau: free(0.06) };
    let fit = Fit::new(&Lag, &record).parameters(parameters).predictor(Horizon::new(steps));
    Trial { summary: fit.run().unwrap().into_summary(), truth: vec![LAG.gain, LAG.tau] }
}
