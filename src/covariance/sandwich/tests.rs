//! The parts of a filtered sandwich.

use super::*;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, Fit, Time, free};

/// What is measured in either of two pieces of a record is measured, and the slopes of both are kept.
#[test]
fn pieces_of_a_record_join() {
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let record = Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 4], vec![Current { i: 1.0 }; 4]).unwrap();
    let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
    let objective = problem.objective().unwrap();
    let piece = |slopes: [f64; 4], measured: [bool; 4]| Backward {
        objective: &objective,
        experiment: 0,
        columns: 1,
        samples: 4,
        slopes: slopes.to_vec(),
        measured: measured.to_vec(),
    };
    // Backward in time, so that the earlier piece is behind the later one.
    let mut whole = piece([0.0, 0.0, 3.0, 4.0], [false, false, false, true]);
    whole.append(piece([1.0, 2.0, 0.0, 0.0], [true, false, false, false]));
    assert_eq!((whole.slopes, whole.measured), (vec![1.0, 2.0, 3.0, 4.0], vec![true, false, false, true]));
}

#[test]
fn a_quadratic_form() {
    let m = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 5.0]);
    assert_eq!(form(&m, &[3.0, -2.0]), 2.0 * 9.0 + 5.0 * 4.0 - 12.0);
}

/// The variance of filtered white noise at each sample, by the filter's response to one impulse.
#[test]
fn variance_after_a_filter() {
    let filter = Butterworth::low_pass(2, 0.1, 1.0).unwrap();
    let mut impulse = vec![0.0; 30];
    impulse[0] = 1.0;
    filter.filter_rows(&mut impulse, 1, &mut vec![]);
    let mut variance = ImpulseResponse::new(&filter);
    for k in 0..30 {
        let expected: f64 = impulse[..=k].iter().map(|response| response * response).sum();
        assert!((variance.next() - expected).abs() < 1e-15, "{k}");
    }
}
