//! The rows of each output, extended by its gain, offset and delay.

use super::ruled_out::Unless;
use crate::information::{Gathering, Information};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;

/// What may be wrong with a sensor.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    Gain,
    Offset,
    Delay,
}

impl Kind {
    pub const ALL: [Kind; KINDS] = [Kind::Gain, Kind::Offset, Kind::Delay];
}

pub(crate) const KINDS: usize = 3;

/// What rules out that rows are extended, and that sensors are tested.
pub(crate) const UNLESS: &[Unless] = &[Unless::Prefilter, Unless::Restarts, Unless::ManyUnknowns, Unless::NoMinimum];
pub(crate) const UNTESTED: &[Unless] = &[
    Unless::Prefilter,
    Unless::Restarts,
    Unless::ManyUnknowns,
    Unless::NoMinimum,
    Unless::NoFreedom(1.0),
    Unless::RoundOff,
];

/// The measurements of an experiment, one after the other.
pub(crate) struct Measurements<'o> {
    objective: &'o Objective<'o>,
    experiment: usize,
    sigma: Vec<f64>,
    /// The prediction of each output at the sample before, if it was measured.
    before: Vec<Option<f64>>,
}

/// A measurement: its place in the window, the factor of its row, and the slopes by gain, offset and delay.
pub(crate) struct Measurement {
    pub k: usize,
    pub output: usize,
    pub root: f64,
    pub slopes: [f64; KINDS],
}

impl<'o> Measurements<'o> {
    pub fn new(objective: &'o Objective<'o>, experiment: usize) -> Self {
        let before = vec![None; objective.outputs()];
        Measurements { objective, experiment, sigma: objective.whitening.sigma(), before }
    }

    /// Those of a window that count.
    pub fn visit(&mut self, window: &Window, lane: usize, mut visit: impl FnMut(Measurement)) {
        let record = &self.objective.problem.records[self.experiment];
        for (k, output) in (0..window.samples[lane]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j))) {
            let before = std::mem::take(&mut self.before[output]);
            if !window.is_measured(k, output, lane) {
                continue;
            }
            let (sample, error) = (window.begin[lane] + k, window.error(k, output, lane));
            let unit = if window.has_variances() { window.variance_root(k, output, lane) } else { self.sigma[output] };
            let prediction = record.outputs()[output].values[sample] - error * unit;
            self.before[output] = Some(prediction);
            // As in iteratively reweighted least squares, whose minimum is that of the loss.
            let by_loss = self.objective.loss().map_or(1.0, |loss| loss.weight(error));
            let weight = self.objective.weight(self.experiment, sample) * by_loss;
            if weight > 0.0 {
                let change = before.map_or(0.0, |before| before - prediction);
                let slopes = [prediction / unit, unit.recip(), change / unit];
                visit(Measurement { k, output, root: weight.sqrt(), slopes });
            }
        }
    }

    /// Goes on behind a segment that follows.
    pub fn append(&mut self, later: Self) {
        self.before = later.before;
    }
}

/// The triangle of each output's rows, of one experiment: slopes of the unknowns, then of gain, offset and delay.
pub(crate) struct Triangle<'o> {
    measurements: Measurements<'o>,
    of: Vec<Gathering>,
    row: Vec<f64>,
}

impl<'o> Triangle<'o> {
    pub fn new(objective: &'o Objective<'o>, experiment: usize) -> Self {
        let columns = objective.problem.unknowns.columns(experiment).count() + KINDS;
        let of = (0..objective.outputs()).map(|_| Gathering::new(columns)).collect();
        Triangle { measurements: Measurements::new(objective, experiment), of, row: vec![0.0; columns] }
    }

    /// One triangle, with the regressors of each output in columns of their own.
    pub fn of_all_outputs(self) -> Information {
        let unknowns = self.row.len() - KINDS;
        let outputs = self.of.len();
        let mut all = Information::new(unknowns + outputs * KINDS);
        for (j, triangle) in self.of.into_iter().map(Gathering::triangle).enumerate() {
            for i in 0..=triangle.columns() {
                let mut row = vec![0.0; all.columns()];
                let place = |c: usize| if c < unknowns { c } else { c + j * KINDS };
                (i..triangle.columns()).for_each(|c| row[place(c)] = triangle.at(i, c));
                all.absorb_row(&row, triangle.at(i, triangle.columns()));
            }
        }
        all
    }
}

impl Accumulate for Triangle<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let Triangle { measurements, of, row } = self;
        let unknowns = row.len() - KINDS;
        measurements.visit(window, lane, |Measurement { k, output, root, slopes }| {
            let (of_unknowns, of_sensor) = row.split_at_mut(unknowns);
            let own = window.row(k, output).chunks_exact(window.lanes());
            of_unknowns.iter_mut().zip(own).for_each(|(to, lanes)| *to = root * lanes[lane]);
            of_sensor.iter_mut().zip(slopes).for_each(|(to, slope)| *to = root * slope);
            of[output].take(row, root * window.error(k, output, lane));
        });
    }

    fn append(&mut self, later: Self) {
        self.of.iter_mut().zip(later.of).for_each(|(rows, later)| rows.append(later));
        self.measurements.append(later.measurements);
    }
}
