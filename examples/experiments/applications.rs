//! Experiment 6: material handling and water cutting.

use crate::figure::{Figure, Panel, curve, dots, level, thin};
use crate::methods::*;
use crate::report::Report;
use crate::speeds::by_speed;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::offline::{Form, Validation};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{KeLyapunov, Winding};

/// Errors of Ke (%) by axis: least squares, weighted by w^2, nonlinear grey box, extended least squares.
#[derive(Default)]
struct Errors {
    rows: Vec<(String, Vec<f64>)>,
    ke: [Vec<(f64, f64)>; 4],
}

pub fn applications() -> Result<Report> {
    let mut report = Report::new("Experiment 6: material handling and water cutting, six axes, cold");
    let (mut material, mut water) = (Errors::default(), Errors::default());
    let (mut tracks, mut traces) = (Vec::new(), Vec::new());
    for number in 1..=6 {
        let axis = RobotAxis::reference(number)?;
        let simulation = Simulation::new(axis)?;
        for (title, errors) in [("material handling", &mut material), ("water cutting", &mut water)] {
            let program = |n| match title {
                "water cutting" => Program::water_cutting(&axis, n),
                _ => Program::material_handling(&axis, n),
            };
            let offline = run(simulation, program(4)?);
            let trace =
                mras(&run(simulation, program(10)?), (axis.rs, axis.ls), 0.0, only_ke(KeLyapunov { gain: 1e-5 }))?;
            compare(errors, &offline, &trace)?;
            if number == 1 {
                tracks.push(track(title, &offline));
                traces.push(observed(title, trace));
            }
            if number == 1 && title == "water cutting" {
                validation(&mut report, &offline);
            }
        }
    }
    let columns =
        ["LS R ratio", "LS L err %", "LS Ke err %", "w^2 Ke err %", "grey Ke err %", "ext. Ke err %", "MRAS rms %"];
    let worst = |errors: &Errors, method: usize| errors.ke[method].iter().map(|(_, e)| e.abs()).fold(0.0, f64::max);
    let found = format!("within {:.2} %", worst(&material, 0));
    let statement = "One fast section in the cycle is enough for Ke (material handling)";
    report.claim(statement, "least squares within 1 % on all axes", found, worst(&material, 0) < 1.0);
    let (plain, weighted) = (worst(&water, 0), worst(&water, 1));
    report.claim(
        "In water cutting, always slow, Ke is overestimated; weighting helps",
        "least squares more than 2 % off on some axis; weighted by w^2 at least a third less",
        format!("up to {plain:.2} % off; weighted by w^2 {weighted:.2} %"),
        plain > 2.0 && weighted < 0.67 * plain,
    );
    report.figure(in_time(
        "exp6-tracks",
        "Axis 1: one repeat of each program",
        "One fast transfer between slow approaches; slow contours and short moves.",
        "speed (rad/s)",
        tracks,
    ));
    report.figure(in_time("exp6-mras", "Axis 1, MRAS (gain by speed, 1e-5)", "Material handling has a fast section in each cycle, and Ke is found; water cutting is always slow, and dead time is taken for EMF.", "error of Ke (%)", traces));
    let panels =
        [("material handling", &material), ("water cutting", &water)].map(|(title, errors)| by_axis(title, errors));
    report.figure(Figure {
        name: "exp6-ke".to_owned(),
        title: "Error of Ke by axis and method, both programs".to_owned(),
        caption:
            "Dead time is taken for EMF where the speeds are low; weighting by w^2 helps, estimating it removes it."
                .to_owned(),
        x: "axis",
        y: "error of Ke (%)",
        panels: panels.into(),
        logarithmic: false,
    });
    report.table("Material handling", &columns, material.rows);
    report.table("Water cutting", &columns, water.rows);
    Ok(report)
}

fn compare(errors: &mut Errors, run: &Run, trace: &[(f64, f64)]) -> Result<()> {
    let axis = &run.axis;
    let even = equations(&run.spans)?;
    let fast = even.clone().weighted(|k| by_speed(&run.spans, k)).solve()?.parameters;
    let even = even.solve()?.parameters;
    let found = [even.ke, fast.ke, grey_box(&run.spans, axis)?.ke, solve_extended(&run.spans)?.parameters.ke];
    let ke = found.map(|ke| percent(ke, axis.ke));
    errors.ke.iter_mut().zip(ke).for_each(|(points, e)| points.push((f64::from(axis.number), e)));
    let cells = [even.rs / axis.rs, percent(even.ls, axis.ls)].into_iter().chain(ke).chain([rms_of_second_half(trace)]);
    errors.rows.push((format!("axis {}", axis.number), cells.collect()));
    Ok(())
}

fn by_axis(title: &str, errors: &Errors) -> Panel {
    let labels = ["least squares", "weighted by w^2", "nonlinear grey box", "extended least squares"];
    let mut series: Vec<_> = labels.into_iter().zip(&errors.ke).map(|(label, ke)| dots(label, ke.clone())).collect();
    series.push(level("reference", 0.0, (1.0, 6.0)));
    Panel { title: title.to_owned(), series }
}

fn in_time(name: &str, title: &str, caption: &str, y: &'static str, panels: Vec<Panel>) -> Figure {
    let (name, title, caption) = (name.to_owned(), title.to_owned(), caption.to_owned());
    Figure { name, title, caption, x: "time (s)", y, panels, logarithmic: false }
}

fn track(title: &str, run: &Run) -> Panel {
    let first = run.cycles.first().map_or(0, |cycle| cycle.samples.end);
    let speed = run.spans.spans.iter().take(first).enumerate().map(|(k, span)| (k as f64 * run.spans.ts, span.w));
    Panel { title: title.to_owned(), series: vec![curve("speed", thin(speed.collect()))] }
}

fn observed(title: &str, trace: Vec<(f64, f64)>) -> Panel {
    let ends = (0.0, trace.last().map_or(1.0, |(t, _)| *t));
    let series = vec![curve("estimate", thin(trace)), level("reference", 0.0, ends)];
    Panel { title: title.to_owned(), series }
}

/// Voltages that the nominal motor needs for the measured currents, beside the commanded ones (thesis 7.1).
fn validation(report: &mut Report, run: &Run) {
    let axis = &run.axis;
    let nominal = Winding { rs: axis.rs + axis.r_cable, ls: axis.ls, ke: axis.ke };
    let pairs = run.spans.voltages(&nominal, Form::Sinc);
    let relative = |slow: bool| {
        let chosen = pairs.iter().filter(|(u, _)| (u[1].abs() < 10.0) == slow && u[1].abs() > 1.0);
        let (error, size) =
            chosen.fold((0.0, 0.0), |(e, s), (u, u_hat)| (e + (u[1] - u_hat[1]).powi(2), s + u[1] * u[1]));
        100.0 * (error / size).sqrt()
    };
    let (slow, fast) = (relative(true), relative(false));
    let all = Validation::of(pairs.iter().copied());
    let found = format!("error of uq: {slow:.0} % below 10 V, {fast:.0} % above; fit of uq {:.1} %", all.fit[1]);
    let statement = "The model does not describe the data well at low voltage";
    report.claim(statement, "relative error below 10 V more than three times that above", found, slow > 3.0 * fast);
    let trace = |of: fn(&([f64; 2], [f64; 2])) -> f64| {
        let second = pairs.iter().enumerate().skip(8000).take(12_000);
        thin(second.map(|(k, pair)| (k as f64 * run.spans.ts, of(pair))).collect())
    };
    let series = vec![curve("predicted", trace(|p| p.1[1])), curve("commanded", trace(|p| p.0[1]))];
    let panel = Panel { title: String::new(), series };
    let caption =
        "At low voltage dead time is missing in the prediction: the commanded voltage is larger by some volts.";
    report.figure(in_time(
        "exp6-validation",
        "Axis 1, water cutting: voltage that the model needs",
        caption,
        "uq (V)",
        vec![panel],
    ));
}
