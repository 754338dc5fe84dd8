//! [`Descent`]: one way down from a start, by damped steps of limited length.

use super::point::Point;
use crate::information::norm;
use crate::scaling::Seen;
use serde::{Deserialize, Serialize};

/// How long steps may be, in sizes of the unknowns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Reach {
    #[serde(with = "crate::real")]
    pub first: f64,
    #[serde(with = "crate::real")]
    pub later: f64,
}

/// The longest step of the next trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Longest {
    First,
    Later,
    /// In the metric of the damping.
    Length(#[serde(with = "crate::real")] f64),
}

/// The memory of a descent: damping, length of the next step, and what the last trials were like.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Descent {
    reach: Reach,
    #[serde(with = "crate::real")]
    lambda: f64,
    /// The part to which `lambda` falls after the next good step.
    #[serde(with = "crate::real")]
    fall: f64,
    longest: Longest,
    /// Trials in a row that were rejected where the cost resolves nothing.
    undecided: u32,
    /// Trials since the cost last resolved one.
    unresolved: u32,
    /// Trials in a row that could not be evaluated.
    pub failed: u64,
    /// How far, as a part of the cost, the last rejected trials were off the predicted decrease.
    #[serde(with = "crate::real")]
    pub noise: f64,
    /// Rejected trials in a row whose gain was no nearer to the predicted one than that of the longer trials before, and the
    /// difference of the last one.
    #[serde(with = "crate::real")]
    rough: (u32, f64),
    /// Trials so far.
    pub trials: u64,
    /// The trial at which the search last made progress, with cost and predicted decrease at that point.
    #[serde(with = "crate::real")]
    mark: (u64, f64, f64),
    /// Accepted steps in a row that lowered the cost by less than a tenth.
    slow: u32,
}

/// A step to be tried.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub x: Vec<f64>,
    pub step: Vec<f64>,
    /// The diagonal by which it was damped, and its length in the metric of the scales.
    pub damping: Vec<f64>,
    pub length: f64,
    predicted: f64,
    resolved: bool,
}

const FALL: f64 = 0.1;
/// The part to which `lambda` falls after a first step that was good: a tenth would hold back the second one.
const FIRST_FALL: f64 = 0.03;
/// A step that gains so much of the predicted decrease is a good one.
const GOOD: f64 = 0.9;
const ACCEPT: f64 = 1e-4;
/// The next step after one that was rejected.
const SHORTER: f64 = 0.25;
/// Five trials are enough where the differences of cost, or the slopes, are rounding.
const UNDECIDED: u32 = 5;
/// The number of trials where the slopes still predict a decrease: enough for ten digits if each step halves the distance.
const UNRESOLVED: u32 = 60;
/// Where the cost is smooth, the relative error of the predicted decrease falls to a quarter with a step of a quarter of the
/// length. The cost is called rough when that error stays above this part of the one before, so many times in a row.
const SMOOTH: f64 = 0.7;
const ROUGH: u32 = 8;
const COST_ROUNDING: f64 = 1e-10;
/// The search is called creeping when so many trials together neither lower the cost by this part
const CREEPING: u64 = 300;
const CREEPING_FALL: f64 = 0.01;
/// nor leave the next full step no more than this part of what it would have gained before.
const CREEPING_GAIN: f64 = 0.1;
/// Second derivatives are worth their evaluation after so many steps that each lower the cost by less than this part.
const SLOW: (u32, f64) = (20, 0.1);

impl Descent {
    pub fn new(reach: Reach) -> Self {
        Descent {
            reach,
            lambda: 0.0,
            fall: FIRST_FALL,
            longest: Longest::First,
            undecided: 0,
            unresolved: 0,
            failed: 0,
            noise: 0.0,
            rough: (0, f64::MAX),
            trials: 0,
            mark: (0, f64::MAX, f64::MAX),
            slow: 0,
        }
    }

    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// The next step to try; `None` if no step leads away from here.
    pub fn propose(&mut self, point: &Point, scales: &[f64], seen: &Seen) -> Option<Trial> {
        let sizes: Vec<f64> = (0..point.x.len()).map(|i| seen.size(i)).collect();
        let size = length(scales, &sizes);
        let longest = match self.longest {
            Longest::Length(longest) => longest,
            _ if size == 0.0 => f64::INFINITY,
            Longest::First => self.reach.first * size,
            Longest::Later => self.reach.later * size,
        };
        let (lambda, step) = limited(point, scales, self.lambda, longest)?;
        self.lambda = lambda;
        let (x, predicted) = (point.towards(&step), point.linear.predicted_reduction(&step));
        let resolved = predicted > point.resolution();
        let damping = damping(scales, lambda);
        let length = length(scales, &step);
        let most = if point.is_flat() { UNDECIDED } else { UNRESOLVED };
        let spent = self.is_rough() || self.undecided >= UNDECIDED || self.unresolved >= most && !resolved;
        (x != point.x && !spent).then_some(Trial { x, step, damping, length, predicted, resolved })
    }

    /// Whether slopes are not those of the cost: however short the steps, they do not gain what slopes predict.
    pub fn is_rough(&self) -> bool {
        self.rough.0 >= ROUGH
    }

    /// Whether the second derivative along a step is worth an evaluation: in a curved valley, where steps are good and short.
    pub fn is_slow(&self, trial: &Trial) -> bool {
        self.slow >= SLOW.0 && trial.resolved
    }

    /// Whether the trials get nowhere.
    pub fn creeps(&mut self, point: &Point) -> bool {
        let (_, cost, potential) = self.mark;
        if point.cost() < cost - CREEPING_FALL * point.cost_size() || point.potential < CREEPING_GAIN * potential {
            self.mark = (self.trials, point.cost(), point.potential);
        }
        self.trials - self.mark.0 > CREEPING
    }

    /// Whether to go to the point that a trial led to (`None` if it has no cost); adapts damping and length of the next step.
    pub fn judge(&mut self, point: &Point, trial: &Trial, next: Option<&Point>) -> bool {
        self.trials += 1;
        self.unresolved = if trial.resolved { 0 } else { self.unresolved + 1 };
        let cost = point.cost();
        let gain = match next {
            None => f64::NEG_INFINITY,
            Some(next) if trial.resolved => (cost - next.cost()) / trial.predicted,
            Some(next) => self.gain_by_slope(point, trial, next),
        };
        if gain <= ACCEPT {
            self.reject(trial, gain, point.cost_size(), next.is_none());
            return false;
        }
        let next_cost = next.map_or(cost, Point::cost);
        self.slow = if trial.resolved && cost - next_cost < SLOW.1 * point.cost_size() { self.slow + 1 } else { 0 };
        (self.undecided, self.failed, self.noise, self.longest) = (0, 0, 0.0, Longest::Later);
        if trial.resolved {
            self.rough = (0, f64::MAX);
        }
        if gain > GOOD {
            // Ten times faster with each good step, so that a good start is not held up by the damping.
            self.lambda *= self.fall;
            self.fall *= FALL;
        } else {
            // Nielsen (1999): smooth between no change at half the predicted gain and a tenth at the full one.
            self.lambda *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(FALL, 2.0);
            self.fall = FALL;
        }
        true
    }

    fn reject(&mut self, trial: &Trial, gain: f64, cost: f64, failed: bool) {
        self.undecided += u32::from(!trial.resolved);
        self.failed = if failed { self.failed + 1 } else { 0 };
        if trial.resolved && !failed {
            // Of a smooth cost this falls with the length of the step; what stays is noise.
            self.noise = ((1.0 - gain).abs() * trial.predicted / cost).max(0.125 * self.noise);
            let falls = 1.0 - gain < SMOOTH * self.rough.1;
            self.rough = (if falls { 0 } else { self.rough.0 + 1 }, 1.0 - gain);
        }
        self.longest = Longest::Length(SHORTER * trial.length);
        self.fall = FALL;
    }

    /// The gain of a step whose change of cost is rounding, by the slopes along it: in the metric of the damped step the
    /// gradient of a convergent iteration shrinks at every step.
    fn gain_by_slope(&self, point: &Point, trial: &Trial, next: &Point) -> f64 {
        let again = next.linear.step_within(&trial.damping, &next.held, &next.limits);
        let part = again.map_or(f64::INFINITY, |again| next.slope(&again) / point.slope(&trial.step));
        match part {
            _ if next.cost() > point.cost() + COST_ROUNDING * point.cost_size() => 0.0,
            part if part < 0.25 => 1.0,
            part if part < 1.0 => GOOD,
            _ => 0.0,
        }
    }
}

/// `|diag(scales) step|`.
pub(super) fn length(scales: &[f64], step: &[f64]) -> f64 {
    norm(scales.iter().zip(step).map(|(scale, step)| scale * step))
}

fn damping(scales: &[f64], lambda: f64) -> Vec<f64> {
    scales.iter().map(|scale| lambda.sqrt() * scale).collect()
}

/// The step with the least damping, `lambda` at least, that is no longer than this (to a tenth), and that damping.
fn limited(point: &Point, scales: &[f64], lambda: f64, longest: f64) -> Option<(f64, Vec<f64>)> {
    const NEAR: f64 = 0.1;
    const TRIALS: u32 = 20;
    let at = |lambda: f64| {
        let step = point.linear.step_within(&damping(scales, lambda), &point.held, &point.limits)?;
        Some((length(scales, &step), step))
    };
    let first = at(lambda);
    if let Some((length, step)) = first.as_ref().filter(|(length, _)| *length <= (1.0 + NEAR) * longest) {
        return length.is_finite().then(|| (lambda, step.clone()));
    }
    // The length falls with the damping, and is at most |gradient / scales| / lambda.
    let free = (0..scales.len()).filter(|&i| !point.held[i]);
    let steepest = norm(free.map(|i| point.gradient[i] / scales[i]));
    let (mut low, mut high) = (lambda, steepest / longest);
    // Its inverse is nearly linear in the damping (Hebden 1973; More 1978): the secant of the last two.
    let mut last = first.map(|(length, _)| (lambda, 1.0 / length));
    let (mut lambda, mut best) = ((low * high).sqrt().max(1e-3 * high), None);
    for _ in 0..TRIALS {
        let Some((length, step)) = at(lambda) else {
            (low, lambda) = (lambda, (10.0 * lambda).min(high));
            continue;
        };
        best = Some((lambda, step));
        if (length - longest).abs() <= NEAR * longest || high <= low {
            break;
        }
        if length > longest {
            low = low.max(lambda)
        } else {
            high = high.min(lambda)
        }
        let inverse = 1.0 / length;
        let secant = last
            .filter(|(_, other)| *other != inverse)
            .map(|(other, its)| lambda + (1.0 / longest - inverse) * (lambda - other) / (inverse - its));
        last = Some((lambda, inverse));
        let middle = if low > 0.0 { (low * high).sqrt() } else { 0.01 * high };
        lambda = secant.filter(|secant| low < *secant && *secant < high).unwrap_or(middle);
    }
    best
}

#[cfg(test)]
mod tests;
