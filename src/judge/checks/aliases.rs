//! Whether samples are close enough together to tell at which frequency the plant oscillates.
//!
//! Samples `h` apart of an oscillation at the frequency `w` are those of one at `2 pi/h - w`, too. What the inputs do between
//! samples tells the two apart, but each of them has a minimum of its own, and a search ends in that on its side of `pi/h`.

use super::*;
use crate::record::{Record, Time, steps};
use crate::residuals::modes::{StateAt, eigenvalues, oscillating, reached, relative_slopes, some};
use crate::residuals::residual_pass;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

pub(crate) const ALIASES: Check = Check::new(
    "oscillations are resolved",
    "Are there fewer than 2.5 samples a period of an oscillation that parameters within their bounds turn into \
     its alias?",
    &[WarningCode::Aliased],
    |evidence, _| aliased(evidence).into(),
)
.levels(&[
    level("samples a period", SAMPLES, "below it an alias is within a factor of 1.5"),
    level("the amplitude that is left after a sample", LEFT, "a tenth shows"),
]);

/// An oscillation with fewer samples a period than this can be taken for its alias, whose frequency is then within a factor of 1.5.
const SAMPLES: f64 = 2.5;
/// An oscillation must keep at least this part of its amplitude over an interval for the next sample to show it.
const LEFT: f64 = 0.1;
/// Factor within which unknowns may be off where no bound is nearer: that within which `Fit::starts` draws.
const REACH: f64 = 10.0;
/// The largest relative change of a frequency at once.
const LARGEST_STEP: f64 = 0.1;
/// Number of steps of time that are examined.
const STEPS: usize = 1000;
/// Sampling is uneven where the quartiles of its steps of time differ by more than this part of the median.
const EVEN: f64 = 0.1;

/// Decay (negative, 1/s) and frequency (rad/s).
type Mode = (f64, f64);

/// An oscillation of which there are too few samples.
struct Unresolved<'p> {
    point: &'p StateAt,
    mode: Mode,
    /// Between samples (s).
    interval: f64,
    /// The other frequency with the same samples (rad/s).
    alias: f64,
    /// The unknown that moves it most.
    name: String,
}

/// The frequency of an oscillation of which there are too few samples (rad/s), and the points where it has another frequency with
/// the same samples.
pub(crate) struct Aliases {
    pub frequency: f64,
    /// Frequencies (rad/s) and coordinates of the unknowns.
    pub others: Vec<(f64, Vec<f64>)>,
}

impl Aliases {
    /// The aliases at a point; `None` where all oscillations are resolved. The other points are near this one and near the declared start,
    /// with all unknowns changed that move the frequency, or that alone which moves it most.
    pub fn at(objective: &Objective<'_>, coordinates: &[f64]) -> Option<Self> {
        let points = residual_pass(objective, coordinates).ok()?.points;
        let Unresolved { point, mode, interval, .. } = unresolved(objective, coordinates, &points)?;
        let folds = mode.1 * interval / PI;
        let slopes = slopes(objective, coordinates, point, mode)?;
        let moving: Vec<usize> = (0..slopes.len()).filter(|&i| slopes[i] != 0.0).collect();
        let most = moving.iter().copied().max_by(|&a, &b| slopes[a].abs().total_cmp(&slopes[b].abs()))?;
        let mut others = vec![];
        for fold in [folds.floor(), folds.ceil()] {
            let frequency = TAU / interval * fold - mode.1;
            if frequency <= 0.0 {
                continue;
            }
            for from in [coordinates, &objective.problem.unknowns.start()[..]] {
                for moving in [&moving[..], &[most]] {
                    let other = moved(objective, from, (point, mode), frequency, moving);
                    let other = other.map(|other| (frequency, other)).filter(|other| !others.contains(other));
                    others.extend(other);
                }
            }
        }
        Some(Aliases { frequency: mode.1, others })
    }
}

/// An oscillation of which there are too few samples, with parameters that may make it another one.
fn aliased(evidence: &Evidence<'_>) -> Option<Warning> {
    let found = unresolved(evidence.point.objective, &evidence.point.end.coordinates, &evidence.residuals.points)?;
    let Unresolved { mode: (_, frequency), interval, alias, name, .. } = found;
    // Ends of other searches have been compared.
    let compared = evidence.point.end.starts.is_some();
    let severity = if compared { Severity::Usable } else { Severity::UsableWithCare };
    let tried = if compared { "searches were started on both sides" } else { "no search was started there" };
    let about = if compared { About::Minimum } else { About::Frequency };
    let unit = evidence.point.objective.problem.records[0].time_unit();
    let per = unit.angular_frequency();
    let text = format!(
        "the model oscillates at {} {per}, of which the samples, {} apart, take {} a period: an oscillation at {} {per} gives \
         the same samples, with other parameters ({tried}); sample faster, search from several starts (Fit::starts), or bound \
         `{name}`",
        number(frequency, 3),
        unit.say(interval, 3),
        number(TAU / (frequency * interval), 2),
        number(alias, 3)
    );
    Some(Warning::new(WarningCode::Aliased, severity, text).about(about))
}

/// The fastest oscillation of which there are too few samples, where parameters within their bounds reach another one with the
/// same samples.
fn unresolved<'p>(objective: &Objective<'_>, coordinates: &[f64], points: &'p [StateAt]) -> Option<Unresolved<'p>> {
    let interval = interval(&objective.problem.records)?;
    let found = some(points).filter_map(|point| unresolved_at(objective, coordinates, point, interval));
    found.max_by(|a, b| a.mode.1.total_cmp(&b.mode.1))
}

/// Such an oscillation at one of these points.
fn unresolved_at<'p>(
    objective: &Objective<'_>,
    coordinates: &[f64],
    point: &'p StateAt,
    interval: f64,
) -> Option<Unresolved<'p>> {
    let modes = oscillations(&oscillating(objective, coordinates, point, TAU / (SAMPLES * interval))?);
    let &mode = modes.iter().filter(|mode| is_seen_too_seldom(**mode, interval)).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let alias = alias(mode.1, interval);
    let needed = (alias / mode.1).ln();
    let unknowns = &objective.problem.unknowns;
    let slopes = slopes(objective, coordinates, point, mode)?;
    let values = unknowns.values(coordinates);
    let moves = (0..slopes.len()).map(|i| {
        let parameter = unknowns.row[i].parameter;
        moved_within(slopes[i], values[i], needed, (parameter.lower, parameter.upper))
    });
    let moves: Vec<f64> = moves.collect();
    let most = (0..moves.len()).max_by(|&a, &b| moves[a].total_cmp(&moves[b]))?;
    let reached = moves.iter().sum::<f64>() > needed.abs();
    reached.then(|| Unresolved { point, mode, interval, alias, name: unknowns.row[most].name.clone() })
}

/// Whether there are too few samples of an oscillation, of which something is left at the next one.
fn is_seen_too_seldom((decay, frequency): Mode, interval: f64) -> bool {
    frequency * interval * SAMPLES > TAU && (decay * interval).exp() > LEFT
}

/// The nearest other frequency with the same samples, so far apart: on the other side of the nearest multiple of half that of sampling.
fn alias(frequency: f64, interval: f64) -> f64 {
    TAU / interval * (frequency * interval / PI).round() - frequency
}

/// By how much, in logarithms, an unknown moves a frequency towards another one before it comes to its bound: `slope` is that of
/// the logarithm of the frequency over the logarithm of the unknown, `needed` has the sign of the change.
fn moved_within(slope: f64, value: f64, needed: f64, (lower, upper): (f64, f64)) -> f64 {
    let grows = slope.is_sign_positive() == needed.is_sign_positive();
    let bound = if grows == value.is_sign_positive() { upper } else { lower };
    // Not a number, where the bound has another sign.
    slope.abs() * (bound / value).ln().abs().min(REACH.ln())
}

/// By which part of itself the frequency of an oscillation grows where an unknown grows by a part of itself, for each.
fn slopes(objective: &Objective<'_>, coordinates: &[f64], point: &StateAt, mode: Mode) -> Option<Vec<f64>> {
    let frequency = |x: &[f64]| Some(nearest(&modes(objective, x, point)?, mode).1 / mode.1);
    relative_slopes(objective, (point.experiment, coordinates), &frequency)
}

/// Changes some unknowns, all by the least parts of themselves, until an oscillation has another frequency; `None` if they come to
/// their bounds, or to where they do not move it.
fn moved(
    objective: &Objective<'_>,
    coordinates: &[f64],
    (point, mode): (&StateAt, Mode),
    frequency: f64,
    moving: &[usize],
) -> Option<Vec<f64>> {
    let of = |x: &[f64], near: Mode| Some(nearest(&modes(objective, x, point)?, near));
    reached(objective, (point.experiment, coordinates), moving, (mode, LARGEST_STEP), &of, |mode| {
        (frequency / mode.1).ln()
    })
}

/// Each oscillation about a point.
fn modes(objective: &Objective<'_>, coordinates: &[f64], point: &StateAt) -> Option<Vec<Mode>> {
    Some(oscillations(&eigenvalues(objective, coordinates, point)?))
}

/// The oscillations among eigenvalues.
fn oscillations(eigenvalues: &[Complex<f64>]) -> Vec<Mode> {
    eigenvalues.iter().filter(|value| value.im > 0.0).map(|value| (value.re, value.im)).collect()
}

/// The oscillation that is nearest to one.
fn nearest(modes: &[Mode], mode: Mode) -> Mode {
    let distance = |other: &&Mode| (other.0 - mode.0).hypot(other.1 - mode.1);
    modes.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied().unwrap_or(mode)
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
    let mut steps = steps(&stamps[..stamps.len().min(STEPS + 1)]);
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

    /// An unknown of 2 that moves the frequency by half its own part grows to 6 for a higher frequency and falls to 1 for a lower one;
    /// where it moves the other way it does the other; a negative one grows away from zero. Beyond a factor of ten nothing is looked
    /// for, and neither bound of another sign nor none is nearer.
    #[test]
    fn unknowns_move_up_to_their_bounds() {
        let moved = |slope: f64, value: f64, needed: f64, bounds| moved_within(slope, value, needed, bounds).exp();
        let found = [
            moved(0.5, 2.0, 0.1, (1.0, 6.0)).powi(2),
            moved(0.5, 2.0, -0.1, (1.0, 6.0)).powi(2),
            moved(-0.5, 2.0, 0.1, (1.0, 6.0)).powi(2),
            moved(-0.5, 2.0, -0.1, (1.0, 6.0)).powi(2),
            moved(1.0, -2.0, 0.1, (-6.0, -1.0)),
            moved(1.0, -2.0, -0.1, (-6.0, -1.0)),
            moved(1.0, 2.0, -0.1, (-3.0, 6.0)),
            moved(1.0, 2.0, 0.1, (1.0, f64::INFINITY)),
            moved(1.0, 2.0, 0.1, (1.0, 30.0)),
        ];
        let expected = [3.0, 2.0, 2.0, 3.0, 3.0, 2.0, 10.0, 10.0, 10.0];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found / expected - 1.0f64).abs() < 1e-14, "{found} {expected}");
        }
    }

    /// Of ten samples a second an oscillation of more than 4 cycles a second has fewer than two and a half; a tenth is left of it
    /// after a sample where it decays at ten times `ln 10`.
    #[test]
    fn what_is_seen_too_seldom() {
        let decay = -10.0 * 10f64.ln();
        let seldom = |part: f64, cycles: f64| is_seen_too_seldom((part * decay, TAU * cycles), 0.1);
        assert_eq!(
            [seldom(0.0, 4.1), seldom(0.0, 3.9), seldom(0.99, 4.1), seldom(1.01, 4.1), seldom(1.01, 3.9)],
            [true, false, true, false, false]
        );
    }

    /// Of 100 samples a second, in cycles per second: half of that is 50, and 100 a whole cycle a sample.
    #[test]
    fn frequencies_with_the_same_samples() {
        for (frequency, other) in [(40.0, 60.0), (60.0, 40.0), (90.0, 110.0), (130.0, 170.0)] {
            let found = alias(TAU * frequency, 0.01) / TAU;
            assert!((found / other - 1.0f64).abs() < 1e-12, "{frequency}: {found}");
        }
    }

    #[test]
    fn the_nearest_oscillation() {
        let modes = [(-1.0, 5.0), (-3.0, 8.0), (-20.0, 7.0)];
        assert_eq!(
            [nearest(&modes, (-3.0, 7.0)).1, nearest(&modes, (-1.0, 6.0)).1, nearest(&[], (-1.0, 6.0)).1],
            [8.0, 5.0, 6.0]
        );
        // Of decays of the other sign the nearest is that of the smaller difference, not of the smaller sum.
        assert_eq!(nearest(&[(-4.0, 5.0), (4.0, 6.0)], (-4.0, 5.5)).1, 5.0);
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
