//! Fits: parameters that are known come back, bad input is named.

mod adaptive_fits;
mod argmin_solvers;
mod bad_input;
mod bad_models;
mod checks;
mod closed_forms;
mod closure_sweep;
mod columns;
#[path = "../common/mod.rs"]
mod common;
mod conditions;
mod contradictions;
#[path = "../common/dc_motor.rs"]
mod dc_motor;
mod declared;
mod dense_answers;
mod derived_steps;
mod equations;
mod exchanged;
mod extremes;
mod far_starts;
mod few_measurements;
mod field;
mod fleet;
mod guessed_states;
mod holds;
mod initial_functions;
mod instants;
mod interval_limits;
mod judgements;
mod kinks;
mod late_sensor;
mod long_profile;
#[path = "../common/lorenz.rs"]
mod lorenz;
mod many_records;
mod missing_terms;
mod models;
mod narrow_losses;
mod nist;
mod noise;
mod optimizers;
mod owned_problems;
mod recovery;
mod refining;
#[path = "../common/refused.rs"]
mod refused;
mod sandwiches;
mod segments;
mod sensors;
#[path = "../common/shared.rs"]
mod shared;
mod shooting;
mod sizes_of_errors;
#[path = "../common/spiral.rs"]
mod spiral;
mod stages;
mod starts;
mod step_errors;
mod stiff;
mod stopped;
mod threads;
mod user_code;
mod weights;
mod white_contradictions;
