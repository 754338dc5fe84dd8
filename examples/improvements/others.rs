//! Injected d current, an inverter that switches, outliers: axis 1, four cycles.

use crate::methods::*;
use crate::report::Report;
use greybox::hampel;
use greybox::pmsm::Injection;
use greybox::pmsm::drive::{Log, Simulation};
use greybox::pmsm::inverter::Carrier;
use greybox::pmsm::offline::Spans;
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;

fn axis_1() -> Result<(RobotAxis, Simulation, Program)> {
    let axis = RobotAxis::reference(1)?;
    Ok((axis, Simulation::new(axis)?, Program::speed_cycles(&axis, 4, 1.0)?))
}

pub fn injection(report: &mut Report) -> Result<()> {
    let (axis, simulation, program) = axis_1()?;
    let row = |simulation: Simulation| -> Result<Vec<f64>> {
        let found = solve_extended(&Spans::from_log(&simulation.run(&program), axis.pole_pairs))?;
        Ok(vec![percent(found.parameters.ld, 0.96 * axis.ls), found.index.ld, found.index.r])
    };
    let injected = simulation.injecting(Injection::new(-12.0, 0.1, 0.01, 0.5)?);
    let rows = vec![("id = 0".to_owned(), row(simulation)?), ("stairs of -12 A".to_owned(), row(injected)?)];
    report.table("Axis 1, d current injected", &["Ld err %", "index Ld %", "index R %"], rows);
    Ok(())
}

pub fn switching(report: &mut Report) -> Result<()> {
    let (axis, simulation, program) = axis_1()?;
    let row = |(name, simulation): (&str, Simulation)| -> Result<(String, Vec<f64>)> {
        let spans = Spans::from_log(&simulation.run(&program), axis.pole_pairs);
        let (before, after) = (equations(&spans)?.solve()?.parameters, solve_extended(&spans)?.parameters);
        let r = percent(after.r, axis.rs + axis.r_cable);
        Ok((name.to_owned(), vec![percent(before.ke, axis.ke), percent(after.ke, axis.ke), r, after.vdt]))
    };
    let rows = [
        ("mean voltage", simulation),
        ("switching at 7.9 kHz", simulation.switching(RobotAxis::V_DC, Carrier::PerSample)?),
        ("switching at 4.0 kHz", simulation.switching(RobotAxis::V_DC, Carrier::HalfPerSample)?),
    ];
    let rows = rows.into_iter().map(row).collect::<Result<_>>()?;
    report.table("Axis 1, inverter that switches", &["Ke LS %", "Ke ext. %", "R ext. %", "Vdt V"], rows);
    Ok(())
}

pub fn outliers(report: &mut Report) -> Result<()> {
    let (axis, simulation, program) = axis_1()?;
    let mut log = simulation.run(&program);
    let ls = |log: &Log| -> Result<Vec<f64>> {
        let p = equations(&Spans::from_log(log, axis.pole_pairs))?.solve()?.parameters;
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
    Ok(())
}
