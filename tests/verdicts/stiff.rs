//! What is called converged is a minimum, of a stiff model from far starts, too.

use crate::random::Random;
use greybox::{
    Esdirk, Estimate, ExperimentOf, Fit, Model, Nothing, Of, Parameter, Scalar, Severity, Signals, Simulator, Time,
    fixed, free, signals,
};

signals! { pub struct Species { y1: "1", y2: "1", y3: "1", y4: "1", y5: "1", y6: "1", y7: "1", y8: "1" } }
signals! { pub struct Constants { k1: "1/s", k2: "1/s", k3: "1/s", k4: "1/s", k5: "1/s", kp: "1/s" } }

/// HIRES: the high irradiance response of photomorphogenesis, after E. Schäfer (1975), in the constants of E. Hairer and
/// G. Wanner, Solving Ordinary Differential Equations II, section IV.10.
#[derive(Clone)]
struct Hires;

impl Model for Hires {
    type State = Species;
    type Input = Nothing;
    type Output = Species;
    type Parameters = Constants;
    fn derivative<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, p: &Constants<S>) -> Species<S> {
        let bound = p.kp * x.y6 * x.y8 - x.y7 * 1.81;
        Species {
            y1: -p.k1 * x.y1 + p.k2 * x.y2 + p.k3 * x.y3 + 0.0007,
            y2: p.k1 * x.y1 - x.y2 * 8.75,
            y3: x.y3 * -10.03 + p.k2 * x.y4 + p.k5 * x.y5,
            y4: p.k3 * x.y2 + p.k1 * x.y3 - x.y4 * 1.12,
            y5: x.y5 * -1.745 + p.k2 * x.y6 + p.k2 * x.y7,
            y6: -p.kp * x.y6 * x.y8 + p.k4 * x.y4 + p.k1 * x.y5 - p.k2 * x.y6 + p.k4 * x.y7,
            y7: bound,
            y8: -bound,
        }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, _p: &Constants<S>) -> Species<S> {
        *x
    }
}

const TRUTH: Constants = Constants { k1: 1.71, k2: 0.43, k3: 8.32, k4: 0.69, k5: 0.035, kp: 280.0 };

fn record() -> ExperimentOf<Hires> {
    let start = Species { y1: 1.0, y8: 0.0057, ..Species::default() };
    // Dense at first, to 320 s in all.
    let times: Vec<f64> = (0..60).map(|k| 320.0 * (f64::from(k) / 59.0).powi(3)).collect();
    let exact = Esdirk { relative: 1e-10, absolute: 1e-14 };
    let run =
        Simulator::new(&Hires).integrator(exact).run(&TRUTH, &start, Time::Stamps(times), &[Nothing; 60]).unwrap();
    let largest = |j: usize| run.outputs.iter().map(|y| Species::into_array(*y)[j]).fold(0.0, f64::max);
    let noise = Species::from_fn(|j| 0.01 * largest(j));
    run.with_noise(noise, 4).experiment(&Hires).unwrap().initial(Species::map(start, fixed))
}

fn fit(record: &ExperimentOf<Hires>, start: Of<Constants, Parameter>) -> Result<Estimate<Hires>, greybox::Error> {
    let esdirk = Esdirk { relative: 1e-7, absolute: 1e-10 };
    Fit::new(&Hires, record).parameters(start).integrator(esdirk).run()
}

/// From starts that are up to three times off, the fastest constant a hundred times (further off, the model itself explodes). A
/// search from the end of another, moved by a hundredth, does not find a lower cost where that said to have converged; and
/// where it is usable, it is the truth within five standard errors.
#[test]
#[cfg_attr(debug_assertions, ignore = "an implicit method from far starts takes an optimized build")]
fn a_stiff_model_from_far_starts_is_at_a_minimum_or_says_that_it_is_not() {
    let record = record();
    let truth = Constants::into_array(TRUTH);
    let mut usable = 0;
    for seed in 0..6 {
        let mut random = Random(seed);
        let mut factor = |spread: f64| (spread.ln() * (2.0 * random.uniform() - 1.0)).exp();
        let start = Constants::from_fn(|i| free(truth[i] * factor(if i == 5 { 100.0 } else { 3.0 })).log());
        let Ok(estimate) = fit(&record, start) else { continue };
        println!("{estimate}");
        if !estimate.outcome.converged() {
            assert_eq!(estimate.severity(), Severity::NotUsable, "{estimate}");
            continue;
        }
        let moved = Constants::from_fn(|i| free(estimate.summary().parameters[i].value * factor(1.01)).log());
        let again = fit(&record, moved).unwrap();
        // To the square of the tolerance of a hundredth of a standard error.
        assert!(
            again.cost > estimate.cost * (1.0 - 1e-4),
            "{seed}: {} after {}\n{estimate}\n{again}",
            again.cost,
            estimate.cost
        );
        if estimate.severity() == Severity::Usable {
            usable += 1;
            for (unknown, truth) in estimate.unknowns.iter().zip(truth) {
                let error = unknown.knowledge.standard_error().unwrap();
                assert!((unknown.value - truth).abs() < 5.0 * error, "{estimate}");
            }
        }
    }
    assert!(usable > 0);
}

/// From starts that are up to ten times off the model itself grows beyond all numbers in half of the cases, which is an error. What
/// has converged is the truth within five standard errors; three of these ten starts lead there.
#[test]
#[cfg_attr(debug_assertions, ignore = "an implicit method from far starts takes an optimized build")]
fn a_stiff_model_from_starts_ten_times_off_converges_at_the_truth_or_not_at_all() {
    let (record, truth, mut random) = (record(), Constants::into_array(TRUTH), Random(1));
    let mut right = 0;
    for number in 0..10 {
        let mut factor = || (10f64.ln() * (2.0 * random.uniform() - 1.0)).exp();
        let start = Constants::from_fn(|i| free(truth[i] * factor()).log());
        let Ok(estimate) = fit(&record, start) else { continue };
        println!("{number}: {}", estimate.outcome);
        if estimate.outcome.converged() {
            right += 1;
            for (unknown, truth) in estimate.unknowns.iter().zip(truth) {
                let error = unknown.knowledge.standard_error().unwrap();
                assert!((unknown.value - truth).abs() < 5.0 * error, "{estimate}");
            }
        }
    }
    assert!(right >= 3, "{right}");
}
