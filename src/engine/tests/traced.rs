//! Models that are read: branches, loops, kinds, what cannot be read; and the models that the library has.

use super::steps::agrees;
use greybox::graph::{Function, Graph, Leaf, Symbol};
use greybox::models::{
    AxisMotion, AxisParameters, Command, ControlledAxisMotion, Positioning, PositioningLoop, Reference,
};
use greybox::pmsm::{
    AngledDrive, Cabled, Compensated, CompensatedDrive, CompensatedWinding, Currents, Drive, EmfHarmonic, ExactSalient,
    ExactStep, ExactSurface, FluxLinkage, FluxMapped, HeldIn, InverterFed, InverterFedWinding, Machine,
    MachineParameters, MachineState, MappedWinding, Mechanics, Misaligned, Salient, SalientWinding, Saturated,
    SaturatedWinding, Shaft, ShaftMotion, Surface, Torque, VoltageAndLoad, Winding,
};
use greybox::scalar::{Extrapolation, Interpolation};
use greybox::{Automatic, Hold, Kind, Model, Nothing, Rk4, Scalar, Signals, Table, equations::Equations, signals};

signals! {
    pub struct Pair { a: "1", b: "1" }
    pub struct Push { u: "1" }
    pub struct Gains { k: "1", d: "1" }
}

signals! {
    /// A salient motor with a harmonic in its EMF, its cable, and the size of its inverter's dead time.
    pub struct CompensatedSalientWinding { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", ke6: "V s/rad", vdt: "V" }
}

signals! {
    /// A motor with surface magnets, its magnet by flux linkage.
    pub struct FluxWinding { rs: "ohm", ls: "H", psi_m: "Wb" }
}

signals! {
    /// A salient motor behind cable and inverter, and how its record is aligned.
    pub struct Line {
        rs: "ohm", r_cable: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad",
    }
}

fn swing<U: Signals>(amplitudes: U::Of<f64>, n: usize) -> Vec<U::Of<f64>> {
    (0..n).map(|k| U::map(amplitudes, |a| a * (0.3 * k as f64 + 1.0).sin())).collect()
}

/// A model by its derivative or next state, to try many.
macro_rules! model {
    ($name:ident, $kind:expr, |$t:ident, $x:ident, $u:ident, $p:ident| $state:expr, $output:expr) => {
        struct $name;
        #[allow(unused_variables, reason = "not every model needs every quantity")]
        impl Model for $name {
            type State = Pair;
            type Input = Push;
            type Output = Pair;
            type Parameters = Gains;
            const KIND: Kind = $kind;
            fn derivative<S: Scalar>(&self, $t: S, $x: &Pair<S>, $u: &Push<S>, $p: &Gains<S>) -> Pair<S> {
                $state
            }
            fn next<S: Scalar>(&self, $t: S, $x: &Pair<S>, $u: &Push<S>, $p: &Gains<S>) -> Pair<S> {
                $state
            }
            fn output<S: Scalar>(&self, $t: S, $x: &Pair<S>, $u: &Push<S>, $p: &Gains<S>) -> Pair<S> {
                $output
            }
        }
    };
}

model! { Branches, Kind::Continuous, |_t, x, u, p| {
    // A square root whose argument is negative on the side that is not taken, and a loop that an answer ends.
    let flow = if x.a < 0.0 { S::from(0.0) } else { x.a.sqrt() };
    let mut rest = x.b;
    let mut turns = 0;
    while rest > 0.5 && turns < 3 {
        rest -= 0.5;
        turns += 1;
    }
    let force = if u.u > x.b && x.a <= 1.0 { p.k * rest } else { (x.b * x.b + 1.0).ln() };
    Pair { a: -flow * p.d + u.u, b: force - x.b.max(x.a * 0.2).min(p.d) }
}, Pair { a: x.a.abs(), b: x.b.clamp(-0.3, 0.4) } }

model! { Discrete, Kind::Discrete, |t, x, u, p| Pair { a: x.b, b: x.a * p.k + (t * 0.1).sin() - u.u * p.d },
Pair { a: x.a + u.u.exp(), b: t * p.k } }

model! { InputsThroughFunctions, Kind::Continuous, |t, x, u, p| {
    let shape = (u.u * 2.0 + t).sin() / (u.u * u.u + 1.0);
    Pair { a: shape * p.k - x.a, b: x.a * p.d - x.b.tanh() }
}, Pair { a: x.a, b: x.b } }

/// Each output is a function of input and parameters; no state.
struct Map;
impl Model for Map {
    type State = Nothing;
    type Input = Push;
    type Output = Pair;
    type Parameters = Gains;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Push<S>, p: &Gains<S>) -> Pair<S> {
        Pair { a: p.k * (-u.u * p.d).exp(), b: u.u.hypot(p.k) }
    }
}

#[test]
fn branches_and_kinds_run_as_they_are_written() {
    let (p, inputs) = (Gains { k: 0.7, d: 0.4 }, swing::<Push<f64>>(Push { u: 1.0 }, 80));
    for a in [-0.5, 0.01, 0.6, 1.4] {
        let start = Pair { a, b: 0.9 };
        agrees::<_, _, 4>(&Branches, &Rk4::default(), Hold::Zero, start, p, &inputs, 0.05);
        agrees::<_, _, 4>(&Branches, &Rk4 { substeps: 2 }, Hold::First, start, p, &inputs, 0.05);
        agrees::<_, _, 4>(&Discrete, &Automatic::default(), Hold::Zero, start, p, &inputs, 0.05);
        agrees::<_, _, 4>(&InputsThroughFunctions, &Rk4::default(), Hold::First, start, p, &inputs, 0.05);
    }
    agrees::<_, _, 2>(&Map, &Automatic::default(), Hold::Zero, Nothing, p, &inputs, 0.05);
}

#[test]
fn shipped_motors_run_on_lanes() {
    let rk4 = Rk4::default();
    let drive = swing::<Drive>(Drive { ud: 20.0, uq: 40.0, w: 100.0 }, 60);
    let i = Currents { id: 1.0, iq: -2.0 };
    let winding = Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
    agrees::<_, _, 5>(&Surface::new(4).unwrap(), &rk4, Hold::Zero, i, winding, &drive, 1e-4);
    let salient = SalientWinding { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95 };
    agrees::<_, _, 6>(&Salient::new(4).unwrap(), &rk4, Hold::First, i, salient, &drive, 1e-4);
    let saturated = SaturatedWinding {
        rs: 0.4,
        ld: 3.8e-3,
        lq: 4.2e-3,
        lq_saturated: 2e-3,
        lq_cross: -8e-6,
        i_saturation: 40.0,
        ke: 0.95,
    };
    agrees::<_, _, 9>(&Saturated::new(4).unwrap(), &rk4, Hold::Zero, i, saturated, &drive, 1e-4);
    let rotor = MachineParameters { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95, j: 0.012, bv: 4e-3, tc: 1.2, tg: 1.0 };
    let acting = swing::<VoltageAndLoad>(VoltageAndLoad { ud: 5.0, uq: 40.0, tau_l: 0.1 }, 60);
    let machine = Machine::new(4, 100.0).unwrap();
    let motion = MachineState::from([1.0, -2.0, 3.0, 0.1]);
    agrees::<_, _, 12>(&machine, &rk4, Hold::Zero, motion, rotor, &acting, 1e-4);
    let line =
        Line { rs: 0.4, r_cable: 0.23, ld: 3.8e-3, lq: 4.2e-3, ke: 0.95, vdt: 2.0, i0: 0.15, tau: 1e-5, delta: 0.01 };
    let angled = swing::<AngledDrive>(AngledDrive { ud: 20.0, uq: 40.0, w: 100.0, theta: 2.0 }, 60);
    agrees::<_, _, 11>(
        &Misaligned::<InverterFed<Cabled<Salient, Line>, Line>, Line>::new(InverterFed::new(Cabled::new(
            Salient::new(4).unwrap(),
        ))),
        &rk4,
        Hold::Zero,
        i,
        line,
        &angled,
        1e-4,
    );
    let shaft = Shaft::new(100.0).unwrap();
    let torque = swing::<Torque>(Torque::from([3.0]), 60);
    agrees::<_, _, 7>(
        &shaft,
        &rk4,
        Hold::Zero,
        ShaftMotion::from([0.1, 2.0]),
        Mechanics::from([0.01, 4e-3, 1.2, 1.0, 0.5]),
        &torque,
        1e-3,
    );
}

/// Currents that cross points of the maps and leave them, by a smooth map and by one with kinks.
#[test]
fn motors_with_flux_maps_run_on_lanes() {
    let (id, iq) = ([-12.0, -5.0, 0.0, 5.0, 12.0], [-12.0, -6.0, 0.0, 6.0, 12.0]);
    let over = |psi: fn(f64, f64) -> f64| -> Vec<f64> {
        id.iter().flat_map(|d| iq.iter().map(move |q| psi(*d, *q))).collect()
    };
    let drive: Vec<Drive> = (0..300)
        .map(|k| 0.05 * f64::from(k))
        .map(|a| Drive { ud: 15.0 * a.sin(), uq: 30.0 * (0.7 * a).cos(), w: 20.0 * (0.1 * a).sin() })
        .collect();
    let p = MappedWinding { rs: 0.6, ke: 0.9, flux: 1.1 };
    for between in [Interpolation::Smooth, Interpolation::Linear] {
        let map = |psi| Table::surface(&id, &iq, &over(psi), between, Extrapolation::Linear).unwrap();
        let map_d = map(|d, q| 4e-3 * d - 1e-6 * d * q * q);
        let map_q = map(|d, q| 0.06 * (q / 15.0).atan() - 1e-6 * q * d * d);
        let motor = FluxMapped::new(4, map_d, map_q).unwrap();
        for hold in [Hold::Zero, Hold::First] {
            let start = Currents { id: -9.0, iq: 7.0 };
            agrees::<_, _, 5>(&motor, &Rk4::default(), hold, start, p, &drive, 2e-4);
        }
    }
}

#[test]
fn exact_and_wrapped_motors_run_on_lanes() {
    let rk4 = Rk4::default();
    let drive = swing::<Drive>(Drive { ud: 20.0, uq: 40.0, w: 100.0 }, 60);
    let angled = swing::<AngledDrive>(AngledDrive { ud: 20.0, uq: 40.0, w: 100.0, theta: 2.0 }, 60);
    let i = Currents { id: 1.0, iq: -2.0 };
    let winding = Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
    let salient = SalientWinding { rs: 0.63, ld: 4e-3, lq: 5e-3, ke: 0.95 };
    for held in [HeldIn::Stationary, HeldIn::Rotor] {
        let step = ExactStep::new(4, 1e-4, held).unwrap();
        let exact = ExactSurface(step);
        agrees::<_, _, 5>(&exact, &Automatic::default(), Hold::Zero, i, winding, &drive, 1e-4);
        let lost = swing::<CompensatedDrive>(CompensatedDrive::from([20.0, 40.0, 100.0, 2.0, 0.9, -0.4]), 60);
        let p = CompensatedWinding::from([0.63, 4e-3, 0.95, 2.0]);
        agrees::<_, _, 6>(
            &Compensated::<_, CompensatedWinding>::new(ExactSurface(step)),
            &Automatic::default(),
            Hold::Zero,
            i,
            p,
            &lost,
            1e-4,
        );
        let p = InverterFedWinding::from([0.63, 4e-3, 0.95, 2.0, 0.15]);
        agrees::<_, _, 7>(
            &InverterFed::<_, InverterFedWinding>::new(ExactSurface(step)),
            &Automatic::default(),
            Hold::Zero,
            i,
            p,
            &angled,
            1e-4,
        );
    }
    let flux = FluxLinkage::<_, FluxWinding>::new(Surface::new(4).unwrap());
    agrees::<_, _, 5>(&flux, &rk4, Hold::Zero, i, FluxWinding { rs: 0.63, ls: 4e-3, psi_m: 0.19 }, &drive, 1e-4);
    let motor = ExactSalient(ExactStep::new(4, 1e-4, HeldIn::Stationary).unwrap());
    agrees::<_, _, 6>(&motor, &Automatic::default(), Hold::Zero, i, salient, &drive, 1e-4);
    let harmonic = EmfHarmonic::<_, CompensatedSalientWinding>::new(motor);
    let compensated = Compensated::<_, CompensatedSalientWinding>::new(harmonic);
    let lost = swing::<CompensatedDrive>(CompensatedDrive::from([20.0, 40.0, 100.0, 2.0, 0.9, -0.4]), 60);
    let p = CompensatedSalientWinding::from([0.63, 4e-3, 5e-3, 0.95, 0.01, 2.0]);
    agrees::<_, _, 8>(&compensated, &Automatic::default(), Hold::Zero, i, p, &lost, 1e-4);
}

#[test]
fn shipped_axes_run_on_lanes() {
    let rk4 = Rk4::default();
    let axis = AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 };
    let command = swing::<Command>(Command { vir: 2.0 }, 60);
    agrees::<_, _, 6>(&Positioning::EMPS, &rk4, Hold::Zero, AxisMotion { q: 0.1, v: 0.0 }, axis, &command, 1e-3);
    let reference = swing::<Reference>(Reference { qg: 0.1 }, 60);
    let start = ControlledAxisMotion { q: 0.1, v: 0.0, moved: 0.0, before: 0.0, held: 0.0 };
    agrees::<_, _, 9>(&PositioningLoop::EMPS, &rk4, Hold::First, start, axis, &reference, 1e-3);
}

model! { AsksForValues, Kind::Continuous, |_t, x, _u, _p| Pair { a: x.a * x.b.value(), b: x.b }, *x }
model! { Chains, Kind::Continuous, |_t, x, _u, _p| Pair { a: x.a.chain(1.0, 2.0), b: x.b }, *x }
model! { NeverEnds, Kind::Continuous, |_t, x, _u, p| {
    let mut a = x.a;
    while a > p.k {
        a *= 0.5;
    }
    Pair { a, b: x.b }
}, *x }
model! { TooManyPaths, Kind::Continuous, |_t, x, _u, p| {
    let mut sum = x.a;
    for i in 0..9 {
        if x.b * f64::from(i) > p.k {
            sum += 1.0;
        }
    }
    Pair { a: sum, b: x.b }
}, *x }
model! { Panics, Kind::Continuous, |_t, x, _u, _p| {
    assert!(x.a < 1.0, "far too large");
    *x
}, *x }

#[test]
fn what_cannot_be_read_is_told() {
    let reason = |result: Result<Equations, greybox::graph::Untraceable>| result.unwrap_err().to_string();
    assert_eq!(
        reason(Equations::trace(&AsksForValues)),
        "cannot be read as a graph: it asks a number for its value (`value()`)"
    );
    assert!(reason(Equations::trace(&Chains)).contains("`chain`"));
    assert!(reason(Equations::trace(&NeverEnds)).contains("48 open comparisons"));
    assert!(reason(Equations::trace(&TooManyPaths)).contains("64 paths"));
    assert!(reason(Equations::trace(&Panics)).contains("far too large"));
    // Nothing of a failed trace is left: symbols stand for nothing again, and the next trace is whole.
    let outside = Symbol::from(1.0) + Symbol::from(2.0);
    assert!(Graph::default().trace(|| vec![outside]).unwrap_err().reason.contains("kept from elsewhere"));
    assert!(Equations::trace(&Branches).is_ok());
}

#[test]
fn answers_follow_from_each_other() {
    let mut graph = Graph::default();
    let mut runs = 0;
    let roots = graph.trace(|| {
        runs += 1;
        let (x, y) = (Symbol::leaf(Leaf::State(0)), Symbol::leaf(Leaf::State(1)));
        // Not less and not greater: equal or not a number; asked twice, answered alike.
        let order = match x.partial_cmp(&y) {
            Some(std::cmp::Ordering::Less) => 1.0,
            Some(std::cmp::Ordering::Equal) => 2.0,
            Some(std::cmp::Ordering::Greater) => 3.0,
            None => 4.0,
        };
        let again = if x < y {
            10.0
        } else if x >= y {
            20.0
        } else {
            30.0
        };
        vec![Symbol::from(order + again)]
    });
    let roots = roots.unwrap();
    assert_eq!(runs, 4);
    for (x, y, expected) in [(0.0, 1.0, 11.0), (1.0, 1.0, 22.0), (2.0, 1.0, 23.0), (f64::NAN, 1.0, 34.0)] {
        let found = graph.evaluate(&roots, |leaf| if leaf == Leaf::State(0) { x } else { y });
        assert_eq!(found, [expected], "{x} and {y}");
    }
}

#[test]
fn values_keep_the_rounding_of_the_text() {
    let mut graph = Graph::default();
    let roots = graph.trace(|| {
        let (a, b) = (Symbol::leaf(Leaf::State(0)), Symbol::leaf(Leaf::State(1)));
        vec![(a * a - b * b).sqrt(), a * 0.0, a + 0.0, (a + b) - b, a.powi(3)]
    });
    let roots = roots.unwrap();
    for (a, b) in [(0.1, 0.1), (1.0 + f64::EPSILON, 1.0), (f64::INFINITY, 1.0), (-0.0, 1e300), (f64::NAN, 0.0)] {
        let found = graph.evaluate(&roots, |leaf| if leaf == Leaf::State(0) { a } else { b });
        let expected = [(a * a - b * b).sqrt(), a * 0.0, a + 0.0, (a + b) - b, a.powi(3)];
        for (found, expected) in found.iter().zip(expected) {
            assert!(found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(), "{found} {expected}");
        }
    }
}

#[test]
fn equations_know_whether_they_are_affine() {
    let surface = Equations::trace(&Surface::new(4).unwrap()).unwrap();
    assert!(surface.is_affine());
    assert!(!Equations::trace(&Branches).unwrap().is_affine());
    assert!(!Equations::trace(&Positioning::EMPS).unwrap().is_affine(), "friction");
    assert!(Equations::trace(&Discrete).unwrap().is_affine());
}

#[test]
fn equations_are_data() {
    for equations in [Equations::trace(&Surface::new(4).unwrap()), Equations::trace(&Branches)] {
        let equations = equations.unwrap();
        let json = serde_json::to_string(&equations).unwrap();
        assert_eq!(serde_json::from_str::<Equations>(&json).unwrap(), equations);
    }
    let mut graph = Graph::default();
    for x in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 0.1] {
        let x = graph.constant(x);
        graph.function(Function::Floor, x);
    }
    let json = serde_json::to_string(&graph).unwrap();
    assert_eq!(serde_json::from_str::<Graph>(&json).unwrap(), graph);
    assert!(
        serde_json::from_str::<Graph>(r#"{"nodes":[{"Neg":0}],"tables":[]}"#).is_err(),
        "an operand that does not come before"
    );
}

#[test]
fn equations_are_readable() {
    let text = Equations::trace(&Surface::new(4).unwrap()).unwrap().to_string();
    let expected = "\
_1 = w * 4.0
d(id)/dt = (ud - id * rs) / ls + iq * _1
d(iq)/dt = (uq - iq * rs - w * ke * 0.816496580927726) / ls - id * _1
output id = id
output iq = iq
";
    assert_eq!(text, expected);
}
