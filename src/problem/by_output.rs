//! [`ByOutput`]: the triangles of each output's rows at a point, from which those with other noise levels follow without a pass.

use crate::information::Information;

/// The triangles of each output at a point.
#[derive(Debug)]
pub(crate) struct ByOutput {
    pub point: Vec<f64>,
    /// The noise levels by which the rows were divided.
    pub sigma: Vec<f64>,
    /// Of each experiment, output by output.
    triangles: Vec<Vec<Information>>,
    /// Sum of squares of each output, over all experiments.
    squares: Vec<f64>,
}

impl ByOutput {
    pub fn new(point: &[f64], sigma: Vec<f64>, triangles: Vec<Vec<Information>>) -> Self {
        let of = |j: usize| triangles.iter().map(|own| own[j].residual_at_zero()).sum();
        let squares = (0..sigma.len()).map(of).collect();
        ByOutput { point: point.to_vec(), sigma, triangles, squares }
    }

    /// Whether no output's sum of squares is zero, as which a triangle counts those below some 1e-280.
    pub fn is_resolved(&self) -> bool {
        self.squares.iter().all(|squares| *squares > 0.0)
    }

    /// The mean square error of each output, in its unit.
    pub fn variances(&self) -> Vec<f64> {
        let rows = |j: usize| self.triangles.iter().map(|own| own[j].rows()).sum::<u64>().max(1);
        let of = |(j, (sigma, squares)): (usize, (&f64, &f64))| sigma * sigma * squares / rows(j) as f64;
        self.sigma.iter().zip(&self.squares).enumerate().map(of).collect()
    }

    /// The cost with these noise levels, priors left out.
    pub fn cost(&self, sigma: &[f64]) -> f64 {
        let half = |(squares, factor): (&f64, f64)| 0.5 * factor * factor * squares;
        self.squares.iter().zip(self.factors(sigma)).map(half).sum()
    }

    /// The triangle of all outputs of each experiment, with these noise levels.
    pub fn blocks(&self, sigma: &[f64]) -> Vec<Information> {
        let joined = |own: &Vec<Information>| {
            let mut all = own.iter().zip(self.factors(sigma)).map(|(triangle, factor)| triangle.times(factor));
            let first = all.next();
            let merged = |mut whole: Information, next: Information| {
                whole.merge(&next);
                whole
            };
            all.fold(first.unwrap_or_else(|| Information::new(0)), merged)
        };
        self.triangles.iter().map(joined).collect()
    }

    fn factors<'s>(&'s self, sigma: &'s [f64]) -> impl Iterator<Item = f64> {
        self.sigma.iter().zip(sigma).map(|(own, other)| own / other)
    }
}

#[cfg(test)]
mod tests {
    use crate::optimize::{LeastSquares, Linearization};
    use crate::pmsm::{Surface, Winding};
    use crate::problem::{Control, Whitening, noise};
    use crate::{Experiment, ExperimentOf, Fit, Kind, Model, Nothing, Scalar, Time, free, signals};

    signals! { struct Input { u: "V" } }
    signals! { struct Outputs { y: "V", z: "V" } }
    signals! { struct Parameters { a: "1", b: "1", c: "1" } }

    /// Two outputs, one of which has a root of a parameter.
    #[derive(Clone)]
    struct Root;

    impl Model for Root {
        type State = Nothing;
        type Input = Input;
        type Output = Outputs;
        type Parameters = Parameters;
        const KIND: Kind = Kind::Static;

        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Input<S>, p: &Parameters<S>) -> Outputs<S> {
            Outputs { y: p.a.sqrt() + p.b * u.u, z: p.c * u.u }
        }
    }

    /// On its bound, where its slope is infinite, a parameter has no column; those of both outputs do. `z = u` and `c = 2`, so that the slope
    /// of the cost along `c` is the sum of `u^2`, divided by the variance.
    #[test]
    fn a_slope_that_is_infinite_leaves_all_outputs() {
        let inputs: Vec<Input> = (1..21).map(|k| Input { u: f64::from(k) }).collect();
        let outputs = (1..21).map(|k| Outputs { y: f64::from(k) + 3.0, z: f64::from(k) }).collect();
        let record = Experiment::new(&Root, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let start = Parameters { a: free(0.0).within(0.0, 10.0), b: free(0.5), c: free(2.0) };
        let problem = Fit::new(&Root, &record).parameters(start).problem().unwrap();
        let objective = problem.objective().unwrap();
        let linear = objective.linearize(&objective.start()).unwrap();
        let sum: f64 = (1..21).map(|k| f64::from(k * k)).sum();
        let variance = objective.whitening.sigma()[1].powi(2);
        assert!((variance / (sum / 20.0) - 1.0).abs() < 1e-14, "{variance}");
        let gradient = linear.gradient();
        assert!(linear.rows() == 40 && gradient[0] == 0.0 && gradient[1].abs() > 1.0, "{gradient:?}");
        assert!((gradient[2].abs() * variance / sum - 1.0).abs() < 1e-13, "{gradient:?}");
        let found = problem.run().unwrap();
        for (unknown, truth) in found.unknowns.iter().zip([9.0, 1.0, 1.0]) {
            assert!((unknown.value / truth - 1.0).abs() < 1e-6, "{found}");
        }
    }

    /// Noise and linearization that follow from those at a point with other levels, and those of new passes.
    fn compare(records: &[ExperimentOf<Surface>]) {
        let model = Surface::new(4).unwrap();
        let start = Winding { rs: free(0.9), ls: free(2e-3).log(), ke: free(0.7) };
        let problem = Fit::new(&model, records).parameters(start).problem().unwrap();
        let x = problem.unknowns.start();
        let fresh = || problem.in_units(&Control::NEVER);
        let plain = fresh();
        plain.evaluate(&x).unwrap();
        let (known, measured) = (noise::estimate(&plain, &x).unwrap(), noise::estimate(&fresh(), &x).unwrap());
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-11, "{a} {b}");
        known.sigma().into_iter().zip(measured.sigma()).for_each(|(a, b)| near(a, b));
        assert!(known.sigma()[0] != known.sigma()[1]);
        for whitening in [known, Whitening::Diagonal(vec![0.3, 20.0])] {
            let found: Linearization = plain.with(whitening.clone()).known_at(&x).unwrap();
            let expected = fresh().with(whitening).linearize(&x).unwrap();
            near(found.cost, expected.cost);
            assert_eq!(found.rows(), expected.rows());
            let (step, other) = (found.gradient(), expected.gradient());
            step.into_iter().zip(other).for_each(|(a, b)| near(a, b));
            let held = vec![false; x.len()];
            let errors = |linear: &Linearization| linear.covariance(&held).unwrap().diagonal();
            errors(&found).into_iter().zip(errors(&expected)).for_each(|(a, b)| near(a, b));
        }
        let mut moved = x.clone();
        moved[0] *= 1.0 + f64::EPSILON;
        assert!(plain.known_at(&moved).is_none());
    }

    /// A record in segments, and several records with missing measurements. Sums of 2,000 terms, of which the gradient's cancel to a
    /// hundredth.
    #[test]
    fn other_noise_levels_need_no_pass() {
        let model = Surface::new(4).unwrap();
        let record = Experiment::from_file(&model, "examples/data/pmsm.csv").unwrap();
        let piece = |r: usize| {
            let of = |values: &[f64]| values[400 * r..][..300].to_vec();
            let inputs = record.record().inputs().iter().map(|channel| of(&channel.values)).collect();
            let missing = |(j, values): (usize, Vec<f64>)| -> Vec<f64> {
                values.into_iter().enumerate().map(|(k, y)| if k % (5 + j) == r { f64::NAN } else { y }).collect()
            };
            let outputs =
                record.record().outputs().iter().map(|channel| of(&channel.values)).enumerate().map(missing).collect();
            Experiment::from_columns(&model, Time::Uniform { start: 0.0, step: 0.25e-3 }, inputs, outputs).unwrap()
        };
        let pieces: Vec<_> = (0..3).map(piece).collect();
        compare(&[record]);
        compare(&pieces);
    }

    /// What is known of a point is no longer used where the errors have weights or a loss, which other levels bend.
    #[test]
    fn losses_and_weights_keep_nothing() {
        let model = Surface::new(4).unwrap();
        let record = Experiment::from_file(&model, "examples/data/pmsm.csv").unwrap();
        let fit = || Fit::new(&model, &record).parameters(Winding { rs: free(0.9), ls: free(2e-3), ke: free(0.7) });
        for (fit, keeps) in [
            (fit(), true),
            (fit().loss(crate::Huber::default()), false),
            (fit().weighting(|_: &crate::Sample<Surface>| 2.0), false),
        ] {
            let problem = fit.problem().unwrap();
            assert_eq!(problem.in_units(&Control::NEVER).keeps_outputs(), keeps);
        }
    }
}
