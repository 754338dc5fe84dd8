//! The back-EMF's observer on the speed cycles of the robot, root mean square errors over the second half, mean of six axes.
//!
//! With the nominal inductance dead time, total resistance and normalized gain reach 0.166 %, with a dead zone 0.136 %. What
//! is left is the saliency: `Ld` and `Lq` differ by 4 % from the observer's inductance, and the current that friction needs
//! makes a voltage `we (Lq - L) iq` that is taken for EMF. Without saliency axis 1 reaches 0.042 and 0.029 %. An observer with
//! the voltage held in the rotor's frame makes an error of the other sign that hides a part of it, and reads 0.13 %.

use crate::acceptance_records::{Record, cycles, percent, record};
use greybox::online::{AdaptationLaw, MrasStart, Order, Stepping, Watch};
use greybox::pmsm::drive::{Disturbance, Simulation};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{
    AngledDrive, Currents, DeadZone, ExactStep, ExactSurface, HeldIn, KeLyapunov, MotorLaw, Normalized, NotAdapted,
    Winding,
};
use greybox::{Butterworth, fixed, free};

/// Of an observer with this resistance and inductance, fed with the voltage less `vdt` (V) of dead time.
fn rms<L: AdaptationLaw<ExactSurface>>(
    record: &Record,
    (rs, ls): (f64, f64),
    vdt: f64,
    held_in: HeldIn,
    law: L,
) -> f64 {
    let ke = record.axis.ke;
    let step = ExactStep::new(4, RobotAxis::TS, held_in).unwrap();
    let start = MrasStart {
        parameters: Winding { rs: fixed(rs), ls: fixed(ls), ke: free(0.9 * ke).within(0.0, 10.0 * ke) },
        pull: Currents { id: 1000.0, iq: 1000.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1000 },
    };
    let mut observer = ExactSurface(step).mras(law, start).unwrap();
    let errors = record.spans.spans.iter().enumerate().map(|(k, span)| {
        let u = AngledDrive { ud: span.ud, uq: span.uq, w: span.w, theta: span.theta };
        observer.update(k as f64 * RobotAxis::TS, &step.less_dead_time(&span.i0, &u, vdt, 0.15), &span.i0);
        percent(observer.parameters().ke, ke)
    });
    let half = record.spans.spans.len() / 2;
    let squares = errors.skip(half).map(|e| e * e).sum::<f64>();
    (squares / (record.spans.spans.len() - half) as f64).sqrt()
}

fn lyapunov(gain: f64) -> KeLyapunov {
    KeLyapunov { gain }
}

fn normalized(gain: f64) -> Normalized<KeLyapunov> {
    Normalized { law: lyapunov(gain), speed: 100.0 }
}

fn only<K>(ke: K) -> MotorLaw<NotAdapted, K> {
    MotorLaw { rs: NotAdapted, ke }
}

const STILL: HeldIn = HeldIn::Stationary;

#[test]
fn each_improvement_of_the_observer_counts() {
    if cfg!(debug_assertions) {
        println!("skipped: run `cargo test --release --test motor acceptance_mras`");
        return;
    }
    let filter = Butterworth::low_pass(4, 100.0, RobotAxis::TS).unwrap();
    let mut mean = [0.0; 6];
    for number in 1..=6 {
        let record = cycles(number);
        let axis = &record.axis;
        let total = (axis.rs + axis.r_cable, axis.ls);
        let lq = record.spans.extended(0.15).prefiltered(&filter).solve().unwrap().parameters.lq;
        let zone = only(DeadZone { law: normalized(1e-5), speed: 20.0 });
        let found = [
            rms(record, (axis.rs, axis.ls), 0.0, STILL, only(lyapunov(1e-5))),
            rms(record, total, 2.0, STILL, only(DeadZone { law: lyapunov(1e-5), speed: 20.0 })),
            rms(record, total, 2.0, STILL, only(normalized(2e-5))),
            rms(record, total, 2.0, STILL, zone),
            rms(record, (total.0, lq), 2.0, STILL, zone),
            rms(record, total, 2.0, HeldIn::Rotor, only(normalized(2e-5))),
        ];
        println!("axis {number}: {found:.3?}");
        mean.iter_mut().zip(found).for_each(|(mean, found)| *mean += found / 6.0);
    }
    println!("mean: {mean:.3?}");
    let [plain, compensated, normalized, zone, found_lq, rotor] = mean;
    // The published digits; the seeds' noise moves the last one.
    assert!((plain - 2.4).abs() < 0.05 && (compensated - 0.25).abs() < 0.005, "{mean:?}");
    assert!((normalized - 0.166).abs() < 0.002 && (zone - 0.136).abs() < 0.002, "{mean:?}");
    assert!(found_lq < 0.09, "{mean:?}");
    assert!((rotor - 0.13).abs() < 0.005, "{mean:?}");
}

// The two figures without saliency: on axis 1 0.042 and 0.029 % in the place of 0.153 and 0.105 %.
#[test]
fn what_is_left_is_the_saliency() {
    for number in (1..=6).step_by(if cfg!(debug_assertions) { 6 } else { 5 }) {
        let axis = RobotAxis::reference(number).unwrap();
        let simulation = Simulation::new(axis).unwrap().without(Disturbance::Saliency);
        let record = record(simulation, Program::speed_cycles(&axis, 20, 1.0).unwrap());
        let total = (axis.rs + axis.r_cable, axis.ls);
        let plain = rms(&record, total, 2.0, STILL, only(normalized(2e-5)));
        let zone = rms(&record, total, 2.0, STILL, only(DeadZone { law: normalized(1e-5), speed: 20.0 }));
        println!("axis {number}: {plain:.3} %, with the dead zone {zone:.3} %");
        if number == 1 {
            assert!((plain - 0.042).abs() < 0.002 && (zone - 0.029).abs() < 0.002, "axis 1: {plain} {zone}");
        }
        assert!(plain < 0.05 && zone < 0.03, "axis {number}: {plain} {zone}");
    }
}
