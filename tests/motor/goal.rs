//! The goal: Ke within 0.1 % and R within 1 % at every speed on all six axes of the disturbed robot. A debug build looks
//! at every third cycle, release at each.
//!
//! The estimators are told what a user knows: that dead time and the EMF's sixth harmonic exist, of what shape, that
//! resistance, inductances and harmonic do not change from cycle to cycle, and what the data sheet says of Ke and inductance.

use crate::acceptance_records::{Worst, cycles, every, filter, percent};
use greybox::pmsm::offline::{Equations, Extended, Spans};
use greybox::pmsm::program::Cycle;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{Compensated, EmfHarmonic, ExactSalient, ExactStep, HeldIn};
use greybox::{Fit, free, regress::PooledRegression, signals};
use std::sync::OnceLock;

signals! {
    /// A salient motor with a harmonic in its EMF, its cable, and the size of its inverter's dead time.
    pub struct CompensatedSalientWinding { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", ke6: "V s/rad", vdt: "V" }
}

/// What all cycles of an axis share: what belongs to the motor. How dead time acts on the mean voltage depends on how fast the
/// currents pass through zero, and with it on the speed.
const SHARED: Extended<bool> = Extended { r: true, ld: true, lq: true, lq2: true, ke: false, ke6: true, vdt: false };

/// A cycle, and the current (A) at which its dead time turns over.
struct CycleSpans {
    spans: Spans,
    i0: f64,
}

impl CycleSpans {
    fn equations(&self, i0: f64) -> Equations<Extended> {
        self.spans.extended(i0).prefiltered(&filter())
    }
}

/// The cycles of an axis that are looked at.
fn each_cycle(number: u8) -> &'static [CycleSpans] {
    static FOUND: [OnceLock<Vec<CycleSpans>>; 6] = [const { OnceLock::new() }; 6];
    FOUND[number as usize - 1].get_or_init(|| {
        let record = cycles(number);
        let cycle = |cycle: &Cycle| {
            let spans = record.spans.cut(cycle.samples.clone());
            let mut found = CycleSpans { spans: spans.bent(record.axis.ke, record.axis.ls).unwrap(), i0: 0.0 };
            found.i0 = Extended::search_i0(0.03, 1.0, |i0| found.equations(i0).least_squares()).unwrap();
            found
        };
        record.cycles.iter().step_by(every(3)).map(cycle).collect()
    })
}

// Measured on all cycles: Ke at most 0.018 to 0.028 % off, R 0.000 to 0.027 %. With other seeds of the sensors' noise the
// slowest cycle comes to 0.1 % (one of 36 records at 0.105 %).
#[test]
fn extended_regression_with_what_is_the_motors_in_common() {
    for number in 1..=6 {
        let axis = cycles(number).axis;
        let sets = each_cycle(number).iter().map(|cycle| cycle.equations(cycle.i0).regression());
        let mut worst = Worst([0.0; 2]);
        for found in PooledRegression::new(sets, SHARED).solve().unwrap() {
            let p = found.parameters;
            worst.see([percent(p.ke, axis.ke), percent(p.r, axis.rs + axis.r_cable)]);
        }
        println!("axis {number}: Ke, R off by at most {:.4?} %", worst.0);
        assert!(worst.0[0] < 0.1 && worst.0[1] < 1.0, "axis {number}: Ke, R {:?} %", worst.0);
    }
}

// The thesis' method (5.2.3): currents simulated in exact steps and compared with the measured ones. Measured on all cycles:
// Ke at most 0.016 to 0.076 % off, R 0.077 to 0.34 %.
#[test]
fn grey_box_with_harmonic_and_common_resistance() {
    let step = ExactStep::new(4, RobotAxis::TS, HeldIn::Stationary).unwrap();
    let motor = EmfHarmonic::<_, CompensatedSalientWinding>::new(ExactSalient(step));
    let model = Compensated::<_, CompensatedSalientWinding>::new(motor);
    for number in 1..=6 {
        let axis = cycles(number).axis;
        let record = |cycle: &CycleSpans| cycle.spans.grey_box(&model, cycle.i0).unwrap();
        let records: Vec<_> = each_cycle(number).iter().map(record).collect();
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
        println!("axis {number}: Ke, R off by at most {:.4?} %", worst.0);
        assert_eq!(found, records.len());
        assert!(worst.0[0] < 0.1 && worst.0[1] < 1.0, "axis {number}: Ke, R {:?} %", worst.0);
    }
}
