//! Injection of d current, which makes the resistance visible: torque hardly moves, the d axis does.
//!
//! Resistance and back-EMF are found in turns, and the error of one is in the other. With the law of the d axis
//! ([`RsDirect`](super::RsDirect)) at rest on a step of the staircase, and the back-EMF at rest before, one period leaves
//! `iq/(iq + (rs/ls + F) id/we)` of the resistance's error. So the pull `F` must be strong, or `id` of the sign that makes
//! the denominator grow; else alternating between the two diverges.

use super::MotorError;
use serde::{Deserialize, Serialize};

/// A staircase of d current, 0, A/2, A, repeated after a rest; the back-EMF's estimate is frozen meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Injection {
    amplitude: f64,
    step: f64,
    settle: f64,
    period: f64,
}

impl Injection {
    /// Steps of 0, A/2 and A amperes (`amplitude` A, negative weakens the field) of `step` seconds each, of which the
    /// first `settle` seconds are not used, every `period` seconds.
    ///
    /// # Errors
    /// An amplitude of zero; times that are not positive, or do not fit into one another.
    pub fn new(amplitude: f64, step: f64, settle: f64, period: f64) -> Result<Self, MotorError> {
        let refuse = |quantity, value, unit, must| Err(MotorError::OutOfRange { quantity, value, unit, must });
        if amplitude == 0.0 || !amplitude.is_finite() {
            return refuse(
                "injected d current",
                amplitude,
                "A",
                "be a number other than zero, or nothing is seen of the resistance",
            );
        }
        let step = MotorError::positive("duration of a step", step, "s")?;
        if !(0.0..step).contains(&settle) {
            return refuse("settling time", settle, "s", "be zero or more and shorter than a step");
        }
        if !(period >= 3.0 * step + settle && period.is_finite()) {
            return refuse("injection period", period, "s", "hold three steps and the settling after them");
        }
        Ok(Injection { amplitude, step, settle, period })
    }

    /// Number of the step at time `t` (s), three or more in the rest; and the time since it began. The first step starts at 0.
    fn step(&self, t: f64) -> (f64, f64) {
        let into = crate::Scalar::rem_euclid(t, self.period);
        let number = crate::Scalar::min(crate::Scalar::floor(into / self.step), 3.0);
        (number, into - number * self.step)
    }

    /// Reference of the d current (A) at time `t` (s).
    pub fn id(&self, t: f64) -> f64 {
        match self.step(t) {
            (number, _) if number < 3.0 => self.amplitude * number * 0.5,
            _ => 0.0,
        }
    }

    /// Whether the back-EMF may be adapted at time `t` (s): not under injection, nor until its transient has gone.
    pub fn adapts_ke(&self, t: f64) -> bool {
        let (number, since) = self.step(t);
        number >= 3.0 && since >= self.settle
    }

    /// Whether the resistance may be adapted at time `t` (s): on a step, once the current has settled.
    pub fn adapts_rs(&self, t: f64) -> bool {
        let (number, since) = self.step(t);
        number < 3.0 && since >= self.settle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbs_rests_and_repeats() {
        let injection = Injection::new(-8.0, 0.1, 0.02, 1.0).unwrap();
        let at = |t: f64| (injection.id(t), injection.adapts_ke(t), injection.adapts_rs(t));
        for t in [0.0, 3.0] {
            assert_eq!(at(t + 0.01), (0.0, false, false));
            assert_eq!(at(t + 0.05), (0.0, false, true));
            assert_eq!(at(t + 0.11), (-4.0, false, false));
            assert_eq!(at(t + 0.15), (-4.0, false, true));
            assert_eq!(at(t + 0.25), (-8.0, false, true));
            assert_eq!(at(t + 0.31), (0.0, false, false));
            assert_eq!(at(t + 0.33), (0.0, true, false));
        }
        assert_eq!(at(-0.05), at(0.95));
    }

    #[test]
    fn refuses_what_cannot_be() {
        for (amplitude, step, settle, period) in [
            (0.0, 0.1, 0.0, 1.0),
            (f64::NAN, 0.1, 0.0, 1.0),
            (1.0, 0.0, 0.0, 1.0),
            (1.0, 0.1, 0.1, 1.0),
            (1.0, 0.1, 0.0, 0.2),
        ] {
            assert!(Injection::new(amplitude, step, settle, period).is_err());
        }
        let error = Injection::new(1.0, 0.1, 0.0, 0.2).unwrap_err().to_string();
        assert_eq!(error, "injection period is 0.2 s; it must hold three steps and the settling after them");
    }
}
