//! Inputs with dead times: programs against dual numbers.

use super::*;

signals! {
    struct Forces { m: "N m", f: "N m", g: "N m" }
    struct Late { g: "1/s^2", b: "1/kg", r: "1", early: "s", late: "s" }
}

/// Pendulums, continuous and as a map, of two inputs that share a dead time, with one of another between them.
struct Continuous;
struct Discrete;

macro_rules! driven {
    ($name:ident, $kind:ident) => {
        impl Model for $name {
            type State = Angle;
            type Input = Forces;
            type Output = Angle;
            type Parameters = Late;
            const KIND: Kind = Kind::$kind;
            fn derivative<S: Scalar>(&self, t: S, x: &Angle<S>, u: &Forces<S>, p: &Late<S>) -> Angle<S> {
                let force = (u.m + u.f * u.f * 0.5 - u.g) * p.b;
                Angle { phi: x.w, w: force - x.phi.sin() * p.g - x.w * 0.3 + (t * 3.0).sin() * 0.1 }
            }
            fn next<S: Scalar>(&self, t: S, x: &Angle<S>, u: &Forces<S>, p: &Late<S>) -> Angle<S> {
                let rate = self.derivative(t, x, u, p);
                Angle { phi: x.phi + rate.phi * 0.02, w: x.w + rate.w * 0.02 }
            }
            fn output<S: Scalar>(&self, _t: S, x: &Angle<S>, u: &Forces<S>, _p: &Late<S>) -> Angle<S> {
                Angle { phi: x.phi, w: x.w + u.m.sin() * 0.01 + u.f * 0.02 }
            }
            fn delay<S: Scalar>(&self, p: &Late<S>) -> Forces<S> {
                Forces { m: p.late, f: p.early, g: p.late }
            }
            fn diffusion<S: Scalar>(&self, _t: S, _x: &Angle<S>, _u: &Forces<S>, _p: &Late<S>) -> Angle<S> {
                Angle { phi: S::from(0.0), w: S::from(0.1) }
            }
            fn noise<S: Scalar>(&self, _t: S, _x: &Angle<S>, _u: &Forces<S>, p: &Late<S>) -> Angle<S> {
                Angle { phi: p.r, w: p.r * 2.0 }
            }
        }
    };
}
driven! { Continuous, Continuous }
driven! { Discrete, Discrete }

const SEEDS: [Seed; 5] =
    [Seed::Carry(1), Seed::Parameter(0), Seed::Parameter(2), Seed::Parameter(3), Seed::Parameter(4)];
/// Time from sample to sample (s).
const STEP: f64 = 0.02;

/// Inputs that are waves, and outputs some of which are missing.
fn driven(samples: usize, holds: [Hold; 3]) -> Record {
    let of = record(samples, 1.0, true);
    let wave = |a: f64| Column::from((0..samples).map(|k| (a * k as f64 + 0.4).sin()).collect::<Vec<_>>());
    let inputs = [("m", 0.11), ("f", 0.23), ("g", 0.37)];
    let inputs = inputs.map(|(name, a)| Channel { name: name.to_owned(), unit: "1".to_owned(), values: wave(a) });
    let states = Layout::of::<Continuous>().states;
    let record = Record::new(states, of.times().clone(), inputs.to_vec(), of.outputs().to_vec()).unwrap();
    ["m", "f", "g"].into_iter().zip(holds).fold(record, |record, (name, hold)| record.hold_of(name, hold).unwrap())
}

/// Pieces with dead times of their own, in lanes side by side, from the begin and from within the record. Where an input does not move, which is
/// before the record, duals cross an interval by one step and programs by two or three. Their slopes with respect to a cut differ by some 1e-8
/// for steps of 0.02 (RK4: by the fourth power), in up to 150 intervals.
fn compare(model: &impl Model, predictor: impl Predictor, holds: [Hold; 3], late: [[f64; 2]; 5]) {
    let [plain, evaluated, programs] = sweeps(model, predictor, automatic(1));
    let record = driven(150, holds);
    let all_p = late.map(|[early, late]| [2.0, 1.5, 0.1, early * STEP, late * STEP]);
    for (begin, seeds) in [(0, &SEEDS[..]), (0, &[]), (70, &SEEDS[..])] {
        let prepared: Vec<Prepared> = all_p.iter().map(|p| plain.prepare(&record, p).unwrap()).collect();
        let piece = |(parameters, prepared)| {
            let Reached { carry, slopes } = plain.start(&record, &[0.3, -0.2], parameters).unwrap();
            let column = |seed: &Seed| match *seed {
                Seed::Carry(i) => i,
                Seed::Parameter(j) => 2 + j,
            };
            let row = |row: usize| seeds.iter().map(|seed| slopes[row * 7 + column(seed)]).collect::<Vec<f64>>();
            let slopes = (0..carry.len()).flat_map(row).collect();
            Piece { record: &record, prepared, samples: begin..150, carry: carry.into(), slopes, parameters }
        };
        let pieces: Vec<Piece<'_>> = all_p.iter().map(|p| &p[..]).zip(&prepared).map(piece).collect();
        let all = |sweep: &dyn Sweep, lanes: usize| -> Vec<Vec<f64>> {
            pieces.chunks(lanes).flat_map(|pieces| rows(sweep, pieces, seeds).0).collect()
        };
        let lanes = programs.lanes(&record, seeds);
        assert!(programs.engine().starts_with("read as a graph"), "{}", programs.engine());
        let expected = all(&*plain, 1);
        for found in [all(&*evaluated, 1), all(&*programs, lanes)] {
            for (p, (expected, found)) in all_p.iter().zip(expected.iter().zip(&found)) {
                assert_eq!(expected.len(), found.len());
                for (at, (a, b)) in expected.iter().zip(found).enumerate() {
                    assert!((a - b).abs() < 5e-6, "{holds:?} {p:?} from {begin}, entry {at}: {a} {b}");
                }
            }
        }
    }
}

/// Both dead times zero, at one place between samples, whole, in either order, longer than the record.
const LATE: [[f64; 2]; 5] = [[0.0, 0.0], [0.37, 0.37], [2.0, 1.6], [1.2, 5.7], [500.0, 3.5]];

#[test]
fn late_inputs_that_are_held() {
    compare(&Continuous, FreeRun, [Hold::Zero; 3], LATE);
    compare(&Discrete, FreeRun, [Hold::Zero; 3], LATE);
}

/// Of two cuts at one place the order is that of dead times in programs, that of inputs in duals; the steps between differ, and where inputs
/// are interpolated, so do slopes by the error of a step. Here cuts are apart.
#[test]
fn late_inputs_that_are_interpolated() {
    let (zero, first) = (Hold::Zero, Hold::First);
    let late = [[0.0, 0.45], [0.37, 0.81], [2.0, 1.6], [1.2, 5.7], [500.0, 3.5]];
    for holds in [[first; 3], [zero, first, first]] {
        compare(&Continuous, FreeRun, holds, late);
        compare(&Discrete, FreeRun, holds, late);
    }
    compare(&Continuous, Kalman, [first, zero, zero], late);
    compare(&Continuous, Horizon::new(5), [zero, first, zero], late);
}

/// A dead time that cannot be gives no number; samples that are not evenly spaced are run in dual numbers, and that is said.
#[test]
fn what_programs_refuse() {
    let [.., programs] = sweeps(&Continuous, FreeRun, automatic(1));
    let record = driven(40, [Hold::Zero; 3]);
    let prepared = Prepared::default();
    let run = |record: &Record, late: f64| {
        let parameters = &[2.0, 1.5, 0.1, 0.0, late];
        let (carry, slopes) = (vec![0.3, -0.2].into(), vec![].into());
        let piece = Piece { record, prepared: &prepared, samples: 0..40, carry, slopes, parameters };
        rows(&*programs, &[piece], &[]).0
    };
    for late in [-0.01, f64::NAN, f64::INFINITY] {
        // Measured or not, and the error, of each output.
        assert!(run(&record, late)[0].chunks(2).skip(2).all(|pair| pair[0] == 0.0 || pair[1].is_nan()), "{late}");
    }
    assert!(!programs.engine().contains("dual numbers"), "{}", programs.engine());
    let stamps = Time::Stamps((0..40).map(|k| 0.02 * f64::from(k) + 0.001 * f64::from(k % 3)).collect());
    let uneven =
        Record::new(Layout::of::<Continuous>().states, stamps, record.inputs().to_vec(), record.outputs().to_vec());
    assert!(run(&uneven.unwrap(), 0.03)[0].iter().all(|number| number.is_finite()));
    assert!(programs.engine().contains("samples are not evenly spaced"), "{}", programs.engine());
}
