//! More plants: with states that no output gives, without inputs, static curves.

use crate::plants::*;
use greybox::{Kind, Model, Nothing, Scalar, signals};

signals! { pub struct Overvoltage { v: "V" } }
signals! { pub struct Amperes { i: "A" } }
signals! { pub struct Cell { r0: "ohm", r1: "ohm", c1: "F", e: "V" } }
signals! { pub struct Animals { prey: "1", predators: "1" } }
signals! { pub struct Rates { a: "1/s", b: "1/s", c: "1/s", d: "1/s" } }
signals! { pub struct Vat { c: "mol/l", t: "K" } }
signals! { pub struct Feed { q: "1/s", tc: "K" } }
signals! { pub struct Kinetics { k: "1/s", e: "K", h: "K l/mol", w: "1/s" } }
signals! { pub struct Lateral { v: "m/s", r: "rad/s" } }
signals! { pub struct Yaw { r: "rad/s" } }
signals! { pub struct Steering { angle: "rad" } }
signals! { pub struct Tires { cf: "N/rad", cr: "N/rad", iz: "kg m^2" } }
signals! { pub struct Resonance { w: "rad/s", q: "1" } }
signals! { pub struct Angle { a: "rad", w: "rad/s" } }
signals! { pub struct Seen { a: "rad" } }
signals! { pub struct Swing { g: "1/s^2", d: "1/s" } }
signals! { pub struct Rooms { air: "K", wall: "K" } }
signals! { pub struct Air { air: "K" } }
signals! { pub struct Weather { heat: "kW", outside: "K" } }
signals! { pub struct Building { ca: "kWh/K", cw: "kWh/K", h: "kW/K", u: "kW/K" } }
signals! { pub struct Growth { rate: "1/s", limit: "1" } }
signals! { pub struct Enzyme { vmax: "1", km: "1" } }
signals! { pub struct Wave { a: "1", b: "1", w: "rad/s", c: "1" } }
signals! { pub struct Decay { a: "1", tau: "s", c: "1" } }
signals! { pub struct Levels { h1: "m", h2: "m" } }
signals! { pub struct Lower { h2: "m" } }
signals! { pub struct Outlets { c1: "m^2/s", c2: "m^2/s" } }
signals! { pub struct Broth { cells: "g/l", sugar: "g/l" } }
signals! { pub struct Flow { dilution: "1/h", sugar: "g/l" } }
signals! { pub struct Monod { rate: "1/h", half: "g/l", gained: "1" } }
signals! { pub struct Drug { gut: "mg", blood: "mg", tissue: "mg" } }
signals! { pub struct Dose { rate: "mg/h" } }
signals! { pub struct Blood { blood: "mg" } }
signals! { pub struct Transfer { absorbed: "1/h", lost: "1/h", to: "1/h", back: "1/h" } }
signals! { pub struct Piston { pressure: "MPa", speed: "m/s" } }
signals! { pub struct Oil { flow: "1/s", leak: "1/s", area: "m/s^2/MPa", friction: "1/s" } }

/// A model by its kind, its signals and two expressions.
macro_rules! process {
    ($(#[$doc:meta])* $name:ident, $kind:ident, [$x:ty, $u:ty, $y:ty, $p:ty], |$xs:ident, $us:ident, $ps:ident, $t:ident|
     $state:expr, $output:expr) => {
        $(#[$doc])*
        #[derive(Clone)]
        pub struct $name;
        impl Model for $name {
            type State = $x;
            type Input = $u;
            type Output = $y;
            type Parameters = $p;
            const KIND: Kind = Kind::$kind;
            #[allow(unused_variables, reason = "not every process uses all")]
            fn derivative<S: Scalar>(&self, $t: S, $xs: &greybox::Of<$x, S>, $us: &greybox::Of<$u, S>, $ps: &greybox::Of<$p, S>)
                -> greybox::Of<$x, S> { $state }
            #[allow(unused_variables, reason = "not every process uses all")]
            fn output<S: Scalar>(&self, $t: S, $xs: &greybox::Of<$x, S>, $us: &greybox::Of<$u, S>, $ps: &greybox::Of<$p, S>)
                -> greybox::Of<$y, S> { $output }
        }
    };
}
process!(
    /// A battery: a source with a resistance, and a resistance beside a capacitor whose voltage nobody measures.
    Battery, Continuous, [Overvoltage, Amperes, Level, Cell],
    |x, u, p, t| Overvoltage { v: (u.i - x.v / p.r1) / p.c1 },
    Level { y: p.e - p.r0 * u.i - x.v }
);
process!(
    /// Lotka and Volterra's, both counted.
    PredatorPrey, Continuous, [Animals, Nothing, Animals, Rates],
    |x, u, p, t| {
        let met = x.prey * x.predators;
        Animals { prey: p.a * x.prey - p.b * met, predators: p.c * met - p.d * x.predators }
    },
    *x
);
process!(
    /// A stirred reactor with a cooling jacket, Arrhenius' law about 350 K.
    Reactor, Continuous, [Vat, Feed, Vat, Kinetics],
    |x, u, p, t| {
        let rate = p.k * (p.e * (S::from(1.0 / 350.0) - S::from(1.0) / x.t)).exp() * x.c;
        Vat { c: u.q * (-x.c + 1.0) - rate, t: u.q * (-x.t + 350.0) + p.h * rate + p.w * (u.tc - x.t) }
    },
    *x
);
process!(
    /// A car as a bicycle at 25 m/s, its yaw rate measured, its slip not.
    Bicycle, Continuous, [Lateral, Steering, Yaw, Tires],
    |x, u, p, t| {
        let (m, lf, lr, speed) = (1500.0, 1.2, 1.5, 25.0);
        let front = p.cf * (u.angle - (x.v + x.r * lf) / speed);
        let rear = p.cr * ((x.r * lr - x.v) / speed);
        Lateral { v: (front + rear) / m - x.r * speed, r: (front * lf - rear * lr) / p.iz }
    },
    Yaw { r: x.r }
);
process!(
    /// An active low-pass of order two.
    LowPass, Continuous, [Motion, Force, Level, Resonance],
    |x, u, p, t| Motion { x: x.v, v: p.w * p.w * (u.u - x.x) - x.v * p.w / p.q },
    Level { y: x.x }
);
process!(
    /// A pendulum let go, its angle measured.
    Pendulum, Continuous, [Angle, Nothing, Seen, Swing],
    |x, u, p, t| Angle { a: x.w, w: -(p.g * x.a.sin() + p.d * x.w) },
    Seen { a: x.a }
);
process!(
    /// A building of air and walls, the air's temperature measured.
    House, Continuous, [Rooms, Weather, Air, Building],
    |x, u, p, t| {
        let flow = (x.air - x.wall) * p.h;
        Rooms { air: (u.heat - flow) / p.ca, wall: (flow - (x.wall - u.outside) * p.u) / p.cw }
    },
    Air { air: x.air }
);
process!(
    /// Verhulst's growth.
    Logistic, Continuous, [Level, Nothing, Level, Growth],
    |x, u, p, t| Level { y: p.rate * x.y * (-x.y / p.limit + 1.0) },
    *x
);
process!(
    /// Two tanks with outlets of Torricelli's law, the lower level measured.
    TwoTanks, Continuous, [Levels, Force, Lower, Outlets],
    |x, u, p, t| {
        let (first, second) = (p.c1 * x.h1.sqrt(), p.c2 * x.h2.sqrt());
        Levels { h1: u.u - first, h2: first - second }
    },
    Lower { h2: x.h2 }
);
process!(
    /// Monod's growth in a chemostat.
    Chemostat, Continuous, [Broth, Flow, Broth, Monod],
    |x, u, p, t| {
        let growth = p.rate * x.sugar / (p.half + x.sugar);
        Broth { cells: (growth - u.dilution) * x.cells, sugar: u.dilution * (u.sugar - x.sugar) - growth * x.cells / p.gained }
    },
    *x
);
process!(
    /// A drug in gut, blood and tissue, measured in the blood.
    Compartments, Continuous, [Drug, Dose, Blood, Transfer],
    |x, u, p, t| {
        let exchanged = p.to * x.blood - p.back * x.tissue;
        let absorbed = p.absorbed * x.gut;
        Drug { gut: u.rate - absorbed, blood: absorbed - p.lost * x.blood - exchanged, tissue: exchanged }
    },
    Blood { blood: x.blood }
);
process!(
    /// A hydraulic piston behind a valve: a flow by the root of the pressure that is left.
    Hydraulic, Continuous, [Piston, Force, Piston, Oil],
    |x, u, p, t| {
        let left = -(x.pressure * (u.u * 20.0).tanh()) + 2.0;
        Piston { pressure: p.flow * u.u * left.sqrt() - p.leak * x.pressure, speed: p.area * x.pressure - p.friction * x.speed }
    },
    *x
);
process!(
    /// Michaelis and Menten's rate of a reaction.
    MichaelisMenten, Static, [Nothing, Force, Level, Enzyme],
    |x, u, p, t| *x,
    Level { y: p.vmax * u.u / (p.km + u.u) }
);
process!(
    /// A sine about a level.
    Sine, Static, [Nothing, Nothing, Level, Wave],
    |x, u, p, t| *x,
    Level { y: p.a * (p.w * t).cos() + p.b * (p.w * t).sin() + p.c }
);
process!(
    /// A decay to a level.
    Exponential, Static, [Nothing, Nothing, Level, Decay],
    |x, u, p, t| *x,
    Level { y: p.a * (-t / p.tau).exp() + p.c }
);

pub fn battery() -> Bench<Battery> {
    bench(Battery, &[0.02, 0.03, 900.0, 3.7], 2.0, &[(1.0, 6.0, 12)], &[0.0])
}

pub fn predator_prey() -> Bench<PredatorPrey> {
    bench(PredatorPrey, &[1.1, 0.4, 0.1, 0.4], 0.1, &[], &[10.0, 5.0])
}

pub fn reactor() -> Bench<Reactor> {
    bench(Reactor, &[1.0, 8000.0, 30.0, 0.8], 0.05, &[(1.0, 0.5, 25), (345.0, 15.0, 40)], &[0.6, 350.0])
}

pub fn bicycle() -> Bench<Bicycle> {
    bench(Bicycle, &[8e4, 9e4, 2500.0], 0.02, &[(0.0, 0.06, 15)], &[0.0, 0.0])
}

pub fn low_pass() -> Bench<LowPass> {
    bench(LowPass, &[6000.0, 0.9], 2e-5, &[(0.0, 1.0, 20)], &[0.0, 0.0])
}

pub fn pendulum() -> Bench<Pendulum> {
    bench(Pendulum, &[9.81, 0.15], 0.02, &[], &[1.2, 0.4])
}

pub fn house() -> Bench<House> {
    bench(House, &[0.8, 6.0, 1.2, 0.25], 0.25, &[(3.0, 3.0, 14), (278.0, 6.0, 24)], &[292.0, 289.0])
}

pub fn logistic() -> Bench<Logistic> {
    bench(Logistic, &[0.8, 5.0], 0.1, &[], &[0.2])
}

pub fn two_tanks() -> Bench<TwoTanks> {
    bench(TwoTanks, &[0.3, 0.25], 0.5, &[(0.3, 0.2, 20)], &[1.0, 1.3])
}

pub fn chemostat() -> Bench<Chemostat> {
    bench(Chemostat, &[0.5, 0.3, 0.5], 0.5, &[(0.2, 0.12, 25), (4.0, 1.0, 40)], &[1.0, 1.0])
}

pub fn compartments() -> Bench<Compartments> {
    bench(Compartments, &[0.8, 0.25, 0.3, 0.2], 0.25, &[(1.0, 1.0, 30)], &[0.0; 3])
}

pub fn hydraulic() -> Bench<Hydraulic> {
    bench(Hydraulic, &[8.0, 5.0, 6.0, 2.0], 0.02, &[(0.0, 0.8, 20)], &[0.0, 0.0])
}

pub fn michaelis_menten() -> Bench<MichaelisMenten> {
    bench(MichaelisMenten, &[2.0, 0.7], 1.0, &[(2.0, 1.95, 1)], &[])
}

pub fn sine() -> Bench<Sine> {
    bench(Sine, &[1.0, -0.6, 2.0, 3.0], 0.05, &[], &[])
}

pub fn exponential() -> Bench<Exponential> {
    bench(Exponential, &[3.0, 1.2, 0.5], 0.4, &[], &[])
}

/// The plants that faults and conditions are tried on.
pub fn process(number: u64) -> Box<dyn Plant> {
    match number % 9 {
        0 => Box::new(battery()),
        1 => Box::new(predator_prey()),
        2 => Box::new(reactor()),
        3 => Box::new(bicycle()),
        4 => Box::new(low_pass()),
        5 => Box::new(pendulum()),
        6 => Box::new(house()),
        7 => Box::new(logistic()),
        _ => Box::new(two_tanks()),
    }
}
