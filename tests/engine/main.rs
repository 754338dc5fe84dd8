//! Models as graphs, and the engine that runs them: against duals and plain arithmetic.

mod bits;
mod groups;
mod random;
mod steps;
mod tables;
mod traced;
