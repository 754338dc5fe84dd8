//! Models as graphs, and the engine that runs them: against duals and plain arithmetic.

mod random;
mod steps;
