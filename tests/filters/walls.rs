//! Two walls that exchange heat, and all about them that is exact: transitions by the series of the matrix exponential, the likelihood by a
//! filter with full matrices. Of the library only numbers with slopes are used.

use crate::common::Noise;
use core::f64::consts::TAU;
use greybox::*;

signals! { pub struct Walls { a: "K", b: "K" } }
signals! { pub struct Heat { u: "W" } }
signals! { pub struct Probes { y: "K", z: "K" } }
signals! {
    pub struct Building { tau: "s", lose: "s", gain: "K/(W s)", q: "K/s^0.5", r: "K", p0: "K" }
}

/// Unknowns: the parameters by logarithm but `gain`, then the initial states.
pub type D = Dual<8>;
/// How long a discrete model steps (s).
pub const STEP: f64 = 0.1;

/// `da = ((b - a) / tau + gain u) dt + q dw`, `db = ((a - b) / (2 tau) - b / lose) dt + q/2 dv`, seen as `y = a + e` and `z = a + b + 2 e`; or
/// by Euler's steps of 0.1 s.
#[derive(Clone)]
pub struct Heated<const DISCRETE: bool>;

impl<const DISCRETE: bool> Model for Heated<DISCRETE> {
    type State = Walls;
    type Input = Heat;
    type Output = Probes;
    type Parameters = Building;
    const KIND: Kind = if DISCRETE { Kind::Discrete } else { Kind::Continuous };
    fn derivative<S: Scalar>(&self, _t: S, x: &Walls<S>, u: &Heat<S>, p: &Building<S>) -> Walls<S> {
        Walls { a: (x.b - x.a) / p.tau + p.gain * u.u, b: (x.a - x.b) / (p.tau * 2.0) - x.b / p.lose }
    }
    fn next<S: Scalar>(&self, t: S, x: &Walls<S>, u: &Heat<S>, p: &Building<S>) -> Walls<S> {
        let Walls { a, b } = self.derivative(t, x, u, p);
        Walls { a: x.a + a * STEP, b: x.b + b * STEP }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Walls<S>, _u: &Heat<S>, _p: &Building<S>) -> Probes<S> {
        Probes { y: x.a, z: x.a + x.b }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Walls<S>, _u: &Heat<S>, p: &Building<S>) -> Walls<S> {
        Walls { a: p.q, b: p.q * 0.5 }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Walls<S>, _u: &Heat<S>, p: &Building<S>) -> Probes<S> {
        Probes { y: p.r, z: p.r * 2.0 }
    }
    fn initial_noise<S: Scalar>(&self, p: &Building<S>) -> Walls<S> {
        Walls { a: p.p0, b: p.p0 * 0.5 }
    }
}

/// All free.
pub fn start() -> Building<Parameter> {
    let free = |start: f64| free(start).log();
    Building { tau: free(0.9), lose: free(2.0), gain: greybox::free(1.2), q: free(0.4), r: free(0.15), p0: free(0.5) }
}

/// A point away from the start.
pub const AT: [f64; 8] = [-0.2, 0.8, 1.1, -0.8, -1.8, -0.6, 0.3, -0.2];

/// Something like a record of the plant: `z` is there at each third sample, `y` not at each seventh.
pub fn record<const DISCRETE: bool>(time: Time, samples: usize) -> ExperimentOf<Heated<DISCRETE>> {
    let (mut noise, mut a, mut b) = (Noise(5), 0.5f64, -0.2f64);
    let (mut inputs, mut outputs) = (vec![], vec![]);
    for k in 0..samples {
        let u = [1.0, -0.5, 0.0, 2.0][k / 11 % 4];
        inputs.push(Heat { u });
        let (y, z) = (a + 0.15 * noise.gauss(), a + b + 0.3 * noise.gauss());
        let y = if k % 7 == 5 { f64::NAN } else { y };
        outputs.push(Probes { y, z: if k % 3 == 0 { z } else { f64::NAN } });
        let h = time.at(k + 1) - time.at(k);
        let (da, db) = ((b - a) / 0.8 + u, (a - b) / 1.6 - b / 2.5);
        a += h * da + 0.4 * h.sqrt() * noise.gauss();
        b += h * db + 0.2 * h.sqrt() * noise.gauss();
    }
    Experiment::new(&Heated::<DISCRETE>, time, inputs, outputs).unwrap()
}

pub type Matrix<S> = Vec<Vec<S>>;

pub fn zeros<S: Scalar>(rows: usize, columns: usize) -> Matrix<S> {
    vec![vec![S::from(0.0); columns]; rows]
}

pub fn times<S: Scalar>(a: &Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    let entry = |row: &Vec<S>, j: usize| row.iter().zip(b).map(|(a, b)| *a * b[j]).sum::<S>();
    a.iter().map(|row| (0..b[0].len()).map(|j| entry(row, j)).collect()).collect()
}

pub fn transposed<S: Scalar>(a: &Matrix<S>) -> Matrix<S> {
    (0..a[0].len()).map(|j| a.iter().map(|row| row[j]).collect()).collect()
}

pub fn plus<S: Scalar>(a: &Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a + *b).collect()).collect()
}

/// By 30 terms of the series, of a 256th of the matrix, squared eight times.
pub fn exponential<S: Scalar>(a: &Matrix<S>) -> Matrix<S> {
    let n = a.len();
    let a: Matrix<S> = a.iter().map(|row| row.iter().map(|entry| *entry * 256f64.recip()).collect()).collect();
    let identity = |i: usize| (0..n).map(|j| S::from(f64::from(u8::from(i == j)))).collect();
    let mut sum: Matrix<S> = (0..n).map(identity).collect();
    let mut term = sum.clone();
    for k in 1..30 {
        term = times(&term, &a).iter().map(|row| row.iter().map(|entry| *entry / f64::from(k)).collect()).collect();
        sum = plus(&sum, &term);
    }
    (0..8).for_each(|_| sum = times(&sum, &sum));
    sum
}

/// `x[k+1] = phi x[k] + gamma u[k] + w`, and the covariance of `w`.
#[derive(Clone)]
pub struct Step<S> {
    pub phi: Matrix<S>,
    pub gamma: Matrix<S>,
    pub noise: Matrix<S>,
}

/// Records of both kinds have one type.
pub type Record = ExperimentOf<Heated<false>>;

/// The plant at coordinates of the fit.
pub struct Plant<S> {
    pub discrete: bool,
    pub a: Matrix<S>,
    pub b: Matrix<S>,
    pub q: Matrix<S>,
    pub r: [S; 2],
    pub p0: Matrix<S>,
    pub x0: Matrix<S>,
}

fn diagonal<S: Scalar>(a: S, b: S) -> Matrix<S> {
    vec![vec![a * a, S::from(0.0)], vec![S::from(0.0), b * b]]
}

impl<S: Scalar> Plant<S> {
    pub fn new(at: &[S], discrete: bool) -> Self {
        let [tau, lose, q, r, p0] = [0, 1, 3, 4, 5].map(|i| at[i].exp());
        let exchange = tau.recip();
        Plant {
            discrete,
            a: vec![vec![-exchange, exchange], vec![exchange * 0.5, -(exchange * 0.5) - lose.recip()]],
            b: vec![vec![at[2]], vec![S::from(0.0)]],
            q: diagonal(q, q * 0.5),
            r: [r * r, r * r * 4.0],
            p0: diagonal(p0, p0 * 0.5),
            x0: vec![vec![at[6]], vec![at[7]]],
        }
    }

    /// Over `h` (s) with a held input; the covariance by Van Loan's block matrix.
    pub fn over(&self, h: f64) -> Step<S> {
        let mut with_input = zeros(3, 3);
        let mut block = zeros(4, 4);
        for i in 0..2 {
            with_input[i][2] = self.b[i][0] * h;
            for j in 0..2 {
                with_input[i][j] = self.a[i][j] * h;
                block[i][j] = -(self.a[i][j] * h);
                block[i][2 + j] = self.q[i][j] * h;
                block[2 + i][2 + j] = self.a[j][i] * h;
            }
        }
        let (moved, block) = (exponential(&with_input), exponential(&block));
        let part = |of: &Matrix<S>, i0: usize, j0: usize, columns: usize| -> Matrix<S> {
            (0..2).map(|i| of[i0 + i][j0..j0 + columns].to_vec()).collect()
        };
        let noise = times(&transposed(&part(&block, 2, 2, 2)), &part(&block, 0, 2, 2));
        Step { phi: part(&moved, 0, 0, 2), gamma: part(&moved, 0, 2, 1), noise }
    }

    /// By Euler's step.
    pub fn stepped(&self) -> Step<S> {
        let scaled = |of: &Matrix<S>| -> Matrix<S> {
            of.iter().map(|row| row.iter().map(|entry| *entry * STEP).collect()).collect()
        };
        Step {
            phi: plus(&scaled(&self.a), &diagonal(S::from(1.0), S::from(1.0))),
            gamma: scaled(&self.b),
            noise: self.q.clone(),
        }
    }

    /// The step after each sample but the last.
    pub fn steps(&self, record: &Record) -> Vec<Step<S>> {
        let mut known: Vec<(f64, Step<S>)> = vec![];
        let mut step = |k: usize| {
            let h = record.time(k + 1) - record.time(k);
            if let Some((_, step)) = known.iter().find(|(length, _)| *length == h) {
                return step.clone();
            }
            let step = if self.discrete { self.stepped() } else { self.over(h) };
            known.push((h, step.clone()));
            step
        };
        (0..record.len() - 1).map(&mut step).collect()
    }
}

/// The row of an output and its measurements, `y` then `z`.
pub const ROWS: [[f64; 2]; 2] = [[1.0, 0.0], [1.0, 1.0]];

/// `-ln` of the likelihood from a covariance at the first sample, outputs one by one.
pub fn likelihood<S: Scalar>(record: &Record, plant: &Plant<S>, covariance: Matrix<S>) -> S {
    let (mut x, mut p, mut sum) = (plant.x0.clone(), covariance, S::from(0.0));
    let steps = plant.steps(record);
    for (k, (u, probes)) in record.inputs().zip(record.outputs()).enumerate() {
        for (y, (row, r)) in [probes.y, probes.z].into_iter().zip(ROWS.iter().zip(plant.r)) {
            if y.is_nan() {
                continue;
            }
            let c: Matrix<S> = vec![row.iter().map(|entry| S::from(*entry)).collect()];
            let gain = times(&p, &transposed(&c));
            let (error, variance) = (S::from(y) - times(&c, &x)[0][0], times(&c, &gain)[0][0] + r);
            sum += (error * error / variance + (variance * TAU).ln()) * 0.5;
            for i in 0..2 {
                x[i][0] += gain[i][0] * error / variance;
            }
            let taken = |i: usize, j: usize| -(gain[i][0] * gain[j][0] / variance);
            let taken: Matrix<S> = (0..2).map(|i| (0..2).map(|j| taken(i, j)).collect()).collect();
            p = plus(&p, &taken);
        }
        let Some(Step { phi, gamma, noise }) = steps.get(k) else { continue };
        x = plus(&times(phi, &x), &times(gamma, &vec![vec![S::from(u.u)]]));
        p = plus(&times(&times(phi, &p), &transposed(phi)), noise);
    }
    sum
}
