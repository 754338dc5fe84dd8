//! What goes beyond the thesis, before and after, on the same records: `cargo run --release --example improvements`.

#[path = "../experiments/report.rs"]
#[allow(dead_code, reason = "shared with the experiments, which also draw")]
mod report;
#[path = "../common/terminal.rs"]
mod terminal;

use greybox::online::{Ekf, EkfStart, Law, MrasStart, Order, Stepping, Watch};
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::inverter::Carrier;
use greybox::pmsm::offline::{Axes, Extended, Form, Spans, extended, plain, search_i0};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::{Axis, TS, V_DC};
use greybox::pmsm::{
    AngledDrive, Currents, DeadZone, ExactStep, ExactSurface, HeldIn, Injection, InverterFed, InverterFedWinding,
    KeLyapunov, MotorLaw, Normalized, NotAdapted, Winding,
};
use greybox::{Butterworth, Hold, LinearEstimate, fixed, free, hampel};
use report::Report;

type Result<T> = core::result::Result<T, Box<dyn std::error::Error>>;

fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0)
}

fn solve_plain(spans: &Spans) -> Result<Winding> {
    let filter = Butterworth::low_pass(4, 100.0, TS)?;
    Ok(plain(spans, Axes::Both, Form::Rotor).prefiltered(&filter).solve()?.parameters)
}

fn solve_extended(spans: &Spans) -> Result<LinearEstimate<Extended>> {
    let filter = Butterworth::low_pass(4, 100.0, TS)?;
    let i0 = search_i0(0.03, 1.0, |i0| extended(spans, i0).prefiltered(&filter).least_squares())?;
    Ok(extended(spans, i0).prefiltered(&filter).solve()?)
}

/// Root mean square of the errors of Ke (%) in the second half of a run.
fn rms(axis: &Axis, ke: impl ExactSizeIterator<Item = f64>) -> f64 {
    let half = ke.len() / 2;
    let squares: Vec<f64> = ke.skip(half).map(|ke| percent(ke, axis.ke).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The observer with this resistance and inductance, fed with the voltage less the dead time of `vdt` (V).
fn mras<L: Law<ExactSurface>>(axis: &Axis, spans: &Spans, (rs, ls): (f64, f64), vdt: f64, law: L) -> Result<f64> {
    let ke = free(0.9 * axis.ke).within(0.0, 10.0 * axis.ke);
    let start = MrasStart {
        parameters: Winding { rs: fixed(rs), ls: fixed(ls), ke },
        pull: Currents { id: 1000.0, iq: 1000.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1000 },
    };
    let step = ExactStep::new(4, TS, HeldIn::Stationary)?;
    let mut observer = ExactSurface(step).mras(law, start)?;
    Ok(rms(
        axis,
        spans.spans.iter().enumerate().map(|(k, span)| {
            let u = AngledDrive { ud: span.ud, uq: span.uq, w: span.w, theta: span.theta };
            observer.update(k as f64 * TS, &step.less_dead_time(&span.i0, &u, vdt, 0.15), &span.i0);
            observer.parameters().ke
        }),
    ))
}

fn joint_filter(axis: &Axis, spans: &Spans) -> Result<f64> {
    let current = free(0.0).prior(0.0, 1.0);
    let start = EkfStart {
        state: Currents { id: current, iq: current },
        parameters: InverterFedWinding {
            rs: free(axis.rs).prior(axis.rs, 0.1f64.sqrt()),
            ls: fixed(axis.ls),
            ke: free(0.9 * axis.ke).prior(0.9 * axis.ke, 0.02f64.sqrt()),
            vdt: free(0.0).prior(0.0, 2.0),
            i0: fixed(0.15),
        },
        state_drift: Currents { id: 0.1, iq: 0.1 },
        parameter_drift: InverterFedWinding { rs: 1e-5, ls: 0.0, ke: 1e-11f64.sqrt(), vdt: 1e-9f64.sqrt(), i0: 0.0 },
        noise: Currents { id: 4e-3f64.sqrt(), iq: 4e-3f64.sqrt() },
        hold: Hold::Zero,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1000 },
    };
    let mut filter = Ekf::<_, 5>::new(
        InverterFed::<_, InverterFedWinding>::new(ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary)?)),
        TS,
        start,
    )?;
    Ok(rms(
        axis,
        spans.spans.iter().enumerate().map(|(k, span)| {
            let u = AngledDrive { ud: span.ud, uq: span.uq, w: span.w, theta: span.theta };
            filter.update(k as f64 * TS, &u, &span.i0);
            filter.parameters().ke
        }),
    ))
}

fn main() -> Result<()> {
    let mut report = Report::new("Beyond the thesis: the same records, before and after");
    let (mut offline, mut online, mut water_rows) = (Vec::new(), Vec::new(), Vec::new());
    let stop = terminal::interrupted()?;
    let bar = terminal::steps(7, "axes");
    for number in (1..=6).take_while(|_| !stop.load(std::sync::atomic::Ordering::Relaxed)) {
        let axis = Axis::reference(number)?;
        let (name, total) = (format!("axis {number}"), axis.rs + axis.r_cable);
        let simulation = Simulation::new(axis)?;
        let program = Program::speed_cycles(&axis, 20, 1.0)?;
        let spans = Spans::from_log(&simulation.run(&program), axis.pole_pairs);
        let mut worst = [0f64; 4];
        for cycle in program.cycles.iter().step_by(3) {
            let cut = spans.cut(cycle.samples.clone());
            let (before, after) = (solve_plain(&cut)?, solve_extended(&cut)?.parameters);
            let errors = [(before.ke, axis.ke), (after.ke, axis.ke), (before.rs, total), (after.r, total)];
            for (worst, (found, truth)) in worst.iter_mut().zip(errors) {
                *worst = worst.max(percent(found, truth).abs());
            }
        }
        offline.push((name.clone(), worst.to_vec()));

        let law = |gain| MotorLaw { rs: NotAdapted, ke: KeLyapunov { gain } };
        let normalized = |gain| MotorLaw { rs: NotAdapted, ke: Normalized { law: KeLyapunov { gain }, speed: 100.0 } };
        let zone = MotorLaw { rs: NotAdapted, ke: DeadZone { law: normalized(1e-5).ke, speed: 20.0 } };
        let (nominal, whole) = ((total, axis.ls), solve_extended(&spans)?.parameters);
        let row = vec![
            mras(&axis, &spans, (axis.rs, axis.ls), 0.0, law(1e-5))?,
            mras(&axis, &spans, nominal, 2.0, law(1e-5))?,
            mras(&axis, &spans, nominal, 2.0, normalized(2e-5))?,
            mras(&axis, &spans, nominal, 2.0, zone)?,
            mras(&axis, &spans, (total, whole.lq), 2.0, zone)?,
            joint_filter(&axis, &spans)?,
        ];
        online.push((name.clone(), row));

        let water = Spans::from_log(&simulation.run(&Program::water_cutting(&axis, 6)?), axis.pole_pairs);
        let (before, after) = (solve_plain(&water)?, solve_extended(&water)?.parameters);
        let row = vec![percent(before.ke, axis.ke), percent(after.ke, axis.ke), joint_filter(&axis, &water)?];
        water_rows.push((name, row));
        bar.inc(1);
    }
    let columns = ["Ke LS", "Ke extended", "R LS", "R extended"];
    report.table("Speed cycles, offline: largest error over the speeds (%; R with cable)", &columns, offline);
    let columns = ["MRAS", "+R +Vdt", "normalized", "dead zone", "found Lq", "joint EKF"];
    report.table("Speed cycles, online: rms error of Ke (%)", &columns, online);
    let columns = ["Ke LS", "Ke extended", "EKF rms"];
    report.table("Water cutting: error of Ke (%)", &columns, water_rows);

    bar.set_message("axis 1, variants");
    let axis = Axis::reference(1)?;
    let program = Program::speed_cycles(&axis, 4, 1.0)?;
    let simulation = Simulation::new(axis)?;
    let row = |simulation: Simulation| -> Result<Vec<f64>> {
        let found = solve_extended(&Spans::from_log(&simulation.run(&program), axis.pole_pairs))?;
        Ok(vec![percent(found.parameters.ld, 0.96 * axis.ls), found.index.ld, found.index.r])
    };
    let injected = simulation.injecting(Injection::new(-12.0, 0.1, 0.01, 0.5)?);
    let rows = vec![("id = 0".to_owned(), row(simulation)?), ("stairs of -12 A".to_owned(), row(injected)?)];
    report.table("Axis 1, d current injected", &["Ld err %", "index Ld %", "index R %"], rows);

    let row = |(name, simulation): (&str, Simulation)| -> Result<(String, Vec<f64>)> {
        let spans = Spans::from_log(&simulation.run(&program), axis.pole_pairs);
        let (before, after) = (solve_plain(&spans)?, solve_extended(&spans)?.parameters);
        let r = percent(after.r, axis.rs + axis.r_cable);
        Ok((name.to_owned(), vec![percent(before.ke, axis.ke), percent(after.ke, axis.ke), r, after.vdt]))
    };
    let rows = [
        ("mean voltage", simulation),
        ("switching at 7.9 kHz", simulation.switching(V_DC, Carrier::PerSample)?),
        ("switching at 4.0 kHz", simulation.switching(V_DC, Carrier::HalfPerSample)?),
    ];
    let rows = rows.into_iter().map(row).collect::<Result<_>>()?;
    report.table("Axis 1, inverter that switches", &["Ke LS %", "Ke ext. %", "R ext. %", "Vdt V"], rows);

    let mut log = simulation.run(&program);
    let ls = |log: &_| -> Result<Vec<f64>> {
        let p = solve_plain(&Spans::from_log(log, axis.pole_pairs))?;
        Ok(vec![p.rs, p.ls * 1e3, p.ke])
    };
    let clean = ls(&log)?;
    log.rows.iter_mut().step_by(50).for_each(|row| row.iq += 40.0);
    let spiked = ls(&log)?;
    let mut values: Vec<f64> = log.rows.iter().map(|row| row.iq).collect();
    hampel(&mut values, 3, 6.0, simulation.currents.step);
    log.rows.iter_mut().zip(values).for_each(|(row, iq)| row.iq = iq);
    let rows = [("clean", clean), ("spikes of 40 A, 1 in 50", spiked), ("Hampel before the filter", ls(&log)?)];
    let rows = rows.map(|(name, cells)| (name.to_owned(), cells)).to_vec();
    report.table("Axis 1, outliers", &["R ohm", "L mH", "Ke V s/rad"], rows);
    bar.finish_and_clear();
    println!("{report}");
    Ok(())
}
