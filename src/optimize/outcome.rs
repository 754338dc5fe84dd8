//! [`Outcome`]: how a search ended.

use super::PRECISION_GRADIENT;
use core::fmt;
use serde::{Deserialize, Serialize};

/// How a search ended, with the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// The next step is negligible and the residual orthogonal to the Jacobian (or next to rounding).
    Converged {
        /// Largest relative size of the next step.
        step: f64,
        /// Largest cosine between the residual and a column of the Jacobian.
        gradient: f64,
    },
    /// A step lowered the cost by a negligible part (only if such a stop was asked for).
    CostUnchanged {
        /// The relative decrease.
        decrease: f64,
    },
    /// The cost cannot resolve a further step, and what the step would gain no longer shrinks.
    LimitOfPrecision {
        /// Largest cosine between the residual and a column of the Jacobian.
        gradient: f64,
    },
    /// Nothing was left to explain: the model reproduces the data to the rounding of the unknowns.
    Exact,
    /// However short, no step lowers the cost, and yet the gradient is not zero.
    Stalled {
        /// Largest cosine between the residual and a column of the Jacobian.
        gradient: f64,
        /// How many of the last trial steps could not be simulated.
        failed: u64,
    },
    /// The limit of iterations was met first.
    IterationLimit {
        /// The limit.
        iterations: u64,
    },
    /// The time limit was met first.
    TimeLimit,
    /// The user stopped the search.
    Cancelled,
}

/// Whether to trust what a search found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Severity {
    /// Nothing speaks against it.
    Usable,
    /// Read the warnings first.
    UsableWithCare,
    /// Do not use the numbers.
    NotUsable,
}

impl Outcome {
    /// Whether a minimum was reached. It may still be a local one.
    pub fn converged(&self) -> bool {
        match self {
            Outcome::Converged { .. } | Outcome::CostUnchanged { .. } | Outcome::Exact => true,
            Outcome::LimitOfPrecision { gradient } => *gradient <= PRECISION_GRADIENT,
            _ => false,
        }
    }

    /// What to do, in one sentence.
    pub fn advice(&self) -> &'static str {
        match self {
            Outcome::Converged { .. } | Outcome::Exact => "Nothing to do.",
            Outcome::CostUnchanged { .. } => {
                "Drop the cost tolerance if more digits matter: on hard problems it stops early."
            }
            Outcome::LimitOfPrecision { .. } if self.converged() => {
                "Nothing to do: the cost has no more digits to give."
            }
            Outcome::LimitOfPrecision { .. } => {
                "The cost is too rough to follow: tighten the integrator's tolerance, or scale the data."
            }
            Outcome::Stalled { failed: 0, .. } => {
                "The cost is not smooth here (dry friction, a switch, a coarse tolerance): smooth the model, use a shorter \
                 horizon, or start elsewhere."
            }
            Outcome::Stalled { .. } => {
                "The simulation fails all around this point: bound the parameters, use a shorter horizon or start elsewhere."
            }
            Outcome::IterationLimit { .. } => {
                "Allow more iterations, or start closer; if it creeps, look for parameters that only appear together."
            }
            Outcome::TimeLimit => "Allow more time, or resume from the checkpoint.",
            Outcome::Cancelled => "Resume from the checkpoint to go on.",
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Outcome::Converged { step, gradient } => {
                write!(f, "converged (relative step {step:.1e}, gradient cosine {gradient:.1e})")
            }
            Outcome::CostUnchanged { decrease } => write!(f, "converged (cost fell by a part of {decrease:.1e} only)"),
            Outcome::LimitOfPrecision { gradient } if self.converged() => {
                write!(f, "converged to the precision of the cost (gradient cosine {gradient:.1e})")
            }
            Outcome::LimitOfPrecision { gradient } => {
                write!(f, "not converged: the cost resolves no further step, but the gradient cosine is {gradient:.1e}")
            }
            Outcome::Exact => write!(f, "converged (the model reproduces the data)"),
            Outcome::Stalled { gradient, failed } => {
                write!(f, "not converged: no step lowers the cost (gradient cosine {gradient:.1e}")?;
                if *failed > 0 {
                    write!(f, "; {failed} trial step(s) could not be simulated")?;
                }
                write!(f, ")")
            }
            Outcome::IterationLimit { iterations } => write!(f, "not converged after {iterations} iterations"),
            Outcome::TimeLimit => write!(f, "not converged within the time limit"),
            Outcome::Cancelled => write!(f, "cancelled"),
        }
    }
}
