//! Experiments 1 and 2 of the thesis, and what they must show: an observer in the loop of an ideal drive.

use greybox::online::{AdaptationLaw, Mras, MrasStart, Order, Stepping, UpdateOutcome, Watch};
use greybox::pmsm::adaptive::{Adaptive, Instant};
use greybox::pmsm::control::{CurrentControl, PositionControl, SpeedControl};
use greybox::pmsm::{
    Currents, ExactStep, ExactSurface, HeldIn, KeLyapunov, Machine, MachineParameters, MotorLaw, NotAdapted, PolePairs,
    RsDirect, RsLyapunov, Winding,
};
use greybox::{fixed, free};

const TS: f64 = 0.126e-3;
const KE: f64 = 1.6;
const RS: f64 = 0.5;
const LS: f64 = 4e-3;

fn observer<L: AdaptationLaw<ExactSurface>>(
    start: Winding,
    lowest: f64,
    law: L,
    ts: f64,
    order: Order,
) -> Mras<ExactSurface, L> {
    let model = ExactSurface(ExactStep::new(4, ts, HeldIn::Rotor).unwrap());
    let start = MrasStart {
        parameters: Winding {
            rs: free(start.rs).within(lowest, 1e6),
            ls: fixed(start.ls),
            ke: free(start.ke).within(lowest, 1e6),
        },
        pull: Currents { id: 100.0, iq: 100.0 },
        order,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 100 },
    };
    Mras::new(model, law, ts, start).unwrap()
}

/// Ramps of experiment 1: Ke -10 % from 5 s to 7 s, R +30 % from 9 s to 11 s.
fn truth(t: f64) -> MachineParameters {
    let ramp = |begin: f64| ((t - begin) / 2.0).clamp(0.0, 1.0);
    let (rs, ke) = (RS * (1.0 + 0.3 * ramp(9.0)), KE * (1.0 - 0.1 * ramp(5.0)));
    MachineParameters { rs, ld: LS, lq: LS, ke, j: 0.3, bv: 1.0, tc: 0.0, tg: 0.0 }
}

/// Experiment 1: every sample of 14 s. `id` is the share of iq that id is given.
fn experiment_1<L: AdaptationLaw<ExactSurface>>(law: L, torque: f64, id: f64) -> Vec<Instant> {
    experiment_1_within(0.0, law, torque, id)
}

/// The same with a lowest bound for the estimates.
fn experiment_1_within<L: AdaptationLaw<ExactSurface>>(lowest: f64, law: L, torque: f64, id: f64) -> Vec<Instant> {
    let np = PolePairs::new(4).unwrap();
    let control = CurrentControl::lambda_tuned(0.8 * RS, LS, 0.0, np, 1e-3).unwrap();
    let drive = Adaptive {
        machine: Machine::new(4, 1.0).unwrap(),
        control,
        observer: observer(Winding { rs: 0.8 * RS, ls: LS, ke: 0.8 * KE }, lowest, law, TS, Order::UpdateThenPredict),
        ts: TS,
    };
    let mut seen = Vec::new();
    let reference = |t: f64, _: &_, kt: f64| {
        let iq = if t >= 1.0 { torque / kt } else { 0.0 };
        Currents { id: id * iq, iq }
    };
    drive.run(14.0, truth, |_| 0.0, reference, |now| seen.push(*now));
    seen
}

fn at(seen: &[Instant], t: f64) -> Instant {
    seen[(t / TS).round() as usize]
}

/// Relative errors (%) of (R, Ke).
fn errors(now: &Instant) -> (f64, f64) {
    let p = truth(now.t);
    (100.0 * (now.estimate.rs / p.rs - 1.0), 100.0 * (now.estimate.ke / p.ke - 1.0))
}

fn worst(seen: &[Instant], from: f64, to: f64, which: impl Fn((f64, f64)) -> f64) -> f64 {
    seen.iter().filter(|now| now.t >= from && now.t <= to).map(|now| which(errors(now)).abs()).fold(0.0, f64::max)
}

fn settles(seen: &[Instant]) {
    let (rs, ke) = errors(&at(seen, 1.35));
    assert!(rs.abs() < 1.0 && ke.abs() < 1.0, "at 1.35 s: R {rs} %, Ke {ke} %");
    for t in [4.9, 8.9, 14.0] {
        let (rs, ke) = errors(&at(seen, t));
        assert!(rs.abs() < 0.01 && ke.abs() < 0.01, "at {t} s: R {rs} %, Ke {ke} %");
    }
    for now in seen.iter().filter(|now| now.t >= 2.0) {
        assert!((now.torque - 100.0).abs() < 0.12, "torque {} at {} s", now.torque, now.t);
    }
}

#[test]
fn experiment_1_both_parameters_are_found_and_followed() {
    let law = MotorLaw { rs: RsDirect { gain: -10.0 }, ke: KeLyapunov { gain: 1e-3 } };
    let seen = experiment_1(law, 100.0, 0.2);
    settles(&seen);
    assert!(worst(&seen, 5.0, 7.0, |e| e.1) < 0.1);
    assert!(worst(&seen, 9.0, 11.0, |e| e.0) < 0.3);
}

#[test]
fn experiment_1_with_the_lyapunov_law_for_the_resistance() {
    let law = MotorLaw { rs: RsLyapunov { gain: 0.005 }, ke: KeLyapunov { gain: 1e-3 } };
    let seen = experiment_1(law, 100.0, 0.2);
    settles(&seen);
    assert!(worst(&seen, 5.0, 7.0, |e| e.1) < 0.1);
    assert!(worst(&seen, 9.0, 11.0, |e| e.0) < 0.3);
    assert!(worst(&seen, 5.0, 7.0, |e| e.0) < 0.5);
}

// Without id and with the resistance held, what is missing in R i is taken for EMF: dR b / Ke^2 of it.
#[test]
fn experiment_1_without_d_current_the_resistance_goes_into_ke() {
    let law = MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain: 1e-3 } };
    let seen = experiment_1(law, 100.0, 0.0);
    for (t, expected) in [(4.9, 3.906), (14.0, 12.056)] {
        let ke = errors(&at(&seen, t)).1;
        assert!((ke - expected).abs() < 0.05, "{ke} % at {t} s");
    }
}

#[test]
fn experiment_1_the_direct_law_diverges_with_d_current_of_the_wrong_sign_and_says_so() {
    let law = MotorLaw { rs: RsDirect { gain: -10.0 }, ke: KeLyapunov { gain: 1e-3 } };
    let seen = experiment_1(law, -100.0, 0.2);
    // The estimate leaves its bounds, the resistance being below zero, before 1.03 s; left to itself, its error is past
    // 100 % there.
    let stopped = seen.iter().find(|now| matches!(now.outcome, UpdateOutcome::Diverged(_))).expect("it must say so");
    assert!(stopped.t > 1.0 && stopped.t < 1.03, "{}", stopped.t);
    let end = seen.last().unwrap();
    assert!(matches!(end.outcome, UpdateOutcome::Diverged(_)), "{:?}", end.outcome);
    assert!(end.estimate.rs.is_finite() && end.estimate.ke.is_finite());

    let law = MotorLaw { rs: RsDirect { gain: -10.0 }, ke: KeLyapunov { gain: 1e-3 } };
    let unbounded = experiment_1_within(-1e6, law, -100.0, 0.2);
    assert!(errors(&at(&unbounded, 1.03)).0.abs() > 100.0);
    assert!(unbounded.iter().all(|now| now.estimate.rs.is_finite() && now.torque.is_finite()));

    let law = MotorLaw { rs: RsLyapunov { gain: 0.005 }, ke: KeLyapunov { gain: 1e-3 } };
    let (rs, ke) = errors(experiment_1(law, -100.0, 0.2).last().unwrap());
    assert!(rs.abs() < 0.01 && ke.abs() < 0.01, "R {rs} %, Ke {ke} %");
}

/// Experiment 2: the integral of the absolute speed error (rad) over 5 s, and the torque constant's error (%) over time.
fn experiment_2<L: AdaptationLaw<ExactSurface>>(law: L, start: f64, ts: f64, order: Order) -> (f64, Vec<(f64, f64)>) {
    const KE: f64 = 0.95;
    let rotor = MachineParameters { rs: 0.4, ld: LS, lq: LS, ke: KE, j: 0.2, bv: 0.02, tc: 0.0, tg: 0.0 };
    let np = PolePairs::new(4).unwrap();
    let drive = Adaptive {
        machine: Machine::new(4, 1.0).unwrap(),
        control: CurrentControl::lambda_tuned(0.4, LS, 0.0, np, 1e-3).unwrap(),
        observer: observer(Winding { rs: 0.4, ls: LS, ke: start * KE }, 0.0, law, ts, order),
        ts,
    };
    let mut position = PositionControl::new(5.0, 300.0, 60.0).unwrap();
    let mut speed = SpeedControl::tuned(0.2, 3.0, 1.0).unwrap();
    let (mut integral, mut kt) = (0.0, Vec::new());
    let mut error = 0.0;
    let reference = |_: f64, x: &greybox::pmsm::MachineState, kt: f64| {
        let target = position.step(2400.0 - x.theta, ts);
        error = target.w - x.w;
        integral += error.abs() * ts;
        let (torque, _) = speed.step(target, x.theta, x.w, ts);
        Currents { id: 0.0, iq: torque / kt }
    };
    let load = |w: f64| if w > 0.0 { 1.0 } else { 0.0 };
    drive.run(5.0, |_| rotor, load, reference, |now| kt.push((now.t, 100.0 * (now.estimate.ke / KE - 1.0))));
    (integral, kt)
}

#[test]
fn experiment_2_the_adapted_drive_follows_as_well_as_one_that_knows() {
    let adapt = MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain: 1e-3 } };
    let rest = MotorLaw { rs: NotAdapted, ke: NotAdapted };
    let (ts, order) = (TS / 10.0, Order::Thesis);
    let within = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 0.01, "{value} for {expected}");
    within(experiment_2(rest, 1.0, ts, order).0, 3.44);
    within(experiment_2(rest, 1.2, ts, order).0, 5.44);
    let (integral, kt) = experiment_2(adapt, 1.2, ts, order);
    within(integral, 3.44);
    for (t, error) in kt.iter().filter(|(t, _)| *t >= 0.3) {
        assert!(error.abs() < 1.0, "Kt {error} % at {t} s");
    }
}

// At the drive's own sample time the thesis' order is unstable; with the update before the prediction it works.
#[test]
fn experiment_2_at_the_drives_sample_time() {
    let adapt = MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain: 1e-3 } };
    let (integral, kt) = experiment_2(adapt, 1.2, TS, Order::UpdateThenPredict);
    assert!((integral / 3.44 - 1.0).abs() < 0.01, "{integral}");
    assert!(kt.iter().filter(|(t, _)| *t >= 0.3).all(|(_, error)| error.abs() < 1.0));
    let (_, kt) = experiment_2(adapt, 1.2, TS, Order::Thesis);
    assert!(kt.iter().any(|(t, error)| *t >= 0.3 && error.abs() > 1.0));
}
