//! Numbers, the triangle, losses, integrators: each against analytic cases.

mod duals;
mod information;
mod integrators;
mod linearization;
mod losses;
mod regress;
#[path = "../common/spiral.rs"]
mod spiral;
mod trees;
