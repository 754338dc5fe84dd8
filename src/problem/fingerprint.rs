//! [`Fingerprint`]: whether a checkpoint belongs to a problem.
//!
//! Data, names and numbers of the settings enter a hash (SHA-256, FIPS 180-4), which is the same on every machine. Code
//! cannot be hashed: a model with other constants has the same type, and closures have no name. So equations, weighting
//! and loss are evaluated at fixed points, and the values are compared.

use super::{Noise, Objective};
use crate::hash::hexadecimal;
use crate::record::Record;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Values that differ by less, relatively, are the same: what elementary functions of another processor make of them.
const TOLERANCE: f64 = 1e-9;
/// Records that are simulated, and samples of each: more would take longer than a checkpoint is worth.
const RECORDS: usize = 8;
const SAMPLES: usize = 100_000;
/// Standardized errors at which the loss is evaluated.
const ERRORS: [f64; 8] = [0.1, 0.5, 1.0, 1.5, 2.5, 5.0, 10.0, 100.0];

/// Identification of a problem.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Fingerprint {
    /// Of data and settings.
    hash: String,
    /// Of equations, weighting and loss.
    probes: Vec<Probe>,
}

/// A sum of values with different factors, and the sum of their magnitudes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Probe {
    #[serde(with = "crate::real")]
    sum: f64,
    #[serde(with = "crate::real")]
    size: f64,
}

impl Probe {
    /// Adds value number `k`; what is not finite does not count.
    fn add(&mut self, k: usize, value: f64) {
        let value = value * (1.0 + (k % 97) as f64 / 97.0);
        if value.is_finite() {
            self.sum += value;
            self.size += value.abs();
        }
    }

    /// Whether both are sums of the same values, or one of them is not known.
    fn agrees(&self, other: &Probe) -> bool {
        let apart = (self.sum - other.sum).abs().max((self.size - other.size).abs());
        apart.is_nan() || apart <= TOLERANCE * self.size.max(other.size)
    }
}

impl Fingerprint {
    /// Of the problem of an objective, whose errors are in the units of the outputs.
    pub fn new(plain: &Objective<'_>) -> Self {
        let problem = plain.problem;
        let start = problem.unknowns.start();
        // Beside the start, where some effects are zero.
        let moved = start.iter().zip(problem.unknowns.bounds());
        let moved = moved.map(|(x, (lower, upper))| (x + 0.1 * x.abs().max(1.0)).min(upper).max(lower)).collect();
        let mut probes = vec![];
        for e in 0..problem.records.len().min(RECORDS) {
            probes.extend([&start, &moved].map(|coordinates| errors(plain, e, coordinates)));
            probes.extend(problem.settings.weights.as_ref().map(|weights| {
                let record = &problem.records[e];
                let samples = 0..record.len().min(SAMPLES);
                of(samples.map(|k| weights.weight(record, k)))
            }));
        }
        let losses = problem.settings.loss.iter();
        probes.extend(losses.flat_map(|loss| ERRORS.map(|error| of([loss.rho(error), loss.psi(-error)]))));
        Fingerprint { hash: hash(plain), probes }
    }

    /// Whether both are of one problem.
    pub fn is_same(&self, other: &Fingerprint) -> bool {
        let alike = self.hash == other.hash && self.probes.len() == other.probes.len();
        alike && self.probes.iter().zip(&other.probes).all(|(a, b)| a.agrees(b))
    }
}

fn of(values: impl IntoIterator<Item = f64>) -> Probe {
    let mut probe = Probe::default();
    values.into_iter().enumerate().for_each(|(k, value)| probe.add(k, value));
    probe
}

/// Prediction errors and variances of an experiment; not a number if the search was stopped meanwhile.
fn errors(plain: &Objective<'_>, e: usize, coordinates: &[f64]) -> Probe {
    let (mut probe, mut number) = (Probe::default(), 0);
    // How far a simulation comes before it fails is part of the answer.
    let _ = plain.run_alone(e, coordinates, false, &mut |window| {
        for k in 0..window.samples[0] {
            for j in 0..window.outputs() {
                if window.is_measured(k, j, 0) {
                    probe.add(number, window.error(k, j, 0));
                    probe.add(number, window.variance(k, j, 0));
                }
                number += 1;
            }
        }
        number < SAMPLES * window.outputs()
    });
    if plain.control.stops() { Probe { sum: f64::NAN, size: f64::NAN } } else { probe }
}

/// Of the data and of the settings that have a text.
fn hash(plain: &Objective<'_>) -> String {
    let problem = plain.problem;
    let (sweep, settings) = (&problem.sweep, &problem.settings);
    let mut hash = Sha256::new();
    let mut text = |text: &str| {
        // The length tells where one text ends and the next begins.
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    };
    text(env!("CARGO_PKG_VERSION"));
    text(&sweep.identity());
    text(&format!("{:?}", sweep.layout()));
    text(&sweep.integrator());
    text(&sweep.predictor());
    text(&format!("{:?}{:?}", problem.unknowns.parameters, problem.unknowns.row));
    let noise: &Noise = &settings.noise;
    text(&format!("{:?}{noise:?}{}", settings.prefilter, settings.searches.count()));
    text(&format!("{:?}", settings.weights.as_ref().map(|weights| weights.describe())));
    text(&format!("{:?}", settings.loss.as_ref().map(|loss| loss.describe())));
    for record in &problem.records {
        text(&format!("{}{:?}{:?}{}", record.name(), record.holds, record.initial_state(), record.len()));
    }
    problem.records.iter().for_each(|record| numbers(record, &mut hash));
    hexadecimal(hash)
}

/// Time, inputs and outputs of a record.
fn numbers(record: &Record, hash: &mut Sha256) {
    (0..record.len()).for_each(|k| hash.update(record.time(k).to_le_bytes()));
    for channel in record.inputs().iter().chain(record.outputs()) {
        channel.values.iter().for_each(|value| hash.update(value.to_le_bytes()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// Errors of one, from values of zero, with the factors of their numbers; those beyond the first 100,000 do not count, but for the
    /// rest of a window of 64 samples. Each is followed by its variance, of one where none is predicted.
    #[test]
    fn errors_of_the_first_samples_are_probed() {
        for (count, probed) in [(50, 50), (100_200, 100_032)] {
            let (inputs, outputs) = (vec![Voltage { u: 0.0 }; count], vec![Current { i: 1.0 }; count]);
            let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
            let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
            let found = errors(&problem.objective().unwrap().in_units(), 0, &[1.0]);
            let size: f64 = (0..probed).map(|k| 1.0 + f64::from(k % 97) / 97.0).sum();
            assert!((found.size / (2.0 * size) - 1.0).abs() < 1e-12, "{} {size}", found.size);
        }
    }

    /// Values in another order are others, so is each value, and what is not finite does not count.
    #[test]
    fn probes_tell_values_and_their_order() {
        let probe = |values: &[f64]| of(values.iter().copied());
        let values = probe(&[1.0, 2.0, 5.0, f64::NAN]);
        assert!(values.agrees(&probe(&[1.0, 2.0, 5.0])));
        for other in [[2.0, 1.0, 5.0], [1.0, 5.0, 2.0], [3.0, 2.0, 5.0], [1.0, 2.0, 5.001]] {
            assert!(!values.agrees(&probe(&other)), "{other:?}");
        }
        // Relative to their size, up to what another processor rounds.
        for size in [1e-3, 1e3] {
            let of = |part: f64| probe(&[size, -size * (1.0 + part)]);
            assert!(of(0.0).agrees(&of(1e-10)) && !of(0.0).agrees(&of(1e-7)), "{size}");
        }
        // By its definition: factors 1, 98/97 and 99/97.
        assert!((values.sum - (1.0 + 2.0 * 98.0 / 97.0 + 5.0 * 99.0 / 97.0)).abs() < 1e-12);
    }
}
