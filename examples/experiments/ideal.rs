//! Experiments 1 and 2: an observer inside the loop of an ideal drive.

use crate::figure::{Figure, Panel, Series, curve, reference, thin};
use crate::methods::Result;
use crate::report::Report;
use greybox::online::{AdaptationLaw, Mras, MrasStart, Order, Stepping, UpdateOutcome, Watch};
use greybox::pmsm::adaptive::{Adaptive, Instant};
use greybox::pmsm::control::{CurrentControl, PositionControl, SpeedControl};
use greybox::pmsm::{
    Currents, ExactStep, ExactSurface, HeldIn, KeLyapunov, Machine, MachineParameters, MotorLaw, NotAdapted, PolePairs,
    RsDirect, RsLyapunov, Winding,
};
use greybox::{fixed, free};

const TS: f64 = 0.126e-3;

fn observer<L: AdaptationLaw<ExactSurface>>(
    start: Winding,
    law: L,
    ts: f64,
    order: Order,
) -> Result<Mras<ExactSurface, L>> {
    let start = MrasStart {
        parameters: Winding {
            rs: free(start.rs).within(0.0, 20.0),
            ls: fixed(start.ls),
            ke: free(start.ke).within(0.0, 20.0),
        },
        pull: Currents { id: 100.0, iq: 100.0 },
        order,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 100 },
    };
    Ok(Mras::new(ExactSurface(ExactStep::new(4, ts, HeldIn::Rotor)?), law, ts, start)?)
}

/// The motor of experiment 1: Ke falls by 10 % from 5 s to 7 s, R rises by 30 % from 9 s to 11 s.
fn drifting(t: f64) -> MachineParameters {
    let ramp = |begin: f64| ((t - begin) / 2.0).clamp(0.0, 1.0);
    let (rs, ke) = (0.5 * (1.0 + 0.3 * ramp(9.0)), 1.6 * (1.0 - 0.1 * ramp(5.0)));
    MachineParameters { rs, ld: 4e-3, lq: 4e-3, ke, j: 0.3, bv: 1.0, tc: 0.0, tg: 0.0 }
}

fn errors(now: &Instant) -> (f64, f64) {
    let p = drifting(now.t);
    (100.0 * (now.estimate.rs / p.rs - 1.0), 100.0 * (now.estimate.ke / p.ke - 1.0))
}

fn step_of_torque<L: AdaptationLaw<ExactSurface>>(law: L, torque: f64, id: f64) -> Result<Vec<Instant>> {
    let start = Winding { rs: 0.4, ls: 4e-3, ke: 1.28 };
    let drive = Adaptive {
        machine: Machine::new(4, 1.0)?,
        control: CurrentControl::lambda_tuned(0.4, 4e-3, 0.0, PolePairs::new(4)?, 1e-3)?,
        observer: observer(start, law, TS, Order::UpdateThenPredict)?,
        ts: TS,
    };
    let mut seen = Vec::new();
    let reference = |t: f64, _: &_, kt: f64| {
        let iq = if t >= 1.0 { torque / kt } else { 0.0 };
        Currents { id: id * iq, iq }
    };
    drive.run(14.0, drifting, |_| 0.0, reference, |now| seen.push(*now));
    Ok(seen)
}

pub fn torque_step() -> Result<Report> {
    let mut report = Report::new("Experiment 1: torque step of 100 N m, estimates from 80 %, drifting motor");
    let ke = KeLyapunov { gain: 1e-3 };
    let direct = step_of_torque(MotorLaw { rs: RsDirect { gain: -10.0 }, ke }, 100.0, 0.2)?;
    let lyapunov = step_of_torque(MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke }, 100.0, 0.2)?;
    let without = step_of_torque(MotorLaw { rs: NotAdapted, ke }, 100.0, 0.0)?;
    let reversed = step_of_torque(MotorLaw { rs: RsDirect { gain: -10.0 }, ke }, -100.0, 0.2)?;

    let runs = [("R law (5.4)", &direct), ("R law by Lyapunov", &lyapunov), ("id = 0, R held", &without)];
    let row = |(name, seen): &(&str, &Vec<Instant>)| {
        let at = |t: f64| errors(&seen[(t / TS).round() as usize]);
        let cells = [1.35, 4.9, 8.9, 14.0].into_iter().flat_map(|t| [at(t).0, at(t).1]).collect();
        (name.to_string(), cells)
    };
    let columns = ["R 1.35 s", "Ke 1.35 s", "R 4.9 s", "Ke 4.9 s", "R 8.9 s", "Ke 8.9 s", "R 14 s", "Ke 14 s"];
    report.table("Errors of the estimates (%)", &columns, runs.iter().map(row).collect());

    let torque = direct.iter().filter(|now| now.t >= 2.0).map(|now| (now.torque - 100.0).abs()).fold(0.0, f64::max);
    report.claim(
        "With both parameters estimated, torque stays at its reference while the motor drifts",
        "within 0.12 N m from 2 s on",
        format!("within {torque:.3} N m of 100 N m from 2 s on"),
        torque < 0.12,
    );
    let bias = errors(&without[(4.9 / TS) as usize]).1;
    report.claim(
        "Without d current the resistance cannot be estimated, and its error goes into Ke",
        "Ke off by dR b/Ke^2 = 3.906 %, within 0.05 %",
        format!("R held 20 % low makes Ke {bias:.3} % high"),
        (bias - 3.906).abs() < 0.05,
    );
    let stopped = reversed.iter().find_map(|now| match now.outcome {
        UpdateOutcome::Diverged(why) => Some((now.t, why)),
        _ => None,
    });
    let found = stopped.map_or("it did not stop".to_owned(), |(t, why)| format!("stopped at {t:.3} s: {why}"));
    let statement = "Law (5.4) is stable only while g id < 0 (here: -100 N m)";
    report.claim(statement, "the observer says that it diverged", found, stopped.is_some());

    let trace = |of: fn(&Instant) -> f64, seen: &[Instant]| thin(seen.iter().map(|now| (now.t, of(now))).collect());
    let truth =
        |of: fn(MachineParameters) -> f64| thin(direct.iter().map(|now| (now.t, of(drifting(now.t)))).collect());
    let series = |of: fn(&Instant) -> f64, true_value: fn(MachineParameters) -> f64| {
        vec![
            curve("law (5.4)", trace(of, &direct)),
            curve("Lyapunov's law", trace(of, &lyapunov)),
            curve("id = 0, R held", trace(of, &without)),
            reference("true", truth(true_value)),
        ]
    };
    let caption =
        "Both laws find Ke from 80 % within a third of a second and follow it; with R held, R's error goes into Ke.";
    report.figure(figure(
        "exp1-ke",
        "Back-EMF of a drifting motor",
        caption,
        "Ke (V s/rad)",
        series(|now| now.estimate.ke, |p| p.ke),
    ));
    let caption = "Both laws find R and follow it; Ke's own drift (5 to 7 s) shows in Lyapunov's law for a moment.";
    report.figure(figure(
        "exp1-rs",
        "Resistance of a drifting motor",
        caption,
        "R (ohm)",
        series(|now| now.estimate.rs, |p| p.rs),
    ));
    let torque = vec![
        curve("adapted", trace(|now| now.torque, &direct)),
        curve("id = 0, R held", trace(|now| now.torque, &without)),
        reference("reference", vec![(0.0, 0.0), (1.0, 0.0), (1.0, 100.0), (14.0, 100.0)]),
    ];
    let caption = "Adapted, the torque is 100 N m whatever the motor does; a wrong Ke is a wrong torque.";
    report.figure(figure("exp1-torque", "Torque, 100 N m asked for from 1 s on", caption, "torque (N m)", torque));
    Ok(report)
}

/// Integral of |speed error| (rad) over 5 s, and traces of the speed error and of Kt's error (%).
struct Followed {
    integral: f64,
    speed_error: Vec<(f64, f64)>,
    kt: Vec<(f64, f64)>,
}

fn step_of_position<L: AdaptationLaw<ExactSurface>>(law: L, start: f64, ts: f64, order: Order) -> Result<Followed> {
    let rotor = MachineParameters { rs: 0.4, ld: 4e-3, lq: 4e-3, ke: 0.95, j: 0.2, bv: 0.02, tc: 0.0, tg: 0.0 };
    let drive = Adaptive {
        machine: Machine::new(4, 1.0)?,
        control: CurrentControl::lambda_tuned(0.4, 4e-3, 0.0, PolePairs::new(4)?, 1e-3)?,
        observer: observer(Winding { rs: 0.4, ls: 4e-3, ke: start * rotor.ke }, law, ts, order)?,
        ts,
    };
    let mut position = PositionControl::new(5.0, 300.0, 60.0)?;
    let mut speed = SpeedControl::tuned(0.2, 3.0, 1.0)?;
    let (mut integral, mut speed_error, mut kt) = (0.0, Vec::new(), Vec::new());
    let reference = |t: f64, x: &greybox::pmsm::MachineState, kt: f64| {
        let target = position.step(2400.0 - x.theta, ts);
        integral += (target.w - x.w).abs() * ts;
        speed_error.push((t, target.w - x.w));
        Currents { id: 0.0, iq: speed.step(target, x.theta, x.w, ts).0 / kt }
    };
    let load = |w: f64| if w > 0.0 { 1.0 } else { 0.0 };
    drive.run(
        5.0,
        |_| rotor,
        load,
        reference,
        |now| {
            kt.push((now.t, 100.0 * (now.estimate.ke / rotor.ke - 1.0)));
        },
    );
    Ok(Followed { integral, speed_error: thin(speed_error), kt: thin(kt) })
}

pub fn position_step() -> Result<Report> {
    let mut report = Report::new("Experiment 2: position step of 2400 rad, Kt believed 20 % high");
    let adapt = MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain: 1e-3 } };
    let rest = MotorLaw { rs: NotAdapted, ke: NotAdapted };
    let runs = [
        ("true Kt", step_of_position(rest, 1.0, TS / 10.0, Order::Thesis)?),
        ("adapted, Ts/10, order of the thesis", step_of_position(adapt, 1.2, TS / 10.0, Order::Thesis)?),
        ("adapted, Ts, update then predict", step_of_position(adapt, 1.2, TS, Order::UpdateThenPredict)?),
        ("not adapted", step_of_position(rest, 1.2, TS / 10.0, Order::Thesis)?),
    ];
    let row = |(name, run): &(&str, Followed)| {
        let late = run.kt.iter().filter(|(t, _)| *t >= 0.3).map(|(_, e)| e.abs()).fold(0.0, f64::max);
        (name.to_string(), vec![run.integral, late])
    };
    let columns = ["|e_w| (rad)", "Kt err %"];
    report.table(
        "Integral of the speed error over 5 s, largest error of Kt from 0.3 s on",
        &columns,
        runs.iter().map(row).collect(),
    );
    let (knows, adapted, not) = (runs[0].1.integral, runs[1].1.integral, runs[3].1.integral);
    report.claim(
        "An adapted Kt makes the speed follow as with the true one",
        "integral within 1 % of that with the true Kt, and half as much again without adaptation",
        format!("{adapted:.2} rad adapted, {knows:.2} rad with the true Kt, {not:.2} rad not adapted"),
        adapted < 1.01 * knows && not > 1.5 * knows,
    );
    let series = |of: fn(&Followed) -> &Vec<(f64, f64)>| {
        runs.iter().map(|(name, run)| curve(*name, of(run).clone())).collect::<Vec<_>>()
    };
    let caption = "The adapted drive follows as one that knows Kt; not adapted, it lags by half as much again.";
    let title = "Speed error in a position step";
    report.figure(figure("exp2-speed-error", title, caption, "speed error (rad/s)", series(|run| &run.speed_error)));
    let caption = "Kt is within 1 % after 0.3 s, at the drive's sample time as at a tenth of it.";
    let title = "Torque constant, believed 20 % high at first";
    report.figure(figure("exp2-kt", title, caption, "error of Kt (%)", series(|run| &run.kt)));
    Ok(report)
}

fn figure(name: &str, title: &str, caption: &str, y: &'static str, series: Vec<Series>) -> Figure {
    Figure {
        name: name.to_owned(),
        title: title.to_owned(),
        caption: caption.to_owned(),
        x: "time (s)",
        y,
        panels: vec![Panel { title: String::new(), series }],
        logarithmic: false,
    }
}
