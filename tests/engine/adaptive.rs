//! Adaptive and stiff methods on compiled right-hand sides, against the model on duals.

use crate::tables::{Coil, Flux, Mapped, Volts};
use greybox::engine::Differentiated;
use greybox::pmsm::{Machine, MachineParameters, MachineState, VoltageAndLoad};
use greybox::{
    Dual, Equations, Esdirk, Extrapolation, Hold, Integrator, Interpolation, Interval, Model, ModelSystem, Of, Rk4,
    Rk45, Scalar, Signals, signals,
};

signals! {
    pub struct Chain { a: "1", b: "1", c: "1", d: "1", e: "1", f: "1", g: "1", h: "1", i: "1", j: "1" }
    pub struct Source { u: "1" }
    pub struct Rates { fast: "1/s", slow: "1/s" }
}

/// Ten stages in a row, of which some are a thousand times faster than the others.
struct Stiff;

impl Model for Stiff {
    type State = Chain;
    type Input = Source;
    type Output = Source;
    type Parameters = Rates;

    fn derivative<S: Scalar>(&self, t: S, x: &Chain<S>, u: &Source<S>, p: &Rates<S>) -> Chain<S> {
        let x: [S; 10] = (*x).into();
        let mut before = u.u + t.sin();
        Chain::from(core::array::from_fn(|i| {
            let rate = if i % 3 == 0 { p.fast } else { p.slow };
            let flow = (before - x[i]) * rate;
            before = x[i] + x[i].tanh();
            flow
        }))
    }
    fn output<S: Scalar>(&self, _t: S, x: &Chain<S>, _u: &Source<S>, _p: &Rates<S>) -> Source<S> {
        Source { u: x.j }
    }
}

fn agrees<M: Model, I: Integrator>(
    model: &M,
    integrator: &I,
    x0: Of<M::State, f64>,
    p: Of<M::Parameters, f64>,
    input: Of<M::Input, f64>,
    step: f64,
) {
    let differentiated = Differentiated::new(&Equations::trace(model).unwrap()).unwrap();
    let (states, parameters) = (M::State::into_array(x0), M::Parameters::into_array(p));
    let p = M::Parameters::from_fn(|j| Dual::<8>::variable(parameters.as_ref()[j], j));
    let mut x = M::State::from_fn(|i| Dual::<8>::variable(states.as_ref()[i], M::Parameters::LEN + i));
    let mut system = differentiated.system(M::Parameters::into_array(p).as_ref());
    let mut compiled = M::State::into_array(x).as_ref().iter().copied().collect();
    let (mut memory, mut same_memory) = Default::default();
    for k in 0..30 {
        let u = |k: i32| M::Input::map(input, |a| a * (0.4 * f64::from(k)).cos());
        let (t0, t1) = (f64::from(k) * step, f64::from(k + 1) * step);
        let interval = Interval { t0, t1, u0: u(k), u1: u(k + 1), hold: Hold::First };
        x = ModelSystem { model, interval: &interval, p: &p }.step(integrator, x, &mut memory).unwrap();
        let (u0, u1) = (M::Input::into_array(u(k)), M::Input::into_array(u(k + 1)));
        system.set_interval(t0, t1, u0.as_ref(), u1.as_ref(), Hold::First);
        compiled = integrator.advance(&system, compiled, &mut same_memory).unwrap();
        for (a, b) in compiled.iter().zip(M::State::into_array(x).as_ref()) {
            // Steps are chosen by values; those that differ by rounding choose steps that differ by as much.
            assert!((a.value - b.value).abs() <= 1e-9 * b.value.abs().max(1e-3), "{} {}", a.value, b.value);
            let size = b.slopes.iter().fold(1e-6f64, |m, s| m.max(s.abs()));
            for (a, b) in a.slopes.iter().zip(b.slopes) {
                assert!((a - b).abs() <= 1e-8 * size, "{a} {b}");
            }
        }
    }
}

#[test]
fn adaptive_methods_run_on_compiled_right_hand_sides() {
    let x = Chain::from([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]);
    let (p, u) = (Rates { fast: 300.0, slow: 2.0 }, Source { u: 1.0 });
    agrees(&Stiff, &Esdirk::default(), x, p, u, 0.05);
    agrees(&Stiff, &Rk45::default(), x, p, u, 0.05);
    agrees(&Stiff, &Rk4 { substeps: 30 }, x, p, u, 0.05);
    let rotor = MachineParameters { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95, j: 0.012, bv: 4e-3, tc: 1.2, tg: 1.0 };
    let (machine, acting) = (Machine::new(4, 100.0).unwrap(), VoltageAndLoad { ud: 5.0, uq: 40.0, tau_l: 0.1 });
    agrees(&machine, &Rk45::default(), MachineState::from([1.0, -2.0, 3.0, 0.1]), rotor, acting, 1e-3);
    let mapped = Mapped::new(Interpolation::Smooth, Extrapolation::Linear);
    agrees(&mapped, &Esdirk::default(), Flux { d: 0.3, q: 0.6 }, Coil { r: 1.0, scale: 0.9 }, Volts { u: 2.0 }, 0.02);
}
