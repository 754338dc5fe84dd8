//! The models that ship, and a direct-current motor: their slopes, their balance of power, and the records that they were made for.

use crate::dc_motor::{Armature, DcMotor, Feed, Rotation};
use crate::shared::shared;
use approx::assert_relative_eq;
use greybox::models::*;
use greybox::pmsm::{Drive, ExactStep, ExactSurface, HeldIn, Surface, Winding};
use greybox::*;
use proptest::prelude::*;

const AXIS: AxisParameters = AxisParameters { m: 95.0, fv: 203.0, fc: 20.0, offset: -3.2 };

proptest! {
    #[test]
    fn slopes_are_those_of_the_values(i in -5.0..5.0, w in -300.0..300.0, u in -24.0..24.0, tau_l in -0.1..0.1) {
        let p = Armature { r: 1.1, l: 1.2e-3, k: 0.05, j: 1e-4, b: 2e-5 };
        prop_assert_eq!(check::derivatives(&DcMotor, 0.0, &Rotation { i, w }, &Feed { u, tau_l }, &p), Ok(()));
    }

    #[test]
    fn slopes_of_the_axis(q in -0.2..0.2, v in -0.3..0.3, moved in -4e-5..4e-5, vir in -5.0..5.0, e in -1e-4..1e-4) {
        let open = check::derivatives(&Positioning::EMPS, 0.0, &AxisMotion { q, v }, &Command { vir }, &AXIS);
        prop_assert_eq!(open, Ok(()));
        let x = ControlledAxisMotion { q, v, moved, before: 0.3 * moved, held: vir };
        prop_assert_eq!(check::derivatives(&PositioningLoop::EMPS, 0.0, &x, &Reference { qg: q + e }, &AXIS), Ok(()));
    }

    // Where friction turns over within 5e-4 m/s, steps of 6e-6 are too long for central differences.
    #[test]
    fn slopes_of_the_axis_about_standstill(v in -1e-3..1e-3, vir in -5.0..5.0) {
        for v in [v, 0.0] {
            let slopes = check::derivatives(&Positioning::EMPS, 0.0, &AxisMotion { q: 0.1, v }, &Command { vir }, &AXIS);
            prop_assert_eq!(slopes, Ok(()));
        }
    }

    // Electrical power = copper loss + change of the field's energy + mechanical power; what friction and load leave of
    // that accelerates the rotor. A dozen roundings: 1e-12 of the largest term.
    #[test]
    fn power_of_the_dc_motor_balances(i in -5.0..5.0, w in -300.0..300.0, u in -24.0..24.0, tau_l in -0.1..0.1) {
        let p = Armature { r: 1.1, l: 1.2e-3, k: 0.05, j: 1e-4, b: 2e-5 };
        let dx = DcMotor.derivative(0.0, &Rotation { i, w }, &Feed { u, tau_l }, &p);
        let terms = [u * i, -p.r * i * i, -p.l * i * dx.i, -p.j * w * dx.w, -p.b * w * w, -tau_l * w];
        let size: f64 = terms.iter().map(|term| term.abs()).sum();
        prop_assert!(terms.iter().sum::<f64>().abs() <= 1e-12 * size);
    }

    // A controller commands the axis as its own law says, never beyond its limit, and the axis has that until the next sample.
    #[test]
    fn the_loop_is_the_axis_under_its_command(q in -0.2..0.2, v in -0.3..0.3, qg in -0.2..0.2, moved in -3e-4..3e-4) {
        let (closed, u) = (PositioningLoop::EMPS, Reference { qg });
        let x = ControlledAxisMotion { q, v, moved, before: 0.5 * moved, held: 7.0 };
        let vir = closed.output(0.0, &x, &u, &AXIS).vir;
        let law = closed.kv * (closed.kp * (qg - q) - 1.5 * moved / 2e-3);
        prop_assert!((vir - law.clamp(-10.0, 10.0)).abs() <= 1e-12);
        let after = closed.jump(0.0, &x, &u, &AXIS);
        prop_assert_eq!(after, ControlledAxisMotion { q, v, moved: 0.0, before: moved, held: vir });
        let (dx, open) = (
            closed.derivative(0.0, &after, &u, &AXIS),
            closed.axis.derivative(0.0, &AxisMotion { q, v }, &Command { vir }, &AXIS),
        );
        prop_assert_eq!((dx.q, dx.v, dx.moved, dx.before, dx.held), (open.q, open.v, v, 0.0, 0.0));
    }
}

/// All five parameters of a DC motor come back from a noise-free record, to the tolerance of the search (step 1e-10).
#[test]
fn a_dc_motor_is_recovered() {
    let truth = Armature { r: 1.1, l: 1.2e-3, k: 0.05, j: 1e-4, b: 2e-5 };
    let time = Time::Uniform { start: 0.0, step: 2e-4 };
    let inputs: Vec<_> = (0..2000)
        .map(|k| Feed {
            u: if k / 250 % 2 == 0 { 12.0 } else { -6.0 },
            tau_l: if k / 400 % 2 == 0 { 0.0 } else { 0.05 },
        })
        .collect();
    let run = simulate(&DcMotor, &truth, &Rotation::splat(0.0), time, &inputs).unwrap();
    let record = run.experiment(&DcMotor).unwrap().initial(Rotation::splat(fixed(0.0)));
    let far = Armature { r: free(2.0), l: free(3e-3), k: free(0.1), j: free(3e-4), b: free(1e-5) };
    let estimate = Fit::new(&DcMotor, &record).parameters(far).noise(Rotation { i: 0.01, w: 1.0 }).run().unwrap();
    assert_relative_eq!(estimate.parameters, truth, max_relative = 1e-6);
}

/// The published estimates (Janot, Gautier, Brunot 2019) were made from accelerations; M is to agree to 1 %, friction to
/// 5 %, the offset to 3 %.
#[test]
fn the_emps_record_is_fitted_in_closed_loop() {
    let Some(path) = shared("emps/emps.csv") else { return };
    let model = PositioningLoop::EMPS;
    let record = Experiment::from_file(&model, path).unwrap();
    let start = AxisParameters { m: free(80.0), fv: free(150.0), fc: free(15.0), offset: free(0.0) };
    let estimate = Fit::new(&model, &record).parameters(start).run().unwrap();
    let p = estimate.parameters;
    assert!(estimate.outcome.converged());
    assert_relative_eq!(p.m, 95.1089, max_relative = 0.01);
    assert_relative_eq!(p.fv, 203.5034, max_relative = 0.05);
    assert_relative_eq!(p.fc, 20.3935, max_relative = 0.05);
    assert_relative_eq!(p.offset, -3.1648, max_relative = 0.03);
    let simulated = estimate.predict(&model, &record).unwrap();
    let wrong: f64 = simulated.residuals.iter().map(|e| e.vir * e.vir).sum();
    let whole: f64 = record.outputs().map(|y| y.vir * y.vir).sum();
    assert!((wrong / whole).sqrt() < 0.0435, "relative force error {}", (wrong / whole).sqrt());
}

/// Logs of another simulator, noise-free; what is left is its inverter (averaged, switching) and speed within an interval.
#[test]
fn an_independent_drive_is_fitted() {
    for (file, rs, ke) in [("motulator/spm_avg.csv", 1e-3, 5e-4), ("motulator/spm_pwm.csv", 1e-2, 2e-3)] {
        let Some(path) = shared(file) else { return };
        let log = DataFile::new(path).column("w", "omega_m").read(&Surface::new(3).unwrap()).unwrap();
        let model = ExactSurface(ExactStep::new(3, log.sample_time(), HeldIn::Stationary).unwrap());
        let next = log.inputs().skip(1).chain(log.inputs().last());
        let inputs = log.inputs().zip(next).map(|(u, next)| Drive { w: (u.w + next.w) / 2.0, ..u }).collect();
        let record = Experiment::new(&model, log.times().clone(), inputs, log.outputs().collect()).unwrap();
        let start = Winding { rs: free(1.0).log(), ls: free(1e-2).log(), ke: free(1.0).log() };
        let p = Fit::new(&model, &record).parameters(start).run().unwrap().parameters;
        assert_relative_eq!(p.rs, 3.6, max_relative = rs);
        assert_relative_eq!(p.ls, 0.042, max_relative = rs);
        assert_relative_eq!(p.ke, 1.5f64.sqrt() * 3.0 * 0.545, max_relative = ke);
    }
}

/// The record that the examples ship is the one that `first_fit --save` makes: four standard errors hold the truth.
#[test]
fn the_shipped_record_holds_its_truth() {
    let model = Surface::new(4).unwrap();
    let record = Experiment::from_file(&model, concat!(env!("CARGO_MANIFEST_DIR"), "/examples/data/pmsm.csv")).unwrap();
    let start = Winding { rs: free(1.0).within(0.01, 10.0), ls: free(2e-3), ke: free(0.7) };
    let estimate = Fit::new(&model, &record).parameters(start).run().unwrap();
    for (unknown, truth) in estimate.unknowns.iter().zip([0.63, 4e-3, 0.95]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error, "{}: {}", unknown.name, unknown.value);
    }
}
