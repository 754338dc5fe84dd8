//! Weights of the points of an axis at a place between them.

use super::{Extrapolation, Interpolation};

/// Weights of the points `first..first + 4`, as far as there are any.
pub(super) struct Weights {
    first: usize,
    weights: [f64; 4],
    count: usize,
}

impl Weights {
    /// The weighted sum of the points' values.
    pub fn of(&self, value: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        for (k, weight) in self.weights[..self.count].iter().enumerate() {
            if *weight != 0.0 {
                sum += weight * value(self.first + k);
            }
        }
        sum
    }
}

/// The weights at a place for the derivative of some order; the axis has at least two points, which rise.
pub(super) fn weights(axis: &[f64], at: f64, order: u8, between: Interpolation, beyond: Extrapolation) -> Weights {
    let last = axis.len() - 1;
    let interval = axis.partition_point(|point| *point <= at).saturating_sub(1).min(last - 1);
    let end = if at < axis[0] { axis[0] } else { axis[last] };
    if at >= axis[0] && at <= axis[last] {
        return inside(axis, interval, at, order, between);
    }
    match (beyond, order) {
        (Extrapolation::Hold, 0) => inside(axis, interval, end, 0, between),
        (Extrapolation::Linear, 0) => {
            let mut line = inside(axis, interval, end, 0, between);
            let slope = inside(axis, interval, end, 1, between);
            for (weight, slope) in line.weights.iter_mut().zip(slope.weights) {
                *weight += (at - end) * slope;
            }
            line
        }
        (Extrapolation::Linear, 1) => inside(axis, interval, end, 1, between),
        _ => Weights { first: 0, weights: [0.0; 4], count: 0 },
    }
}

fn inside(axis: &[f64], i: usize, at: f64, order: u8, between: Interpolation) -> Weights {
    let h = axis[i + 1] - axis[i];
    let s = (at - axis[i]) / h;
    match between {
        Interpolation::Linear => {
            let (low, high) = match order {
                0 => (1.0 - s, s),
                1 => (-1.0 / h, 1.0 / h),
                _ => (0.0, 0.0),
            };
            Weights { first: i, weights: [low, high, 0.0, 0.0], count: 2 }
        }
        Interpolation::Smooth => smooth(axis, i, h, s, order),
    }
}

/// Hermite's cubic between two points, with the slopes of parabolas.
fn smooth(axis: &[f64], i: usize, h: f64, s: f64, order: u8) -> Weights {
    // Values at both ends, then slopes times the interval.
    let [v0, v1, m0, m1] = match order {
        0 => {
            let (r, ss) = (1.0 - s, s * s);
            [r * r * (1.0 + 2.0 * s), ss * (3.0 - 2.0 * s), s * r * r, ss * (s - 1.0)]
        }
        1 => [6.0 * s * (s - 1.0), 6.0 * s * (1.0 - s), (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)],
        2 => [12.0 * s - 6.0, 6.0 - 12.0 * s, 6.0 * s - 4.0, 6.0 * s - 2.0],
        3 => [12.0, -12.0, 6.0, 6.0],
        _ => [0.0; 4],
    };
    // From the point before the interval to the point after it; weight `k` belongs to point `i + k - 1`.
    let mut weights = [0.0, v0, v1, 0.0];
    for (point, slope) in [(i, m0 * h), (i + 1, m1 * h)] {
        for (at, weight) in slope_at(axis, point) {
            weights[at + 1 - i] += slope * weight;
        }
    }
    // An axis of few points has no neighbors there.
    let scale = match order {
        0 => 1.0,
        1 => 1.0 / h,
        2 => 1.0 / (h * h),
        _ => 1.0 / (h * h * h),
    };
    let weights = weights.map(|weight| weight * scale);
    let count = 4.min(axis.len() + 1 - i);
    match i {
        0 => Weights { first: 0, weights: [weights[1], weights[2], weights[3], 0.0], count: count - 1 },
        _ => Weights { first: i - 1, weights, count },
    }
}

/// The slope at a point, of the parabola through it and its neighbors, as weights of points.
fn slope_at(axis: &[f64], point: usize) -> [(usize, f64); 3] {
    let last = axis.len() - 1;
    if last == 1 {
        let slope = 1.0 / (axis[1] - axis[0]);
        return [(0, -slope), (1, slope), (1, 0.0)];
    }
    let middle = point.clamp(1, last - 1);
    let (a, b) = (axis[middle] - axis[middle - 1], axis[middle + 1] - axis[middle]);
    // Weights of the differences below and above the middle.
    let (below, above) = match point {
        _ if point < middle => ((2.0 * a + b) / (a + b), -a / (a + b)),
        _ if point > middle => (-b / (a + b), (a + 2.0 * b) / (a + b)),
        _ => (b / (a + b), a / (a + b)),
    };
    [(middle - 1, -below / a), (middle, below / a - above / b), (middle + 1, above / b)]
}
