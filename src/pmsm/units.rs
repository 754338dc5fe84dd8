//! Named conversions between the conventions of motor data sheets, bridges and simulators and those of this library.
//!
//! Each is written for any [`Scalar`], so that the uncertainty of an estimate goes through it with the slopes.

use super::{MotorError, PolePairs, SQRT_2_3, SQRT_3_2};
use crate::scalar::Scalar;
use core::f64::consts::{FRAC_1_SQRT_2, PI};
use serde::{Deserialize, Serialize};

const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// How the amplitude of a voltage, EMF or current is given where it is not the phase peak.
///
/// ```
/// use greybox::pmsm::units::Amplitude;
/// assert!((Amplitude::LineRms.to_phase_peak(400.0_f64) - 326.6).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Amplitude {
    /// Phase, rms.
    PhaseRms,
    /// Line to line, peak.
    LinePeak,
    /// Line to line, rms.
    LineRms,
}

impl Amplitude {
    /// This amplitude of a phase peak of one.
    const fn of_one(self) -> f64 {
        match self {
            Amplitude::PhaseRms => FRAC_1_SQRT_2,
            Amplitude::LinePeak => SQRT_3,
            Amplitude::LineRms => SQRT_3_2,
        }
    }

    /// The phase peak of what is given so, in the same unit.
    #[inline]
    pub fn to_phase_peak<S: Scalar>(self, amplitude: S) -> S {
        amplitude / self.of_one()
    }

    /// This amplitude of a phase peak, in the same unit.
    #[inline]
    pub fn from_phase_peak<S: Scalar>(self, phase_peak: S) -> S {
        phase_peak * self.of_one()
    }
}

/// How a motor's constant of EMF or torque is given where it is not `Ke` (V s/rad, line-to-line rms).
///
/// ```
/// use greybox::pmsm::{PolePairs, units::Constant};
/// let ke = Constant::FluxLinkage(PolePairs::new(3)?).to_ke(0.545_f64);
/// assert!((ke - 2.002_46).abs() < 5e-6);
/// # Ok::<(), greybox::pmsm::MotorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Constant {
    /// `Kt` in N m per ampere of *peak* iq: `sqrt(3/2) Ke`.
    TorquePerPeak,
    /// `Kt` in N m per ampere *rms*: `sqrt(3) Ke`.
    TorquePerRms,
    /// The magnet flux linkage `psi_m` (Wb, peak) of a motor with so many pole pairs: `Ke = sqrt(3/2) np psi_m`.
    FluxLinkage(PolePairs),
    /// Volts (line-to-line rms) per 1000 revolutions per minute.
    VoltsPerKrpm,
}

impl Constant {
    /// `Ke` (V s/rad, line-to-line rms) of what is given so.
    #[inline]
    pub fn to_ke<S: Scalar>(self, constant: S) -> S {
        match self {
            Constant::TorquePerPeak => constant * SQRT_2_3,
            Constant::TorquePerRms => constant / SQRT_3,
            Constant::FluxLinkage(np) => constant * (SQRT_3_2 * np.get()),
            Constant::VoltsPerKrpm => constant * (60.0 / (2000.0 * PI)),
        }
    }

    /// This constant of a motor with `Ke` (V s/rad, line-to-line rms).
    #[inline]
    pub fn from_ke<S: Scalar>(self, ke: S) -> S {
        match self {
            Constant::TorquePerPeak => ke * SQRT_3_2,
            Constant::TorquePerRms => ke * SQRT_3,
            Constant::FluxLinkage(np) => ke * SQRT_2_3 / np.get(),
            Constant::VoltsPerKrpm => ke * (2000.0 * PI / 60.0),
        }
    }
}

/// Phase resistance (ohm) or synchronous inductance (H) from the one measured between two terminals, the third open:
/// *half* of it, for two phases are in series (not `1/sqrt(3)`, which is for voltages).
#[inline]
pub fn phase_from_terminals<S: Scalar>(between_terminals: S) -> S {
    between_terminals * 0.5
}

/// A motor cable with copper conductors, one per phase.
///
/// ```
/// use greybox::pmsm::units::Cable;
/// let cable = Cable { length: 20.0, cross_section: 1.5 };
/// assert!((cable.resistance()? - 0.23).abs() < 1e-3); // axes 1 to 3 of the reference robot
/// # Ok::<(), greybox::pmsm::MotorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cable {
    /// Length, one way (m).
    pub length: f64,
    /// Cross-section of one conductor (mm^2).
    pub cross_section: f64,
}

impl Cable {
    /// Resistivity of annealed copper at 20 C: 0.017241 ohm mm^2/m (IEC 60028).
    pub const COPPER: f64 = 0.017_241;

    /// Resistance per phase at 20 C (ohm), to be added to the motor's; linear in the length.
    ///
    /// # Errors
    /// A length below zero, a cross-section that is not positive.
    pub fn resistance(&self) -> Result<f64, MotorError> {
        let length = if self.length == 0.0 { 0.0 } else { MotorError::positive("cable length", self.length, "m")? };
        let cross_section = MotorError::positive("cable cross-section", self.cross_section, "mm^2")?;
        Ok(Self::COPPER * length / cross_section)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    proptest! {
        // A pair of conversions is two roundings.
        #[test]
        fn pairs_undo_each_other(x in 1e-6..1e6, count in 1u32..50) {
            let np = PolePairs::new(count).unwrap();
            let amplitudes = [Amplitude::PhaseRms, Amplitude::LinePeak, Amplitude::LineRms];
            let constants =
                [Constant::TorquePerPeak, Constant::TorquePerRms, Constant::FluxLinkage(np), Constant::VoltsPerKrpm];
            let amplitudes = amplitudes.map(|unit| unit.to_phase_peak(unit.from_phase_peak(x)));
            let constants = constants.map(|unit| unit.to_ke(unit.from_ke(x)));
            for back in amplitudes.into_iter().chain(constants).chain([np.mechanical(np.electrical(x))]) {
                assert_relative_eq!(back, x, max_relative = 1e-15 * 4.0);
            }
        }

        // One chain of definitions: torque times speed is the power that the EMF takes from the phases.
        #[test]
        fn torque_constant_is_that_of_the_power(ke in 1e-3..10.0, w in -500.0..500.0, iq in -100.0..100.0) {
            let emf = Amplitude::LineRms.to_phase_peak(ke) * w;
            assert_relative_eq!(Constant::TorquePerPeak.from_ke(ke) * iq * w, 1.5 * emf * iq, max_relative = 1e-14);
            let (iq_rms, emf_rms) = (Amplitude::PhaseRms.from_phase_peak(iq), Amplitude::PhaseRms.from_phase_peak(emf));
            assert_relative_eq!(Constant::TorquePerRms.from_ke(ke) * iq_rms * w, 3.0 * emf_rms * iq_rms, max_relative = 1e-14);
        }

        #[test]
        fn flux_emf_and_torque_agree(psi_m in 1e-4..2.0, count in 1u32..50) {
            let np = PolePairs::new(count).unwrap();
            let ke = Constant::FluxLinkage(np).to_ke(psi_m);
            // Torque per ampere of peak iq is 3/2 np psi_m.
            let kt = Constant::TorquePerPeak.from_ke(ke);
            assert_relative_eq!(kt, 1.5 * np.get() * psi_m, max_relative = 1e-14);
            // (3.7): peak phase EMF per mechanical rad/s is np psi_m.
            assert_relative_eq!(Amplitude::LineRms.to_phase_peak(ke), np.get() * psi_m, max_relative = 1e-14);
        }
    }

    // 2000 pi / 60 = 104.7198.
    #[test]
    fn volts_per_thousand_revolutions() {
        assert_relative_eq!(Constant::VoltsPerKrpm.from_ke(0.95), 99.4838, epsilon = 5e-5);
    }

    // The independent drive of the motulator records: np 3, 0.545 Wb.
    #[test]
    fn ke_of_a_known_motor() {
        let ke = Constant::FluxLinkage(PolePairs::new(3).unwrap()).to_ke(0.545);
        assert_relative_eq!(ke, 2.002_46, epsilon = 5e-6);
    }

    // Between two terminals with the rotor still, one phase carries i and another -i. The third is open.
    #[test]
    fn terminals_see_two_phases_in_series() {
        use crate::pmsm::frames::Park;
        let (rs, i) = (0.4, 7.0);
        let volts = [rs * i, -rs * i, 0.0];
        assert_relative_eq!(phase_from_terminals((volts[0] - volts[1]) / i), rs, max_relative = 1e-15);
        let [d, ..] = Park::amplitude_invariant().forward(volts, 0.3);
        let [current, ..] = Park::amplitude_invariant().forward([i, -i, 0.0], 0.3);
        assert_relative_eq!(d / current, rs, max_relative = 1e-14);
    }

    #[test]
    fn bad_cables_are_refused() {
        assert!(Cable { length: -1.0, cross_section: 1.0 }.resistance().is_err());
        let error = Cable { length: 1.0, cross_section: 0.0 }.resistance().unwrap_err();
        assert_eq!(error.to_string(), "cable cross-section is 0 mm^2; it must be positive and finite");
        assert_eq!(PolePairs::new(0), Err(MotorError::NoPolePairs));
    }
}
