//! [`Filter`]: the constant covariance of a filter of linear equations.

use super::product;
use crate::scalar::Scalar;
use nalgebra::DMatrix;

/// Doublings in which it has to become constant: a million samples.
const DOUBLINGS: usize = 20;
/// The doubling ends where the next one would change no variance by more than this part; corrections follow, each of which squares what is left.
const DOUBLED: f64 = 1e-8;
/// Corrections at most.
const CORRECTIONS: usize = 6;
/// A covariance is right where a sample changes it by no more than this part of the standard deviations: roundings of some products.
const RIGHT: f64 = 1e-14;
/// What is left of a deviation from the state is negligible where no entry, in standard deviations, is above this: of a covariance its square is left.
const NEGLIGIBLE: f64 = 1e-10;

/// What a sample and the interval after it do to a covariance `P`: measurements `c x` of some variance correct it, one by one; then it becomes
/// `F P F' + Q`. Matrices row by row.
#[derive(Clone)]
pub(crate) struct Filter<S> {
    pub n: usize,
    pub kept: Vec<S>,
    pub added: Vec<S>,
    pub sensors: Vec<Sensor<S>>,
}

/// The slopes of an output with respect to the state, and the variance of its noise.
#[derive(Clone)]
pub(crate) struct Sensor<S> {
    pub slopes: Vec<S>,
    pub variance: S,
}

/// The next sample.
struct Next<S> {
    /// The covariance before it.
    covariance: Vec<S>,
    /// The slopes of a deviation from the state there with respect to one a sample before.
    left: Vec<S>,
    /// The variance of each output a sample before, given those before it.
    variances: Vec<S>,
}

impl<S: Scalar> Filter<S> {
    /// What a sample and the interval after it make of the covariance before it.
    fn next(&self, p: &[S]) -> Next<S> {
        let n = self.n;
        let (mut p, mut left, mut variances) = (p.to_vec(), unit(n), vec![]);
        for Sensor { slopes: c, variance } in &self.sensors {
            let gain: Vec<S> = (0..n).map(|i| (0..n).map(|j| p[i * n + j] * c[j]).sum()).collect();
            let total = gain.iter().zip(c).map(|(gain, c)| *gain * *c).sum::<S>() + *variance;
            variances.push(total);
            let part: Vec<S> = gain.iter().map(|gain| *gain / total).collect();
            let rest: Vec<S> = (0..n * n).map(|at| -(part[at / n] * c[at % n])).collect();
            let rest: Vec<S> = rest.iter().zip(unit::<S>(n)).map(|(taken, one)| *taken + one).collect();
            p = congruent(n, &rest, &p);
            (0..n * n).for_each(|at| p[at] += part[at / n] * *variance * part[at % n]);
            left = product(n, &rest, &left);
        }
        let moved = congruent(n, &self.kept, &p);
        let covariance = moved.iter().zip(&self.added).map(|(moved, added)| *moved + *added).collect();
        Next { covariance, left: product(n, &self.kept, &left), variances }
    }

    /// The constant covariance, upper and lower triangle, and the variances of the outputs, with their slopes, from its value.
    pub fn about(&self, settled: &[f64]) -> [Vec<S>; 2] {
        let here: Vec<S> = settled.iter().map(|p| S::from(*p)).collect();
        let Next { covariance, left, .. } = self.next(&here);
        let left: Vec<f64> = left.iter().map(Scalar::value).collect();
        let change = covariance.iter().zip(&here).map(|(next, here)| *next - *here).collect();
        let change = sum_over_samples(self.n, left, change, settled);
        let covariance: Vec<S> = here.iter().zip(change).map(|(here, change)| *here + change).collect();
        let variances = self.next(&covariance).variances;
        [covariance, variances]
    }
}

impl Filter<f64> {
    /// The constant covariance before a sample; `None` where there is none. States that no noise reaches have no variance. By doubling
    /// (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, International Journal of Control 77 (2004) 767-788), then by Newton's method
    /// (G. A. Hewer, IEEE Transactions on Automatic Control 16 (1971) 382-384).
    pub fn settled(&self) -> Option<Vec<f64>> {
        let n = self.n;
        let reached = self.reached();
        let within = self.of(&reached).settled_within()?;
        let mut all = vec![0.0; n * n];
        for (i, row) in reached.iter().enumerate() {
            reached.iter().enumerate().for_each(|(j, column)| all[row * n + column] = within[i * reached.len() + j]);
        }
        Some(all)
    }

    /// The states that noise reaches.
    fn reached(&self) -> Vec<usize> {
        let n = self.n;
        let mut reached: Vec<bool> = (0..n).map(|i| self.added[i * (n + 1)] != 0.0).collect();
        for _ in 0..n {
            (0..n * n).for_each(|at| reached[at / n] |= reached[at % n] && self.kept[at] != 0.0);
        }
        (0..n).filter(|i| reached[*i]).collect()
    }

    /// The filter of some of the states.
    fn of(&self, states: &[usize]) -> Self {
        let square = |all: &[f64]| {
            let row = |i: &usize| states.iter().map(|j| all[i * self.n + j]).collect::<Vec<f64>>();
            states.iter().flat_map(row).collect()
        };
        let sensor = |sensor: &Sensor<f64>| Sensor {
            slopes: states.iter().map(|i| sensor.slopes[*i]).collect(),
            variance: sensor.variance,
        };
        let sensors = self.sensors.iter().map(sensor).collect();
        Filter { n: states.len(), kept: square(&self.kept), added: square(&self.added), sensors }
    }

    fn settled_within(&self) -> Option<Vec<f64>> {
        let n = self.n;
        let mut p = self.doubled()?;
        for _ in 0..CORRECTIONS {
            let Next { covariance, left, .. } = self.next(&p);
            let change: Vec<f64> = covariance.iter().zip(&p).map(|(next, here)| next - here).collect();
            let size = |at: usize| (p[at / n * (n + 1)] * p[at % n * (n + 1)]).sqrt();
            if (0..n * n).all(|at| change[at].abs() <= RIGHT * size(at)) {
                return Some(p);
            }
            let change = sum_over_samples(n, left, change, &p);
            p.iter_mut().zip(change).for_each(|(p, change)| *p += change);
        }
        None
    }

    /// The settled covariance, nearly.
    fn doubled(&self) -> Option<Vec<f64>> {
        let n = self.n;
        let square = |rows: &[f64]| DMatrix::from_row_slice(n, n, rows);
        let (mut a, mut p) = (square(&self.kept).transpose(), square(&self.added));
        let mut information = DMatrix::zeros(n, n);
        for Sensor { slopes, variance } in self.sensors.iter().filter(|sensor| sensor.slopes.iter().any(|c| *c != 0.0))
        {
            let c = DMatrix::from_row_slice(1, n, slopes);
            information += c.tr_mul(&c) / *variance;
        }
        for _ in 0..DOUBLINGS {
            let both = (DMatrix::identity(n, n) + &information * &p).lu();
            let (of_a, of_information) = (both.solve(&a)?, both.solve(&information)?);
            let grown = a.tr_mul(&p) * &of_a;
            information += &a * of_information * a.transpose();
            a = &a * of_a;
            p += &grown;
            if (0..n).all(|i| grown[(i, i)].abs() <= DOUBLED * p[(i, i)]) {
                return Some(p.iter().copied().collect());
            }
        }
        None
    }
}

/// The sum of `M^k D M'^k` over all `k`, of a change `D` of this covariance.
fn sum_over_samples<S: Scalar>(n: usize, mut left: Vec<f64>, mut sum: Vec<S>, settled: &[f64]) -> Vec<S> {
    let deviations: Vec<f64> = (0..n).map(|i| settled[i * (n + 1)].sqrt()).collect();
    // States without noise: what they do is no part of the sum.
    (0..n * n).filter(|at| deviations[at / n] * deviations[at % n] == 0.0).for_each(|at| left[at] = 0.0);
    for _ in 0..=DOUBLINGS {
        let lifted: Vec<S> = left.iter().map(|entry| S::from(*entry)).collect();
        sum = sum.iter().zip(congruent(n, &lifted, &sum)).map(|(sum, more)| *sum + more).collect();
        left = product(n, &left, &left);
        if (0..n * n).all(|at| left[at].abs() * deviations[at % n] <= NEGLIGIBLE * deviations[at / n]) {
            break;
        }
    }
    sum
}

fn unit<S: Scalar>(n: usize) -> Vec<S> {
    (0..n * n).map(|at| S::from(f64::from(u8::from(at.is_multiple_of(n + 1))))).collect()
}

/// `A P A'`.
fn congruent<S: Scalar>(n: usize, a: &[S], p: &[S]) -> Vec<S> {
    let moved = product(n, a, p);
    (0..n * n).map(|at| (0..n).map(|k| moved[at / n * n + k] * a[at % n * n + k]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;

    /// `x' = f x + w`, measured once: `P^2 + P (r (1 - f^2) - q) - q r = 0`, of a stable, an integrating and an unstable state, and of measurements that are
    /// hardly noisy and hardly anything else. Slopes are those of the root.
    #[test]
    fn of_one_state() {
        let root = |[f, q, r]: [Dual<3>; 3]| {
            let b = r * (f * f - 1.0) + q;
            let root = (b * b + q * r * 4.0).sqrt();
            // Without cancelling.
            if b.value > 0.0 { (b + root) * 0.5 } else { q * r * 2.0 / (root - b) }
        };
        for (f, q, r) in [(0.7, 0.2, 0.5), (1.0, 0.2, 0.5), (1.3, 0.01, 0.5), (0.99, 1.0, 1e-8), (0.9, 1e-8, 1.0)] {
            let [f, q, r] = [(f, 0), (q, 1), (r, 2)].map(|(value, lane)| Dual::<3>::variable(value, lane));
            let filter = |f: Dual<3>, q: Dual<3>, r: Dual<3>| {
                let sensors = vec![Sensor { slopes: vec![Dual::from(2.0)], variance: r * 4.0 }];
                Filter { n: 1, kept: vec![f], added: vec![q], sensors }
            };
            let exact = root([f, q, r]);
            let found = values(&filter(f, q, r)).settled().unwrap();
            let [covariance, variances] = filter(f, q, r).about(&found);
            // Rounding of the few products of a sample, times the samples that are remembered: up to 10,000 here.
            assert!((covariance[0].value / exact.value - 1.0).abs() < 1e-12, "{} {}", covariance[0].value, exact.value);
            let variance = exact * 4.0 + r * 4.0;
            for (found, exact) in [(covariance[0], exact), (variances[0], variance)] {
                for ((found, slope), p) in found.slopes.iter().zip(exact.slopes).zip([f, q, r]) {
                    let size = slope.abs().max(exact.value / p.value);
                    assert!((found - slope).abs() < 1e-11 * size, "{f:?} {q:?}: {found} {slope}");
                }
            }
        }
    }

    fn values<S: Scalar>(filter: &Filter<S>) -> Filter<f64> {
        let all = |of: &[S]| of.iter().map(Scalar::value).collect::<Vec<f64>>();
        let sensor = |sensor: &Sensor<S>| Sensor { slopes: all(&sensor.slopes), variance: sensor.variance.value() };
        let sensors = filter.sensors.iter().map(sensor).collect();
        Filter { n: filter.n, kept: all(&filter.kept), added: all(&filter.added), sensors }
    }

    /// Three states in units a million apart, two of them disturbed, the third fed by neither, and two sensors: what 2,000 samples lead to from nothing. The
    /// third stays known.
    #[test]
    fn of_states_in_other_units_as_by_many_samples() {
        let unit = [1e3, 1.0, 1e-3];
        let in_units = |of: [[f64; 3]; 3]| (0..9).map(|at| of[at / 3][at % 3] * unit[at / 3] / unit[at % 3]).collect();
        let squares = |of: [[f64; 3]; 3]| (0..9).map(|at| of[at / 3][at % 3] * unit[at / 3] * unit[at % 3]).collect();
        let sensor = |c: [f64; 3], variance: f64| Sensor { slopes: (0..3).map(|i| c[i] / unit[i]).collect(), variance };
        let filter = Filter {
            n: 3,
            kept: in_units([[0.9, 0.2, 0.1], [-0.1, 0.95, 0.3], [0.0, 0.0, 0.999]]),
            added: squares([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0; 3]]),
            sensors: vec![sensor([1.0, 0.0, 0.5], 0.01), sensor([0.3, 1.0, 0.0], 4.0)],
        };
        let found = filter.settled().unwrap();
        let right = (0..2_000).fold(vec![0.0; 9], |p, _| filter.next(&p).covariance);
        for at in 0..9 {
            let size = (right[at / 3 * 4] * right[at % 3 * 4]).sqrt();
            assert!((found[at] - right[at]).abs() <= 1e-13 * size, "{at}: {} {}", found[at], right[at]);
        }
        assert!([2, 5, 6, 7, 8].iter().all(|at| found[*at] == 0.0));
    }

    /// Three states, of which each becomes the next one and the last a third of the first: no power has an entry beside its mirror image. `P_1 = q + P_2`,
    /// `P_2 = q + P_3`, `P_3 = q + k^2 P_1`, which is `P_1 = 3 q / (1 - k^2)`, with its slope.
    #[test]
    fn of_a_cycle_of_states() {
        let (k, q) = (Dual::<1>::variable(1.0 / 3.0, 0), Dual::from(0.2));
        let [zero, one] = [0.0, 1.0].map(Dual::from);
        let filter = Filter {
            n: 3,
            kept: vec![zero, one, zero, zero, zero, one, k, zero, zero],
            added: vec![q, zero, zero, zero, q, zero, zero, zero, q],
            sensors: vec![],
        };
        let [found, _] = filter.about(&values(&filter).settled().unwrap());
        let exact = q * 3.0 / (-(k * k) + 1.0);
        assert!(
            (found[0].value / exact.value - 1.0).abs() < 1e-14
                && (found[0].slopes[0] / exact.slopes[0] - 1.0).abs() < 1e-14
        );
    }

    /// A state that grows, or adds up its noise, and is not measured. After a measurement without noise what a sample adds is left.
    #[test]
    fn what_does_not_settle() {
        let filter = |kept: f64, slope: f64, variance: f64| {
            let sensors = vec![Sensor { slopes: vec![slope], variance }];
            Filter { n: 1, kept: vec![kept], added: vec![0.1], sensors }.settled()
        };
        assert!(filter(0.9, 0.0, 1.0).is_some() && filter(1.1, 1.0, 1.0).is_some());
        assert_eq!(filter(0.9, 1.0, 0.0), Some(vec![0.1]));
        assert!([filter(1.0, 0.0, 1.0), filter(1.1, 0.0, 1.0), filter(f64::NAN, 1.0, 1.0)].iter().all(Option::is_none));
    }
}
