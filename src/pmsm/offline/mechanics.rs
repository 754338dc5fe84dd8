use super::{Equations, Spans};
use crate::pmsm::{COULOMB_WIDTH, Load, SQRT_3_2, Shaft};
use crate::scalar::Scalar;

impl Spans {
    /// The balance of torque `sqrt(3/2) ke iq = j dw/dt + bv w + tc tanh(w/0.5) + tg cos(theta/gear)` at each sample between
    /// two intervals, linear in inertia, friction and gravity; all of them scale with `ke` (V s/rad).
    ///
    /// The acceleration is the second difference of a measured angle and very noisy: filter the equations (a low-pass of some
    /// 10 Hz). Simulating [`Shaft`] in a fit instead needs no acceleration.
    pub fn mechanics(&self, shaft: &Shaft, ke: f64) -> Equations<Load> {
        let rows = self.spans.windows(2).map(|pair| {
            let (a, b) = (&pair[0], &pair[1]);
            let w = 0.5 * (a.w + b.w);
            let theta = 0.5 * (a.theta + b.theta);
            let terms = Load {
                j: (b.w - a.w) / self.ts,
                bv: w,
                tc: Scalar::tanh(w / COULOMB_WIDTH),
                tg: Scalar::cos(theta / shaft.gear()),
            };
            (terms, SQRT_3_2 * ke * b.i0.iq)
        });
        Equations::new().stream(rows)
    }
}
