//! Robust losses whose constant is far below the noise.

use crate::common::{Branch, Current, Lag, Noise, Voltage, levels};
use greybox::loss::{Loss, Tukey};
use greybox::*;

fn said_of(samples: usize, loss: impl Loss + Clone + 'static, seed: u64) -> Option<Severity> {
    let inputs: Vec<Voltage> =
        levels(samples, if samples < 300 { 4 } else { 20 }, seed).into_iter().map(|u| Voltage { u }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.01 };
    let truth = Branch { gain: 2.0, tau: 0.05 };
    let run = simulate(&Lag, &truth, &Current { i: 0.0 }, time.clone(), &inputs).unwrap();
    let mut noise = Noise(seed);
    let outputs = run.outputs.iter().map(|y| Current { i: y.i + 0.1 * noise.gauss() }).collect();
    let record = Experiment::new(&Lag, time, inputs, outputs).unwrap();
    let start = Branch { gain: free(1.8), tau: free(0.06) };
    let fit = Fit::new(&Lag, &record).parameters(start).loss(loss).run().unwrap();
    fit.warnings.iter().find(|warning| warning.code == WarningCode::NarrowLoss).map(|warning| warning.severity)
}

fn said(loss: impl Loss + Clone + 'static, seed: u64) -> Option<Severity> {
    said_of(300, loss, seed)
}

/// Of 300 errors a thousandth of a standard deviation holds none or one; of Tukey's loss a third of one has as much negative slope as
/// positive, nearly. The constants of 95 % efficiency, and absolute errors nearly (a tenth), are wide enough.
#[test]
fn a_loss_that_hardly_any_error_is_within_is_named() {
    for seed in 1..5 {
        for narrow in [1e-9, 1e-3] {
            assert_eq!(said(Huber(narrow), seed), Some(Severity::NotUsable), "Huber {narrow} {seed}");
        }
        assert!(said(Tukey(0.1), seed).is_some(), "{seed}");
        assert_eq!([said(Huber(1.345), seed), said(Huber(0.5), seed), said(Tukey(4.685), seed)], [None; 3], "{seed}");
        // The mean curvature of twelve errors is uncertain, but that is not for the loss.
        assert_eq!(said_of(12, Huber(1.345), seed), None, "{seed}");
    }
}
