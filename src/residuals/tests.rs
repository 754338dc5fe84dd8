use super::residual_pass;
use crate::problem::{Problem, Settings};
use crate::random::Random;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, ExperimentOf, Fit, Parameter, Time, free};

/// A record of nothing but these errors.
fn record(errors: &[f64], name: &str) -> ExperimentOf<Line> {
    let inputs = vec![Voltage { u: 1.0 }; errors.len()];
    let outputs = errors.iter().map(|&i| Current { i }).collect();
    Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap().named(name)
}

/// Sums of `e[t] e[t - k]` within each record.
fn products(records: &[Vec<f64>], k: usize) -> f64 {
    records.iter().map(|e| (k..e.len()).map(|t| e[t] * e[t - k]).sum::<f64>()).sum()
}

/// Autocorrelations over several records are pooled, and smaller by the number of unknowns that records have for themselves over
/// that of all errors, but not beyond zero; with one record, and with a gain that all share, they are as large as they are.
#[test]
fn unknowns_of_single_records_reduce_autocorrelations() {
    let mut random = Random::stream(7, 0);
    let errors: Vec<Vec<f64>> = [24, 30, 26].iter().map(|&n| (0..n).map(|_| random.normal()).collect()).collect();
    let check = |errors: &[Vec<f64>], gain: Parameter, own: f64| {
        let records: Vec<_> = errors.iter().zip(["a", "b", "c"]).map(|(e, name)| record(e, name)).collect();
        let shared = Fit::new(&Line, &records).parameters(Gain { a: free(0.0) }).problem().unwrap();
        let of = records.iter().map(|record| record.record().clone()).collect();
        let problem = Problem::unchecked(shared.sweep.clone(), of, &[gain], Settings::default()).unwrap();
        let objective = problem.objective().unwrap();
        let found = residual_pass(&objective, &objective.start()).unwrap().whiteness[0].correlations;
        let count: usize = errors.iter().map(Vec::len).sum();
        for (k, found) in (1..).zip(found) {
            let plain = products(errors, k) / products(errors, 0);
            let expected = plain.signum() * (plain.abs() - own / count as f64).max(0.0);
            // Sums of 80 products, in another order.
            assert!((found - expected).abs() < 1e-14, "{k}: {found} {expected}");
        }
    };
    check(&errors, free(0.0).per_experiment(), 3.0);
    check(&errors[..2], free(0.0).per_experiment(), 2.0);
    check(&errors[..1], free(0.0).per_experiment(), 0.0);
    check(&errors, free(0.0), 0.0);
}
