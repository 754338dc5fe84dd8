//! Thousands of fits: coverage of intervals, scatter of estimates, far starts. In optimized builds only
//! (`cargo test --release --test thorough`); others say so and pass.

#[cfg(not(debug_assertions))]
mod colored;
#[cfg(not(debug_assertions))]
#[path = "../common/mod.rs"]
mod common;
#[cfg(not(debug_assertions))]
mod coverage;
#[cfg(not(debug_assertions))]
mod far_starts;
#[cfg(not(debug_assertions))]
mod filters;
#[cfg(not(debug_assertions))]
#[path = "../common/hardening.rs"]
mod hardening;
#[cfg(not(debug_assertions))]
mod intervals;
#[cfg(not(debug_assertions))]
#[path = "../common/lorenz.rs"]
mod lorenz;
#[cfg(not(debug_assertions))]
mod monte_carlo;
#[cfg(not(debug_assertions))]
#[path = "../common/random.rs"]
mod random;

#[cfg(debug_assertions)]
#[test]
fn in_optimized_builds_only() {
    println!("nothing tested: run `cargo test --release --test thorough`");
}
#[cfg(not(debug_assertions))]
mod temperature;
