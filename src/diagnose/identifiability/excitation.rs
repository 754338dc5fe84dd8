//! Where in the records, and through which outputs, each unknown is excited.

use super::{Excitation, Segment};
use crate::error::Error;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;

const SEGMENTS: usize = 10;

/// Squares of the standardized slopes of one experiment, by unknown.
struct Squares {
    unknowns: Vec<usize>,
    /// Samples of a segment.
    length: usize,
    by_output: Vec<Vec<f64>>,
    by_segment: Vec<Vec<f64>>,
}

impl Accumulate for Squares {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            let segment = (window.begin[lane] + k) / self.length;
            for j in 0..window.outputs() {
                for (c, &unknown) in self.unknowns.iter().enumerate() {
                    let mut square = window.at(k, j, c, lane).powi(2);
                    // Through the predicted variance of the output, too.
                    if window.has_variances() && window.is_measured(k, j, lane) {
                        square += window.variance_at(k, j, c, lane).powi(2);
                    }
                    self.by_output[unknown][j] += square;
                    self.by_segment[unknown][segment] += square;
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        let add = |sums: &mut [Vec<f64>], later: Vec<Vec<f64>>| {
            let pairs = sums.iter_mut().flatten().zip(later.into_iter().flatten());
            pairs.for_each(|(sum, later)| *sum += later);
        };
        add(&mut self.by_output, later.by_output);
        add(&mut self.by_segment, later.by_segment);
    }
}

/// The excitation of each unknown, its strength in the optimizer's coordinates.
pub(super) fn excitation(objective: &Objective<'_>, best: &[f64]) -> Result<Vec<Excitation>, Error> {
    let (n, outputs, problem) = (best.len(), objective.outputs(), objective.problem);
    let make = |e: usize| {
        let samples = problem.records()[e].len();
        let length = samples.div_ceil(SEGMENTS).max(1);
        Squares {
            unknowns: problem.unknowns.columns(e).collect(),
            length,
            by_output: vec![vec![0.0; outputs]; n],
            by_segment: vec![vec![0.0; samples.div_ceil(length)]; n],
        }
    };
    let gathered = objective.gather(best, true, make).map_err(|_| Error::Simulation(objective.locate(0, best, 0)))?;
    let mut by_output = vec![vec![0.0; outputs]; n];
    let mut by_segment = vec![vec![]; n];
    let mut begins = vec![];
    for (e, squares) in gathered.into_iter().enumerate() {
        let (label, record) = (&problem.unknowns.labels[e], &problem.records()[e]);
        let segments = squares.by_segment.first().map_or(0, Vec::len);
        begins.extend((0..segments).map(|s| (label.clone(), record.time(s * squares.length))));
        for (all, sums) in by_output.iter_mut().zip(&squares.by_output) {
            all.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
        }
        by_segment.iter_mut().zip(squares.by_segment).for_each(|(all, sums): (&mut Vec<f64>, _)| all.extend(sums));
    }
    let names = objective.names();
    let excited = |i: usize| {
        let total = by_output[i].iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let output = |j: usize| (problem.layout().outputs[j].name.clone(), by_output[i][j] / total);
        let segment = |(sum, (experiment, from)): (&f64, &(String, f64))| Segment {
            experiment: experiment.clone(),
            from: *from,
            share: sum / total,
        };
        Excitation {
            name: names[i].clone(),
            strength: 0.0,
            outputs: (0..outputs).map(output).collect(),
            segments: by_segment[i].iter().zip(&begins).map(segment).collect(),
        }
    };
    Ok((0..n).map(excited).collect())
}
