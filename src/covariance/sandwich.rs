//! The sandwich covariance, for fits with weights, a robust loss or a pre-filter.
//!
//! It is `A^-1 B A^-1` (Huber 1967; White 1980). `A` is the curvature of the cost, `E[psi'] sum w g g'`. `B` is the
//! covariance of the score: the sum of squares of the samples' own scores, `w psi(z) g` added up over the outputs. Where variances `v` are
//! predicted, of `rho(z) + kappa/2 ln v`, `A` has `E[psi'(z) z^2 + psi(z) z]/2 sum w d d'` beside it and the score `w (psi(z) z - kappa)
//! d/sqrt(2)`, with `d = dv / (sqrt(2) v)`.
//! Errors of a fit are smaller than the noise by the part of it that the fit took over, so each is divided by one less
//! its leverage (HC3: MacKinnon and White, J. Econometrics 29 (1985) 305), and what this leaves out is added ([`scores`]).
//!
//! A pre-filter correlates the errors. Where those before it are white, with covariance `S` between the outputs, the
//! score is theirs times the weighted slopes passed through the filter backward in time (its adjoint), from rest at the
//! end of the record to its first sample. A forward pass instead counts what happens at the begin of a record wrongly:
//! errors of initial states came out several times too large.

mod scores;

use crate::covariance::leverage::{form, of_experiment};
use crate::covariance::point::Point;
use crate::covariance::shares::{self, Largest};
use crate::information::{Covariance, Gathering, Information};
use crate::optimize::Linearization;
use crate::prefilter::Butterworth;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use nalgebra::DMatrix;
use scores::Scores;

/// A sandwich covariance.
pub(crate) struct Robust {
    /// `None` if it has no number.
    pub covariance: Option<Covariance>,
    /// The largest shares in the variances, which a pre-filter has none of.
    pub shares: Option<Vec<Largest>>,
    /// Degrees of freedom of the variance of each unknown, infinite where they are not examined.
    pub degrees: Vec<f64>,
}

/// The curvature of the cost.
pub(crate) struct Bread {
    /// Without the mean curvature of the loss.
    pub linear: Linearization,
    /// Mean of `psi'`, by which it is to be multiplied.
    pub curvature: f64,
    /// The root of the curvature along the logarithm of a variance relative to that along a mean.
    variance: f64,
    /// The variance of errors times the roots of their weights, by their influences.
    noise: f64,
    tally: Tally,
}

impl Bread {
    /// That of plain least squares, by the slopes of the search and the number of measurements; that of weights and losses, by a pass with
    /// slopes.
    pub fn of(point: &Point<'_>, measured: u64) -> Option<Self> {
        let Point { objective, end, linear, .. } = point;
        if objective.needs_sandwich() {
            return Bread::weighted(objective, &end.coordinates);
        }
        let priors: f64 = objective.problem.unknowns.priors(&end.coordinates).map(|(_, _, error)| error * error).sum();
        let noise = (linear.sum_of_squares() - priors) / measured.max(1) as f64;
        let tally = Tally::new(objective.outputs());
        Some(Bread { linear: (*linear).clone(), curvature: 1.0, variance: 1.0, noise, tally })
    }

    /// That of weights and losses.
    pub fn weighted(objective: &Objective<'_>, coordinates: &[f64]) -> Option<Self> {
        let unknowns = &objective.problem.unknowns;
        let make = |experiment: usize| {
            let columns = unknowns.columns(experiment).count();
            let impulse = objective.problem.settings.prefilter.as_ref().map(ImpulseResponse::new);
            let rows = || Gathering::new(columns);
            let tally = Tally::new(objective.outputs());
            let variances = objective.sweep.predicts_variance().then(rows);
            Curvature { objective, experiment, tally, rows: rows(), variances, impulse, row: vec![0.0; columns] }
        };
        let mut tally = Tally::new(objective.outputs());
        let mut triangles = vec![];
        for one in objective.gather(coordinates, true, make).ok()? {
            triangles.push((one.rows.triangle(), one.variances.map(Gathering::triangle)));
            tally.add(one.tally);
        }
        let curvature = tally.curvature / tally.weights;
        let variance = (tally.along_variance / tally.curvature).max(0.0).sqrt();
        let joined = |(mut means, variances): (Information, Option<Information>)| {
            if let Some(mut variances) = variances {
                variances.scale_columns(&vec![variance; variances.columns()]);
                means.merge(&variances);
            }
            means
        };
        let mut triangles: Vec<Information> = triangles.into_iter().map(joined).collect();
        // A prior is a measurement of unit variance; all is multiplied by the mean curvature later.
        unknowns.add_priors(coordinates, curvature.max(f64::MIN_POSITIVE).sqrt().recip(), &mut triangles);
        let linear = Linearization::new(0.0, unknowns.shared(), triangles);
        let noise = tally.squares / tally.count.max(1.0) / (curvature * curvature);
        Some(Bread { linear, curvature, variance, noise, tally })
    }

    /// Sums of `psi'` and of its squares over all measurements, and the number of these.
    pub fn slopes_of_influence(&self) -> [f64; 3] {
        let Tally { slopes: [sum, squares], count, .. } = self.tally;
        [sum, squares, count]
    }

    /// The accumulator of the scores of an experiment, by the inverse of the curvature.
    pub fn scores<'o>(&self, objective: &'o Objective<'o>, inverse: &Covariance, e: usize) -> Scores<'o> {
        Scores::new(objective, e, of_experiment(objective, inverse, e), self.noise, self.variance)
    }

    /// `A^-1 B A^-1` over all unknowns that are not held, of scores of which the squares are to be multiplied by a number.
    pub fn sandwich(&self, held: &[bool], scores: &[Information], scale: f64) -> Option<Covariance> {
        Some(self.linear.sandwich(held, scores)?.times(scale / (self.curvature * self.curvature)))
    }
}

/// What the pass for the curvature sums up over all measurements.
struct Tally {
    weights: f64,
    curvature: f64,
    /// Sum of the curvatures along the logarithm of a predicted variance.
    along_variance: f64,
    /// Sums of the products of two outputs' influences.
    influence: DMatrix<f64>,
    /// Sums of the variance that white noise of variance one would have.
    expected: Vec<f64>,
    /// Sum of the squared influences times their weights, and their number.
    squares: f64,
    count: f64,
    /// Sums of `psi'` and of its squares.
    slopes: [f64; 2],
}

impl Tally {
    fn new(outputs: usize) -> Self {
        Tally {
            weights: 0.0,
            curvature: 0.0,
            along_variance: 0.0,
            influence: DMatrix::zeros(outputs, outputs),
            expected: vec![0.0; outputs],
            squares: 0.0,
            count: 0.0,
            slopes: [0.0; 2],
        }
    }

    fn add(&mut self, other: Tally) {
        self.weights += other.weights;
        self.curvature += other.curvature;
        self.along_variance += other.along_variance;
        self.influence += other.influence;
        self.expected.iter_mut().zip(other.expected).for_each(|(sum, other)| *sum += other);
        self.squares += other.squares;
        self.count += other.count;
        self.slopes.iter_mut().zip(other.slopes).for_each(|(sum, other)| *sum += other);
    }
}

/// The sandwich over all unknowns that are not held, in one more pass with slopes. `None` where that fails.
pub(crate) fn sandwich(point: &Point<'_>, bread: &Bread) -> Option<Robust> {
    let Point { objective, end, held_for_covariance: held, .. } = point;
    let x = &end.coordinates;
    let degrees = vec![f64::INFINITY; held.len()];
    let Some(inverse) = bread.linear.covariance(held) else {
        return Some(Robust { covariance: None, shares: None, degrees });
    };
    let Some(filter) = &objective.problem.settings.prefilter else {
        let all = objective.gather(x, true, |e| bread.scores(objective, &inverse, e)).ok()?;
        return Some(of_scores(point, bread, all));
    };
    let (mut scores, scale) = filtered_scores(objective, x, (&inverse, &bread.tally), filter)?;
    objective.problem.unknowns.add_priors(x, scale.sqrt().recip(), &mut scores);
    Some(Robust { covariance: bread.sandwich(held, &scores, scale), shares: None, degrees })
}

/// The sandwich of the scores of all experiments.
pub(crate) fn of_scores(point: &Point<'_>, bread: &Bread, all: Vec<Scores<'_>>) -> Robust {
    let Point { objective, end, held_for_covariance: held, .. } = point;
    let shares = shares::of_all(objective, all.iter().map(|one| &one.shares));
    let degrees = scores::degrees(objective, &all);
    let mut triangles: Vec<Information> = all.into_iter().map(|one| one.scores.triangle()).collect();
    objective.problem.unknowns.add_priors(&end.coordinates, 1.0, &mut triangles);
    Robust { covariance: bread.sandwich(held, &triangles, 1.0), shares: Some(shares), degrees }
}

/// The triangle of each experiment's scores where a filter correlated white errors, and the factor for all of them by which the noise is
/// larger than the errors. Holds the slopes of one experiment at a time.
fn filtered_scores(
    objective: &Objective<'_>,
    coordinates: &[f64],
    (inverse, tally): (&Covariance, &Tally),
    filter: &Butterworth,
) -> Option<(Vec<Information>, f64)> {
    let expected = |i: usize| tally.expected[i].max(f64::MIN_POSITIVE);
    let outputs = objective.outputs();
    let noise = DMatrix::from_fn(outputs, outputs, |i, j| tally.influence[(i, j)] / (expected(i) * expected(j)).sqrt());
    let deviations = DMatrix::from_diagonal(&noise.diagonal().map(f64::sqrt));
    let factor = noise.cholesky().map_or(deviations, |cholesky| cholesky.l());
    let (mut scores, mut taken) = (vec![], 0.0);
    for experiment in 0..objective.experiments() {
        let columns = objective.problem.unknowns.columns(experiment).count();
        let samples = objective.problem.records[experiment].len();
        let make = || {
            let (slopes, measured) = (vec![0.0; columns * outputs * samples], vec![false; outputs * samples]);
            Backward { objective, experiment, columns, samples, slopes, measured }
        };
        let mut gathered = objective.gather_one(coordinates, experiment, true, make).ok()?;
        let inverse = of_experiment(objective, inverse, experiment);
        let (triangle, part) = gathered.scores(filter, &factor, &inverse, outputs);
        scores.push(triangle);
        taken += part;
    }
    let expected: f64 = tally.expected.iter().sum();
    Some((scores, expected / (expected - taken).max(f64::MIN_POSITIVE)))
}

/// The triangle of `sqrt(w) g`, that of `sqrt(w) d` where variances are predicted, and sums of the errors.
struct Curvature<'c> {
    objective: &'c Objective<'c>,
    experiment: usize,
    tally: Tally,
    rows: Gathering,
    variances: Option<Gathering>,
    impulse: Option<ImpulseResponse<'c>>,
    row: Vec<f64>,
}

impl Accumulate for Curvature<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, lanes) = (window.outputs(), window.lanes());
        let loss = self.objective.loss();
        let mut psi = vec![0.0; outputs];
        for k in 0..window.samples[lane] {
            let w = self.objective.weight(self.experiment, window.begin[lane] + k);
            let expected = self.impulse.as_mut().map_or(1.0, ImpulseResponse::next);
            psi.fill(0.0);
            for j in (0..outputs).filter(|&j| w > 0.0 && window.is_measured(k, j, lane)) {
                let z = window.error(k, j, lane);
                psi[j] = loss.map_or(z, |loss| loss.psi(z));
                self.tally.weights += w;
                let slope = loss.map_or(1.0, |loss| loss.slope(z));
                self.tally.curvature += w * slope;
                self.tally.slopes.iter_mut().zip([slope, slope * slope]).for_each(|(sum, one)| *sum += one);
                self.tally.expected[j] += expected;
                self.tally.squares += w * psi[j] * psi[j];
                self.tally.count += 1.0;
                self.tally.along_variance += w * 0.5 * (slope * z + psi[j]) * z;
                let mut take = |row: &[f64], rows: &mut Gathering| {
                    let values = row.iter().skip(lane).step_by(lanes);
                    self.row.iter_mut().zip(values).for_each(|(to, from)| *to = from * w.sqrt());
                    rows.take(&self.row, 0.0);
                };
                take(window.row(k, j), &mut self.rows);
                if let Some(variances) = &mut self.variances {
                    take(window.variance_row(k, j), variances);
                }
            }
            for (i, j) in (0..outputs).flat_map(|i| (0..outputs).map(move |j| (i, j))) {
                self.tally.influence[(i, j)] += psi[i] * psi[j];
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.rows.append(later.rows);
        self.variances.iter_mut().zip(later.variances).for_each(|(own, later)| own.append(later));
        self.tally.add(later.tally);
    }
}

/// The weighted slopes of an experiment backward in time: sample by sample, column by column, output by output.
struct Backward<'b> {
    objective: &'b Objective<'b>,
    experiment: usize,
    columns: usize,
    samples: usize,
    slopes: Vec<f64>,
    measured: Vec<bool>,
}

impl Accumulate for Backward<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, samples) = (window.outputs(), self.samples);
        for k in 0..window.samples[lane] {
            let sample = window.begin[lane] + k;
            let (weight, back) = (self.objective.weight(self.experiment, sample), samples - 1 - sample);
            for j in 0..outputs {
                self.measured[j * samples + back] = window.is_measured(k, j, lane);
                for c in 0..self.columns {
                    self.slopes[(back * self.columns + c) * outputs + j] = weight * window.at(k, j, c, lane);
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.slopes.iter_mut().zip(later.slopes).for_each(|(slope, later)| *slope += later);
        self.measured.iter_mut().zip(later.measured).for_each(|(measured, later)| *measured |= later);
    }
}

impl Backward<'_> {
    /// The triangle of the scores, and the sum of the leverages.
    fn scores(
        &mut self,
        filter: &Butterworth,
        factor: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
        outputs: usize,
    ) -> (Information, f64) {
        let Backward { columns, samples, slopes, measured, .. } = self;
        let (columns, samples) = (*columns, *samples);
        filter.filter_rows(slopes, columns * outputs, &mut vec![]);
        let (mut scores, mut score, mut taken) = (Gathering::new(columns), vec![0.0; columns], 0.0);
        for k in 0..samples {
            let at = |c: usize, j: usize| {
                if measured[j * samples + k] { slopes[(k * columns + c) * outputs + j] } else { 0.0 }
            };
            for j in 0..outputs {
                score.iter_mut().enumerate().for_each(|(c, score)| *score = at(c, j));
                taken += form(inverse, &score);
                score.iter_mut().enumerate().for_each(|(c, score)| {
                    *score = (j..outputs).map(|i| factor[(i, j)] * at(c, i)).sum();
                });
                scores.take(&score, 0.0);
            }
        }
        (scores.triangle(), taken)
    }
}

/// Variance that white noise of variance one has after a filter that was at rest: the sum of the squared impulse
/// response so far.
struct ImpulseResponse<'f> {
    filter: &'f Butterworth,
    state: Vec<f64>,
    impulse: f64,
    total: f64,
}

impl<'f> ImpulseResponse<'f> {
    fn new(filter: &'f Butterworth) -> Self {
        ImpulseResponse { filter, state: vec![], impulse: 1.0, total: 0.0 }
    }

    fn next(&mut self) -> f64 {
        let mut response = [std::mem::take(&mut self.impulse)];
        self.filter.filter_rows(&mut response, 1, &mut self.state);
        self.total += response[0] * response[0];
        self.total
    }
}

#[cfg(test)]
mod tests;
