//! Records cut into segments give what they give as a whole.

use greybox::models::{AxisParameters, ControlledAxisMotion, ControlledAxisOutput, PositioningLoop, Reference};
use greybox::optimize::LeastSquares;
use greybox::{
    Estimate, ExperimentOf, Fit, Hold, Horizon, Huber, Model, Of, Rk4, Scalar, Simulator, Time, fixed, free, signals,
};

signals! {
    pub struct State { a: "", b: "" }
    pub struct Input { u: "" }
    pub struct Output { y: "" }
    pub struct Coefficients { p: "", q: "", r: "" }
}

/// Plants of two states. One that asks for a value cannot be traced: it runs with dual numbers, uncut.
#[derive(Clone, Copy)]
struct Plant {
    kind: usize,
    whole: bool,
}

impl Model for Plant {
    type State = State;
    type Input = Input;
    type Output = Output;
    type Parameters = Coefficients;

    fn derivative<S: Scalar>(&self, _t: S, x: &State<S>, u: &Input<S>, c: &Coefficients<S>) -> State<S> {
        if self.whole {
            let _ = x.a.value();
        }
        let (State { a, b }, Coefficients { p, q, r }, u) = (*x, *c, u.u);
        let one = |x: S| x + 1.0;
        let (da, db) = match self.kind {
            // Affine in their states.
            0 => ((u - a) * p, (a - b) * q),
            1 => (b, u * r - a * p - b * q),
            2 => ((b - a) * p + u, (a - b) * q - b * r),
            3 => (u * r - a * p, a * u * q - b),
            // Not.
            4 => (b, u - a.sin() * p - b * q),
            5 => (b, u * r - a * p - a * a * a * q - b * 0.2),
            6 => (b, (-(a * a) + 1.0) * b * p - a * q + u * r),
            7 => (b, u - b * b * b * p - b * q - a * r),
            8 => (b, u - b * b.abs() * p - a * q - b * r),
            9 => (u * p - one(a).sqrt() * q + q, one(a).sqrt() * q - one(b).sqrt() * r + r - q),
            10 => (b, u - (b * 20.0).tanh() * p - b * q - a * r),
            11 => (a * (-a + 1.0) * p + u * q, (a - b) * r),
            12 => ((a * p - a * b * q) + u * 0.1, a * b * 0.5 - b * r),
            13 => (u - a * p / (a * a + 0.5) * q, (a - b) * r),
            14 => ((u - a * p) / (one(a * a * q)), (a - b) * r),
            15 => (u * 2.0 - (one(a).powi(4) - 1.0) * p * 0.2 - a * q, (a - b) * r),
            16 => ((u - a) * p - ((a * 2.0).exp() - 1.0) * q * 0.1, (a - b) * r),
            17 => ((u - a) * p - a * (b * 0.5).exp() * q * 0.3, a * 0.4 - b * r),
            18 => (b, u - (a + a * a * 0.3) * p - b * q * (a * a * 0.2 + 1.0) - (b * 5.0).tanh() * r * 0.2),
            19 => (b * p, u - a * b * q - b * r),
            20 => (b, u * u.abs() - a * p - (a - 0.3).abs() * q - b * r),
            21 => (u - a * p + (a * b).cos() * q * 0.1, (a * a - b) * r),
            22 => (b, u.tanh() * 2.0 - a.hypot(b * 0.5) * a * p - b * q - a * r * 0.5),
            _ => ((u - a.atan() * p) * q, (a.sin() - b) * r),
        };
        State { a: da, b: db }
    }

    fn output<S: Scalar>(&self, _t: S, x: &State<S>, _u: &Input<S>, _c: &Coefficients<S>) -> Output<S> {
        Output { y: x.a + x.b * 0.5 }
    }
}

const AFFINE: std::ops::Range<usize> = 0..4;
const NONLINEAR: std::ops::Range<usize> = 4..24;

fn record(kind: usize, noise: f64, samples: usize) -> ExperimentOf<Plant> {
    let model = Plant { kind, whole: false };
    let truth = Coefficients { p: 1.1, q: 0.7, r: 0.9 };
    let steps = |k: usize| [0.3, 1.1, -0.4, 0.8, 0.1, 1.4, -0.2][k / 90 % 7] + 0.2 * (k as f64 * 0.013).sin();
    let inputs: Vec<_> = (0..samples).map(|k| Input { u: steps(k) }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let run = Simulator::new(&model).run(&truth, &State { a: 0.2, b: 0.1 }, time, &inputs).unwrap();
    run.with_noise(Output { y: noise }, kind as u64).experiment(&model).unwrap()
}

fn fit(kind: usize, whole: bool, record: &ExperimentOf<Plant>, start: [f64; 3]) -> Option<Estimate<Plant>> {
    let record = record.clone().initial(State { a: free(0.2), b: fixed(0.1) });
    let start = start.map(|factor| free(factor).within(0.01, 20.0));
    let parameters: Of<Coefficients, _> = Coefficients { p: start[0], q: start[1], r: start[2] };
    Fit::new(&Plant { kind, whole }, &record)
        .parameters(parameters)
        .noise(Output { y: 0.05 })
        .integrator(Rk4::default())
        .run()
        .ok()
}

/// Near starts, and starts a factor of three to five off, each way.
const STARTS: [[f64; 3]; 5] = [[1.0, 1.0, 1.0], [3.0, 0.3, 2.0], [0.3, 2.0, 0.3], [0.25, 0.2, 4.0], [5.0, 3.0, 0.2]];

/// Whether a search of the whole record ends in the same minimum from starts that differ in the last digits. The search of a pendulum
/// from far may pass hundreds of minima, and rounding decides in which it ends.
fn is_reproducible(kind: usize, record: &ExperimentOf<Plant>, start: [f64; 3], cost: f64) -> bool {
    let ends =
        [1.0 + 1e-15, 1.0 - 1e-14].map(|factor| fit(kind, true, record, [start[0] * factor, start[1], start[2]]));
    ends.iter().flatten().all(|end| (end.cost - cost).abs() <= 1e-8 * cost)
}

/// Where the whole record leads to a minimum, whatever the last digits of the start, so do its segments, and to the same; how many did.
fn compare(kinds: std::ops::Range<usize>, noise: f64, samples: usize) -> (usize, usize) {
    let (mut found, mut tried) = (0, 0);
    for kind in kinds {
        let record = record(kind, noise, samples);
        for start in STARTS {
            tried += 1;
            let (whole, cut) = (fit(kind, true, &record, start), fit(kind, false, &record, start));
            let Some(whole) = whole.filter(|whole| whole.outcome.converged()) else { continue };
            let cut = cut.unwrap_or_else(|| panic!("kind {kind} from {start:?}: no estimate"));
            assert!(whole.method.engine.contains("dual") && cut.method.engine.contains("graph"));
            let what = format!("kind {kind} from {start:?}: {} {} {}", cut.cost, whole.cost, cut.outcome);
            // Costs of the same minimum differ by rounding and by what the search leaves: a relative step of 1e-8.
            if !(cut.outcome.converged() && (cut.cost - whole.cost).abs() <= 1e-8 * whole.cost) {
                assert!(!is_reproducible(kind, &record, start, whole.cost), "{what}");
                continue;
            }
            for (a, b) in cut.unknowns.iter().zip(&whole.unknowns) {
                let Some(error) = b.knowledge.standard_error() else { continue };
                assert!((a.value - b.value).abs() <= 1e-3 * error, "{what}: {} {} {}", a.name, a.value, b.value);
                let Some(own) = a.knowledge.standard_error() else { panic!("{what}: {} is not known", a.name) };
                assert!((own / error - 1.0).abs() <= 1e-4, "{what}: {} known to {own}, {error}", a.name);
            }
            found += 1;
        }
    }
    (found, tried)
}

#[test]
fn affine_plants_from_far_starts() {
    for noise in [0.0005, 0.05, 0.5] {
        let (found, tried) = compare(AFFINE, noise, 2000);
        println!("noise {noise}: {found} of {tried}");
        assert!(found == tried, "noise {noise}: {found} of {tried}");
    }
}

/// The cost with a loss is that of the whole record at each of many points. What the borders of segments are off there, if anything, is rounding, which depends
/// on the point; where it was corrected as for squares, the cost was half the sum of the weighted squares, a third less.
#[test]
fn losses_of_affine_plants() {
    for kind in AFFINE {
        let record = record(kind, 0.3, 1_000);
        let cut = Plant { kind, whole: false };
        let whole = Plant { kind, whole: true };
        let start = Coefficients { p: free(1.1), q: free(0.8), r: free(0.9) };
        let problem =
            |plant| Fit::new(plant, &record).parameters(start).noise(Output { y: 0.1 }).loss(Huber(1.345)).problem();
        let (cut, whole) = (problem(&cut).unwrap(), problem(&whole).unwrap());
        let (cut, whole) = (cut.objective().unwrap(), whole.objective().unwrap());
        for k in 0..40 {
            let x: Vec<f64> = cut.start().iter().map(|x| x * (1.0 + 1e-3 * f64::from(k))).collect();
            let [of_cut, of_whole] = [&cut, &whole].map(|objective| objective.linearize(&x).unwrap().cost);
            assert!((of_cut / of_whole - 1.0).abs() < 1e-9, "{kind} {k}: {of_cut} {of_whole}");
        }
    }
}

#[test]
fn twenty_nonlinear_plants_from_far_starts() {
    let (found, tried) = compare(NONLINEAR, 0.05, 800);
    println!("{found} of {tried}");
    assert!(found * 100 >= tried * 95, "{found} of {tried}");
}

/// The slopes at a start where nothing is known of the borders between segments, against those of the record as a whole, in
/// units in which each column has length one: plants that forget within a segment and such that do not.
#[test]
fn the_first_slopes_are_those_of_the_whole_record() {
    use greybox::optimize::LeastSquares;
    for (kind, p) in AFFINE.flat_map(|kind| [1.3, 0.2, 0.03].map(|p| (kind, p))) {
        let record = record(kind, 0.05, 1_500).initial(State { a: free(0.2), b: fixed(0.1) });
        let gradient = |whole: bool| {
            let model = Plant { kind, whole };
            let problem = Fit::new(&model, &record)
                .parameters(Coefficients { p: free(p), q: free(0.5), r: free(0.7) })
                .noise(Output { y: 0.05 })
                .integrator(Rk4::default())
                .problem()
                .unwrap();
            let objective = problem.objective().unwrap();
            let linear = objective.linearize(&objective.start()).unwrap();
            let size = linear.column_norms().into_iter().map(move |norm| norm * (2.0 * linear.cost).sqrt());
            (linear.gradient(), size.collect::<Vec<_>>())
        };
        let ((cut, sizes), (whole, _)) = (gradient(false), gradient(true));
        for ((a, b), size) in cut.into_iter().zip(whole).zip(sizes) {
            // What the guesses are off by may change the squared errors by a millionth, and the slopes by its root.
            assert!((a - b).abs() <= 1e-3 * size, "plant {kind}, p = {p}: {a} {b} of {size}");
        }
    }
}

/// `da/dt = (u - p a) q`, measured; `whole` as for [`Plant`].
struct Measured {
    whole: bool,
}

signals! { pub struct Rates { p: "", q: "" } }

impl Model for Measured {
    type State = Output;
    type Input = Input;
    type Output = Output;
    type Parameters = Rates;

    fn derivative<S: Scalar>(&self, _t: S, x: &Output<S>, u: &Input<S>, c: &Rates<S>) -> Output<S> {
        if self.whole {
            let _ = x.y.value();
        }
        Output { y: (u.u - c.p * x.y) * c.q }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Output<S>, _u: &Input<S>, _c: &Rates<S>) -> Output<S> {
        *x
    }
}

/// Predictions further ahead than a segment is long: each measurement counts once, in the cut record as in the whole.
#[test]
fn a_horizon_beyond_a_segment_counts_each_measurement_once() {
    let inputs: Vec<_> = record(0, 0.0, 1_000).inputs().collect();
    let fit = |whole: bool| {
        let (model, time) = (Measured { whole }, Time::Uniform { start: 0.0, step: 0.05 });
        let run = Simulator::new(&model).run(&Rates { p: 1.1, q: 0.7 }, &Output { y: 0.0 }, time, &inputs).unwrap();
        let record = run.with_noise(Output { y: 0.05 }, 3).experiment(&model).unwrap();
        let fit = Fit::new(&model, &record).parameters(Rates { p: free(1.2), q: free(0.6) });
        fit.integrator(Rk4::default()).predictor(Horizon::new(300)).run().unwrap().into_summary()
    };
    let (cut, whole) = (fit(false), fit(true));
    assert_eq!((cut.measurements, whole.measurements), (1_000, 1_000));
    for (a, b) in cut.unknowns.iter().zip(&whole.unknowns) {
        let error = b.knowledge.standard_error().unwrap();
        // What the search leaves: a relative step of 1e-8.
        assert!((a.value - b.value).abs() < 1e-3 * error, "{a:?} {b:?}");
        assert!((a.knowledge.standard_error().unwrap() / error - 1.0).abs() < 1e-3, "{a:?} {b:?}");
    }
}

/// The axis of the benchmark EMPS with its dry friction, under its digital controller; `whole` as for [`Plant`].
struct Axis {
    whole: bool,
}

impl Model for Axis {
    type State = ControlledAxisMotion;
    type Input = Reference;
    type Output = ControlledAxisOutput;
    type Parameters = AxisParameters;

    fn derivative<S: Scalar>(
        &self,
        t: S,
        x: &ControlledAxisMotion<S>,
        u: &Reference<S>,
        p: &AxisParameters<S>,
    ) -> ControlledAxisMotion<S> {
        if self.whole {
            let _ = x.v.value();
        }
        PositioningLoop::EMPS.derivative(t, x, u, p)
    }

    fn jump<S: Scalar>(
        &self,
        t: S,
        x: &ControlledAxisMotion<S>,
        u: &Reference<S>,
        p: &AxisParameters<S>,
    ) -> ControlledAxisMotion<S> {
        PositioningLoop::EMPS.jump(t, x, u, p)
    }

    fn initial<S: Scalar>(&self, u: &Reference<S>, p: &AxisParameters<S>) -> ControlledAxisMotion<S> {
        PositioningLoop::EMPS.initial(u, p)
    }

    fn output<S: Scalar>(
        &self,
        t: S,
        x: &ControlledAxisMotion<S>,
        u: &Reference<S>,
        p: &AxisParameters<S>,
    ) -> ControlledAxisOutput<S> {
        PositioningLoop::EMPS.output(t, x, u, p)
    }
}

/// The axis goes to and fro and rests between, where its friction turns over within half a millimeter per second.
#[test]
fn an_axis_with_dry_friction_is_fitted_in_segments() {
    let place =
        |k: usize| 0.1 + 0.05 * (0.5 - 0.5 * (0.006 * k as f64).cos()) * f64::from(u8::from(k / 1_047 % 3 != 1));
    let inputs: Vec<_> = (0..4_200).map(|k| Reference { qg: place(k) }).collect();
    let rest = ControlledAxisMotion { q: 0.1, v: 0.0, moved: 0.0, before: 0.0, held: 0.0 };
    let (truth, time) =
        (AxisParameters { m: 95.0, fv: 200.0, fc: 20.0, offset: -3.0 }, Time::Uniform { start: 0.0, step: 1e-3 });
    let model = Axis { whole: false };
    let run = Simulator::new(&model).hold(Hold::First).run(&truth, &rest, time, &inputs).unwrap();
    let noise = ControlledAxisOutput { qm: 1e-6, vir: 0.05 };
    let record = run.with_noise(noise, 3).experiment(&model).unwrap();
    for [m, fv, fc] in [[80.0, 150.0, 15.0], [150.0, 400.0, 40.0], [60.0, 60.0, 60.0]] {
        let fit = |whole: bool| {
            let start = AxisParameters { m: free(m), fv: free(fv), fc: free(fc), offset: free(0.0) };
            let model = Axis { whole };
            let fit = Fit::new(&model, &record).parameters(start).noise(noise).integrator(Rk4::default());
            fit.run().unwrap().into_summary()
        };
        let (cut, whole) = (fit(false), fit(true));
        assert!(whole.method.engine.contains("dual") && cut.method.engine.contains("graph"));
        assert!(cut.outcome.converged() && whole.outcome.converged(), "{} {}", cut.outcome, whole.outcome);
        assert!((cut.cost - whole.cost).abs() <= 1e-8 * whole.cost, "{} {}", cut.cost, whole.cost);
        for (a, b) in cut.unknowns.iter().zip(&whole.unknowns) {
            let error = b.knowledge.standard_error().unwrap();
            assert!((a.value - b.value).abs() <= 1e-3 * error, "{}: {} {}", a.name, a.value, b.value);
            assert!((a.knowledge.standard_error().unwrap() / error - 1.0).abs() <= 1e-4, "{a:?} {b:?}");
        }
    }
}
