//! Numbers, the triangle, losses, integrators: each against analytic cases.

mod duals;
mod information;
mod integrators;
mod linearization;
mod losses;
mod regress;
mod trees;
