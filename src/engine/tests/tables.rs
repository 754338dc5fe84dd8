//! Look-up tables: between points, at them and beyond, by themselves, on duals and in programs.

use super::steps::agrees;
use greybox::{
    Dual, Hold, Model, Rk4, Scalar, Table,
    equations::Equations,
    scalar::{Extrapolation, Grid, Interpolation, TableError},
    signals,
};

const X: [f64; 5] = [-1.0, 0.0, 0.5, 2.0, 3.0];
const Y: [f64; 3] = [0.0, 1.0, 4.0];
const CURVE: [f64; 5] = [2.0, 1.0, 1.5, -1.0, 0.25];
const WAYS: [(Interpolation, Extrapolation); 4] = [
    (Interpolation::Linear, Extrapolation::Hold),
    (Interpolation::Linear, Extrapolation::Linear),
    (Interpolation::Smooth, Extrapolation::Hold),
    (Interpolation::Smooth, Extrapolation::Linear),
];

fn surface() -> Vec<f64> {
    X.iter().flat_map(|x| Y.map(|y| (x * 0.7).sin() + 0.3 * x * y - 0.1 * y * y)).collect()
}

#[test]
fn points_keep_their_values_and_slopes_are_those_of_the_interval_above() {
    for (between, beyond) in WAYS {
        let grid = Grid::curve(&X, &CURVE, between, beyond).unwrap();
        for (x, value) in X.iter().zip(CURVE) {
            assert_eq!(grid.at(*x), value);
        }
        let values = surface();
        let grid = Grid::surface(&X, &Y, &values, between, beyond).unwrap();
        for (i, x) in X.iter().enumerate() {
            for (j, y) in Y.iter().enumerate() {
                assert_eq!(grid.at2(*x, *y), values[i * 3 + j]);
            }
        }
    }
    let grid = Grid::curve(&X, &CURVE, Interpolation::Linear, Extrapolation::Hold).unwrap();
    let slope = |x: f64| grid.at(Dual::<1>::variable(x, 0)).slopes[0];
    assert_eq!([slope(-2.0), slope(-1.0), slope(0.0), slope(3.0), slope(3.5)], [0.0, -1.0, 1.0, 1.25, 0.0]);
    assert!(grid.at(f64::NAN).is_nan() && grid.at2(f64::NAN, 0.0).is_nan());
    assert_eq!((grid.at(-1e300), grid.at(f64::INFINITY)), (2.0, 0.25));
}

/// Slopes, and slopes of slopes, against differences; and both are continuous where they are said to be.
#[test]
fn slopes_are_those_of_the_values() {
    let values = surface();
    for (between, beyond) in WAYS {
        for grid in [
            Grid::curve(&X, &CURVE, between, beyond).unwrap(),
            Grid::surface(&X, &Y, &values, between, beyond).unwrap(),
        ] {
            for k in 0..60 {
                // Off the points.
                let (x, y) = (-1.73 + 0.0917 * f64::from(k), -0.41 + 0.0811 * f64::from(k));
                let at = |x: f64, y: f64| grid.at2(x, y);
                let dual = grid.at2(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
                let h = 1e-6;
                let differences = [(at(x + h, y) - at(x - h, y)) / 2e-6, (at(x, y + h) - at(x, y - h)) / 2e-6];
                // Differences are right to h^2 and to rounding over h.
                for (slope, difference) in dual.slopes.iter().zip(differences) {
                    assert!((slope - difference).abs() < 1e-8, "{slope} {difference}");
                }
                let second = grid.at2(
                    Dual::<2, Dual<2>>::variable(Dual::variable(x, 0), 0),
                    Dual::variable(Dual::variable(y, 1), 1),
                );
                let slope = |x: f64, y: f64| grid.at2(Dual::<2>::variable(x, 0), Dual::variable(y, 1)).slopes;
                for i in 0..2 {
                    let by_x = (slope(x + h, y)[i] - slope(x - h, y)[i]) / 2e-6;
                    let by_y = (slope(x, y + h)[i] - slope(x, y - h)[i]) / 2e-6;
                    let [xx, xy] = second.slopes[i].slopes;
                    assert!((xx - by_x).abs() < 1e-7 && (xy - by_y).abs() < 1e-7, "{second:?} {by_x} {by_y}");
                }
            }
            if between == Interpolation::Smooth {
                for x in &X[1..4] {
                    let slope = |x: f64| grid.at2(Dual::<1>::variable(x, 0), Dual::constant(0.7)).slopes[0];
                    assert!((slope(x - 1e-9) - slope(*x)).abs() < 1e-7, "at {x}");
                }
            }
        }
    }
}

/// A parabola is its own cubic, everywhere and with its slopes, on uneven points; two points make a line.
#[test]
fn a_parabola_is_met_exactly() {
    let f = |x: f64| 3.0 - 2.0 * x + 0.5 * x * x;
    let grid = X.map(f);
    let grid = Grid::curve(&X, &grid, Interpolation::Smooth, Extrapolation::Linear).unwrap();
    for k in 0..=80 {
        let x = -1.0 + 0.05 * f64::from(k);
        let dual = grid.at(Dual::<1>::variable(x, 0));
        // A dozen roundings on numbers below ten.
        assert!((dual.value - f(x)).abs() < 1e-14 && (dual.slopes[0] - (x - 2.0)).abs() < 1e-13, "{x}: {dual:?}");
    }
    assert!((grid.at(4.0) - (f(3.0) + 1.0)).abs() < 1e-14, "beyond, the line");
    let line = Grid::curve(&[1.0, 3.0], &[2.0, 6.0], Interpolation::Smooth, Extrapolation::Linear).unwrap();
    assert_eq!([line.at(1.0), line.at(2.0), line.at(5.0)], [2.0, 4.0, 10.0]);
}

#[test]
fn what_is_no_table_is_told() {
    let curve = |x: &[f64], y: &[f64]| Grid::curve(x, y, Interpolation::Linear, Extrapolation::Hold).unwrap_err();
    assert_eq!(curve(&[1.0], &[1.0]), TableError::TooShort(1));
    assert_eq!(curve(&[1.0, 1.0], &[1.0, 2.0]), TableError::NotRising { index: 1, value: 1.0 });
    assert!(matches!(curve(&[f64::NAN, 1.0], &[1.0, 2.0]), TableError::NotRising { index: 0, .. }));
    assert_eq!(curve(&[0.0, 1.0], &[1.0]), TableError::Count { expected: 2, found: 1 });
    assert!(matches!(curve(&[0.0, 1.0], &[1.0, f64::INFINITY]), TableError::NotFinite { index: 1, .. }));
    let text = r#"{"x":[0.0,0.0],"y":[],"values":[1.0,2.0],"interpolation":"Linear","extrapolation":"Hold"}"#;
    assert!(serde_json::from_str::<Table>(text).unwrap_err().to_string().contains("not above"));
}

signals! {
    pub struct Flux { d: "Wb", q: "Wb" }
    pub struct Volts { u: "V" }
    pub struct Coil { r: "ohm", scale: "1" }
}

/// A machine whose currents are tables of its fluxes.
pub struct Mapped {
    curve: Table,
    surface: Table,
}

impl Mapped {
    pub fn new(between: Interpolation, beyond: Extrapolation) -> Self {
        Mapped {
            curve: Table::curve(&X, &CURVE, between, beyond).unwrap(),
            surface: Table::surface(&X, &Y, &surface(), between, beyond).unwrap(),
        }
    }
}

impl Model for Mapped {
    type State = Flux;
    type Input = Volts;
    type Output = Flux;
    type Parameters = Coil;

    fn derivative<S: Scalar>(&self, _t: S, x: &Flux<S>, u: &Volts<S>, p: &Coil<S>) -> Flux<S> {
        let i = self.surface.at2(x.d * p.scale, x.q);
        Flux { d: u.u - p.r * i, q: self.curve.at(x.q * p.scale) - self.curve.at(u.u) - x.q }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Flux<S>, _u: &Volts<S>, _p: &Coil<S>) -> Flux<S> {
        Flux { d: self.curve.at(x.d), q: x.q }
    }
}

#[test]
fn tables_run_on_lanes() {
    let inputs: Vec<_> = (0..80).map(|k| Volts { u: 3.0 * (0.2 * f64::from(k)).sin() }).collect();
    for (between, beyond) in WAYS {
        let model = Mapped::new(between, beyond);
        for start in [Flux { d: 0.0, q: 0.5 }, Flux { d: 2.0, q: 1.0 }, Flux { d: -1.0, q: 5.0 }] {
            let p = Coil { r: 1.0, scale: 1.0 };
            agrees::<_, _, 4>(&model, &Rk4::default(), Hold::First, start, p, &inputs, 0.05);
        }
        let equations = Equations::trace(&model).unwrap();
        assert_eq!(equations.graph().tables().len(), 2);
        assert!(!equations.is_affine());
        let json = serde_json::to_string(&equations).unwrap();
        assert_eq!(serde_json::from_str::<Equations>(&json).unwrap(), equations);
        assert!(equations.to_string().contains("output d = table"), "{equations}");
    }
}
