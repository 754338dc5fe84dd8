//! Models that a record cannot tell, that fail somewhere or everywhere, or that are stepped by the wrong method: what the
//! user is told, and that the search goes around what it can go around.

use crate::refused::says;
use approx::assert_relative_eq;
use greybox::*;

signals! { pub struct Position { x: "m" } }
signals! { pub struct Force { u: "N" } }
signals! { pub struct Pair { a: "1/s", b: "1/s" } }
signals! { pub struct Two { x: "m", z: "m" } }

const H: f64 = 0.01;
const EVEN: Time = Time::Uniform { start: 0.0, step: H };

/// A model of one state with the parameters `a` and `b`, from its equations.
macro_rules! model {
    ($name:ident, $kind:expr, $step:ident, |$x:ident, $u:ident, $p:ident| $dx:expr, $y:expr) => {
        struct $name;
        impl Model for $name {
            type State = Position;
            type Input = Force;
            type Output = Position;
            type Parameters = Pair;
            const KIND: Kind = $kind;
            fn $step<S: Scalar>(&self, _t: S, $x: &Position<S>, $u: &Force<S>, $p: &Pair<S>) -> Position<S> {
                Position { x: $dx }
            }
            fn output<S: Scalar>(&self, _t: S, $x: &Position<S>, _u: &Force<S>, _p: &Pair<S>) -> Position<S> {
                Position { x: $y }
            }
        }
    };
}

model!(Lag, Kind::Continuous, derivative, |x, u, p| p.b * u.u - p.a * x.x, x.x);
model!(Held, Kind::Discrete, next, |x, u, p| p.a * x.x + p.b * u.u, x.x);
model!(Deaf, Kind::Continuous, derivative, |x, u, p| u.u - p.a * x.x + p.b * 0.0, x.x);
model!(Ratio, Kind::Continuous, derivative, |x, u, p| u.u - p.a / p.b * x.x, x.x);
model!(Rooted, Kind::Continuous, derivative, |x, u, p| p.b * u.u - (p.a - 1.5).sqrt() * x.x, x.x);
model!(Steep, Kind::Continuous, derivative, |x, u, p| p.b * u.u - p.a.sqrt() * x.x, x.x);
model!(Logged, Kind::Continuous, derivative, |x, u, p| p.b * u.u - p.a * x.x, (S::from(0.12) - x.x).ln());
model!(Mixed, Kind::Continuous, next, |x, u, p| p.a * x.x + p.b * u.u, x.x);
model!(Turned, Kind::Discrete, derivative, |x, u, p| p.b * u.u - p.a * x.x, x.x);
// Slopes that differ by 1e-7 of themselves.
model!(Near, Kind::Continuous, derivative, |x, u, p| (p.a + p.b) * u.u - x.x * 3.0 + p.b * x.x * 1e-6, x.x);

fn force(k: usize) -> f64 {
    if k % 50 < 25 { 1.0 } else { -0.5 }
}

/// Between -1 and 1, the same each time.
fn noise(k: usize) -> f64 {
    let bits = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((bits ^ (bits >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// `x' = b u - a x` from zero, exactly, with noise.
fn lag(a: f64, b: f64, h: f64, samples: usize, amplitude: f64) -> Vec<f64> {
    let mut x = 0.0;
    (0..samples)
        .map(|k| {
            let y = x + amplitude * noise(k);
            x = b * force(k) / a + (x - b * force(k) / a) * (-a * h).exp();
            y
        })
        .collect()
}

fn record<M: Model<State = Position, Input = Force, Output = Position>>(
    model: &M,
    h: f64,
    y: &[f64],
) -> ExperimentOf<M> {
    let inputs = (0..y.len()).map(|k| Force { u: force(k) }).collect();
    let outputs = y.iter().map(|&x| Position { x }).collect();
    let record = Experiment::new(model, Time::Uniform { start: 0.0, step: h }, inputs, outputs).unwrap();
    record.named("bench").initial(Position { x: fixed(0.0) })
}

fn free_pair(a: f64, b: f64) -> Pair<Parameter> {
    Pair { a: free(a), b: free(b) }
}

/// The warnings in one text, which must hold every one of `parts`.
#[track_caller]
fn warns(estimate: &Summary, parts: &[&str]) {
    println!("{estimate}\n");
    let text: Vec<&str> = estimate.warnings.iter().map(|warning| warning.text.as_str()).collect();
    let text = text.join("\n");
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// Outputs that never move leave no noise to tell the accuracy by: nothing is known, however small the errors became. With the noise
/// given, a gain is known next to zero.
#[test]
fn nothing_is_known_of_constant_outputs() {
    for samples in [100, 300, 500] {
        let input = |k: usize| Force { u: (0.37 * k as f64).sin() + if k % 50 < 25 { 1.0 } else { -1.0 } };
        let (inputs, outputs) = ((0..samples).map(input).collect(), vec![Position { x: 0.0 }; samples]);
        let record = Experiment::new(&Lag, Time::Uniform { start: 0.0, step: 0.05 }, inputs, outputs).unwrap();
        for pair in [free_pair(2.0, 1.0), Pair { a: free(2.0).log(), b: free(1.0).log() }] {
            let found = Fit::new(&Lag, &record).parameters(pair).run().unwrap();
            assert!(found.unknowns.iter().all(|unknown| unknown.knowledge == Knowledge::Unidentified), "{found}");
        }
        let fit = Fit::new(&Lag, &record).parameters(Pair { a: fixed(2.0), b: free(1.0) });
        let found = fit.noise(Position { x: 0.1 }).run().unwrap();
        assert!(found.knowledge.b.standard_error().is_some_and(|error| error < 0.1), "{found}");
    }
}

#[test]
fn a_parameter_without_influence_is_named() {
    let record = record(&Deaf, H, &lag(3.0, 1.0, H, 300, 1e-3));
    let estimate = Fit::new(&Deaf, &record).parameters(free_pair(2.0, 7.0)).run().unwrap();
    warns(&estimate, &["`b` has no influence on the outputs", "fix one"]);
    assert_eq!(estimate.knowledge.b, Knowledge::Unidentified);
    assert_eq!(estimate.parameters.b, 7.0);
    assert_eq!(estimate.severity(), Severity::UsableWithCare);
    let error = estimate.knowledge.a.standard_error().unwrap();
    assert!((estimate.parameters.a - 3.0).abs() < 5.0 * error, "{} {error}", estimate.parameters.a);
    // A prior makes it known, as well as the prior knew it.
    let parameters = Pair { a: free(2.0), b: free(7.0).prior(5.0, 0.5) };
    let estimate = Fit::new(&Deaf, &record).parameters(parameters).run().unwrap();
    assert_relative_eq!(estimate.parameters.b, 5.0, max_relative = 1e-9);
    assert_relative_eq!(estimate.knowledge.b.standard_error().unwrap(), 0.5, max_relative = 0.02);
}

#[test]
fn parameters_known_only_as_a_ratio_are_named_with_the_direction() {
    let record = record(&Ratio, H, &lag(3.0, 1.0, H, 300, 1e-3));
    for start in [free_pair(2.0, 1.0), free_pair(2e9, 1e9), Pair { a: free(2.0).log(), b: free(1.0).log() }] {
        let estimate = Fit::new(&Ratio, &record).parameters(start).run().unwrap();
        warns(&estimate, &["`a`, `b` are known only together", "a +1 %", "b +1 %", "fix one, add a prior"]);
        assert_eq!([estimate.knowledge.a, estimate.knowledge.b], [Knowledge::Unidentified; 2]);
        assert_eq!(estimate.severity(), Severity::NotUsable);
        // The ratio itself is right to five of its standard errors.
        assert_relative_eq!(estimate.parameters.a / estimate.parameters.b, 3.0, max_relative = 5e-3);
    }
    // An initial state that is known makes no parameter known.
    let record = record.initial(Position { x: free(0.1) });
    let estimate = Fit::new(&Ratio, &record).parameters(free_pair(2.0, 1.0)).run().unwrap();
    warns(&estimate, &["`a`, `b` are known only together", "the data determine none of the parameters"]);
    assert!(estimate.unknowns[2].knowledge.standard_error().is_some_and(|error| error < 1e-3));
    assert_eq!(estimate.severity(), Severity::NotUsable);
}

#[test]
fn columns_that_coincide_to_1e_7_are_told_apart() {
    let record = record(&Near, H, &lag(3.0, 2.0, H, 300, 1e-3));
    let estimate = Fit::new(&Near, &record).parameters(free_pair(1.5, 1.5)).run().unwrap();
    println!("{estimate}\n");
    assert!(estimate.directions.is_empty(), "{:?}", estimate.directions);
    let (a, b) = (estimate.knowledge.a.standard_error().unwrap(), estimate.knowledge.b.standard_error().unwrap());
    // The sum is known a million times better than either, and they err together.
    assert!(a > 1e2 && (a / b - 1.0).abs() < 1e-3, "{a} {b}");
    assert!((estimate.parameters.a + estimate.parameters.b - 2.0).abs() < 1e-6 * a + 0.01);
}

#[test]
fn the_wrong_method_for_a_model() {
    let y = lag(3.0, 1.0, H, 300, 1e-3);
    let (continuous, discrete) = (record(&Lag, H, &y), record(&Held, H, &y));
    let held = || Fit::new(&Held, &discrete).parameters(free_pair(0.9, 0.1));
    says(held().integrator(Rk4::default()).run(), &["a discrete model", "Runge-Kutta 4", "serves continuous"]);
    says(held().integrator(Rk45::default()).run(), &["a discrete model", "Runge-Kutta 5(4)", "continuous"]);
    let run = Simulator::new(&Held).integrator(Esdirk::default());
    let run = run.run(&Pair { a: 0.9, b: 0.1 }, &Position { x: 0.0 }, EVEN, &[Force { u: 1.0 }; 3]);
    says(run, &["a discrete model", "implicit Runge-Kutta"]);
    let lag = Fit::new(&Lag, &continuous).parameters(free_pair(2.0, 2.0)).integrator(Discrete).run();
    let error = says(lag, &["a continuous model", "discrete steps", "leave the integrator out"]);
    assert!(matches!(error, Error::WrongIntegrator { .. }));
    assert_relative_eq!(held().run().unwrap().parameters.a, f64::exp(-0.03), max_relative = 1e-3);
}

#[test]
fn equations_that_were_not_written() {
    let y = lag(3.0, 1.0, H, 300, 1e-3);
    // `next` written, `derivative` asked for, and the other way round.
    let (mixed, turned) = (record(&Mixed, H, &y), record(&Turned, H, &y));
    let mixed = || Fit::new(&Mixed, &mixed).parameters(free_pair(2.0, 2.0));
    let parts = ["`bench`, sample", "`x` is NaN", "`derivative` or `next` that Model::KIND asks for was not written"];
    assert!(matches!(says(mixed().run(), &parts), Error::Start(_)));
    says(mixed().integrator(Rk45::default()).run(), &parts);
    says(mixed().integrator(Esdirk::default()).run(), &parts);
    // The estimate of a model with the same quantities.
    let estimate = Fit::new(&Lag, &record(&Lag, H, &y)).parameters(free_pair(2.0, 2.0)).run().unwrap();
    let estimate = Estimate::<Mixed>::of(estimate.into_summary()).unwrap();
    says(mixed().predict(&estimate, &record(&Mixed, H, &y)), &parts);
    says(Fit::new(&Turned, &turned).parameters(free_pair(2.0, 2.0)).run(), &parts);
}

#[test]
fn a_start_where_the_model_is_undefined() {
    let rooted = record(&Rooted, H, &lag(1.2, 1.0, H, 300, 1e-3));
    let fit = |a: f64| Fit::new(&Rooted, &rooted).parameters(free_pair(a, 1.0));
    let error = says(fit(1.0).run(), &["sample 1 (t = 0.01 s)", "state `x` is NaN", "root", "start elsewhere"]);
    let Error::Start(failure) = error else { panic!("{error}") };
    assert_eq!((failure.sample, failure.time.time, failure.signal.as_str()), (1, 0.01, "state `x`"));
    // Where the value is finite and its slope is not.
    let steep = record(&Steep, H, &lag(1.2, 1.0, H, 300, 1e-3));
    let error = Fit::new(&Steep, &steep).parameters(free_pair(0.0, 1.0)).run();
    says(error, &["slope of output `x` with respect to `a`", "sample 1", "start elsewhere"]);
    // An output that is undefined from some sample on: x reaches 0.12 after 0.124 s.
    let exact = lag(3.0, 1.0, H, 300, 0.0);
    let logged = record(&Logged, H, &[0.0; 300]);
    let run = |record: &ExperimentOf<Logged>| Fit::new(&Logged, record).parameters(free_pair(0.5, 1.0)).run();
    let error = says(run(&logged), &["output `x` is NaN", "logarithm"]);
    let Error::Start(failure) = error else { panic!("{error}") };
    assert_eq!(failure.sample, 13, "{failure}");
    // There, and only there, no measurement: nothing is asked of it.
    let measured: Vec<f64> =
        exact.iter().enumerate().map(|(k, x)| if k < 10 { (0.12 - x).ln() } else { f64::NAN }).collect();
    let fit = run(&record(&Logged, H, &measured)).unwrap();
    // Ten samples without noise: Runge-Kutta's error, (3 H)^5 / 120 a step.
    assert_relative_eq!(fit.parameters.a, 3.0, max_relative = 1e-5);
    // Its state cannot be read from an output that is undefined on the way.
    let open = Experiment::new(
        &Rootless,
        Time::Uniform { start: 0.0, step: H },
        vec![Force { u: 1.0 }; 9],
        vec![Position { x: 1.0 }; 9],
    );
    let open = open.unwrap();
    says(
        Fit::new(&Rootless, &open).parameters(free_pair(1.0, 1.0)).run(),
        &["output `x` is NaN where x = 0", "give a start for it with Experiment::initial"],
    );
}

model!(Rootless, Kind::Continuous, derivative, |x, u, p| p.b * u.u - p.a * x.x, (x.x - 1.0).sqrt());

#[test]
fn a_search_goes_around_what_cannot_be_simulated() {
    let truth = 1.6 - 1.5f64;
    let record = record(&Rooted, H, &lag(truth.sqrt(), 1.0, H, 300, 1e-4));
    for start in [8.0, 3.0, 1.7, 1.501] {
        let estimate = Fit::new(&Rooted, &record).parameters(free_pair(start, 1.0)).run().unwrap();
        println!("{estimate}\n");
        assert!(estimate.outcome.converged(), "{}", estimate.outcome);
        let error = estimate.knowledge.a.standard_error().unwrap();
        assert!((estimate.parameters.a - 1.6).abs() < 5.0 * error, "{} {error}", estimate.parameters.a);
    }
}

#[test]
fn an_unstable_simulation() {
    let record = record(&Lag, 1.0, &lag(3.0, 1.0, 1.0, 3000, 1e-3));
    let fit = || Fit::new(&Lag, &record).parameters(free_pair(-3.0, 1.0));
    let parts = ["`bench`, sample", "`x`", "overflows", "horizon"];
    says(fit().integrator(Rk45::default()).starts(1).run(), &parts);
    says(fit().integrator(Rk4 { substeps: 10 }).starts(1).run(), &parts);
    // In stages, from the same start; by multiple shooting alone where the integrator chooses its steps.
    for led in [fit().integrator(Rk4 { substeps: 10 }).run().unwrap(), fit().integrator(Rk45::default()).run().unwrap()]
    {
        let error = led.knowledge.a.standard_error().unwrap();
        assert!((led.parameters.a - 3.0).abs() < 4.0 * error && error < 0.01, "{led}");
    }
    // A stable estimate, made unstable.
    let stable = Fit::new(&Lag, &record).parameters(free_pair(3.0, 1.0)).integrator(Rk4 { substeps: 10 });
    let mut summary = stable.run().unwrap().into_summary();
    summary.parameters[0].value = -3.0;
    let estimate = Estimate::of(summary).unwrap();
    let error = says(fit().integrator(Rk4 { substeps: 10 }).predict(&estimate, &record), &parts);
    assert!(matches!(error, Error::Simulation(_)));
    // A stable model, and a step too long for it.
    let long = Fit::new(&Lag, &record).parameters(free_pair(9.0, 1.0)).integrator(Rk4::default());
    says(long.starts(1).run(), &["overflows", "shorter step"]);
}

#[test]
fn a_step_too_coarse_for_the_dynamics_is_warned_of() {
    // a h = 1.2: Runge-Kutta of order 4 errs by 1.2^5 / 120, 2 % of the step.
    let coarse = record(&Lag, 0.4, &lag(3.0, 1.0, 0.4, 300, 1e-4));
    let fit = || Fit::new(&Lag, &coarse).parameters(free_pair(2.0, 1.5)).integrator(Rk4::default());
    let estimate = fit().run().unwrap();
    warns(&estimate, &["step is too coarse", "Runge-Kutta 4, 2 steps", "standard errors", "finer step"]);
    assert_eq!(estimate.severity(), Severity::UsableWithCare);
    let error = estimate.knowledge.a.standard_error().unwrap();
    assert!(
        (estimate.parameters.a - 3.0).abs() > 2.0 * error,
        "it is in fact wrong: {} {error}",
        estimate.parameters.a
    );
    // With steps to match, and with an adaptive method, there is nothing to warn of, and the answer is right.
    for fit in [fit().integrator(Rk4 { substeps: 40 }), fit().integrator(Rk45::default())] {
        let fine = fit.run().unwrap();
        assert!(fine.warnings.is_empty(), "{:?}", fine.warnings);
        assert!((fine.parameters.a - 3.0).abs() < 5.0 * fine.knowledge.a.standard_error().unwrap(), "{fine}");
    }
    // The same with a loose tolerance.
    let loose = fit().integrator(Rk45 { relative: 0.1, absolute: 0.1 }).run().unwrap();
    warns(&loose, &["step is too coarse"]);
}

#[test]
fn one_of_two_outputs() {
    struct Twins;
    impl Model for Twins {
        type State = Position;
        type Input = Force;
        type Output = Two;
        type Parameters = Pair;
        fn derivative<S: Scalar>(&self, _t: S, x: &Position<S>, u: &Force<S>, p: &Pair<S>) -> Position<S> {
            Position { x: p.b * u.u - p.a * x.x }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Force<S>, p: &Pair<S>) -> Two<S> {
            Two { x: x.x, z: x.x * 0.0 * p.a }
        }
    }
    let y = lag(3.0, 1.0, H, 300, 1e-3);
    let inputs: Vec<Force> = (0..y.len()).map(|k| Force { u: force(k) }).collect();
    let record = |z: f64, noise: f64| {
        let exact = lag(3.0, 1.0, H, 300, 0.0);
        let outputs = y.iter().zip(exact).map(|(y, exact)| Two { x: exact + noise * (y - exact), z }).collect();
        let record = Experiment::new(&Twins, Time::Uniform { start: 0.0, step: H }, inputs.clone(), outputs).unwrap();
        record.named("bench").initial(Position { x: fixed(0.0) })
    };
    let missing = record(f64::NAN, 1.0);
    let error =
        says(Fit::new(&Twins, &missing).parameters(free_pair(2.0, 2.0)).run(), &["`bench`", "output `z`", "drop it"]);
    assert!(matches!(error, Error::OutputMissing { .. }));
    // Always zero, as the model says: it tells nothing, and spoils nothing.
    for noise in [1.0, 0.0] {
        let zero = record(0.0, noise);
        let fit = || Fit::new(&Twins, &zero).parameters(free_pair(2.0, 2.0));
        for estimate in [fit().run(), fit().noise_covariance().run(), fit().loss(Huber::default()).run()] {
            let estimate = estimate.unwrap();
            println!("{estimate}\n");
            assert!(estimate.outcome.converged(), "{}", estimate.outcome);
            assert_relative_eq!(estimate.parameters.a, 3.0, max_relative = 1e-2);
            assert!(estimate.quality.z.fit_percent.is_none());
            assert!(estimate.deviance.is_none_or(f64::is_finite) && estimate.cost.is_finite());
            assert!(!estimate.to_string().contains("NaN"));
            let again = estimate.predict(&Twins, &zero).unwrap();
            assert_relative_eq!(again.quality.x.rmse, estimate.quality.x.rmse, max_relative = 1e-9);
        }
    }
}

#[test]
fn magnitudes_of_1e_12_and_1e_12() {
    for (a, b) in [(3.0, 1e-12), (3.0, 1e12), (3e-12, 1e-12), (3e12, 1e12), (3e-12, 1e12), (3e12, 1e-12)] {
        // The time goes with the time constant.
        let h = 0.03 / a;
        let record = record(&Lag, h, &lag(a, b, h, 300, 0.0));
        let starts = [free_pair(1.5 * a, 0.7 * b), Pair { a: free(1.5 * a).log(), b: free(0.7 * b).log() }];
        for start in starts {
            let estimate = Fit::new(&Lag, &record).parameters(start).run().unwrap();
            assert!(estimate.outcome.converged(), "{a} {b}: {}", estimate.outcome);
            // Six digits: Runge-Kutta's error is (0.03)^5 / 120 a step.
            assert_relative_eq!(estimate.parameters.a, a, max_relative = 1e-6);
            assert_relative_eq!(estimate.parameters.b, b, max_relative = 1e-6);
            assert!(estimate.knowledge.a.standard_error().is_some_and(|error| error < 1e-6 * a));
        }
    }
}

#[test]
fn a_fit_without_any_error() {
    // A static line through its points: the cost is zero to the last bit.
    struct Line;
    impl Model for Line {
        type State = Nothing;
        type Input = Force;
        type Output = Position;
        type Parameters = Pair;
        const KIND: Kind = Kind::Static;
        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, p: &Pair<S>) -> Position<S> {
            Position { x: p.a * u.u + p.b }
        }
    }
    let inputs: Vec<Force> = (0..16).map(|k| Force { u: k as f64 }).collect();
    let outputs = inputs.iter().map(|u| Position { x: 2.0 * u.u + 1.0 }).collect();
    let line = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let estimate = Fit::new(&Line, &line).parameters(free_pair(2.0, 1.0)).run().unwrap();
    println!("{estimate}\n");
    assert_eq!(estimate.cost, 0.0);
    assert!(estimate.deviance.is_none() && !estimate.to_string().contains("NaN"));
    assert_eq!(estimate.predict(&Line, &line).unwrap().quality.x.rmse, 0.0);
    let estimate = Fit::new(&Line, &line).parameters(free_pair(-7.0, 30.0)).run().unwrap();
    assert_relative_eq!(estimate.parameters.a, 2.0, max_relative = 1e-12);
    // One sample of a static model, one unknown.
    let one =
        Experiment::new(&Line, Time::Stamps(vec![0.0]), vec![Force { u: 2.0 }], vec![Position { x: 6.0 }]).unwrap();
    let estimate = Fit::new(&Line, &one).parameters(Pair { a: free(1.0), b: fixed(0.0) }).run().unwrap();
    warns(&estimate, &["1 measurement(s) for 1 unknown(s)"]);
    assert_relative_eq!(estimate.parameters.a, 3.0, max_relative = 1e-9);
    assert_eq!(estimate.severity(), Severity::NotUsable);
}
