//! [`Stiff`]: the implicit method that a fit takes by itself.

use super::{Esdirk, Integrator, Stuck, System};
use crate::layout::Kind;

/// [`Esdirk`] with a limit to the number of its steps, so that a fit does not spend long on a model that is not stiff but fast,
/// or whose states diverge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiff {
    method: Esdirk,
    /// The limits below, times this.
    more: u32,
}

/// Most steps per interval, accepted or rejected, where the step with which the interval begins is not shorter than its `FAST`th
/// part. At a tolerance of 1e-8 a jump of the input takes 50 to 100, whatever the rates; a period of a relaxation oscillator
/// takes a thousand.
const STEPS: u32 = 3_000;
/// Most steps per interval where the step with which it begins is shorter than this part of it.
const FAST: u32 = 1_000;
/// How many times as many steps a method of order four takes when its tolerance is a hundredth: the fourth root of 100,
/// rounded up.
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
