use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::units::Constant;
use super::{Currents, PolePairs};
use crate::signals::place_of;
use crate::{Of, Scalar, Signals};

wraps_motor! {
    /// A motor whose magnet is given, and found, by its flux linkage `psi_m` (Wb, peak) in place of `ke`: the parameters
    /// `P` hold `psi_m` and those of the motor `M` but for `ke`, by name.
    ///
    /// Bounds, priors and intervals are then of `psi_m` itself. `ke = sqrt(3/2) np psi_m`
    /// ([`Constant::FluxLinkage`]).
    ///
    /// ```
    /// use greybox::{pmsm::{FluxLinkage, Surface}, signals};
    /// signals! { pub struct FluxWinding { rs: "ohm", ls: "H", psi_m: "Wb" } }
    /// let model = FluxLinkage::<_, FluxWinding>::new(Surface::new(4)?);
    /// # Ok::<(), greybox::pmsm::MotorError>(())
    /// ```
    FluxLinkage, M::Input, |wrapper, x, u, p, motor| {
        motor(x, u, &wrapper.winding(p))
    }
}

impl<M: MotorModel, P: Signals> FluxLinkage<M, P> {
    const PSI_M: usize = place_of(P::NAMES, "psi_m");
    const KE: usize = place_of(M::Parameters::NAMES, "ke");
    /// Where each parameter of the motor stands in `P`; `psi_m` in the place of `ke`.
    const PLACES: [usize; 64] = {
        let (mut places, mut i) = ([Self::PSI_M; 64], 0);
        while i < M::Parameters::LEN {
            if i != Self::KE {
                places[i] = place_of(P::NAMES, M::Parameters::NAMES[i]);
            }
            i += 1;
        }
        places
    };

    #[inline(always)]
    fn winding<S: Scalar>(&self, p: &Of<P, S>) -> Of<M::Parameters, S> {
        let (entries, np) = (P::into_array(*p), self.motor.pole_pairs());
        M::Parameters::from_fn(|i| {
            let value = entries.as_ref()[Self::PLACES[i]];
            if i == Self::KE { Constant::FluxLinkage(np).to_ke(value) } else { value }
        })
    }
}

impl<M: MotorModel, P: Signals> MotorModel for FluxLinkage<M, P> {
    passes_on!(pole_pairs);

    #[inline(always)]
    fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &Of<P, S>) -> S {
        self.motor.torque(x, theta, &self.winding(p))
    }
}
