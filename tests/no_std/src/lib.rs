//! A controller's side of the library: scalar, dual, signals, model, integrators, observers; no std, no alloc.
#![no_std]

use greybox::online::{
    Ekf, EkfStart, Forgetting, Mras, MrasStart, ObserverError, Order, UpdateOutcome, Rls, Stepping, Watch,
};
use greybox::pmsm::{
    AngledDrive, Currents, Drive, ExactStep, ExactSurface, HeldIn, InverterFed, InverterFedWinding, KeLyapunov,
    MotorLaw, RsLyapunov, Winding,
};
use greybox::{Dual, Hold, Model, Nothing, Of, Scalar, fixed, free, signals};

signals! {
    /// Temperature of a winding over that of its surroundings.
    pub struct Rise { dt: "K" }
    /// Heat balance.
    pub struct Heat { gain: "K/s", loss: "1/s" }
}

/// A user's own model.
pub struct Warming;

impl Model for Warming {
    type State = Rise;
    type Input = Nothing;
    type Output = Rise;
    type Parameters = Heat;

    fn derivative<S: Scalar>(&self, _t: S, x: &Rise<S>, _u: &Nothing, p: &Heat<S>) -> Rise<S> {
        Rise { dt: p.gain - p.loss * x.dt }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Rise<S>, _u: &Nothing, _p: &Heat<S>) -> Rise<S> {
        *x
    }
}

/// Slope of the warming with respect to the loss.
pub fn slope(x: f64) -> f64 {
    let p: Of<Heat, Dual<1>> = Heat { gain: Dual::from(1.0), loss: Dual::variable(0.1, 0) };
    Warming.derivative(Dual::from(0.0), &Rise { dt: Dual::from(x) }, &Nothing, &p).dt.slopes[0]
}

/// A filter of the user's own, continuous model.
pub fn warming_filter() -> Result<Ekf<Warming, 3>, ObserverError> {
    let start = EkfStart {
        state: Rise { dt: free(0.0).prior(0.0, 1.0) },
        parameters: Heat { gain: free(1.0).prior(1.0, 0.5).log(), loss: free(0.1).prior(0.1, 0.05) },
        state_drift: Rise { dt: 1e-3 },
        parameter_drift: Heat { gain: 1e-4, loss: 1e-5 },
        noise: Rise { dt: 0.1 },
        hold: Hold::Zero,
        watch: Watch { limit: Rise { dt: 6.0 }, patience: 10 },
    };
    Ekf::new(Warming, 1.0, start)
}

/// One sample of each of the motor's observers.
pub fn motor(ts: f64, i: Currents) -> Result<[UpdateOutcome; 3], ObserverError> {
    let Ok(step) = ExactStep::new(4, ts, HeldIn::Stationary) else {
        return Err(ObserverError::NotPositive { what: "the sample time", signal: "t", value: ts });
    };
    let start = MrasStart {
        parameters: Winding { rs: free(0.4), ls: fixed(4e-3), ke: free(0.9) },
        pull: Currents { id: 100.0, iq: 100.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1 },
    };
    let law = MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke: KeLyapunov { gain: 1e-3 } };
    let mut mras: Mras<_, _> = ExactSurface(step).mras(law, start)?;
    let a = mras.update(0.0, &Drive { ud: 0.0, uq: 70.0, w: 90.0 }, &i).outcome;

    let model = InverterFed::<_, InverterFedWinding>::new(ExactSurface(step));
    let start = EkfStart {
        state: Currents { id: free(0.0).prior(0.0, 1.0), iq: free(0.0).prior(0.0, 1.0) },
        parameters: InverterFedWinding {
            rs: free(0.4).prior(0.4, 0.3),
            ls: fixed(4e-3),
            ke: free(0.9).prior(0.9, 0.1),
            vdt: free(0.0).prior(0.0, 2.0),
            i0: fixed(0.15),
        },
        state_drift: Currents { id: 0.1, iq: 0.1 },
        parameter_drift: InverterFedWinding { rs: 1e-5, ls: 0.0, ke: 3e-6, vdt: 3e-5, i0: 0.0 },
        noise: Currents { id: 0.06, iq: 0.06 },
        hold: Hold::Zero,
        watch: Watch { limit: Currents { id: 8.0, iq: 8.0 }, patience: 100 },
    };
    let mut ekf = model.ekf::<5>(start)?;
    let b = ekf.update(0.0, &AngledDrive { ud: 0.0, uq: 70.0, w: 90.0, theta: 0.0 }, &i).outcome;

    let start =
        Winding { rs: free(0.4).prior(0.4, 1.0), ls: free(4e-3).prior(4e-3, 1e-2), ke: free(0.9).prior(0.9, 1.0) };
    let mut rls = Rls::<Winding, 3>::new(start, 1.0, Forgetting::factor(0.999))?;
    let c = rls.update(&[(Winding { rs: i.iq, ls: 0.0, ke: 70.0 }, 60.0)]).outcome;
    Ok([a, b, c])
}

/// What a controller's C code calls: 1 if all observers took the sample.
#[unsafe(no_mangle)]
pub extern "C" fn observe(ts: f64, id: f64, iq: f64) -> i32 {
    let warm = warming_filter().is_ok() && slope(id) == -id;
    let took =
        motor(ts, Currents { id, iq }).is_ok_and(|all| all.iter().all(|one| !matches!(one, UpdateOutcome::Diverged(_))));
    (warm && took) as i32
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}
