//! Records of an independent drive simulator (motulator 0.5.0), averaged and switching, through the offline methods.
#![cfg(feature = "csv")]

use crate::shared::shared;
use greybox::pmsm::offline::{Axes, Extended, Form, Spans, Speed};
use greybox::pmsm::{Compensated, CompensatedWinding, ExactStep, ExactSurface, HeldIn, PolePairs, Surface, Winding};
use greybox::{DataFile, Fit, fixed, free};

const TRUTH: Winding = Winding { rs: 3.6, ls: 42e-3, ke: 2.002_46 };

/// The records that are there, by intervals.
fn records() -> Vec<(&'static str, Spans)> {
    ["spm_avg.csv", "spm_pwm.csv"]
        .into_iter()
        .filter_map(|name| {
            let path = shared(&format!("motulator/{name}"))?;
            let model = Surface::new(3).unwrap();
            let record = DataFile::new(path).column("w", "omega_m").read(&model).unwrap();
            // The speed is that at the sample.
            Some((name, Spans::from_experiment(&record, PolePairs::new(3).unwrap(), Speed::AtSample, 0.0).unwrap()))
        })
        .collect()
}

fn assert_within(name: &str, found: Winding, most: f64) {
    let errors = [found.rs / TRUTH.rs, found.ls / TRUTH.ls, found.ke / TRUTH.ke].map(|ratio| 100.0 * (ratio - 1.0));
    println!("{name}: R, L, Ke off by {errors:.4?} %, limit {most} %");
    assert!(errors.iter().all(|e| e.abs() < most), "{name}: R, L, Ke are off by {errors:?} %");
}

#[test]
fn plain_least_squares_within_two_hundredths_of_a_percent() {
    for (name, spans) in records() {
        for form in [Form::Rotor, Form::Sinc, Form::Stationary] {
            assert_within(name, spans.plain(Axes::Both, form).solve().unwrap().parameters, 0.02);
        }
        assert_within(name, spans.plain(Axes::Q, Form::Stationary).solve().unwrap().parameters, 0.02);
    }
}

#[test]
fn extended_least_squares_within_a_tenth_of_a_percent() {
    for (name, spans) in records() {
        let i0 = Extended::search_i0(0.03, 1.0, |i0| spans.extended(i0).least_squares()).unwrap();
        let p = spans.extended(i0).solve().unwrap().parameters;
        for ls in [p.ld, p.lq] {
            assert_within(name, Winding { rs: p.r, ls, ke: p.ke }, 0.1);
        }
        assert!(p.vdt.abs() < 0.01, "{name}: there is no dead time, found {} V", p.vdt);
    }
}

#[test]
fn grey_box_within_a_tenth_of_a_percent() {
    for (name, spans) in records() {
        let model = Compensated::<_, CompensatedWinding>::new(ExactSurface(
            ExactStep::new(3, spans.ts, HeldIn::Stationary).unwrap(),
        ));
        let record = spans.grey_box(&model, 0.15).unwrap();
        let start = CompensatedWinding {
            rs: free(1.5 * TRUTH.rs),
            ls: free(1.2 * TRUTH.ls),
            ke: free(0.9 * TRUTH.ke),
            vdt: fixed(0.0),
        };
        let p = Fit::new(&model, &record).parameters(start).run().unwrap().parameters;
        assert_within(name, Winding { rs: p.rs, ls: p.ls, ke: p.ke }, 0.1);
    }
}
