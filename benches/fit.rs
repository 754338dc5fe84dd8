//! Time of a simulation and of a linearization (cost and exact slopes), per sample of a record; of the search itself on a
//! problem whose model costs nothing; and of reading a CSV file: `cargo bench --bench fit`.

use argmin::core::CostFunction;
use divan::{Bencher, counter::ItemsCount};
use greybox::models::{
    Armature, AxisParameters, Command, ControlledAxisOutput, DcMotor, Feed, Positioning, PositioningLoop, Reference,
};
use greybox::optimize::{LeastSquares, LevenbergMarquardt, Linearization};
use greybox::pmsm::{Drive, Machine, MachineParameters, Salient, SalientWinding, Surface, VoltageAndLoad, Winding};
use greybox::{Experiment, Fit, Model, Of, Signals, Time, free, information::Information};

const SAMPLES: usize = 20_000;
const STEP: f64 = 1e-4;

fn main() {
    divan::main();
}

/// One model after another: its inputs swing with these amplitudes, its outputs are noise, its parameters are free.
macro_rules! models {
    ($($name:ident: $model:expr, $amplitude:expr, $parameters:expr;)*) => {$(
        mod $name {
            use super::*;
            #[divan::bench]
            fn simulation(bencher: Bencher) {
                run(bencher, &$model, $amplitude, $parameters, false);
            }
            #[divan::bench]
            fn linearization(bencher: Bencher) {
                run(bencher, &$model, $amplitude, $parameters, true);
            }
        }
    )*};
}

models! {
    surface: Surface::new(4).unwrap(), Drive { ud: 5.0, uq: 40.0, w: 50.0 }, Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
    salient: Salient::new(4).unwrap(), Drive { ud: 5.0, uq: 40.0, w: 50.0 },
        SalientWinding { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95 };
    machine: Machine::new(4, 100.0).unwrap(), VoltageAndLoad { ud: 5.0, uq: 40.0, tau_l: 0.1 },
        MachineParameters { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95, j: 0.012, bv: 4e-3, tc: 1.2, tg: 1.0 };
    dc_motor: DcMotor, Feed { u: 24.0, tau_l: 0.1 }, Armature { r: 1.0, l: 1e-3, k: 0.05, j: 1e-4, b: 1e-5 };
    positioning: Positioning::EMPS, Command { vir: 2.0 }, AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 };
    positioning_loop: PositioningLoop::EMPS, Reference { qg: 0.1 }, AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 };
}

fn run<M: Model + Clone>(
    bencher: Bencher,
    model: &M,
    amplitude: Of<M::Input, f64>,
    p: Of<M::Parameters, f64>,
    slopes: bool,
) {
    let swing = |k: usize| (3.0 * k as f64 * STEP).sin();
    let inputs = (0..SAMPLES).map(|k| M::Input::map(amplitude, |a| a * swing(k))).collect();
    let outputs = (0..SAMPLES).map(|k| M::Output::splat(swing(7 * k))).collect();
    let record = Experiment::new(model, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    let record = record.initial(M::State::splat(free(0.0)));
    let fit = Fit::new(model, &record).parameters(M::Parameters::map(p, free)).noise(M::Output::splat(1.0));
    let problem = fit.problem().unwrap();
    let objective = problem.objective().unwrap();
    let start = objective.start();
    let bencher = bencher.counter(ItemsCount::new(SAMPLES));
    if slopes {
        bencher.bench_local(|| objective.linearize(divan::black_box(&start)).unwrap());
    } else {
        bencher.bench_local(|| objective.cost(divan::black_box(&start)).unwrap());
    }
}

/// Rosenbrock's valley: two rows, so that the time is the search's own.
struct Rosenbrock;

impl LeastSquares for Rosenbrock {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, greybox::optimize::Infeasible> {
        let (first, second) = (10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]);
        let mut information = Information::new(2);
        information.absorb_row(&[20.0 * x[0], -10.0], first);
        information.absorb_row(&[1.0, 0.0], second);
        Ok(Linearization::new(0.5 * (first * first + second * second), 2, vec![information]))
    }
}

#[divan::bench]
fn search_of_rosenbrock() -> u64 {
    let executor = argmin::core::Executor::new(Rosenbrock, LevenbergMarquardt::default());
    let result = executor.configure(|state| state.param(vec![-1.2, 1.0])).ctrlc(false).run().unwrap();
    argmin::core::State::get_iter(result.state())
}

#[divan::bench]
fn read_csv(bencher: Bencher) {
    let model = PositioningLoop::EMPS;
    let path = std::env::temp_dir().join(format!("greybox_bench_{}.csv", std::process::id()));
    let value = |k: usize| (k as f64 * 0.377).sin();
    let inputs = (0..SAMPLES).map(|k| Reference { qg: value(k) }).collect();
    let outputs = (0..SAMPLES).map(|k| ControlledAxisOutput { qm: value(k + 1), vir: value(k + 2) }).collect();
    let record = Experiment::new(&model, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    record.to_csv(&path).unwrap();
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| Experiment::from_csv(&model, &path).unwrap());
    std::fs::remove_file(path).unwrap();
}
