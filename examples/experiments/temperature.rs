//! Experiment 4: cold and warm, and both temperatures read back.

use crate::figure::{Figure, Panel, curve, dots, level};
use crate::methods::*;
use crate::report::Report;
use crate::speeds::CYCLE_SPEED;
use greybox::pmsm::Winding;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::offline::{Axes, Equations, Extended, ExtendedWithI0};
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::temperature::{Celsius, Estimated};
use greybox::regress::LinearEstimate;

/// Ke of a whole record.
fn ke(run: &Run) -> Result<Estimated> {
    let found = solve_extended(&run.spans)?;
    Ok(Estimated { value: found.parameters.ke, std: found.standard_errors.ke })
}

/// The extended equations of a whole record with the current at which the dead time turns over among the unknowns, for a motor
/// of about the data sheet's Ke and inductance.
fn extended_with_i0(run: &Run) -> Result<Equations<ExtendedWithI0>> {
    let (spans, filter) = (run.spans.clone().bent(run.axis.ke, run.axis.ls)?, low_pass(run.spans.ts)?);
    let extended = |i0| spans.extended(i0).prefiltered(&filter);
    let i0 = Extended::search_i0(0.03, 1.0, |i0| extended(i0).least_squares())?;
    let vdt = extended(i0).solve()?.parameters.vdt;
    Ok(spans.extended_with_i0(i0, vdt).prefiltered(&filter))
}

/// Rise of the winding between two records of the same motion.
fn winding_rise(cold: &Run, warm: &Run) -> Result<Estimated> {
    let change = extended_with_i0(cold)?.change(&extended_with_i0(warm)?)?;
    let change = Estimated { value: change.parameters.r, std: change.standard_errors.r };
    // The equations' resistance is within 0.2 %.
    let r20 = Estimated { value: cold.axis.rs, std: 0.002 / 3f64.sqrt() * cold.axis.rs };
    Ok(Estimated::winding_rise_by(change, r20)?)
}

pub fn temperature() -> Result<Report> {
    let mut report = Report::new("Experiment 4: the same, warm (55 °C), six axes");
    let warm_at = Celsius::new(55.0)?;
    let (mut rows, mut ke_panels, mut r_panels) = (Vec::new(), Vec::new(), Vec::new());
    let (mut winding_read, mut magnet_read) = (Vec::new(), Vec::new());
    let (mut ratio_off, mut l_off) = (0f64, 0f64);
    for number in 1..=6 {
        let axis = RobotAxis::reference(number)?;
        let program = || Program::speed_cycles(&axis, 8, 1.0);
        let cold = run(Simulation::new(axis)?, program()?);
        // Noise of its own.
        let warm = run(Simulation::new(axis)?.heated(warm_at, warm_at).seeded(10 + u64::from(number)), program()?);
        let (plain_cold, plain_warm) = (per_cycle(&cold, Axes::Both)?, per_cycle(&warm, Axes::Both)?);
        let (ke0, ke1, winding) = (ke(&cold)?, ke(&warm)?, winding_rise(&cold, &warm)?);
        let magnet = Estimated::magnet_rise(ke0, ke1, Celsius::new(20.0)?)?;
        if let (Some((_, c)), Some((_, w))) = (plain_cold.last(), plain_warm.last()) {
            let (ke, ls) = (w.parameters.ke / c.parameters.ke, w.parameters.ls / c.parameters.ls);
            rows.push((
                format!("axis {number}"),
                vec![ke, ls, ke1.value / ke0.value, winding.value, winding.std, magnet.value, magnet.std],
            ));
            (ratio_off, l_off) = (ratio_off.max((ke - 0.9615).abs()), l_off.max((ls - 1.0).abs()));
        }
        winding_read.push((f64::from(number), winding.value));
        magnet_read.push((f64::from(number), magnet.value));
        let (heated, ends) = (axis.heated(warm_at, warm_at), (15.0, axis.w_max));
        let panel = |of: fn(&Winding) -> f64, [cold_truth, warm_truth]: [f64; 2]| {
            let found =
                |found: &[(f64, LinearEstimate<Winding>)]| found.iter().map(|(w, e)| (*w, of(&e.parameters))).collect();
            let series = vec![
                curve("20 °C", found(&plain_cold)),
                curve("55 °C", found(&plain_warm)),
                level("reference at 20 °C", cold_truth, ends),
                level("reference at 55 °C", warm_truth, ends),
            ];
            Panel { title: format!("axis {number}"), series }
        };
        ke_panels.push(panel(|p| p.ke, [axis.ke, heated.ke]));
        r_panels.push(panel(|p| p.rs, [axis.rs + axis.r_cable, heated.rs + heated.r_cable]));
    }
    let columns = ["LS Ke w/c", "LS L w/c", "ext Ke w/c", "winding K", "+-", "magnet K", "+-"];
    report.table("Warm over cold; rises read back (truth: Ke 0.9615, 35 K)", &columns, rows);
    let found = format!("at the highest speed within {:.2} % of the magnet's 0.9615", 100.0 * ratio_off);
    let statement = "Ke falls with temperature as the magnet's law says";
    report.claim(statement, "ratio of warm to cold within 0.5 % on all axes", found, ratio_off < 0.005);
    let found = format!("moves by {:.2} % at most", 100.0 * l_off);
    report.claim("L is not affected by temperature", "moves by less than 1 % on all axes", found, l_off < 0.01);
    let read_off = winding_read.iter().chain(&magnet_read).map(|(_, rise)| (rise - 35.0).abs()).fold(0.0, f64::max);
    let found = format!("both temperatures within {read_off:.1} K, by the extended equations");
    let statement = "The temperatures can be read back from the estimates";
    report.claim(statement, "winding and magnet within 2 K on all axes", found, read_off < 2.0);

    for (name, title, caption, y, panels) in [
        (
            "exp4-ke",
            "Back-EMF against speed, cold and warm",
            "35 K take 3.85 % from Ke, at every speed: the two curves are as far apart as the two references.",
            "Ke (V s/rad)",
            ke_panels,
        ),
        (
            "exp4-rs",
            "Resistance against speed, cold and warm (references: motor and cable)",
            "35 K add 13.8 % to the motor's resistance; least squares shows the difference on top of the dead time.",
            "R (ohm)",
            r_panels,
        ),
        (
            "exp4-rises",
            "Temperature rises read back, extended least squares",
            "Each axis was warmed by 35 K. The winding's rise is read from R, the magnet's from Ke.",
            "rise (K)",
            vec![Panel {
                title: String::new(),
                series: vec![
                    dots("winding", winding_read),
                    dots("magnet", magnet_read),
                    level("reference", 35.0, (1.0, 6.0)),
                ],
            }],
        ),
    ] {
        let x = if name == "exp4-rises" { "axis" } else { CYCLE_SPEED };
        let (name, title, caption) = (name.to_owned(), title.to_owned(), caption.to_owned());
        report.figure(Figure { name, title, caption, x, y, panels, logarithmic: false });
    }
    Ok(report)
}
