//! Standard errors where moving sums and stationary errors differ.

/// The standard error to report relative to that of the moving sums, from that of stationary errors relative to the same: the
/// latter, unless the variance of the moving sums exceeds it by more than the part `certain`. Between three quarters and five
/// quarters of that part the variance is interpolated, so that no jump makes rounding decide.
pub(crate) fn joined(ratio: f64, certain: f64) -> f64 {
    let square = ratio * ratio;
    match 1.0 / square - 1.0 {
        excess if !(ratio.is_finite() && certain.is_finite()) || excess.is_nan() => 1.0,
        _ if certain == 0.0 => ratio.max(1.0),
        excess => {
            let sums = (2.0 * excess / certain - 1.5).clamp(0.0, 1.0);
            (sums + (1.0 - sums) * square).sqrt()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand, with a part of a fifth: an excess of a tenth is not certain, one of a half is; at a fifth it is the root of the mean
    /// variance, with no jump on either side. Larger errors of stationary ones are taken, and those that are no numbers are not.
    #[test]
    fn errors_of_either_kind_join() {
        let of = |excess: f64| joined((1.0 + excess).sqrt().recip(), 0.2);
        assert!((of(0.1) - 1.1f64.sqrt().recip()).abs() < 1e-15);
        assert_eq!(of(0.5), 1.0);
        assert!((of(0.2) - (0.5 + 0.5 / 1.2f64).sqrt()).abs() < 1e-15);
        for at in [0.15, 0.25] {
            assert!((of(at + 1e-9) - of(at - 1e-9)).abs() < 1e-8);
        }
        assert!((joined(1.3, 0.2) - 1.3).abs() < 1e-15 && joined(0.9, 0.0) == 1.0 && joined(1.1, 0.0) == 1.1);
        assert_eq!([joined(f64::NAN, 0.2), joined(f64::INFINITY, 0.2), joined(0.0, 0.2)], [1.0; 3]);
        assert_eq!(joined(0.5, f64::NAN), 1.0);
    }
}
