//! Observers and integrators allocate nothing, nor does a pre-filtered fit sample by sample, from their making on: counted.

use crate::allocator::allocations;
use crate::spiral::{Plane, Rates, Spiral};
use greybox::online::{Ekf, EkfStart, Forgetting, Mras, MrasStart, Order, Rls, Stepping, Watch};
use greybox::pmsm::{
    AngledDrive, Currents, Drive, ExactStep, ExactSurface, HeldIn, InverterFed, InverterFedWinding, KeLyapunov,
    MotorLaw, RsLyapunov, Winding,
};
use greybox::{
    Butterworth, Dual, Esdirk, Experiment, Fit, Hold, Huber, Interval, Nothing, Rk4, Rk45, Sample, Time, fixed, free,
    integrate::{Integrator, ModelSystem},
};

const TS: f64 = 0.126e-3;

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
}

#[test]
fn mras_allocates_nothing() {
    let count = allocations(|| {
        let model = ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
        let start = MrasStart {
            parameters: Winding { rs: free(0.4), ls: fixed(4e-3), ke: free(0.9) },
            pull: Currents { id: 100.0, iq: 100.0 },
            order: Order::UpdateThenPredict,
            stepping: Stepping::Split,
            watch: Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1 },
        };
        let law = MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke: KeLyapunov { gain: 1e-3 } };
        let mut mras: Mras<_, _> = model.mras(law, start).unwrap();
        for k in 0..100 {
            mras.update(k as f64 * TS, &Drive { ud: 0.0, uq: 70.0, w: 90.0 }, &Currents { id: 0.0, iq: 5.0 });
        }
        assert!(mras.radius::<5>(&mras.state(), &Drive { ud: 0.0, uq: 70.0, w: 90.0 }) > 0.0);
    });
    assert_eq!(count, 0);
}

#[test]
fn ekf_allocates_nothing() {
    let count = allocations(|| {
        let model =
            InverterFed::<_, InverterFedWinding>::new(ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap()));
        let start = EkfStart {
            state: Currents { id: free(0.0).prior(0.0, 1.0), iq: free(0.0).prior(0.0, 1.0) },
            parameters: InverterFedWinding {
                rs: free(0.4).prior(0.4, 0.3).log(),
                ls: fixed(4e-3),
                ke: free(0.9).prior(0.9, 0.1),
                vdt: free(0.0).prior(0.0, 2.0),
                i0: fixed(0.15),
            },
            state_drift: Currents { id: 0.1, iq: 0.1 },
            parameter_drift: InverterFedWinding { rs: 1e-5, ls: 0.0, ke: 3e-6, vdt: 3e-5, i0: 0.0 },
            noise: Currents { id: 0.06, iq: 0.06 },
            hold: Hold::Zero,
            watch: Watch { limit: Currents { id: 8.0, iq: 8.0 }, patience: 100 },
        };
        let mut ekf: Ekf<_, 5> = model.ekf(start).unwrap();
        for k in 0..100 {
            let u = AngledDrive { ud: 0.0, uq: 70.0, w: 90.0, theta: 90.0 * TS * k as f64 };
            ekf.update(k as f64 * TS, &u, &Currents { id: 0.0, iq: f64::NAN });
        }
    });
    assert_eq!(count, 0);
}

#[test]
fn rls_allocates_nothing() {
    let count = allocations(|| {
        let start =
            Winding { rs: free(0.4).prior(0.4, 1.0), ls: free(4e-3).prior(4e-3, 1e-2), ke: free(0.9).prior(0.9, 1.0) };
        let limits = Forgetting { factor: 0.999, floor: [1e-6; 3], ceiling: [1.0; 3] };
        let mut rls = Rls::<Winding, 3>::new(start, 1.0, limits).unwrap();
        for k in 0..100 {
            rls.update(&[(Winding { rs: 1.0, ls: k as f64, ke: 3.0 }, 5.0)]);
        }
    });
    assert_eq!(count, 0);
}

#[test]
fn integrators_allocate_nothing() {
    fn run<I: Integrator>(integrator: &I) -> usize {
        let p = Rates { growth: Dual::<2>::variable(1.0, 0), turn: Dual::variable(2.0, 1) };
        let interval = Interval { t0: 0.0, t1: 0.5, u0: Nothing, u1: Nothing, hold: Hold::Zero };
        allocations(|| {
            let start = Plane { x: Dual::constant(0.5), y: Dual::constant(0.0) };
            let system = ModelSystem { model: &Spiral, interval: &interval, p: &p };
            system.step(integrator, start, &mut 0.0).unwrap();
        })
    }
    assert_eq!((run(&Rk4::default()), run(&Rk45::default()), run(&Esdirk::default())), (0, 0, 0));
}

/// One evaluation of a fit with slopes, of so many samples, on this thread; the first one, which compiles, not counted.
fn evaluation(samples: usize) -> usize {
    use greybox::optimize::LeastSquares;
    let model = greybox::pmsm::Surface::new(4).unwrap();
    let drive = |k: usize| Drive { ud: (k % 7) as f64, uq: 20.0, w: 30.0 };
    let record = Experiment::new(
        &model,
        Time::Uniform { start: 0.0, step: TS },
        (0..samples).map(drive).collect(),
        vec![Currents { id: 0.0, iq: 1.0 }; samples],
    )
    .unwrap();
    let problem = Fit::new(&model, &record)
        .parameters(Winding { rs: free(0.4), ls: free(4e-3), ke: free(0.9) })
        .noise(Currents { id: 0.1, iq: 0.1 })
        .loss(Huber(1.345))
        .weighting(|s: &Sample<greybox::pmsm::Surface>| s.u.w)
        .prefilter(Butterworth::low_pass(4, 100.0, TS).unwrap())
        .problem()
        .unwrap();
    let objective = problem.objective().unwrap();
    let start = objective.start();
    objective.linearize(&start).unwrap();
    let count = allocations(|| {
        objective.linearize(&start).unwrap();
    });
    println!("{count} allocations for {samples} samples");
    count
}

#[test]
fn allocations_of_a_fit_do_not_grow_with_the_record() {
    assert_eq!(evaluation(1000), evaluation(10_000));
}
