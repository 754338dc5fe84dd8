use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::{AngledDrive, Currents, PolePairs, SQRT_2_3, SQRT_3_2};
use crate::{Of, Scalar, Signals};

crate::signals! {
    /// The lowest harmonic that the EMF of a symmetric winding has.
    struct SixthHarmonic {
        /// Amplitude of the sixth harmonic of `ke`: line-to-line rms, `ke + ke6 cos(6 theta_e)`.
        ke6: "V s/rad",
    }
}

wraps_motor! {
    /// A motor whose back-EMF has a sixth harmonic, in phase with the magnet: `ke + ke6 cos(6 theta_e)` in place of `ke`,
    /// in EMF and torque. The parameters `P` hold, by name, those of the motor `M` and `ke6` (V s/rad, line-to-line rms).
    ///
    /// It is the fifth and seventh harmonic of the phases. At low speed, where a controller follows it, a
    /// model without it attributes it to `ke`: 0.2 % on the small axes of the reference robot. For a motor in
    /// exact steps it is taken at the input's angle, that of mid-interval, and held as the voltage is.
    EmfHarmonic, AngledDrive, |wrapper, x, u, p, motor| {
        let u = AngledDrive { uq: u.uq - wrapper.harmonic(u.theta, p) * u.w * SQRT_2_3, ..*u };
        motor(x, &AngledDrive::part::<M::Input, S>(u), &P::part::<M::Parameters, S>(*p))
    }
}

impl<M: MotorModel, P: Signals> EmfHarmonic<M, P> {
    /// The harmonic's contribution to `ke` at a mechanical angle (rad).
    #[inline(always)]
    fn harmonic<S: Scalar>(&self, theta: S, p: &Of<P, S>) -> S {
        P::part::<SixthHarmonic, S>(*p).ke6 * (self.motor.pole_pairs().electrical(theta) * 6.0).cos()
    }
}

impl<M: MotorModel, P: Signals> MotorModel for EmfHarmonic<M, P> {
    passes_on!(pole_pairs);

    #[inline(always)]
    fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &Of<P, S>) -> S {
        let even = self.motor.torque(x, theta, &P::part::<M::Parameters, S>(*p));
        even + self.harmonic(theta, p) * x.iq * SQRT_3_2
    }
}
