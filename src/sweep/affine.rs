//! Whether equations that are not read as a graph are affine in the state: tested by their values.

use crate::functions::{Functions, LONG};
use crate::layout::{Kind, Layout};
use crate::record::Record;

/// Samples at whose time and inputs they are tested.
const SAMPLES: usize = 5;
/// Sizes of the states, relative to the largest measurement: the unit of a state may be another.
const SCALES: [f64; 3] = [1e-3, 1.0, 1e3];
/// `f(a + b) + f(0)` and `f(a) + f(b)` of an affine function differ by some roundings of their terms.
const ROUNDING: f64 = 1e-9;

/// The first of derivatives (next states), outputs and states after a sample that is not affine, by its number among them; `None` if all are, or are undefined at
/// the origin.
pub(super) fn not_affine(layout: &Layout, functions: &dyn Functions<f64>, record: &Record, p: &[f64]) -> Option<usize> {
    let n = layout.states.len();
    let all = record.outputs().iter().flat_map(|channel| channel.values.iter());
    let largest = all.filter(|y| y.is_finite()).fold(0.0, |largest: f64, y| largest.max(y.abs()));
    let size = if largest > 0.0 { largest } else { 1.0 };
    // Slopes of functions that are affine are found from their values at the last of these.
    let sizes = SCALES.map(|scale| scale * size).into_iter().chain([LONG]);
    let samples = (0..SAMPLES).map(|i| i * (record.len() - 1) / (SAMPLES - 1));
    let cases = samples.flat_map(|k| sizes.clone().flat_map(move |size| (0..n).map(move |i| (k, size, i))));
    cases
        .filter_map(|(k, size, i)| {
            let values = |x: &[f64]| {
                let (t, u) = (record.time(k), record.input(k));
                let (mut state, mut output) = (vec![0.0; n], vec![0.0; layout.outputs.len()]);
                if layout.kind != Kind::Static {
                    functions.state(t, x, &u, p, &mut state);
                }
                functions.output(t, x, &u, p, &mut output);
                let mut after = x.to_vec();
                if layout.kind == Kind::Continuous {
                    functions.jump(t, x, &u, p, &mut after);
                }
                [state, output, after].concat()
            };
            // All states, of both signs and different sizes; with the one at hand moved in addition, products of two states show.
            let b: Vec<f64> = (0..n).map(|j| size * [1.0, -0.7, 0.4][j % 3]).collect();
            let (mut a, mut sum) = (vec![0.0; n], b.clone());
            a[i] = size;
            sum[i] += size;
            let [origin, a, b, sum] = [&vec![0.0; n], &a, &b, &sum].map(|x| values(x));
            (0..origin.len()).find(|&e| {
                let terms = [sum[e], origin[e], a[e], b[e]];
                let rounding = ROUNDING * terms.iter().map(|term| term.abs()).sum::<f64>();
                let equal = (terms[0] + terms[1] - terms[2] - terms[3]).abs() <= rounding;
                origin[e].is_finite() && !equal
            })
        })
        .min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Quantity;
    use crate::record::{Channel, Time};

    struct Written {
        state: fn([f64; 2]) -> [f64; 2],
        output: fn([f64; 2]) -> f64,
    }

    impl Functions<f64> for Written {
        fn state(&self, _t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
            let [a, b] = (self.state)([x[0], x[1]]);
            to.copy_from_slice(&[a + u[0], b * p[0]]);
        }
        fn output(&self, _t: f64, x: &[f64], _u: &[f64], _p: &[f64], to: &mut [f64]) {
            to[0] = (self.output)([x[0], x[1]]);
        }
        fn diffusion(&self, _t: f64, _x: &[f64], _u: &[f64], _p: &[f64], _to: &mut [f64]) {}
        fn noise(&self, _t: f64, _x: &[f64], _u: &[f64], _p: &[f64], _to: &mut [f64]) {}
        fn initial_noise(&self, _p: &[f64], _to: &mut [f64]) {}
        fn initial(&self, _u: &[f64], _p: &[f64], _to: &mut [f64]) {}
        fn delay(&self, _p: &[f64], _to: &mut [f64]) {}
        fn jumps(&self) -> bool {
            false
        }
        fn jump(&self, _t: f64, _x: &[f64], _u: &[f64], _p: &[f64], _to: &mut [f64]) {}
    }

    /// The first equation that is not affine where measurements are 2 V.
    fn found(state: fn([f64; 2]) -> [f64; 2], output: fn([f64; 2]) -> f64) -> Option<usize> {
        let named = |name: &str| Quantity { name: name.to_owned(), unit: "V".to_owned() };
        let layout = Layout {
            kind: Kind::Continuous,
            states: vec![named("x"), named("z")],
            inputs: vec![named("u")],
            outputs: vec![named("y")],
            parameters: vec![named("a")],
        };
        let channel = |name: &str, value: f64| Channel::new(name, "V", vec![value; 9]);
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record =
            Record::new(layout.states.clone(), time, vec![channel("u", 3.0)], vec![channel("y", 2.0)]).unwrap();
        not_affine(&layout, &Written { state, output }, &record, &[0.3])
    }

    #[test]
    fn equations_are_tested_by_their_values() {
        let line = |[x, z]: [f64; 2]| [0.1 * x - 7.0 * z + 5.0, x];
        let sum = |[x, z]: [f64; 2]| x / 3.0 - z + 0.1;
        assert_eq!(found(line, sum), None);
        assert_eq!(found(|[x, z]| [x, x * z], sum), Some(1));
        assert_eq!(found(|[x, z]| [z.sin(), x], sum), Some(0));
        assert_eq!(found(line, |[x, _]| x.powi(2)), Some(2));
        // A limit within a thousand times the measurements, the root of what is negative, and what is undefined at the origin.
        assert_eq!(found(line, |[_, z]| z.min(900.0)), Some(2));
        assert_eq!(found(line, |[_, z]| z.sqrt()), Some(2));
        assert_eq!(found(line, |[_, z]| z.recip()), None);
    }
}
