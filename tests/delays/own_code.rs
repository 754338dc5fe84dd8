//! Models that are not read as a graph, and observers, which have no dead time.

use crate::{Excess, Heated, Process, Sensor, Valve};
use greybox::online::{Ekf, EkfStart, ObserverError, Watch};
use greybox::*;

/// [`Heated`], late by what `theta` has above 2 s; it asks for a value, as no model does that is read as a graph.
#[derive(Clone)]
struct Unread;

impl Model for Unread {
    type State = Excess;
    type Input = Valve;
    type Output = Sensor;
    type Parameters = Process;
    fn derivative<S: Scalar>(&self, _t: S, x: &Excess<S>, u: &Valve<S>, p: &Process<S>) -> Excess<S> {
        let gain = if p.k.value() > 0.0 { p.k } else { -p.k };
        Excess { z: (gain * u.u - x.z) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Excess<S>, _u: &Valve<S>, p: &Process<S>) -> Sensor<S> {
        Sensor { y: p.y0 + x.z }
    }
    fn delay<S: Scalar>(&self, p: &Process<S>) -> Valve<S> {
        Valve { u: (p.theta - 2.0).max(S::from(0.0)) }
    }
}

/// A dead time that is zero for small parameters: a fit has it where it is not, as the simulation has. The error is that of rounding.
#[test]
fn a_dead_time_that_begins_above_a_value() {
    let inputs: Vec<Valve> = (0..60).map(|k| Valve { u: [0.0, 1.0, -1.0][k / 7 % 3] }).collect();
    let truth = Process { y0: 1.0, k: 2.0, tau: 5.0, theta: 5.5 };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let run = simulate(&Unread, &truth, &Excess { z: 0.0 }, time, &inputs).unwrap();
    let record = run.experiment(&Unread).unwrap().initial(Excess { z: fixed(0.0) });
    let start = Process { y0: free(0.5), k: free(1.0), tau: free(4.0).log(), theta: fixed(5.5) };
    let found = Fit::new(&Unread, &record).parameters(start).integrator(Rk4 { substeps: 1 }).run().unwrap();
    assert!(found.method.engine.starts_with("dual numbers"), "{}", found.method.engine);
    assert!((found.parameters.k - 2.0).abs() < 1e-9 && (found.parameters.tau - 5.0).abs() < 1e-8, "{found}");
}

#[test]
fn observers_refuse_a_dead_time() {
    let start = EkfStart {
        state: Excess { z: free(0.0).prior(0.0, 1.0) },
        parameters: Process { y0: fixed(0.0), k: fixed(1.0), tau: fixed(5.0), theta: fixed(3.0) },
        state_drift: Excess { z: 1e-3 },
        parameter_drift: Process::default(),
        noise: Sensor { y: 0.1 },
        hold: Hold::Zero,
        watch: Watch { limit: Sensor { y: 6.0 }, patience: 20 },
    };
    let error = Ekf::<_, 1>::new(Heated, 1.0, start).err().unwrap();
    assert_eq!(error, ObserverError::Late { input: "u", delay: 3.0 });
}
