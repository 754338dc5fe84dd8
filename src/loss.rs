//! [`Loss`]: how much an error costs, from squared to robust.
//!
//! A loss acts on the standardized error `z = (y - y_hat) / sigma`. The constants that tune the robust ones give 95 % of
//! the efficiency of least squares on Gaussian noise (P. W. Holland, R. E. Welsch, "Robust regression using iteratively
//! reweighted least-squares", Communications in Statistics A6, 1977, 813-827, table 1).

use crate::error::Error;
use core::fmt::Debug;
use serde::{Deserialize, Serialize};

/// The cost of a standardized error.
///
/// Requirements: `rho` is even, zero at zero, never falls with `|z|`, and behaves as `z^2 / 2` near zero;
/// [`check::loss`](crate::check::loss) tests it. A new loss writes `rho` and `psi`:
///
/// ```
/// use greybox::Loss;
/// /// Welsch's loss, which forgets what is far out.
/// #[derive(Debug)]
/// struct Welsch(f64);
/// impl Loss for Welsch {
///     fn rho(&self, z: f64) -> f64 { self.0 * self.0 / 2.0 * -(-(z / self.0).powi(2)).exp_m1() }
///     fn psi(&self, z: f64) -> f64 { z * (-(z / self.0).powi(2)).exp() }
/// }
/// greybox::check::loss(&Welsch(2.985)).unwrap();
/// ```
pub trait Loss: Debug + Send + Sync {
    /// The cost of the error `z`.
    fn rho(&self, z: f64) -> f64;

    /// Its derivative, the influence of an error on the estimate.
    fn psi(&self, z: f64) -> f64;

    /// `psi(z) / z`, one at zero: the weight of the error in iteratively reweighted least squares.
    fn weight(&self, z: f64) -> f64 {
        if z == 0.0 { 1.0 } else { self.psi(z) / z }
    }

    /// The derivative of `psi`. Left unwritten: central differences, right to 1e-9 away from a kink and the mean of the
    /// two sides on it.
    fn slope(&self, z: f64) -> f64 {
        let h = f64::EPSILON.cbrt() * z.abs().max(1.0);
        (self.psi(z + h) - self.psi(z - h)) / ((z + h) - (z - h))
    }

    /// Variance of the least squares estimate over that of this loss, with Gaussian noise: `E[psi']^2 / E[psi^2]`, right to
    /// 1e-10.
    fn efficiency(&self) -> f64 {
        expectation(&|z| z * self.psi(z)).powi(2) / expectation(&|z| self.psi(z).powi(2))
    }

    /// Whether the tuning constants make sense.
    ///
    /// # Errors
    /// The constant and its value.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Name and tuning constants, for reports.
    fn describe(&self) -> String {
        format!("{self:?}")
    }
}

/// Squared up to the tuning constant, a straight line beyond (P. J. Huber, Annals of Mathematical Statistics 35, 1964,
/// 73-101). Convex: it adds no minima of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Huber(pub f64);

impl Default for Huber {
    /// 1.345: 95 % efficiency.
    fn default() -> Self {
        Huber(1.345)
    }
}

impl Loss for Huber {
    fn rho(&self, z: f64) -> f64 {
        if z.abs() <= self.0 { z * z / 2.0 } else { self.0 * (z.abs() - self.0 / 2.0) }
    }
    fn psi(&self, z: f64) -> f64 {
        if z.abs() > self.0 { self.0.copysign(z) } else { z }
    }
    fn slope(&self, z: f64) -> f64 {
        if z.abs() > self.0 { 0.0 } else { 1.0 }
    }
    fn check(&self) -> Result<(), Error> {
        positive("Huber", self.0)
    }
}

/// `rho = c^2 (sqrt(1 + (z/c)^2) - 1)`: Huber's loss without its kink (also called pseudo-Huber; P. Charbonnier et al.,
/// IEEE Transactions on Image Processing 6, 1997, 298-311, table I). Convex.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoftL1(pub f64);

impl Default for SoftL1 {
    /// 1.287: 95 % efficiency, by [`efficiency`](Loss::efficiency).
    fn default() -> Self {
        SoftL1(1.287)
    }
}

impl Loss for SoftL1 {
    // Without the difference of near equals that the formula has at small z.
    fn rho(&self, z: f64) -> f64 {
        z / (1.0 + (z / self.0).hypot(1.0)) * z
    }
    fn psi(&self, z: f64) -> f64 {
        z / (z / self.0).hypot(1.0)
    }
    fn slope(&self, z: f64) -> f64 {
        (z / self.0).hypot(1.0).powi(-3)
    }
    fn check(&self) -> Result<(), Error> {
        positive("SoftL1", self.0)
    }
}

/// `rho = c^2/2 ln(1 + (z/c)^2)`: the likelihood of Cauchy noise (Holland and Welsch 1977). Not convex: start near.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cauchy(pub f64);

impl Default for Cauchy {
    /// 2.385: 95 % efficiency.
    fn default() -> Self {
        Cauchy(2.385)
    }
}

impl Loss for Cauchy {
    fn rho(&self, z: f64) -> f64 {
        self.0 * self.0 / 2.0 * (z / self.0).powi(2).ln_1p()
    }
    fn psi(&self, z: f64) -> f64 {
        z / (1.0 + (z / self.0).powi(2))
    }
    fn slope(&self, z: f64) -> f64 {
        let q = (z / self.0).powi(2);
        (1.0 - q) / (1.0 + q) / (1.0 + q)
    }
    fn check(&self) -> Result<(), Error> {
        positive("Cauchy", self.0)
    }
}

/// Tukey's biweight: what lies beyond the tuning constant has no influence at all (A. E. Beaton, J. W. Tukey,
/// Technometrics 16, 1974, 147-185). Not convex: start from a Huber fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tukey(pub f64);

impl Default for Tukey {
    /// 4.685: 95 % efficiency.
    fn default() -> Self {
        Tukey(4.685)
    }
}

impl Loss for Tukey {
    fn rho(&self, z: f64) -> f64 {
        if z.abs() > self.0 {
            return self.0 * self.0 / 6.0;
        }
        let q = (z / self.0).powi(2);
        z * z / 6.0 * (3.0 - 3.0 * q + q * q)
    }
    fn psi(&self, z: f64) -> f64 {
        if z.abs() > self.0 { 0.0 } else { z * (1.0 - (z / self.0).powi(2)).powi(2) }
    }
    fn slope(&self, z: f64) -> f64 {
        let q = (z / self.0).powi(2);
        if z.abs() > self.0 { 0.0 } else { (1.0 - q) * (1.0 - 5.0 * q) }
    }
    fn check(&self) -> Result<(), Error> {
        positive("Tukey", self.0)
    }
}

fn positive(loss: &str, value: f64) -> Result<(), Error> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(Error::NotPositive { what: format!("the tuning constant of the loss {loss}"), value })
}

/// `E[psi']` of standard Gaussian errors, right to 1e-10: the curvature of the expected cost.
///
/// It is taken as `E[z psi]`, which is the same (C. Stein, Annals of Statistics 9, 1981, lemma 1) and needs no derivative
/// where `psi` has a kink.
pub(crate) fn expected_slope(loss: &dyn Loss) -> f64 {
    expectation(&|z| z * loss.psi(z))
}

/// The expectation of a function of a standard normal number.
fn expectation(f: &dyn Fn(f64) -> f64) -> f64 {
    let density = |z: f64| (-z * z / 2.0).exp() / core::f64::consts::TAU.sqrt();
    let integrand = |z: f64| (f(z) + f(-z)) * density(z);
    // Beyond 12 standard deviations is less than 1e-30.
    (0..48).map(|i| simpson(&integrand, 0.25 * i as f64, 0.25, 1e-13, 30)).sum()
}

/// Adaptive Simpson quadrature over `from..from + width`.
fn simpson(f: &dyn Fn(f64) -> f64, from: f64, width: f64, tolerance: f64, depth: u32) -> f64 {
    let at = |fraction: f64| f(from + width * fraction);
    let (ends, quarters, middle) = (at(0.0) + at(1.0), at(0.25) + at(0.75), at(0.5));
    let coarse = width / 6.0 * (ends + 4.0 * middle);
    let fine = width / 12.0 * (ends + 4.0 * quarters + 2.0 * middle);
    if depth == 0 || (fine - coarse).abs() <= 15.0 * tolerance {
        return fine + (fine - coarse) / 15.0;
    }
    let half = width / 2.0;
    simpson(f, from, half, tolerance / 2.0, depth - 1) + simpson(f, from + half, half, tolerance / 2.0, depth - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Holland and Welsch's constants are rounded to four digits, which leaves the efficiency within 1e-4.
    #[test]
    fn the_default_tuning_is_95_percent_efficient() {
        let losses: [Box<dyn Loss>; 4] = [
            Box::new(Huber::default()),
            Box::new(SoftL1::default()),
            Box::new(Cauchy::default()),
            Box::new(Tukey::default()),
        ];
        for loss in losses {
            let efficiency = loss.efficiency();
            assert!((efficiency - 0.95).abs() < 1e-4, "{loss:?}: {efficiency}");
        }
    }

    #[test]
    fn expectations_match_closed_forms() {
        // Far beyond all errors, Huber's loss is that of least squares.
        assert_relative_eq!(expected_slope(&Huber(1e3)), 1.0, epsilon = 1e-10);
        // Huber at k = 1: E psi' = 2 Phi(1) - 1 and E psi^2 = E psi' - 2 phi(1) + 2 (1 - Phi(1)), with Phi(1) and phi(1) from
        // Abramowitz and Stegun, table 26.1.
        let (phi, density) = (0.841_344_746_068_543, 0.241_970_724_519_143);
        let huber = Huber(1.0);
        assert_relative_eq!(expected_slope(&huber), 2.0 * phi - 1.0, epsilon = 1e-10);
        let psi_squared = expectation(&|z| huber.psi(z).powi(2));
        assert_relative_eq!(psi_squared, 2.0 * phi - 1.0 - 2.0 * density + 2.0 * (1.0 - phi), epsilon = 1e-10);
    }
}
