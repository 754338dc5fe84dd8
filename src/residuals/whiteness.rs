//! [`Whiteness`]: how much the errors of an output are correlated over time.

use crate::whiteness::{FEW, Portmanteau, levinson_durbin};

/// Significance level of the whiteness test.
pub(crate) const WHITENESS_LEVEL: f64 = 0.01;
/// Lags of the portmanteau test; one over few sees more of what only neighbors share.
pub(crate) const LAGS: usize = 20;

/// Whiteness of the errors of an output.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Whiteness {
    /// Three times the least p-value of three tests: over 3 lags, over 20, and of neighbors.
    pub p_value: f64,
    /// Autocorrelations at lags `1, 2, ...`.
    pub correlations: [f64; LAGS],
    /// The part of the errors' variance that follows from the errors before, by an autoregression over all lags, less
    /// what white errors show by chance.
    pub predicted: f64,
    /// How many errors have the information of one independent error on a slow signal.
    pub dependence: f64,
}

impl Whiteness {
    /// Of so many errors.
    pub fn of(errors: &Portmanteau, count: u64) -> Self {
        let correlations = std::array::from_fn(|k| errors.at(k + 1).1);
        let (predicted, dependence) = color(&correlations, count);
        let most = |lags: usize| lags.min(count as usize / 4).max(1);
        let over = |lags: usize| errors.p_value(most(lags));
        Whiteness {
            p_value: (3.0 * over(FEW).min(over(LAGS)).min(errors.neighbors_p_value())).min(1.0),
            correlations,
            predicted,
            dependence,
        }
    }
}

/// What follows from the errors before, and how many errors count for one, from the autocorrelations at lags `1, 2, ...` of
/// so many errors.
fn color(coefficients: &[f64], count: u64) -> (f64, f64) {
    let (first, lags) = (coefficients[0], coefficients.len() as f64);
    let mut innovation = 1.0;
    levinson_durbin(coefficients, |_, variance| innovation = variance);
    // What chance leaves, as in an adjusted coefficient of determination.
    let free = (count as f64 - lags).max(1.0) / (count as f64).max(1.0);
    let predicted = (1.0 - innovation / free).clamp(0.0, 1.0);
    let positive: f64 = coefficients.iter().take_while(|rho| **rho > 0.0).sum();
    let autoregression = (1.0 + first) / (1.0 - first).max(f64::EPSILON);
    (predicted, (1.0 + 2.0 * positive).max(autoregression).max(1.0))
}

/// Of the outputs that were tested that whose errors are least white, and how white they are; the probability counts all of them.
pub(crate) fn least_white(tested: &[(usize, Whiteness)]) -> Option<(usize, Whiteness)> {
    let count = tested.len() as f64;
    let tested = tested.iter().map(|(j, white)| (*j, Whiteness { p_value: white.p_value * count, ..*white }));
    let strongest = |a: &Whiteness, b: &Whiteness| {
        a.p_value.total_cmp(&b.p_value).then(b.correlations[0].total_cmp(&a.correlations[0]))
    };
    tested.min_by(|a, b| strongest(&a.1, &b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of an autoregression of order one with correlation `r`, the part `r^2` of the variance follows from the error before,
    /// and `(1 + r) / (1 - r)` errors count for one; of white noise nothing follows, and each counts.
    #[test]
    fn an_autoregression_is_predicted() {
        for r in [0.0, 0.3, 0.9f64] {
            let coefficients: Vec<f64> = (1..=20).map(|k| r.powi(k)).collect();
            let (predicted, dependence) = color(&coefficients, 1_000_000_000);
            // The adjustment for 20 lags of so many errors is 2e-8.
            assert!((predicted - r * r).abs() < 1e-7, "{r}: {predicted}");
            assert!((dependence - (1.0 + r) / (1.0 - r)).abs() < 1e-9, "{r}: {dependence}");
        }
    }

    /// Three tests of one series, over no more lags than a quarter of its errors.
    #[test]
    fn three_tests_of_whiteness() {
        let mut random = crate::random::Random::stream(3, 0);
        for (count, lags) in [(402, [FEW, LAGS]), (23, [FEW, 5])] {
            let run: Vec<f64> = (0..count).map(|_| random.normal()).collect();
            let mut errors = Portmanteau::new(LAGS);
            errors.add(&run);
            let least = lags.map(|lags| errors.p_value(lags)).into_iter().fold(errors.neighbors_p_value(), f64::min);
            assert_eq!(Whiteness::of(&errors, count).p_value, (3.0 * least).min(1.0));
        }
    }

    /// The least probability, times the number of outputs; of equal ones that with the larger correlation.
    #[test]
    fn the_least_white_of_outputs() {
        let of = |p_value: f64, first: f64| {
            let mut correlations = [0.0; LAGS];
            correlations[0] = first;
            Whiteness { p_value, correlations, predicted: 0.0, dependence: 1.0 }
        };
        let found = |all: &[Whiteness]| {
            let tested: Vec<(usize, Whiteness)> = all.iter().copied().enumerate().collect();
            least_white(&tested).map(|(j, white)| (j, white.p_value))
        };
        assert_eq!(found(&[]), None);
        assert_eq!(found(&[of(0.5, 0.9), of(0.125, 0.1), of(0.25, 0.9)]), Some((1, 0.375)));
        assert_eq!(found(&[of(0.0, 0.3), of(0.0, 0.9), of(0.0, 0.6)]), Some((1, 0.0)));
    }

    /// An autoregression of order four leaves the product of `1 - r^2` over its partial autocorrelations `r` (Durbin, Review of
    /// the International Statistical Institute 28 (1960) 233); its autocorrelations follow from them.
    #[test]
    fn partial_autocorrelations_make_the_innovation() {
        let partial = [0.5, -0.4, 0.3, 0.2f64];
        let (mut a, mut rho, mut left) = (Vec::<f64>::new(), Vec::<f64>::new(), 1.0);
        for k in 0..LAGS {
            let next = partial.get(k).copied().unwrap_or(0.0);
            let known: f64 = a.iter().zip(rho.iter().rev()).map(|(a, rho)| a * rho).sum();
            rho.push(known + next * left);
            let turned: Vec<f64> = a.iter().rev().map(|a| next * a).collect();
            a.iter_mut().zip(turned).for_each(|(a, by)| *a -= by);
            a.push(next);
            left *= 1.0 - next * next;
        }
        let mut innovation = 1.0;
        levinson_durbin(&rho, |_, variance| innovation = variance);
        assert!((innovation - left).abs() < 1e-12, "{innovation} {left}");
        // Of 100 errors, 20 lags take as many degrees of freedom.
        let (predicted, _) = color(&rho, 100);
        assert!((predicted - (1.0 - left / 0.8)).abs() < 1e-12, "{predicted}");
    }

    /// The sum over the lags up to the first that is not positive, where it is more than an autoregression's.
    #[test]
    fn dependence_counts_positive_lags() {
        for coefficients in [[0.1, 0.3, 0.2, -0.5, 0.4], [0.1, 0.3, 0.2, 0.0, 0.4]] {
            let (_, dependence) = color(&coefficients, 1000);
            assert!((dependence - 2.2).abs() < 1e-12, "{dependence}");
        }
        let (_, dependence) = color(&[-0.3, 0.2], 1000);
        assert_eq!(dependence, 1.0);
    }
}
