//! Every motor model that ships: its slopes against finite differences, and validation both ways on a record.

use greybox::check::derivatives;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::offline::{Axes, Form, Spans, Validation, plain, voltages};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::{Axis, TS};
use greybox::pmsm::*;
use greybox::{Fit, fixed, signals};

signals! {
    /// A salient motor behind cable and inverter, and how its record is aligned.
    pub struct Line {
        rs: "ohm", r_cable: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad",
    }
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
        let step = ExactStep::new(4, TS, held_in).unwrap();
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

#[test]
fn a_motor_without_pole_pairs_is_refused() {
    assert_eq!(Surface::new(0), Err(Error::NoPolePairs));
    assert!(Machine::new(4, 0.0).is_err() && Shaft::new(f64::NAN).is_err());
    assert!(serde_json::from_str::<Surface>(r#"{"pole_pairs":0}"#).unwrap_err().to_string().contains("pole pair"));
}

// With the least-squares parameters of an undisturbed record, voltages are predicted from currents and currents from
// voltages; with Ke 5 % off neither is.
#[test]
fn validation_both_ways() {
    let axis = Axis::reference(1).unwrap();
    let log = Simulation::new(axis).unwrap().undisturbed().run(&Program::speed_cycles(&axis, 3, 1.0).unwrap());
    let spans = Spans::from_log(&log, axis.pole_pairs);
    let found = plain(&spans, Axes::Both, Form::Stationary).solve().unwrap().parameters;
    let wrong = Winding { ke: 1.05 * found.ke, ..found };

    let fit = |winding| Validation::of(voltages(&spans, &winding, Form::Stationary).into_iter()).fit;
    assert!(fit(found).iter().all(|percent| *percent > 99.5), "{:?}", fit(found));
    assert!(fit(wrong)[1] < 97.0, "{:?}", fit(wrong));

    let model =
        Compensated::<_, CompensatedWinding>::new(ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap()));
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
