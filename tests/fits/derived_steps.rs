#![cfg(feature = "std")]
//! Quantities computed from the parameters, in steps.

use crate::common::*;
use greybox::diagnose::derived;
use greybox::*;

/// A quantity that has no slope in a parameter is known exactly where it is the same within the interval, else not at all: each of two parameters alone may change
/// nothing.
#[test]
fn a_step_within_an_interval_leaves_no_standard_error() {
    let mut noise = Noise(3);
    let inputs = levels(200, 9, 3).into_iter().map(|u| Voltage { u }).collect();
    let run = simulated(&Rl, 0.01, inputs, Current::default(), Coil { r: 2.0, l: 0.05 });
    let record = noisy(&Rl, &run, Current { i: 0.01 }, &mut noise);
    let fit = Fit::new(&Rl, &record).parameters(Coil { r: free(1.0), l: free(0.1) }).run().unwrap();
    let error = fit.knowledge.r.standard_error().unwrap();
    // In units of the standard error the value is somewhere between two whole numbers, and an interval is four wide.
    let whole = derived(&fit, "whole", |p| (p.r * (1.0 / error)).floor());
    assert!(whole.value.is_finite() && whole.standard_error.is_none() && whole.interval.is_none(), "{whole:?}");
    let far = derived(&fit, "far", |p| (p.r * 0.4).floor());
    assert_eq!((far.value, far.standard_error, far.interval), (0.0, Some(0.0), Some((0.0, 0.0))));
    // A step between the corner of both intervals and the estimate, beyond each interval alone.
    let [r, l] = [fit.parameters.r, fit.parameters.l];
    let [(_, r_up), (_, l_up)] = ["r", "l"].map(|name| fit.interval(name, 0.95).unwrap());
    let corner = derived(&fit, "corner", |p| {
        let sum = (p.r - r) * (1.0 / (r_up - r)) + (p.l - l) * (1.0 / (l_up - l));
        (sum * (1.0 / 1.5)).floor().max(Dual::from(0.0))
    });
    assert!(corner.value == 0.0 && corner.standard_error.is_none(), "{corner:?}");
}
