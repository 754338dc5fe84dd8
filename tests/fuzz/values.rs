//! Random numbers, records and declarations, sound and unsound.

use crate::random::Random;
use greybox::{Experiment, ExperimentOf, Hold, Model, Of, Parameter, Signals, Time, fixed, free, simulate};

/// Draws that a case is made of.
pub struct Draw(pub Random);

impl Draw {
    /// One of `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.0.uniform() * n as f64) as usize).min(n - 1)
    }

    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.uniform() < probability
    }

    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// A number of a usual size.
    pub fn usual(&mut self) -> f64 {
        let sign = if self.chance(0.2) { -1.0 } else { 1.0 };
        sign * 10f64.powf(2.0 * self.0.uniform() - 1.0)
    }

    /// A number of any kind.
    pub fn odd(&mut self) -> f64 {
        const ODD: [f64; 14] = [
            0.0,
            -0.0,
            5e-324,
            1e-310,
            -1e-200,
            1e-30,
            1e15,
            1e160,
            -1e300,
            f64::MAX,
            f64::EPSILON,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        self.pick(&ODD)
    }

    /// Mostly usual.
    pub fn number(&mut self, odd: f64) -> f64 {
        if self.chance(odd) { self.odd() } else { self.usual() }
    }
}

/// A column of `n` numbers.
fn column(draw: &mut Draw, n: usize) -> Vec<f64> {
    let (kind, scale, period) = (draw.below(9), draw.usual(), 2 + draw.below(40));
    let mut column: Vec<f64> = (0..n)
        .map(|k| match kind {
            0 => scale,
            1 => 0.0,
            2 | 3 => scale * (k as f64 * 6.0 / period as f64).sin(),
            4 | 5 => scale * if k / period % 2 == 0 { 1.0 } else { -1.0 },
            6 => scale * draw.0.normal(),
            7 => scale * k as f64,
            _ => scale * if k == n / 2 { 1.0 } else { 0.0 },
        })
        .collect();
    if draw.chance(0.1) {
        let factor = draw.pick(&[1e-310, 1e-160, 1e160, 1e300]);
        column.iter_mut().for_each(|value| *value *= factor);
    }
    if n > 0 && draw.chance(0.1) {
        let (at, value) = (draw.below(n), draw.odd());
        column[at] = value;
    }
    column
}

fn time(draw: &mut Draw, n: usize) -> Time {
    let step = if draw.chance(0.1) { draw.number(0.5).abs() } else { draw.pick(&[1e-3, 0.01, 0.1, 1.0]) };
    let start = if draw.chance(0.05) { draw.odd() } else { 0.0 };
    match draw.below(10) {
        0 | 1 => {
            let uneven = draw.0.uniform();
            Time::Stamps((0..n).map(|k| start + step * (k as f64 + uneven * draw.0.uniform())).collect())
        }
        2 => {
            let repeated = draw.below(n.max(1));
            Time::Stamps((0..n).map(|k| start + step * if k > repeated { k - 1 } else { k } as f64).collect())
        }
        3 => {
            let gap = draw.below(n.max(1));
            Time::Stamps((0..n).map(|k| start + step * if k > gap { k + 500 } else { k } as f64).collect())
        }
        _ => Time::Uniform { start, step },
    }
}

/// A record, of the model if it can be simulated, or of columns that are unrelated; `None` where it is refused.
pub fn record<M: Model>(draw: &mut Draw, model: &M) -> Option<ExperimentOf<M>> {
    let n = match draw.below(8) {
        0 => draw.below(6),
        1 => 6 + draw.below(30),
        2 => 500 + draw.below(1000),
        _ => 40 + draw.below(200),
    };
    let time = time(draw, n);
    let columns: Vec<Vec<f64>> = (0..M::Input::LEN).map(|_| column(draw, n)).collect();
    let inputs: Vec<Of<M::Input, f64>> = (0..n).map(|k| M::Input::from_fn(|i| columns[i][k])).collect();
    let truth = M::Parameters::from_fn(|_| draw.usual().abs());
    let initial = M::State::from_fn(|_| 0.0);
    let simulated = simulate(model, &truth, &initial, time.clone(), &inputs).ok().filter(|_| draw.chance(0.75));
    let mut outputs: Vec<Of<M::Output, f64>> = match simulated {
        Some(run) if draw.chance(0.1) => run.outputs,
        Some(run) => {
            let sigma = 10f64.powf(-4.0 * draw.0.uniform());
            run.with_noise(M::Output::from_fn(|_| sigma), draw.below(1000) as u64).outputs
        }
        None => {
            let columns: Vec<Vec<f64>> = (0..M::Output::LEN).map(|_| column(draw, n)).collect();
            (0..n).map(|k| M::Output::from_fn(|j| columns[j][k])).collect()
        }
    };
    if draw.chance(0.15) {
        let share = draw.pick(&[0.02, 0.3, 0.9, 1.0]);
        let from = if draw.chance(0.5) { 0 } else { n / 2 };
        for output in outputs.iter_mut().skip(from) {
            *output = M::Output::map(*output, |value| if draw.chance(share) { f64::NAN } else { value });
        }
    }
    if n > 0 && draw.chance(0.05) {
        let (at, value) = (draw.below(n), draw.odd());
        outputs[at] = M::Output::splat(value);
    }
    let mut record = Experiment::new(model, time, inputs, outputs).ok()?;
    if draw.chance(0.2) {
        record = record.hold(Hold::First);
    }
    match draw.below(6) {
        0 => record = record.initial_from_first_sample(),
        1 | 2 => record = record.initial(M::State::from_fn(|_| fixed(draw.number(0.05)))),
        3 => record = record.initial(M::State::from_fn(|_| parameter(draw))),
        _ => {}
    }
    Some(record)
}

/// A declaration of a parameter or initial state.
pub fn parameter(draw: &mut Draw) -> Parameter {
    let start = if draw.chance(0.8) { draw.usual().abs() } else { draw.number(0.3) };
    let is_free = draw.chance(0.85);
    let mut parameter = if is_free { free(start) } else { fixed(start) };
    if draw.chance(0.2) {
        let (a, b) = (draw.number(0.2), draw.number(0.2));
        parameter = if draw.chance(0.9) {
            parameter.within(a.min(b).min(start), a.max(b).max(start))
        } else {
            parameter.within(a, b)
        };
    }
    if draw.chance(0.15) {
        parameter = parameter.log();
    }
    // What is fixed has neither.
    let prior = draw.chance(0.1).then(|| (draw.number(0.1), draw.number(0.1).abs()));
    if let Some((mean, std)) = prior.filter(|_| is_free) {
        parameter = parameter.prior(mean, std);
    }
    if draw.chance(0.1) && is_free {
        parameter = parameter.per_experiment();
    }
    parameter
}
