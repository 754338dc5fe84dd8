//! Motor constants from geometry (thesis (3.2) to (3.11)).

use super::units::Constant;
use super::{MotorError, PolePairs};
use core::f64::consts::PI;
use serde::{Deserialize, Serialize};

/// Permeability of vacuum (V s/(A m)).
const MU_0: f64 = 1.256_637_062_12e-6;

/// The dimensions that decide a surface-magnet motor's constants: sine-distributed windings, iron without saturation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Active length `l1` (m).
    pub length: f64,
    /// Rotor diameter `l2` (m).
    pub rotor_diameter: f64,
    /// Effective air gap `g` (m): the magnets' thickness counts, for they conduct flux like air.
    pub air_gap: f64,
    /// Turns in series per phase `Ns`.
    pub turns: f64,
    /// Peak flux density of the magnets in the gap `Bm` (T).
    pub flux_density: f64,
    /// Pole pairs.
    pub pole_pairs: PolePairs,
}

/// The constants that follow from a [`Geometry`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Magnet flux linkage (Wb, peak).
    pub psi_m: f64,
    /// Self inductance `L` of a phase (H), without leakage.
    pub phase_inductance: f64,
    /// Synchronous (dq) inductance (H): 3/2 of the phase's, for the other two phases help.
    pub ls: f64,
    /// Line-to-line rms back-EMF per mechanical speed (V s/rad).
    pub ke: f64,
}

impl Geometry {
    /// `psi_m = pi l1 l2 Bm Ns / (4 np)` and `L = pi mu0 l1 l2 Ns^2 / (8 g np^2)`.
    ///
    /// # Errors
    /// A length, diameter, gap, flux density or number of turns that is not positive.
    pub fn constants(&self) -> Result<Constants, MotorError> {
        let area = MotorError::positive("motor length", self.length, "m")?
            * MotorError::positive("rotor diameter", self.rotor_diameter, "m")?;
        let gap = MotorError::positive("air gap", self.air_gap, "m")?;
        let turns = MotorError::positive("number of turns", self.turns, "turns")?;
        let flux_density = MotorError::positive("flux density", self.flux_density, "T")?;
        let np = self.pole_pairs.get();
        let psi_m = PI * area * flux_density * turns / (4.0 * np);
        let phase_inductance = PI * MU_0 * area * turns * turns / (8.0 * gap * np * np);
        Ok(Constants {
            psi_m,
            phase_inductance,
            ls: 1.5 * phase_inductance,
            ke: Constant::FluxLinkage(self.pole_pairs).to_ke(psi_m),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pmsm::frames::{Park, Phases};
    use approx::assert_relative_eq;

    const NP: u32 = 4;

    fn geometry() -> Geometry {
        Geometry {
            length: 0.1,
            rotor_diameter: 0.06,
            air_gap: 4e-3,
            turns: 96.0,
            flux_density: 0.9,
            pole_pairs: PolePairs::new(NP).unwrap(),
        }
    }

    // Flux in the three phases by (3.2), seen from the rotor: psi_d = psi_m + ls id, psi_q = ls iq.
    #[test]
    fn dq_inductance_is_three_halves_of_a_phase() {
        let k = geometry().constants().unwrap();
        let park = Park::amplitude_invariant();
        let (i, th) = (Phases { a: 3.0, b: -7.0, c: 4.0 }, 0.7_f64);
        let s = 2.0 * PI / 3.0;
        let flux = |own: f64, others: f64, shift: f64| {
            k.phase_inductance * (own - 0.5 * others) + k.psi_m * (th + shift).cos()
        };
        let psi = Phases { a: flux(i.a, i.b + i.c, 0.0), b: flux(i.b, i.a + i.c, -s), c: flux(i.c, i.a + i.b, s) };
        let (psi, i) = (park.forward(psi, th), park.forward(i, th));
        assert_relative_eq!(psi.d, k.psi_m + k.ls * i.d, max_relative = 1e-13);
        assert_relative_eq!(psi.q, k.ls * i.q, max_relative = 1e-13);
    }

    // By hand: psi_m = pi * 0.006 * 0.9 * 96 / 16, L = pi * mu0 * 0.006 * 9216 / (0.032 * 16).
    #[test]
    fn numbers_by_hand() {
        let k = geometry().constants().unwrap();
        assert_relative_eq!(k.psi_m, 0.101_787_602, max_relative = 1e-8);
        assert_relative_eq!(k.phase_inductance, 4.263_669e-4, max_relative = 1e-6);
        assert_relative_eq!(k.ke, 0.498_655_4, max_relative = 1e-5);
    }

    #[test]
    fn a_motor_without_gap_is_refused() {
        let error = Geometry { air_gap: 0.0, ..geometry() }.constants().unwrap_err();
        assert_eq!(error.to_string(), "air gap is 0 m; it must be positive and finite");
    }
}
