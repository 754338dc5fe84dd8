//! [`Kalman`] of models that are affine in their state, against exact likelihoods: of an independent scalar filter, and of all measurements at once as one Gaussian
//! vector. Noise levels are among the unknowns.

use crate::common::Noise;
use argmin::core::{CostFunction, Gradient, Jacobian, Operator};
use core::f64::consts::TAU;
use greybox::estimate::{CovarianceMethod, NoiseModel};
use greybox::optimize::{JacobianColumns, LeastSquares};
use greybox::optimize::{LevenbergMarquardt, Stop};
use greybox::*;
use nalgebra::{DMatrix, DVector};

signals! { pub struct Position { x: "m" } }
signals! { pub struct Push { u: "m" } }
signals! { pub struct Sensors { y: "m", z: "m" } }
signals! { pub struct Levels { drift: "m", y: "m", z: "m" } }
signals! { pub struct Dynamics { tau: "s", gain: "1", drift: "m", y: "m", z: "m" } }

/// `x[k+1] = x[k] + w`, seen by two sensors of different noise.
#[derive(Clone)]
struct RandomWalk;

impl Model for RandomWalk {
    type State = Position;
    type Input = Push;
    type Output = Sensors;
    type Parameters = Levels;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Push<S>, _p: &Levels<S>) -> Position<S> {
        *x
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Levels<S>) -> Position<S> {
        Position { x: p.drift }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Levels<S>) -> Sensors<S> {
        Sensors { y: p.y, z: p.z }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Push<S>, _p: &Levels<S>) -> Sensors<S> {
        Sensors { y: x.x, z: x.x }
    }
}

/// `x[k+1] = a x[k] + (1 - a) gain u[k] + w` with `a = exp(-1 / tau)`; the second sensor shows twice the state.
#[derive(Clone)]
struct Sampled;

impl Model for Sampled {
    type State = Position;
    type Input = Push;
    type Output = Sensors;
    type Parameters = Dynamics;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Position<S>, u: &Push<S>, p: &Dynamics<S>) -> Position<S> {
        let a = (-p.tau.recip()).exp();
        Position { x: a * x.x + p.gain * u.u * (-a + 1.0) }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Dynamics<S>) -> Position<S> {
        Position { x: p.drift }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Dynamics<S>) -> Sensors<S> {
        Sensors { y: p.y, z: p.z }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Push<S>, _p: &Dynamics<S>) -> Sensors<S> {
        Sensors { y: x.x, z: x.x * 2.0 }
    }
}

/// `tau dx = (gain u - x) dt + tau drift dw`, seen as `Sampled` is.
#[derive(Clone)]
struct Lag;

impl Model for Lag {
    type State = Position;
    type Input = Push;
    type Output = Sensors;
    type Parameters = Dynamics;
    fn derivative<S: Scalar>(&self, _t: S, x: &Position<S>, u: &Push<S>, p: &Dynamics<S>) -> Position<S> {
        Position { x: (p.gain * u.u - x.x) / p.tau }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Dynamics<S>) -> Position<S> {
        Position { x: p.drift }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Position<S>, _u: &Push<S>, p: &Dynamics<S>) -> Sensors<S> {
        Sensors { y: p.y, z: p.z }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Push<S>, _p: &Dynamics<S>) -> Sensors<S> {
        Sensors { y: x.x, z: x.x * 2.0 }
    }
}

/// Numbers with slopes with respect to all unknowns.
type D = Dual<6>;

/// A scalar state over a record: `x[k+1] = a x[k] + f + w`, the variance of `w` is `q`.
struct Chain<S> {
    start: S,
    steps: Vec<[S; 3]>,
    measurements: Vec<Measurement<S>>,
}

/// `y = c x + e` at a sample, the variance of `e` is `r`.
struct Measurement<S> {
    sample: usize,
    y: f64,
    c: f64,
    r: S,
}

impl<S: Scalar> Chain<S> {
    /// `-ln` of the likelihood by the recursion of a scalar filter.
    fn by_filter(&self) -> S {
        let (mut x, mut p, mut sum) = (self.start, S::from(0.0), S::from(0.0));
        for k in 0..=self.steps.len() {
            for m in self.measurements.iter().filter(|m| m.sample == k) {
                let (error, variance) = (S::from(m.y) - x * m.c, p * (m.c * m.c) + m.r);
                sum += (error * error / variance + (variance * TAU).ln()) * 0.5;
                let gain = p * m.c / variance;
                (x, p) = (x + gain * error, p * m.r / variance);
            }
            if let Some([a, f, q]) = self.steps.get(k) {
                (x, p) = (*a * x + *f, *a * *a * p + *q);
            }
        }
        sum
    }

    /// The same from mean and covariance of all measurements, by Cholesky's factorization.
    fn by_covariance(&self) -> S {
        // Mean and variance of the state at each sample; its covariance with an earlier one is that one's variance times
        // the product of all a between them.
        let mut moments = vec![(self.start, S::from(0.0))];
        for [a, f, q] in &self.steps {
            let (mean, variance) = moments[moments.len() - 1];
            moments.push((*a * mean + *f, *a * *a * variance + *q));
        }
        let covariance = |earlier: usize, later: usize| {
            self.steps[earlier..later].iter().fold(moments[earlier].1, |product, [a, ..]| product * *a)
        };
        let n = self.measurements.len();
        let mut factor = vec![vec![S::from(0.0); n]; n];
        let mut sum = S::from(0.5 * n as f64 * TAU.ln());
        let mut whitened: Vec<S> = Vec::with_capacity(n);
        for i in 0..n {
            let m = &self.measurements[i];
            for j in 0..=i {
                let other = &self.measurements[j];
                let mut entry = covariance(other.sample, m.sample) * (m.c * other.c);
                if i == j {
                    entry += m.r;
                }
                for (a, b) in factor[i][..j].iter().zip(&factor[j]) {
                    entry -= *a * *b;
                }
                factor[i][j] = if i == j { entry.sqrt() } else { entry / factor[j][j] };
            }
            let mut error = S::from(m.y) - moments[m.sample].0 * m.c;
            for (entry, white) in factor[i].iter().zip(&whitened) {
                error -= *entry * *white;
            }
            whitened.push(error / factor[i][i]);
            sum += factor[i][i].ln() + whitened[i] * whitened[i] * 0.5;
        }
        sum
    }
}

/// The measurements of a record, in the order of time and of the outputs; `c` of each sensor, and their variances.
fn measurements<S: Scalar>(
    outputs: impl Iterator<Item = Sensors>,
    c: [f64; 2],
    deviations: [S; 2],
) -> Vec<Measurement<S>> {
    let r = deviations.map(|deviation| deviation * deviation);
    let rows = outputs
        .enumerate()
        .flat_map(|(sample, row)| [(row.y, 0), (row.z, 1)].map(|(y, j)| Measurement { sample, y, c: c[j], r: r[j] }));
    rows.filter(|m| !m.y.is_nan()).collect()
}

/// The gradient, by exact slopes.
fn gradient(chain: &dyn Fn(&[D]) -> Chain<D>, at: &[f64]) -> Vec<f64> {
    let seeded: Vec<D> = at.iter().enumerate().map(|(i, x)| Dual::variable(*x, i)).collect();
    chain(&seeded).by_covariance().slopes[..at.len()].to_vec()
}

/// Where the gradient vanishes, by Newton's method with differences of it, from a place nearby.
fn minimum(chain: &dyn Fn(&[D]) -> Chain<D>, from: &[f64]) -> Vec<f64> {
    let n = from.len();
    let moved = |x: &DVector<f64>, i: usize, by: f64| {
        let mut to = x.clone();
        to[i] += by;
        DVector::from_vec(gradient(chain, to.as_slice()))
    };
    let mut x = DVector::from_column_slice(from);
    for _ in 0..8 {
        let hessian = DMatrix::from_columns(
            &(0..n).map(|i| (moved(&x, i, 1e-5) - moved(&x, i, -1e-5)) / 2e-5).collect::<Vec<_>>(),
        );
        let step = hessian.lu().solve(&DVector::from_vec(gradient(chain, x.as_slice()))).unwrap();
        x -= step;
    }
    x.as_slice().to_vec()
}

/// Likelihood and gradient of a fit at its start and at its end, and its end, against the two of the reference, whose
/// unknowns are the coordinates of the fit.
fn agrees<M: Model + Clone>(fit: Fit<'_, M>, chain: &dyn Fn(&[D]) -> Chain<D>) {
    // The search converges linearly, by a half at each step: the last one has to be shorter than the tolerance below.
    let stop = Stop { step: 1e-12, ..Stop::default() };
    let problem = fit.optimizer(LevenbergMarquardt::new(stop, JacobianColumns)).problem().unwrap();
    let estimate = problem.run().unwrap();
    println!("{estimate}");
    assert!(estimate.outcome.converged(), "{estimate}");
    assert_eq!(estimate.method.noise, NoiseModel::Predicted);
    let objective = problem.objective().unwrap();
    let end: Vec<f64> = estimate.unknowns.iter().map(|u| u.transform.to_coordinate(u.value)).collect();
    let constant = 0.5 * estimate.measurements as f64 * TAU.ln();
    for at in [objective.start(), end.clone()] {
        let constants: Vec<D> = at.iter().map(|x| Dual::constant(*x)).collect();
        let (filtered, exact) = (chain(&constants).by_filter().value, chain(&constants).by_covariance().value);
        // The two references agree with each other first.
        assert!((filtered / exact - 1.0).abs() < 1e-12, "{filtered} {exact}");
        let found = objective.cost(&at).unwrap() + constant;
        assert!((found / exact - 1.0).abs() < 1e-10, "{found} {exact}");
        let (found, exact) = (objective.gradient(&at).unwrap(), gradient(chain, &at));
        // At the minimum the gradient is zero: it is measured by its terms, one per measurement.
        let size = exact.iter().fold(constant, |size, g| size.max(g.abs()));
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-10 * size, "{found} {exact}");
        }
    }
    let best = minimum(chain, &end);
    for ((unknown, found), exact) in estimate.unknowns.iter().zip(&end).zip(&best) {
        let value = unknown.transform.to_value(*exact);
        println!("{} {} {value} {:e}", unknown.name, unknown.value, unknown.value / value - 1.0);
        assert!((unknown.value / value - 1.0).abs() < 1e-10, "{}: {found} {exact}", unknown.name);
    }
    let constants: Vec<D> = best.iter().map(|x| Dual::constant(*x)).collect();
    let deviance = 2.0 * chain(&constants).by_covariance().value;
    assert!((estimate.deviance.unwrap() / deviance - 1.0).abs() < 1e-10, "{:?} {deviance}", estimate.deviance);
}

/// A record of the plant: one sensor is read at every third sample only, and neither at some.
fn record<M>(model: &M, time: Time, step: impl Fn(f64, f64, f64, f64) -> f64, c: [f64; 2]) -> ExperimentOf<M>
where
    M: Model<State = Position, Input = Push, Output = Sensors>,
{
    let mut noise = Noise(11);
    let (mut x, mut inputs, mut outputs) = (1.5, vec![], vec![]);
    for k in 0..60 {
        let u = if k % 17 < 8 { 1.0 } else { -0.5 };
        let (y, z) = (c[0] * x + 0.3 * noise.gauss(), c[1] * x + 0.5 * noise.gauss());
        let y = if k % 7 == 5 { f64::NAN } else { y };
        outputs.push(Sensors { y, z: if k % 3 == 0 { z } else { f64::NAN } });
        inputs.push(Push { u });
        x = step(time.at(k + 1) - time.at(k), x, u, noise.gauss());
    }
    Experiment::new(model, time, inputs, outputs).unwrap().initial(Position { x: free(1.0) })
}

#[test]
fn a_random_walk() {
    let record = record(&RandomWalk, Time::Uniform { start: 0.0, step: 1.0 }, |_, x, _, w| x + 0.2 * w, [1.0, 1.0]);
    let parameters = Levels { drift: free(0.5).log(), y: free(0.5).log(), z: free(0.4) };
    let fit = Fit::new(&RandomWalk, &record).parameters(parameters).predictor(Kalman);
    agrees(fit, &|p| {
        let q = (p[0] * 2.0).exp();
        Chain {
            start: p[3],
            steps: vec![[D::from(1.0), D::from(0.0), q]; record.len() - 1],
            measurements: measurements(record.outputs(), [1.0, 1.0], [p[1].exp(), p[2]]),
        }
    });
}

fn dynamics() -> Dynamics<Parameter> {
    Dynamics { tau: free(5.0).log(), gain: free(1.0), drift: free(0.3).log(), y: free(0.5).log(), z: free(0.4) }
}

#[test]
fn a_first_order_lag_in_discrete_time() {
    let a = f64::exp(-0.25);
    let step = |_: f64, x: f64, u: f64, w: f64| a * x + (1.0 - a) * 2.0 * u + 0.2 * w;
    let record = record(&Sampled, Time::Uniform { start: 0.0, step: 1.0 }, step, [1.0, 2.0]);
    let fit = Fit::new(&Sampled, &record).parameters(dynamics()).predictor(Kalman);
    agrees(fit, &|p| {
        let (a, gain, q) = ((-(-p[0]).exp()).exp(), p[1], (p[2] * 2.0).exp());
        let inputs = record.inputs().take(record.len() - 1);
        Chain {
            start: p[5],
            steps: inputs.map(|u| [a, gain * (-a + 1.0) * u.u, q]).collect(),
            measurements: measurements(record.outputs(), [1.0, 2.0], [p[3].exp(), p[4]]),
        }
    });
}

/// A record of the lag, and its chain: over an interval `h` under a held input, exactly, `a = exp(-h / tau)` and
/// `q = drift^2 tau (1 - a^2) / 2`.
fn lag(time: Time) -> (ExperimentOf<Lag>, impl Fn(&[D]) -> Chain<D>) {
    let (tau, drift) = (0.4, 0.5);
    let step = |h: f64, x: f64, u: f64, w: f64| {
        let a = f64::exp(-h / tau);
        a * x + (1.0 - a) * 2.0 * u + drift * f64::sqrt(tau / 2.0 * (1.0 - a * a)) * w
    };
    let record = record(&Lag, time, step, [1.0, 2.0]);
    let same = record.clone();
    let chain = move |p: &[D]| {
        let (tau, gain, drift) = (p[0].exp(), p[1], p[2].exp());
        let over = |(k, u): (usize, Push)| {
            let a = (-tau.recip() * (same.time(k + 1) - same.time(k))).exp();
            [a, gain * (-a + 1.0) * u.u, drift * drift * tau * (-(a * a) + 1.0) * 0.5]
        };
        Chain {
            start: p[5],
            steps: same.inputs().enumerate().take(same.len() - 1).map(over).collect(),
            measurements: measurements(same.outputs(), [1.0, 2.0], [p[3].exp(), p[4]]),
        }
    };
    (record, chain)
}

/// Runge-Kutta's 200 steps per sample err by `200 (2 h / (200 tau))^5 / 120` in the variance, with `h / tau` up to 0.33 less than
/// 1e-12.
#[test]
fn a_first_order_lag_in_continuous_time_sampled_unevenly() {
    let time = Time::Stamps((0..60).map(|k| 0.1 * k as f64 + if k % 2 == 0 { 0.0 } else { 0.03 }).collect());
    let (record, chain) = lag(time);
    let parameters = Dynamics { tau: free(0.5).log(), ..dynamics() };
    let fit = Fit::new(&Lag, &record).parameters(parameters).predictor(Kalman).integrator(Rk4 { substeps: 200 });
    agrees(fit, &chain);
}

/// Two sensors of one position, far better than the model predicts it: the variance that the second one meets is a part of 1e-12 to 1e-18
/// of that before the first. The reference has it as a product, and each sensor's term has the rounding of an error of some 1e-16 of a
/// position in a noise of 1e-9.
#[test]
fn sensors_far_better_than_the_model() {
    for level in [1e-6, 1e-7, 1e-8, 1e-9] {
        let (mut noise, mut x, mut outputs) = (Noise(4), 0.0, vec![]);
        for _ in 0..60 {
            outputs.push(Sensors { y: x + level * noise.gauss(), z: x + level * noise.gauss() });
            x += 0.1 * noise.gauss();
        }
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 60], outputs).unwrap();
        let record = record.initial(Position { x: fixed(0.0) });
        let parameters = Levels { drift: free(0.1).log(), y: free(level).log(), z: free(level).log() };
        let problem = Fit::new(&RandomWalk, &record).parameters(parameters).predictor(Kalman).problem().unwrap();
        let objective = problem.objective().unwrap();
        let at = objective.start();
        let found = objective.cost(&at).unwrap() + 60.0 * TAU.ln();
        let chain = Chain {
            start: 0.0,
            steps: vec![[1.0, 0.0, (2.0 * at[0]).exp()]; 59],
            measurements: measurements(record.outputs(), [1.0, 1.0], [at[1].exp(), at[2].exp()]),
        };
        let exact = chain.by_filter();
        assert!((found / exact - 1.0).abs() < 1e-8, "{level}: {found} {exact}");
    }
}

/// Methods that choose their steps run in dual numbers, in windows of eight samples: in most of them other measurements are missing than
/// in the window before. The gradient at the start, a sum of some hundred terms, is that of the exact likelihood to the tolerance.
#[test]
fn missing_measurements_by_methods_that_choose_their_steps() {
    let time = Time::Stamps((0..60).map(|k| 0.1 * k as f64 + if k % 2 == 0 { 0.0 } else { 0.03 }).collect());
    let (record, chain) = lag(time);
    let parameters = || Dynamics { tau: free(0.5).log(), ..dynamics() };
    let fit = || Fit::new(&Lag, &record).parameters(parameters()).predictor(Kalman);
    let (relative, absolute) = (1e-10, 1e-12);
    for fit in [fit().integrator(Rk45 { relative, absolute }), fit().integrator(Esdirk { relative, absolute })] {
        let problem = fit.problem().unwrap();
        let objective = problem.objective().unwrap();
        let start = objective.start();
        let (found, exact) = (objective.gradient(&start).unwrap(), gradient(&chain, &start));
        let size = exact.iter().fold(0.0f64, |size, g| size.max(g.abs()));
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-7 * size, "{found} {exact}");
        }
    }
}

/// Ten samples, the last one not measured: from the field, where the slope with respect to the sensor's noise was 32.08.
#[test]
fn one_missing_measurement_in_the_second_window() {
    let y = [0.9, 0.8, 0.75, 0.6, 0.66, 0.55, 0.5, 0.62, 0.58, f64::NAN];
    let outputs = y.map(|y| Sensors { y, z: f64::NAN }).to_vec();
    let time = Time::Uniform { start: 0.0, step: 0.2 };
    // dx/dt = -x + u / 2 + 0.3 dw, the noise of y is 0.2; the second sensor is measured once, so exactly that it does not matter.
    let outputs = [&[Sensors { y: outputs[0].y, z: 2.0 }], &outputs[1..]].concat();
    let record = Experiment::new(&Lag, time, vec![Push { u: 1.0 }; 10], outputs).unwrap();
    let record = record.initial(Position { x: fixed(1.0) });
    let parameters = Dynamics { tau: fixed(1.0), gain: fixed(0.5), drift: fixed(0.3), y: free(0.2), z: fixed(1.0) };
    let slope = |fit: Fit<'_, Lag>| {
        let problem = fit.predictor(Kalman).problem().unwrap();
        let objective = problem.objective().unwrap();
        objective.gradient(&objective.start()).unwrap()[0]
    };
    let fit = || Fit::new(&Lag, &record).parameters(parameters);
    for slope in [
        slope(fit().integrator(Esdirk { relative: 1e-9, absolute: 1e-12 })),
        slope(fit().integrator(Rk4 { substeps: 64 })),
    ] {
        // The value of an independent filter, to its digits.
        assert!((slope - 29.2259).abs() < 5e-5, "{slope}");
    }
}

/// Samples 1.5 and 3 time constants apart. A default fit steps so finely that the next finer step would move no unknown by a tenth of
/// its standard error, and says nothing of the step; by a method of fourth order all finer ones together then move it by little more
/// than a tenth. One step per sample, where it was chosen, is 1.2 errors off, and a warning says so; at 3 time constants its variance
/// is negative.
#[test]
fn a_lag_sampled_coarsely() {
    let fitted = |steps: f64, one: bool| {
        let (record, chain) = lag(Time::Uniform { start: 0.0, step: 0.4 * steps });
        let parameters = Dynamics { tau: free(0.5).log(), drift: fixed(0.5), ..dynamics() };
        let fit = Fit::new(&Lag, &record).parameters(parameters).predictor(Kalman);
        let fit = if one { fit.integrator(Rk4::default()) } else { fit };
        fit.run().map(|estimate| {
            let coordinates: Vec<f64> =
                estimate.unknowns.iter().map(|one| one.transform.to_coordinate(one.value)).collect();
            let drift = D::from(0.5f64.ln());
            let best = minimum(&|p| chain(&[&p[..2], &[drift], &p[2..]].concat()), &coordinates);
            let moved = |(one, exact): (&greybox::estimate::Unknown, &f64)| {
                (one.value - one.transform.to_value(*exact)).abs() / one.knowledge.standard_error().unwrap()
            };
            let moved = estimate.unknowns.iter().zip(&best).map(moved).fold(0.0, f64::max);
            (moved, estimate.warnings.iter().any(|one| one.code == WarningCode::CoarseStep))
        })
    };
    for steps in [1.5, 3.0] {
        let (moved, warned) = fitted(steps, false).unwrap();
        println!("{moved} {warned}");
        assert!(moved < 0.12 && !warned, "{steps}: {moved}");
    }
    let (moved, warned) = fitted(1.5, true).unwrap();
    assert!(moved > 0.5 && warned, "{moved}");
    let why = fitted(3.0, true).unwrap_err().to_string();
    assert!(why.contains("use a finer step"), "{why}");
}

/// A model that says nothing of its noise.
macro_rules! without_noise {
    ($name:ident, $kind:expr, $state:ident) => {
        #[derive(Clone)]
        struct $name;

        impl Model for $name {
            type State = $state;
            type Input = Push;
            type Output = Position;
            type Parameters = Levels;
            const KIND: Kind = $kind;
            fn next<S: Scalar>(&self, _t: S, x: &Of<$state, S>, _u: &Push<S>, _p: &Levels<S>) -> Of<$state, S> {
                *x
            }
            fn output<S: Scalar>(&self, _t: S, _x: &Of<$state, S>, u: &Push<S>, p: &Levels<S>) -> Position<S> {
                Position { x: u.u * p.y }
            }
        }
    };
}

without_noise!(Noiseless, Kind::Discrete, Position);
without_noise!(Stateless, Kind::Static, Nothing);

#[test]
fn what_cannot_be_filtered_is_refused() {
    fn refused<M>(model: &M, start: Of<M::State, Parameter>) -> String
    where
        M: Model<Input = Push, Output = Position, Parameters = Levels> + Clone,
    {
        let (inputs, outputs) = (vec![Push { u: 1.0 }; 9], vec![Position { x: 1.0 }; 9]);
        let record = Experiment::new(model, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let record = record.initial(start);
        let parameters = Levels { drift: fixed(0.1), y: free(0.5), z: fixed(0.0) };
        let Err(error) = Fit::new(model, &record).parameters(parameters).predictor(Kalman).run() else {
            panic!("a fit without noise")
        };
        error.to_string()
    }
    for why in [refused(&Noiseless, Position { x: fixed(0.0) }), refused(&Stateless, Nothing)] {
        let expected = "the predicted variance of output `x` is NaN; it must be positive: write Model::noise";
        assert!(why.contains(expected), "{why}");
    }
}

/// Of 20 errors of size `s` the deviance rises by `20 (ln(s'^2 / s^2) + s^2 / s'^2 - 1)` where the level is `s'`: by the square of
/// Student's t at 97.5 % at both ends of the profile, whose roots are found to a thousandth.
#[test]
fn the_profile_of_a_noise_level() {
    let mut noise = Noise(8);
    let outputs = (0..20).map(|_| Sensors { y: 0.3 * noise.gauss(), z: 0.1 * noise.gauss() }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 20], outputs).unwrap();
    let record = record.initial(Position { x: fixed(0.0) });
    let parameters = Levels { drift: fixed(0.0), y: free(0.2), z: fixed(0.1) };
    let problem = Fit::new(&RandomWalk, &record).parameters(parameters).predictor(Kalman).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = diagnose::profile(&problem, &estimate, "y", 0.95).unwrap();
    let square = record.outputs().map(|y| y.y * y.y).sum::<f64>() / 20.0;
    assert!((found.value / square.sqrt() - 1.0).abs() < 1e-6, "{} {square}", found.value);
    for end in [found.lower, found.upper] {
        let diagnose::End::At(end) = end else { panic!("{end:?}") };
        let part = square / (end * end);
        let rise = 20.0 * (part - part.ln() - 1.0);
        assert!(((rise / (found.threshold * found.inflation)).sqrt() - 1.0).abs() < 2e-3, "{rise} {}", found.threshold);
    }
    assert!(found.remark.is_empty(), "{}", found.remark);
}

/// Of 20 errors the standard deviation has a variance with 20 degrees of freedom (Satterthwaite: `2 v^2 / var(v)` with
/// `v = sigma^2 / 40`); by logarithm the variance does not depend on it, and those of the fit are left, 39.
#[test]
fn a_noise_level_has_the_degrees_of_freedom_of_its_own_variance() {
    let mut noise = Noise(8);
    let outputs = (0..20).map(|_| Sensors { y: 0.3 * noise.gauss(), z: 0.1 * noise.gauss() }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 20], outputs).unwrap();
    let record = record.initial(Position { x: fixed(0.0) });
    let width = |y: Parameter| {
        let parameters = Levels { drift: fixed(0.0), y, z: fixed(0.1) };
        let fit = Fit::new(&RandomWalk, &record).parameters(parameters).predictor(Kalman).run().unwrap();
        let Knowledge::Known { standard_error, lower, upper } = fit.unknowns[0].knowledge else { panic!("{fit}") };
        let uneven = fit.warnings.iter().any(|warning| warning.code == WarningCode::CurvedInterval);
        // A part of 1 / sqrt(40) of the value, just above the 15 % that are warned of.
        (
            standard_error / fit.unknowns[0].value,
            (upper - lower) / 2.0 / standard_error,
            (upper / lower).ln() / 2.0,
            uneven,
            fit.unknowns[0].degrees_of_freedom,
        )
    };
    let (relative, half, _, uneven, degrees) = width(free(0.2));
    assert!((relative - 40f64.sqrt().recip()).abs() < 1e-6, "{relative}");
    // By the logarithms of the variance half a standard error to either side, `2 ln(1 + d) - 2 ln(1 - d) = 4 atanh d`.
    let expected = 2.0 / (4.0 * (0.5 * relative).atanh()).powi(2);
    assert!((degrees / expected - 1.0).abs() < 1e-6, "{degrees} {expected}");
    // Student's t at 97.5 % with 20 degrees of freedom; differences over a standard error are good to 0.4 %.
    assert!((half / 2.085_963 - 1.0).abs() < 2e-3 && uneven, "{half}");
    let (relative, _, half, uneven, _) = width(free(0.2).log());
    assert!((half / relative / 2.022_691 - 1.0).abs() < 1e-6 && !uneven, "{half} {relative}");
}

/// Noise levels are seen through the variance of their own output alone, by each measurement as much as by any other.
#[test]
fn noise_levels_are_excited_by_the_measurements_of_their_output() {
    let mut noise = Noise(8);
    let measured = |k: usize, every: usize, y: f64| if k.is_multiple_of(every) { y } else { f64::NAN };
    let outputs = (0..40).map(|k| Sensors { y: measured(k, 2, 0.3 * noise.gauss()), z: 0.1 * noise.gauss() }).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 40], outputs).unwrap();
    let record = record.initial(Position { x: fixed(0.0) });
    let parameters = Levels { drift: fixed(0.0), y: free(0.2), z: free(0.2) };
    let problem = Fit::new(&RandomWalk, &record).parameters(parameters).predictor(Kalman).problem().unwrap();
    let found = diagnose::identifiability(&problem, &problem.run().unwrap()).unwrap();
    for (excited, (through, strength)) in found.excitation.iter().zip([([1.0, 0.0], 40f64), ([0.0, 1.0], 80.0)]) {
        let shares: Vec<f64> = excited.outputs.iter().map(|(_, share)| *share).collect();
        assert_eq!(shares, through, "{}", excited.name);
        // The information of `n` errors about the logarithm of their size is `2 n`.
        assert!((excited.strength / strength.sqrt() - 1.0).abs() < 1e-9, "{} {}", excited.name, excited.strength);
        assert_eq!(excited.segments.len(), 10);
        assert!(excited.segments.iter().all(|segment| (segment.share - 0.1).abs() < 1e-12), "{:?}", excited.segments);
    }
}

/// With up to twelve unknowns each has degrees of freedom of its own; with more all have those of the measurements.
#[test]
fn degrees_of_freedom_of_many_unknowns() {
    let of = |records: u64| {
        let record = |seed: u64| {
            let mut noise = Noise(seed);
            let outputs = (0..12).map(|_| Sensors { y: 0.3 * noise.gauss(), z: 0.1 * noise.gauss() }).collect();
            let time = Time::Uniform { start: 0.0, step: 1.0 };
            Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 12], outputs).unwrap()
        };
        let records: Vec<_> = (1..=records).map(record).collect();
        let parameters = Levels { drift: fixed(0.0), y: free(0.2), z: free(0.2) };
        let fit = Fit::new(&RandomWalk, &records).parameters(parameters).predictor(Kalman).run().unwrap();
        let left = fit.measurements as f64 - fit.unknowns.len() as f64;
        (fit.unknowns.len(), fit.unknowns.iter().filter(|unknown| unknown.degrees_of_freedom != left).count())
    };
    // Those of the two levels; the variance of an initial state depends on both.
    assert_eq!([of(10), of(11)], [(12, 12), (13, 0)]);
}

/// Normal noise under Huber's loss: noise levels come out right, to a percent of deviation each from 4,000 samples; without the factor
/// `kappa = E[psi(s) s]` of the logarithms of the variances they would be 13 % low.
#[test]
fn noise_levels_under_a_robust_loss() {
    let (truth, mut noise, mut x) = (Levels { drift: 0.1, y: 0.3, z: 0.5 }, Noise(11), 0.0);
    let mut measure = |_| {
        let seen = Sensors { y: x + truth.y * noise.gauss(), z: x + truth.z * noise.gauss() };
        x += truth.drift * noise.gauss();
        seen
    };
    let outputs: Vec<Sensors> = (0..4_000).map(&mut measure).collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&RandomWalk, time, vec![Push { u: 0.0 }; 4_000], outputs).unwrap();
    let record = record.initial(Position { x: fixed(0.0) });
    let start = Levels { drift: free(0.2), y: free(0.2), z: free(0.3) };
    let fit = || Fit::new(&RandomWalk, &record).parameters(Levels::map(start, Parameter::log)).predictor(Kalman);
    let plain = fit().run().unwrap();
    // A limit that no error reaches, and weights of one: the sandwich knows variances to a part of sqrt(14 / 4000), standard errors to 3 %.
    for same in [fit().loss(Huber(100.0)), fit().weighting(|_: &Sample<RandomWalk>| 1.0)] {
        let same = same.run().unwrap();
        assert_eq!(same.method.covariance, CovarianceMethod::Sandwich, "{same}");
        for (robust, classical) in same.unknowns.iter().zip(&plain.unknowns) {
            let ratio = [robust, classical].map(|unknown| unknown.knowledge.standard_error().unwrap());
            assert!((ratio[0] / ratio[1] - 1.0).abs() < 0.12, "{ratio:?}: {same}");
        }
    }
    assert!((plain.log_likelihood.unwrap() / plain.deviance.unwrap() + 0.5).abs() < 1e-12, "{plain}");
    let fit = fit().loss(Huber(1.345)).run().unwrap();
    let (mut expected, mut x, mut p) = (0.0, 0.0, 0.0);
    for seen in record.outputs() {
        for (y, sigma) in [(seen.y, fit.parameters.y), (seen.z, fit.parameters.z)] {
            let (error, variance): (f64, f64) = (y - x, p + sigma * sigma);
            expected -= Huber(1.345).rho(error / variance.sqrt()) + 0.5 * (TAU * variance).ln();
            (x, p) = (x + p / variance * error, p * sigma * sigma / variance);
        }
        p += fit.parameters.drift * fit.parameters.drift;
    }
    assert!((fit.log_likelihood.unwrap() / expected - 1.0).abs() < 1e-10, "{:?} {expected}", fit.log_likelihood);
    for (found, truth) in [(fit.parameters.y, truth.y), (fit.parameters.z, truth.z)] {
        // Four deviations.
        assert!((found / truth - 1.0).abs() < 0.05, "{found} for {truth}: {fit}");
    }
}

/// Records of all measurements, long enough that covariances come to an end: in segments of one record, by run-ins where the filter's memory is short (some two
/// samples), chained where it is longer (ten), and where it is so long (twenty) that the first segment ends before; and of eight records side by side. In some of them
/// one measurement is missing. Cost and gradient against the filter of each sample.
#[test]
fn covariances_that_settle() {
    let (tau, step) = (0.4, 0.02);
    for (drift, records, missing) in [(5.0, 1, 1), (0.1, 1, 0), (0.1, 1, 1), (0.02, 1, 0), (5.0, 8, 1), (0.1, 8, 1)] {
        let samples = 6_000 / records;
        let mut noise = Noise(17);
        let a = f64::exp(-step / tau);
        let spread = drift * f64::sqrt(tau / 2.0 * (1.0 - a * a));
        let one = |record: usize| {
            let (mut x, mut inputs, mut outputs) = (1.5, vec![], vec![]);
            for k in 0..samples {
                let u = if (k + 7 * record) % 170 < 80 { 1.0 } else { -0.5 };
                let (y, z) = (x + 0.3 * noise.gauss(), 2.0 * x + 0.5 * noise.gauss());
                outputs.push(Sensors { y: if missing == 1 && k == 2 * samples / 3 { f64::NAN } else { y }, z });
                inputs.push(Push { u });
                x = a * x + (1.0 - a) * 2.0 * u + spread * noise.gauss();
            }
            let time = Time::Uniform { start: 0.0, step };
            Experiment::new(&Lag, time, inputs, outputs).unwrap().initial(Position { x: fixed(1.4) })
        };
        let all: Vec<ExperimentOf<Lag>> = (0..records).map(one).collect();
        let parameters = Dynamics { tau: free(0.5).log(), drift: free(0.8 * drift).log(), ..dynamics() };
        let problem = Fit::new(&Lag, &all).parameters(parameters).predictor(Kalman).problem().unwrap();
        let objective = problem.objective().unwrap();
        let sum = |p: &[f64]| {
            let p: Vec<D> = p.iter().enumerate().map(|(j, p)| Dual::variable(*p, j)).collect();
            let (tau, gain, drift) = (p[0].exp(), p[1], p[2].exp());
            let a = (-tau.recip() * step).exp();
            let of = |record: &ExperimentOf<Lag>| {
                let q = drift * drift * tau * (-(a * a) + 1.0) * 0.5;
                let steps = record.inputs().take(record.len() - 1).map(|u| [a, gain * (-a + 1.0) * u.u, q]).collect();
                let measurements = measurements(record.outputs(), [1.0, 2.0], [p[3].exp(), p[4]]);
                Chain { start: D::from(1.4), steps, measurements }.by_filter()
            };
            all.iter().map(of).sum::<D>()
        };
        let constant = 0.5 * (records * (2 * samples - missing)) as f64 * TAU.ln();
        for change in [0.0, 1e-3, -0.05] {
            let at: Vec<f64> = objective.start().iter().map(|x| x * (1.0 + change)).collect();
            let exact = sum(&at);
            let found = objective.linearize(&at).unwrap();
            let in_values = objective.cost(&at).unwrap();
            // A covariance is taken for settled within 1e-10, which one sample in a thousand is off by.
            for cost in [found.cost, in_values] {
                assert!(((cost + constant) / exact.value - 1.0).abs() < 1e-12, "{} {}", cost + constant, exact.value);
            }
            // Terms of either sign: measured by their number.
            // The gradient, and the same by all rows, whose segments begin with the slopes that it has left.
            let (jacobian, residuals) = (objective.jacobian(&at).unwrap(), objective.apply(&at).unwrap());
            let by_rows = |j: usize| jacobian.iter().zip(&residuals).map(|(row, y)| row[j] * y).sum::<f64>();
            for (j, found) in objective.gradient(&at).unwrap().iter().enumerate() {
                for found in [*found, by_rows(j)] {
                    let exact = exact.slopes[j];
                    assert!((found - exact).abs() < 1e-10 * constant, "{drift} {records} {change}: {found} {exact}");
                }
            }
        }
    }
}
