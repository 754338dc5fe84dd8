mod crossed;
mod late;
mod settling;

use super::*;
use crate::functions::Handle;
use crate::integrate::{Method, Rk4, automatic, exact};
use crate::model::Model;
use crate::predict::{FreeRun, Horizon, InitialCovariance, Kalman, Predictor};
use crate::record::{Channel, Column};
use crate::scalar::Scalar;
use crate::signals;
use crate::sweep::duals::Uncompiled;
use crate::sweep::{DualSweep, Evaluated, Typed, Window};

signals! {
    struct Angle { phi: "rad", w: "rad/s" }
    struct Torque { m: "N m" }
    struct Given { g: "1/s^2", d: "1/s", b: "1/kg", q: "1", r: "1" }
}

/// A pendulum that something moves, its linear relative, or that one with constant coefficients.
#[derive(Clone, Copy, PartialEq)]
enum Pendulum {
    Plain,
    Linear,
    Constant,
}

impl Model for Pendulum {
    type State = Angle;
    type Input = Torque;
    type Output = Angle;
    type Parameters = Given;
    fn derivative<S: Scalar>(&self, t: S, x: &Angle<S>, u: &Torque<S>, p: &Given<S>) -> Angle<S> {
        let pull = if *self == Pendulum::Plain { x.phi.sin() } else { x.phi };
        let moved = if *self == Pendulum::Constant { S::from(0.1) } else { (t * 3.0).sin() * 0.1 };
        Angle { phi: x.w, w: u.m * p.b - pull * p.g - x.w * p.d + moved }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Angle<S>, u: &Torque<S>, _p: &Given<S>) -> Angle<S> {
        Angle { phi: x.phi, w: x.w + u.m * 0.01 }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Angle<S>, _u: &Torque<S>, p: &Given<S>) -> Angle<S> {
        Angle { phi: S::from(0.0), w: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Angle<S>, _u: &Torque<S>, p: &Given<S>) -> Angle<S> {
        Angle { phi: p.r, w: p.r * 2.0 }
    }
}

/// Where time is not uniform, some samples are at the instant of the one before, with its inputs.
fn record(samples: usize, seed: f64, uniform: bool) -> Record {
    let instant = |k: usize| if !uniform && k % 9 == 4 { k - 1 } else { k };
    let column = |a: f64, at: &dyn Fn(usize) -> usize| {
        Column::from((0..samples).map(|k| (a * at(k) as f64 + seed).sin()).collect::<Vec<_>>())
    };
    let wave = |a: f64| column(a, &|k| k);
    let channel = |name: &str, values: Column| Channel { name: name.to_owned(), unit: "1".to_owned(), values };
    let missing = |mut values: Vec<f64>, every: usize| {
        values.iter_mut().skip(3).step_by(every).for_each(|y| *y = f64::NAN);
        Column::from(values)
    };
    let time = match uniform {
        true => Time::Uniform { start: 0.3, step: 0.02 },
        false => {
            let stamp = |k: f64| 0.02 * k + 0.005 * (k * 1.7).sin();
            Time::Stamps((0..samples).map(|k| stamp(instant(k) as f64)).collect())
        }
    };
    let outputs = vec![channel("phi", missing(wave(0.05).to_vec(), 7)), channel("w", missing(wave(0.07).to_vec(), 11))];
    let states = Layout::of::<Pendulum>().states;
    Record::new(states, time, vec![channel("m", column(0.11, &instant))], outputs).unwrap()
}

/// Rows of all samples by lane, measured or not: output by output, slopes, error and, if there is one, variance with its slopes.
fn rows(sweep: &dyn Sweep, pieces: &[Piece<'_>], seeds: &[Seed]) -> (Vec<Vec<f64>>, Vec<Reached>) {
    let mut all = vec![vec![]; pieces.len()];
    let reached = sweep.run(pieces, seeds, &mut |window: &mut Window| {
        for (lane, all) in all.iter_mut().enumerate().take(pieces.len()) {
            for k in 0..window.samples[lane] {
                for j in 0..window.outputs() {
                    all.push(f64::from(u8::from(window.is_measured(k, j, lane))));
                    all.extend((0..window.columns()).map(|c| window.at(k, j, c, lane)));
                    if window.has_variances() {
                        let row = window.variance_row(k, j);
                        all.extend((0..window.columns()).map(|c| row[c * window.lanes() + lane]));
                    }
                }
            }
        }
        true
    });
    (all, reached.into_iter().map(Result::unwrap).collect())
}

/// The model's own code in duals (its equations, where slopes are asked for that it does not have), its equations in duals, and programs.
fn sweeps<M: Model>(model: &M, predictor: impl Predictor, method: Arc<dyn Method>) -> [Arc<dyn Sweep + '_>; 3] {
    let predictor: Arc<dyn Prediction> = Arc::new(predictor);
    let equations = Arc::new(Equations::trace(model).unwrap());
    let duals = |code| -> Arc<dyn Sweep + '_> {
        let (layout, method, predictor) = (Arc::new(Layout::of::<M>()), method.clone(), predictor.clone());
        let uncompiled = Uncompiled::of(&equations, String::new());
        Arc::new(DualSweep { layout, code, method, predictor, uncompiled })
    };
    let evaluated = duals(Arc::new(Evaluated::new(equations.clone())));
    let typed = match predictor.needs_slopes() && !equations.is_affine() {
        true => evaluated.clone(),
        false => duals(Arc::new(Typed { model: Handle::Borrowed(model), loops: Some(Arc::new(Rk4::default())) })),
    };
    let programs = ProgramSweep::new(equations, method.clone(), predictor.clone(), typed.clone()).unwrap();
    [typed, evaluated, Arc::new(programs)]
}

/// Pieces of several records with different parameters, with slopes and without; the longest has windows after the first of every engine,
/// in which other samples are missing.
fn compare(model: &Pendulum, predictor: impl Predictor, uniform: bool, hold: Hold) {
    let method = if *model == Pendulum::Constant { exact() } else { automatic(1) };
    let [plain, evaluated, programs] = sweeps(model, predictor, method);
    let lengths = [300, 64, 2, 33, 197];
    let parameters = |i: usize| [2.0 + 0.1 * i as f64, 0.3, 1.5, 0.2, 0.1];
    let records: Vec<Record> = lengths.iter().map(|&n| record(n.max(40), n as f64, uniform).hold(hold)).collect();
    let all_p: Vec<[f64; 5]> = (0..lengths.len()).map(parameters).collect();
    let prepared: Vec<Prepared> = records.iter().zip(&all_p).map(|(r, p)| plain.prepare(r, p).unwrap()).collect();
    for seeds in
        [vec![], vec![Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(2), Seed::Parameter(3), Seed::Parameter(4)]]
    {
        let piece = |i: usize| {
            let start = |sweep: &dyn Sweep| sweep.start(&records[i], &[0.3, -0.2], &all_p[i]).unwrap();
            let Reached { carry, slopes: all } = start(&*plain);
            for other in [start(&*evaluated), start(&*programs)] {
                let pairs = |a: &[f64], b: &[f64], roundings: f64| {
                    for (a, b) in a.iter().zip(b) {
                        assert!((a - b).abs() < roundings, "start of record {i}: {a} {b}");
                    }
                };
                pairs(&carry, &other.carry, 1e-12);
                // Those of the covariance at rest are some hundred roundings of numbers up to ten, in a plant whose motion
                // decays by a tenth per radian; that of angle and speed is zero, its slopes are rounding alone.
                pairs(&all, &other.slopes, 1e-11);
            }
            let column = |seed: &Seed| match *seed {
                Seed::Carry(i) => i,
                Seed::Parameter(j) => 2 + j,
            };
            let row = |row: usize| seeds.iter().map(|seed| all[row * 7 + column(seed)]).collect::<Vec<f64>>();
            let (slopes, carry) = ((0..carry.len()).flat_map(row).collect(), carry.into());
            let (record, prepared, parameters) = (&records[i], &prepared[i], &all_p[i][..]);
            Piece { record, prepared, samples: 0..lengths[i], carry, slopes, parameters }
        };
        let pieces: Vec<Piece<'_>> = (0..lengths.len()).map(piece).collect();
        let lanes = programs.lanes(&records[0], &seeds);
        let all = |sweep: &dyn Sweep, lanes: usize| {
            let found: Vec<_> = pieces.chunks(lanes).map(|pieces| rows(sweep, pieces, &seeds)).collect();
            let (rows, reached): (Vec<_>, Vec<_>) = found.into_iter().unzip();
            (rows.concat(), reached.concat())
        };
        let (expected, ends) = all(&*plain, 1);
        let others = [all(&*evaluated, 1), all(&*programs, lanes)];
        for (lane, (found, reached)) in others.iter().flat_map(|other| (0..pieces.len()).map(move |lane| (lane, other)))
        {
            assert_eq!(expected[lane].len(), found[lane].len());
            for (at, (a, b)) in expected[lane].iter().zip(&found[lane]).enumerate() {
                // Hundreds of steps, each of some dozens of roundings of numbers up to ten.
                assert!((a - b).abs() < 1e-11, "{} seeds, lane {lane}, entry {at}: {a} {b}", seeds.len());
            }
            if pieces[lane].samples.end < pieces[lane].record.len() && programs.restarts().is_none() {
                let (a, b) = (&ends[lane], &reached[lane]);
                let pairs = a.carry.iter().zip(&b.carry).chain(a.slopes.iter().zip(&b.slopes));
                for (a, b) in pairs {
                    assert!((a - b).abs() < 1e-11, "{} seeds, end of lane {lane}: {a} {b}", seeds.len());
                }
            }
        }
    }
}

#[test]
fn programs_predict_what_duals_predict() {
    for hold in [Hold::Zero, Hold::First] {
        for uniform in [true, false] {
            compare(&Pendulum::Plain, FreeRun, uniform, hold);
            compare(&Pendulum::Linear, Kalman, uniform, hold);
            compare(&Pendulum::Constant, FreeRun, uniform, hold);
            compare(&Pendulum::Constant, Kalman, uniform, hold);
            compare(&Pendulum::Plain, Kalman, uniform, hold);
            for initial in [InitialCovariance::Stationary, InitialCovariance::FirstInterval] {
                compare(&Pendulum::Linear, Kalman::starting(initial), uniform, hold);
                compare(&Pendulum::Plain, Kalman::starting(initial), uniform, hold);
            }
        }
        compare(&Pendulum::Plain, Horizon::new(1), true, hold);
        compare(&Pendulum::Plain, Horizon::new(35), true, hold);
    }
}

/// The transition of linear equations is what steps of a 64th of the interval come to, by some 1e-13, with inputs that are held and that are
/// interpolated; slopes too.
#[test]
fn exact_transitions_are_what_fine_steps_come_to() {
    for hold in [Hold::Zero, Hold::First] {
        let record = record(150, 1.0, true).hold(hold);
        let p = [2.0, 0.3, 1.5, 0.2, 0.1];
        let seeds = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(2), Seed::Parameter(3), Seed::Parameter(4)];
        let by = |method: Arc<dyn Method>| {
            let [.., programs] = sweeps(&Pendulum::Constant, Kalman, method);
            let prepared = programs.prepare(&record, &p).unwrap();
            let (carry, slopes) = (vec![0.3, -0.2, 0.0, 0.0, 0.0].into(), vec![0.0; 5 * seeds.len()].into());
            rows(
                &*programs,
                &[Piece { record: &record, prepared: &prepared, samples: 0..150, carry, slopes, parameters: &p }],
                &seeds,
            )
            .0
        };
        for (exact, stepped) in by(exact()).concat().into_iter().zip(by(automatic(64)).concat()) {
            assert!((exact - stepped).abs() < 1e-11, "{hold:?}: {exact} {stepped}");
        }
    }
}

/// A plant whose columns are kept: time is not among them.
struct Cart;

impl Model for Cart {
    type State = Angle;
    type Input = Torque;
    type Output = Angle;
    type Parameters = Given;
    fn derivative<S: Scalar>(&self, _t: S, x: &Angle<S>, u: &Torque<S>, p: &Given<S>) -> Angle<S> {
        Angle { phi: x.w, w: u.m * p.b - x.phi * x.phi * p.g - x.w * p.d }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Angle<S>, u: &Torque<S>, _p: &Given<S>) -> Angle<S> {
        Angle { phi: x.phi, w: x.w + u.m * 0.01 }
    }
}

/// Columns that are kept from a pass are read again only by pieces of the same records at the same samples: same bits as
/// without any memory, whatever ran before.
#[test]
fn kept_columns_are_those_of_the_records_at_hand() {
    let [.., programs] = sweeps(&Cart, FreeRun, automatic(1));
    let first = record(300, 1.0, true);
    let with_other_output = {
        let outputs = record(300, 4.0, true).outputs().to_vec();
        Record::new(Layout::of::<Cart>().states, first.times().clone(), first.inputs().to_vec(), outputs).unwrap()
    };
    let (second, third) = (record(300, 2.0, true), record(170, 3.0, true));
    let p = [2.0, 0.3, 1.5, 0.2, 0.1];
    let seeds = [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(2)];
    let kept = Prepared::default();
    let run = |records: [&Record; 2], samples: std::ops::Range<usize>, seeds: &[Seed], first: &Prepared| {
        let other = Prepared::default();
        let piece = |(record, prepared)| Piece {
            record,
            prepared,
            samples: samples.clone(),
            carry: vec![0.3, -0.2].into(),
            slopes: vec![0.5; 2 * seeds.len()].into(),
            parameters: &p,
        };
        rows(&*programs, &[(records[0], first), (records[1], &other)].map(piece), seeds)
    };
    for (records, samples, seeds) in [
        ([&first, &second], 0..170, &seeds[..]),
        ([&first, &second], 0..170, &seeds[..]),
        ([&first, &third], 0..170, &seeds[..]),
        ([&first, &third], 0..170, &[]),
        ([&with_other_output, &third], 0..170, &[]),
        ([&with_other_output, &third], 0..170, &seeds[..]),
        ([&first, &second], 64..170, &seeds[..]),
        ([&first, &second], 0..150, &seeds[..]),
        ([&first, &second], 150..300, &seeds[..]),
    ] {
        let found = run(records, samples.clone(), seeds, &kept);
        assert_eq!(found, run(records, samples, seeds, &Prepared::default()));
    }
}
