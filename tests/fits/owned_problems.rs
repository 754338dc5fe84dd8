//! A problem outlives the model and the records that it was made of.

use crate::common::{Branch, Current, Lag, Voltage, levels, simulated};
use greybox::{ExperimentOf, Fit, Huber, Problem, Sample, Summary, free, report::Report};

fn record() -> ExperimentOf<Lag> {
    let inputs = levels(900, 12, 5).into_iter().map(|u| Voltage { u }).collect();
    simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, Branch { gain: 2.0, tau: 0.05 })
}

fn fit<'a>(model: &'a Lag, record: &'a ExperimentOf<Lag>, least: f64) -> Fit<'a, Lag> {
    Fit::new(model, record)
        .parameters(Branch { gain: free(1.0), tau: free(0.1) })
        .loss(Huber::default())
        .weighting(move |s: &Sample<Lag>| s.u.u.abs().max(least))
}

/// Model, record and what the weighting captures end with this function.
fn problem(least: f64) -> Problem<'static> {
    let (model, record) = (Lag, record());
    fit(&model, &record, least).problem().unwrap()
}

fn text(summary: Summary) -> String {
    serde_json::to_string(&Summary { seconds: 0.0, ..summary }).unwrap()
}

#[test]
fn a_problem_is_returned_and_run_by_a_thread() {
    let (model, record) = (Lag, record());
    let expected = fit(&model, &record, 0.1).run().unwrap().into_summary();
    let problem = problem(0.1);
    let found = std::thread::spawn(move || {
        let found = problem.run().unwrap();
        Report::new(&problem, &found).unwrap();
        found
    });
    assert_eq!(text(found.join().unwrap()), text(expected));
}
