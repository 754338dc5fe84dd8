use super::units::Constant;
use super::{Currents, Drive, MotorError, MotorModel, PolePairs};
use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Parameters of a motor whose q axis saturates.
    pub struct SaturatedWinding {
        /// Phase resistance; must be positive.
        rs: "ohm",
        /// Inductance along the magnet flux; must be positive.
        ld: "H",
        /// Inductance of the q axis at small currents; must be positive.
        lq: "H",
        /// Incremental inductance of the q axis at large currents; must be positive.
        lq_saturated: "H",
        /// Change of the saturating part of lq per ampere of id.
        lq_cross: "H/A",
        /// Current around which the q axis saturates; must be positive.
        i_saturation: "A",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
    }
}

/// Currents of a motor with saturation and cross-saturation, through a reciprocal flux map: both fluxes are slopes of one
/// co-energy `W(id, iq)`, so that `dpsi_d/diq = dpsi_q/did` and no current cycle makes energy:
///
/// ```text
/// W = psi_m id + ld id^2/2 + lq_sat iq^2/2 + (lq - lq_sat + cross id) h(iq),   h = i_sat^2 (r - 1),
/// r = sqrt(1 + (iq/i_sat)^2)
/// psi_d = psi_m + ld id + cross h            psi_q = lq_sat iq + (lq - lq_sat + cross id) iq / r
/// dpsi_d/dt = ud - rs id + we psi_q          dpsi_q/dt = uq - rs iq - we psi_d
/// ```
///
/// The voltage equation therefore contains the *incremental* inductances (slopes of the fluxes), the rotation and the
/// torque the apparent ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Saturated {
    pole_pairs: PolePairs,
}

impl Saturated {
    /// A motor with this many pole pairs.
    ///
    /// # Errors
    /// Zero pole pairs.
    pub const fn new(pole_pairs: u32) -> Result<Self, MotorError> {
        match PolePairs::new(pole_pairs) {
            Ok(pole_pairs) => Ok(Saturated { pole_pairs }),
            Err(error) => Err(error),
        }
    }

    /// Flux linkages `(psi_d, psi_q)` (Wb).
    #[inline]
    pub fn flux<S: Scalar>(&self, x: &Currents<S>, p: &SaturatedWinding<S>) -> (S, S) {
        let z = x.iq / p.i_saturation;
        let r = (z * z + 1.0).sqrt();
        let psi_m = Constant::FluxLinkage(self.pole_pairs).from_ke(p.ke);
        let saturating = p.lq - p.lq_saturated + p.lq_cross * x.id;
        (
            psi_m + p.ld * x.id + p.lq_cross * p.i_saturation * p.i_saturation * (r - 1.0),
            p.lq_saturated * x.iq + saturating * x.iq / r,
        )
    }

    /// Incremental inductances (H) `(dpsi_d/did, dpsi_d/diq = dpsi_q/did, dpsi_q/diq)`.
    #[inline]
    pub fn incremental<S: Scalar>(&self, x: &Currents<S>, p: &SaturatedWinding<S>) -> (S, S, S) {
        let z = x.iq / p.i_saturation;
        let r = (z * z + 1.0).sqrt();
        let saturating = p.lq - p.lq_saturated + p.lq_cross * x.id;
        (p.ld, p.lq_cross * x.iq / r, p.lq_saturated + saturating / (r * r * r))
    }
}

impl MotorModel for Saturated {
    fn pole_pairs(&self) -> PolePairs {
        self.pole_pairs
    }

    /// `3/2 np (psi_d iq - psi_q id)` (N m).
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, _theta: S, p: &SaturatedWinding<S>) -> S {
        let (psi_d, psi_q) = self.flux(x, p);
        (psi_d * x.iq - psi_q * x.id) * (1.5 * self.pole_pairs.get())
    }
}

impl Model for Saturated {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = SaturatedWinding;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &SaturatedWinding<S>) -> Currents<S> {
        let we = self.pole_pairs.electrical(u.w);
        let (psi_d, psi_q) = self.flux(x, p);
        let (ldd, ldq, lqq) = self.incremental(x, p);
        let (vd, vq) = (u.ud - p.rs * x.id + we * psi_q, u.uq - p.rs * x.iq - we * psi_d);
        let determinant = ldd * lqq - ldq * ldq;
        Currents { id: (lqq * vd - ldq * vq) / determinant, iq: (ldd * vq - ldq * vd) / determinant }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &SaturatedWinding<S>) -> Currents<S> {
        *x
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Salient, SalientWinding};
    use super::*;
    use crate::Dual;
    use proptest::prelude::*;

    const P: SaturatedWinding = SaturatedWinding {
        rs: 0.4,
        ld: 3.84e-3,
        lq: 4.16e-3,
        lq_saturated: 2e-3,
        lq_cross: -8e-6,
        i_saturation: 40.0,
        ke: 0.95,
    };

    proptest! {
        // The incremental inductances are the slopes of the fluxes (by duals), and the map is reciprocal.
        #[test]
        fn incremental_inductance_is_the_slope_of_the_flux(id in -60.0..60.0, iq in -60.0..60.0) {
            let model = Saturated::new(4).unwrap();
            let x = Currents { id: Dual::<2>::variable(id, 0), iq: Dual::variable(iq, 1) };
            let p = <SaturatedWinding as crate::Signals>::map(P, Dual::<2>::constant);
            let (psi_d, psi_q) = model.flux(&x, &p);
            let (ldd, ldq, lqq) = model.incremental(&Currents { id, iq }, &P);
            // A dozen roundings on numbers of the size of lq.
            let same = |a: f64, b: f64| (a - b).abs() < 1e-16;
            prop_assert!(same(psi_d.slopes[0], ldd) && same(psi_q.slopes[1], lqq));
            prop_assert!(same(psi_d.slopes[1], ldq) && same(psi_q.slopes[0], ldq));
        }

        // Energy: electrical power in = copper loss + torque * speed + change of field energy, the field energy being
        // psi i minus the co-energy of the currents. All by duals along the motion.
        #[test]
        fn power_balances(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0, uq in -300.0..300.0,
                          w in -400.0..400.0) {
            let model = Saturated::new(4).unwrap();
            let (x, u) = (Currents { id, iq }, Drive { ud, uq, w });
            let dx = model.derivative(0.0, &x, &u, &P);
            let (ldd, ldq, lqq) = model.incremental(&x, &P);
            let (dpsi_d, dpsi_q) = (ldd * dx.id + ldq * dx.iq, ldq * dx.id + lqq * dx.iq);
            let field = 1.5 * (id * dpsi_d + iq * dpsi_q);
            let copper = 1.5 * P.rs * (id * id + iq * iq);
            let mechanical = model.torque(&x, 0.0, &P) * w;
            let electrical = 1.5 * (ud * id + uq * iq);
            prop_assert!((electrical - copper - mechanical - field).abs() < 1e-9 * (1.0 + electrical.abs() + field.abs()));
        }

        // Without saturation it is the salient motor.
        #[test]
        fn unsaturated_it_is_salient(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0, w in -400.0..400.0) {
            let p = SaturatedWinding { lq_saturated: P.lq, lq_cross: 0.0, ..P };
            let q = SalientWinding { rs: P.rs, ld: P.ld, lq: P.lq, ke: P.ke };
            let (x, u) = (Currents { id, iq }, Drive { ud, uq: 100.0, w });
            let a = Saturated::new(4).unwrap().derivative(0.0, &x, &u, &p);
            let salient = Salient::new(4).unwrap();
            let b = salient.derivative(0.0, &x, &u, &q);
            approx::assert_relative_eq!(a, b, epsilon = 1e-7, max_relative = 1e-11);
            let torque = (Saturated::new(4).unwrap().torque(&x, 0.0, &p), salient.torque(&x, 0.0, &q));
            approx::assert_relative_eq!(torque.0, torque.1, epsilon = 1e-11, max_relative = 1e-11);
        }
    }
}
