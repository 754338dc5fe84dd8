//! Filters of plants with process noise: likelihoods, gradients, estimates.

mod affine;
#[path = "../common/mod.rs"]
mod common;
mod crossed;
mod exact_sensor;
mod extended;
mod given_noise;
#[path = "../common/hardening.rs"]
mod hardening;
mod house;
mod initial;
mod input_timing;
mod jumps;
mod missing_terms;
mod moving_levels;
mod process_noise;
mod second_order;
mod simulated;
mod simulates;
mod smoothed;
mod two_sensors;
mod uneven;
mod walls;
mod weighed;
