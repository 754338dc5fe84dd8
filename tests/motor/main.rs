//! Motors: frames, drives, observers, and the acceptance numbers of the reference study.

mod acceptance_adaptive;
mod acceptance_mras;
mod acceptance_records;
mod goal;
mod independent_drive;
mod motor_methods;
mod motor_models;
mod online;
mod online_experiments;
#[path = "../common/shared.rs"]
mod shared;
mod switching;
