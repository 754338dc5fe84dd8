//! Experiment 3 on axis 1: which equations, which weights, which observer.

use crate::figure::{Figure, Panel, Series, curve, level, thin};
use crate::methods::*;
use crate::report::Report;
use crate::speeds::{Found, by_speed};
use greybox::online::Rate;
use greybox::pmsm::{Adaptation, AdaptationInput, DeadZone, KeLyapunov, SQRT_2_3, Winding};
use greybox::regress::LinearEstimate;

/// `Ke' = -g sqrt(2/3) sign(w) e_q/ls`, sign +1 at 0 (5.1.2): as fast at low speed as at high. It drifts at standstill.
#[derive(Clone, Copy, Debug)]
struct KeConstantGain {
    /// `g`, above zero.
    gain: f64,
}

impl Adaptation for KeConstantGain {
    fn rate(&self, seen: &AdaptationInput) -> Rate {
        let sign = if seen.w < 0.0 { -1.0 } else { 1.0 };
        Rate::Adapt(-self.gain * SQRT_2_3 * sign / seen.ls * seen.e.iq)
    }
}

pub fn first_axis(report: &mut Report, run: &Run, q: &Found, both: &Found) -> Result<()> {
    let axis = &run.axis;
    let rows = q.iter().zip(both).step_by(3).map(|((speed, q), (_, both))| {
        let l = |e: &LinearEstimate<Winding>| percent(e.parameters.ls, axis.ls);
        (format!("{speed:.0} rad/s"), vec![l(q), q.index.ls, l(both), both.index.ls])
    });
    report.table(
        "Axis 1: inductance from q only and from both equations",
        &["q: L err %", "index %", "both: L err %", "index %"],
        rows.collect(),
    );
    let mean = |all: &Found| {
        let fast = all.iter().filter(|(speed, _)| *speed > 100.0).map(|(_, e)| e.index.ls);
        fast.clone().sum::<f64>() / fast.count() as f64
    };
    let (q_index, both_index) = (mean(q), mean(both));
    let found = format!("above 100 rad/s the index of L is {q_index:.0} % from q alone, {both_index:.0} % from both");
    report.claim(
        "Both voltage equations are needed",
        "index of L at least three times lower",
        found,
        q_index > 3.0 * both_index,
    );

    let pooled = equations(&run.spans)?;
    let weighted = pooled.clone().weighted(|k| by_speed(&run.spans, k));
    let (even, fast) =
        (percent(pooled.solve()?.parameters.ke, axis.ke), percent(weighted.solve()?.parameters.ke, axis.ke));
    let found = format!("whole record: Ke {even:+.2} % even, {fast:+.2} % weighted by w^2");
    report.claim(
        "Weighting by speed improves Ke",
        "error at least a third smaller",
        found,
        fast.abs() < 0.67 * even.abs(),
    );
    observers(report, run)
}

fn observers(report: &mut Report, run: &Run) -> Result<()> {
    let nominal = (run.axis.rs, run.axis.ls);
    let lyapunov = |gain| mras(run, nominal, 0.0, only_ke(KeLyapunov { gain }));
    let constant = |gain| mras(run, nominal, 0.0, only_ke(DeadZone { law: KeConstantGain { gain }, speed: 1.0 }));
    let traces = [
        ("gain by speed, 1e-4", lyapunov(1e-4)?),
        ("gain by speed, 1e-5", lyapunov(1e-5)?),
        ("gain by speed, 1e-6", lyapunov(1e-6)?),
        ("constant gain, 1e-3", constant(1e-3)?),
        ("constant gain, 1e-4", constant(1e-4)?),
    ];
    let rows = traces.iter().map(|(name, trace)| {
        let worst = trace[trace.len() / 2..].iter().map(|(_, e)| e.abs()).fold(0.0, f64::max);
        (name.to_string(), vec![rms_of_second_half(trace), worst])
    });
    report.table("Axis 1, MRAS: error of Ke over the second half (%)", &["rms", "largest"], rows.collect());
    let rms: Vec<f64> = traces.iter().map(|(_, trace)| rms_of_second_half(trace)).collect();
    let found = format!(
        "rms {:.2} % (gain by speed, 1e-5), {:.2} % (constant gain, 1e-3); a tenth of each: {:.2} % and {:.2} %",
        rms[1], rms[3], rms[2], rms[4]
    );
    report.claim(
        "The gain that grows with speed is preferable to the constant one",
        "rms error at least a quarter smaller",
        found,
        rms[1] < 0.75 * rms[3],
    );
    let id = run.spans.spans.iter().map(|span| span.i0.id.powi(2)).sum::<f64>() / run.spans.spans.len() as f64;
    let found = format!("id is {:.3} A rms, of {} A: law (5.4) has no signal", id.sqrt(), run.axis.i_max);
    report.claim(
        "With id = 0 the resistance cannot be estimated online",
        "id below 1 % of the largest current",
        found,
        id.sqrt() < 0.01 * run.axis.i_max,
    );
    let panel = |(name, trace): (&str, Vec<(f64, f64)>)| {
        let ends = (0.0, trace.last().map_or(1.0, |(t, _)| *t));
        let clipped = trace.into_iter().map(|(t, e)| (t, e.clamp(-10.0, 20.0))).collect();
        let series: Vec<Series> = vec![curve("estimate", thin(clipped)), level("reference", 0.0, ends)];
        Panel { title: name.to_owned(), series }
    };
    report.figure(Figure {
        name: "exp3-mras".to_owned(),
        title: "Axis 1, MRAS: gain by speed and constant gain".to_owned(),
        caption:
            "Error of Ke over the record (limited to -10 to 20 %): each slow section pulls the estimate up, the more \
                  the larger the gain; a gain that grows with speed recovers sooner."
                .to_owned(),
        x: "time (s)",
        y: "error of Ke (%)",
        panels: traces.into_iter().map(panel).collect(),
        logarithmic: false,
    });
    Ok(())
}
