//! Text models: what they mean, what is said of wrong ones, and that they give the answers of Rust models.

mod exported;
mod fuzz;
mod meaning;
mod noise;
mod readers;
mod twins;
mod units;
mod wrong;
