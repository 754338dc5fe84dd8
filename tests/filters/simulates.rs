//! What a fit with process noise says of a simulation.

use crate::common::Noise;
use crate::hardening::{Deflection, Gauges, Hardening, Spring, TRUTH, driven, start};
use greybox::*;

fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) =
        errors.filter(|error| error.is_finite()).fold((0.0, 0), |(sum, n), error| (sum + error * error, n + 1));
    (sum / f64::from(count)).sqrt()
}

/// The estimate tells both errors, in the unit of the output; of records that are not disturbed nothing is said.
#[test]
fn an_estimate_tells_how_far_off_a_simulation_is() {
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let record = driven(&Spring { q: 0.6, r: 0.05, ..TRUTH }, time.clone(), 1500, 3, &mut Noise(4));
    let found = Fit::new(&Hardening, &record).parameters(start()).predictor(Kalman).run().unwrap();
    let told = found.warnings.iter().find(|warning| warning.code == WarningCode::SimulatesWorse).expect("it is told");
    assert_eq!(told.severity, Severity::Usable);
    let inputs: Vec<_> = record.inputs().collect();
    let run =
        simulate(&Hardening, &found.parameters, &found.experiments[0].initial_state, time.clone(), &inputs).unwrap();
    let off = rms(run.outputs.iter().zip(record.outputs()).map(|(simulated, y)| y.y - simulated.y));
    let off_z = rms(run.outputs.iter().zip(record.outputs()).map(|(simulated, y)| y.z - simulated.z));
    let [y, z] = [0, 1].map(|j| found.outputs[j].fit.rmse);
    let (name, predicted, simulated) = if off / y > off_z / z { ("y", y, off) } else { ("z", z, off_z) };
    for word in [format!("`{name}` is off by {predicted:.2}"), format!("by {simulated:.2}"), "control".to_owned()] {
        // Three digits of a number below one.
        assert!(told.text.contains(&word[..word.len() - usize::from(word.contains('.'))]), "{word}: {}", told.text);
    }
    let run = simulate(&Hardening, &TRUTH, &found.experiments[0].initial_state, time, &inputs).unwrap();
    let still = run.with_noise(Gauges { y: 0.1, z: 0.2 }, 3).experiment(&Hardening).unwrap();
    let still = still.initial(Deflection { x: free(0.0) });
    let quiet = Fit::new(&Hardening, &still).parameters(start()).predictor(Kalman).run().unwrap();
    assert!(quiet.warnings.iter().all(|warning| warning.code != WarningCode::SimulatesWorse), "{quiet}");
}
