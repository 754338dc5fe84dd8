//! Steps between bounds.

use super::reduce::Terms;
use super::{Elimination, entry};

/// How often unknowns are released from their limits; a few times suffice.
const RELEASES: usize = 20;
/// How often the step projected on the limits is halved; after that it ends where the first unknown reaches a limit.
const HALVINGS: usize = 10;
/// An unknown is kept on a limit where the cosine between the residual and its column is below.
const NEGLIGIBLE: f64 = 1e-12;

impl Elimination {
    /// As [`step`](Self::step), within limits for each unknown's step (a lower one of at most zero, an upper one of at least
    /// zero): the minimizer among all steps that the limits allow.
    ///
    /// Projected Newton steps (Bertsekas, SIAM J. Control Optim. 20 (1982) 221). The line to the unlimited minimizer is
    /// projected on the limits: an unknown that would exceed its limit stays on it. Of this path the whole, a half, a quarter
    /// and so on are tried, and the first is taken that lowers the damped sum of squares further than the straight line up
    /// to the first limit. Unknowns on a limit are then kept there and the others minimized again. Once no unknown exceeds
    /// its limits, those on a limit whose slope falls inward are released. The number of stages hardly grows with the number
    /// of pieces.
    pub fn step_within(&self, damping: &[f64], held: &[bool], limits: &[(f64, f64)]) -> Option<Vec<f64>> {
        let n = self.unknowns();
        let step = self.step(damping, held)?;
        let free = |i: usize| !held.get(i).copied().unwrap_or(false);
        if limits.iter().zip(&step).enumerate().all(|(i, ((down, up), step))| !free(i) || (down..=up).contains(&step)) {
            return Some(step);
        }
        let mut stage = Stage {
            held: (0..n).map(|i| !free(i)).collect(),
            put: vec![0.0; n],
            on_end: vec![None; n],
            at: vec![0.0; n],
            step,
        };
        let mut releases = 0;
        loop {
            let leaving = stage.leaving(limits);
            if let Some(first) = leaving.iter().map(|leaving| leaving.part).min_by(f64::total_cmp) {
                let part = self.part(&stage, first, &leaving, damping);
                stage.advance(part, &leaving);
            } else {
                std::mem::swap(&mut stage.at, &mut stage.step);
                releases += 1;
                if releases > RELEASES || !stage.release(&self.slopes(&stage.at, damping)) {
                    return Some(stage.at);
                }
            }
            stage.step = self.solve(Terms { damping, held: &stage.held, origin: &stage.put })?;
            stage.step.iter_mut().zip(&stage.put).for_each(|(step, put)| *step += put);
        }
    }

    /// The part of the path to take.
    fn part(&self, stage: &Stage, first: f64, leaving: &[Leaving], damping: &[f64]) -> f64 {
        let gain = |part: f64| {
            let step = stage.along(part, leaving);
            let damped: f64 = step.iter().enumerate().map(|(i, d)| (entry(damping, i) * d).powi(2)).sum();
            self.predicted_reduction(&step) - 0.5 * damped
        };
        let straight = gain(first);
        let parts = std::iter::successors(Some(1.0), |part| Some(part * 0.5)).take(HALVINGS);
        parts.take_while(|part| *part > first).find(|part| gain(*part) > straight).unwrap_or(first)
    }

    /// Slopes of half the damped sum of squares after a step; zero where no more than rounding.
    fn slopes(&self, step: &[f64], damping: &[f64]) -> Vec<f64> {
        let mut slopes: Vec<f64> = step.iter().enumerate().map(|(i, d)| entry(damping, i).powi(2) * d).collect();
        let mut squares = 0.0;
        for (triangle, columns) in self.columns() {
            for i in 0..columns.len() {
                let (y, row) = triangle.row(i);
                let change: f64 = row.iter().zip(&columns[i..]).map(|(r, &unknown)| r * step[unknown]).sum();
                row.iter().zip(&columns[i..]).for_each(|(r, &unknown)| slopes[unknown] += r * (change - y));
                squares += (change - y) * (change - y);
            }
            squares += triangle.residual();
        }
        let negligible = NEGLIGIBLE * squares.sqrt();
        for ((slope, norm), i) in slopes.iter_mut().zip(&self.norms).zip(0..) {
            if slope.abs() <= negligible * norm.hypot(entry(damping, i)) {
                *slope = 0.0;
            }
        }
        slopes
    }
}

/// How far the search for a step within bounds has come.
struct Stage {
    held: Vec<bool>,
    /// Where unknowns were put on a limit.
    put: Vec<f64>,
    /// On which limit: -1 for the lower one, 1 for the upper one.
    on_end: Vec<Option<f64>>,
    /// The point reached, and the minimizer that is to be reached from it.
    at: Vec<f64>,
    step: Vec<f64>,
}

/// A free unknown that exceeds a limit on the path.
struct Leaving {
    unknown: usize,
    /// At which part of the path.
    part: f64,
    end: f64,
    side: f64,
}

impl Stage {
    fn leaving(&self, limits: &[(f64, f64)]) -> Vec<Leaving> {
        let leaving = |(unknown, &(down, up)): (usize, &(f64, f64))| {
            let (at, step) = (*self.at.get(unknown)?, self.step[unknown]);
            let (end, side) = match step {
                _ if self.held[unknown] => return None,
                step if step < down => (down, -1.0),
                step if step > up => (up, 1.0),
                _ => return None,
            };
            Some(Leaving { unknown, part: ((end - at) / (step - at)).clamp(0.0, 1.0), end, side })
        };
        limits.iter().enumerate().filter_map(leaving).collect()
    }

    /// The point after this part of the path; unknowns that have exceeded a limit by then are on it.
    fn along(&self, part: f64, leaving: &[Leaving]) -> Vec<f64> {
        let mut point: Vec<f64> = self.at.iter().zip(&self.step).map(|(at, step)| at + part * (step - at)).collect();
        leaving.iter().filter(|leaving| leaving.part <= part).for_each(|leaving| point[leaving.unknown] = leaving.end);
        point
    }

    /// Moves by this part of the path.
    fn advance(&mut self, part: f64, leaving: &[Leaving]) {
        self.at = self.along(part, leaving);
        for &Leaving { unknown, end, side, .. } in leaving.iter().filter(|leaving| leaving.part <= part) {
            (self.put[unknown], self.held[unknown], self.on_end[unknown]) = (end, true, Some(side));
        }
    }

    /// Releases the unknowns whose slopes fall inward; whether there were any.
    fn release(&mut self, slopes: &[f64]) -> bool {
        let mut any = false;
        for (unknown, side) in self.on_end.iter_mut().enumerate() {
            if side.is_some_and(|side| slopes[unknown] * side > 0.0) {
                (self.put[unknown], self.held[unknown], *side) = (0.0, false, None);
                any = true;
            }
        }
        any
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the way to a minimizer of which two entries exceed their limits: the first one does so on this half.
    #[test]
    fn a_path_ends_on_its_limits() {
        let mut stage = Stage {
            held: vec![false; 3],
            put: vec![0.0; 3],
            on_end: vec![None; 3],
            at: vec![1.0, 2.0, 3.0],
            step: vec![5.0, -6.0, 3.0],
        };
        let leaving = stage.leaving(&[(0.0, 2.0), (-4.0, 9.0), (0.0, 4.0)]);
        let found: Vec<_> = leaving.iter().map(|one| (one.unknown, one.part, one.end, one.side)).collect();
        assert_eq!(found, [(0, 0.25, 2.0, 1.0), (1, 0.75, -4.0, -1.0)]);
        assert_eq!(stage.along(0.5, &leaving), [2.0, -2.0, 3.0]);
        stage.advance(0.5, &leaving);
        assert_eq!((&stage.at[..], &stage.held[..]), (&[2.0, -2.0, 3.0][..], &[true, false, false][..]));
        assert_eq!((stage.put[0], &stage.on_end[..]), (2.0, &[Some(1.0), None, None][..]));
        // A slope that falls inward from an upper limit is positive.
        assert!(!stage.release(&[-1.0, 5.0, 5.0]) && stage.held[0]);
        assert!(stage.release(&[1.0, 0.0, 0.0]) && !stage.held[0]);
    }
}
