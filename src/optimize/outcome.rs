//! [`Outcome`]: how a search ended.

use super::PRECISION;
use core::fmt;
use serde::{Deserialize, Serialize};

/// How a search ended, with the numbers; in JSON with its name as `code`, in small letters with underscores.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum Outcome {
    /// The next step is negligible and the residual orthogonal to the Jacobian.
    Converged {
        /// Largest relative size of the next step.
        #[serde(with = "crate::real")]
        step: f64,
        /// Largest cosine between the residual and a column of the Jacobian.
        #[serde(with = "crate::real")]
        gradient: f64,
    },
    /// The next step would lower the cost by a negligible part (only if such a stop was asked for).
    CostUnchanged {
        /// That part, by the slopes.
        #[serde(with = "crate::real")]
        decrease: f64,
    },
    /// The cost cannot resolve a further step, and what the step would gain no longer shrinks.
    LimitOfPrecision {
        /// Largest cosine between the residual and a column of the Jacobian.
        #[serde(with = "crate::real")]
        gradient: f64,
        /// Largest relative size of the next step; where it is large, this is a plateau.
        #[serde(with = "crate::real")]
        step: f64,
    },
    /// Nothing was left to explain: the model reproduces the data to their rounding.
    Exact,
    /// No step lowers the cost, which is rough: what the next step would gain is below what the cost jumps from point to
    /// point (of an adaptive integrator: changes with a finer tolerance, or negligible), or steps do not gain what slopes
    /// predict, however short.
    Rough {
        /// By how much the cost jumps, as a part of it.
        #[serde(with = "crate::real")]
        noise: f64,
        /// How long the next step would be, in standard errors of the unknowns.
        #[serde(with = "crate::real")]
        errors: f64,
    },
    /// However short, no step lowers the cost, and yet the gradient is not zero.
    Stalled {
        /// Largest cosine between the residual and a column of the Jacobian.
        #[serde(with = "crate::real")]
        gradient: f64,
        /// Largest relative size of the next step.
        #[serde(with = "crate::real")]
        step: f64,
        /// How many of the last trial steps could not be simulated.
        failed: u64,
    },
    /// Unknowns, or combinations of them, that had influence at the start have none at the end.
    Plateau {
        /// How many have lost it.
        lost: usize,
        /// Largest cosine between the residual and a column of the Jacobian.
        #[serde(with = "crate::real")]
        gradient: f64,
    },
    /// Many steps in a row lowered the cost by next to nothing, where slopes predict more.
    Creeping {
        /// How many.
        trials: u64,
        /// By which part of the cost the next full step would lower it, if the slopes held.
        #[serde(with = "crate::real")]
        promised: f64,
    },
    /// The limit of iterations was met first.
    IterationLimit {
        /// The limit.
        iterations: u64,
    },
    /// A limit of iterations that the library has, not the user, was met first.
    OwnLimit {
        /// How many there were.
        iterations: u64,
        /// What the limit is of.
        limit: SearchLimit,
    },
    /// The time limit was met first.
    TimeLimit,
    /// The user stopped the search.
    Cancelled,
}

/// What has a limit of iterations of its own, apart from that which the user gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchLimit {
    /// The first of two tries from a start.
    FirstTry,
    /// A search by a finer method than the default one, which the fit took by itself.
    FinerMethod,
    /// A search from a further start, which the fit drew by itself.
    FurtherStart,
    /// The rounds in which the noise levels are estimated.
    NoiseRounds,
}

impl fmt::Display for SearchLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SearchLimit::FirstTry => "where a first try is ended; the second one found nothing better",
            SearchLimit::FinerMethod => "the most by a finer method that the fit takes by itself",
            SearchLimit::FurtherStart => "the most from a start that the fit draws by itself",
            SearchLimit::NoiseRounds => "in which the noise levels did not settle",
        })
    }
}

/// Where the cost resolves no more, three digits of each unknown make a minimum.
const DIGITS: f64 = 1e-3;
/// Where the cost is rough, a tenth of a standard error does.
const NEAR: f64 = 0.1;

impl Outcome {
    /// Whether a minimum was reached. It may still be a local one.
    pub fn converged(&self) -> bool {
        match self {
            Outcome::Converged { .. } | Outcome::CostUnchanged { .. } | Outcome::Exact => true,
            Outcome::LimitOfPrecision { gradient, step } => *gradient <= PRECISION && *step <= DIGITS,
            Outcome::Rough { errors, .. } => *errors <= NEAR,
            _ => false,
        }
    }

    /// The advice, in one sentence.
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
                "The cost is flat here: start elsewhere, or fix an unknown that only appears together with others."
            }
            Outcome::Rough { .. } if self.converged() => {
                "Tighten the integrator's tolerance if more digits than the noise allows matter."
            }
            Outcome::Rough { .. } => {
                "The cost is too rough to follow: tighten the integrator's tolerance, or smooth the model (dry friction, a \
                 switch)."
            }
            Outcome::Stalled { failed: 0, .. } => {
                "The cost is not smooth here (dry friction, a switch, the dead time of a held input, a coarse tolerance): \
                 smooth the model, use a shorter horizon, or start elsewhere."
            }
            Outcome::Stalled { .. } => {
                "The simulation fails all around this point: bound the parameters, use a shorter horizon or start elsewhere."
            }
            Outcome::Plateau { .. } => {
                "Start elsewhere or give bounds: the search has run to where the unknowns no longer matter."
            }
            Outcome::Creeping { .. } => {
                "Look for parameters that only appear together, and fix one of them or give it a prior; or start closer."
            }
            Outcome::IterationLimit { .. } => {
                "Allow more iterations, or start closer; if the cost hardly falls any more, look for parameters that only \
                 appear together."
            }
            Outcome::OwnLimit { limit: SearchLimit::FinerMethod, .. } => {
                "Name the integrator (Fit::integrator), with which a search has all its iterations, or start closer."
            }
            Outcome::OwnLimit { limit: SearchLimit::FurtherStart, .. } => {
                "Ask for more starts (Fit::starts), which have all their iterations, or start closer."
            }
            Outcome::OwnLimit { limit: SearchLimit::FirstTry, .. } => {
                "Start closer, or look for parameters that only appear together."
            }
            Outcome::OwnLimit { limit: SearchLimit::NoiseRounds, .. } => "Give the noise, or fix an unknown.",
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
            Outcome::CostUnchanged { decrease } => {
                write!(f, "converged (the next step would lower the cost by {decrease:.1e} of itself)")
            }
            Outcome::LimitOfPrecision { gradient, step } => {
                let not = if self.converged() { "converged to" } else { "not converged: this is" };
                write!(f, "{not} the precision of the cost (relative step {step:.1e}, gradient cosine {gradient:.1e})")
            }
            Outcome::Exact => write!(f, "converged (the model reproduces the data)"),
            Outcome::Rough { noise, errors } => {
                let not = if self.converged() { "converged" } else { "not converged" };
                write!(
                    f,
                    "{not} within the roughness of the cost (it jumps by {noise:.1e} of itself; next step {errors:.1e} \
                     standard errors)"
                )
            }
            Outcome::Stalled { gradient, step, failed } => {
                write!(
                    f,
                    "not converged: no step lowers the cost (relative step {step:.1e}, gradient cosine {gradient:.1e}"
                )?;
                if *failed > 0 {
                    write!(f, "; {failed} trial step(s) could not be simulated")?;
                }
                write!(f, ")")
            }
            Outcome::Plateau { lost, gradient } => write!(
                f,
                "not converged: {lost} unknown(s) or combination(s) lost their influence on the way (gradient cosine \
                 {gradient:.1e})"
            ),
            Outcome::Creeping { trials, promised } => write!(
                f,
                "not converged: {trials} steps hardly lowered the cost, of which the slopes predict {:.1} %",
                100.0 * promised
            ),
            Outcome::IterationLimit { iterations } => write!(f, "not converged after {iterations} iterations"),
            Outcome::OwnLimit { iterations, limit } => {
                write!(f, "not converged after {iterations} iterations, {limit}")
            }
            Outcome::TimeLimit => write!(f, "not converged within the time limit"),
            Outcome::Cancelled => write!(f, "cancelled"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outcomes that are minima, with their words and advice.
    #[test]
    fn outcomes_and_their_words() {
        let precision = |gradient: f64, step: f64| Outcome::LimitOfPrecision { gradient, step };
        let rough = |errors: f64| Outcome::Rough { noise: 1e-9, errors };
        let stalled = |failed: u64| Outcome::Stalled { gradient: 0.5, step: 0.25, failed };
        let own = |limit: SearchLimit| Outcome::OwnLimit { iterations: 7, limit };
        let cases = [
            (Outcome::Converged { step: 1e-9, gradient: 1e-12 }, true, "converged (", "Nothing to do."),
            (Outcome::CostUnchanged { decrease: 1e-9 }, true, "converged (", "Drop the cost tolerance"),
            (Outcome::Exact, true, "converged (", "Nothing to do."),
            (precision(0.5 * PRECISION, 5e-4), true, "converged to the precision", "Nothing to do"),
            (precision(0.5 * PRECISION, 2e-3), false, "not converged: this is the precision", "The cost is flat"),
            (precision(2.0 * PRECISION, 5e-4), false, "not converged: this is the precision", "The cost is flat"),
            (rough(0.05), true, "converged within the roughness", "Tighten the integrator's tolerance if"),
            (rough(0.2), false, "not converged within the roughness", "The cost is too rough"),
            (stalled(0), false, "not converged: no step lowers", "The cost is not smooth"),
            (stalled(2), false, "not converged: no step lowers", "The simulation fails"),
            (Outcome::Plateau { lost: 1, gradient: 0.5 }, false, "not converged: 1 unknown", "Start elsewhere"),
            (Outcome::Creeping { trials: 9, promised: 0.5 }, false, "not converged: 9 steps", "Look for parameters"),
            (Outcome::IterationLimit { iterations: 7 }, false, "not converged after 7", "Allow more iterations"),
            (own(SearchLimit::FirstTry), false, "not converged after 7 iterations, where a first try", "Start closer"),
            (own(SearchLimit::FinerMethod), false, "not converged after 7 iterations, the most by", "Name the integ"),
            (own(SearchLimit::FurtherStart), false, "not converged after 7 iterations, the most from", "Ask for more"),
            (own(SearchLimit::NoiseRounds), false, "not converged after 7 iterations, in which", "Give the noise"),
            (Outcome::TimeLimit, false, "not converged within the time", "Allow more time"),
            (Outcome::Cancelled, false, "cancelled", "Resume"),
        ];
        for (outcome, converged, words, advice) in cases {
            assert_eq!(outcome.converged(), converged, "{outcome:?}");
            assert!(outcome.to_string().starts_with(words), "{outcome}");
            assert!(outcome.advice().starts_with(advice), "{outcome:?}: {}", outcome.advice());
        }
        assert!(!stalled(0).to_string().contains("simulated") && stalled(2).to_string().contains("; 2 trial step(s)"));
    }
}
