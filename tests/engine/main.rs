//! Models as graphs, and the engine that runs them: against duals and plain arithmetic.

mod bits;
mod random;
mod steps;
mod traced;
