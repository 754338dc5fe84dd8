//! The engine that runs a program on this machine.

use super::Trajectories;
use super::code::Sound;
use crate::wide::Width;

#[cfg(all(feature = "jit", target_arch = "x86_64"))]
pub(super) use super::machine::Machine;

/// There is no machine code without the feature `jit`, nor for other processors.
#[cfg(not(all(feature = "jit", target_arch = "x86_64")))]
#[derive(Debug)]
pub(super) enum Machine {}

#[cfg(not(all(feature = "jit", target_arch = "x86_64")))]
impl Machine {
    pub fn new(_code: &Sound, _width: Width) -> Option<Self> {
        None
    }
    pub fn len(&self) -> usize {
        match *self {}
    }
    pub fn run(&self, _: &Sound, _: usize, _: &mut [f64], _: &[f64], _: &mut [f64], _: usize) {
        match *self {}
    }
}

/// The variable that tests choose an engine by. It changes no bit of any result, but for `duals`: no program at all.
const VARIABLE: &str = "GREYBOX_ENGINE";

/// The registers and, if it can be and pays, the machine code for a step.
pub(super) fn engine(code: &Sound, trajectories: Trajectories) -> (Width, Option<Machine>) {
    let wanted = std::env::var(VARIABLE).unwrap_or_default();
    let narrow = wanted.ends_with("avx2");
    let width = match (wanted.as_str(), trajectories) {
        (_, Trajectories::One) => Width::single(),
        ("portable", _) => Width::portable(),
        _ if narrow => Width::avx2().unwrap_or_else(Width::portable),
        _ => Width::widest(),
    };
    let interpreted = wanted.starts_with("interpreter") || wanted == "portable";
    (width, if interpreted { None } else { Machine::new(code, width) })
}

/// Whether models are to be evaluated with dual numbers, whatever can be compiled.
pub(crate) fn only_duals() -> bool {
    std::env::var(VARIABLE).is_ok_and(|wanted| wanted == "duals")
}
