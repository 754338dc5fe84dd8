//! The rows of each output, extended by its gain, offset and delay.

use crate::aligned::Aligned;
use crate::information::{Information, Triangles};
use crate::problem::{AccumulateLanes, Objective};
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

/// The regressors of measurements: of each row of a window the root of its weight, zero where nothing counts, and the slopes by gain, offset
/// and delay, which are zero there too.
pub(crate) struct Regressors<'o> {
    /// The objective and the experiment in each lane.
    of: Vec<(&'o Objective<'o>, usize)>,
    lanes: usize,
    /// Standard deviations of the outputs, lane by lane; ones in lanes without a record.
    sigma: Vec<f64>,
    /// The prediction of each output in each lane at the sample before. NaN if it was not measured, and at the begins of segments, also in a pass
    /// that does not cut records: fleets then have the regressors of single fits.
    before: Vec<f64>,
    /// Measurements of each row, lane by lane; NaN where there is none.
    measured: Vec<f64>,
    /// Row by row, root and slopes one after the other, lane by lane.
    rows: Vec<f64>,
}

impl<'o> Regressors<'o> {
    pub fn new(of: Vec<(&'o Objective<'o>, usize)>) -> Self {
        Regressors { of, lanes: 0, sigma: vec![], before: vec![], measured: vec![], rows: vec![] }
    }

    /// Whether the roots may be other numbers than one and zero.
    fn weighs(&self) -> bool {
        self.of.iter().any(|(objective, _)| objective.is_weighted() || objective.loss().is_some())
    }

    /// Prepares for windows of so many lanes and outputs.
    fn begin(&mut self, lanes: usize, outputs: usize) {
        self.lanes = lanes;
        self.before = vec![f64::NAN; outputs * lanes];
        self.sigma = vec![1.0; outputs * lanes];
        for (lane, (objective, _)) in self.of.iter().enumerate() {
            let own = self.sigma.iter_mut().skip(lane).step_by(lanes);
            own.zip(objective.whitening.sigma()).for_each(|(to, sigma)| *to = sigma);
        }
    }

    /// Takes a window, which follows the one before.
    pub fn take(&mut self, window: &Window) {
        let (lanes, outputs) = (window.lanes(), window.outputs());
        if self.before.is_empty() {
            self.begin(lanes, outputs);
        }
        self.read_measurements(window);
        self.rows.resize(window.capacity() * outputs * (1 + KINDS) * lanes, 0.0);
        let (weighs, begins) = (self.weighs(), self.begins(window));
        let mut units = vec![0.0; lanes];
        let rows = self.rows.chunks_exact_mut((1 + KINDS) * lanes).zip(self.measured.chunks_exact(lanes)).enumerate();
        for (number, (row, measured)) in rows {
            let (k, output) = (number / outputs, number % outputs);
            match window.has_variances() {
                true => (0..lanes).for_each(|lane| units[lane] = window.variance_root(k, output, lane)),
                false => units.copy_from_slice(&self.sigma[output * lanes..][..lanes]),
            }
            let errors = &window.row(k, output)[(window.columns() - 1) * lanes..];
            let before = &mut self.before[output * lanes..][..lanes];
            begins.iter().filter(|(at, _)| *at == k).for_each(|(_, lane)| before[*lane] = f64::NAN);
            let (roots, slopes) = row.split_at_mut(lanes);
            let (gains, others) = slopes.split_at_mut(lanes);
            let (offsets, delays) = others.split_at_mut(lanes);
            for lane in 0..lanes {
                let unit = units[lane];
                let prediction = measured[lane] - errors[lane] * unit;
                let (change, present) = (before[lane] - prediction, !prediction.is_nan());
                before[lane] = prediction;
                roots[lane] = if present { 1.0 } else { 0.0 };
                let inverse = unit.recip();
                gains[lane] = if present { prediction * inverse } else { 0.0 };
                offsets[lane] = if present { inverse } else { 0.0 };
                delays[lane] = if change.is_nan() { 0.0 } else { change * inverse };
            }
            if weighs {
                let counted = self.of.iter().zip(roots).zip(errors).enumerate();
                for (lane, (((objective, experiment), root), error)) in
                    counted.filter(|(_, ((_, root), _))| **root > 0.0)
                {
                    // As in iteratively reweighted least squares, whose minimum is that of the loss.
                    let by_loss = objective.loss().map_or(1.0, |loss| loss.weight(*error));
                    *root = (objective.weight(*experiment, window.begin[lane] + k) * by_loss).sqrt();
                }
            }
        }
    }

    /// The places in a window at which a later segment of a record begins, with their lanes.
    fn begins(&self, window: &Window) -> Vec<(usize, usize)> {
        let of = |(lane, (objective, experiment)): (usize, &(&Objective<'_>, usize))| {
            let inside = window.begin[lane]..window.begin[lane] + window.samples[lane];
            let segments = objective.problem.cuts.segments[*experiment].iter().skip(1).map(|segment| segment.start);
            segments
                .filter(|start| inside.contains(start))
                .map(|start| (start - inside.start, lane))
                .collect::<Vec<_>>()
        };
        self.of.iter().enumerate().flat_map(of).collect()
    }

    fn read_measurements(&mut self, window: &Window) {
        let (lanes, outputs) = (window.lanes(), window.outputs());
        self.measured.clear();
        self.measured.resize(window.len() * outputs * lanes, f64::NAN);
        // A lane that has ended begins behind its record.
        let present = self.of.iter().enumerate().filter(|(lane, _)| window.samples[*lane] > 0);
        for (lane, (objective, experiment)) in present {
            let samples = window.begin[lane]..window.begin[lane] + window.samples[lane];
            for (j, output) in objective.problem.records[*experiment].outputs().iter().enumerate() {
                let places = self.measured.iter_mut().skip(j * lanes + lane).step_by(outputs * lanes);
                for (k, (to, value)) in places.zip(&output.values[samples.clone()]).enumerate() {
                    if window.whole || window.is_measured(k, j, lane) {
                        *to = *value;
                    }
                }
            }
        }
    }

    /// The roots of the weights of a row, lane by lane, then its slopes.
    pub fn at(&self, row: usize) -> (&[f64], &[f64]) {
        let width = (1 + KINDS) * self.lanes;
        self.rows[row * width..][..width].split_at(self.lanes)
    }
}

/// The triangles of each output's rows: slopes of the unknowns, then of gain, offset and delay.
pub(crate) struct Extenders<'o> {
    regressors: Regressors<'o>,
    of: Vec<Triangles>,
    rows: Aligned,
}

impl<'o> Extenders<'o> {
    /// Of the objective and the experiment in each lane.
    pub fn new(of: Vec<(&'o Objective<'o>, usize)>) -> Self {
        Extenders { regressors: Regressors::new(of), of: vec![], rows: Aligned::zeros(0) }
    }
}

impl AccumulateLanes for Extenders<'_> {
    type Lane = Vec<Information>;

    fn add(&mut self, window: &Window) {
        let Extenders { regressors, of, rows } = self;
        let (lanes, outputs, columns) = (window.lanes(), window.outputs(), window.columns() + KINDS);
        regressors.take(window);
        let weighs = regressors.weighs();
        of.resize_with(outputs, || Triangles::with(window.width, columns - 1, lanes));
        if rows.is_empty() {
            *rows = Aligned::zeros(window.capacity() * columns * lanes);
        }
        for (j, triangles) in of.iter_mut().enumerate() {
            for (k, to) in rows.chunks_exact_mut(columns * lanes).enumerate().take(window.len()) {
                let (roots, slopes) = regressors.at(k * outputs + j);
                let (own, error) = window.row(k, j).split_at((window.columns() - 1) * lanes);
                let (to_own, to_slopes) = to.split_at_mut(own.len());
                let (to_slopes, to_error) = to_slopes.split_at_mut(KINDS * lanes);
                to_own.copy_from_slice(own);
                to_slopes.copy_from_slice(slopes);
                to_error.copy_from_slice(error);
                // Without weights and loss a root is one where something was measured; elsewhere the row is zero.
                if weighs {
                    let by_lane = to.chunks_exact_mut(lanes);
                    by_lane.for_each(|to| to.iter_mut().zip(roots).for_each(|(to, root)| *to *= root));
                }
            }
            triangles.absorb(rows, window.len());
        }
    }

    fn lane(&self, lane: usize) -> Vec<Information> {
        self.of.iter().map(|triangles| triangles.triangle(lane)).collect()
    }

    fn append(lane: &mut Vec<Information>, later: Vec<Information>) {
        lane.iter_mut().zip(&later).for_each(|(triangle, later)| triangle.merge(later));
    }
}

/// One triangle from those of each output, with the regressors of each in columns of their own. Its number of rows is not that of the measurements.
pub(crate) fn of_all_outputs(of: Vec<Information>) -> Information {
    let outputs = of.len();
    let unknowns = of.first().map_or(0, |triangle| triangle.columns() - KINDS);
    let mut all = Information::new(unknowns + outputs * KINDS);
    for (j, triangle) in of.into_iter().enumerate() {
        for i in 0..=triangle.columns() {
            let mut row = vec![0.0; all.columns()];
            let place = |c: usize| if c < unknowns { c } else { c + j * KINDS };
            (i..triangle.columns()).for_each(|c| row[place(c)] = triangle.at(i, c));
            all.absorb_row(&row, triangle.at(i, triangle.columns()));
        }
    }
    all
}
