//! Numbers, the triangle, filters, losses, integrators: each against analytic cases.

mod duals;
mod filters;
mod information;
mod integrators;
mod linearization;
mod losses;
mod regress;
mod trees;
