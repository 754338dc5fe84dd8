//! `Numeric` models against the same equations with exact slopes, and the checks for users' own tests.

use crate::spiral::{Plane, Rates, Spiral};
use approx::assert_relative_eq;
use greybox::check::Disagreement;
use greybox::integrate::ModelSystem;
use greybox::*;
use std::f64::consts::PI;

signals! { pub struct State { x: "m", v: "m/s" } }
signals! { pub struct Force { u: "N" } }
signals! { pub struct Place { y: "m" } }
signals! { pub struct Spring { m: "kg", k: "N/m", d: "N s/m" } }

/// A spring that hardens, with friction: `m v' = u - k x (1 + x^2) - d tanh(v)`; the other two as plain functions.
struct Exact;

fn acceleration<S: Scalar>(x: &State<S>, u: &Force<S>, p: &Spring<S>) -> S {
    (u.u - p.k * x.x * (x.x * x.x + 1.0) - p.d * x.v.tanh()) / p.m
}

impl Model for Exact {
    type State = State;
    type Input = Force;
    type Output = Place;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &State<S>, u: &Force<S>, p: &Spring<S>) -> State<S> {
        State { x: x.v, v: acceleration(x, u, p) }
    }
    fn output<S: Scalar>(&self, t: S, x: &State<S>, u: &Force<S>, p: &Spring<S>) -> Place<S> {
        Place { y: x.x * t.cos() + (u.u / p.k).sin() }
    }
}

fn numeric() -> impl Model<State = State, Input = Force, Output = Place, Parameters = Spring> {
    Numeric::<State, Force, Place, Spring>::continuous(
        |_t, x, u, p| State { x: x.v, v: acceleration(x, u, p) },
        |t, x, u, p| Place { y: x.x * t.cos() + (u.u / p.k).sin() },
    )
}

/// `x`, `u` and `p` with slopes with respect to all six.
fn seeded(x: State, u: Force, p: Spring) -> (State<Dual<6>>, Force<Dual<6>>, Spring<Dual<6>>) {
    (
        State { x: Dual::variable(x.x, 0), v: Dual::variable(x.v, 1) },
        Force { u: Dual::variable(u.u, 2) },
        Spring { m: Dual::variable(p.m, 3), k: Dual::variable(p.k, 4), d: Dual::variable(p.d, 5) },
    )
}

fn assert_slopes(found: &[f64], exact: &[f64], sizes: &[f64]) {
    let largest = exact.iter().zip(sizes).fold(0.0f64, |m, (s, size)| m.max((s * size).abs()));
    for ((found, exact), size) in found.iter().zip(exact).zip(sizes) {
        assert_relative_eq!(found * size, exact * size, epsilon = 1e-9 * largest, max_relative = 1e-6);
    }
}

/// At 3e7 an absolute step of 6e-6 is wrong by 17 %, at 1e12 it vanishes, and at 1e-12 it is everything.
#[test]
fn slopes_at_parameters_of_every_magnitude() {
    let model = numeric();
    for magnitude in [1e-12, 1.0, 3e7, 1e12] {
        let p = Spring { m: 1.7 * magnitude, k: 3.1 * magnitude, d: 0.4 * magnitude };
        let (x, u) = (State { x: 0.3, v: -0.7 }, Force { u: 1.9 * magnitude });
        let (xs, us, ps) = seeded(x, u, p);
        let sizes = [1.0, 1.0, u.u, p.m, p.k, p.d];
        let (found, exact) = (model.derivative(0.4.into(), &xs, &us, &ps), Exact.derivative(0.4.into(), &xs, &us, &ps));
        assert_eq!((found.x.value, found.v.value), (x.v, acceleration(&x, &u, &p)));
        assert_slopes(&found.x.slopes, &exact.x.slopes, &sizes);
        assert_slopes(&found.v.slopes, &exact.v.slopes, &sizes);
        // An input far below one is stepped by more than itself, unless its size is said; here it enters a sine.
        if magnitude >= 1.0 {
            let (found, exact) = (model.output(0.4.into(), &xs, &us, &ps), Exact.output(0.4.into(), &xs, &us, &ps));
            assert_slopes(&found.y.slopes, &exact.y.slopes, &sizes);
        }
    }
}

#[test]
fn sizes_make_small_inputs_and_passing_zeros_accurate() {
    let tiny = 1e-12;
    let model = Numeric::<State, Force, Place, Spring>::continuous(
        |_t, x, u, p| State { x: x.v, v: acceleration(x, u, p) },
        |_t, x, u, p| Place { y: x.x + (u.u / p.k).sin() + p.d },
    )
    .sizes(State { x: 1.0, v: 1.0 }, Force { u: tiny }, Spring { m: 1.0, k: tiny, d: 1.0 });
    // d nearly zero, where a step of its own size would drown in the rounding of y.
    let (x, u, p) =
        seeded(State { x: 0.3, v: 0.0 }, Force { u: 1.9 * tiny }, Spring { m: 1.0, k: 3.1 * tiny, d: 1e-14 });
    let y = model.output(0.0.into(), &x, &u, &p).y;
    assert_relative_eq!(y.slopes[0], 1.0, max_relative = 1e-8);
    assert_relative_eq!(y.slopes[2], (1.9f64 / 3.1).cos() / (3.1 * tiny), max_relative = 1e-8);
    assert_relative_eq!(y.slopes[5], 1.0, max_relative = 1e-8);
    assert!(format!("{model:?}").contains("1e-12"));
}

#[test]
fn a_numeric_model_simulates_like_the_exact_one() {
    let (mut a, mut b) = (State { x: Dual::<6>::variable(0.3, 0), v: Dual::variable(0.0, 1) }, None);
    let (_, _, p) = seeded(State::default(), Force::default(), Spring { m: 2.0, k: 30.0, d: 0.5 });
    for k in 0..50 {
        let u0 = Force { u: (0.2 * k as f64).sin() };
        let interval = Interval { t0: 0.02 * k as f64, t1: 0.02 * (k + 1) as f64, u0, u1: u0, hold: Hold::Zero };
        b = Some(
            ModelSystem { model: &Exact, interval: &interval, p: &p }
                .step(&Rk4::default(), b.unwrap_or(a), &mut 0.0)
                .unwrap(),
        );
        a = ModelSystem { model: &numeric(), interval: &interval, p: &p }.step(&Rk4::default(), a, &mut 0.0).unwrap();
    }
    let b = b.unwrap();
    assert_relative_eq!(a.x.value, b.x.value, max_relative = 1e-13);
    for j in 0..6 {
        assert_relative_eq!(a.x.slopes[j], b.x.slopes[j], epsilon = 1e-8);
        assert_relative_eq!(a.v.slopes[j], b.v.slopes[j], epsilon = 1e-8);
    }
}

#[test]
fn discrete_and_static_numeric_models() {
    fn kind<M: Model>(_: &M) -> Kind {
        M::KIND
    }
    let discrete = Numeric::<Place, Force, Place, Spring>::discrete(
        |_t, x, u, p| Place { y: p.k * x.y + u.u },
        |_t, x, _u, _p| *x,
    );
    let p = Spring { m: Dual::constant(0.0), k: Dual::<1>::variable(0.9, 0), d: Dual::constant(0.0) };
    let next = discrete.next(0.0.into(), &Place { y: Dual::constant(2.0) }, &Force { u: Dual::constant(1.0) }, &p);
    assert_relative_eq!(next.y.value, 2.8);
    assert_relative_eq!(next.y.slopes[0], 2.0, max_relative = 1e-9);
    let curve = Numeric::<Nothing, Force, Place, Spring>::without_state(|_t, _x, u, p| Place { y: (u.u * p.k).sin() });
    let y = curve.output(0.0.into(), &Nothing, &Force { u: Dual::constant(2.0) }, &p).y;
    assert_relative_eq!(y.slopes[0], 2.0 * 1.8f64.cos(), max_relative = 1e-9);
    assert_eq!((kind(&numeric()), kind(&discrete), kind(&curve)), (Kind::Continuous, Kind::Discrete, Kind::Static));
    // No variable at all.
    let constant = Numeric::<Nothing, Nothing, Place, Nothing>::without_state(|_t, _x, _u, _p| Place { y: PI });
    assert_eq!(constant.output::<Dual<1>>(0.0.into(), &Nothing, &Nothing, &Nothing).y.value, PI);
    check::derivatives(&constant, 0.0, &Nothing, &Nothing, &Nothing).unwrap();
}

#[test]
fn right_slopes_are_confirmed() {
    for magnitude in [1e-12, 1.0, 3e7, 1e12] {
        let p = Spring { m: 1.7 * magnitude, k: 3.1 * magnitude, d: 0.4 * magnitude };
        let (x, u) = (State { x: 0.3, v: -0.7 }, Force { u: 1.9 * magnitude });
        check::derivatives(&Exact, 0.4, &x, &u, &p).unwrap();
    }
    let rest = State { x: 0.0, v: 0.0 };
    check::derivatives(&Exact, 0.4, &rest, &Force { u: 0.0 }, &Spring { m: 1.0, k: 1.0, d: 0.0 }).unwrap();
    let (x, p) = (Plane { x: 0.4, y: 0.2 }, Rates { growth: 1.0, turn: 2.0 });
    check::derivatives(&Spiral, 0.4, &x, &Nothing, &p).unwrap();
}

/// A value taken out of its scalar loses its slopes; the check names the function, the quantity and the variable.
#[test]
fn lost_slopes_are_found() {
    struct Lost;
    impl Model for Lost {
        type State = State;
        type Input = Force;
        type Output = Place;
        type Parameters = Spring;
        const KIND: Kind = Kind::Discrete;
        fn next<S: Scalar>(&self, _t: S, x: &State<S>, u: &Force<S>, p: &Spring<S>) -> State<S> {
            State { x: x.x + x.v, v: x.v + u.u / p.m.value() }
        }
        fn output<S: Scalar>(&self, _t: S, x: &State<S>, _u: &Force<S>, _p: &Spring<S>) -> Place<S> {
            Place { y: x.x }
        }
    }
    let p = Spring { m: 2.0, k: 1.0, d: 1.0 };
    let why = check::derivatives(&Lost, 0.0, &State { x: 1.0, v: 1.0 }, &Force { u: 3.0 }, &p).unwrap_err();
    let Disagreement::Slope { function, quantity, variable, exact, numeric } = why else { panic!("{why}") };
    assert_eq!((function, quantity, variable, exact), ("next", "v", "m", 0.0));
    assert_relative_eq!(numeric, -0.75, max_relative = 1e-8);
}

/// Of slopes that were lost, the changes are below rounding in the shorter steps: of a value that is hardly moved, and of one that is a
/// difference of large numbers.
#[test]
fn lost_slopes_are_found_where_shorter_steps_are_lost_in_rounding() {
    #[derive(Clone, Copy)]
    struct Weak(fn(f64) -> f64);
    impl Model for Weak {
        type State = State;
        type Input = Force;
        type Output = Place;
        type Parameters = Spring;
        fn derivative<S: Scalar>(&self, _t: S, x: &State<S>, _u: &Force<S>, _p: &Spring<S>) -> State<S> {
            *x
        }
        fn output<S: Scalar>(&self, _t: S, _x: &State<S>, _u: &Force<S>, p: &Spring<S>) -> Place<S> {
            Place { y: (self.0)(p.k.value()).into() }
        }
    }
    for (f, slope) in [(Weak(|k| 1.0 + 5e-8 * k), 5e-8), (Weak(|k| (1e8 + k) - 1e8), 1.0)] {
        let (x, p) = (State { x: 1.0, v: 1.0 }, Spring { m: 2.0, k: 1.0, d: 1.0 });
        let why = check::derivatives(&f, 0.0, &x, &Force { u: 3.0 }, &p).unwrap_err();
        let Disagreement::Slope { variable, exact, numeric, .. } = why else { panic!("{why}") };
        assert_eq!((variable, exact), ("k", 0.0));
        // The second value moves in steps of 1.5e-8, of which a difference over 1.2e-5 is off by one or two.
        assert_relative_eq!(numeric, slope, max_relative = 3e-3);
    }
}

/// A function that is not a number, with slopes that are not, agrees with nothing.
#[test]
fn what_is_not_a_number_is_not_confirmed() {
    let p = Spring { m: 0.0, k: 1.0, d: 1.0 };
    let x = State { x: 1.0, v: 1.0 };
    check::derivatives(&Exact, 0.0, &x, &Force { u: f64::NAN }, &p).unwrap_err();
}
