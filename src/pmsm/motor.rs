//! Motor constants from geometry (thesis (3.2) to (3.11)).

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

impl Geometry {
    /// Magnet flux linkage (Wb, peak): `psi_m = pi l1 l2 Bm Ns / (4 np)`; the back-EMF constant follows by
    /// [`Constant::FluxLinkage`](super::units::Constant::FluxLinkage).
    ///
    /// # Errors
    /// A length, diameter, flux density or number of turns that is not positive.
    pub fn psi_m(&self) -> Result<f64, MotorError> {
        let flux_density = MotorError::positive("flux density", self.flux_density, "T")?;
        Ok(PI * self.area()? * flux_density * self.turns()? / (4.0 * self.pole_pairs.get()))
    }

    /// Synchronous (dq) inductance (H), without leakage: 3/2 of a phase's self inductance `L = pi mu0 l1 l2 Ns^2 / (8 g np^2)`, for
    /// the other two phases help.
    ///
    /// # Errors
    /// A length, diameter, gap or number of turns that is not positive.
    pub fn ls(&self) -> Result<f64, MotorError> {
        let (gap, np) = (MotorError::positive("air gap", self.air_gap, "m")?, self.pole_pairs.get());
        let (area, turns) = (self.area()?, self.turns()?);
        Ok(1.5 * (PI * MU_0 * area * turns * turns / (8.0 * gap * np * np)))
    }

    /// `l1 l2` (m^2).
    fn area(&self) -> Result<f64, MotorError> {
        let length = MotorError::positive("motor length", self.length, "m")?;
        Ok(length * MotorError::positive("rotor diameter", self.rotor_diameter, "m")?)
    }

    fn turns(&self) -> Result<f64, MotorError> {
        MotorError::positive("number of turns", self.turns, "turns")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pmsm::frames::Park;
    use crate::pmsm::units::Constant;
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
        let (psi_m, ls) = (geometry().psi_m().unwrap(), geometry().ls().unwrap());
        let park = Park::amplitude_invariant();
        let (i, th) = ([3.0, -7.0, 4.0], 0.7_f64);
        let s = 2.0 * PI / 3.0;
        let flux = |own: f64, others: f64, shift: f64| ls / 1.5 * (own - 0.5 * others) + psi_m * (th + shift).cos();
        let [a, b, c] = i;
        let psi = [flux(a, b + c, 0.0), flux(b, a + c, -s), flux(c, a + b, s)];
        let ([psi_d, psi_q, _], [id, iq, _]) = (park.forward(psi, th), park.forward(i, th));
        assert_relative_eq!(psi_d, psi_m + ls * id, max_relative = 1e-13);
        assert_relative_eq!(psi_q, ls * iq, max_relative = 1e-13);
    }

    // By hand: psi_m = pi * 0.006 * 0.9 * 96 / 16, L = pi * mu0 * 0.006 * 9216 / (0.032 * 16).
    #[test]
    fn numbers_by_hand() {
        let (psi_m, ls) = (geometry().psi_m().unwrap(), geometry().ls().unwrap());
        assert_relative_eq!(psi_m, 0.101_787_602, max_relative = 1e-8);
        assert_relative_eq!(ls / 1.5, 4.263_669e-4, max_relative = 1e-6);
        let ke = Constant::FluxLinkage(geometry().pole_pairs).to_ke(psi_m);
        assert_relative_eq!(ke, 0.498_655_4, max_relative = 1e-5);
    }

    #[test]
    fn a_motor_without_gap_is_refused() {
        let error = Geometry { air_gap: 0.0, ..geometry() }.ls().unwrap_err();
        assert_eq!(error.to_string(), "air gap is 0 m; it must be positive and finite");
    }
}
