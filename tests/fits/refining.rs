//! Fits whose integrator was not chosen take a finer one where the default step would decide the answer.

use crate::far_starts::{Coupled, Coupling, coupled};
use approx::assert_relative_eq;
use greybox::optimize::{Outcome, Severity};
use greybox::*;

/// Steps of 1 ms; a stiffness of `c` turns by `sqrt(150 c) / 1000` rad in one. Without friction.
fn record(c: f64, d: f64) -> (Coupling, ExperimentOf<Coupled>) {
    let p = Coupling { j1: 1e-2, j2: 2e-2, c, d, f: 0.0 };
    (p, coupled(p, 0.002))
}

fn near(p: Coupling) -> Coupling<Parameter> {
    let start = Coupling { j1: 1.1 * p.j1, j2: p.j2 / 1.1, c: 1.001 * p.c, ..p };
    Coupling { f: fixed(0.0), ..Coupling::map(start, free) }
}

/// From a step that is fine to one with which Runge-Kutta's method is unstable.
#[test]
fn the_default_method_is_as_fine_as_the_plant_asks_for() {
    for (c, d, method) in [
        (5.0, 0.02, "1 step per sample"),
        (3e3, 0.1, "4 steps per sample"),
        (6e4, 0.5, "16 steps per sample"),
        (1e6, 5.0, "64 steps per sample"),
    ] {
        let (truth, record) = record(c, d);
        let fit = Fit::new(&Coupled, &record).parameters(near(truth)).run().unwrap();
        println!("{fit}");
        assert!(fit.method.integrator.contains(method), "{c}: {}", fit.method.integrator);
        assert!(fit.severity() < Severity::NotUsable, "{fit}");
        assert!(fit.warnings.iter().all(|warning| warning.code != WarningCode::CoarseStep), "{fit}");
        // Each trial step is an evaluation, and so is the start of each method.
        assert!(fit.evaluations > fit.iterations, "{} {}", fit.evaluations, fit.iterations);
        // The stiffest plant turns by 12 rad in a sample: its stiffness has aliases, its inertias have none.
        let told = if c < 1e6 { 4 } else { 2 };
        for (unknown, truth) in fit.unknowns.iter().zip(Coupling::into_array(truth)).take(told) {
            // Four standard errors: one of 16 is further out in a tenth of a percent of all records.
            if let Some(error) = unknown.knowledge.standard_error() {
                assert!((unknown.value - truth).abs() < 4.0 * error, "{c}: {unknown:?} for {truth}");
            }
        }
        // What is made of the estimate uses the same method.
        let problem = Fit::new(&Coupled, &record).parameters(near(truth)).problem().unwrap();
        let found = problem.run().unwrap();
        assert_eq!((found.cost, &found.method), (fit.cost, &fit.method));
        let again = fit.predict(&Coupled, &record).unwrap().quality.first.rmse;
        assert_relative_eq!(again, fit.quality.first.rmse, max_relative = 1e-9);
        let report = Report::new(&problem, &found).unwrap();
        assert_eq!(report.estimate.method.integrator, fit.method.integrator);
    }
}

/// A method that was chosen stays, and a warning says that it is too coarse.
#[test]
fn a_method_that_was_chosen_stays() {
    let (truth, record) = record(3e3, 0.1);
    let fit = Fit::new(&Coupled, &record).parameters(near(truth)).integrator(Rk4 { substeps: 1 }).run().unwrap();
    assert!(fit.method.integrator.contains("1 step per sample"), "{fit}");
    let warning = fit.warnings.iter().find(|warning| warning.code == WarningCode::CoarseStep).unwrap();
    assert!(warning.severity == Severity::UsableWithCare && warning.text.contains("2 steps per sample"), "{fit}");
    // By how much of itself which unknown would move: what half the step moves it by, but for the second order.
    let finer = Fit::new(&Coupled, &record).parameters(near(truth)).integrator(Rk4 { substeps: 2 }).run().unwrap();
    let (before, after) = warning.text.split_once("` would move by ").unwrap();
    let name = before.rsplit('`').next().unwrap();
    let value = |fit: &Estimate<Coupled>| fit.unknowns.iter().find(|unknown| unknown.name == name).unwrap().value;
    let moved = 100.0 * (value(&finer) / value(&fit) - 1.0).abs();
    let said: f64 = after.split(' ').next().unwrap().parse().unwrap();
    assert!((said / moved - 1.0).abs() < 0.2, "{moved} {}", warning.text);
}

/// A fleet takes records to the method that single fits take them to, also where the start overflows with the default step.
#[test]
fn a_fleet_refines_as_single_fits_do() {
    for (c, d) in [(5.0, 0.02), (3e3, 0.1), (6e4, 0.5), (1e6, 5.0)] {
        let (truth, record) = record(c, d);
        let single = Fit::new(&Coupled, &record).parameters(near(truth)).run().unwrap();
        let fleet = Fleet::new(&Coupled).parameters(near(truth)).fleet().unwrap();
        for answer in fleet.run(vec![record.clone(); 3]) {
            let answer = answer.unwrap();
            assert_eq!(answer.method.integrator, single.method.integrator);
            assert_eq!(answer.outcome.converged(), single.outcome.converged());
            for (a, b) in answer.unknowns.iter().zip(&single.unknowns) {
                // Two orders of the same sums; unknowns are found to 1e-8 of a standard error or so.
                let error = b.knowledge.standard_error().unwrap_or(f64::INFINITY);
                assert!((a.value - b.value).abs() < 1e-5 * error, "{c}: {} {} {}", a.name, a.value, b.value);
            }
        }
    }
}

/// The cost of an implicit method jumps with the number of its steps: a search that finds no way down says by how much, and how
/// far away the minimum of a finer tolerance is, which is no stall.
#[test]
fn a_cost_as_rough_as_its_tolerance_is_no_stall() {
    let (truth, record) = record(1e6, 5.0);
    let coarse = Esdirk { relative: 1e-6, absolute: 1e-9 };
    let fit = Fit::new(&Coupled, &record).parameters(near(truth)).integrator(coarse).run().unwrap();
    let Outcome::Rough { noise, errors } = fit.outcome else { panic!("{}", fit.outcome) };
    // The plant turns by 12 rad in each of 1,000 samples, so that tolerances add up to a thousandth of the cost or so, which may
    // hide a step of a standard error.
    assert!((1e-5..1e-2).contains(&noise) && (0.1..10.0).contains(&errors), "{}", fit.outcome);
    assert!(!fit.outcome.converged() && fit.severity() == Severity::NotUsable, "{fit}");
}

/// A search that creeps at a minimum of its own tolerance, from which that of a finer one is standard errors away (the errors of
/// its steps add up in an oscillation that hardly decays), has converged.
#[test]
fn a_minimum_of_a_tolerance_is_no_stall() {
    let (truth, record) = record(6e4, 0.5);
    let coarse = Esdirk { relative: 1e-6, absolute: 1e-9 };
    for off in [1.001, 1.05] {
        let start = Coupling { c: free(off * truth.c), ..near(truth) };
        let fit = Fit::new(&Coupled, &record).parameters(start).integrator(coarse).run().unwrap();
        assert!(fit.outcome.converged() && fit.severity() < Severity::NotUsable, "{fit}");
        // Five: three for the noise of this record, and the bias.
        for (unknown, truth) in fit.unknowns.iter().zip(Coupling::into_array(truth)) {
            let error = unknown.knowledge.standard_error().unwrap();
            assert!((unknown.value - truth).abs() < 5.0 * error, "{fit}");
        }
    }
}
