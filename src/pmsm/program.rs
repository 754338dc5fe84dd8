//! Motion programs: what the speed of an axis is asked to be, sample by sample.

use super::MotorError;
use super::control::Target;
use super::robot::RobotAxis;
use core::f64::consts::PI;
use core::ops::Range;

/// Time (s) over which a reference is smoothed, to a whole number of samples.
const SMOOTHING: f64 = 0.02;

/// A speed reference with its operating cycles.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Sample time (s).
    pub ts: f64,
    /// Speed and acceleration asked for, one per sample.
    pub targets: Vec<Target>,
    /// The operating cycles that the record is to be cut into.
    pub cycles: Vec<Cycle>,
}

/// One operating cycle of a [`Program`].
#[derive(Clone, Debug, PartialEq)]
pub struct Cycle {
    /// Its samples.
    pub samples: Range<usize>,
    /// Largest speed asked for (rad/s).
    pub speed: f64,
}

/// Puts speeds together, then smooths them.
#[derive(Clone, Debug)]
struct Composer {
    ts: f64,
    speeds: Vec<f64>,
    cycles: Vec<Cycle>,
}

impl Composer {
    fn new(axis: &RobotAxis) -> Result<Self, MotorError> {
        let ts = MotorError::positive("sample time", axis.ts, "s")?;
        Ok(Composer { ts, speeds: Vec::new(), cycles: Vec::new() })
    }

    fn rest(&mut self, seconds: f64) -> &mut Self {
        self.speeds.resize(self.speeds.len() + (seconds / self.ts) as usize, 0.0);
        self
    }

    /// Up to `v` (rad/s) at `a` (rad/s^2), `cruise` seconds there, and down again.
    fn trap(&mut self, v: f64, a: f64, cruise: f64) -> &mut Self {
        let ramp = ((v.abs() / a / self.ts) as usize).max(4);
        self.speeds.extend((0..ramp).map(|k| v * k as f64 / ramp as f64));
        self.speeds.resize(self.speeds.len() + (cruise / self.ts) as usize, v);
        self.speeds.extend((0..ramp).map(|k| v * (1.0 - k as f64 / ramp as f64)));
        self
    }

    fn cycle(&mut self, speed: f64, compose: impl FnOnce(&mut Self)) {
        let begin = self.speeds.len();
        compose(self);
        self.cycles.push(Cycle { samples: begin..self.speeds.len(), speed });
    }

    fn finish(self) -> Program {
        let speeds = moving_average(&self.speeds, (SMOOTHING / self.ts) as usize);
        let at = |k: usize| speeds.get(k).copied().unwrap_or(0.0);
        let targets = (0..speeds.len())
            .map(|k| {
                let before = if k == 0 { at(0) } else { at(k - 1) };
                Target { w: at(k), a: (at(k + 1) - before) / (2.0 * self.ts) }
            })
            .collect();
        Program { ts: self.ts, targets, cycles: self.cycles }
    }
}

/// Centred average over `width` samples (one more before than after, if even), zeros beyond the ends.
fn moving_average(values: &[f64], width: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for value in values {
        sum += value;
        sums.push(sum);
    }
    let upto = |k: usize| sums[k.min(values.len())];
    let (before, after) = (width / 2, width - width / 2);
    (0..values.len()).map(|k| (upto(k + after) - upto(k.saturating_sub(before))) / width as f64).collect()
}

impl Program {
    /// Experiments 3, 4 and 5: `count` back-and-forth cycles of speeds rising evenly from 15 rad/s to the axis's largest,
    /// at `share` of its largest acceleration.
    ///
    /// # Errors
    /// A share or an axis whose acceleration or sample time is not positive.
    pub fn speed_cycles(axis: &RobotAxis, count: usize, share: f64) -> Result<Program, MotorError> {
        let a = MotorError::positive("acceleration", share * axis.a_max, "rad/s^2")?;
        let mut composer = Composer::new(axis)?;
        for k in 0..count {
            let v = 15.0 + (axis.w_max - 15.0) * k as f64 / (count.max(2) - 1) as f64;
            composer.cycle(v, |c| {
                c.rest(0.15).trap(v, a, 0.4).rest(0.15).trap(-v, a, 0.4).rest(0.15);
            });
        }
        Ok(composer.finish())
    }

    /// Experiment 6, material handling: slow approach, fast transfer, slow approach, both ways.
    ///
    /// # Errors
    /// An axis whose acceleration or sample time is not positive.
    pub fn material_handling(axis: &RobotAxis, repeats: usize) -> Result<Program, MotorError> {
        let a = MotorError::positive("acceleration", axis.a_max, "rad/s^2")?;
        let v = 0.85 * axis.w_max;
        let mut composer = Composer::new(axis)?;
        for _ in 0..repeats {
            composer.cycle(v, |c| {
                for s in [1.0, -1.0] {
                    c.rest(0.2).trap(0.06 * s * v, 0.3 * a, 0.5).trap(s * v, a, 0.45);
                    c.trap(0.06 * s * v, 0.3 * a, 0.5).rest(0.2);
                }
            });
        }
        Ok(composer.finish())
    }

    /// Experiment 6, water cutting: slow contours, then short moves; the same speeds on every axis.
    ///
    /// # Errors
    /// An axis whose acceleration or sample time is not positive.
    pub fn water_cutting(axis: &RobotAxis, repeats: usize) -> Result<Program, MotorError> {
        let a = MotorError::positive("acceleration", axis.a_max, "rad/s^2")?;
        let mut composer = Composer::new(axis)?;
        for _ in 0..repeats {
            composer.cycle(85.0, |c| {
                let ts = c.ts;
                c.rest(0.3);
                c.speeds.extend((0..(4.0 / ts) as usize).map(|k| {
                    let t = k as f64 * ts;
                    let contour = 22.0 * (2.0 * PI * 0.5 * t).sin() * (2.0 * t).min(1.0);
                    contour + 8.0 * (2.0 * PI * 1.5 * t).sin()
                }));
                c.trap(25.0, 0.3 * a, 0.3).rest(0.3);
                c.trap(-85.0, 0.6 * a, 0.05).trap(40.0, 0.6 * a, 0.1).rest(0.3);
            });
        }
        Ok(composer.finish())
    }

    /// Its length (s).
    pub fn duration(&self) -> f64 {
        self.targets.len() as f64 * self.ts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_cover_the_program_and_reach_their_speed() {
        let axis = RobotAxis::reference(1).unwrap();
        let program = Program::speed_cycles(&axis, 20, 1.0).unwrap();
        assert_eq!(program.cycles.len(), 20);
        assert_eq!(program.cycles.last().unwrap().samples.end, program.targets.len());
        for cycle in &program.cycles {
            let top = program.targets[cycle.samples.clone()].iter().map(|t| t.w).fold(0.0, f64::max);
            assert!((top - cycle.speed).abs() < 1e-9, "{top} {}", cycle.speed);
        }
        // The reference returns to its first value: forward and backward motion are equal.
        let sum: f64 = program.targets.iter().map(|t| t.w * program.ts).sum();
        assert!(sum.abs() < 1e-9, "{sum}");
        // The acceleration is within the limit, but for ramps rounded down to whole samples: the shortest has 132.
        let most = program.targets.iter().map(|t| t.a.abs()).fold(0.0, f64::max);
        assert!(most <= 900.0 * (1.0 + 1.0 / 132.0), "{most}");
    }

    #[test]
    fn smoothing_keeps_the_sum() {
        let mut values = vec![0.0; 400];
        values[200] = 1.0;
        let smooth = moving_average(&values, 158);
        assert!((smooth.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(smooth.iter().filter(|v| **v > 0.0).count(), 158);
    }
}
