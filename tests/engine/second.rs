//! Second derivatives along a direction, against duals of duals.

use crate::steps::{Pmsm, columns_of};
use crate::tables::Mapped;
use greybox::engine::{Column, Program, Sampling};
use greybox::graph::Seed;
use greybox::models::{Armature, DcMotor, Feed, Rotation};
use greybox::pmsm::{AngledDrive, Cabled, Currents, InverterFed, Misaligned, Salient, Saturated, SaturatedWinding};
use greybox::{
    Dual, Equations, Extrapolation, Hold, Interpolation, Interval, Model, ModelSystem, Of, Recurrence, Rk4, Signals,
    signals,
};

signals! {
    /// A salient motor behind cable and inverter, and how its record is aligned.
    pub struct Line {
        rs: "ohm", r_cable: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad",
    }
}

type Second = Dual<1, Dual<1>>;

/// A number that moves along a direction with this speed, twice over.
fn moving(value: f64, speed: f64) -> Second {
    Dual { value: Dual { value, slopes: [speed] }, slopes: [Dual { value: speed, slopes: [0.0] }] }
}

fn agrees<M: Model>(
    model: &M,
    start: Of<M::State, f64>,
    p: Of<M::Parameters, f64>,
    swing: Of<M::Input, f64>,
    step: f64,
) {
    let (nx, np, samples) = (M::State::LEN, M::Parameters::LEN, 40);
    let equations = Equations::trace(model).unwrap();
    let recurrence = Recurrence::new(&equations, &Rk4::default(), Hold::Zero).unwrap();
    let seeds: Vec<Seed> = (0..nx).map(Seed::Carry).chain((0..np).map(Seed::Parameter)).collect();
    let program = Program::compile_second(&recurrence, &seeds, Sampling::Uniform).unwrap();
    assert_eq!(program.row_length(), 3 * M::Output::LEN);
    let mut group = program.group(program.lanes());
    let lanes = group.lanes();
    let (x0, p0) = (M::State::into_array(start), M::Parameters::into_array(p));
    let values: Vec<f64> = x0.as_ref().iter().chain(p0.as_ref()).copied().collect();
    let direction = |lane: usize| -> Vec<f64> {
        values.iter().enumerate().map(|(i, v)| (0.1 + v.abs()) * (1.3 * (i + 3 * lane) as f64).cos()).collect()
    };
    for lane in 0..lanes {
        group.set_parameters(lane, p0.as_ref());
        group.set_direction(lane, &direction(lane));
        group.set_step(lane, step);
        group.start(lane, x0.as_ref());
    }
    group.prepare();
    let input = |k: usize| M::Input::map(swing, |a| a * (0.3 * k as f64 + 1.0).sin());
    let block = columns_of(&program, samples, lanes, |column, k| match column {
        Column::Input(i) => M::Input::into_array(input(k)).as_ref()[*i],
        other => panic!("{other:?}"),
    });
    let mut rows = vec![0.0; samples * program.row_length() * lanes];
    group.run(&block, &mut rows, samples);
    for lane in 0..lanes {
        let v = direction(lane);
        let mut x = M::State::from_fn(|i| moving(x0.as_ref()[i], v[i]));
        let p = M::Parameters::from_fn(|j| moving(p0.as_ref()[j], v[nx + j]));
        let mut largest = [1e-300f64; 3];
        for k in 0..samples {
            let u = M::Input::map(input(k), Second::from);
            let y = M::Output::into_array(model.output(Second::from(k as f64 * step), &x, &u, &p));
            for (j, y) in y.as_ref().iter().enumerate() {
                let expected = [y.slopes[0].value, y.slopes[0].slopes[0], y.value.value];
                for (s, expected) in expected.iter().enumerate() {
                    let found = rows[((k * M::Output::LEN + j) * 3 + s) * lanes + lane];
                    largest[s] = largest[s].max(expected.abs());
                    assert!((found - expected).abs() <= 1e-11 * largest[s], "{s}: {found} against {expected}");
                }
            }
            let u = input(k);
            let interval = Interval { t0: k as f64 * step, t1: (k + 1) as f64 * step, u0: u, u1: u, hold: Hold::Zero };
            x = ModelSystem { model, interval: &interval, p: &p }.step(&Rk4::default(), x, &mut 0.0).unwrap();
        }
        assert!(largest[1] > 1e-9, "the second derivative is not zero throughout");
    }
}

#[test]
fn second_derivatives_are_those_of_duals_of_duals() {
    let i = Currents { id: 1.0, iq: -2.0 };
    let motor = crate::steps::Currents { id: 1.0, iq: -2.0 };
    let winding = crate::steps::Winding { rs: 0.6, ls: 3.5e-3, ke: 0.9 };
    agrees(&Pmsm { pole_pairs: 4.0 }, motor, winding, crate::steps::Drive { ud: 20.0, uq: 40.0, w: 100.0 }, 1e-4);
    let saturated = SaturatedWinding {
        rs: 0.4,
        ld: 3.8e-3,
        lq: 4.2e-3,
        lq_saturated: 2e-3,
        lq_cross: -8e-6,
        i_saturation: 40.0,
        ke: 0.95,
    };
    agrees(&Saturated::new(4).unwrap(), i, saturated, greybox::pmsm::Drive { ud: 20.0, uq: 40.0, w: 100.0 }, 1e-4);
    let line =
        Line { rs: 0.4, r_cable: 0.23, ld: 3.8e-3, lq: 4.2e-3, ke: 0.95, vdt: 2.0, i0: 5.0, tau: 1e-5, delta: 0.01 };
    agrees(
        &Misaligned::<InverterFed<Cabled<Salient, Line>, Line>, Line>::new(InverterFed::new(Cabled::new(
            Salient::new(4).unwrap(),
        ))),
        i,
        line,
        AngledDrive { ud: 20.0, uq: 40.0, w: 100.0, theta: 2.0 },
        1e-4,
    );
    let armature = Armature { r: 1.0, l: 1e-3, k: 0.05, j: 1e-4, b: 1e-5 };
    agrees(&DcMotor, Rotation::from([0.5, 10.0]), armature, Feed { u: 24.0, tau_l: 0.1 }, 1e-4);
    let mapped = Mapped::new(Interpolation::Smooth, Extrapolation::Linear);
    let (flux, coil) = (crate::tables::Flux { d: 0.3, q: 0.6 }, crate::tables::Coil { r: 1.0, scale: 0.9 });
    agrees(&mapped, flux, coil, crate::tables::Volts { u: 2.0 }, 0.02);
}
