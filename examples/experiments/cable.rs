//! Experiment 3 with cables of other lengths.

use crate::figure::{Figure, Panel, curve, reference};
use crate::methods::*;
use crate::report::Report;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;

/// Resistance of axis 2 against the length of its cable.
pub fn cable(report: &mut Report) -> Result<()> {
    let axis = RobotAxis::reference(2)?;
    let (mut plain, mut extended, mut truth) = (Vec::new(), Vec::new(), Vec::new());
    for length in [0.0, 7.0, 20.0, 50.0] {
        let with_cable = RobotAxis { r_cable: axis.r_cable * length / 20.0, ..axis };
        let run = run(Simulation::new(with_cable)?, Program::speed_cycles(&with_cable, 4, 1.0)?);
        plain.push((length, equations(&run.spans)?.solve()?.parameters.rs));
        extended.push((length, solve_extended(&run.spans)?.parameters.r));
        truth.push((length, with_cable.rs + with_cable.r_cable));
    }
    let off = extended.iter().zip(&truth).map(|(a, b)| percent(a.1, b.1).abs()).fold(0.0, f64::max);
    report.claim(
        "The cable's resistance is a part of what is estimated, in proportion to its length",
        "extended least squares within 1 % of motor and cable at 0, 7, 20 and 50 m",
        format!("within {off:.2} %"),
        off < 1.0,
    );
    report.figure(Figure {
        name: "exp3-cable".to_owned(),
        title: "Axis 2: resistance against the length of the cable".to_owned(),
        caption: "The estimate grows with the cable; dead time adds the rest, unless it is estimated too.".to_owned(),
        x: "length of the cable (m)",
        y: "R (ohm)",
        panels: vec![Panel {
            title: String::new(),
            series: vec![
                curve("least squares", plain),
                curve("extended least squares", extended),
                reference("motor and cable", truth),
            ],
        }],
        logarithmic: false,
    });
    Ok(())
}
