//! Whether samples are close enough together to tell at which frequency the plant oscillates.
//!
//! Samples `h` apart of an oscillation at the frequency `w` are those of one at `2 pi/h - w`, too. What the inputs do between
//! samples tells the two apart, but each of them has a minimum of its own, and a search ends in that on its side of `pi/h`.

use super::conclude::Judgement;
use crate::estimate::{Warning, WarningCode};
use crate::numeral::number;
use crate::optimize::Severity;
use crate::problem::Role;
use crate::record::{Record, Time};
use nalgebra::{DMatrix, Schur};
use std::f64::consts::{PI, TAU};

/// An oscillation with fewer samples a period than this can be taken for its alias, whose frequency is then within a factor of 1.5.
const SAMPLES: f64 = 2.5;
/// What is left of an oscillation after an interval, at the least, for the next sample to show it.
const LEFT: f64 = 0.1;
/// Factor within which unknowns may be off where no bound is nearer: that within which `Fit::starts` draws.
const REACH: f64 = 10.0;
/// Relative change of a parameter for the slope of a frequency.
const CHANGE: f64 = 1e-4;
/// So many points along the records are examined, and so many steps of time.
const POINTS: usize = 8;
const STEPS: usize = 1000;
/// Sampling is uneven where the quartiles of its steps of time differ by more than this part of the median.
const EVEN: f64 = 0.1;
const ITERATIONS: usize = 10_000;

/// A point of a record: experiment, sample and state.
pub(super) type Point = (usize, usize, Vec<f64>);

impl Judgement<'_> {
    /// An oscillation of which there are too few samples, with parameters that may make it another one.
    pub(super) fn aliased(&self) -> Option<Warning> {
        let interval = interval(&self.objective.problem.records)?;
        let points = &self.residuals.points;
        let some = points.iter().step_by(points.len().div_ceil(POINTS).max(1));
        let found = some.filter_map(|point| self.unresolved(point, interval));
        let (frequency, alias, name) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        // Ends of other searches have been compared.
        let compared = self.end.starts.as_ref().is_some_and(|starts| starts.tried > 1);
        let severity = if compared { Severity::Usable } else { Severity::UsableWithCare };
        let tried = if compared { "searches were started on both sides" } else { "no search was started there" };
        let text = format!(
            "the model oscillates at {} rad/s, of which the samples, {} s apart, take {} a period: an oscillation at {} rad/s gives \
             the same samples, with other parameters ({tried}); sample faster, search from several starts (Fit::starts), or bound \
             `{name}`",
            number(frequency, 3),
            number(interval, 3),
            number(TAU / (frequency * interval), 2),
            number(alias, 3)
        );
        Some(Warning { code: WarningCode::Aliased, severity, text })
    }

    /// The fastest oscillation at a point of which there are too few samples: its frequency, the other one with the same samples
    /// (both in rad/s), and the parameter that moves it most; `None` where parameters within their bounds do not reach the other.
    fn unresolved(&self, point: &Point, interval: f64) -> Option<(f64, f64, String)> {
        let p = self.objective.problem.unknowns.of_experiment(point.0, &self.end.coordinates).p;
        let modes = self.modes(point, &p)?;
        let few =
            |(decay, frequency): &&(f64, f64)| frequency * interval * SAMPLES > TAU && (decay * interval).exp() > LEFT;
        let &mode = modes.iter().filter(few).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let frequency = mode.1;
        let alias = 2.0 * PI / interval * (frequency * interval / PI).round() - frequency;
        let needed = (alias / frequency).ln();
        let (mut reach, mut most) = (0.0, (0.0, String::new()));
        for unknown in &self.objective.problem.unknowns.row {
            let Role::Parameter(j) = unknown.role else { continue };
            if unknown.experiment.is_some_and(|e| e != point.0) {
                continue;
            }
            let mut changed = p.clone();
            changed[j] *= 1.0 + CHANGE;
            let slope = (nearest(&self.modes(point, &changed)?, mode) / frequency).ln() / CHANGE;
            let (grows, parameter) = ((slope > 0.0) == (needed > 0.0), unknown.parameter);
            let bound = if grows == (p[j] > 0.0) { parameter.upper } else { parameter.lower };
            // Not a number, where the bound has another sign.
            let moves = slope.abs() * (bound / p[j]).ln().abs().min(REACH.ln());
            reach += moves;
            if moves > most.0 {
                most = (moves, unknown.name.clone());
            }
        }
        (reach > needed.abs()).then_some((frequency, alias, most.1))
    }

    /// Decay (negative) and frequency of each oscillation about a point, in 1/s and rad/s.
    fn modes(&self, (e, sample, state): &Point, p: &[f64]) -> Option<Vec<(f64, f64)>> {
        let record = &self.objective.problem.records[*e];
        let slopes = self.objective.sweep.state_slopes(record, *sample, state, p)?;
        let n = state.len();
        if !slopes.iter().all(|slope| slope.is_finite()) {
            return None;
        }
        let schur = Schur::try_new(DMatrix::from_row_slice(n, n, &slopes), f64::EPSILON, ITERATIONS)?;
        let values = schur.complex_eigenvalues();
        Some(values.iter().filter(|value| value.im > 0.0).map(|value| (value.re, value.im)).collect())
    }
}

/// The frequency of the oscillation that is nearest to one.
fn nearest(modes: &[(f64, f64)], (decay, frequency): (f64, f64)) -> f64 {
    let distance = |mode: &&(f64, f64)| (mode.0 - decay).hypot(mode.1 - frequency);
    modes.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(frequency, |mode| mode.1)
}

/// The time of which all distances between measurements of an output are multiples (s), that of the output and record which has
/// the shortest; `None` where a record is sampled unevenly, which leaves no other frequency.
fn interval(records: &[Record]) -> Option<f64> {
    let mut shortest = f64::INFINITY;
    for record in records {
        let step = step(record)?;
        for channel in record.outputs() {
            let (mut rows, mut last) = (0, None);
            for (k, _) in channel.values.iter().enumerate().filter(|(_, y)| !y.is_nan()) {
                rows = greatest_common_divisor(k - last.unwrap_or(k), rows);
                last = Some(k);
                if rows == 1 {
                    break;
                }
            }
            if rows > 0 {
                shortest = shortest.min(rows as f64 * step);
            }
        }
    }
    Some(shortest).filter(|shortest| shortest.is_finite())
}

/// The step of time of a record that is sampled evenly (s).
fn step(record: &Record) -> Option<f64> {
    let stamps = match record.times() {
        Time::Uniform { step, .. } => return Some(*step),
        Time::Stamps(stamps) => stamps,
    };
    let mut steps: Vec<f64> = stamps.windows(2).take(STEPS).map(|t| t[1] - t[0]).collect();
    steps.sort_by(f64::total_cmp);
    let part = |quarters: usize| steps.get(quarters * (steps.len().max(1) - 1) / 4).copied();
    let (low, middle, high) = (part(1)?, part(2)?, part(3)?);
    (high - low <= EVEN * middle).then_some(middle)
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Channel;

    fn record(time: Time, measured: &[usize]) -> Record {
        let mut values = vec![f64::NAN; 40];
        measured.iter().for_each(|&k| values[k] = 1.0);
        let channel = Channel::new("y", "", values);
        Record::new(vec![], time, vec![], vec![channel]).unwrap()
    }

    #[test]
    fn the_nearest_oscillation() {
        let modes = [(-1.0, 5.0), (-3.0, 8.0), (-20.0, 7.0)];
        assert_eq!(
            [nearest(&modes, (-3.0, 7.0)), nearest(&modes, (-1.0, 6.0)), nearest(&[], (-1.0, 6.0))],
            [8.0, 5.0, 6.0]
        );
        // Of decays of the other sign the nearest is that of the smaller difference, not of the smaller sum.
        assert_eq!(nearest(&[(-4.0, 5.0), (4.0, 6.0)], (-4.0, 5.5)), 5.0);
    }

    /// The quartiles of four steps are the first, the second and the third of them in order of size.
    #[test]
    fn steps_by_their_quartiles() {
        let of = |stamps: &[f64]| {
            let channel = Channel::new("y", "", vec![1.0; stamps.len()]);
            step(&Record::new(vec![], Time::Stamps(stamps.to_vec()), vec![], vec![channel]).unwrap())
        };
        assert_eq!(of(&[0.0, 1.0, 2.0, 3.0, 9.0]), Some(1.0));
        assert_eq!(of(&[0.0, 1.0, 2.0, 5.0, 9.0]), None);
        assert_eq!(of(&[0.0, 2.0]), Some(2.0));
    }

    /// By hand: measured at samples 3, 7, 17 and 21, all distances are multiples of 2; the shortest of two records counts; a step
    /// that scatters by more than a tenth leaves no other frequency.
    #[test]
    fn intervals_by_hand() {
        let uniform = |step| Time::Uniform { start: 0.0, step };
        let even = record(uniform(0.5), &[3, 7, 17, 21]);
        assert_eq!(interval(std::slice::from_ref(&even)), Some(1.0));
        assert_eq!(interval(&[even.clone(), record(uniform(0.3), &[0, 3, 6])]), Some(3.0 * 0.3));
        assert_eq!(interval(&[record(uniform(0.5), &[3])]), None);
        let stamps = |part: f64| (0..40).map(|k| f64::from(k) + part * f64::from(k * k % 3)).collect::<Vec<f64>>();
        assert_eq!(interval(&[record(Time::Stamps(stamps(0.0)), &[0, 5, 15])]), Some(5.0));
        assert_eq!(interval(&[even, record(Time::Stamps(stamps(0.3)), &[0, 5])]), None);
    }
}
