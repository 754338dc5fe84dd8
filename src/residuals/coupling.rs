//! Whether the errors of several outputs are correlated at the same sample.

use crate::residuals::whiteness::Whiteness;
use crate::sweep::Window;
use crate::whiteness::chi_squared_tail;
use crate::wide::{Terms, Wide, sums};

/// Level of the test, over all pairs of outputs.
pub(crate) const LEVEL: f64 = 0.01;

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

/// `a b`, `a^2`, `b^2` and `(a b)^2` of two errors.
#[derive(Clone, Copy)]
pub(crate) struct Products;

impl Terms<2, 4> for Products {
    #[inline(always)]
    fn of<W: Wide>(self, [a, b]: [W; 2]) -> [W; 4] {
        let product = a.mul(b);
        [product, a.mul(a), b.mul(b), product.mul(product)]
    }
}

/// The sums of all pairs.
#[derive(Clone, Debug)]
pub(crate) struct Coupling {
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

/// Above this p-value of the whiteness test no inflation is applied: the autocorrelations are chance, and an inflation by them hides
/// correlated outputs in short records.
const WHITE: f64 = 0.05;
/// The largest ratio of the sums over the second and the first half of the known lags that is extrapolated.
const SLOWEST: f64 = 0.99;

/// By how much the variance of the sum of products of two independent sequences is larger than if they were white: by
/// `1 + 2 sum over k of rho_i(k) rho_j(k)` (Bartlett, J. Royal Statistical Society 98 (1935) 536), from their autocorrelations
/// at lags `1, 2, ...`. Beyond the known lags the sum is continued as a geometric series with the ratio of the known halves. Where
/// that is less than the value of autoregressions of order one with these correlations at lag one, theirs is taken.
fn inflation(a: &[f64], b: &[f64]) -> f64 {
    let products: Vec<f64> = a.iter().zip(b).map(|(a, b)| a * b).collect();
    let phi = products.first().map_or(0.0, |first| first.min(1.0 - f64::EPSILON));
    let (early, late) = products.split_at(products.len() / 2);
    let (early, late): (f64, f64) = (early.iter().sum(), late.iter().sum());
    let falls = if early > 0.0 && late > 0.0 { (late / early).min(SLOWEST) } else { 0.0 };
    let later = late * falls / (1.0 - falls);
    (1.0 + 2.0 * (early + late + later)).max((1.0 + phi) / (1.0 - phi)).max(1.0)
}

impl Coupling {
    pub fn new(outputs: usize) -> Self {
        Coupling { pairs: vec![Pair::default(); pairs(outputs).count()] }
    }

    /// Adds the products of a window, each sample with its weight, if there are weights.
    pub fn add(&mut self, window: &Window, lane: usize, weight: Option<&dyn Fn(usize) -> f64>) {
        for ((i, j), pair) in pairs(window.outputs()).zip(&mut self.pairs) {
            let both = window.errors(i, lane).zip(window.errors(j, lane)).enumerate();
            let measured = |k| window.whole || window.is_measured(k, i, lane) && window.is_measured(k, j, lane);
            let mut sums = Pair::default();
            for (k, (a, b)) in both.filter(|(k, _)| measured(*k)) {
                let weight = weight.map_or(1.0, |of| of(k));
                sums.product += weight * (a * b);
                sums.squares[0] += weight * (a * a);
                sums.squares[1] += weight * (b * b);
                sums.fourth += (weight * a * b).powi(2);
            }
            pair.append(&sums);
        }
    }

    /// Adds the products of so many samples, all of them measured, from their errors, output by output.
    pub fn add_all(&mut self, errors: &[f64], samples: usize) {
        let of = |j: usize| &errors[j * samples..][..samples];
        for ((i, j), pair) in pairs(errors.len().checked_div(samples).unwrap_or(0)).zip(&mut self.pairs) {
            let [product, a, b, fourth] = sums([of(i), of(j)], Products);
            pair.append(&Pair { product, squares: [a, b], fourth });
        }
    }

    pub fn append(&mut self, other: &Coupling) {
        self.pairs.iter_mut().zip(&other.pairs).for_each(|(pair, other)| pair.append(other));
    }

    /// The most certain correlation between outputs whose errors are autocorrelated like this, if any is certain.
    pub fn strongest(&self, whiteness: &[Whiteness]) -> Option<Coupled> {
        let of = |(outputs, pair): ((usize, usize), &Pair)| {
            let size = (pair.squares[0] * pair.squares[1]).sqrt();
            let (a, b) = (&whiteness[outputs.0], &whiteness[outputs.1]);
            let colored = a.p_value.max(b.p_value) < WHITE;
            let more = if colored { inflation(&a.correlations, &b.correlations) } else { 1.0 };
            let chance = chi_squared_tail(pair.product * pair.product / (more * pair.fourth), 1.0);
            let p_value = (chance * self.pairs.len() as f64).min(1.0);
            (size > 0.0 && pair.fourth > 0.0).then(|| Coupled { outputs, correlation: pair.product / size, p_value })
        };
        let found = pairs(whiteness.len()).zip(&self.pairs).filter_map(of);
        found.min_by(|a, b| a.p_value.total_cmp(&b.p_value)).filter(|found| found.p_value < LEVEL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residuals::whiteness::LAGS;

    const PLAIN: Whiteness = Whiteness { p_value: 1.0, correlations: [0.0; LAGS], predicted: 0.0, dependence: 1.0 };

    /// By hand, two outputs with errors (1, 2), (1, 1), (-1, -1): products 2, 1, 1; squares 3 and 6; a sum of squared products
    /// of 6. The statistic is 16/6, whose tail with one degree of freedom is 0.102470; not below the level. Four times the
    /// same: 64/6, 0.001091.
    #[test]
    fn correlation_by_hand() {
        let once = Coupling { pairs: vec![Pair { product: 4.0, squares: [3.0, 6.0], fourth: 6.0 }] };
        assert!(once.strongest(&[PLAIN; 2]).is_none());
        let mut four = once.clone();
        (0..3).for_each(|_| four.append(&once));
        let found = four.strongest(&[PLAIN; 2]).unwrap();
        assert_eq!(found.outputs, (0, 1));
        assert!((found.correlation - 4.0 / 18f64.sqrt()).abs() < 1e-15, "{found:?}");
        assert!((found.p_value - 0.001_091).abs() < 1e-6, "{found:?}");
    }

    /// Errors 1, 2, 3 and 2, 5, 7 of two outputs, the second measured at the first two samples only, with the weights 4, 3, 2: products
    /// `4 * 2 + 3 * 10`, squares `4 + 3 * 4` and `4 * 4 + 3 * 25`, squared products `8^2 + 30^2`. Of the other lane nothing counts.
    #[test]
    fn products_of_samples_with_weights_by_hand() {
        let mut window = Window::new(2, 2, 0, 3, false);
        window.samples = vec![3, 3];
        let values = [[1.0, 2.0], [2.0, 5.0], [3.0, 7.0]];
        for (k, errors) in values.iter().enumerate() {
            for (j, error) in errors.iter().enumerate() {
                window.row_mut(k, j).copy_from_slice(&[*error, 100.0]);
                window.set_measured(k, j, if j == 1 && k == 2 { 0b10 } else { 0b11 });
            }
        }
        let sums = |weight: Option<&dyn Fn(usize) -> f64>| {
            let mut found = Coupling::new(2);
            found.add(&window, 0, weight);
            let Pair { product, squares: [a, b], fourth } = found.pairs[0];
            [product, a, b, fourth]
        };
        assert_eq!(sums(Some(&|k| 4.0 - k as f64)), [38.0, 16.0, 91.0, 964.0]);
        assert_eq!(sums(None), [12.0, 5.0, 29.0, 104.0]);
    }

    /// The same errors seven times, side by side, and a third output twice the first: sums of integers are exact.
    #[test]
    fn products_of_whole_windows_by_hand() {
        let errors = |of: [f64; 3]| of.into_iter().cycle().take(21);
        let all: Vec<f64> =
            [[1.0, 1.0, -1.0], [2.0, 1.0, -1.0], [2.0, 2.0, -2.0]].into_iter().flat_map(errors).collect();
        let mut found = Coupling::new(3);
        found.add_all(&all, 21);
        let pairs = found.pairs.iter().map(|pair| [pair.product, pair.squares[0], pair.squares[1], pair.fourth]);
        let expected = [[28.0, 21.0, 42.0, 42.0], [42.0, 21.0, 84.0, 84.0], [56.0, 42.0, 84.0, 168.0]];
        assert_eq!(pairs.collect::<Vec<_>>(), expected);
    }

    /// By hand: an autoregression of 1/2 beside as much white noise has `1 + 2 (1/16 + 1/64 + ...) = 7/6`; `1 + 2 (1/4 + 1/8)`
    /// where what falls by a half goes on as `1/16 + ...`; `(1 + 1/4)/(1 - 1/4)`, which is more than `1 + 2/4`; and never less than
    /// for white errors.
    #[test]
    fn autocorrelation_inflates_the_variance() {
        let beside_white = [0.25, 0.125, 0.0625, 0.03125];
        assert!((inflation(&beside_white, &beside_white) - 7.0 / 6.0).abs() < 1e-15);
        assert!((inflation(&[0.5, 0.25], &[0.5, 0.5]) - 2.0).abs() < 1e-15);
        assert!((inflation(&[0.5, 0.0], &[0.5, 0.9]) - 5.0 / 3.0).abs() < 1e-15);
        assert_eq!(inflation(&[0.5, 0.1], &[-0.5, 0.1]), 1.0);
        // A sum that turns negative is not continued: 1 + 2 (0.01 + 0.64 - 0.18).
        assert!((inflation(&[0.1, 0.8, 0.3, 0.3], &[0.1, 0.8, -0.3, -0.3]) - 1.94).abs() < 1e-14);
        let colored = Whiteness { p_value: 0.0, correlations: [0.9; LAGS], ..PLAIN };
        let pair = Pair { product: 16.0, squares: [12.0, 24.0], fourth: 24.0 };
        assert!(Coupling { pairs: vec![pair] }.strongest(&[PLAIN, colored]).is_some());
        assert!(Coupling { pairs: vec![pair] }.strongest(&[colored; 2]).is_none());
    }
}
