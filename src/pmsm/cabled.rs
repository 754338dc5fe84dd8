use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::{Currents, PolePairs};
use crate::signals::place_of;
use crate::{Of, Scalar, Signals};

crate::signals! {
    /// A motor cable.
    struct CableResistance {
        /// Resistance per phase.
        r_cable: "ohm",
    }
}

wraps_motor! {
    /// A motor at the end of a cable: its resistance `rs` and the cable's `r_cable` in series. The parameters `P` hold,
    /// by name, those of the motor `M` and `r_cable` (ohm).
    ///
    /// The data determine only the sum of both resistances: one of them is to be fixed, or known beforehand.
    Cabled, M::Input, |_wrapper, x, u, p, motor| {
        let mut winding = M::Parameters::into_array(P::part::<M::Parameters, S>(*p));
        winding.as_mut()[Self::RS] += P::part::<CableResistance, S>(*p).r_cable;
        motor(x, u, &M::Parameters::from_array(winding))
    }
}

impl<M: MotorModel, P: Signals> Cabled<M, P> {
    const RS: usize = place_of(M::Parameters::NAMES, "rs");
}

impl<M: MotorModel, P: Signals> MotorModel for Cabled<M, P> {
    passes_on!(pole_pairs);
    passes_on!(torque);
}
