//! Named conversions between the conventions of motor data sheets, bridges and simulators and those of this library.
//!
//! Each is written for any [`Scalar`], so that the uncertainty of an estimate goes through it with the slopes.

use super::{MotorError, PolePairs, SQRT_2_3, SQRT_3_2};
use crate::scalar::Scalar;
use core::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};
use serde::{Deserialize, Serialize};

const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// Line-to-line voltage or EMF from the phase value: times `sqrt(3)` (both rms or both peak).
#[inline]
pub fn line_from_phase<S: Scalar>(phase: S) -> S {
    phase * SQRT_3
}

/// Phase voltage or EMF from the line-to-line value.
#[inline]
pub fn phase_from_line<S: Scalar>(line: S) -> S {
    line / SQRT_3
}

/// Rms of a sine from its peak.
#[inline]
pub fn rms_from_peak<S: Scalar>(peak: S) -> S {
    peak * FRAC_1_SQRT_2
}

/// Peak of a sine from its rms.
#[inline]
pub fn peak_from_rms<S: Scalar>(rms: S) -> S {
    rms * SQRT_2
}

/// Phase peak from line-to-line rms: times `sqrt(2/3)`.
#[inline]
pub fn phase_peak_from_line_rms<S: Scalar>(line_rms: S) -> S {
    line_rms * SQRT_2_3
}

/// Line-to-line rms from phase peak: times `sqrt(3/2)`.
#[inline]
pub fn line_rms_from_phase_peak<S: Scalar>(phase_peak: S) -> S {
    phase_peak * SQRT_3_2
}

/// Phase resistance (ohm) or synchronous inductance (H) from the one measured between two terminals, the third open:
/// *half* of it, for two phases are in series (not `1/sqrt(3)`, which is for voltages).
#[inline]
pub fn phase_from_terminals<S: Scalar>(between_terminals: S) -> S {
    between_terminals * 0.5
}

/// Resistance or inductance between two terminals from the phase value: twice.
#[inline]
pub fn terminals_from_phase<S: Scalar>(phase: S) -> S {
    phase * 2.0
}

/// `Kt` (N m per ampere of peak iq) from `Ke` (V s/rad, line-to-line rms): `sqrt(3/2) Ke`.
#[inline]
pub fn kt_from_ke<S: Scalar>(ke: S) -> S {
    ke * SQRT_3_2
}

/// `Kt` in N m per ampere *rms* from `Ke`: `sqrt(3) Ke`.
#[inline]
pub fn kt_per_rms_from_ke<S: Scalar>(ke: S) -> S {
    ke * SQRT_3
}

/// `Ke` (V s/rad, line-to-line rms) from `Kt` (N m per ampere of peak iq).
#[inline]
pub fn ke_from_kt<S: Scalar>(kt: S) -> S {
    kt * SQRT_2_3
}

/// `Ke` (V s/rad, line-to-line rms) from `Kt` in N m per ampere *rms*.
#[inline]
pub fn ke_from_kt_per_rms<S: Scalar>(kt: S) -> S {
    kt / SQRT_3
}

/// `Ke` (V s/rad, line-to-line rms) from the magnet flux linkage `psi_m` (Wb, peak): `sqrt(3/2) np psi_m`.
#[inline]
pub fn ke_from_psi_m<S: Scalar>(psi_m: S, np: PolePairs) -> S {
    psi_m * (SQRT_3_2 * np.get())
}

/// Magnet flux linkage `psi_m` (Wb, peak) from `Ke`.
#[inline]
pub fn psi_m_from_ke<S: Scalar>(ke: S, np: PolePairs) -> S {
    ke * SQRT_2_3 / np.get()
}

/// `Kt` (N m per ampere of peak iq) from `psi_m`: `3/2 np psi_m`.
#[inline]
pub fn kt_from_psi_m<S: Scalar>(psi_m: S, np: PolePairs) -> S {
    psi_m * (1.5 * np.get())
}

/// `Ke` (V s/rad) from the data sheets' volts (line-to-line rms) per 1000 revolutions per minute.
#[inline]
pub fn ke_from_volts_per_krpm<S: Scalar>(volts: S) -> S {
    volts * (60.0 / (2000.0 * PI))
}

/// Volts (line-to-line rms) per 1000 revolutions per minute from `Ke`.
#[inline]
pub fn volts_per_krpm_from_ke<S: Scalar>(ke: S) -> S {
    ke * (2000.0 * PI / 60.0)
}

/// rad/s from revolutions per minute.
#[inline]
pub fn rad_per_s_from_rpm<S: Scalar>(rpm: S) -> S {
    rpm * (PI / 30.0)
}

/// Revolutions per minute from rad/s.
#[inline]
pub fn rpm_from_rad_per_s<S: Scalar>(w: S) -> S {
    w * (30.0 / PI)
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
            for back in [
                phase_from_line(line_from_phase(x)), peak_from_rms(rms_from_peak(x)),
                phase_peak_from_line_rms(line_rms_from_phase_peak(x)), phase_from_terminals(terminals_from_phase(x)),
                ke_from_kt(kt_from_ke(x)), ke_from_kt_per_rms(kt_per_rms_from_ke(x)),
                psi_m_from_ke(ke_from_psi_m(x, np), np), ke_from_volts_per_krpm(volts_per_krpm_from_ke(x)),
                rpm_from_rad_per_s(rad_per_s_from_rpm(x)), np.mechanical(np.electrical(x)),
            ] {
                assert_relative_eq!(back, x, max_relative = 1e-15 * 4.0);
            }
        }

        // One chain of definitions: torque times speed is the power that the EMF takes from the phases.
        #[test]
        fn torque_constant_is_that_of_the_power(ke in 1e-3..10.0, w in -500.0..500.0, iq in -100.0..100.0) {
            let emf = phase_peak_from_line_rms(ke) * w;
            assert_relative_eq!(kt_from_ke(ke) * iq * w, 1.5 * emf * iq, max_relative = 1e-14);
            let (iq_rms, emf_rms) = (rms_from_peak(iq), rms_from_peak(emf));
            assert_relative_eq!(kt_per_rms_from_ke(ke) * iq_rms * w, 3.0 * emf_rms * iq_rms, max_relative = 1e-14);
        }

        #[test]
        fn flux_emf_and_torque_agree(psi_m in 1e-4..2.0, count in 1u32..50) {
            let np = PolePairs::new(count).unwrap();
            let ke = ke_from_psi_m(psi_m, np);
            assert_relative_eq!(kt_from_ke(ke), kt_from_psi_m(psi_m, np), max_relative = 1e-14);
            // (3.7): peak phase EMF per mechanical rad/s is np psi_m.
            assert_relative_eq!(phase_peak_from_line_rms(ke), np.get() * psi_m, max_relative = 1e-14);
        }
    }

    // The independent drive of the motulator records: np 3, 0.545 Wb.
    #[test]
    fn ke_of_a_known_motor() {
        let ke = ke_from_psi_m(0.545, PolePairs::new(3).unwrap());
        assert_relative_eq!(ke, 2.002_46, epsilon = 5e-6);
    }

    // Between two terminals with the rotor still, one phase carries i and another -i. The third is open.
    #[test]
    fn terminals_see_two_phases_in_series() {
        use crate::pmsm::frames::{Park, Phases};
        let (rs, i) = (0.4, 7.0);
        let volts = Phases { a: rs * i, b: -rs * i, c: 0.0 };
        assert_relative_eq!(phase_from_terminals((volts.a - volts.b) / i), rs, max_relative = 1e-15);
        let dq = Park::amplitude_invariant().forward(volts, 0.3);
        let current = Park::amplitude_invariant().forward(Phases { a: i, b: -i, c: 0.0 }, 0.3);
        assert_relative_eq!(dq.d / current.d, rs, max_relative = 1e-14);
    }

    #[test]
    fn bad_cables_are_refused() {
        assert!(Cable { length: -1.0, cross_section: 1.0 }.resistance().is_err());
        let error = Cable { length: 1.0, cross_section: 0.0 }.resistance().unwrap_err();
        assert_eq!(error.to_string(), "cable cross-section is 0 mm^2; it must be positive and finite");
        assert_eq!(PolePairs::new(0), Err(MotorError::NoPolePairs));
    }
}
