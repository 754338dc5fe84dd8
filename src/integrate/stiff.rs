//! [`Stiff`]: the implicit method that a fit takes by itself.

use super::{Esdirk, Integrator, Stuck, System};
use crate::layout::Kind;

/// [`Esdirk`] with a limit to its steps: what is not stiff but fast, or explodes, is given up soon.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stiff(pub Esdirk);

/// Steps per interval, tried or taken, of a solution that is smooth at the begin of the interval: a jump of the input takes 50
/// to 100 at a tolerance of 1e-8, whatever the rates; a turn of a relaxation oscillator a thousand.
const STEPS: u32 = 3_000;
/// The same of a solution that asks for more steps than that from the begin on.
const FAST: u32 = 1_000;

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
        let is_fast = *step > 0.0 && *step * f64::from(FAST) < length;
        self.0.advance_within(if is_fast { FAST } else { STEPS }, system, x, step)
    }

    fn serves(&self, kind: Kind) -> bool {
        self.0.serves(kind)
    }

    fn refined(&self, kind: Kind) -> Option<Self> {
        self.0.refined(kind).map(Stiff)
    }

    fn describe(&self, kind: Kind) -> String {
        self.0.describe(kind)
    }
}
