//! Numbers, the triangle, filters, losses, integrators: each against analytic cases.

mod filters;
mod ground;
mod information;
mod integrators;
mod linearization;
mod losses;
mod regress;
mod trees;
