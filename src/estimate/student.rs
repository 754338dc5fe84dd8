//! Intervals by Student's t.
//!
//! Beyond a few thousand degrees of freedom the library's inversion loses digits, while the expansion of the quantile in
//! their inverse about the normal one (Abramowitz and Stegun 26.7.5) has more than twelve.

use crate::parameter::Transform;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

const MANY: f64 = 1000.0;

/// The value below which Student's t lies with this probability.
pub(crate) fn quantile(probability: f64, degrees: f64) -> f64 {
    let normal = Normal::standard().inverse_cdf(probability);
    if degrees > MANY {
        let (z, n) = (normal, degrees);
        let z2 = z * z;
        let first = z * (z2 + 1.0) / 4.0;
        let second = z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
        let third = z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
        let fourth = z * ((((79.0 * z2 + 776.0) * z2 + 1482.0) * z2 - 1920.0) * z2 - 945.0) / 92160.0;
        return z + (first + (second + (third + fourth / n) / n) / n) / n;
    }
    match StudentsT::new(0.0, 1.0, degrees) {
        Ok(student) => student.inverse_cdf(probability),
        // No degree of freedom: nothing is known.
        Err(_) => f64::INFINITY,
    }
}

/// The probability that Student's t is as far from zero; one where that is not defined.
pub(crate) fn two_sided(t: f64, degrees: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, degrees) {
        Ok(student) if t.is_finite() && degrees >= 1.0 => 2.0 * student.sf(t.abs()),
        _ => 1.0,
    }
}

/// How far an estimate scatters in the coordinate that it was estimated in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub standard_error: f64,
    /// Degrees of freedom of that standard error.
    pub degrees: f64,
}

impl Spread {
    /// Half the width of the two-sided interval, in coordinates.
    pub fn reach(&self, probability: f64) -> f64 {
        quantile(0.5 + probability / 2.0, self.degrees) * self.standard_error
    }

    /// The two-sided interval about a coordinate.
    pub fn interval(&self, center: f64, transform: Transform, probability: f64) -> (f64, f64) {
        let reach = self.reach(probability);
        (transform.to_value(center - reach), transform.to_value(center + reach))
    }
}

#[cfg(test)]
mod tests {
    use super::quantile;

    /// Quantiles to 12 digits from tables and multiple-precision inversion; both branches and where they meet.
    #[test]
    fn quantiles_match_reference() {
        for (probability, degrees, expected) in [
            (0.975, 1.0, 12.706_204_736_174_7),
            (0.975, 10.0, 2.228_138_851_986_27),
            (0.975, 1e12, 1.959_963_984_540_05),
        ] {
            let found = quantile(probability, degrees);
            // Nine digits: what the library's inversion guarantees at few degrees.
            assert!((found / expected - 1.0).abs() < 1e-9, "{probability} {degrees}: {found} {expected}");
        }
        let step = quantile(0.975, 1000.0 * (1.0 + 1e-12)) / quantile(0.975, 1000.0) - 1.0;
        assert!(step.abs() < 1e-9, "the branches differ by {step}");
    }
}
