//! Every motor model that ships: its slopes against finite differences, and validation both ways on a record.

use approx::assert_relative_eq;
use greybox::Model;
use greybox::check::derivatives;
use greybox::online::{MrasStart, Order, Stepping, Watch};
use greybox::pmsm::drive::{Disturbance, Simulation};
use greybox::pmsm::frames::Stator;
use greybox::pmsm::offline::{Axes, Form, Spans, Validation};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::*;
use greybox::{Fit, fixed, free, signals, simulate};

signals! {
    /// A salient motor behind cable and inverter, and how its record is aligned.
    pub struct Line {
        rs: "ohm", r_cable: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad",
    }
}

signals! {
    /// A motor with surface magnets, its magnet by flux linkage.
    pub struct FluxWinding { rs: "ohm", ls: "H", psi_m: "Wb" }
}

const T: f64 = 0.3;
const I: Currents = Currents { id: -3.0, iq: 11.0 };
const U: Drive = Drive { ud: -20.0, uq: 90.0, w: 120.0 };

#[test]
fn slopes_are_those_of_the_values() {
    let winding = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };
    derivatives(&Surface::new(4).unwrap(), T, &I, &U, &winding).unwrap();
    let salient = SalientWinding { rs: 0.4, ld: 3.8e-3, lq: 4.2e-3, ke: 0.95 };
    derivatives(&Salient::new(4).unwrap(), T, &I, &U, &salient).unwrap();
    let saturated = SaturatedWinding {
        rs: 0.4,
        ld: 3.8e-3,
        lq: 4.2e-3,
        lq_saturated: 2e-3,
        lq_cross: -8e-6,
        i_saturation: 40.0,
        ke: 0.95,
    };
    derivatives(&Saturated::new(4).unwrap(), T, &I, &U, &saturated).unwrap();

    // Currents at which no phase is far in the dead time's saturation, where the slopes by i0 would be nothing.
    let (small, angled) = (Currents { id: 0.1, iq: 0.2 }, AngledDrive { ud: -20.0, uq: 90.0, w: 120.0, theta: 0.4 });
    let line =
        Line { rs: 0.4, r_cable: 0.23, ld: 3.8e-3, lq: 4.2e-3, ke: 0.95, vdt: 2.0, i0: 0.15, tau: 20e-6, delta: 0.01 };
    derivatives(
        &Misaligned::<InverterFed<Cabled<Salient, Line>, Line>, Line>::new(InverterFed::new(Cabled::new(
            Salient::new(4).unwrap(),
        ))),
        T,
        &small,
        &angled,
        &line,
    )
    .unwrap();
    for held_in in [HeldIn::Stationary, HeldIn::Rotor] {
        let step = ExactStep::new(4, RobotAxis::TS, held_in).unwrap();
        derivatives(&ExactSurface(step), T, &I, &U, &winding).unwrap();
        let p = InverterFedWinding { rs: 0.4, ls: 4e-3, ke: 0.95, vdt: 2.0, i0: 0.15 };
        derivatives(&InverterFed::<_, InverterFedWinding>::new(ExactSurface(step)), T, &small, &angled, &p).unwrap();
        let p = CompensatedWinding { rs: 0.4, ls: 4e-3, ke: 0.95, vdt: 2.0 };
        let u = CompensatedDrive { ud: -20.0, uq: 90.0, w: 120.0, theta: 0.4, lost_d: 0.3, lost_q: -0.9 };
        derivatives(&Compensated::<_, CompensatedWinding>::new(ExactSurface(step)), T, &I, &u, &p).unwrap();
    }

    let mechanics = Mechanics { j: 0.015, bv: 5e-3, tc: 1.5, tg: 6.0, ke: 0.95 };
    let turning = ShaftMotion { w: 0.4, theta: 70.0 };
    derivatives(&Shaft::new(110.0).unwrap(), T, &turning, &Torque { iq: 7.0 }, &mechanics).unwrap();
    let rotor = MachineParameters { rs: 0.4, ld: 3.8e-3, lq: 4.2e-3, ke: 0.95, j: 0.015, bv: 5e-3, tc: 1.5, tg: 6.0 };
    let motion = MachineState { id: -3.0, iq: 11.0, w: 0.4, theta: 70.0 };
    let acting = VoltageAndLoad { ud: -20.0, uq: 90.0, tau_l: 2.0 };
    derivatives(&Machine::new(4, 110.0).unwrap(), T, &motion, &acting, &rotor).unwrap();
}

signals! {
    /// Everything from the inverter to the load.
    struct Whole {
        rs: "ohm", r_cable: "ohm", ld: "H", lq: "H", ke: "V s/rad", ke6: "V s/rad", vdt: "V", i0: "A",
        j: "kg m^2", bv: "N m s", tc: "N m", tg: "N m",
    }
}

// Composed of cable, harmonic, inverter and shaft around the salient motor, a model is the simulated axis with everything
// but saturation and cogging: same slopes for the same voltage, at any angle.
#[test]
fn a_composed_model_is_the_simulated_axis() {
    let axis = RobotAxis::reference(2).unwrap();
    let plant = Simulation::new(axis).unwrap().without(Disturbance::Saturation).without(Disturbance::Cogging).plant;
    type Motor = InverterFed<EmfHarmonic<Cabled<Salient, Whole>, Whole>, Whole>;
    let motor: Motor = InverterFed::new(EmfHarmonic::new(Cabled::new(Salient::new(4).unwrap())));
    let machine = Machine::<Motor, Whole>::of(motor, Shaft::new(axis.gear).unwrap());
    let p = Whole {
        rs: axis.rs,
        r_cable: axis.r_cable,
        ld: 0.96 * axis.ls,
        lq: 1.04 * axis.ls,
        ke: axis.ke,
        ke6: 0.01 * axis.ke,
        vdt: 2.0,
        i0: 0.15,
        j: axis.j,
        bv: axis.bv,
        tc: axis.tc,
        tg: axis.tg,
    };
    for k in 0..200 {
        let k = f64::from(k);
        let x = MachineState {
            id: 3.0 * (1.7 * k).sin(),
            iq: 12.0 * (0.9 * k).cos(),
            w: 300.0 * (0.3 * k).sin(),
            theta: 0.37 * k,
        };
        let (ud, uq) = (20.0 * k.cos(), 250.0 * (0.3 * k).sin());
        let (sin, cos) = (4.0 * x.theta).sin_cos();
        let (alpha, beta) = (ud * cos - uq * sin, uq * cos + ud * sin);
        let truth = plant.derivative(&x, Stator { alpha, beta });
        let found = machine.derivative(0.0, &x, &VoltageAndLoad { ud, uq, tau_l: 0.0 }, &p);
        // Slopes of up to 1e5 A/s; the angle of 300 rad electrical costs two digits.
        assert_relative_eq!(found, truth, epsilon = 1e-8, max_relative = 1e-10);
        assert_relative_eq!(machine.torque(&x, &p), plant.torque(&x), epsilon = 1e-9, max_relative = 1e-9);
    }
    let small = MachineState { id: 0.1, iq: 0.2, w: 0.4, theta: 7.0 };
    derivatives(&machine, T, &small, &VoltageAndLoad { ud: 5.0, uq: 9.0, tau_l: 1.0 }, &p).unwrap();
}

// Flux linkage in the place of Ke: the same fit in another unit, estimate and interval alike.
#[test]
fn flux_linkage_may_be_given_and_found() {
    let axis = RobotAxis::reference(1).unwrap();
    let surface = Surface::new(4).unwrap();
    let log = Simulation::new(axis).unwrap().undisturbed().run(&Program::speed_cycles(&axis, 2, 1.0).unwrap());
    let record = log.experiment(&surface).unwrap();
    // The same voltages on the model itself: errors are white, and their intervals no matter of rounding.
    let columns = record.record().inputs();
    let drive = |k: usize| Drive { ud: columns[0].values[k], uq: columns[1].values[k], w: columns[2].values[k] };
    let (inputs, time) = ((0..record.len()).map(drive).collect::<Vec<_>>(), record.record().times().clone());
    let truth = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };
    let run = simulate(&surface, &truth, &Currents::default(), time, &inputs).unwrap();
    let record = run.with_noise(Currents { id: 0.05, iq: 0.05 }, 1).experiment(&surface).unwrap();
    let start = Winding { rs: free(0.5), ls: free(5e-3), ke: free(0.8) };
    let by_ke = Fit::new(&surface, &record).parameters(start).run().unwrap();
    let psi = units::Constant::FluxLinkage(surface.pole_pairs());
    let start = FluxWinding { rs: free(0.5), ls: free(5e-3), psi_m: free(psi.from_ke(0.8)) };
    let model = FluxLinkage::<_, FluxWinding>::new(surface);
    let by_flux = Fit::new(&model, &record).parameters(start).run().unwrap();
    // Both searches stop within a thousandth of a standard error.
    let (psi_m, ke) = (by_flux.parameters.psi_m, by_ke.parameters.ke);
    assert_relative_eq!(psi.to_ke(psi_m), ke, max_relative = 1e-7);
    let error = |known: &greybox::Knowledge| known.standard_error().unwrap();
    let (of_psi, of_ke) = (error(&by_flux.knowledge.psi_m), error(&by_ke.knowledge.ke));
    assert_relative_eq!(psi.to_ke(of_psi), of_ke, max_relative = 1e-3);
}

// An observer that knows Ld and Lq has nothing left to adapt to on a salient motor, and finds Ke from 10 % below; one with a
// single inductance, the mean of both, takes the difference for EMF.
#[test]
fn an_observer_of_a_salient_motor_has_no_error_of_inductance() {
    let step = ExactStep::new(4, RobotAxis::TS, HeldIn::Stationary).unwrap();
    let truth = SalientWinding { rs: 0.4, ld: 3.6e-3, lq: 4.4e-3, ke: 0.95 };
    let law = MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain: 1e-5 } };
    let (pull, watch) = (Currents { id: 1e3, iq: 1e3 }, Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1000 });
    let (order, stepping, ke) = (Order::UpdateThenPredict, Stepping::Split, free(0.9 * truth.ke));
    let parameters = SalientWinding { rs: fixed(truth.rs), ld: fixed(truth.ld), lq: fixed(truth.lq), ke };
    let mut salient = ExactSalient(step).mras(law, MrasStart { parameters, pull, order, stepping, watch }).unwrap();
    let parameters = Winding { rs: fixed(truth.rs), ls: fixed(4e-3), ke };
    let mut round = ExactSurface(step).mras(law, MrasStart { parameters, pull, order, stepping, watch }).unwrap();
    let mut i = Currents::default();
    for k in 0..40_000 {
        let t = f64::from(k) * RobotAxis::TS;
        let w = 200.0 + 100.0 * (3.0 * t).sin();
        // A controller of 20 A in q and -10 A in d.
        let u = Drive {
            ud: 3.0 * (-10.0 - i.id) - 4.0 * w * truth.lq * i.iq,
            uq: 3.0 * (20.0 - i.iq) + 4.0 * w * truth.ld * i.id + SQRT_2_3 * truth.ke * w,
            w,
        };
        salient.update(t, &u, &i);
        round.update(t, &u, &i);
        i = step.advance_salient(&i, &u, &truth);
    }
    let off = |ke: f64| 100.0 * (ke / truth.ke - 1.0).abs();
    let (right, wrong) = (off(salient.parameters().ke), off(round.parameters().ke));
    assert!(right < 1e-6, "{right} %");
    assert!(wrong > 0.5, "{wrong} %");
}

#[test]
fn a_motor_without_pole_pairs_is_refused() {
    assert_eq!(Surface::new(0), Err(MotorError::NoPolePairs));
    assert!(Machine::new(4, 0.0).is_err() && Shaft::new(f64::NAN).is_err());
    assert!(serde_json::from_str::<Surface>(r#"{"pole_pairs":0}"#).unwrap_err().to_string().contains("pole pair"));
}

// With the least-squares parameters of an undisturbed record, voltages are predicted from currents and currents from
// voltages; with Ke 5 % off neither is.
#[test]
fn validation_both_ways() {
    let axis = RobotAxis::reference(1).unwrap();
    let log = Simulation::new(axis).unwrap().undisturbed().run(&Program::speed_cycles(&axis, 3, 1.0).unwrap());
    let spans = Spans::from_log(&log, axis.pole_pairs);
    let found = spans.plain(Axes::Both, Form::Stationary).solve().unwrap().parameters;
    let wrong = Winding { ke: 1.05 * found.ke, ..found };

    let fit = |winding| Validation::of(spans.voltages(&winding, Form::Stationary).into_iter()).fit;
    assert!(fit(found).iter().all(|percent| *percent > 99.5), "{:?}", fit(found));
    assert!(fit(wrong)[1] < 97.0, "{:?}", fit(wrong));

    let model = Compensated::<_, CompensatedWinding>::new(ExactSurface(
        ExactStep::new(4, RobotAxis::TS, HeldIn::Stationary).unwrap(),
    ));
    let record = spans.grey_box(&model, 0.15).unwrap();
    let simulated = |p: Winding| {
        let held = CompensatedWinding { rs: fixed(p.rs), ls: fixed(p.ls), ke: fixed(p.ke), vdt: fixed(0.0) };
        Fit::new(&model, &record).parameters(held).run().unwrap().quality
    };
    // Currents from voltages are an amplifier: with R = 0.4 ohm, 5 % of the EMF are amperes.
    let (right, off) = (simulated(found).iq, simulated(wrong).iq);
    assert!(right.fit_percent.unwrap() > 99.0, "{right:?}");
    assert!(off.rmse > 10.0 * right.rmse, "{off:?} {right:?}");
}
