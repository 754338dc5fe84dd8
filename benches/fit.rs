//! Time of a simulation and of a linearization (cost and exact slopes), per sample of a record; from a model to its problem,
//! its program included; of the search itself on a problem whose model costs nothing; and of reading a CSV file:
//! `cargo bench --bench fit`. `GREYBOX_ENGINE` chooses what evaluates the models (`duals`, `interpreter`, `machine-code`).

#[path = "../tests/common/dc_motor.rs"]
mod brushed;

use argmin::core::CostFunction;
use brushed::{Armature, DcMotor, Feed};
use divan::{Bencher, counter::ItemsCount};
use greybox::models::{AxisParameters, Command, ControlledAxisOutput, Positioning, PositioningLoop, Reference};
use greybox::optimize::{LeastSquares, LevenbergMarquardt, Linearization};
use greybox::pmsm::{Drive, Machine, MachineParameters, Salient, SalientWinding, Surface, VoltageAndLoad, Winding};
use greybox::{
    Automatic, Esdirk, Experiment, ExperimentOf, Fit, Model, Of, Rk45, Scalar, Signals, Time, free,
    information::Information, integrate::Integrator, signals,
};

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
                run(bencher, &$model, Automatic::default(), $amplitude, $parameters, false);
            }
            #[divan::bench]
            fn linearization(bencher: Bencher) {
                run(bencher, &$model, Automatic::default(), $amplitude, $parameters, true);
            }
            #[divan::bench]
            fn from_model_to_problem(bencher: Bencher) {
                let model = $model;
                let record = record(&model, $amplitude, 2);
                bencher.bench_local(|| fit(&model, &record, $parameters).problem().unwrap());
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
    coupled: Coupled, COUPLED_INPUT, COUPLED;
    positioning: Positioning::EMPS, Command { vir: 2.0 }, AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 };
    positioning_loop: PositioningLoop::EMPS, Reference { qg: 0.1 }, AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 };
}

signals! {
    pub struct Four { a: "1", b: "1", c: "1", d: "1" }
    pub struct Two { u: "1", v: "1" }
    pub struct Ends { y: "1", z: "1" }
    pub struct Ten {
        k0: "1", k1: "1", k2: "1", k3: "1", k4: "1", k5: "1", k6: "1", k7: "1", k8: "1", k9: "1"
    }
}

/// Four masses that swing, rub and couple: about ninety operations, products nested three deep, four quotients, a tanh.
#[derive(Clone)]
pub struct Coupled;

impl Model for Coupled {
    type State = Four;
    type Input = Two;
    type Output = Ends;
    type Parameters = Ten;

    fn derivative<S: Scalar>(&self, _t: S, x: &Four<S>, u: &Two<S>, p: &Ten<S>) -> Four<S> {
        let pull = Four {
            a: (u.u - p.k0 * x.a) / p.k1 + x.b * x.c * p.k2,
            b: (u.v - p.k0 * x.b) / p.k1 - x.a * x.c * p.k2,
            c: (x.a * x.b * p.k3 - p.k4 * x.c) / p.k5 - x.d,
            d: x.c * p.k4 - x.d * p.k5,
        };
        let bend = Four {
            a: pull.a + x.b * p.k6,
            b: pull.b - x.a * p.k7,
            c: pull.c * p.k8 + x.d,
            d: pull.d - x.a * x.b * p.k9,
        };
        let mix = |v: Four<S>, divisor: S| Four {
            a: (v.a * x.a - v.b * p.k1) / divisor,
            b: v.b * x.b + v.c * p.k2,
            c: v.c * x.c - v.d * p.k3,
            d: v.d * x.d - v.a * p.k4,
        };
        let twist = mix(mix(bend, p.k5), p.k3);
        Four {
            a: pull.a - twist.a * 1e-3,
            b: pull.b - twist.b * 1e-3,
            c: pull.c - twist.c * 1e-3,
            d: pull.d - twist.d * 1e-3 - (x.d / 0.1).tanh() * p.k9,
        }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Four<S>, _u: &Two<S>, _p: &Ten<S>) -> Ends<S> {
        Ends { y: x.a, z: x.d }
    }
}

const COUPLED_INPUT: Two = Two { u: 1.0, v: 1.0 };
const COUPLED: Ten = Ten { k0: 1.0, k1: 1.1, k2: 1.2, k3: 1.3, k4: 1.4, k5: 1.5, k6: 1.6, k7: 1.7, k8: 1.8, k9: 1.9 };

#[divan::bench_group]
mod coupled_adaptive {
    use super::*;

    #[divan::bench]
    fn rk45(bencher: Bencher) {
        run(bencher, &Coupled, Rk45::default(), COUPLED_INPUT, COUPLED, true);
    }
    #[divan::bench]
    fn esdirk(bencher: Bencher) {
        run(bencher, &Coupled, Esdirk::default(), COUPLED_INPUT, COUPLED, true);
    }
}

fn record<M: Model>(model: &M, amplitude: Of<M::Input, f64>, samples: usize) -> ExperimentOf<M> {
    let swing = |k: usize| (3.0 * k as f64 * STEP).sin();
    let inputs = (0..samples).map(|k| M::Input::map(amplitude, |a| a * swing(k))).collect();
    let outputs = (0..samples).map(|k| M::Output::splat(swing(7 * k))).collect();
    let record = Experiment::new(model, Time::Uniform { start: 0.0, step: STEP }, inputs, outputs).unwrap();
    record.initial(M::State::splat(free(0.0)))
}

fn fit<'m, M: Model + Clone>(model: &'m M, record: &'m ExperimentOf<M>, p: Of<M::Parameters, f64>) -> Fit<'m, M> {
    Fit::new(model, record).parameters(M::Parameters::map(p, free)).noise(M::Output::splat(1.0))
}

fn run<M: Model + Clone, I: Integrator>(
    bencher: Bencher,
    model: &M,
    integrator: I,
    amplitude: Of<M::Input, f64>,
    p: Of<M::Parameters, f64>,
    slopes: bool,
) {
    let record = record(model, amplitude, SAMPLES);
    let problem = fit(model, &record, p).integrator(integrator).problem().unwrap();
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
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| Experiment::from_file(&model, &path).unwrap());
    std::fs::remove_file(path).unwrap();
}
