//! Experiment 5: lower acceleration.

use crate::figure::{Figure, Panel, curve, level};
use crate::methods::*;
use crate::report::Report;
use crate::speeds::CYCLE_SPEED;
use greybox::pmsm::Winding;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::offline::Axes;
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;

pub fn acceleration() -> Result<Report> {
    let mut report = Report::new("Experiment 5: the same with 0.35 of the acceleration");
    let (mut better, mut cells, mut panels) = (0, 0, Vec::new());
    for number in [1, 2, 6] {
        let axis = RobotAxis::reference(number)?;
        let fast = per_cycle(&run(Simulation::new(axis)?, Program::speed_cycles(&axis, 20, 1.0)?), Axes::Both)?;
        let slow = per_cycle(&run(Simulation::new(axis)?, Program::speed_cycles(&axis, 20, 0.35)?), Axes::Both)?;
        let errors = |e: &Winding| [e.rs / axis.rs, percent(e.ls, axis.ls), percent(e.ke, axis.ke)];
        let mut rows = Vec::new();
        for ((speed, fast), (_, slow)) in fast.iter().zip(&slow) {
            let (fast, slow) = (errors(&fast.parameters), errors(&slow.parameters));
            rows.push((format!("{speed:.0} rad/s"), fast.iter().zip(slow).flat_map(|(a, b)| [*a, b]).collect()));
            cells += 2;
            better += usize::from(slow[0] < fast[0]) + usize::from(slow[1].abs() < fast[1].abs());
        }
        let columns = ["R ratio", "slow", "L err %", "slow", "Ke err %", "slow"];
        let title = format!("Axis {number}: full and low acceleration");
        report.table(title, &columns, rows.into_iter().step_by(3).collect());
        for (quantity, which, truth) in [("R / motor's R", 0, 1.0), ("error of L (%)", 1, 0.0)] {
            let of = |found: &[(f64, greybox::regress::LinearEstimate<Winding>)]| {
                found.iter().map(|(w, e)| (*w, errors(&e.parameters)[which])).collect()
            };
            panels.push(Panel {
                title: format!("axis {number}: {quantity}"),
                series: vec![
                    curve("full acceleration", of(&fast)),
                    curve("0.35 of it", of(&slow)),
                    level("reference", truth, (15.0, axis.w_max)),
                ],
            });
        }
    }
    let found = format!("R or L is nearer to its reference in {better} of {cells} cases");
    let statement = "Lower acceleration does not improve R or L";
    report.claim(statement, "nearer in less than a third of the cases", found, better * 3 < cells);
    // R in the upper row, L in the lower.
    let (upper, lower): (Vec<_>, Vec<_>) = panels.into_iter().enumerate().partition(|(k, _)| k % 2 == 0);
    report.figure(Figure {
        name: "exp5-acceleration".to_owned(),
        title: "Resistance and inductance against speed, full and low acceleration".to_owned(),
        caption: "Less acceleration is less current: R and L are further from their references.".to_owned(),
        x: CYCLE_SPEED,
        y: "",
        panels: upper.into_iter().chain(lower).map(|(_, panel)| panel).collect(),
        logarithmic: false,
    });
    Ok(report)
}
