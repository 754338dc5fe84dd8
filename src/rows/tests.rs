//! Rows extended by the regressors of sensors, by their definitions.

use super::*;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, ExperimentOf, Fit, Huber, Sample, Time, Weighting, free};

const SIGMA: f64 = 0.5;
const AT: f64 = 2.1;

/// `i = 2 u` with errors that are no noise, every eleventh of which is far off; some samples are missing.
fn record(samples: usize) -> ExperimentOf<Line> {
    let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: ((k * k) as f64 * 0.3).sin() + 0.2 }).collect();
    let error = |k: usize| (k as f64 * 1.7).cos() * if k % 11 == 5 { 4.0 } else { 0.4 };
    let output = |k: usize| if k % 7 == 3 { f64::NAN } else { 2.0 * inputs[k].u + error(k) };
    let outputs = (0..samples).map(|k| Current { i: output(k) }).collect();
    Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

/// Twice as much of the second half of a hundred seconds; a fifth of the samples counts nothing.
struct Halves;

fn weight(k: usize) -> f64 {
    match k % 100 {
        _ if k % 5 == 2 => 0.0,
        0..50 => 1.0,
        _ => 2.0,
    }
}

impl Weighting<Line> for Halves {
    fn weight(&self, sample: &Sample<Line>) -> f64 {
        weight(sample.t as usize)
    }
}

/// `phi' phi` of the extended rows with their errors, row by row: the prediction before is known within a segment, where it was measured.
fn by_hand(record: &ExperimentOf<Line>, begins: &[usize], weighs: bool) -> [[f64; 5]; 5] {
    let (mut products, mut before) = ([[0.0; 5]; 5], f64::NAN);
    for (k, sample) in record.samples::<Line>().enumerate() {
        let (u, y): (f64, f64) = (sample.u.u, sample.y.i);
        let prediction = AT * u;
        let last = if begins.contains(&k) { f64::NAN } else { before };
        before = if y.is_nan() { f64::NAN } else { prediction };
        let error = (y - prediction) / SIGMA;
        let by_loss = if weighs { (1.345 / error.abs()).min(1.0) } else { 1.0 };
        let root = if weighs { (weight(k) * by_loss).sqrt() } else { 1.0 };
        if y.is_nan() || root == 0.0 {
            continue;
        }
        let change = if last.is_nan() { 0.0 } else { last - prediction };
        let row = [u / SIGMA, prediction / SIGMA, 1.0 / SIGMA, change / SIGMA, error].map(|entry| root * entry);
        for i in 0..5 {
            (0..5).for_each(|j| products[i][j] += row[i] * row[j]);
        }
    }
    products
}

fn assert_equal(found: &Information, products: &[[f64; 5]; 5]) {
    for i in 0..5 {
        for j in 0..5 {
            let product: f64 = (0..=i.min(j)).map(|k| found.at(k, i) * found.at(k, j)).sum();
            // Sums of some thousand terms of one size.
            let size = (products[i][i] * products[j][j]).sqrt();
            assert!((product - products[i][j]).abs() < 1e-12 * size, "{i} {j}: {product} {}", products[i][j]);
        }
    }
}

const SENSORS: Asked<'static> = Asked { shares: None, colored: None, sensors: true, parts: false };

/// Records that end in different windows, one of which is cut, with measurements and weights that are missing; a robust loss.
#[test]
fn extended_rows_are_those_by_hand() {
    let records = [100, 300, 1200].map(record);
    for weighs in [false, true] {
        let plain = Fit::new(&Line, &records).parameters(Gain { a: free(1.0) }).noise(Current { i: SIGMA });
        let fit = if weighs { plain.weighting(Halves).loss(Huber::default()) } else { plain };
        let problem = fit.problem().unwrap();
        let objective = problem.objective().unwrap();
        let found = rows(&objective, &[AT], SENSORS).sensors.unwrap();
        assert!(problem.cuts.segments[2].len() > 1);
        for (e, record) in records.iter().enumerate() {
            let begins: Vec<usize> = problem.cuts.segments[e].iter().map(|segment| segment.start).collect();
            assert_equal(&found[e], &by_hand(record, &begins, weighs));
        }
    }
}

/// In parallel lanes, where no record is cut, as each alone.
#[test]
fn rows_of_several_fits_are_those_of_each() {
    let records = [100, 300, 1200].map(record);
    let fit = |record| Fit::new(&Line, record).parameters(Gain { a: free(1.0) }).noise(Current { i: SIGMA });
    let problems: Vec<_> = records.iter().map(|record| fit(record).problem().unwrap()).collect();
    let objectives: Vec<_> = problems.iter().map(|problem| problem.objective().unwrap()).collect();
    let asked: Vec<(At<'_>, Asked<'_>)> = objectives.iter().map(|one| ((one, &[AT][..]), SENSORS)).collect();
    for (e, found) in rows_together(&asked).into_iter().enumerate() {
        let begins: Vec<usize> = problems[e].cuts.segments[0].iter().map(|segment| segment.start).collect();
        assert_equal(&found.unwrap().sensors.unwrap()[0], &by_hand(&records[e], &begins, false));
    }
}
