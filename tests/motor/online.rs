//! The online observers by themselves: against dense algebra, against known truth, and on bad input.

use approx::assert_relative_eq;
use greybox::nalgebra::{SMatrix, SVector};
use greybox::online::{
    AdaptationLaw, Divergence, Ekf, EkfStart, Forgetting, Gradient, Moment, Mras, MrasStart, ObserverError, Order,
    Rate, Rls, Stepping, UpdateOutcome, Watch,
};
use greybox::pmsm::{
    AngledDrive, Currents, DirectCurrent, Drive, ExactStep, ExactSurface, HeldIn, Injection, InverterFed,
    InverterFedWinding, KeLyapunov, MotorLaw, RsDirect, RsLyapunov, Surface, Winding,
};
use greybox::{Hold, Kind, Model, Nothing, Parameter, Scalar, fixed, free, signals};
use proptest::prelude::*;

const TS: f64 = 0.126e-3;

/// Deterministic standard normal numbers: sums of twelve uniform ones of a 64-bit linear congruential generator.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        (0..12)
            .map(|_| {
                self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (self.0 >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }
}

// Recursive least squares.

signals! {
    /// A straight line.
    pub struct Line { slope: "V/A", offset: "V" }
}

fn line(std: f64) -> Line<Parameter> {
    Line { slope: free(0.0).prior(0.0, std), offset: free(0.0).prior(0.0, std) }
}

// Without forgetting it is the least squares solution of all rows and the prior's: normal equations of a 2 x 2 problem
// with condition 10 are exact to 1e-12.
#[test]
fn rls_is_least_squares() {
    let mut rls = Rls::<Line, 2>::new(line(3.0), 0.5, Forgetting::none()).unwrap();
    let mut noise = Noise(1);
    let mut normal = SMatrix::<f64, 2, 2>::identity() / 9.0;
    let mut right = SVector::<f64, 2>::zeros();
    for k in 0..500 {
        let x = (k as f64 * 0.37).sin();
        let y = 0.4 * x - 2.0 + 0.5 * noise.next();
        let row = SVector::from([x, 1.0]);
        let expected = y - row.dot(&SVector::from(rls.parameters()));
        let update = rls.update(&[(Line { slope: x, offset: 1.0 }, y)]);
        assert_relative_eq!(update.innovation[0], expected, epsilon = 1e-14);
        normal += row * row.transpose() / 0.25;
        right += row * y / 0.25;
    }
    let inverse = normal.try_inverse().unwrap();
    assert_relative_eq!(SVector::from(rls.parameters()), inverse * right, max_relative = 1e-11);
    assert_relative_eq!(rls.covariance(), inverse, max_relative = 1e-11);
    assert_relative_eq!(rls.deviations().slope, inverse[(0, 0)].sqrt(), max_relative = 1e-11);
}

// Two equations of one sample, given together, are used together; the innovations are both prior to them.
#[test]
fn rls_takes_both_equations_of_a_sample() {
    let (a, b) = (Line { slope: 1.0, offset: 1.0 }, Line { slope: -1.0, offset: 1.0 });
    let mut together = Rls::<Line, 2>::new(line(3.0), 0.5, Forgetting::none()).unwrap();
    let mut apart = together;
    let update = together.update(&[(a, 2.0), (b, 3.0)]);
    assert_eq!(update.innovation, [2.0, 3.0]);
    apart.update(&[(a, 2.0)]);
    apart.update(&[(b, 3.0)]);
    assert_eq!(together.parameters(), apart.parameters());
}

#[test]
fn rls_forgets_between_its_limits() {
    let limits = Forgetting { factor: 0.98, floor: [0.05, 0.05], ceiling: [0.5, 0.5] };
    let mut rls = Rls::<Line, 2>::new(line(0.4), 0.1, limits).unwrap();
    // Excited in one direction only: without a ceiling the other's variance would be 1e8 of the start's.
    for k in 0..1000 {
        let x = (k % 3) as f64;
        rls.update(&[(Line { slope: 0.0, offset: 1.0 }, x)]);
        let std = rls.deviations();
        assert!(std.slope <= 0.5 * (1.0 + 1e-12), "{}", std.slope);
    }
    // Excited well: after the growth to the floor one sample of noise 0.1 takes at most what it tells.
    let mut rls = Rls::<Line, 2>::new(line(0.4), 0.1, Forgetting { ceiling: [f64::INFINITY; 2], ..limits }).unwrap();
    for k in 0..5000 {
        let x = if k % 2 == 0 { 1.0 } else { -1.0 };
        // The jump at 2500 is followed, for the floor keeps it able to move.
        let slope = if k < 2500 { 0.4 } else { 1.4 };
        rls.update(&[(Line { slope: x, offset: 1.0 }, slope * x)]);
    }
    assert_relative_eq!(rls.parameters().slope, 1.4, max_relative = 1e-6);
    let least = (1.0f64 / (1.0 / 0.05f64.powi(2) + 2.0 / 0.1f64.powi(2))).sqrt();
    assert!(rls.deviations().slope >= least, "{} {least}", rls.deviations().slope);
}

#[test]
fn rls_says_what_is_wrong() {
    let nan = f64::NAN;
    let mut rls = Rls::<Line, 2>::new(line(1.0), 0.1, Forgetting::none()).unwrap();
    let row = Line { slope: 1.0, offset: 1.0 };
    assert_eq!(rls.update(&[(row, nan)]).outcome, UpdateOutcome::Missing { signal: "y" });
    assert_eq!(rls.update(&[(Line { offset: nan, ..row }, 1.0)]).outcome, UpdateOutcome::Missing { signal: "offset" });
    assert_eq!(rls.parameters(), Line::default());
    let bounded = Line { slope: free(0.0).prior(0.0, 1.0).within(-1.0, 1.0), offset: fixed(0.0) };
    let mut rls = Rls::<Line, 2>::new(bounded, 0.1, Forgetting::none()).unwrap();
    let diverged = rls.update(&[(row, 5.0)]).outcome;
    assert!(matches!(diverged, UpdateOutcome::Diverged(Divergence::Bounds { parameter: "slope", .. })), "{diverged}");
    // It has stopped, at the last estimates that made sense.
    assert_eq!(rls.update(&[(row, 0.0)]).outcome, diverged);
    assert_eq!(rls.parameters(), Line::default());
    // Windup until the covariance overflows ends in words, not in NaN.
    let mut rls = Rls::<Line, 2>::new(line(1.0), 0.1, Forgetting::factor(1e-3)).unwrap();
    let last = (0..300).map(|_| rls.update(&[(Line { slope: 0.0, offset: 1.0 }, 1.0)]).outcome).last().unwrap();
    assert!(matches!(last, UpdateOutcome::Diverged(Divergence::NotFinite { .. })), "{last}");
    assert!(rls.parameters().slope.is_finite() && rls.parameters().offset.is_finite());

    let new = |start, noise, factor| Rls::<Line, 2>::new(start, noise, Forgetting::factor(factor)).err().unwrap();
    assert_eq!(new(line(1.0), 0.1, 1.5), ObserverError::Forgetting { factor: 1.5 });
    assert_eq!(new(line(1.0), -0.1, 1.0).to_string(), "the noise of `y` is -0.1; it must be positive and finite");
    assert!(matches!(new(line(0.0), 0.1, 1.0), ObserverError::NotPositive { signal: "slope", .. }));
    let open = Line { slope: free(0.0), offset: fixed(0.0) };
    assert_eq!(new(open, 0.1, 1.0), ObserverError::NoPrior { parameter: "slope" });
    let log = Line { slope: free(1.0).log(), offset: fixed(0.0) };
    assert_eq!(new(log, 0.1, 1.0), ObserverError::Logarithm { parameter: "slope" });
}

// Joint extended Kalman filter.

signals! {
    /// One state.
    pub struct Level { x: "m" }
    /// Its parameters.
    pub struct Tank { a: "1/s", b: "m/s" }
}

/// `dx/dt = b - a x`: `x` goes to `b/a`.
struct Leak;

impl Model for Leak {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Tank;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, p: &Tank<S>) -> Level<S> {
        Level { x: p.b - p.a * x.x }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Tank<S>) -> Level<S> {
        *x
    }
}

fn leak(a: Parameter, b: Parameter) -> EkfStart<Leak> {
    EkfStart {
        state: Level { x: free(0.0).prior(0.0, 1.0) },
        parameters: Tank { a, b },
        state_drift: Level { x: 1e-3 },
        parameter_drift: Tank::default(),
        noise: Level { x: 0.1 },
        hold: Hold::Zero,
        watch: Watch { limit: Level { x: 6.0 }, patience: 20 },
    }
}

// With the parameters fixed the problem is linear and scalar: the textbook filter, exp(-a h) by Runge-Kutta 4.
#[test]
fn ekf_is_the_kalman_filter_where_the_model_is_linear() {
    let h = 0.1;
    let mut ekf = Ekf::<_, 1>::new(Leak, h, leak(fixed(0.7), fixed(2.0))).unwrap();
    let z: f64 = -0.7 * h;
    let phi = 1.0 + z + z * z / 2.0 + z.powi(3) / 6.0 + z.powi(4) / 24.0;
    let (mut x, mut p, mut noise) = (0.0, 1.0, Noise(2));
    for k in 0..200 {
        let y = 2.8 + 0.1 * noise.next();
        if k > 0 {
            x = phi * x + (1.0 - phi) / 0.7 * 2.0;
            p = phi * phi * p + 1e-6;
        }
        let s = p + 0.01;
        let update = ekf.update(k as f64 * h, &Nothing, &Level { x: y });
        assert_relative_eq!(update.innovation.x, y - x, epsilon = 1e-12);
        assert_relative_eq!(ekf.nis(), (y - x) * (y - x) / s, epsilon = 1e-12, max_relative = 1e-9);
        x += p / s * (y - x);
        p -= p * p / s;
        assert_relative_eq!(ekf.state().x, x, epsilon = 1e-12);
        assert_relative_eq!(ekf.state_deviations().x, p.sqrt(), max_relative = 1e-10);
    }
}

// Truth, noise and filter agree: estimates within 4 of their standard deviations, and the mean normalized innovation
// square of n samples within 4 of its own, sqrt(2/n). The logarithm gives the same as the value does.
#[test]
fn ekf_finds_parameters_and_knows_how_well() {
    let (h, n) = (0.05, 4000);
    let start = |a, b| EkfStart { state_drift: Level { x: 0.0 }, ..leak(a, b) };
    let (a, b) = (free(1.0).prior(1.0, 0.5).within(1e-3, 1e3), free(1.0).prior(1.0, 1.0));
    let mut plain = Ekf::<_, 3>::new(Leak, h, start(a, b)).unwrap();
    let mut log = Ekf::<_, 3>::new(Leak, h, start(a.log(), b)).unwrap();
    let (mut noise, mut x, mut sum) = (Noise(3), 0.0f64, 0.0);
    let decay = f64::exp(-0.7 * h);
    for k in 0..n {
        let y = Level { x: x + 0.1 * noise.next() };
        sum += if plain.update(k as f64 * h, &Nothing, &y).outcome == UpdateOutcome::Corrected {
            plain.nis()
        } else {
            1.0
        };
        log.update(k as f64 * h, &Nothing, &y);
        x = decay * x + (1.0 - decay) * 2.0 / 0.7;
    }
    for ekf in [&plain, &log] {
        let (p, std) = (ekf.parameters(), ekf.deviations());
        println!("a {} +- {}, b {} +- {}", p.a, std.a, p.b, std.b);
        assert!((p.a - 0.7).abs() < 4.0 * std.a && (p.b - 2.0).abs() < 4.0 * std.b);
        assert!(std.a < 0.02 && std.b < 0.05);
    }
    let mean = sum / n as f64;
    assert!((mean - 1.0).abs() < 4.0 * (2.0 / n as f64).sqrt(), "{mean}");
}

/// A drive's record: speed that swings, d current in steps, an inverter that loses 2 V.
fn fed_motor(n: usize, mut each: impl FnMut(f64, AngledDrive, Currents)) {
    let model =
        InverterFed::<_, InverterFedWinding>::new(ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap()));
    let truth = InverterFedWinding { rs: 0.63, ls: 4e-3, ke: 0.95, vdt: 2.0, i0: 0.15 };
    let (mut i, mut theta, mut noise) = (Currents::default(), 0.0, Noise(4));
    for k in 0..n {
        let t = k as f64 * TS;
        let w = 150.0 * (6.0 * t).sin();
        let wanted =
            Currents { id: if ((t * 4.0) as u32).is_multiple_of(2) { 0.0 } else { -6.0 }, iq: 15.0 * (40.0 * t).sin() };
        let we = 4.0 * w;
        let u = AngledDrive {
            ud: 2.0 * (wanted.id - i.id) - we * 4e-3 * i.iq,
            uq: 2.0 * (wanted.iq - i.iq) + we * 4e-3 * i.id + 0.95 * w * (2f64 / 3.0).sqrt(),
            w,
            theta: theta + w * TS / 2.0,
        };
        each(t, u, Currents { id: i.id + 0.06 * noise.next(), iq: i.iq + 0.06 * noise.next() });
        i = model.next(t, &i, &u, &truth);
        theta += w * TS;
    }
}

fn motor_ekf() -> Ekf<InverterFed<ExactSurface, InverterFedWinding>, 5> {
    let model =
        InverterFed::<_, InverterFedWinding>::new(ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap()));
    let start = EkfStart {
        state: Currents { id: free(0.0).prior(0.0, 1.0), iq: free(0.0).prior(0.0, 1.0) },
        parameters: InverterFedWinding {
            rs: free(0.4).prior(0.4, 0.32).within(0.01, 10.0),
            ls: fixed(4e-3),
            ke: free(0.855).prior(0.855, 0.14).within(0.1, 10.0),
            vdt: free(0.0).prior(0.0, 2.0),
            i0: fixed(0.15),
        },
        state_drift: Currents { id: 1e-3, iq: 1e-3 },
        parameter_drift: InverterFedWinding { rs: 1e-6, ls: 0.0, ke: 1e-7, vdt: 1e-6, i0: 0.0 },
        noise: Currents { id: 0.06, iq: 0.06 },
        hold: Hold::Zero,
        watch: Watch { limit: Currents { id: 8.0, iq: 8.0 }, patience: 50 },
    };
    model.ekf(start).unwrap()
}

#[test]
fn joint_ekf_of_a_motor_finds_resistance_emf_and_dead_time() {
    let (mut ekf, mut bad) = (motor_ekf(), 0);
    fed_motor(16_000, |t, u, y| bad += (ekf.update(t, &u, &y).outcome != UpdateOutcome::Corrected) as u32);
    let (p, std) = (ekf.parameters(), ekf.deviations());
    println!("{p:?} +- {std:?}");
    assert_eq!(bad, 1); // the start
    assert_eq!((p.ls, std.ls), (4e-3, 0.0));
    for (value, truth, std) in [(p.rs, 0.63, std.rs), (p.ke, 0.95, std.ke), (p.vdt, 2.0, std.vdt)] {
        assert!((value - truth).abs() < 4.0 * std, "{value} {truth} {std}");
        assert!(std < 0.01 * truth);
    }
}

#[test]
fn ekf_survives_bad_samples_and_gaps() {
    let (mut ekf, mut k) = (motor_ekf(), 0);
    let mut outcomes = Vec::new();
    fed_motor(16_000, |t, mut u, mut y| {
        k += 1;
        // The record jumps by a second: the currents of before are void.
        let t = if k > 9_000 { t + 1.0 } else { t };
        match k {
            3_000 => y.iq = f64::NAN,
            4_000 => u.w = f64::INFINITY,
            _ => {}
        }
        let update = ekf.update(t, &u, &y);
        assert!(update.innovation.id.is_finite() && update.innovation.iq.is_finite());
        if update.outcome != UpdateOutcome::Corrected {
            outcomes.push((k, update.outcome));
        }
    });
    assert_eq!(outcomes.len(), 5, "{outcomes:?}");
    assert_eq!(outcomes[1], (3_000, UpdateOutcome::Missing { signal: "iq" }));
    assert_eq!(outcomes[2], (4_000, UpdateOutcome::Missing { signal: "w" }));
    assert!(matches!(outcomes[3], (4_001, UpdateOutcome::Restarted { .. })));
    assert!(matches!(outcomes[4], (9_001, UpdateOutcome::Restarted { expected: TS, found }) if found > 1.0));
    assert_relative_eq!(ekf.parameters().ke, 0.95, max_relative = 2e-3);
}

#[test]
fn ekf_stops_where_the_model_does_not_follow() {
    // The sensor sticks at 40 A: 50 innovations in a row far beyond 8 standard deviations.
    let mut ekf = motor_ekf();
    let (mut first, mut kept) = (None, None);
    fed_motor(3_000, |t, u, y| {
        let y = if t > 0.2 { Currents { iq: 1e4, ..y } } else { y };
        let before = ekf.parameters();
        let outcome = ekf.update(t, &u, &y).outcome;
        if let (UpdateOutcome::Diverged(why), None) = (outcome, first) {
            (first, kept) = (Some(why), Some(before));
        }
    });
    assert!(matches!(first, Some(Divergence::Bounds { .. } | Divergence::Innovation { .. })), "{first:?}");
    assert_eq!(kept, Some(ekf.parameters()));
}

#[test]
fn ekf_refuses_what_cannot_be() {
    let new = |start| Ekf::<_, 3>::new(Leak, 0.1, start).err().unwrap();
    let (a, b) = (free(1.0).prior(1.0, 0.5), free(1.0).prior(1.0, 1.0));
    assert_eq!(new(leak(free(1.0), b)), ObserverError::NoPrior { parameter: "a" });
    assert!(matches!(new(leak(a.within(2.0, 3.0), b)), ObserverError::Start { parameter: "a", .. }));
    assert!(matches!(new(leak(free(-1.0).log().prior(-1.0, 1.0), b)), ObserverError::Start { parameter: "a", .. }));
    assert!(matches!(new(EkfStart { noise: Level { x: 0.0 }, ..leak(a, b) }), ObserverError::NotPositive { .. }));
    assert!(matches!(
        Ekf::<_, 3>::new(Leak, 0.0, leak(a, b)).err().unwrap(),
        ObserverError::NotPositive { signal: "t", .. }
    ));
    let error = Ekf::<_, 2>::new(Leak, 0.1, leak(a, b)).err().unwrap();
    assert_eq!(error, ObserverError::Capacity { needed: 3, capacity: 2 });
    assert!(error.to_string().contains("make its last const parameter 3"));
}

/// A discrete model whose state overflows at once.
struct Explosive;

impl Model for Explosive {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Tank;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, p: &Tank<S>) -> Level<S> {
        Level { x: (x.x + p.a) * f64::MAX * 4.0 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Tank<S>) -> Level<S> {
        *x
    }
}

#[test]
fn a_model_that_overflows_stops_the_observer() {
    let Tank { a, b } = Tank { a: free(1.0).prior(1.0, 0.5), b: fixed(0.0) };
    let EkfStart { state, parameters, state_drift, parameter_drift, noise, hold, watch } = leak(a, b);
    let start = EkfStart { state, parameters, state_drift, parameter_drift, noise, hold, watch };
    let mut ekf = Ekf::<_, 2>::new(Explosive, 0.1, start).unwrap();
    let outcomes = [0.0, 0.1, 0.2].map(|t| ekf.update(t, &Nothing, &Level { x: 1.0 }).outcome);
    assert!(matches!(outcomes[1], UpdateOutcome::Diverged(Divergence::NotFinite { .. })), "{:?}", outcomes[1]);
    assert_eq!(outcomes[1], outcomes[2]);
    assert!(ekf.parameters().a.is_finite() && ekf.state().x.is_finite());
}

// Model reference adaptive system.

fn mras_start<M>(parameters: Winding<Parameter>, watch: Watch<Currents>) -> MrasStart<M>
where
    M: Model<State = Currents, Parameters = Winding>,
{
    MrasStart {
        parameters,
        pull: Currents { id: 100.0, iq: 100.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch,
    }
}

const FREE: Watch<Currents> = Watch { limit: Currents { id: 1e3, iq: 1e3 }, patience: 1 };

fn surface_mras<L: AdaptationLaw<ExactSurface>>(law: L, parameters: Winding<Parameter>) -> Mras<ExactSurface, L> {
    let model = ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
    model.mras(law, mras_start(parameters, FREE)).unwrap()
}

fn known() -> Winding<Parameter> {
    Winding { rs: free(0.4).within(0.05, 5.0), ls: fixed(4e-3), ke: free(0.9).within(0.1, 5.0) }
}

proptest! {
    // The law by exact slopes of the model's text is the law derived by hand.
    #[test]
    fn gradient_of_the_motor_is_the_lyapunov_law(id in -60.0..60.0, iq in -60.0..60.0, ed in -5.0..5.0, eq in -5.0..5.0,
                                                 w in -700.0..700.0) {
        let model = Surface::new(4).unwrap();
        let (x, e) = (Currents { id, iq }, Currents { id: ed, iq: eq });
        let (u, p) = (Drive { ud: 10.0, uq: 50.0, w }, Winding { rs: 0.4, ls: 4e-3, ke: 0.95 });
        let now = Moment { model: &model, ts: TS, t: 0.0, x: &x, e: &e, u: &u, p: &p };
        let gradient = Gradient::<_, 3> { gain: Winding { rs: 5e-3, ls: 0.0, ke: 1e-3 } };
        let by_hand = MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke: KeLyapunov { gain: 1e-3 } };
        let number = |rate| match rate { Rate::Adapt(rate) => rate, Rate::Hold { .. } => f64::NAN };
        let (a, b) = (gradient.rates(&now), by_hand.rates(&now));
        assert_relative_eq!(number(a.rs), number(b.rs), epsilon = 1e-12, max_relative = 1e-12);
        assert_relative_eq!(number(a.ke), number(b.ke), epsilon = 1e-12, max_relative = 1e-12);
        assert_eq!(number(a.ls), 0.0);
    }
}

#[test]
fn gradient_serves_any_model_with_measured_state() {
    let start = MrasStart {
        parameters: Tank { a: fixed(0.7), b: free(1.0) },
        pull: Level { x: 5.0 },
        order: Order::UpdateThenPredict,
        stepping: Stepping::Split,
        watch: Watch { limit: Level { x: 100.0 }, patience: 1 },
    };
    let gradient = Gradient::<_, 2> { gain: Tank { a: 0.0, b: 5.0 } };
    let mut mras = Mras::new(Leak, gradient, 0.05, start).unwrap();
    assert!(mras.radius::<3>(&Level { x: 1.0 }, &Nothing) < 1.0);
    let decay = f64::exp(-0.7 * 0.05);
    let mut x = 0.0;
    for k in 0..2000 {
        mras.update(k as f64 * 0.05, &Nothing, &Level { x });
        x = decay * x + (1.0 - decay) * 2.0 / 0.7;
    }
    // Left over: what Runge-Kutta 4 leaves of exp(-a h), (a h)^5/120 = 4e-10 relative.
    assert_relative_eq!(mras.parameters().b, 2.0, max_relative = 1e-8);
}

#[test]
fn mras_names_what_it_cannot_use() {
    let law = MotorLaw {
        rs: DirectCurrent { law: RsDirect { gain: -10.0 }, current: 1.0 },
        ke: greybox::pmsm::DeadZone { law: KeLyapunov { gain: 1e-3 }, speed: 20.0 },
    };
    let mut mras = surface_mras(law, known());
    let u = Drive { ud: 0.0, uq: 0.0, w: 0.0 };
    let (none, nan) = (Currents::default(), f64::NAN);
    assert_eq!(mras.update(0.0, &u, &none).outcome, UpdateOutcome::Started);
    // Standstill and no d current: neither moves, and the first is named.
    let outcome = mras.update(TS, &u, &none).outcome;
    assert_eq!(outcome, UpdateOutcome::Held { parameter: "rs", quantity: "d current (A)", value: 0.0, limit: 1.0 });
    mras.adapt(Winding { rs: false, ls: true, ke: true });
    let outcome = mras.update(2.0 * TS, &u, &none).outcome;
    assert_eq!(outcome.to_string(), "`ke` held: speed (rad/s) is 0, and tells nothing below 20");
    let fast = Drive { w: 100.0, ..u };
    assert_eq!(mras.update(3.0 * TS, &fast, &none).outcome, UpdateOutcome::Corrected);
    assert_eq!(
        mras.update(4.0 * TS, &fast, &Currents { id: nan, iq: 0.0 }).outcome,
        UpdateOutcome::Missing { signal: "id" }
    );
    assert_eq!(mras.update(5.0 * TS, &Drive { uq: nan, ..u }, &none).outcome, UpdateOutcome::Missing { signal: "uq" });
    assert!(matches!(mras.update(6.0 * TS, &fast, &none).outcome, UpdateOutcome::Restarted { .. }));
    assert_eq!(mras.update(nan, &fast, &none).outcome, UpdateOutcome::Missing { signal: "t" });
    assert_eq!(mras.update(7.0 * TS, &fast, &none).outcome, UpdateOutcome::Corrected);
    // Time runs back, and the sensor is dead: the restart waits for it.
    assert_eq!(
        mras.update(0.0, &fast, &Currents { id: nan, iq: nan }).outcome,
        UpdateOutcome::Missing { signal: "id" }
    );
    assert!(matches!(mras.update(TS, &fast, &none).outcome, UpdateOutcome::Restarted { .. }));
    assert!(mras.state().iq.is_finite() && mras.parameters().ke.is_finite());
}

// R starts 20 % and Ke 10 % low, at constant speed. Each period leaves iq/(iq + (rs/ls + F) id/we) = -0.385 of R's error
// (see the top of the file of `Injection`): 5e-4 after eight.
#[test]
fn injection_finds_the_resistance_and_leaves_the_emf_alone() {
    let injection = Injection::new(-8.0, 0.2, 0.02, 1.0).unwrap();
    let step = ExactStep::new(4, TS, HeldIn::Stationary).unwrap();
    let truth = Winding { rs: 0.5, ls: 4e-3, ke: 1.0 };
    let law = MotorLaw { rs: RsDirect { gain: 30.0 }, ke: KeLyapunov { gain: 1e-3 } };
    let pull = Currents { id: 1000.0, iq: 1000.0 };
    let start = MrasStart { pull, ..mras_start(known(), FREE) };
    let mut mras = ExactSurface(step).mras(law, start).unwrap();
    let mut i = Currents::default();
    for k in 0..(8.4 / TS) as usize {
        let (t, w) = (k as f64 * TS, 60.0);
        // The back-EMF has the first turn: far off, it would be taken for resistance.
        let now = t + 0.6;
        let id = injection.id(now);
        let (ed, eq) = (id - i.id, 10.0 - i.iq);
        let u = Drive {
            ud: 4.0 * ed + truth.rs * id - 4.0 * w * truth.ls * i.iq,
            uq: 4.0 * eq + truth.rs * 10.0 + 4.0 * w * truth.ls * i.id + greybox::pmsm::SQRT_2_3 * truth.ke * w,
            w,
        };
        mras.adapt(Winding { rs: injection.adapts_rs(now) && id != 0.0, ls: false, ke: injection.adapts_ke(now) });
        let before = mras.parameters();
        mras.update(t, &u, &i);
        let after = mras.parameters();
        assert!(injection.adapts_ke(now) || after.ke == before.ke);
        assert!(id != 0.0 || after.rs == before.rs);
        i = step.advance(&i, &u, &truth);
    }
    let p = mras.parameters();
    println!("{p:?}");
    assert_relative_eq!(p.rs, truth.rs, max_relative = 1e-3);
    assert_relative_eq!(p.ke, truth.ke, max_relative = 1e-3);
}

// Dead time fed into the observer's input is no error left to adapt to.
#[test]
fn an_observer_fed_with_what_the_dead_time_leaves_has_no_innovation() {
    let step = ExactStep::new(4, TS, HeldIn::Stationary).unwrap();
    let law = MotorLaw { rs: RsLyapunov { gain: 5e-3 }, ke: KeLyapunov { gain: 1e-3 } };
    let motor = Winding { rs: fixed(0.63), ls: fixed(4e-3), ke: free(0.95) };
    let mut mras = surface_mras(law, motor);
    let model = InverterFed::<_, InverterFedWinding>::new(ExactSurface(step));
    let p = InverterFedWinding { rs: 0.63, ls: 4e-3, ke: 0.95, vdt: 2.0, i0: 0.15 };
    let mut i = Currents { id: -3.0, iq: 8.0 };
    for k in 0..1000 {
        let u = AngledDrive { ud: -10.0, uq: 60.0, w: 70.0, theta: 70.0 * TS * k as f64 };
        let update = mras.update(k as f64 * TS, &step.less_dead_time(&i, &u, 2.0, 0.15), &i);
        assert!(update.innovation.id.abs() < 1e-10 && update.innovation.iq.abs() < 1e-10);
        i = model.next(0.0, &i, &u, &p);
    }
}

#[test]
fn innovations_beyond_their_limit_stop_the_observer_after_its_patience() {
    let watch = Watch { limit: Currents { id: 5.0, iq: 5.0 }, patience: 3 };
    let model = ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
    let law = MotorLaw { rs: RsLyapunov { gain: 0.0 }, ke: KeLyapunov { gain: 0.0 } };
    let mut mras = Mras::new(model, law, TS, mras_start(known(), watch)).unwrap();
    let u = Drive::default();
    let far = [0.0, 50.0, 0.0, 50.0, 51.0, 52.0];
    let outcomes: Vec<_> =
        (0..6).map(|k| mras.update(k as f64 * TS, &u, &Currents { id: far[k], iq: 0.0 }).outcome).collect();
    assert_eq!(outcomes[4], UpdateOutcome::Corrected);
    let UpdateOutcome::Diverged(Divergence::Innovation { signal: "id", value, limit: 5.0, samples: 3 }) = outcomes[5]
    else {
        panic!("{:?}", outcomes[5])
    };
    assert!(value > 40.0);
}

#[test]
fn unstable_gains_are_an_error_with_the_point_named() {
    let points = |mras: &Mras<ExactSurface, _>, id| {
        mras.check::<5>((0..8).map(|k| {
            let (w, i) = (50.0 * k as f64, Currents { id, iq: 10.0 });
            (i, Drive { ud: 0.4 * id - 4.0 * w * 0.04, uq: 4.0 + 4.0 * w * 4e-3 * id + 0.775 * w, w })
        }))
    };
    // The thesis' order, at 250 rad/s and above.
    let law = MotorLaw { rs: RsDirect { gain: -10.0 }, ke: KeLyapunov { gain: 1e-3 } };
    let model = ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
    let thesis = MrasStart { order: Order::Thesis, ..mras_start(known(), FREE) };
    let mras =
        Mras::new(model, law, TS, MrasStart { parameters: Winding { rs: fixed(0.4), ..known() }, ..thesis }).unwrap();
    let error = points(&mras, 4.0).unwrap_err();
    assert!(matches!(error, ObserverError::Unstable { point: 5, radius } if radius > 1.0 && radius < 1.1), "{error}");
    // (5.4) is stable with g id < 0 only; the Lyapunov law with either sign.
    assert_eq!(points(&surface_mras(law, known()), 4.0), Ok(()));
    assert!(matches!(points(&surface_mras(law, known()), -4.0), Err(ObserverError::Unstable { .. })));
    let lyapunov = surface_mras(MotorLaw { rs: RsDirect { gain: 0.0 }, ke: KeLyapunov { gain: 1e-3 } }, known());
    assert_eq!(points(&lyapunov, -4.0), Ok(()));
    // A gain far too high for the sample time.
    let high = surface_mras(MotorLaw { rs: RsDirect { gain: -10.0 }, ke: KeLyapunov { gain: 10.0 } }, known());
    assert!(points(&high, 4.0).is_err());
}

// The eigenvalues of one loop by another way: observer without adaptation, exp(-a Ts)(1 - K), all else left out.
#[test]
fn without_adaptation_the_radius_is_the_pulled_pole() {
    let mras = surface_mras(
        MotorLaw { rs: RsLyapunov { gain: 1.0 }, ke: KeLyapunov { gain: 1.0 } },
        Winding { rs: fixed(0.4), ls: fixed(4e-3), ke: fixed(0.95) },
    );
    let radius = mras.radius::<5>(&Currents { id: 1.0, iq: 2.0 }, &Drive { ud: 1.0, uq: 60.0, w: 80.0 });
    assert_relative_eq!(radius, f64::exp(-(100.0 + 100.0) * TS), max_relative = 1e-12);
}

#[test]
fn mras_refuses_what_cannot_be() {
    let model = ExactSurface(ExactStep::new(4, TS, HeldIn::Stationary).unwrap());
    let law = MotorLaw { rs: RsLyapunov { gain: 1.0 }, ke: KeLyapunov { gain: 1.0 } };
    let new = |start| Mras::new(model, law, TS, start).err().unwrap();
    let start = mras_start(known(), FREE);
    assert_eq!(new(MrasStart { stepping: Stepping::Euler, ..start }), ObserverError::EulerOfDiscrete);
    let pull = Currents { id: 100.0, iq: -1.0 };
    assert_eq!(new(MrasStart { pull, ..start }), ObserverError::Pull { state: "iq", value: -1.0 });
    let negative = Winding { ls: fixed(-4e-3).within(0.0, 1.0), ..known() };
    let error = new(mras_start(negative, FREE)).to_string();
    assert_eq!(error, "`ls` starts at -0.004, which is not between its bounds 0 and 1");
    let negative = Winding { ls: fixed(-4e-3), ..known() };
    let error = model.mras(law, mras_start(negative, FREE)).err().unwrap().to_string();
    assert_eq!(error, "the start of `ls` is -0.004; it must be positive and finite");
    let log = Winding { rs: free(0.4).log(), ..known() };
    assert_eq!(new(mras_start(log, FREE)), ObserverError::Logarithm { parameter: "rs" });
}
