//! Sensors of a drive: two phase currents and the angle.

use super::frames::{Stator, clarke, inverse_clarke};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Current sensors in phases a and b; phase c follows from a star point that is not connected.
///
/// The reading is `gain (i + noise) + offset`, rounded to `step`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurrentSensors {
    /// Rms noise (A).
    pub noise: f64,
    /// Step of the converter (A); zero for none.
    pub step: f64,
    /// Gain of the sensors of phases a and b; 1 without error.
    pub gain: [f64; 2],
    /// Offset of the sensors of phases a and b (A).
    pub offset: [f64; 2],
}

impl CurrentSensors {
    /// Exact.
    pub const IDEAL: Self = CurrentSensors { noise: 0.0, step: 0.0, gain: [1.0; 2], offset: [0.0; 2] };

    /// 12 bits over `+-i_max` (A), noise 0.02 A at 30 A in proportion to the range.
    pub fn twelve_bit(i_max: f64) -> Self {
        CurrentSensors { noise: 0.02 * i_max / 30.0, step: 2.0 * i_max / 4096.0, ..Self::IDEAL }
    }

    /// The current vector (A, stator frame) as read; `draws` are two independent standard normal numbers.
    #[inline]
    pub fn read(&self, i: Stator, draws: [f64; 2]) -> Stator {
        let [a, b, _] = inverse_clarke(i);
        let read = |i: f64, k: usize| round_to(self.gain[k] * (i + self.noise * draws[k]) + self.offset[k], self.step);
        let (a, b) = (read(a, 0), read(b, 1));
        clarke([a, b, -a - b])
    }
}

/// An absolute angle sensor on the shaft with its converter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resolver {
    /// Rms noise (rad).
    pub noise: f64,
    /// Unevenness `e` (rad): it adds `e [sin th + 0.5 sin(2 th + 0.7) + 0.3 sin 8 th]`.
    pub unevenness: f64,
    /// Step of the converter (rad); zero for none.
    pub step: f64,
    /// Angle by which the reading is ahead (rad, mechanical).
    pub offset: f64,
}

impl Resolver {
    /// Exact.
    pub const IDEAL: Self = Resolver { noise: 0.0, unevenness: 0.0, step: 0.0, offset: 0.0 };

    /// 16 bits per revolution, 20 urad noise, 0.3 mrad unevenness.
    pub const SIXTEEN_BIT: Self =
        Resolver { noise: 20e-6, unevenness: 3e-4, step: core::f64::consts::TAU / 65536.0, offset: 0.0 };

    /// The angle `theta` (rad, mechanical, not wrapped) as read; `draw` is a standard normal number.
    #[inline]
    pub fn read(&self, theta: f64, draw: f64) -> f64 {
        let mut uneven = 0.0;
        if self.unevenness != 0.0 {
            let wave = |n: f64, phase: f64| Scalar::sin(n * theta + phase);
            uneven = self.unevenness * (wave(1.0, 0.0) + 0.5 * wave(2.0, 0.7) + 0.3 * wave(8.0, 0.0));
        }
        round_to(theta + uneven + self.noise * draw + self.offset, self.step)
    }
}

#[inline]
fn round_to(value: f64, step: f64) -> f64 {
    if step > 0.0 { Scalar::round(value / step) * step } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ideal_sensor_reads_the_truth() {
        let i = Stator { alpha: 3.0, beta: -4.0 };
        let read = CurrentSensors::IDEAL.read(i, [1.0, -1.0]);
        assert!((read.alpha - 3.0).abs() + (read.beta + 4.0).abs() < 1e-14);
        assert_eq!(Resolver::IDEAL.read(1.234, 2.0), 1.234);
    }

    // Rounding moves a reading by half a step at most; the two phases make the vector: 2/3 and more of it.
    #[test]
    fn rounding_is_within_half_a_step() {
        let sensors = CurrentSensors { noise: 0.0, ..CurrentSensors::twelve_bit(60.0) };
        assert_eq!(sensors.step, 120.0 / 4096.0);
        for k in 0..200 {
            let angle = 0.1 * k as f64;
            let i = Stator { alpha: 7.0 * angle.cos(), beta: 7.0 * angle.sin() };
            let read = sensors.read(i, [0.0; 2]);
            assert!((read.alpha - i.alpha).abs() <= 0.5 * sensors.step + 1e-12);
            // beta = (a + 2 b)/sqrt(3): errors of both phases.
            assert!((read.beta - i.beta).abs() <= 1.5 / 3f64.sqrt() * sensors.step + 1e-12);
            let resolver = Resolver { noise: 0.0, unevenness: 0.0, ..Resolver::SIXTEEN_BIT };
            assert!((resolver.read(angle, 0.0) - angle).abs() <= 0.5 * resolver.step + 1e-15);
        }
    }
}
