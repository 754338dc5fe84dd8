//! From three phases to the rotor and back: the Clarke and Park transforms.
//!
//! In the default, amplitude-invariant form a balanced set of phase peak `A` becomes a dq vector of length `A`
//! (thesis (3.1)). The power-invariant form (DQ0) is orthogonal. The thesis prints its matrix with the angle measured to
//! the *q* axis, [`Park::q_axis_angle`]; mixing the two up turns torque into flux.

use crate::scalar::Scalar;

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const INV_SQRT_3: f64 = 0.577_350_269_189_625_8;

crate::signals! {
    /// A vector in the frame of the stator, in the unit of the phases.
    pub struct Stator {
        /// Along the axis of phase a.
        alpha: "",
        /// 90 electrical degrees ahead of it.
        beta: "",
    }
}

/// The amplitude-invariant vector of three phases: `alpha = (2a - b - c)/3`, `beta = (b - c)/sqrt(3)`. Their common part
/// is lost.
#[inline(always)]
pub(super) fn clarke<S: Scalar>([a, b, c]: [S; 3]) -> Stator<S> {
    Stator { alpha: (a * 2.0 - b - c) / 3.0, beta: (b - c) * INV_SQRT_3 }
}

/// The three phases, without a common part, of a vector in the stator's frame.
#[inline(always)]
pub(super) fn inverse_clarke<S: Scalar>(stator: Stator<S>) -> [S; 3] {
    let (half, side) = (stator.alpha * 0.5, stator.beta * (SQRT_3 / 2.0));
    [stator.alpha, side - half, -side - half]
}

/// `(x, y)` seen from axes that stand at `angle` (electrical rad): from the stator to the rotor.
#[inline(always)]
pub(super) fn rotate_into<S: Scalar>((x, y): (S, S), angle: S) -> (S, S) {
    let (sin, cos) = angle.sin_cos();
    (x * cos + y * sin, y * cos - x * sin)
}

/// `(x, y)` given in axes that stand at `angle` (electrical rad), seen from axes at zero: from the rotor to the stator.
#[inline(always)]
pub(super) fn rotate_out_of<S: Scalar>((x, y): (S, S), angle: S) -> (S, S) {
    let (sin, cos) = angle.sin_cos();
    (x * cos - y * sin, y * cos + x * sin)
}

/// The Park transform in one of its conventions. Three phases are `[a, b, c]` (b is 120 electrical degrees behind a, c 240), a vector
/// in the frame of the rotor is `[d, q, zero]` (d along the magnet flux, q 90 electrical degrees ahead of it, zero what the phases
/// have in common), all in one unit (V, A or Wb).
///
/// ```
/// use greybox::pmsm::frames::Park;
/// let [a, b, _] = Park::amplitude_invariant().inverse([0.0, 100.0, 0.0], 0.0_f64);
/// assert!(a.abs() < 1e-12 && (b - 86.602540378).abs() < 1e-8); // q leads d: phase b is near its peak
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Park {
    /// dq amplitude over phase amplitude.
    dq: f64,
    /// Zero component over the mean of the phases.
    zero: f64,
    /// Angle to subtract from the caller's angle to obtain that of the d axis (rad).
    to_d: f64,
    /// Power over `ud id + uq iq`.
    power: f64,
    /// Power over `u0 i0`.
    zero_power: f64,
}

impl Park {
    /// dq vectors are as long as the phases' peak, the zero component is the mean of the phases; power is
    /// `3/2 (ud id + uq iq) + 3 u0 i0`. The convention of this library.
    pub const fn amplitude_invariant() -> Self {
        Park { dq: 1.0, zero: 1.0, to_d: 0.0, power: 1.5, zero_power: 3.0 }
    }

    /// DQ0: `sqrt(3/2)` times the amplitude-invariant dq, zero row `1/sqrt(3)`; orthogonal, power is
    /// `ud id + uq iq + u0 i0`.
    pub const fn power_invariant() -> Self {
        Park { dq: super::SQRT_3_2, zero: SQRT_3, to_d: 0.0, power: 1.0, zero_power: 1.0 }
    }

    /// Amplitude invariant, with the angle measured to the q axis: 90 electrical degrees more than the magnet's. So the
    /// thesis prints its matrix (q rows cosines, d rows sines).
    pub const fn q_axis_angle() -> Self {
        Park { to_d: core::f64::consts::FRAC_PI_2, ..Self::amplitude_invariant() }
    }

    /// The phases seen from the rotor at electrical angle `theta_e` (rad).
    #[inline]
    pub fn forward<S: Scalar>(&self, [a, b, c]: [S; 3], theta_e: S) -> [S; 3] {
        let stator = clarke([a, b, c]);
        let (d, q) = rotate_into((stator.alpha, stator.beta), theta_e - self.to_d);
        let mean = (a + b + c) / 3.0;
        [d * self.dq, q * self.dq, mean * self.zero]
    }

    /// The phases of a rotor vector at electrical angle `theta_e` (rad).
    #[inline]
    pub fn inverse<S: Scalar>(&self, [d, q, zero]: [S; 3], theta_e: S) -> [S; 3] {
        let (alpha, beta) = rotate_out_of((d / self.dq, q / self.dq), theta_e - self.to_d);
        let mean = zero / self.zero;
        inverse_clarke(Stator { alpha, beta }).map(|phase| phase + mean)
    }

    /// Power (W) of voltages `u` (V) and currents `i` (A) in this convention: the sum of `u i` over the phases.
    #[inline]
    pub fn power<S: Scalar>(&self, u: [S; 3], i: [S; 3]) -> S {
        (u[0] * i[0] + u[1] * i[1]) * self.power + u[2] * i[2] * self.zero_power
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;
    use proptest::prelude::*;

    fn phases() -> impl Strategy<Value = [f64; 3]> {
        [-1e3..1e3, -1e3..1e3, -1e3..1e3]
    }

    fn norm([a, b, c]: [f64; 3]) -> f64 {
        (a * a + b * b + c * c).sqrt()
    }

    proptest! {
        // Rounding of some twenty operations on the operands: 1e-12 of |u||i|.
        #[test]
        fn power_is_that_of_the_phases(u in phases(), i in phases(), theta_e in -20.0..20.0f64) {
            let truth = u[0] * i[0] + u[1] * i[1] + u[2] * i[2];
            for park in [Park::amplitude_invariant(), Park::power_invariant(), Park::q_axis_angle()] {
                let power = park.power(park.forward(u, theta_e), park.forward(i, theta_e));
                prop_assert!((power - truth).abs() <= 1e-12 * norm(u) * norm(i), "{park:?}: {power} for {truth}");
            }
        }

        #[test]
        fn the_inverse_undoes(u in phases(), theta_e in -20.0..20.0f64) {
            for park in [Park::amplitude_invariant(), Park::power_invariant(), Park::q_axis_angle()] {
                let back = park.inverse(park.forward(u, theta_e), theta_e);
                let error = norm([0, 1, 2].map(|phase| back[phase] - u[phase]));
                prop_assert!(error <= 1e-12 * norm(u));
            }
        }

        // The rows as the textbooks print them, against the two-step form used here.
        #[test]
        fn rows_are_those_of_the_textbook(u in phases(), th in -20.0..20.0f64) {
            let s = 2.0 * core::f64::consts::PI / 3.0;
            let d = 2.0 / 3.0 * (u[0] * th.cos() + u[1] * (th - s).cos() + u[2] * (th + s).cos());
            let q = -2.0 / 3.0 * (u[0] * th.sin() + u[1] * (th - s).sin() + u[2] * (th + s).sin());
            let is = Park::amplitude_invariant().forward(u, th);
            prop_assert!((is[0] - d).abs() + (is[1] - q).abs() <= 1e-12 * norm(u));
            // The thesis: q rows cosines, d rows sines, of an angle that is 90 degrees more.
            let is = Park::q_axis_angle().forward(u, th);
            let q = 2.0 / 3.0 * (u[0] * th.cos() + u[1] * (th - s).cos() + u[2] * (th + s).cos());
            let d = 2.0 / 3.0 * (u[0] * th.sin() + u[1] * (th - s).sin() + u[2] * (th + s).sin());
            prop_assert!((is[0] - d).abs() + (is[1] - q).abs() <= 1e-12 * norm(u));
            let same = Park::amplitude_invariant().forward(u, th - FRAC_PI_2);
            prop_assert!((is[0] - same[0]).abs() + (is[1] - same[1]).abs() <= 1e-12 * norm(u));
        }

        // Orthogonal: the length of the vector stays.
        #[test]
        fn power_invariant_keeps_length(u in phases(), theta_e in -20.0..20.0f64) {
            let is = Park::power_invariant().forward(u, theta_e);
            prop_assert!(((is[0] * is[0] + is[1] * is[1] + is[2] * is[2]).sqrt() - norm(u)).abs() <= 1e-12 * norm(u));
        }
    }
}
