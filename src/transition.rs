//! [`Transition`]: a state with constant slopes over an interval, exactly.

mod crossing;
mod filter;

pub(crate) use crossing::Crossing;
pub(crate) use filter::{Filter, Sensor};

use crate::scalar::Scalar;

/// `A h` of a first step is no larger than this, by the growth of its absolute values.
const SHORT: f64 = 1.0 / 16.0;
/// Terms of the series over a first step: the next one is below rounding, for covariances `(2 / 16)^11 / 11! = 3e-18`.
const TERMS: usize = 10;
/// With fewer doublings the series has a term for each product of entries along a chain of states, there and back and once more for slopes: the growth
/// of a chain of integrators is zero, however long the step, so that no doubling follows, which would supply the products that the series lacks.
const FEW: f64 = 6.0;
/// Doublings in which a stable plant must come to rest: the slowest and the fastest time constant are up to a factor of some 1e10 apart.
const DOUBLINGS: usize = 40;
/// Doublings of a first step at most: an interval is up to 1e28 times as long as the fastest time constant.
const LONGEST: f64 = 100.0;
/// A transition is at rest where all products of an entry and its mirror image are below this, and has run away where one is above its inverse.
const REST: f64 = 1e-20;

/// Over an interval `h` of `dx = (A x + b) dt + dw`: what is added to the state, `e^{Ah} - I`, which unlike `e^{Ah}` keeps the digits of slow
/// modes; what a constant `b` adds, `F(h)`, the integral of `e^{As}` over it, and what one adds that grows from zero to `b`, the integral of
/// `F(s)` by `h`; and the covariance that the noise leaves, the integral of `e^{As} Q e^{A's}`. Row by row.
pub(crate) struct Transition<S> {
    n: usize,
    length: S,
    added: Vec<S>,
    constant: Vec<S>,
    ramp: Vec<S>,
    covariance: Vec<S>,
}

/// A plant whose covariance does not come to an end.
pub(crate) struct NotStationary {
    /// The state in which this shows the most.
    pub state: usize,
    /// The logarithm by which it grows, per unit of the interval.
    pub rate: f64,
}

impl<S: Scalar> Transition<S> {
    /// Over one step of a discrete plant, `x[k+1] = a x[k] + w`; `q` is the covariance of `w`. It has no inputs.
    pub fn discrete(n: usize, mut a: Vec<S>, q: Vec<S>) -> Self {
        a.iter_mut().step_by(n + 1).for_each(|a| *a -= 1.0);
        let none = vec![S::from(0.0); n * n];
        Transition { n, length: S::from(1.0), added: a, constant: none.clone(), ramp: none, covariance: q }
    }

    /// Over an interval; by the series of all four over a part of it that is short, which is then doubled (C. F. Van Loan, IEEE Transactions
    /// on Automatic Control 23 (1978) 395-404, without the exponential of `-A`, which overflows where the plant is stiff). Not a number where
    /// the interval is too long for that.
    pub fn over(n: usize, a: &[S], q: &[S], h: S) -> Self {
        let values: Vec<f64> = a.iter().map(Scalar::value).collect();
        let halvings = (growth(n, &values) * h.value() / SHORT).log2().ceil().max(0.0);
        let short = if halvings <= LONGEST { h * (-halvings).exp2() } else { S::from(f64::NAN) };
        let ah: Vec<S> = a.iter().map(|a| *a * short).collect();
        let (mut power, mut added) = (ah.clone(), ah.clone());
        let first = |k: usize| move |at: usize| S::from(f64::from(u8::from(at.is_multiple_of(n + 1))) / k as f64);
        let (mut constant, mut ramp): (Vec<S>, Vec<S>) =
            ((0..n * n).map(first(1)).collect(), (0..n * n).map(first(2)).collect());
        let mut term: Vec<S> = q.iter().map(|q| *q * short).collect();
        let mut covariance = term.clone();
        let terms = if halvings < FEW { TERMS.max(3 * n) } else { TERMS };
        for k in 2..=terms + 1 {
            // The term before this one, divided by the next numbers.
            constant.iter_mut().zip(&power).for_each(|(sum, term)| *sum += *term / k as f64);
            ramp.iter_mut().zip(&power).for_each(|(sum, term)| *sum += *term / (k * (k + 1)) as f64);
            power = product(n, &ah, &power).iter().map(|entry| *entry / k as f64).collect();
            let turned = product(n, &ah, &term);
            term = (0..n * n).map(|at| (turned[at] + turned[at % n * n + at / n]) / k as f64).collect();
            added.iter_mut().zip(&power).for_each(|(sum, term)| *sum += *term);
            covariance.iter_mut().zip(&term).for_each(|(sum, term)| *sum += *term);
        }
        constant.iter_mut().chain(&mut ramp).for_each(|entry| *entry *= short);
        let mut transition = Transition { n, length: short, added, constant, ramp, covariance };
        (0..halvings.min(LONGEST) as usize).for_each(|_| transition.double());
        transition
    }

    /// Over an interval that begins with a jump of the state by these slopes.
    pub fn after(mut self, jump: &[S]) -> Self {
        let n = self.n;
        // (I + D) J - I, where D keeps the digits of slow modes.
        let moved = product(n, &self.added, jump);
        let unit = |at: usize| f64::from(u8::from(at.is_multiple_of(n + 1)));
        self.added = (0..n * n).map(|at| moved[at] + (jump[at] - unit(at))).collect();
        self
    }

    /// The covariance that the noise of a continuous plant leaves in the end.
    pub fn at_rest(n: usize, a: &[S], q: &[S]) -> Result<Vec<S>, NotStationary> {
        let values: Vec<f64> = a.iter().map(Scalar::value).collect();
        let growth = growth(n, &values);
        // Without any, nothing decays.
        let short = if growth > 0.0 { SHORT / growth } else { 1.0 };
        let rate = |NotStationary { state, rate }| NotStationary { state, rate: rate / short };
        Transition::over(n, a, q, S::from(short)).stationary().map_err(rate)
    }

    /// The covariance after so many such intervals that it changes no more.
    pub fn stationary(mut self) -> Result<Vec<S>, NotStationary> {
        let n = self.n;
        let mut doublings = 0;
        let kept = loop {
            let kept = |i: usize, j: usize| self.added[i * n + j].value() + f64::from(u8::from(i == j));
            let largest = (0..n * n).map(|at| (kept(at / n, at % n) * kept(at % n, at / n)).abs());
            let largest = largest.fold(0.0, f64::max);
            // A nilpotent part vanishes after at most `n` intervals; its products are zero from the first one on.
            if largest <= REST && 1 << doublings >= n {
                // Slopes decay as the transition does, times the number of intervals.
                (0..2).for_each(|_| self.double());
                return Ok(self.covariance);
            }
            if doublings == DOUBLINGS || largest >= REST.recip() {
                break (0..n).map(|i| kept(i, i).abs()).collect::<Vec<f64>>();
            }
            self.double();
            doublings += 1;
        };
        // The diagonal of a power is the part that each state takes in the modes that are left, whatever its unit.
        let state = (0..n).fold(0, |most, i| if kept[i] > kept[most] { i } else { most });
        let rate = kept[state].max(f64::MIN_POSITIVE).ln() / (doublings as f64).exp2();
        Err(NotStationary { state, rate })
    }

    /// What is left of the state, `e^{Ah}`.
    pub fn kept(self) -> Vec<S> {
        with_unit(self.n, self.added)
    }

    /// The covariance that the noise leaves.
    pub fn covariance(self) -> Vec<S> {
        self.covariance
    }

    /// What happens to a state and its covariance.
    pub fn crossing(self) -> Crossing<S> {
        let Transition { n, added, constant, ramp, covariance, .. } = self;
        let all = |entries: Vec<S>| entries.into_iter().map(Some).collect();
        Crossing {
            n,
            kept: all(with_unit(n, added)),
            constant: all(constant),
            ramp: all(ramp),
            covariance: all(covariance),
        }
    }

    /// Twice the interval.
    fn double(&mut self) {
        let Transition { n, length, added, constant, ramp, covariance } = self;
        let n = *n;
        *length *= 2.0;
        let (of_constant, of_ramp) = (product(n, added, constant), product(n, constant, constant));
        ramp.iter_mut().zip(of_ramp).for_each(|(ramp, square)| *ramp += square / *length);
        constant.iter_mut().zip(of_constant).for_each(|(constant, moved)| *constant = *constant * 2.0 + moved);
        let moved = product(n, added, covariance);
        // D P D'
        let twice = |at: usize| (0..n).map(|k| moved[at / n * n + k] * added[at % n * n + k]).sum::<S>();
        let spread = |at: usize| moved[at] + moved[at % n * n + at / n] + twice(at);
        *covariance = (0..n * n).map(|at| covariance[at] * 2.0 + spread(at)).collect();
        let square = product(n, added, added);
        added.iter_mut().zip(square).for_each(|(added, square)| *added = *added * 2.0 + square);
    }
}

/// `I + D`.
fn with_unit<S: Scalar>(n: usize, mut added: Vec<S>) -> Vec<S> {
    added.iter_mut().step_by(n + 1).for_each(|entry| *entry += 1.0);
    added
}

/// The covariance of independent noises with these levels, row by row.
pub(crate) fn squares<S: Scalar>(levels: &[S]) -> Vec<S> {
    let n = levels.len();
    let mut square = vec![S::from(0.0); n * n];
    square.iter_mut().step_by(n + 1).zip(levels).for_each(|(square, level)| *square = *level * *level);
    square
}

fn product<S: Scalar>(n: usize, a: &[S], b: &[S]) -> Vec<S> {
    (0..n * n).map(|at| (0..n).map(|k| a[at / n * n + k] * b[k * n + at % n]).sum()).collect()
}

/// How fast the powers of a matrix of absolute values grow; units of the states matter little to it.
fn growth(n: usize, a: &[f64]) -> f64 {
    const SQUARINGS: i32 = 6;
    let mut power: Vec<f64> = a.iter().map(|a| a.abs()).collect();
    let mut logarithm = 0.0;
    for squaring in 0..=SQUARINGS {
        let largest = power.iter().fold(0.0, |largest: f64, entry| largest.max(*entry));
        if largest == 0.0 {
            return 0.0;
        }
        logarithm += largest.ln() / f64::from(1 << squaring);
        power.iter_mut().for_each(|entry| *entry /= largest);
        if squaring < SQUARINGS {
            power = product(n, &power, &power);
        }
    }
    f64::exp(logarithm)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fast state that follows a slow one, `dx = (z - x) l dt + dv`, `dz = -m z dt + dw` with 20 s and two days, in units a million apart. At
    /// rest `P_zz = 1 / 2m`, `P_xz = l P_zz / (l + m)`, `P_xx = P_xz + 1 / 2l`; over an interval from nothing `P_zz (1 - e^{-2mh})`, and
    /// `x` is at rest but for what `z` is short of.
    #[test]
    fn of_time_constants_four_decades_apart() {
        let (l, m, unit) = (1.0 / 20.0, 1.0 / 172_800.0, 1e6);
        let a = [-l, l * unit, 0.0, -m];
        let q = [unit * unit, 0.0, 0.0, 1.0];
        let zz = 0.5 / m;
        let xz = l * zz / (l + m);
        let exact = [(xz + 0.5 / l) * unit * unit, xz * unit, xz * unit, zz];
        let found = Transition::at_rest(2, &a, &q).ok().unwrap();
        for (found, exact) in found.iter().zip(exact) {
            // Some 25 doublings, whose roundings add up. What is left of slow modes beside `e^{Ah}` itself has 12 digits less the 4 decades.
            assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
        }
        for h in [1e-3, 1.0, 900.0, 1e6] {
            let found = Transition::over(2, &a, &q, h).covariance();
            let slow = zz * -f64::exp_m1(-2.0 * m * h);
            assert!((found[3] / slow - 1.0).abs() < 1e-12, "{h}: {} {slow}", found[3]);
            // The response of x to w is c (e^{-ms} - e^{-ls}) with c = l / (l - m).
            let c = l / (l - m);
            let part = |rate: f64| -f64::exp_m1(-rate * h) / rate;
            let cross = c * unit * (part(2.0 * m) - part(l + m));
            // For a short interval the two parts cancel.
            let digits = 1e-12 * c * unit * part(2.0 * m) / cross;
            assert!((found[1] / cross - 1.0).abs() < digits.max(1e-12), "{h}: {} {cross}", found[1]);
        }
    }

    /// A rate that is constant, and one that grows: `F A = e^{Ah} - I` and `R A h = F - h I` whatever the plant, and for a state alone with
    /// `dx = -l x dt + ...` the integrals `(1 - e^{-lh}) / l` and `(h - F) / lh`.
    #[test]
    fn of_constant_and_of_growing_rates() {
        let (l, m, unit) = (1.0 / 20.0, 1.0 / 172_800.0, 1e6);
        let a = [-l, l * unit, 0.0, -m];
        for h in [1e-3, 1.0, 900.0, 1e6] {
            let Transition { added, constant, ramp, .. } = Transition::over(2, &a, &[0.0; 4], h);
            for (at, rate) in [(0, l), (3, m)] {
                let integral = -f64::exp_m1(-rate * h) / rate;
                assert!((constant[at] / integral - 1.0).abs() < 1e-13, "{h}: {} {integral}", constant[at]);
                // The difference of the two integrals loses the digits that the series keeps.
                let growing = if rate * h < 0.01 {
                    h * (0.5 - rate * h / 6.0 + (rate * h).powi(2) / 24.0)
                } else {
                    (h - integral) / (rate * h)
                };
                assert!((ramp[at] / growing - 1.0).abs() < 1e-8, "{h}: {} {growing}", ramp[at]);
            }
            let [of_constant, of_ramp] = [&constant, &ramp].map(|matrix| product(2, matrix, &a));
            for at in 0..4 {
                let size = |of: &[f64]| of[at].abs().max(f64::MIN_POSITIVE);
                assert!((of_constant[at] - added[at]).abs() < 1e-11 * size(&added), "{h}, {at}: {}", of_constant[at]);
                let grown = constant[at] - if at % 3 == 0 { h } else { 0.0 };
                // What is left of two numbers as large as the interval.
                assert!((of_ramp[at] * h - grown).abs() < 1e-11 * (grown.abs() + h), "{h}, {at}: {}", of_ramp[at]);
            }
        }
    }

    /// Seven integrators in a row, the last one of white noise: `x_i` after `h` is the integral of `s^m / m!` times the noise, `m = 6 - i`, so that
    /// `P_ij = h^{m+l+1} / ((m + l + 1) m! l!)`; with a leak that is slow against the interval nearly so.
    #[test]
    fn of_a_chain_of_integrators() {
        const N: usize = 7;
        let factorial = |m: usize| (1..=m).product::<usize>() as f64;
        for (leak, h, digits) in [(0.0, 1.0, 1e-13), (0.0, 100.0, 1e-13), (1e-10, 100.0, 1e-7)] {
            let mut a = [0.0; N * N];
            (0..N).for_each(|i| a[i * N + i] = -leak);
            (0..N - 1).for_each(|i| a[i * N + i + 1] = 1.0);
            let mut q = [0.0; N * N];
            q[N * N - 1] = 1.0;
            let Transition { added, constant, covariance, .. } = Transition::over(N, &a, &q, h);
            for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
                let (m, l) = (N - 1 - i, N - 1 - j);
                let exact = h.powi((m + l + 1) as i32) / ((m + l + 1) as f64 * factorial(m) * factorial(l));
                let found = covariance[i * N + j];
                assert!((found / exact - 1.0).abs() < digits, "{leak}, {h}, {i}, {j}: {found} {exact}");
            }
            for (i, j) in (0..N).flat_map(|i| (i + 1..N).map(move |j| (i, j))) {
                let power = |m: usize| h.powi(m as i32) / factorial(m);
                let found = [added[i * N + j] / power(j - i), constant[i * N + j] / power(j - i + 1)];
                assert!(found.iter().all(|found| (found - 1.0).abs() < digits), "{leak}, {h}, {i}, {j}: {found:?}");
            }
        }
    }

    /// An interval that is too long against the fastest time constant is crossed by nothing, not by a series that does not converge.
    #[test]
    fn of_intervals_that_are_too_long() {
        let end = |rate: f64| Transition::over(1, &[-rate], &[1.0], 1.0).covariance()[0];
        assert!((end(1e20) * 2e20 - 1.0).abs() < 1e-12, "{}", end(1e20));
        assert!(end(1e40).is_nan() && end(f64::INFINITY).is_nan() && end(f64::NAN).is_nan());
    }

    /// Noise that passes along a chain of eight memories stands in each of them: `P = I` of `x1 = w`, `x2 = x1`, ... at the next sample. All products of an
    /// entry and its mirror image are zero from the first step on.
    #[test]
    fn of_a_chain_that_passes_values_on() {
        const N: usize = 8;
        let (mut a, mut q) = (vec![0.0; N * N], vec![0.0; N * N]);
        q[0] = 1.0;
        (1..N).for_each(|i| a[i * N + i - 1] = 1.0);
        let found = Transition::discrete(N, a, q).stationary().ok().unwrap();
        assert!((0..N * N).all(|at| found[at] == f64::from(u8::from(at % (N + 1) == 0))), "{found:?}");
    }

    /// An interval after a jump of nothing keeps the digits of a mode of 1e5 s over 0.1 ms: at rest `P = 1 / 2m`.
    #[test]
    fn slow_modes_after_a_jump() {
        let (h, m) = (1e-4, 1e-5);
        let found = Transition::over(1, &[-m], &[1.0], h).after(&[1.0]).stationary().ok().unwrap();
        // Some thirty doublings, whose roundings add up.
        assert!((found[0] * 2.0 * m - 1.0).abs() < 1e-13, "{}", found[0]);
    }

    /// Integrators, and one that is slower than the fastest state by more than can be told, do not come to rest; nor does a growing state,
    /// whose rate is found, in steps too.
    #[test]
    fn without_rest() {
        let of = |a: [f64; 4]| {
            let Err(NotStationary { state, rate }) = Transition::at_rest(2, &a, &[1.0; 4]) else { panic!("{a:?}") };
            (state, rate)
        };
        assert_eq!(of([0.0; 4]).0, 0);
        assert_eq!(of([-1.0, 0.0, 0.0, 0.0]).0, 1);
        assert_eq!(of([0.0, 1.0, 0.0, 0.0]).0, 0);
        assert_eq!(of([-1.0, 0.0, 0.0, -1e-13]).0, 1);
        assert!(of([-1.0, 0.0, 0.0, 0.0]).1.abs() < 1e-10);
        // An undamped oscillator.
        assert!(of([0.0, 1.0, -4.0, 0.0]).1.abs() < 1e-10);
        let (state, rate) = of([-1.0, 2.0, 0.0, 0.3]);
        assert!(state == 1 && (rate / 0.3 - 1.0).abs() < 1e-12, "{state} {rate}");
        let Err(NotStationary { rate, .. }) = Transition::discrete(1, vec![1.1], vec![1.0]).stationary() else {
            panic!()
        };
        assert!((rate / 1.1f64.ln() - 1.0).abs() < 1e-12, "{rate}");
    }
}
