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

/// What an [`Injection`] asks for at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InjectionStep {
    /// Reference of the d current (A).
    pub id: f64,
    /// Whether the back-EMF may be adapted: not under injection, nor until its transient has gone.
    pub adapt_ke: bool,
    /// Whether the resistance may be adapted: on a step, once the current has settled.
    pub adapt_rs: bool,
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

    /// What to do at time `t` (s); the first step starts at 0.
    pub fn at(&self, t: f64) -> InjectionStep {
        let into = crate::Scalar::rem_euclid(t, self.period);
        let number = crate::Scalar::floor(into / self.step);
        let settled = into - number * self.step >= self.settle;
        if number == 0.0 {
            InjectionStep { id: 0.0, adapt_ke: false, adapt_rs: settled }
        } else if number < 3.0 {
            InjectionStep { id: self.amplitude * number * 0.5, adapt_ke: false, adapt_rs: settled }
        } else {
            InjectionStep { id: 0.0, adapt_ke: into - 3.0 * self.step >= self.settle, adapt_rs: false }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbs_rests_and_repeats() {
        let injection = Injection::new(-8.0, 0.1, 0.02, 1.0).unwrap();
        let step = |id, adapt_ke, adapt_rs| InjectionStep { id, adapt_ke, adapt_rs };
        for t in [0.0, 3.0] {
            assert_eq!(injection.at(t + 0.01), step(0.0, false, false));
            assert_eq!(injection.at(t + 0.05), step(0.0, false, true));
            assert_eq!(injection.at(t + 0.11), step(-4.0, false, false));
            assert_eq!(injection.at(t + 0.15), step(-4.0, false, true));
            assert_eq!(injection.at(t + 0.25), step(-8.0, false, true));
            assert_eq!(injection.at(t + 0.31), step(0.0, false, false));
            assert_eq!(injection.at(t + 0.33), step(0.0, true, false));
        }
        assert_eq!(injection.at(-0.05), injection.at(0.95));
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
