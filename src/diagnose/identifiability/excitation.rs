//! Where in the records, and through which outputs, each unknown is excited.

use super::{Excitation, Segment};
use crate::error::Error;
use crate::fit::{Objective, Rows};
use crate::predict::WINDOW;

const SEGMENTS: usize = 10;

/// The excitation of each unknown, its strength in the optimizer's coordinates.
pub(super) fn excitation(objective: &Objective<'_>, best: &[f64]) -> Result<Vec<Excitation>, Error> {
    let (n, outputs) = (best.len(), objective.outputs());
    let mut by_output = vec![vec![0.0; outputs]; n];
    let mut by_segment = vec![vec![]; n];
    let mut begins = vec![];
    for e in 0..objective.experiments() {
        let samples = objective.source.samples(e);
        let columns: Vec<usize> = objective.unknowns.columns(e).collect();
        let (rows, length) = (outputs * WINDOW, samples.div_ceil(SEGMENTS).max(1));
        let mut sums = vec![vec![0.0; samples.div_ceil(length)]; n];
        let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
            let slopes = window.data_mut();
            for (c, &unknown) in columns.iter().enumerate() {
                for j in 0..outputs {
                    let column = &slopes[c * rows + j * WINDOW..][..samples];
                    for (k, slope) in column.iter().enumerate() {
                        by_output[unknown][j] += slope * slope;
                        sums[unknown][(begin + k) / length] += slope * slope;
                    }
                }
            }
        };
        if objective.walk(e, best, true, visit).is_err() {
            return Err(Error::Simulation(objective.locate(e, best, 0)));
        }
        let segments = sums.first().map_or(0, Vec::len);
        let label = &objective.unknowns.labels[e];
        begins.extend((0..segments).map(|s| (label.clone(), objective.source.time(e, s * length))));
        by_segment.iter_mut().zip(sums).for_each(|(all, sums): (&mut Vec<f64>, _)| all.extend(sums));
    }
    let names = objective.names();
    let excited = |i: usize| {
        let total = by_output[i].iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let output = |j: usize| (objective.source.outputs()[j].to_owned(), by_output[i][j] / total);
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
