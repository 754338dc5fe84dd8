//! Time of one update of each online observer, over a record of a swinging drive, and of the drive's own simulation: `cargo bench --bench online`.

use divan::{Bencher, counter::ItemsCount};
use greybox::online::{EkfStart, Forgetting, MrasStart, Order, Rls, Stepping, Watch};
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::inverter::Carrier;
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{
    AngledDrive, Currents, Drive, ExactStep, ExactSurface, HeldIn, InverterFed, InverterFedWinding, KeLyapunov,
    MotorLaw, RsLyapunov, SQRT_2_3, Winding,
};
use greybox::{Hold, Model, fixed, free};

const TS: f64 = 0.126e-3;
const SAMPLES: usize = 4096;

fn main() {
    divan::main();
}

fn step() -> ExactStep {
    ExactStep::new(4, TS, HeldIn::Stationary).unwrap()
}

/// Time, input and currents of a motor under a simple current controller.
fn record() -> Vec<(f64, AngledDrive, Currents)> {
    let model = InverterFed::<_, InverterFedWinding>::new(ExactSurface(step()));
    let truth = InverterFedWinding { rs: 0.63, ls: 4e-3, ke: 0.95, vdt: 2.0, i0: 0.15 };
    let (mut i, mut theta) = (Currents::default(), 0.0);
    (0..SAMPLES)
        .map(|k| {
            let t = k as f64 * TS;
            let w = 150.0 * (30.0 * t).sin();
            let u = AngledDrive {
                ud: 2.0 * (-6.0 - i.id) - 4.0 * w * 4e-3 * i.iq,
                uq: 2.0 * (15.0 * (40.0 * t).sin() - i.iq) + 4.0 * w * 4e-3 * i.id + SQRT_2_3 * 0.95 * w,
                w,
                theta: theta + w * TS / 2.0,
            };
            let row = (t, u, i);
            i = model.next(t, &i, &u, &truth);
            theta += w * TS;
            row
        })
        .collect()
}

/// The drive's simulation; 14 s are 111,111 samples.
fn drive(bencher: Bencher, simulation: Simulation) {
    let program = Program::speed_cycles(&simulation.nominal, 2, 1.0).unwrap();
    bencher.counter(ItemsCount::new(program.targets.len())).bench_local(|| simulation.run(divan::black_box(&program)));
}

fn axis_1() -> Simulation {
    Simulation::new(RobotAxis::reference(1).unwrap()).unwrap()
}

#[divan::bench(sample_count = 20)]
fn drive_averaged(bencher: Bencher) {
    drive(bencher, axis_1());
}

#[divan::bench(sample_count = 20)]
fn drive_switching(bencher: Bencher) {
    drive(bencher, axis_1().switching(RobotAxis::V_DC, Carrier::PerSample).unwrap());
}

#[divan::bench]
fn mras_rs_and_ke(bencher: Bencher) {
    let record = record();
    let start = MrasStart {
        parameters: Winding { rs: free(0.4).within(0.01, 10.0), ls: fixed(4e-3), ke: free(0.855).within(0.1, 10.0) },
        pull: Currents { id: 100.0, iq: 100.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1 },
    };
    let law = MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke: KeLyapunov { gain: 1e-3 } };
    let mras = ExactSurface(step()).mras(law, start).unwrap();
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut mras = mras;
        for (t, AngledDrive { ud, uq, w, .. }, i) in divan::black_box(&record) {
            divan::black_box(mras.update(*t, &Drive { ud: *ud, uq: *uq, w: *w }, i));
        }
        mras.parameters()
    });
}

#[divan::bench]
fn rls_three_parameters(bencher: Bencher) {
    let record = record();
    let start =
        Winding { rs: free(0.4).prior(0.4, 1.0), ls: free(4e-3).prior(4e-3, 1e-2), ke: free(0.9).prior(0.9, 1.0) };
    let limits = Forgetting { factor: 0.9995, floor: [1e-9; 3], ceiling: [1.0; 3] };
    let rls = Rls::<Winding, 3>::new(start, 1.0, limits).unwrap();
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut rls = rls;
        for (_, u, i) in divan::black_box(&record) {
            let row = Winding { rs: i.iq, ls: 4.0 * u.w * i.id, ke: SQRT_2_3 * u.w };
            divan::black_box(rls.update(&[(row, u.uq)]));
        }
        rls.parameters()
    });
}

#[divan::bench]
fn ekf_five_states(bencher: Bencher) {
    let record = record();
    let start = EkfStart {
        state: Currents { id: free(0.0).prior(0.0, 1.0), iq: free(0.0).prior(0.0, 1.0) },
        parameters: InverterFedWinding {
            rs: free(0.4).prior(0.4, 0.32).within(0.01, 10.0),
            ls: fixed(4e-3),
            ke: free(0.855).prior(0.855, 0.14).within(0.1, 10.0),
            vdt: free(0.0).prior(0.0, 2.0),
            i0: fixed(0.15),
        },
        state_drift: Currents { id: 0.1, iq: 0.1 },
        parameter_drift: InverterFedWinding { rs: 1e-5, ls: 0.0, ke: 3e-6, vdt: 3e-5, i0: 0.0 },
        noise: Currents { id: 0.06, iq: 0.06 },
        hold: Hold::Zero,
        watch: Watch { limit: Currents { id: 8.0, iq: 8.0 }, patience: 1000 },
    };
    let ekf = InverterFed::<_, InverterFedWinding>::new(ExactSurface(step())).ekf::<5>(start).unwrap();
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut ekf = ekf;
        for (t, u, i) in divan::black_box(&record) {
            divan::black_box(ekf.update(*t, u, i));
        }
        ekf.parameters()
    });
}
