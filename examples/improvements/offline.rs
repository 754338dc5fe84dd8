//! Speed cycles, offline: every cycle of every axis by the methods of the thesis and by those that know dead time, cable,
//! saliency and the EMF's harmonic.

use crate::figure::{Figure, Panel, curve, level};
use crate::methods::*;
use crate::pooled::{compensated_grey_box, cycles, one_by_one, pooled};
use crate::report::Report;
use greybox::pmsm::offline::Axes;
use greybox::pmsm::robot::RobotAxis;

/// Errors of one method against speed (%): Ke, and R of motor and cable.
#[derive(Default)]
struct Errors {
    ke: Vec<(f64, f64)>,
    r: Vec<(f64, f64)>,
}

/// Two methods of the thesis, then three of this library.
const METHODS: [&str; 5] = [
    "least squares (thesis 5.2.1)",
    "nonlinear grey box (thesis 5.2.3)",
    "extended least squares, cycle by cycle",
    "the same, R, L and harmonic in common",
    "grey box with dead time and harmonic, R in common",
];

/// The goal (%): Ke, R.
const GOAL: (f64, f64) = (0.1, 1.0);

#[derive(Default)]
pub struct Offline {
    axes: Vec<(RobotAxis, [Errors; 5])>,
}

impl Offline {
    pub fn compare(&mut self, run: &Run) -> Result<()> {
        let axis = run.axis;
        let total = axis.rs + axis.r_cable;
        let mut all: [Errors; 5] = Default::default();
        let mut add = |method: usize, speed: f64, ke: f64, r: f64| {
            all[method].ke.push((speed, percent(ke, axis.ke)));
            all[method].r.push((speed, percent(r, total)));
        };
        for (speed, found) in per_cycle(run, Axes::Both)? {
            add(0, speed, found.parameters.ke, found.parameters.rs);
        }
        for (speed, found) in grey_box_per_cycle(run)? {
            add(1, speed, found.ke, found.rs);
        }
        let cycles = cycles(run)?;
        for (method, found) in [(2, one_by_one(&cycles)?), (3, pooled(&cycles)?)] {
            found.iter().for_each(|(speed, found)| add(method, *speed, found.ke, found.r));
        }
        let (r, found) = compensated_grey_box(&axis, &cycles)?;
        found.iter().for_each(|(speed, ke)| add(4, *speed, *ke, r));
        self.axes.push((axis, all));
        Ok(())
    }

    pub fn report(&self, report: &mut Report) {
        let columns = ["LS", "grey box", "extended", "pooled", "grey, compens."];
        type Of = fn(&Errors) -> &Vec<(f64, f64)>;
        let quantities: [(&str, Of, f64); 2] = [("Ke", |e| &e.ke, GOAL.0), ("R (motor and cable)", |e| &e.r, GOAL.1)];
        for (quantity, of, goal) in quantities {
            let worst = |errors: &Errors| of(errors).iter().map(|(_, e)| e.abs()).fold(0.0, f64::max);
            let row = |(axis, all): &(RobotAxis, [Errors; 5])| {
                (format!("axis {}", axis.number), all.iter().map(worst).collect::<Vec<f64>>())
            };
            let rows: Vec<_> = self.axes.iter().map(row).collect();
            let reached = |method: usize| rows.iter().map(|(_, cells)| cells[method]).fold(0.0, f64::max);
            let [extended, pooled, grey_box] = [2, 3, 4].map(reached);
            let (statement, threshold) = match quantity {
                "Ke" => (
                    "Ke is right at every speed of every axis",
                    "within 0.1 % in all cycles, by each of the three methods",
                ),
                _ => (
                    "R is right at every speed of every axis",
                    "within 1 % in all cycles, by each of the three methods",
                ),
            };
            let found = format!("{extended:.3}, {pooled:.3} and {grey_box:.3} %; least squares {:.1} %", reached(0));
            report.claim(statement, threshold, found, extended.max(pooled).max(grey_box) < goal);
            report.table(
                format!("Speed cycles, offline: largest error of {quantity} over all cycles (%)"),
                &columns,
                rows,
            );
        }
        self.figure(report, "improved-ke", "Error of Ke", "|error of Ke| (%)", |e| &e.ke, GOAL.0);
        self.figure(report, "improved-r", "Error of R, motor and cable", "|error of R| (%)", |e| &e.r, GOAL.1);
    }

    fn figure(
        &self,
        report: &mut Report,
        name: &str,
        title: &str,
        y: &'static str,
        of: fn(&Errors) -> &Vec<(f64, f64)>,
        goal: f64,
    ) {
        let panel = |(axis, all): &(RobotAxis, [Errors; 5])| {
            let curves = METHODS.into_iter().zip(all).map(|(label, errors)| curve(label, of(errors).clone()));
            let goal = level("goal", goal, (15.0, axis.w_max));
            Panel { title: format!("axis {}", axis.number), series: curves.chain([goal]).collect() }
        };
        report.figure(Figure {
            name: name.to_owned(),
            title: format!("{title} against speed, before and after"),
            caption:
                "Logarithmic: the two methods of the thesis are above, those that know dead time, cable, saliency and \
                      the EMF's harmonic two decades below, under the goal at every speed. A dip is an error that changes its sign."
                    .to_owned(),
            x: "largest speed of the cycle (rad/s)",
            y,
            panels: self.axes.iter().map(panel).collect(),
            logarithmic: true,
        });
    }
}
