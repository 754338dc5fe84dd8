//! Duals: exact slopes against central differences and identities, and what `signals!` makes.

use approx::{assert_abs_diff_eq, assert_relative_eq, assert_relative_ne};
use greybox::nalgebra::{SVector, Vector2};
use greybox::{Dual, Kind, Model, Nothing, Of, Parameter, Scalar, Signals, Transform, fixed, free, signals};
use proptest::prelude::*;

/// Five-point difference with step h: off by h^4/30 of the fifth derivative and by rounding, 1.5e-16/h of the value.
fn difference(f: impl Fn(f64) -> f64, x: f64) -> f64 {
    let h = 1e-3 * f64::max(x.abs(), 0.1);
    (8.0 * (f(x + h) - f(x - h)) - (f(x + 2.0 * h) - f(x - 2.0 * h))) / (12.0 * h)
}

/// `x` with slopes 1 and -2 in the lanes of a wider number.
fn varied(x: f64) -> Dual<3> {
    Dual { value: x, slopes: [1.0, 0.0, -2.0] }
}

// Domains stay clear of the ends at which derivatives grow without bound; there 1e-8 is hundred times the difference's
// own error.
macro_rules! unary {
    ($($name:ident($($arg:expr),*) on $domain:expr;)*) => { mod unary { use super::*; $(
        proptest! {
            #[test]
            fn $name(x in $domain) {
                let y = Scalar::$name(varied(x) $(, $arg)*);
                let f = |x: f64| Scalar::$name(x $(, $arg)*);
                prop_assert_eq!(y.value, f(x));
                let slope = difference(f, x);
                assert_relative_eq!(y.slopes[0], slope, epsilon = 1e-8, max_relative = 1e-8);
                prop_assert_eq!((y.slopes[1], y.slopes[2]), (0.0, -2.0 * y.slopes[0]));
            }
        }
    )* } };
}
unary! {
    sqrt() on 0.1..50.0;
    cbrt() on 0.1..50.0;
    powi(3) on -5.0..5.0;
    powf(-1.7) on 0.2..9.0;
    exp() on -9.0..9.0;
    exp2() on -9.0..9.0;
    exp_m1() on -9.0..9.0;
    ln() on 0.1..50.0;
    ln_1p() on -0.8..50.0;
    log2() on 0.1..50.0;
    log10() on 0.1..50.0;
    sin() on -9.0..9.0;
    cos() on -9.0..9.0;
    tan() on -1.2..1.2;
    asin() on -0.8..0.8;
    acos() on -0.8..0.8;
    atan() on -9.0..9.0;
    sinh() on -9.0..9.0;
    cosh() on -9.0..9.0;
    tanh() on -9.0..9.0;
    asinh() on -9.0..9.0;
    acosh() on 1.2..9.0;
    atanh() on -0.8..0.8;
    recip() on 0.2..9.0;
    abs() on 0.1..9.0;
    fract() on 3.1..3.9;
    rem_euclid(0.7) on -1.35..-0.75;
    clamp(-3.0, 5.0) on -2.0..4.0;
}

macro_rules! binary {
    ($($name:ident: $f:expr, $x:expr, $y:expr;)*) => { mod binary { use super::*; $(
        proptest! {
            #[test]
            fn $name(x in $x, y in $y) {
                fn f<S: Scalar>(x: S, y: S) -> S { ($f)(x, y) }
                let z = f(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
                // A quotient multiplies by a reciprocal: one more rounding, of terms up to 9.
                assert_relative_eq!(z.value, f(x, y), epsilon = 2e-15, max_relative = 3e-16);
                assert_relative_eq!(z.slopes[0], difference(|x| f(x, y), x), epsilon = 1e-8, max_relative = 1e-8);
                assert_relative_eq!(z.slopes[1], difference(|y| f(x, y), y), epsilon = 1e-8, max_relative = 1e-8);
            }
        }
    )* } };
}
binary! {
    add: |x, y| x + y, -9.0..9.0, -9.0..9.0;
    sub: |x, y| x - y, -9.0..9.0, -9.0..9.0;
    mul: |x, y| x * y, -9.0..9.0, -9.0..9.0;
    div: |x, y| x / y, -9.0..9.0, 0.3..9.0;
    constants: |x: S, y: S| (x * 3.0 - 1.0) / 7.0 + (-y + 2.0), -9.0..9.0, -9.0..9.0;
    pow: |x: S, y: S| x.pow(y), 0.3..5.0, -3.0..3.0;
    atan2: |x: S, y: S| x.atan2(y), 0.3..5.0, -3.0..3.0;
    hypot: |x: S, y: S| x.hypot(y), 0.3..5.0, -3.0..3.0;
    mul_add: |x: S, y: S| x.mul_add(y, x), -9.0..9.0, -9.0..9.0;
    max: |x: S, y: S| x.max(y) * x, 1.0..2.0, 2.1..3.0;
    min: |x: S, y: S| x.min(y) * y, 1.0..2.0, 2.1..3.0;
    copysign: |x: S, y: S| x.copysign(y) * y, -3.0..-1.0, 1.0..3.0;
    chain: |x: S, y: S| x.chain(x.value() * x.value(), x.value() * 2.0) * y, -9.0..9.0, -9.0..9.0;
    sum: |x: S, y: S| [x, y, x * y].into_iter().sum::<S>(), -9.0..9.0, -9.0..9.0;
    assigned: |x: S, y: S| { let mut z = x; z += y; z *= x; z -= y; z /= x * x + 1.0; z += 1.0; z *= 3.0; z -= 2.0; z /= 4.0; z },
        -9.0..9.0, -9.0..9.0;
}

// Identities hold in value and slope; tolerances are some roundings of the largest term.
proptest! {
    #[test]
    fn identities(x in 0.05..3.0) {
        let d = varied(x);
        let same = |a: Dual<3>, b: Dual<3>, terms: f64| {
            let epsilon = 1e-14 * (1.0 + terms);
            assert_abs_diff_eq!(a.value, b.value, epsilon = epsilon);
            assert_abs_diff_eq!(a.slopes[0], b.slopes[0], epsilon = epsilon);
            assert_abs_diff_eq!(a.slopes[2], b.slopes[2], epsilon = 2.0 * epsilon);
        };
        let one = Dual::constant(1.0);
        let (sin, cos) = d.sin_cos();
        same(sin * sin + cos * cos, one, 1.0);
        same(sin, d.sin(), 1.0);
        same(cos, d.cos(), 1.0);
        same(d.exp().ln(), d, 10.0);
        same(d.exp_m1() + 1.0, d.exp(), 50.0);
        same((d + 1.0).ln(), d.ln_1p(), 10.0);
        same(d.exp2().log2(), d, 10.0);
        same(d.log10() * 10f64.ln(), d.ln(), 50.0);
        same(d.sqrt() * d.sqrt(), d, 10.0);
        same(d.cbrt().powi(3), d, 50.0);
        same(d.powi(3), d.powf(3.0), 100.0);
        same(d.pow(Dual::constant(2.5)), d.powf(2.5), 100.0);
        same(d.powf(0.5), d.sqrt(), 10.0);
        same(d.cosh() * d.cosh() - d.sinh() * d.sinh(), one, 500.0);
        same(d.sinh().asinh(), d, 50.0);
        same((d + 1.0).cosh().acosh(), d + 1.0, 500.0);
        same((d * 0.3).tanh().atanh(), d * 0.3, 50.0);
        same((d * 0.4).sin().asin() + (d * 0.4).sin().acos(), Dual::constant(std::f64::consts::FRAC_PI_2), 100.0);
        same((d * 0.4).tan().atan(), d * 0.4, 50.0);
        same(sin.atan2(cos), d, 10.0);
        same(d.hypot(d * 2.0), d * 5f64.sqrt(), 20.0);
        same(d.recip() * d, one, 500.0);
        same(d.floor() + d.fract(), d, 1.0);
        same(d.rem_euclid(0.7) + (d / 0.7).floor() * 0.7, d, 10.0);
        same(d.max(d * 2.0) + d.min(d * 2.0), d * 3.0, 10.0);
        same(d.mul_add(d, d), d * d + d, 50.0);
    }
}

#[test]
fn kinks_take_the_side_of_the_value() {
    let slope = |y: Dual<3>| y.slopes[0];
    assert_eq!((slope(varied(-2.0).abs()), slope(varied(2.0).abs())), (-1.0, 1.0));
    assert_eq!((slope(varied(0.0).abs()), slope(varied(-0.0).abs())), (1.0, -1.0));
    for x in [-2.5, -0.0, 0.0, 2.5] {
        let d = varied(x);
        for (y, f) in [
            (d.signum(), f64::signum(x)),
            (d.floor(), x.floor()),
            (d.ceil(), x.ceil()),
            (d.round(), x.round()),
            (d.trunc(), x.trunc()),
        ] {
            assert_eq!((y.value, y.slopes), (f, [0.0; 3]), "{x}");
        }
    }
    // At a tie, the first.
    assert_eq!(slope(varied(1.0).max(Dual::constant(1.0))), 1.0);
    assert_eq!(slope(Dual::constant(1.0).min(varied(1.0))), 0.0);
    assert_eq!((slope(varied(9.0).clamp(0.0, 5.0)), slope(varied(-9.0).clamp(0.0, 5.0))), (0.0, 0.0));
    // Limits out of order do not panic.
    assert_eq!(3.0.clamp(5.0, 0.0), 0.0);
    // As with f64, a number wins over what is none.
    assert_eq!(varied(1.0).max(Dual::constant(f64::NAN)).value, 1.0);
    assert_eq!(Dual::<3>::constant(f64::NAN).min(varied(1.0)).value, 1.0);
}

// Where a derivative is infinite, a quantity that does not vary still has slope zero, not 0 * inf.
#[test]
fn singular_points_give_no_nan_where_nothing_varies() {
    let zero = Dual::<2>::constant(0.0);
    let one = Dual::<2>::constant(1.0);
    for (name, y) in [
        ("sqrt 0", zero.sqrt()),
        ("cbrt 0", zero.cbrt()),
        ("ln 0", zero.ln()),
        ("ln_1p -1", (-one).ln_1p()),
        ("log2 0", zero.log2()),
        ("log10 0", zero.log10()),
        ("powf 0 0.5", zero.powf(0.5)),
        ("powf 0 -1", zero.powf(-1.0)),
        ("powf 0 0", zero.powf(0.0)),
        ("powi 0 -1", zero.powi(-1)),
        ("powi 0 0", zero.powi(0)),
        ("pow 0 0", zero.pow(zero)),
        ("pow 0 0.5", zero.pow(one * 0.5)),
        ("pow 0 -1", zero.pow(-one)),
        ("pow -2 3", (one * -2.0).pow(one * 3.0)),
        ("atan2 0 0", zero.atan2(zero)),
        ("hypot 0 0", zero.hypot(zero)),
        ("asin 1", one.asin()),
        ("acos -1", (-one).acos()),
        ("acosh 1", one.acosh()),
        ("atanh 1", one.atanh()),
        ("recip 0", zero.recip()),
        ("exp 800", (one * 800.0).exp()),
        ("exp2 2000", (one * 2000.0).exp2()),
        ("exp_m1 800", (one * 800.0).exp_m1()),
        ("sinh 800", (one * 800.0).sinh()),
        ("cosh 800", (one * 800.0).cosh()),
    ] {
        assert_eq!(y.slopes, [0.0; 2], "{name}");
        assert!(!y.value.is_nan(), "{name}");
    }
    // Only the lanes that vary see the infinity.
    let x = Dual::<2>::variable(0.0, 0);
    assert_eq!(x.sqrt().slopes, [f64::INFINITY, 0.0]);
    assert_eq!(x.ln().slopes, [f64::INFINITY, 0.0]);
    // The length of a motion through the origin grows as fast as the motion.
    assert_eq!((x * 3.0).hypot(x * 4.0).slopes, [5.0, 0.0]);
    // 0^n stays 0 when n moves; (-2)^3 moves with its base alone.
    assert_eq!(zero.pow(Dual::variable(2.0, 1)).slopes, [0.0; 2]);
    assert_eq!(Dual::<2>::variable(-2.0, 0).pow(one * 3.0).slopes, [12.0, 0.0]);
}

#[test]
fn numbers_compare_by_value() {
    let (a, b) = (Dual::<2>::variable(1.0, 0), Dual::<2>::variable(1.0, 1));
    assert!(a == b && a == 1.0 && a <= b && a < 2.0 && a + b > 1.5);
    assert!(Dual::<2>::constant(f64::NAN).partial_cmp(&a).is_none());
    assert_eq!(Dual::<2>::variable(1.0, 7).slopes, [0.0; 2]);
    assert_eq!(Dual::<2>::default().value, 0.0);
}

signals! {
    /// Stator currents.
    pub struct Currents {
        /// Along the flux.
        id: "A",
        /// Across it.
        iq: "A",
    }
    /// A single signal.
    pub struct Level { x: "m" }
}

#[test]
fn signals_know_names_units_and_order() {
    assert_eq!((<Currents as Signals>::LEN, Level::<f64>::NAMES, Level::<f64>::UNITS), (2, &["x"][..], &["m"][..]));
    assert_eq!((Currents::<f64>::NAMES, Currents::<f64>::UNITS), (&["id", "iq"][..], &["A", "A"][..]));
    assert_eq!((Currents::position("iq"), Currents::position("uq")), (Some(1), None));
    let i = <Currents as Signals>::from_fn(|k| k as f64 + 1.0);
    assert_eq!(i, Currents { id: 1.0, iq: 2.0 });
    assert_eq!(Currents::map(i, |x| x > 1.5), Currents { id: false, iq: true });
    assert_eq!(<Currents as Signals>::splat("A"), Currents { id: "A", iq: "A" });
    assert_eq!(Currents::into_array(i), [1.0, 2.0]);
    let x: Of<Level, Dual<1>> = Level { x: Dual::variable(2.0, 0) };
    assert_eq!(Level::map(x, |x| x.slopes[0]), Level { x: 1.0 });
    assert_eq!((Nothing::LEN, Nothing::NAMES.len(), <Nothing as Signals>::splat(1.0)), (0, 0, Nothing));
}

proptest! {
    #[test]
    fn signals_convert_both_ways(id in prop::num::f64::NORMAL, iq in prop::num::f64::NORMAL) {
        let i = Currents { id, iq };
        prop_assert_eq!(Currents::from(<[f64; 2]>::from(i)), i);
        prop_assert_eq!(SVector::<f64, 2>::from(i), Vector2::new(id, iq));
        prop_assert_eq!(Currents::from(Vector2::new(id, iq)), i);
        let text = serde_json::to_string(&i).unwrap();
        // serde_json reads numbers to the last bit but one.
        assert_relative_eq!(serde_json::from_str::<Currents>(&text).unwrap(), i, max_relative = 3e-16);
        let x = Level { x: id };
        prop_assert_eq!(Level::from([id]), x);
        let text = serde_json::to_string(&x).unwrap();
        assert_relative_eq!(serde_json::from_str::<Level>(&text).unwrap(), x, max_relative = 3e-16);
    }
}

#[test]
fn signals_are_maps_by_name() {
    assert_eq!(serde_json::to_string(&Currents { id: 1.5, iq: -2.0 }).unwrap(), r#"{"id":1.5,"iq":-2.0}"#);
    assert_eq!(serde_json::from_str::<Currents>(r#"{"iq":-2,"id":1}"#).unwrap(), Currents { id: 1.0, iq: -2.0 });
    let error = |text| serde_json::from_str::<Currents>(text).unwrap_err().to_string();
    assert!(error(r#"{"id":1,"iq":2,"i0":3}"#).contains("unknown field `i0`"));
    assert!(error(r#"{"id":1}"#).contains("missing field `iq`"));
    assert!(error(r#"{"id":1,"id":1,"iq":2}"#).contains("duplicate field `id`"));
    let guess = Currents { id: free(1.0).within(0.0, f64::INFINITY), iq: fixed(2.0) };
    let text = serde_json::to_string(&guess).unwrap();
    assert_eq!(serde_json::from_str::<Currents<Parameter>>(&text).unwrap(), guess);
    assert_eq!(serde_json::from_str::<Nothing>(&serde_json::to_string(&Nothing).unwrap()).unwrap(), Nothing);
}

#[test]
fn signals_compare_approximately() {
    let (a, b) = (Currents { id: 1.0, iq: 1e6 }, Currents { id: 1.0, iq: 1e6 + 1.0 });
    assert_relative_eq!(a, b, max_relative = 1e-5);
    assert_relative_ne!(a, b, max_relative = 1e-7);
    assert_abs_diff_eq!(a, b, epsilon = 1.5);
    assert!(!approx::abs_diff_eq!(a, b, epsilon = 0.5));
    assert!(!approx::abs_diff_eq!(Level { x: f64::NAN }, Level { x: f64::NAN }, epsilon = 1.0));
}

#[test]
fn parameters_say_all_they_are_told() {
    let p = free(0.4).within(0.1, 4.0).prior(0.5, 0.2).log().per_experiment();
    assert!(p.free && p.per_experiment && (p.lower, p.upper) == (0.1, 4.0));
    assert_eq!(serde_json::from_str::<Parameter>(&serde_json::to_string(&p).unwrap()).unwrap(), p);
    let text = serde_json::to_string(&fixed(3.0)).unwrap();
    assert!(text.contains(r#""lower":"-Infinity","upper":"Infinity""#), "{text}");
    assert_eq!(serde_json::from_str::<Parameter>(&text).unwrap(), fixed(3.0));
    let odd = text.replace("lower", "lowest");
    assert!(serde_json::from_str::<Parameter>(&odd).unwrap_err().to_string().contains("unknown field `lowest`"));
    for (transform, x) in [(Transform::Identity, -3.0), (Transform::Log, 3.0)] {
        assert_relative_eq!(transform.to_value(transform.to_coordinate(x)), x, max_relative = 1e-15);
        let slope = difference(|c| transform.to_value(c), transform.to_coordinate(x));
        assert_relative_eq!(transform.slope(x), slope, max_relative = 1e-8);
    }
}

/// A model that leaves its equations unwritten.
struct Blank(Level);

impl Model for Blank {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Nothing;

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Nothing) -> Level<S> {
        Level { x: x.x + self.0.x }
    }
}

#[test]
fn unwritten_equations_are_not_a_number() {
    let model = Blank(Level { x: 2.0 });
    assert_eq!(Blank::KIND, Kind::Continuous);
    assert!(model.derivative(0.0, &Level { x: 1.0 }, &Nothing, &Nothing).x.is_nan());
    assert!(model.next(0.0, &Level { x: 1.0 }, &Nothing, &Nothing).x.is_nan());
    assert_eq!(model.output(0.0, &Level { x: 1.0 }, &Nothing, &Nothing), Level { x: 3.0 });
}
