//! The covariance of the scores where the errors are stationary and unrelated to the slopes, whatever the slopes are.
//!
//! Sums of scores over moving windows need many independent stretches of a record. An unknown that only part of the record
//! informs, such as an initial state, has one: its scores sum to zero there, and so do the windows that hold that part. The
//! errors' own autocorrelation, of which the whole record tells, serves instead: the errors of each output are an
//! autoregression (Yule and Walker's equations, order by Akaike's criterion), and the variance of `sum g[t] e[t]` is that of
//! the innovations times the sum of squares of the slopes `g`, filtered by the autoregression and beyond the end of the
//! record. (In which direction does not matter: a stationary sequence has the same covariances backward.)

use crate::covariance::leverage::ALONE;
use crate::covariance::shares::Shares;
use crate::information::{Gathering, Information};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use crate::whiteness::{Autocorrelation, levinson_durbin};
use nalgebra::DMatrix;
use std::collections::VecDeque;

/// Highest order.
const ORDER: usize = 20;
/// The part of an impulse response's sum of squares that is left out, and its greatest length.
const REST: f64 = 1e-8;
const LONGEST: usize = 1000;
/// An experiment with fewer measurements of an output takes the autoregression of all experiments together.
const OWN: u64 = 100;

/// What the errors say of autoregressions, by the sums of all experiments.
pub(crate) struct Stationary {
    /// The autoregressions of each experiment's outputs.
    pub models: Vec<Vec<Autoregression>>,
    /// Whether an experiment has too few measurements of an output for an autoregression of its own.
    pub short: Vec<bool>,
    /// Relative variance of a variance by the autoregression of all experiments together.
    pub uncertainty: f64,
}

impl Stationary {
    pub fn of(outputs: usize, all: &[&ErrorSums]) -> Self {
        let together = joined(all.iter().map(|one| &one.sums[..]), outputs);
        let of_all = together.iter().map(|(sums, count)| Autoregression::of(sums, *count).uncertainty(*count));
        let uncertainty = of_all.fold(0.0, f64::max);
        let is_short = |(_, count): &(Autocorrelation, u64)| *count < OWN;
        let models = |one: &&ErrorSums| -> Vec<Autoregression> {
            let own = one.sums.iter().zip(&together);
            own.map(|(own, together)| if is_short(own) { together } else { own })
                .map(|(sums, count)| Autoregression::of(sums, *count))
                .collect()
        };
        let short = all.iter().map(|one| one.sums.iter().any(is_short)).collect();
        Stationary { models: all.iter().map(models).collect(), short, uncertainty }
    }
}

/// The sums and counts of all experiments, output by output.
fn joined<'s>(all: impl Iterator<Item = &'s [(Autocorrelation, u64)]>, outputs: usize) -> Vec<(Autocorrelation, u64)> {
    let mut joined = vec![(Autocorrelation::new(ORDER), 0); outputs];
    for one in all {
        for ((sums, count), (own, more)) in joined.iter_mut().zip(one) {
            sums.append(own);
            *count += more;
        }
    }
    joined
}

/// `e[t] = sum over k of a[k] e[t - 1 - k]`, and an innovation.
pub(crate) struct Autoregression {
    coefficients: Vec<f64>,
    /// Standard deviation of the innovations.
    innovation: f64,
    /// Samples after which nothing is left of an innovation.
    length: usize,
}

impl Autoregression {
    /// Of the order that Akaike's criterion prefers.
    fn of(sums: &Autocorrelation, count: u64) -> Self {
        let (sums, n) = (sums.sums(), count as f64);
        let orders = (sums.len() - 1).min((count as usize / 4).saturating_sub(1));
        let correlations: Vec<f64> = sums[1..=orders].iter().map(|sum| sum / sums[0]).collect();
        let (mut least, mut coefficients, mut relative) = (0.0, vec![], 1.0);
        levinson_durbin(&correlations, |a, variance| {
            let criterion = n * variance.ln() + 2.0 * a.len() as f64;
            if criterion < least {
                (least, coefficients, relative) = (criterion, a.to_vec(), variance);
            }
        });
        let innovation = (sums[0] / n.max(1.0) * relative).sqrt();
        Autoregression { length: length(&coefficients), coefficients, innovation }
    }
}

impl Autoregression {
    /// Relative variance of the variance of a slow combination of so many errors: `2 / n` by the innovations, and by the coefficients as for
    /// an autoregression of order one with the same long-run variance, `4 d / n` where `d` errors count for one.
    fn uncertainty(&self, count: u64) -> f64 {
        let whole: f64 = self.coefficients.iter().sum();
        let response: f64 = response(&self.coefficients).iter().map(|r| r * r).sum();
        let dependence = ((1.0 - whole).powi(-2) / response).max(1.0);
        (2.0 + 4.0 * dependence) / count.max(1) as f64
    }
}

/// The samples that hold an impulse response but for a small rest.
fn length(coefficients: &[f64]) -> usize {
    let response = response(coefficients);
    let whole: f64 = response.iter().map(|r| r * r).sum();
    let mut rest = 0.0;
    let short = |r: &&f64| {
        rest += **r * **r;
        rest <= REST * whole
    };
    LONGEST - response.iter().rev().take_while(short).count()
}

/// The response to one innovation.
fn response(coefficients: &[f64]) -> Vec<f64> {
    let mut response = vec![1.0];
    for t in 1..LONGEST {
        response.push(coefficients.iter().zip(response[..t].iter().rev()).map(|(a, before)| a * before).sum());
    }
    response
}

/// Autocorrelations of the influences of each output's measurements, one after the other, and their number; the largest shares of the
/// unknowns and the sizes of the errors that have them. Errors of a fit are smaller than the noise, their variance by one less their
/// leverage, by whose root each is divided.
pub(crate) struct ErrorSums {
    pub shares: Shares,
    sums: Vec<(Autocorrelation, u64)>,
}

/// The same while it is summed up.
pub(crate) struct Errors<'e> {
    objective: &'e Objective<'e>,
    experiment: usize,
    pub into: ErrorSums,
    run: Vec<f64>,
}

impl<'e> Errors<'e> {
    /// By the inverse of the curvature.
    pub fn new(objective: &'e Objective<'e>, experiment: usize, inverse: DMatrix<f64>) -> Self {
        let sums = vec![(Autocorrelation::new(ORDER), 0); objective.outputs()];
        Errors {
            objective,
            experiment,
            into: ErrorSums { shares: Shares::new(experiment, inverse), sums },
            run: vec![],
        }
    }
}

impl Accumulate for Errors<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (objective, loss) = (self.objective, self.objective.loss());
        let ErrorSums { shares, sums } = &mut self.into;
        let mut slopes = vec![0.0; shares.columns()];
        for (j, (sums, count)) in sums.iter_mut().enumerate() {
            let mut influence = |k: usize| {
                let sample = window.begin[lane] + k;
                let (z, weight) = (window.error(k, j, lane), objective.weight(self.experiment, sample));
                slopes.iter_mut().enumerate().for_each(|(c, slope)| *slope = window.at(k, j, c, lane));
                raised(weight, shares.take(weight, &slopes, z, (j, sample))) * loss.map_or(z, |loss| loss.psi(z))
            };
            self.run.clear();
            let measured = (0..window.samples[lane]).filter(|&k| window.is_measured(k, j, lane));
            self.run.extend(measured.map(&mut influence));
            *count += self.run.len() as u64;
            sums.add(&self.run);
        }
    }

    fn append(&mut self, later: Self) {
        self.into.shares.append(&later.into.shares);
        for ((sums, count), (later, more)) in self.into.sums.iter_mut().zip(&later.into.sums) {
            sums.follow(later);
            *count += more;
        }
    }
}

/// The triangle of the slopes, filtered by the autoregressions of their outputs.
pub(crate) struct FilteredSlopes<'p> {
    objective: &'p Objective<'p>,
    experiment: usize,
    models: &'p [Autoregression],
    outputs: Vec<Recent>,
    row: Vec<f64>,
    rows: Gathering,
}

/// The slopes of an output.
#[derive(Clone)]
struct Recent {
    /// The first rows, which those before this piece still act on; they are absorbed when these are known.
    first: Vec<Vec<f64>>,
    /// The last filtered rows, the last one first.
    filtered: VecDeque<Vec<f64>>,
}

impl<'p> FilteredSlopes<'p> {
    pub fn new(objective: &'p Objective<'p>, experiment: usize, models: &'p [Autoregression]) -> Self {
        let columns = objective.problem.unknowns.columns(experiment).count();
        let rows = |model: &Autoregression| Recent {
            first: vec![],
            filtered: model.coefficients.iter().map(|_| vec![0.0; columns]).collect(),
        };
        FilteredSlopes {
            objective,
            experiment,
            models,
            outputs: models.iter().map(rows).collect(),
            row: vec![0.0; columns],
            rows: Gathering::new(columns),
        }
    }

    /// The next row of an output, in `row`.
    fn take(&mut self, j: usize) {
        let (model, Recent { first, filtered }) = (&self.models[j], &mut self.outputs[j]);
        let counts = first.len() == model.length;
        if !counts {
            first.push(self.row.clone());
        }
        filter(&model.coefficients, filtered, &mut self.row);
        if counts {
            self.row.iter_mut().for_each(|row| *row *= model.innovation);
            self.rows.take(&self.row, 0.0);
        }
    }

    /// The triangle, from rest before the first row until nothing is left of the last one.
    pub fn triangle(self) -> Information {
        let mut whole = FilteredSlopes::new(self.objective, self.experiment, self.models);
        whole.outputs.iter_mut().zip(self.models).for_each(|(rows, model)| rows.first = vec![vec![]; model.length]);
        whole.append(self);
        for j in 0..whole.models.len() {
            for _ in 1..whole.models[j].length {
                whole.row.fill(0.0);
                whole.take(j);
            }
        }
        whole.rows.triangle()
    }
}

impl Accumulate for FilteredSlopes<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for k in 0..window.samples[lane] {
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k).sqrt();
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane)) {
                self.row.iter_mut().enumerate().for_each(|(c, row)| *row = weight * window.at(k, j, c, lane));
                self.take(j);
            }
        }
    }

    fn append(&mut self, later: Self) {
        for (j, rows) in later.outputs.iter().enumerate() {
            for row in &rows.first {
                self.row.copy_from_slice(row);
                self.take(j);
            }
        }
        for ((rows, later), model) in self.outputs.iter_mut().zip(later.outputs).zip(self.models) {
            // After so many rows of its own, nothing is left of those before.
            if later.first.len() == model.length {
                rows.filtered = later.filtered;
            }
        }
        self.rows.append(later.rows);
    }
}

/// The root of a weight, raised by what the fit to this measurement took off its error.
fn raised(weight: f64, leverage: f64) -> f64 {
    (weight / (1.0 - leverage).max(ALONE)).sqrt()
}

/// Adds the filtered rows before, the newest first, times these coefficients to a row, and takes it among them.
fn filter(coefficients: &[f64], filtered: &mut VecDeque<Vec<f64>>, row: &mut [f64]) {
    for (a, before) in coefficients.iter().zip(&*filtered) {
        row.iter_mut().zip(before).for_each(|(row, before)| *row += a * before);
    }
    if let Some(mut oldest) = filtered.pop_back() {
        oldest.copy_from_slice(row);
        filtered.push_front(oldest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Sample, Time, free};
    use nalgebra::DMatrix;

    /// The sum of squares of the weighted slopes, filtered from rest until nothing is left of them, but for 1e-8 of the squares, which
    /// is 1e-4 of the slopes.
    #[test]
    fn slopes_are_filtered_along_a_record() {
        let inputs: Vec<Voltage> = (0..700).map(|k| Voltage { u: f64::from(k * k % 17) - 8.0 }).collect();
        let outputs = inputs.iter().map(|u| Current { i: 2.0 * u.u + 0.1 }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs.clone(), outputs).unwrap();
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).noise(Current { i: 0.5 });
        let problem = fit.weighting(|s: &Sample<Line>| 1.0 + s.t / 100.0).problem().unwrap();
        let objective = problem.objective().unwrap();
        let coefficients = [0.9, -0.3];
        let model =
            Autoregression { length: length(&coefficients), coefficients: coefficients.to_vec(), innovation: 3.0 };
        let make = || FilteredSlopes::new(&objective, 0, std::slice::from_ref(&model));
        let found = objective.gather_one(&[1.0], 0, true, make).ok().unwrap().triangle().column_norms()[0];
        let mut filtered: Vec<f64> = vec![];
        for k in 0..1100 {
            let slope = inputs.get(k).map_or(0.0, |u| (1.0 + k as f64 / 100.0).sqrt() * u.u / 0.5);
            let before: f64 = coefficients.iter().zip(filtered.iter().rev()).map(|(a, before)| a * before).sum();
            filtered.push(slope + before);
        }
        let expected = 3.0 * filtered.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    }

    /// The impulse response of `y[t] = u[t] + 0.5 y[t - 1] - 0.25 y[t - 2]`.
    #[test]
    fn rows_are_filtered() {
        let mut filtered: VecDeque<Vec<f64>> = vec![vec![0.0, 0.0]; 2].into();
        let response = [1.0, 0.0, 0.0, 0.0].map(|u| {
            let mut row = [u, -2.0 * u];
            filter(&[0.5, -0.25], &mut filtered, &mut row);
            assert_eq!(row[1], -2.0 * row[0]);
            row[0]
        });
        assert_eq!(response, [1.0, 0.5, 0.0, -0.125]);
        assert_eq!([raised(4.0, 0.4), raised(4.0, 0.0)], [(4.0f64 / 0.6).sqrt(), 2.0]);
    }

    /// Two outputs of two experiments: sums of squares of 1 + 4 and 9, then of 4 and 16 + 1, of so many errors.
    #[test]
    fn experiments_add_up() {
        let of = |errors: &[f64]| {
            let mut sums = Autocorrelation::new(ORDER);
            sums.add(errors);
            (sums, errors.len() as u64)
        };
        let all = [[of(&[1.0, 2.0]), of(&[3.0])], [of(&[2.0]), of(&[4.0, 1.0, 0.0])]];
        let found = joined(all.iter().map(|one| &one[..]), 2);
        let found: Vec<_> = found.iter().map(|(sums, count)| (sums.sums()[0], *count)).collect();
        assert_eq!(found, [(9.0, 3), (26.0, 4)]);
    }

    /// `e[t] = 0.8 e[t - 1] + w[t]` with innovations of unit variance; the impulse response `0.8^t`, whose squares are
    /// `0.64^t`, has 1e-8 of them left after `ln 1e-8 / ln 0.64 = 41.3` samples.
    #[test]
    fn an_autoregression_by_its_autocorrelations() {
        let mut e = vec![0.0; 20_000];
        let mut random = crate::random::Random::stream(1, 2);
        for t in 1..e.len() {
            e[t] = 0.8 * e[t - 1] + random.normal();
        }
        let mut sums = Autocorrelation::new(ORDER);
        sums.add(&e);
        let found = Autoregression::of(&sums, e.len() as u64);
        // Standard deviation of the coefficient: sqrt((1 - 0.64) / 20,000) = 0.0042; of the innovations' 0.005.
        assert!((found.coefficients[0] - 0.8).abs() < 0.02, "{:?}", found.coefficients);
        assert!((found.innovation - 1.0).abs() < 0.02, "{}", found.innovation);
        assert_eq!(length(&[0.8]), 42);
        assert_eq!(length(&[]), 1);
        // Four measurements for each coefficient and the variance, at the least.
        for (count, order) in [(7, 0), (8, 1), (11, 1), (12, 2)] {
            assert!(Autoregression::of(&sums, count).coefficients.len() <= order, "{count}");
        }
        assert_eq!(Autoregression::of(&sums, 8).coefficients.len(), 1);
    }

    /// White errors, and an autoregression of 0.8, of whose errors `(1 + 0.8) / (1 - 0.8) = 9` count for one.
    #[test]
    fn the_variance_of_a_variance() {
        let of = |coefficients: &[f64]| {
            let coefficients = coefficients.to_vec();
            Autoregression { length: 1, coefficients, innovation: 1.0 }.uncertainty(1000)
        };
        assert!((of(&[]) - 6e-3).abs() < 1e-15 && (of(&[0.8]) - 38e-3).abs() < 1e-12, "{} {}", of(&[]), of(&[0.8]));
    }

    /// The order is the first of the least `n ln(v) + 2 k`, where `v` is the part of the variance that the best of `k`
    /// coefficients leave, here by solving Yule and Walker's equations of each order.
    #[test]
    fn the_order_is_that_of_the_least_criterion() {
        let mut orders = vec![];
        for seed in 0..30 {
            let mut random = crate::random::Random::stream(seed, 5);
            let mut e = vec![0.0; 300];
            for t in 3..e.len() {
                e[t] = 0.1 * e[t - 1] + 0.12 * e[t - 3] + random.normal();
            }
            let mut sums = Autocorrelation::new(ORDER);
            sums.add(&e);
            let rho: Vec<f64> = sums.sums().iter().map(|sum| sum / sums.sums()[0]).collect();
            let solved = |k: usize| {
                let matrix = DMatrix::from_fn(k, k, |i, j| rho[i.abs_diff(j)]);
                let right = nalgebra::DVector::from_column_slice(&rho[1..=k]);
                let a = matrix.lu().solve(&right).unwrap();
                (a.iter().copied().collect::<Vec<f64>>(), 1.0 - a.dot(&right))
            };
            let criterion = |k: usize| if k == 0 { 0.0 } else { 300.0 * solved(k).1.ln() + 2.0 * k as f64 };
            let best = (0..=ORDER).min_by(|&a, &b| criterion(a).total_cmp(&criterion(b))).unwrap();
            let found = Autoregression::of(&sums, 300);
            let (expected, left) = if best == 0 { (vec![], 1.0) } else { solved(best) };
            assert_eq!(found.coefficients.len(), best, "{seed}");
            assert!(found.coefficients.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-10), "{seed}");
            assert!(
                (found.innovation - (sums.sums()[0] / 300.0 * left).sqrt()).abs() < 1e-10,
                "{seed}: {}",
                found.innovation
            );
            orders.push(best);
        }
        assert!(orders.contains(&0) && orders.contains(&3), "{orders:?}");
    }
}
