//! Time of a sample with all its slopes, per lane, without what is made of the rows: `cargo bench --bench engine`. The engine
//! is chosen by `GREYBOX_ENGINE`. Beside it, a record on duals, as a model runs that cannot be read; and the time from a model
//! to its program.

use divan::{Bencher, black_box, counter::ItemsCount};
use greybox::engine::{Program, Sampling, Trajectories};
use greybox::graph::Seed;
use greybox::pmsm::{Surface, Winding};
use greybox::{
    Dual, Esdirk, Hold, Interval, Model, Of, Rk4, Rk45, Scalar, Signals,
    equations::Equations,
    integrate::{Integrator, ModelSystem},
    recurrence::Recurrence,
    signals,
};

const SAMPLES: usize = 2000;
const STEP: f64 = 1e-4;

signals! {
    pub struct Four { a: "1", b: "1", c: "1", d: "1" }
    pub struct Two { u: "1", v: "1" }
    pub struct Ends { y: "1", z: "1" }
    pub struct Ten {
        k0: "1", k1: "1", k2: "1", k3: "1", k4: "1", k5: "1", k6: "1", k7: "1", k8: "1", k9: "1"
    }
}

/// Four masses that swing, rub and couple: about ninety operations, products nested three deep, four quotients, a tanh.
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

fn main() {
    println!("Coupled: {:?}", program(&Coupled, Trajectories::Many, true).instructions());
    println!("motor: {:?}", program(&Surface::new(4).unwrap(), Trajectories::Many, true).instructions());
    divan::main();
}

fn program<M: Model>(model: &M, trajectories: Trajectories, slopes: bool) -> Program {
    let equations = Equations::trace(model).unwrap();
    let recurrence = Recurrence::new(&equations, &Rk4::default(), Hold::Zero).unwrap();
    let parameters = (0..M::Parameters::LEN).map(Seed::Parameter);
    let seeds: Vec<Seed> = parameters.chain((0..M::State::LEN).map(Seed::Carry)).filter(|_| slopes).collect();
    Program::compile(&recurrence, &seeds, Sampling::Uniform, trajectories).unwrap()
}

fn lanes<M: Model>(bencher: Bencher, model: &M, p: &[f64], trajectories: Trajectories, slopes: bool) {
    let program = program(model, trajectories, slopes);
    let mut group = program.group(program.lanes());
    let lanes = group.lanes();
    let inputs: Vec<f64> = (0..SAMPLES * program.columns().len() * lanes).map(|i| (0.37 * i as f64).sin()).collect();
    let mut rows = vec![0.0; 32 * program.row_length() * lanes];
    bencher.counter(ItemsCount::new(SAMPLES * lanes)).bench_local(|| {
        for lane in 0..lanes {
            group.set_parameters(lane, p);
            group.set_step(lane, STEP);
            group.start(lane, &[0.1; 8][..M::State::LEN]);
        }
        group.prepare();
        for block in inputs.chunks(32 * program.columns().len() * lanes) {
            group.run(block, &mut rows, block.len() / (program.columns().len() * lanes));
        }
        black_box(&rows);
    });
}

fn duals<M: Model, const N: usize>(bencher: Bencher, model: &M, p: &[f64]) {
    let p = M::Parameters::from_fn(|j| Dual::<N>::variable(p[j], j));
    bencher.counter(ItemsCount::new(SAMPLES)).bench_local(|| {
        let mut x = M::State::from_fn(|i| Dual::<N>::variable(0.1, M::Parameters::LEN + i));
        for k in 0..SAMPLES {
            let u: Of<M::Input, f64> = M::Input::from_fn(|i| (0.37 * (k * 3 + i) as f64).sin());
            let interval = Interval { t0: k as f64 * STEP, t1: (k + 1) as f64 * STEP, u0: u, u1: u, hold: Hold::Zero };
            x = ModelSystem { model, interval: &interval, p: &p }.step(&Rk4::default(), x, &mut 0.0).unwrap();
            black_box(&x);
        }
    });
}

/// Eight slopes of a Rust model through an adaptive method, on duals.
fn adaptive<M: Model, I: Integrator>(bencher: Bencher, model: &M, integrator: &I, p: &[f64]) {
    let p = M::Parameters::from_fn(|j| Dual::<8>::variable(p[j], j));
    let input = |k: usize| -> Of<M::Input, f64> { M::Input::from_fn(|i| (0.037 * (k * 3 + i) as f64).sin()) };
    let time = |k: usize| (k as f64 * 1e-2, (k + 1) as f64 * 1e-2);
    bencher.counter(ItemsCount::new(100usize)).bench_local(|| {
        let (mut step, mut x) = (0.0, M::State::from_fn(|_| Dual::<8>::constant(0.1)));
        for k in 0..100 {
            let interval = Interval { t0: time(k).0, t1: time(k).1, u0: input(k), u1: input(k), hold: Hold::Zero };
            x = ModelSystem { model, interval: &interval, p: &p }.step(integrator, x, &mut step).unwrap();
        }
        black_box(x);
    });
}

const MOTOR: Winding = Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
const TEN: [f64; 10] = [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8, 1.9];

#[divan::bench_group]
mod motor {
    use super::*;

    fn p() -> [f64; 3] {
        MOTOR.into()
    }
    #[divan::bench]
    fn engine(bencher: Bencher) {
        lanes(bencher, &Surface::new(4).unwrap(), &p(), Trajectories::Many, true);
    }
    #[divan::bench]
    fn engine_values_alone(bencher: Bencher) {
        lanes(bencher, &Surface::new(4).unwrap(), &p(), Trajectories::One, false);
    }
    #[divan::bench]
    fn on_duals(bencher: Bencher) {
        duals::<_, 5>(bencher, &Surface::new(4).unwrap(), &p());
    }
    #[divan::bench]
    fn on_numbers(bencher: Bencher) {
        duals::<_, 0>(bencher, &Surface::new(4).unwrap(), &p());
    }
    #[divan::bench]
    fn from_model_to_program() -> Program {
        program(&Surface::new(4).unwrap(), Trajectories::Many, true)
    }
}

#[divan::bench_group]
mod coupled {
    use super::*;

    #[divan::bench]
    fn engine(bencher: Bencher) {
        lanes(bencher, &Coupled, &TEN, Trajectories::Many, true);
    }
    #[divan::bench]
    fn engine_values_alone(bencher: Bencher) {
        lanes(bencher, &Coupled, &TEN, Trajectories::One, false);
    }
    #[divan::bench]
    fn on_duals(bencher: Bencher) {
        duals::<_, 14>(bencher, &Coupled, &TEN);
    }
    #[divan::bench]
    fn on_numbers(bencher: Bencher) {
        duals::<_, 0>(bencher, &Coupled, &TEN);
    }
    #[divan::bench]
    fn from_model_to_program() -> Program {
        program(&Coupled, Trajectories::Many, true)
    }
}

#[divan::bench_group]
mod adaptive_methods {
    use super::*;

    #[divan::bench]
    fn rk45_motor(bencher: Bencher) {
        let p: [f64; 3] = MOTOR.into();
        adaptive(bencher, &Surface::new(4).unwrap(), &Rk45::default(), &p);
    }
    #[divan::bench]
    fn rk45_coupled(bencher: Bencher) {
        adaptive(bencher, &Coupled, &Rk45::default(), &TEN);
    }
    #[divan::bench]
    fn esdirk_coupled(bencher: Bencher) {
        adaptive(bencher, &Coupled, &Esdirk::default(), &TEN);
    }
}
