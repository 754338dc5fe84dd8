use super::*;
use crate::problem::{Control, Whitening};
use crate::{ExperimentOf, Fit, Model, Nothing, Rk4, Scalar, Time, fixed, free, signals};

signals! { struct Swing { angle: "rad", rate: "rad/s" } }
signals! { struct Angle { angle: "rad" } }
signals! { struct Constants { pull: "1/s^2", drag: "1/s" } }

/// A pendulum.
#[derive(Clone)]
struct Pendulum;

impl Model for Pendulum {
    type State = Swing;
    type Input = Nothing;
    type Output = Angle;
    type Parameters = Constants;

    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, p: &Constants<S>) -> Swing<S> {
        Swing { angle: x.rate, rate: -p.pull * x.angle.sin() - p.drag * x.rate }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, _p: &Constants<S>) -> Angle<S> {
        Angle { angle: x.angle }
    }
}

fn record(samples: usize, angle: f64) -> ExperimentOf<Pendulum> {
    let (truth, from) = (Constants { pull: 4.0, drag: 0.3 }, Swing { angle, rate: 0.5 });
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let run = crate::simulate(&Pendulum, &truth, &from, time, &vec![Nothing; samples]).unwrap();
    run.with_noise(Angle { angle: 0.02 }, 5).experiment(&Pendulum).unwrap()
}

/// Two records of different lengths, the first with a given initial rate, one parameter by logarithm with a prior and one for each record.
fn problem() -> crate::problem::Problem<'static> {
    let records = [record(60, 1.0).initial(Swing { angle: free(0.9), rate: fixed(0.5) }), record(45, -2.0)];
    let start = Constants { pull: free(3.0).log().prior(3.5, 1.0), drag: free(0.4).per_experiment() };
    Fit::new(&Pendulum, &records).parameters(start).integrator(Rk4::default()).problem().unwrap()
}

/// A point with nodes off the trajectory, so that no gap is closed.
fn point(shooting: &Shooting<'_>, start: &[f64]) -> Vec<f64> {
    let node = |e: usize, k: usize| vec![0.3 + 0.1 * k as f64 - e as f64, 0.2 * k as f64 - 0.5];
    let nodes: Vec<Vec<Vec<f64>>> =
        (0..2).map(|e| (0..shooting.nodes_at(e).len()).map(|k| node(e, k)).collect()).collect();
    shooting.point(start, &nodes)
}

/// The slopes of the cost with respect to each unknown, nodes and a parameter of one record among them, are those of central differences: their
/// error is that of rounding and of third derivatives.
#[test]
fn slopes_are_those_of_the_cost() {
    let problem = problem();
    let objective = problem.in_units(&Control::NEVER).with(Whitening::Diagonal(vec![0.02]));
    let mut shooting = Shooting::new(&objective, 12, vec![1.0, 2.0], 30.0);
    let gaps: Vec<f64> = (0..shooting.multipliers.len()).map(|i| (i as f64).cos()).collect();
    shooting.tighten(&gaps, true);
    assert_eq!((shooting.count(), shooting.penalty), (5 + 3, 30.0));
    let x = point(&shooting, &objective.start());
    let linear = shooting.linearize(&x).unwrap();
    // The measurements, and the prior.
    assert_eq!((linear.unknowns(), linear.rows()), (x.len(), 105 + 1));
    assert_eq!(
        (shooting.bounds().len(), shooting.sizes().len(), shooting.logarithms().len()),
        (x.len(), x.len(), x.len())
    );
    for (i, slope) in linear.gradient().into_iter().enumerate() {
        let cost = |by: f64| {
            let mut moved = x.clone();
            moved[i] += by;
            shooting.linearize(&moved).unwrap().cost
        };
        let difference = (cost(1e-5) - cost(-1e-5)) / 2e-5;
        assert!((slope - difference).abs() < 1e-5 * linear.cost, "{i}: {slope} {difference}");
    }
}

/// A point of the fit and nodes come back, and the gaps are those between simulations of the pieces and the nodes.
#[test]
fn gaps_of_a_trajectory_are_closed() {
    let problem = problem();
    let objective = problem.in_units(&Control::NEVER);
    let start = objective.start();
    let shooting = Shooting::new(&objective, 12, vec![1.0, 2.0], 1.0);
    let nodes = |e: usize| objective.carries(e, &start, &shooting.nodes_at(e)).unwrap();
    let x = shooting.point(&start, &[nodes(0), nodes(1)]);
    assert_eq!(shooting.coordinates(&x), start);
    assert_eq!(shooting.nodes(&x)[1][0], (15, nodes(1)[0].clone()));
    let passed = shooting.pass(&x).unwrap();
    // The same steps from the same states, but by another order of operations.
    assert!(passed.gaps.len() == 2 * (4 + 2) && passed.gaps.iter().all(|gap| gap.abs() < 1e-12), "{:?}", passed.gaps);
    // The prior counts 0.5 (0.5 / 1)^2.
    assert!(((passed.cost + 0.125) / objective.cost_at(&start).unwrap() - 1.0).abs() < 1e-10);
    // A node that is moved by 0.5 rad/s leaves a gap of -0.25 sizes before it.
    let mut moved = x.clone();
    moved[shooting.node(1, 1).start + 1] += 0.5;
    let gaps = shooting.pass(&moved).unwrap().gaps;
    assert!((gaps[8 + 1] + 0.25).abs() < 1e-12 && gaps[..8].iter().all(|gap| gap.abs() < 1e-12), "{gaps:?}");
}

/// Multipliers move by the penalty times the gaps, the penalty rises tenfold where gaps did not shrink, and logarithms go no further than 1.5 in a
/// search.
#[test]
fn what_changes_between_searches() {
    let problem = problem();
    let objective = problem.in_units(&Control::NEVER);
    let mut shooting = Shooting::new(&objective, 12, vec![1.0, 2.0], 2.0);
    shooting.tighten(&[0.5; 12], false);
    shooting.tighten(&[0.25; 12], true);
    assert_eq!((shooting.penalty, shooting.multipliers[3]), (20.0, 2.0 * 0.5 + 20.0 * 0.25));
    let x = point(&shooting, &objective.start());
    shooting.begin_at(&x);
    let bounds = shooting.bounds();
    assert_eq!(bounds[0], (x[0] - 1.5, x[0] + 1.5));
    let at = |by: f64| [&[x[0] + by], &x[1..]].concat();
    assert_eq!([0.0, 1.4, 1.5, -1.5].map(|by| shooting.is_stopped(&at(by))), [false, false, true, true]);
    assert!(bounds[1..].iter().all(|bound| *bound == (f64::NEG_INFINITY, f64::INFINITY)));
}

#[test]
fn pieces_cover_a_record() {
    assert_eq!(cut(10, 4), [0..5, 5..10]);
    assert_eq!(cut(3, 8), std::iter::once(0..3).collect::<Vec<_>>());
    assert_eq!(cut(3, 0), [0..1, 1..2, 2..3]);
}
