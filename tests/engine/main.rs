//! Models as graphs, and the engine that runs them: against duals and plain arithmetic.

mod adaptive;
mod bits;
mod groups;
mod random;
mod second;
mod steps;
mod tables;
mod traced;
