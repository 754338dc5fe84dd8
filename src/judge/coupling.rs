//! Whether the errors of several outputs are correlated at the same sample.

use super::conclude::Judgement;
use super::covariances::Covariances;
use crate::estimate::{CovarianceMethod, Warning, WarningCode};
use crate::numeral::{number, p_value};
use crate::optimize::Severity;
use crate::problem::{Noise, Whitening};
use crate::sweep::Window;
use crate::whiteness::chi_squared_tail;

/// Level of the test, over all pairs of outputs.
const LEVEL: f64 = 0.01;

/// Sums over the samples at which both outputs of a pair were measured.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    product: f64,
    squares: [f64; 2],
    /// Of the squared products: the variance of their sum where the errors are independent, of any variance each.
    fourth: f64,
}

impl Pair {
    fn append(&mut self, other: &Pair) {
        self.product += other.product;
        self.squares.iter_mut().zip(other.squares).for_each(|(sum, other)| *sum += other);
        self.fourth += other.fourth;
    }
}

/// The sums of all pairs.
#[derive(Clone, Debug)]
pub(super) struct Coupling {
    pairs: Vec<Pair>,
}

/// The most certain correlation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coupled {
    pub outputs: (usize, usize),
    pub correlation: f64,
    /// Over all pairs.
    pub p_value: f64,
}

/// Pairs of so many outputs.
fn pairs(outputs: usize) -> impl Iterator<Item = (usize, usize)> {
    (1..outputs).flat_map(|j| (0..j).map(move |i| (i, j)))
}

impl Coupling {
    pub fn new(outputs: usize) -> Self {
        Coupling { pairs: vec![Pair::default(); pairs(outputs).count()] }
    }

    pub fn add(&mut self, window: &Window, lane: usize) {
        for ((i, j), pair) in pairs(window.outputs()).zip(&mut self.pairs) {
            let both = window.errors(i, lane).zip(window.errors(j, lane)).enumerate();
            let measured = |k| window.whole || window.is_measured(k, i, lane) && window.is_measured(k, j, lane);
            let mut sums = Pair::default();
            for (_, (a, b)) in both.filter(|(k, _)| measured(*k)) {
                sums.product += a * b;
                sums.squares[0] += a * a;
                sums.squares[1] += b * b;
                sums.fourth += a * a * b * b;
            }
            pair.append(&sums);
        }
    }

    pub fn append(&mut self, other: &Coupling) {
        self.pairs.iter_mut().zip(&other.pairs).for_each(|(pair, other)| pair.append(other));
    }

    pub fn strongest(&self, outputs: usize) -> Option<Coupled> {
        let of = |(outputs, pair): ((usize, usize), &Pair)| {
            let size = (pair.squares[0] * pair.squares[1]).sqrt();
            let chance = chi_squared_tail(pair.product * pair.product / pair.fourth, 1.0);
            let p_value = (chance * self.pairs.len() as f64).min(1.0);
            (size > 0.0 && pair.fourth > 0.0).then(|| Coupled { outputs, correlation: pair.product / size, p_value })
        };
        let found = pairs(outputs).zip(&self.pairs).filter_map(of);
        found.min_by(|a, b| a.p_value.total_cmp(&b.p_value)).filter(|found| found.p_value < LEVEL)
    }
}

impl Judgement<'_> {
    /// Outputs whose errors are correlated, where the fit took them as independent.
    pub(super) fn coupled(&self) -> Option<Coupled> {
        let independent = matches!(self.objective.whitening, Whitening::Diagonal(_));
        let own = matches!(self.objective.problem.settings.noise, Noise::Predicted);
        self.residuals.coupled.filter(|_| independent && !own && !self.rounding)
    }

    /// What is said of them.
    pub(super) fn correlated_outputs(&self, covariances: &Covariances) -> Option<Warning> {
        let Coupled { outputs: (i, j), correlation, p_value: chance } = self.coupled()?;
        let outputs = &self.objective.problem.layout().outputs;
        let allowed = match covariances.method {
            CovarianceMethod::Classical => "the intervals do not",
            _ => "the intervals do",
        };
        let text = format!(
            "the errors of `{}` and `{}` are correlated at the same sample ({}, {}); the estimate does not allow for it, {allowed}; \
             a full noise covariance (Fit::noise_covariance) weighs them right",
            outputs[i].name,
            outputs[j].name,
            number(correlation, 2),
            p_value(chance)
        );
        Some(Warning { code: WarningCode::CorrelatedOutputs, severity: Severity::Usable, text })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, two outputs with errors (1, 2), (1, 1), (-1, -1): products 2, 1, 1; squares 3 and 6; a sum of squared products
    /// of 6. The statistic is 16/6, whose tail with one degree of freedom is 0.102470; not below the level. Four times the
    /// same: 64/6, 0.001091.
    #[test]
    fn correlation_by_hand() {
        let once = Coupling { pairs: vec![Pair { product: 4.0, squares: [3.0, 6.0], fourth: 6.0 }] };
        assert!(once.strongest(2).is_none());
        let mut four = once.clone();
        (0..3).for_each(|_| four.append(&once));
        let found = four.strongest(2).unwrap();
        assert_eq!(found.outputs, (0, 1));
        assert!((found.correlation - 4.0 / 18f64.sqrt()).abs() < 1e-15, "{found:?}");
        assert!((found.p_value - 0.001_091).abs() < 1e-6, "{found:?}");
    }
}
