//! [`Stiff`]: the implicit method that a fit takes by itself.

use super::{Esdirk, Integrator, Stuck, System};
use crate::layout::Kind;

/// [`Esdirk`] with a limit to its steps: what is not stiff but fast, or explodes, is given up soon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiff {
    method: Esdirk,
    /// The limits below, times this.
    more: u32,
}

/// Steps per interval, tried or taken, of a solution that is smooth at the begin of the interval: a jump of the input takes 50
/// to 100 at a tolerance of 1e-8, whatever the rates; a turn of a relaxation oscillator a thousand.
const STEPS: u32 = 3_000;
/// The same of a solution that asks for more steps than that from the begin on.
const FAST: u32 = 1_000;
/// Steps that a method of order four takes for one where its tolerance is a hundredth: the fourth root, rounded up.
const FINER: u32 = 4;

impl Default for Stiff {
    fn default() -> Self {
        Stiff { method: Esdirk::default(), more: 1 }
    }
}

impl Integrator for Stiff {
    const FIXED: bool = false;

    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let (_, length) = system.interval();
        let (steps, fast) = (self.more.saturating_mul(STEPS), self.more.saturating_mul(FAST));
        let is_fast = *step > 0.0 && *step * f64::from(fast) < length;
        self.method.advance_within(if is_fast { fast } else { steps }, system, x, step)
    }

    fn serves(&self, kind: Kind) -> bool {
        self.method.serves(kind)
    }

    fn refined(&self, kind: Kind) -> Option<Self> {
        let method = self.method.refined(kind)?;
        Some(Stiff { method, more: self.more.saturating_mul(FINER) })
    }

    fn describe(&self, kind: Kind) -> String {
        self.method.describe(kind)
    }
}
