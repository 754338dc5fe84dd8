//! Checks for the tests of those who write losses, models and integrators of their own.

use crate::loss::Loss;

/// What does not hold, with the place and the numbers.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Disagreement {
    /// A loss that breaks its law.
    #[error("the loss breaks its law at z = {z}: {law}: {found} against {expected}")]
    Loss {
        /// What should hold.
        law: &'static str,
        /// The standardized error.
        z: f64,
        /// What the loss says.
        found: f64,
        /// What it should be.
        expected: f64,
    },
}

/// Whether a loss keeps the law of [`Loss`]: even, zero at zero, `z^2 / 2` near it, never falling, `psi` its derivative,
/// `weight` and `slope` in agreement with `psi`. Looked at in 400 places up to |z| = 40, to 1e-5.
///
/// # Errors
/// The first [`Disagreement`].
pub fn loss(loss: &dyn Loss) -> Result<(), Disagreement> {
    let agree = |law, z, found: f64, expected: f64| {
        if (found - expected).abs() <= 1e-5 * (1.0 + expected.abs()) {
            return Ok(());
        }
        Err(Disagreement::Loss { law, z, found, expected })
    };
    agree("rho(0) is 0", 0.0, loss.rho(0.0), 0.0)?;
    agree("the weight at 0 is 1", 0.0, loss.weight(0.0), 1.0)?;
    agree("rho is z^2/2 near 0", 1e-4, loss.rho(1e-4) / 1e-8, 0.5)?;
    agree("psi is z near 0", 1e-4, loss.psi(1e-4) / 1e-4, 1.0)?;
    // An irrational spacing, which does not meet a kink at a round number.
    for k in 1..=400 {
        let z = k as f64 * (0.01 * core::f64::consts::PI.powi(2));
        let h = 1e-6 * z.max(1.0);
        let difference = |f: &dyn Fn(f64) -> f64| (f(z + h) - f(z - h)) / ((z + h) - (z - h));
        agree("rho is even", z, loss.rho(-z), loss.rho(z))?;
        agree("psi is odd", z, loss.psi(-z), -loss.psi(z))?;
        agree("psi is the derivative of rho", z, loss.psi(z), difference(&|z| loss.rho(z)))?;
        agree("slope is the derivative of psi", z, loss.slope(z), difference(&|z| loss.psi(z)))?;
        agree("weight is psi/z", z, loss.weight(z), loss.psi(z) / z)?;
        agree("rho does not fall", z, loss.psi(z).min(0.0), 0.0)?;
    }
    Ok(())
}
