//! The goal: Ke within 0.1 % and R within 1 % at every speed on all six axes of the disturbed robot. A debug build looks
//! at every third cycle, release at each.
//!
//! The estimators are told what a user knows: that dead time and the EMF's sixth harmonic exist, of what shape, and that
//! resistance and harmonic do not change from cycle to cycle.

use crate::acceptance_records::{Worst, cycles, every, filter, percent};
use greybox::pmsm::offline::{Extended, Spans, extended, search_i0};
use greybox::pmsm::robot::TS;
use greybox::pmsm::{Compensated, CompensatedSalientWinding, EmfHarmonic, ExactSalient, ExactStep, HeldIn};
use greybox::{Fit, PooledRegression, free};
use std::sync::OnceLock;

/// What all cycles of an axis share.
const SHARED: Extended<bool> = Extended { r: true, ld: false, lq: false, lq2: false, ke: false, ke6: true, vdt: false };

fn each_cycle(number: u8) -> Vec<Spans> {
    let record = cycles(number);
    record.cycles.iter().step_by(every(3)).map(|cycle| record.spans.cut(cycle.samples.clone())).collect()
}

fn pooled(spans: &[Spans], i0: f64) -> PooledRegression<Extended> {
    let sets = spans.iter().map(|spans| extended(spans, i0).prefiltered(&filter()).regression());
    PooledRegression::new(sets, SHARED)
}

/// The current (A) at which the dead time of an axis turns over, found from all its cycles.
fn turnover(number: u8, spans: &[Spans]) -> f64 {
    static FOUND: [OnceLock<f64>; 6] = [const { OnceLock::new() }; 6];
    let search = || search_i0(0.03, 1.0, |i0| pooled(spans, i0).least_squares()).unwrap();
    *FOUND[number as usize - 1].get_or_init(search)
}

// Measured on all cycles: Ke at most 0.017 to 0.059 % off, R 0.018 to 0.068 % (the simulated plant's own step leaves 0.03 %
// of Ke at the highest speed).
#[test]
fn extended_regression_with_pooled_resistance() {
    for number in 1..=6 {
        let record = cycles(number);
        let spans = each_cycle(number);
        let i0 = turnover(number, &spans);
        let mut worst = Worst([0.0; 2]);
        for found in pooled(&spans, i0).solve().unwrap() {
            let p = found.parameters;
            worst.see([percent(p.ke, record.axis.ke), percent(p.r, record.axis.rs + record.axis.r_cable)]);
        }
        println!("axis {number}: i0 {i0:.4} A, Ke, R off by at most {:.4?} %", worst.0);
        assert!(worst.0[0] < 0.1 && worst.0[1] < 1.0, "axis {number}: Ke, R {:?} %", worst.0);
    }
}

// The thesis' method (5.2.3): currents simulated in exact steps and compared with the measured ones. Measured on all cycles:
// Ke at most 0.016 to 0.057 % off, R 0.064 to 0.34 %.
#[test]
fn grey_box_with_harmonic_and_common_resistance() {
    let step = ExactStep::new(4, TS, HeldIn::Stationary).unwrap();
    let motor = EmfHarmonic::<_, CompensatedSalientWinding>::new(ExactSalient(step));
    let model = Compensated::<_, CompensatedSalientWinding>::new(motor);
    for number in 1..=6 {
        let axis = cycles(number).axis;
        let spans = each_cycle(number);
        let i0 = turnover(number, &spans);
        let records: Vec<_> = spans.iter().map(|spans| spans.grey_box(&model, i0).unwrap()).collect();
        let start = CompensatedSalientWinding {
            rs: free(1.5 * axis.rs),
            ld: free(1.2 * axis.ls),
            lq: free(1.2 * axis.ls).per_experiment(),
            ke: free(0.9 * axis.ke).per_experiment(),
            ke6: free(0.0),
            vdt: free(0.0).per_experiment(),
        };
        let estimate = Fit::new(&model, &records).parameters(start).run().unwrap();
        let mut worst = Worst([0.0; 2]);
        worst.see([0.0, percent(estimate.parameters.rs, axis.rs + axis.r_cable)]);
        let mut found = 0;
        for ke in estimate.unknowns.iter().filter(|unknown| unknown.name.starts_with("ke [")) {
            worst.see([percent(ke.value, axis.ke), 0.0]);
            found += 1;
        }
        println!("axis {number}: i0 {i0:.4} A, Ke, R off by at most {:.4?} %", worst.0);
        assert_eq!(found, records.len());
        assert!(worst.0[0] < 0.1 && worst.0[1] < 1.0, "axis {number}: Ke, R {:?} %", worst.0);
    }
}
