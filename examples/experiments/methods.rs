//! The estimators that are compared, each from a record to numbers.

use greybox::online::{AdaptationLaw, Mras, MrasStart, Order, Stepping, Watch};
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::offline::{Axes, Equations, Extended, Form, Spans};
use greybox::pmsm::program::{Cycle, Program};
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{Currents, Drive, ExactStep, ExactSurface, HeldIn, MotorLaw, NotAdapted, Surface, Winding};
use greybox::{Butterworth, Experiment, Fit, Time, fixed, free, regress::LinearEstimate};

pub type Result<T> = core::result::Result<T, Box<dyn std::error::Error>>;

/// A record by sample intervals, and its cycles.
pub struct Run {
    pub axis: RobotAxis,
    pub spans: Spans,
    pub cycles: Vec<Cycle>,
}

pub fn run(simulation: Simulation, program: Program) -> Run {
    let axis = simulation.nominal;
    let spans = Spans::from_log(&simulation.run(&program), axis.pole_pairs);
    Run { axis, spans, cycles: program.cycles }
}

pub fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0)
}

pub fn low_pass(ts: f64) -> Result<Butterworth> {
    Ok(Butterworth::low_pass(4, 100.0, ts)?)
}

/// The thesis' least squares (5.2.1): both voltage equations, pre-filtered.
pub fn equations(spans: &Spans) -> Result<Equations<Winding>> {
    Ok(spans.plain(Axes::Both, Form::Rotor).prefiltered(&low_pass(spans.ts)?))
}

/// Least squares on each cycle.
pub fn per_cycle(run: &Run, axes: Axes) -> Result<Vec<(f64, LinearEstimate<Winding>)>> {
    let filter = low_pass(run.spans.ts)?;
    let solve = |cycle: &Cycle| {
        let spans = run.spans.cut(cycle.samples.clone());
        Ok((cycle.speed, spans.plain(axes, Form::Rotor).prefiltered(&filter).solve()?))
    };
    run.cycles.iter().map(solve).collect()
}

/// The thesis' nonlinear grey box (5.2.3): simulated against measured currents, by one search from 1.5 R, 1.2 L and 0.9 Ke. In slow
/// cycles dead time leaves id unexplained, and other starts would lead to minima at 100 R.
pub fn grey_box(spans: &Spans, axis: &RobotAxis) -> Result<Winding> {
    let model = Surface::new(axis.pole_pairs.into())?;
    let (inputs, outputs) =
        spans.spans.iter().map(|span| (Drive { ud: span.ud, uq: span.uq, w: span.w }, span.i0)).unzip();
    let record = Experiment::new(&model, Time::Uniform { start: 0.0, step: spans.ts }, inputs, outputs)?;
    let start = Winding { rs: free(1.5 * axis.rs), ls: free(1.2 * axis.ls), ke: free(0.9 * axis.ke) };
    Ok(Fit::new(&model, &record).parameters(start).starts(1).run()?.parameters)
}

/// The same on each cycle.
pub fn grey_box_per_cycle(run: &Run) -> Result<Vec<(f64, Winding)>> {
    let fit = |cycle: &Cycle| Ok((cycle.speed, grey_box(&run.spans.cut(cycle.samples.clone()), &run.axis)?));
    run.cycles.iter().map(fit).collect()
}

/// Extended least squares on a whole record.
pub fn solve_extended(spans: &Spans) -> Result<LinearEstimate<Extended>> {
    let filter = low_pass(spans.ts)?;
    let i0 = Extended::search_i0(0.03, 1.0, |i0| spans.extended(i0).prefiltered(&filter).least_squares())?;
    Ok(spans.extended(i0).prefiltered(&filter).solve()?)
}

/// Error of Ke (%) over time of the observer with this resistance and inductance, fed with the voltage less the dead time
/// of `vdt` (V), from 10 % below.
pub fn mras<L: AdaptationLaw<ExactSurface>>(
    run: &Run,
    (rs, ls): (f64, f64),
    vdt: f64,
    law: L,
) -> Result<Vec<(f64, f64)>> {
    let (axis, ts) = (&run.axis, run.spans.ts);
    let ke = free(0.9 * axis.ke).within(0.0, 10.0 * axis.ke);
    let start = MrasStart {
        parameters: Winding { rs: fixed(rs), ls: fixed(ls), ke },
        pull: Currents { id: 1000.0, iq: 1000.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1000 },
    };
    let step = ExactStep::new(axis.pole_pairs.into(), ts, HeldIn::Stationary)?;
    let mut observer = Mras::new(ExactSurface(step), law, ts, start)?;
    let trace = run.spans.spans.iter().enumerate().map(|(k, span)| {
        let (t, u) = (k as f64 * ts, span.angled());
        observer.update(t, &step.less_dead_time(&span.i0, &u, vdt, 0.15), &span.i0);
        (t, percent(observer.parameters().ke, axis.ke))
    });
    Ok(trace.collect())
}

pub fn rms_of_second_half(trace: &[(f64, f64)]) -> f64 {
    let half = &trace[trace.len() / 2..];
    (half.iter().map(|(_, e)| e * e).sum::<f64>() / half.len() as f64).sqrt()
}

/// Adapts only the back-EMF.
pub fn only_ke<K>(ke: K) -> MotorLaw<NotAdapted, K> {
    MotorLaw { rs: NotAdapted, ke }
}
