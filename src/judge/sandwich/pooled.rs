//! The noise that all measurements of an output tell of, for one of which its own error tells little.

use super::Tally;
use nalgebra::DMatrix;

/// Sums over the influences `psi` of an output and their weights `w`.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    count: f64,
    squares: f64,
    weighted: f64,
    /// Of `ln w`.
    logarithms: f64,
}

impl Moments {
    pub fn take(&mut self, psi: f64, weight: f64) {
        self.add(Moments { count: 1.0, squares: psi * psi, weighted: weight * psi * psi, logarithms: weight.ln() });
    }

    pub fn add(&mut self, other: Moments) {
        self.count += other.count;
        self.squares += other.squares;
        self.weighted += other.weighted;
        self.logarithms += other.logarithms;
    }

    /// The variance as `a + b / w`: the mean of the two that are the same for all measurements and inverse to their weights, by
    /// how likely the errors are with each.
    fn variance(&self) -> [f64; 2] {
        let [equal, inverse] = [self.squares, self.weighted].map(|sum| sum / self.count.max(1.0));
        if equal <= 0.0 {
            return [0.0; 2];
        }
        let more = 0.5 * (self.count * (equal / inverse).ln() + self.logarithms);
        let part = 1.0 / (1.0 + (-more).exp());
        [(1.0 - part) * equal, part * inverse]
    }
}

/// The noise of all outputs.
pub(super) struct Pooled {
    variances: Vec<[f64; 2]>,
    /// Of the correlation between the outputs at the same sample: `factor factor'`.
    pub factor: DMatrix<f64>,
}

impl Pooled {
    /// From errors that are smaller than the noise by what so many estimated unknowns took of it.
    pub fn of(tally: &Tally, estimated: usize) -> Self {
        let count: f64 = tally.moments.iter().map(|moments| moments.count).sum();
        let larger = count / (count - estimated as f64).max(1.0);
        let variances = tally.moments.iter().map(|moments| moments.variance().map(|part| larger * part)).collect();
        let sums = &tally.influence;
        let correlation =
            |i: usize, j: usize| if i == j { 1.0 } else { sums[(i, j)] / (sums[(i, i)] * sums[(j, j)]).sqrt() };
        let outputs = sums.nrows();
        let correlations = DMatrix::from_fn(outputs, outputs, correlation);
        let factor = correlations.cholesky().map_or(DMatrix::identity(outputs, outputs), |cholesky| cholesky.l());
        Pooled { variances, factor }
    }

    /// The variance of the influence of an output's measurement with this weight.
    pub fn variance(&self, output: usize, weight: f64) -> f64 {
        let [equal, inverse] = self.variances[output];
        equal + inverse / weight
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of 1 and -1 by turns, of weights 1 and 4 by turns, then divided by the roots of the weights. Of 200 of them the one
    /// model is `exp(100 ln(2.5 / 2)) = 4.9e9` times as likely as the other, and the other way around.
    #[test]
    fn noise_goes_with_the_weights_where_errors_do() {
        let of = |power: f64| {
            let mut moments = Moments::default();
            for k in 0..200 {
                let weight: f64 = if k % 2 == 0 { 1.0 } else { 4.0 };
                moments.take(weight.powf(power) * if k % 4 < 2 { 1.0 } else { -1.0 }, weight);
            }
            moments.variance()
        };
        let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-8 && (b - d).abs() < 1e-8;
        assert!(near(of(0.0), [1.0, 0.0]), "{:?}", of(0.0));
        assert!(near(of(-0.5), [0.0, 1.0]), "{:?}", of(-0.5));
        assert_eq!(Moments::default().variance(), [0.0; 2]);
        // Weights that are all alike do not tell the two apart, and need not.
        let mut alike = Moments::default();
        (0..10).for_each(|_| alike.take(3.0, 2.0));
        let [equal, inverse] = alike.variance();
        assert!((equal + inverse / 2.0 - 9.0).abs() < 1e-12);
    }

    /// Two outputs with influences of (2, 1) and (0, 1): correlation `2 / sqrt(4 * 2)`, variances 2 and 1 by two samples each, of
    /// which one of four measurements went to an unknown.
    #[test]
    fn outputs_correlate() {
        let mut tally = Tally::new(2);
        for influences in [[2.0, 1.0], [0.0, 1.0]] {
            for i in 0..2 {
                tally.moments[i].take(influences[i], 1.0);
                (0..2).for_each(|j| tally.influence[(i, j)] += influences[i] * influences[j]);
            }
        }
        let pooled = Pooled::of(&tally, 1);
        let larger = 4.0 / 3.0;
        assert!((pooled.variance(0, 1.0) - 2.0 * larger).abs() < 1e-12);
        assert!((pooled.variance(1, 1.0) - larger).abs() < 1e-12);
        let product = &pooled.factor * pooled.factor.transpose();
        assert!((product[(0, 1)] - 0.5f64.sqrt()).abs() < 1e-12 && (product[(1, 1)] - 1.0).abs() < 1e-12);
    }
}
