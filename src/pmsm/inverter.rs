//! The voltage-source inverter: when its voltage acts, and what dead time takes from it.

use super::frames::{Stator, clarke, inverse_clarke};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// How the voltage that a drive asks for comes about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Inverter {
    /// As its mean over the sample: no ripple, and dead time as a voltage.
    #[default]
    Averaged,
    /// By pulses of the direct voltage `vdc` (V, positive).
    Switching {
        /// Direct voltage (V).
        vdc: f64,
        /// The carrier that the duties are compared with.
        carrier: Carrier,
    },
}

/// How much of a triangular carrier fits into one sample; the samples are at its extrema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Carrier {
    /// A whole period: each leg goes up and down in every sample (7.94 kHz on the reference drive).
    PerSample,
    /// Half a period: each leg goes up in one sample and down in the next (3.97 kHz on the reference drive).
    HalfPerSample,
}

impl Carrier {
    /// Its period (s) for a sample time `ts` (s).
    pub fn period(self, ts: f64) -> f64 {
        match self {
            Carrier::PerSample => ts,
            Carrier::HalfPerSample => 2.0 * ts,
        }
    }
}

/// Voltage lost to dead time and to the valves: `vdt tanh(i/i0)` in each phase; 2 V and 0.15 A for a well-compensated
/// 600 V drive. It causes nearly all error at low speed in the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeadTime {
    /// Voltage (V).
    pub vdt: f64,
    /// Current at which it turns over (A), positive.
    pub i0: f64,
}

impl DeadTime {
    /// The vector (V) lost at the current vector `i` (A), in the stator's frame.
    #[inline]
    pub fn lost(&self, i: Stator) -> Stator {
        if self.vdt == 0.0 {
            return Stator::default();
        }
        clarke(inverse_clarke(i).map(|i| self.vdt * Scalar::tanh(i / self.i0)))
    }
}

/// Share of the period `0..1` for which each upper valve is on, for a stationary vector `u` (V) out of `vdc` (V): the
/// common part is placed so that the largest and smallest duty are equally far from their ends (space vector).
#[cfg(feature = "std")]
#[inline]
pub(super) fn duties(u: Stator, vdc: f64) -> [f64; 3] {
    let [a, b, c] = inverse_clarke(u);
    let middle = 0.5 * (Scalar::max(a, Scalar::max(b, c)) + Scalar::min(a, Scalar::min(b, c)));
    [a, b, c].map(|v| Scalar::clamp(0.5 + (v - middle) / vdc, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // Within the limit of space-vector modulation the duties make exactly the wanted vector; the circle of radius
        // vdc/sqrt(3) is the largest that fits.
        #[test]
        fn duties_make_the_vector(angle in 0.0..6.3f64, share in 0.0..1.0f64) {
            let vdc = 600.0;
            let v = share * vdc / 3f64.sqrt();
            let u = Stator { alpha: v * angle.cos(), beta: v * angle.sin() };
            let d = duties(u, vdc);
            for duty in d {
                prop_assert!((-1e-12..=1.0 + 1e-12).contains(&duty));
            }
            let made = clarke(d.map(|duty| duty * vdc));
            prop_assert!((made.alpha - u.alpha).abs() + (made.beta - u.beta).abs() < 1e-10);
        }
    }
}
