//! Models as graphs, and the programs made of them: against duals and plain arithmetic.

mod bits;
mod groups;
mod guards;
mod random;
mod steps;
mod tables;
mod traced;
