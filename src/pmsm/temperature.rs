//! Effects of heat on a winding and a magnet, and temperatures from estimates.
//!
//! One kelvin is 0.393 % of the winding's resistance and 0.11 % of Ke, both relative to 20 C. The thesis' (3.19) has the
//! magnet's sign wrong and mixes absolute and relative slopes; the laws here are the corrected ones.

use super::MotorError;
use crate::dual::Dual;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Temperature coefficient of copper's resistance (1/K), relative to 20 C.
const COPPER: f64 = 0.003_93;
/// Reversible loss of magnet flux (1/K), relative to 20 C, up to `KNEE`.
const MAGNET: f64 = 0.001_1;
/// By how much that loss grows with each kelvin above `KNEE` (1/K^2).
const MAGNET_GROWTH: f64 = 1.6e-5;
/// Above this temperature (C) what a magnet loses does not come back.
const KNEE: f64 = 150.0;
/// Reference temperature of the laws (C).
const REFERENCE: f64 = 20.0;

/// A temperature (C) not below absolute zero.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct Celsius(f64);

impl Celsius {
    /// `degrees` Celsius.
    ///
    /// # Errors
    /// Below -273.15, infinite, or not a number.
    pub fn new(degrees: f64) -> Result<Self, MotorError> {
        if (-273.15..f64::INFINITY).contains(&degrees) {
            Ok(Celsius(degrees))
        } else {
            let must = "be finite and not below absolute zero (-273.15 C)";
            Err(MotorError::OutOfRange { quantity: "temperature", value: degrees, unit: "C", must })
        }
    }

    /// The number (C).
    pub const fn get(self) -> f64 {
        self.0
    }

    /// `R(t) / R(20 C) = 1 + 0.00393 (t - 20)` of a copper winding.
    pub fn winding_factor(self) -> f64 {
        1.0 + COPPER * (self.0 - REFERENCE)
    }

    /// `Ke(t) / Ke(20 C)` of a magnet that is at its hottest so far; for one that has been hotter, see [`Magnet`].
    pub fn magnet_factor(self, reading: Reading) -> f64 {
        let (rise, above) = (self.0 - REFERENCE, self.above_knee());
        match reading {
            Reading::Local => 1.0 - MAGNET * rise - 0.5 * MAGNET_GROWTH * above * above,
            Reading::Secant => 1.0 - (MAGNET + MAGNET_GROWTH * above) * rise,
        }
    }

    /// How far above 150 C (K); zero below it.
    fn above_knee(self) -> f64 {
        Scalar::max(self.0 - KNEE, 0.0)
    }
}

impl TryFrom<f64> for Celsius {
    type Error = MotorError;
    fn try_from(degrees: f64) -> Result<Self, MotorError> {
        Celsius::new(degrees)
    }
}

impl From<Celsius> for f64 {
    fn from(t: Celsius) -> f64 {
        t.0
    }
}

/// How the growth of the magnet's coefficient above 150 C is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reading {
    /// As a local slope: flux is its integral, `1 - 0.0011 (t - 20) - 0.8e-5 (t - 150)^2` (175 C: 0.8245).
    #[default]
    Local,
    /// As a secant coefficient `s(t)`, flux is `1 - s(t) (t - 20)` (175 C: 0.7675).
    Secant,
}

/// A magnet with its history: the flux that it lost above 150 C stays lost.
///
/// `Ke/Ke0 = (1 - ageing) [1 - 0.0011 (t - 20) - 0.8e-5 max(peak - 150, 0)^2]`
///
/// ```
/// use greybox::pmsm::temperature::{Celsius, Magnet};
/// let mut magnet = Magnet::default();
/// magnet.reach(Celsius::new(175.0)?);
/// assert!((magnet.factor(Celsius::new(20.0)?) - 0.995).abs() < 1e-12); // half a per cent is gone for good
/// # Ok::<(), greybox::pmsm::MotorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Magnet {
    peak: Celsius,
    ageing: f64,
}

impl Default for Magnet {
    /// A new magnet that was never above 20 C.
    fn default() -> Self {
        Magnet { peak: Celsius(REFERENCE), ageing: 0.0 }
    }
}

impl Magnet {
    /// The magnet with a share `loss` of its flux lost to age (0.01 to 0.02 over a life), within `0..1`.
    ///
    /// # Errors
    /// A share outside `0..1`.
    pub fn aged(self, loss: f64) -> Result<Self, MotorError> {
        if (0.0..1.0).contains(&loss) {
            Ok(Magnet { ageing: loss, ..self })
        } else {
            Err(MotorError::OutOfRange { quantity: "ageing", value: loss, unit: "of 1", must: "lie in 0..1" })
        }
    }

    /// Sets the magnet to temperature `t`; gives the share of the new magnet's flux at 20 C that this loses irreversibly, zero
    /// where all comes back on cooling.
    pub fn reach(&mut self, t: Celsius) -> f64 {
        let before = self.lost();
        if t > self.peak {
            self.peak = t;
        }
        self.lost() - before
    }

    /// Share of the flux that is lost irreversibly to heat: `0.8e-5 max(peak - 150, 0)^2`.
    pub fn lost(&self) -> f64 {
        0.5 * MAGNET_GROWTH * self.peak.above_knee() * self.peak.above_knee()
    }

    /// `Ke / Ke0` at temperature `t`; not below zero. The past counts, `t` itself only if [`Magnet::reach`]ed.
    pub fn factor(&self, t: Celsius) -> f64 {
        Scalar::max((1.0 - self.ageing) * (1.0 - MAGNET * (t.0 - REFERENCE) - self.lost()), 0.0)
    }
}

/// A number and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimated {
    /// The estimate.
    pub value: f64,
    /// Its standard error, same unit.
    pub std: f64,
}

impl Estimated {
    /// Rise (K) of the winding between a cold and a warm estimate of the resistance, `dT = (R_warm - R_cold) / (0.00393
    /// R20)`.
    ///
    /// `cold` and `warm` may contain the cable (it cancels); `r20` is the *motor's* phase resistance at 20 C alone: with the
    /// cable in it, 35 K read 22 K on the reference robot. The three errors are taken as independent.
    ///
    /// # Errors
    /// An `r20` that is not positive; a result that is not finite.
    pub fn winding_rise(cold: Estimated, warm: Estimated, r20: Estimated) -> Result<Estimated, MotorError> {
        MotorError::positive("resistance of the motor at 20 C", r20.value, "ohm")?;
        propagate([cold, warm, r20], |[cold, warm, r20]| (warm - cold) / (r20 * COPPER))
    }

    /// The same from the change of the resistance between a cold and a warm record of one motion, as
    /// [`Regression::change`](crate::regress::Regression::change) finds it: what the equations miss repeats in both records and
    /// cancels, which independent errors do not allow for. What multiplies both resistances does not cancel; it acts as an error of
    /// `r20` does, and so is counted there: one within 0.2 % is a standard error of `0.002 / sqrt(3)` of `r20`.
    ///
    /// # Errors
    /// As [`winding_rise`](Self::winding_rise).
    pub fn winding_rise_by(change: Estimated, r20: Estimated) -> Result<Estimated, MotorError> {
        MotorError::positive("resistance of the motor at 20 C", r20.value, "ohm")?;
        propagate([change, r20], |[change, r20]| change / (r20 * COPPER))
    }

    /// Rise (K) of the magnet between a cold and a warm estimate of Ke, below 150 C; `cold_at` is the temperature of the
    /// cold one. The two errors are taken as independent.
    ///
    /// # Errors
    /// A cold Ke that is not positive, a `cold_at` at which no flux is left; a result that is not finite.
    pub fn magnet_rise(cold: Estimated, warm: Estimated, cold_at: Celsius) -> Result<Estimated, MotorError> {
        MotorError::positive("Ke of the cold motor", cold.value, "V s/rad")?;
        let cold_factor = MotorError::positive(
            "magnet factor at the cold temperature",
            cold_at.magnet_factor(Reading::Local),
            "of 1",
        )?;
        propagate([cold, warm], |[cold, warm]| (cold - warm) / (cold * (MAGNET / cold_factor)))
    }
}

/// First-order propagation of independent errors.
fn propagate<const N: usize>(of: [Estimated; N], f: impl Fn([Dual<N>; N]) -> Dual<N>) -> Result<Estimated, MotorError> {
    let result = f(core::array::from_fn(|i| Dual::variable(of[i].value, i)));
    let variance: f64 = result.slopes.iter().zip(of).map(|(slope, e)| (slope * e.std) * (slope * e.std)).sum();
    Ok(Estimated {
        value: MotorError::finite("temperature rise", result.value, "K")?,
        std: MotorError::finite("standard error of the temperature rise", Scalar::sqrt(variance), "K")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn at(degrees: f64) -> Celsius {
        Celsius::new(degrees).unwrap()
    }

    #[test]
    fn published_values() {
        assert_relative_eq!(at(55.0).winding_factor(), 1.137_55, max_relative = 1e-15);
        assert_relative_eq!(at(175.0).magnet_factor(Reading::Local), 0.8245, max_relative = 1e-14);
        assert_relative_eq!(at(175.0).magnet_factor(Reading::Secant), 0.7675, max_relative = 1e-14);
        assert_relative_eq!(at(55.0).magnet_factor(Reading::Local), 0.9615, max_relative = 1e-14);
    }

    proptest! {
        #[test]
        fn both_readings_agree_up_to_the_knee(t in -40.0..=150.0) {
            prop_assert_eq!(at(t).magnet_factor(Reading::Local), at(t).magnet_factor(Reading::Secant));
        }

        // Local: the slope is 0.0011 + 1.6e-5 (t - 150), by a central difference of a parabola (exact but for rounding).
        #[test]
        fn local_slope_grows_by_the_rate(t in 152.0..250.0f64) {
            let slope = (at(t + 1.0).magnet_factor(Reading::Local) - at(t - 1.0).magnet_factor(Reading::Local)) / 2.0;
            prop_assert!((slope + MAGNET + MAGNET_GROWTH * (t - KNEE)).abs() < 1e-14);
        }

        #[test]
        fn a_magnet_on_its_way_up_follows_the_law_and_on_its_way_down_does_not_return(t in 20.0..250.0f64) {
            let mut magnet_ = Magnet::default();
            magnet_.reach(at(t));
            prop_assert!((magnet_.factor(at(t)) - at(t).magnet_factor(Reading::Local)).abs() < 1e-14);
            let cooled = magnet_.factor(at(REFERENCE));
            prop_assert!((1.0 - cooled - magnet_.lost()).abs() < 1e-14);
            prop_assert_eq!(magnet_.reach(at(t.min(100.0))), 0.0);
        }

        #[test]
        fn rises_are_read_back(rise in 1.0..100.0f64, r20 in 0.1..2.0, cable in 0.0..2.0, ke in 0.1..2.0) {
            let known = |value| Estimated { value, std: 0.0 };
            let (cold, warm) = (at(25.0), at(25.0 + rise));
            let winding_read = Estimated::winding_rise(
                known(r20 * cold.winding_factor() + cable), known(r20 * warm.winding_factor() + cable), known(r20)).unwrap();
            prop_assert!((winding_read.value - rise).abs() < 1e-9);
            let factor = |t: Celsius| t.magnet_factor(Reading::Local);
            let magnet_read = Estimated::magnet_rise(known(ke * factor(cold)), known(ke * factor(warm)), cold).unwrap();
            prop_assert!((magnet_read.value - rise).abs() < 1e-9);
        }
    }

    // 0.001 ohm of a 0.4 ohm motor is 0.636 K; twice, in quadrature.
    #[test]
    fn uncertainty_is_propagated() {
        let e = |value, std| Estimated { value, std };
        let read = Estimated::winding_rise(e(0.63, 1e-3), e(0.685, 1e-3), e(0.4, 0.0)).unwrap();
        assert_relative_eq!(read.std, 2f64.sqrt() * 1e-3 / (COPPER * 0.4), max_relative = 1e-12);
        // The same of a change that is known to so much; half a percent of r20 is half a percent of the rise.
        let by = Estimated::winding_rise_by(e(0.055, 2f64.sqrt() * 1e-3), e(0.4, 0.0)).unwrap();
        assert_relative_eq!(by.value, read.value, max_relative = 1e-12);
        assert_relative_eq!(by.std, read.std, max_relative = 1e-12);
        let by = Estimated::winding_rise_by(e(0.055, 0.0), e(0.4, 0.002)).unwrap();
        assert_relative_eq!(by.std, 0.005 * by.value, max_relative = 1e-12);
        assert!(Estimated::winding_rise_by(e(0.055, 0.0), e(0.0, 0.0)).is_err());
        // SPEC: with the cable in the denominator, 35 K read 22 K.
        let with_cable =
            Estimated::winding_rise(e(0.63, 0.0), e(0.63 + 35.0 * COPPER * 0.4, 0.0), e(0.63, 0.0)).unwrap();
        assert_relative_eq!(with_cable.value, 22.2, epsilon = 0.1);
    }

    #[test]
    fn impossible_temperatures_are_refused() {
        assert!(Celsius::new(-300.0).unwrap_err().to_string().contains("absolute zero"));
        assert!(Celsius::new(f64::NAN).is_err());
        let mut magnet = Magnet::default();
        assert!((magnet.reach(at(180.0)) - 0.8e-5 * 30.0 * 30.0).abs() < 1e-15);
        magnet.reach(at(900.0));
        assert_eq!(magnet.factor(at(900.0)), 0.0, "no flux is left");
        assert!(magnet.aged(1.5).is_err());
    }
}
