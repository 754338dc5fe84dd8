//! Speed cycles and water cutting, online: the adaptive observer step by step, and the joint Kalman filter.

use crate::figure::{Figure, Panel, curve, dots, level, thin};
use crate::methods::*;
use crate::report::Report;
use greybox::online::{Ekf, EkfStart, Watch};
use greybox::pmsm::{
    Currents, DeadZone, ExactStep, ExactSurface, HeldIn, InverterFed, InverterFedWinding, KeLyapunov, Normalized,
};
use greybox::{Hold, fixed, free};

const STEPS: [&str; 6] =
    ["MRAS", "told R and dead time", "gain normalized", "dead zone", "Lq from extended LS", "joint Kalman filter"];

type Trace = Vec<(f64, f64)>;

#[derive(Default)]
pub struct Online {
    /// Rms error of Ke (%) over the second half, by axis and step.
    rows: Vec<(String, Vec<f64>)>,
    /// Errors of Ke (%) in water cutting: least squares, extended, filter's rms.
    water: Vec<(String, Vec<f64>)>,
    /// Of axis 1, over time.
    traces: Vec<(&'static str, Trace)>,
}

impl Online {
    pub fn compare(&mut self, cycles: &Run, water: &Run) -> Result<()> {
        let axis = &cycles.axis;
        let total = axis.rs + axis.r_cable;
        let plain = |gain| only_ke(KeLyapunov { gain });
        let normalized = |gain| only_ke(Normalized { law: KeLyapunov { gain }, speed: 100.0 });
        let zone = only_ke(DeadZone { law: normalized(1e-5).ke, speed: 20.0 });
        let lq = solve_extended(&cycles.spans)?.parameters.lq;
        let traces = [
            mras(cycles, (axis.rs, axis.ls), 0.0, plain(1e-5))?,
            mras(cycles, (total, axis.ls), 2.0, plain(1e-5))?,
            mras(cycles, (total, axis.ls), 2.0, normalized(2e-5))?,
            mras(cycles, (total, axis.ls), 2.0, zone)?,
            mras(cycles, (total, lq), 2.0, zone)?,
            joint_filter(cycles)?,
        ];
        let name = format!("axis {}", axis.number);
        self.rows.push((name.clone(), traces.iter().map(|trace| rms_of_second_half(trace)).collect()));
        let before = equations(&water.spans)?.solve()?.parameters.ke;
        let after = solve_extended(&water.spans)?.parameters.ke;
        let filter = rms_of_second_half(&joint_filter(water)?);
        self.water.push((name, vec![percent(before, axis.ke), percent(after, axis.ke), filter]));
        if axis.number == 1 {
            let [before, _, _, after, _, filter] = traces;
            self.traces = vec![(STEPS[0], before), (STEPS[3], after), (STEPS[5], filter)];
        }
        Ok(())
    }

    pub fn report(self, report: &mut Report) {
        let mean = |step: usize| self.rows.iter().map(|(_, cells)| cells[step]).sum::<f64>() / self.rows.len() as f64;
        let [told, normalized, zone] = [1, 2, 3].map(mean);
        report.claim(
            "Each step improves the adaptive observer",
            "rms error of Ke, mean of six axes: 0.25, 0.166 and 0.136 %, each within 0.005 %",
            format!("{:.2} % before; {told:.3}, {normalized:.3} and {zone:.3} %", mean(0)),
            (told - 0.25).abs() < 0.005 && (normalized - 0.166).abs() < 0.005 && (zone - 0.136).abs() < 0.005,
        );
        let filter = self.rows.iter().map(|(_, cells)| cells[5]).fold(0.0, f64::max);
        let water = self.water.iter().map(|(_, cells)| cells[2]).fold(0.0, f64::max);
        report.claim(
            "The joint Kalman filter needs none of them",
            "rms error of Ke below 0.1 % in the speed cycles and 0.6 % in water cutting, on all axes",
            format!("up to {filter:.3} % and {water:.3} %"),
            filter < 0.1 && water < 0.6,
        );
        let by_axis = |rows: &[(String, Vec<f64>)], k: usize| -> Trace {
            rows.iter().enumerate().map(|(axis, (_, cells))| (axis as f64 + 1.0, cells[k])).collect()
        };
        let series = [0, 1, 3, 4, 5].map(|k| dots(STEPS[k], by_axis(&self.rows, k)));
        report.figure(figure(
            "improved-online",
            "Speed cycles, online: rms error of Ke, step by step",
            "Dead time and resistance matter most; saliency is what is left.",
            ["axis", "rms error of Ke (%)"],
            vec![(String::new(), series.into())],
            true,
        ));
        let labels = ["least squares", "extended least squares", "joint Kalman filter (rms)"];
        let mut series: Vec<_> = (0..3).map(|k| dots(labels[k], by_axis(&self.water, k))).collect();
        series.push(level("reference", 0.0, (1.0, 6.0)));
        report.figure(figure(
            "improved-water",
            "Water cutting: error of Ke before and after",
            "Always slow: least squares takes dead time for EMF; what estimates the dead time does not.",
            ["axis", "error of Ke (%)"],
            vec![(String::new(), series)],
            false,
        ));
        let panel = |(label, trace): (&str, Trace)| {
            let ends = (0.0, trace.last().map_or(1.0, |(t, _)| *t));
            (label.to_owned(), vec![curve("estimate", thin(trace)), level("reference", 0.0, ends)])
        };
        let panels = self.traces.into_iter().map(panel).collect();
        report.figure(figure(
            "improved-traces",
            "Axis 1, online: error of Ke over the speed cycles",
            "Before: each cycle pulls the estimate up and down by percents. After: it stays.",
            ["time (s)", "error of Ke (%)"],
            panels,
            false,
        ));
        let columns = ["MRAS", "+R +Vdt", "normalized", "dead zone", "found Lq", "joint EKF"];
        report.table("Speed cycles, online: rms error of Ke (%)", &columns, self.rows);
        report.table("Water cutting: error of Ke (%)", &["Ke LS", "Ke extended", "EKF rms"], self.water);
    }
}

fn figure(
    name: &str,
    title: &str,
    caption: &str,
    [x, y]: [&'static str; 2],
    panels: Vec<(String, Vec<crate::figure::Series>)>,
    logarithmic: bool,
) -> Figure {
    let panels = panels.into_iter().map(|(title, series)| Panel { title, series }).collect();
    let (name, title, caption) = (name.to_owned(), title.to_owned(), caption.to_owned());
    Figure { name, title, caption, x, y, panels, logarithmic }
}

/// Error of Ke (%) over time of the filter on (id, iq, R, Ke, Vdt).
fn joint_filter(run: &Run) -> Result<Trace> {
    let (axis, ts) = (&run.axis, run.spans.ts);
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
    let step = ExactStep::new(axis.pole_pairs.into(), ts, HeldIn::Stationary)?;
    let mut filter = Ekf::<_, 5>::new(InverterFed::<_, InverterFedWinding>::new(ExactSurface(step)), ts, start)?;
    let trace = run.spans.spans.iter().enumerate().map(|(k, span)| {
        filter.update(k as f64 * ts, &span.angled(), &span.i0);
        (k as f64 * ts, percent(filter.parameters().ke, axis.ke))
    });
    Ok(trace.collect())
}
