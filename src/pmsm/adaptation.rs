//! Adaptation laws of the motor's [`Mras`](crate::online::Mras) (thesis, chapter 5.1; corrected), one per parameter.
//!
//! With `e` measured less predicted current, `V = e^T e + (Ke error)^2/g + (R error)^2/gR` falls at the rate
//! `-e^T (2 rs/ls I + F + F^T) e` under both Lyapunov laws, at any speed: the part of the equation that turns with the
//! speed does no work (its unit test has the formula). The currents' error goes to zero; the parameters' only where they are
//! excited: `ke` by speed, `rs` by current. The proof is of continuous time, and does not cover
//! gains that vary; [`Mras::check`](crate::online::Mras::check) looks at the sampled loop.
//!
//! What the observer does not model biases `ke`. On the reference robot's speed cycles (rms, mean of six axes): 2.4 %; with
//! dead time and cable 0.25 %; with normalized gain 0.166 %, and a dead zone 0.136 %. Most of what is left is saliency: without
//! it axis 1 reaches 0.042 and 0.029 %.

use super::{Currents, SQRT_2_3};
use crate::model::Model;
use crate::online::{AdaptationLaw, Moment, Rate};
use crate::signals::{Of, Signals, holds, place_of};

/// The input of a motor's adaptation law at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptationInput {
    /// Measured less predicted currents (A).
    pub e: Currents,
    /// Predicted currents (A).
    pub i: Currents,
    /// Mechanical speed (rad/s).
    pub w: f64,
    /// Inductance of the observer (H).
    pub ls: f64,
}

/// How one parameter of the motor is adapted. Closures are laws.
pub trait Adaptation {
    /// Its rate.
    fn rate(&self, seen: &AdaptationInput) -> Rate;
}

impl<F: Fn(&AdaptationInput) -> Rate> Adaptation for F {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        self(seen)
    }
}

/// `Ke' = -g sqrt(2/3) (w/ls) e_q` (5.3): Lyapunov's law for the back-EMF. At standstill it does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeLyapunov {
    /// `g`, above zero.
    pub gain: f64,
}

impl Adaptation for KeLyapunov {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        Rate::Adapt(-self.gain * SQRT_2_3 * seen.w / seen.ls * seen.e.iq)
    }
}

/// `R' = g e_d` (5.4): the resistance from the d axis. Stable only while `g id < 0`; without id it has no information. Put it
/// behind a [`DirectCurrent`], and bound the parameter: with id of the wrong sign it diverges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RsDirect {
    /// `g`, of the sign opposite to that of id.
    pub gain: f64,
}

impl Adaptation for RsDirect {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        Rate::Adapt(self.gain * seen.e.id)
    }
}

/// `R' = -g (id e_d + iq e_q)/ls`, predicted currents: Lyapunov's law for the resistance, right for either sign of id.
/// With the d axis empty it uses iq, and needs the EMF known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RsLyapunov {
    /// `g`, above zero.
    pub gain: f64,
}

impl Adaptation for RsLyapunov {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        Rate::Adapt(-self.gain * (seen.i.id * seen.e.id + seen.i.iq * seen.e.iq) / seen.ls)
    }
}

/// The law of a parameter that is not adapted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotAdapted;

impl Adaptation for NotAdapted {
    #[inline(always)]
    fn rate(&self, _seen: &AdaptationInput) -> Rate {
        Rate::Adapt(0.0)
    }
}

/// Holds the parameter while the speed is low: what is seen there is the inverter's error, not the EMF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadZone<A> {
    /// The law outside.
    pub law: A,
    /// Least speed (rad/s, mechanical); 20 is usual.
    pub speed: f64,
}

impl<A: Adaptation> Adaptation for DeadZone<A> {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        let value = seen.w.abs();
        if value < self.speed {
            Rate::Hold { quantity: "speed (rad/s)", value, limit: self.speed }
        } else {
            self.law.rate(seen)
        }
    }
}

/// Holds the parameter while there is little d current: without it the d axis has no information on the resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectCurrent<A> {
    /// The law above.
    pub law: A,
    /// Least d current (A).
    pub current: f64,
}

impl<A: Adaptation> Adaptation for DirectCurrent<A> {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        let value = (seen.i.id + seen.e.id).abs();
        if value < self.current {
            Rate::Hold { quantity: "d current (A)", value, limit: self.current }
        } else {
            self.law.rate(seen)
        }
    }
}

/// Divides the gain by `1 + (w/speed)^2`: with [`KeLyapunov`] the loop's bandwidth does not grow with the square of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalized<A> {
    /// The law.
    pub law: A,
    /// Speed (rad/s, mechanical) at which the gain is halved; 100 is usual.
    pub speed: f64,
}

impl<A: Adaptation> Adaptation for Normalized<A> {
    #[inline(always)]
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        let ratio = seen.w / self.speed;
        match self.law.rate(seen) {
            Rate::Adapt(rate) => Rate::Adapt(rate / (1.0 + ratio * ratio)),
            hold => hold,
        }
    }
}

/// The motor's adaptation law: one law for each parameter; the inductances are not adapted.
///
/// For any motor whose parameters include `rs`, `ke` and `ls`, or `lq` instead of that, and whose inputs include `w`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorLaw<R, K> {
    /// Law of the resistance.
    pub rs: R,
    /// Law of the back-EMF.
    pub ke: K,
}

/// Where a motor's parameters stand: resistance, the inductance that the EMF drives its current through, back-EMF.
struct Places<M>(core::marker::PhantomData<M>);

impl<M: Model> Places<M> {
    const RS: usize = place_of(M::Parameters::NAMES, "rs");
    const KE: usize = place_of(M::Parameters::NAMES, "ke");
    const LS: usize = place_of(M::Parameters::NAMES, if holds(M::Parameters::NAMES, "ls") { "ls" } else { "lq" });
}

crate::signals! {
    /// The speed among a motor's inputs.
    struct Speed { w: "rad/s" }
}

impl<M, R, K> AdaptationLaw<M> for MotorLaw<R, K>
where
    M: Model<State = Currents>,
    R: Adaptation,
    K: Adaptation,
{
    #[inline(always)]
    fn rates(&self, now: &Moment<M>) -> Of<M::Parameters, Rate> {
        let w = M::Input::part::<Speed, f64>(*now.u).w;
        let ls = M::Parameters::into_array(*now.p).as_ref()[Places::<M>::LS];
        let seen = AdaptationInput { e: *now.e, i: *now.x, w, ls };
        let (rs, ke) = (self.rs.rate(&seen), self.ke.rate(&seen));
        M::Parameters::from_fn(|i| match i {
            i if i == Places::<M>::RS => rs,
            i if i == Places::<M>::KE => ke,
            _ => Rate::Adapt(0.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Drive, Surface, Winding};
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;

    // `dV/dt = -e^T (2 rs/ls I + F + F^T) e` (A^2/s) of the motor's observer under the Lyapunov laws (thesis, appendix A,
    // derived anew): `f` is the observer's feedback matrix (1/s).
    fn lyapunov_rate(rs: f64, ls: f64, f: &Matrix2<f64>, e: &Currents) -> f64 {
        let e = Vector2::from(*e);
        -(2.0 * rs / ls * e.norm_squared() + 2.0 * e.dot(&(f * e)))
    }

    // How fast `V` falls at least, per second and per `e^T e`: `2 rs/ls + lambda_min(F + F^T)`. The continuous observer is
    // stable where this is positive; no feedback at all is enough.
    fn lyapunov_margin(rs: f64, ls: f64, f: &Matrix2<f64>) -> f64 {
        let s = f + f.transpose();
        let (mean, half) = (0.5 * (s.m11 + s.m22), 0.5 * (s.m11 - s.m22));
        2.0 * rs / ls + mean - crate::Scalar::hypot(half, s.m12)
    }

    fn number(rate: Rate) -> f64 {
        match rate {
            Rate::Adapt(rate) => rate,
            Rate::Hold { .. } => 0.0,
        }
    }

    proptest! {
        // V' from the plant's, the observer's and the laws' own equations, against the closed form.
        #[test]
        fn v_falls_as_appendix_a_says(id in -60.0..60.0, iq in -60.0..60.0, ed in -5.0..5.0, eq in -5.0..5.0, w in -700.0..700.0,
                                      dr in -0.3..0.3, dk in -0.3..0.3, f in prop::array::uniform4(-200.0..200.0)) {
            let (g, gr) = (1e-3f64, 5e-3f64);
            let f = Matrix2::new(f[0], f[1], f[2], f[3]);
            let plant = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };
            let observer = Winding { rs: plant.rs - dr, ke: plant.ke - dk, ..plant };
            let (motor, u) = (Surface::new(4).unwrap(), Drive { ud: 30.0, uq: 90.0, w });
            let (e, i) = (Currents { id: ed, iq: eq }, Currents { id: id - ed, iq: iq - eq });
            let vector = |i: Currents| Vector2::new(i.id, i.iq);
            let v = |i: &Currents, p: &Winding| vector(motor.derivative(0.0, i, &u, p));
            let de = v(&Currents { id, iq }, &plant) - v(&i, &observer) - f * vector(e);
            let now = AdaptationInput { e, i, w, ls: plant.ls };
            let (rs, ke) = (number(RsLyapunov { gain: gr }.rate(&now)), number(KeLyapunov { gain: g }.rate(&now)));
            let (term1, term2, term3): (f64, f64, f64) = (2.0 * vector(e).dot(&de), -2.0 * dk * ke / g, -2.0 * dr * rs / gr);
            // Relative to the terms that cancel.
            let size = 1.0 + 2.0 * vector(e).norm() * de.norm() + term2.abs() + term3.abs();
            let expected = lyapunov_rate(plant.rs, plant.ls, &f, &e);
            prop_assert!((term1 + term2 + term3 - expected).abs() <= 1e-10 * size);
            // The condition is sharp: V' is at most -margin e^T e.
            let bound = -lyapunov_margin(plant.rs, plant.ls, &f) * (ed * ed + eq * eq);
            prop_assert!(expected <= bound + 1e-9 * (1.0 + bound.abs()));
        }
    }

    #[test]
    fn margin_is_reached_along_the_weakest_direction() {
        // F + F^T = [[-300, 80], [80, 20]]: lambda_min by the quadratic formula.
        let f = Matrix2::new(-150.0, 100.0, -20.0, 10.0);
        let lambda = -140.0 - (160.0f64 * 160.0 + 80.0 * 80.0).sqrt();
        approx::assert_relative_eq!(lyapunov_margin(0.4, 4e-3, &f), 200.0 + lambda, max_relative = 1e-14);
        assert!(lyapunov_margin(0.4, 4e-3, &f) < 0.0);
        assert!(lyapunov_margin(0.4, 4e-3, &Matrix2::zeros()) > 0.0);
    }

    #[test]
    fn laws_hold_and_scale() {
        let seen =
            AdaptationInput { e: Currents { id: 0.0, iq: 1.0 }, i: Currents { id: 0.2, iq: 5.0 }, w: -10.0, ls: 4e-3 };
        let law = KeLyapunov { gain: 1.0 };
        approx::assert_relative_eq!(number(law.rate(&seen)), SQRT_2_3 * 10.0 / 4e-3, max_relative = 1e-14);
        assert_eq!(number(law.rate(&AdaptationInput { w: 0.0, ..seen })), 0.0);
        let hold = Rate::Hold { quantity: "speed (rad/s)", value: 10.0, limit: 20.0 };
        assert_eq!(DeadZone { law, speed: 20.0 }.rate(&seen), hold);
        let gated = DirectCurrent { law: RsDirect { gain: -1.0 }, current: 0.5 };
        assert_eq!(gated.rate(&seen), Rate::Hold { quantity: "d current (A)", value: 0.2, limit: 0.5 });
        let fast = AdaptationInput { w: 300.0, ..seen };
        let (plain, slow) = (KeLyapunov { gain: 1.0 }, Normalized { law: KeLyapunov { gain: 1.0 }, speed: 100.0 });
        approx::assert_relative_eq!(number(plain.rate(&fast)), 10.0 * number(slow.rate(&fast)), max_relative = 1e-14);
    }
}
