//! [`Transition`]: a state with constant slopes over an interval, exactly.

use crate::scalar::Scalar;

/// `A h` of a first step is no larger than this, by the growth of its absolute values.
const SHORT: f64 = 1.0 / 16.0;
/// Terms of the series over a first step: the next one is below rounding, for covariances `(2 / 16)^11 / 11! = 3e-18`.
const TERMS: usize = 10;
/// Doublings in which a stable plant must come to rest: the slowest and the fastest time constant are up to a factor of some 1e10 apart.
const DOUBLINGS: usize = 40;
/// A transition is at rest where all products of an entry and its mirror image are below this, and has run away where one is above its inverse.
const REST: f64 = 1e-20;

/// Over an interval `h` of `dx = A x dt + dw`: what is added to the state, `e^{Ah} - I`, which unlike `e^{Ah}` keeps the digits of slow
/// modes, and the covariance that the noise leaves, the integral of `e^{As} Q e^{A's}` over it. Row by row.
pub(crate) struct Transition<S> {
    n: usize,
    added: Vec<S>,
    covariance: Vec<S>,
}

/// A plant that does not come to rest.
pub(crate) struct Restless {
    /// The state in which this shows the most.
    pub state: usize,
    /// The logarithm by which it grows, per unit of the interval.
    pub rate: f64,
}

impl<S: Scalar> Transition<S> {
    /// Over one step of a discrete plant, `x[k+1] = a x[k] + w`; `q` is the covariance of `w`.
    pub fn discrete(n: usize, mut a: Vec<S>, q: Vec<S>) -> Self {
        a.iter_mut().step_by(n + 1).for_each(|a| *a -= 1.0);
        Transition { n, added: a, covariance: q }
    }

    /// Over an interval; by the series of both over a part of it that is short, which is then doubled (C. F. Van Loan, IEEE Transactions
    /// on Automatic Control 23 (1978) 395-404, without the exponential of `-A`, which overflows where the plant is stiff).
    pub fn over(n: usize, a: &[S], q: &[S], h: S) -> Self {
        let values: Vec<f64> = a.iter().map(Scalar::value).collect();
        let halvings = (growth(n, &values) * h.value() / SHORT).log2().ceil().clamp(0.0, DOUBLINGS as f64);
        let short = h * (-halvings).exp2();
        let ah: Vec<S> = a.iter().map(|a| *a * short).collect();
        let (mut power, mut added) = (ah.clone(), ah.clone());
        let mut term: Vec<S> = q.iter().map(|q| *q * short).collect();
        let mut covariance = term.clone();
        for k in 2..=TERMS + 1 {
            power = product(n, &ah, &power).iter().map(|entry| *entry / k as f64).collect();
            let turned = product(n, &ah, &term);
            term = (0..n * n).map(|at| (turned[at] + turned[at % n * n + at / n]) / k as f64).collect();
            added.iter_mut().zip(&power).for_each(|(sum, term)| *sum += *term);
            covariance.iter_mut().zip(&term).for_each(|(sum, term)| *sum += *term);
        }
        let mut transition = Transition { n, added, covariance };
        (0..halvings as usize).for_each(|_| transition.double());
        transition
    }

    /// The covariance that the noise of a continuous plant leaves in the end.
    pub fn at_rest(n: usize, a: &[S], q: &[S]) -> Result<Vec<S>, Restless> {
        let values: Vec<f64> = a.iter().map(Scalar::value).collect();
        let growth = growth(n, &values);
        // Without any, nothing decays.
        let short = if growth > 0.0 { SHORT / growth } else { 1.0 };
        let rate = |Restless { state, rate }| Restless { state, rate: rate / short };
        Transition::over(n, a, q, S::from(short)).forever().map_err(rate)
    }

    /// The covariance after as many such intervals as the plant takes to come to rest.
    pub fn forever(mut self) -> Result<Vec<S>, Restless> {
        let n = self.n;
        let mut doublings = 0;
        let kept = loop {
            let kept = |i: usize, j: usize| self.added[i * n + j].value() + f64::from(u8::from(i == j));
            let largest = (0..n * n).map(|at| (kept(at / n, at % n) * kept(at % n, at / n)).abs());
            let largest = largest.fold(0.0, f64::max);
            if largest <= REST {
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
        Err(Restless { state, rate })
    }

    /// The covariance that the noise leaves.
    pub fn covariance(self) -> Vec<S> {
        self.covariance
    }

    /// Twice the interval.
    fn double(&mut self) {
        let Transition { n, added, covariance } = self;
        let n = *n;
        let moved = product(n, added, covariance);
        // D P D'
        let twice = |at: usize| (0..n).map(|k| moved[at / n * n + k] * added[at % n * n + k]).sum::<S>();
        let spread = |at: usize| moved[at] + moved[at % n * n + at / n] + twice(at);
        *covariance = (0..n * n).map(|at| covariance[at] * 2.0 + spread(at)).collect();
        let square = product(n, added, added);
        added.iter_mut().zip(square).for_each(|(added, square)| *added = *added * 2.0 + square);
    }
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

    /// Integrators, and one that is slower than the fastest state by more than can be told, do not come to rest; nor does a growing state,
    /// whose rate is found, in steps too.
    #[test]
    fn without_rest() {
        let of = |a: [f64; 4]| {
            let Err(Restless { state, rate }) = Transition::at_rest(2, &a, &[1.0; 4]) else { panic!("{a:?}") };
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
        let Err(Restless { rate, .. }) = Transition::discrete(1, vec![1.1], vec![1.0]).forever() else { panic!() };
        assert!((rate / 1.1f64.ln() - 1.0).abs() < 1e-12, "{rate}");
    }
}
