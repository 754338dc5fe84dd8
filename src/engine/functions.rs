//! Functions in lanes.

use crate::graph::{Function, Function2};
use crate::wide::Wide;

/// A function of one number, lane by lane.
#[inline(always)]
pub(super) fn function<W: Wide>(function: Function, a: W) -> W {
    a.map(|x| function.of(x))
}

/// A function of two numbers, lane by lane.
#[inline(always)]
pub(super) fn function2<W: Wide>(function: Function2, a: W, b: W) -> W {
    a.zip(b, |x, y| function.of(x, y, Some(y)))
}
