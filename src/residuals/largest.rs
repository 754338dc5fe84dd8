//! The largest error of an output, tested against the largest of as many normal ones.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// An error, and where it is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Largest {
    pub error: f64,
    pub experiment: usize,
    pub sample: usize,
}

impl Largest {
    /// Adds errors of an experiment from this sample on, zero where missing.
    pub fn add(&mut self, errors: &[f64], experiment: usize, begin: usize) {
        let most = errors.iter().fold(0.0f64, |most, error| most.max(error.abs()));
        if most > self.error.abs()
            && let Some(k) = errors.iter().position(|error| error.abs() == most)
        {
            *self = Largest { error: errors[k], experiment, sample: begin + k };
        }
    }

    /// The larger of both; of equal ones this.
    pub fn or(self, other: Largest) -> Largest {
        if other.error.abs() > self.error.abs() { other } else { self }
    }
}

/// The probability that one of `count` normal errors with this root mean square is as large: Bonferroni's bound with the error
/// divided by the deviation of all others (Grubbs, Annals of Mathematical Statistics 21 (1950) 27).
pub(crate) fn chance(error: f64, rmse: f64, count: f64) -> (f64, f64) {
    let others = ((count * rmse * rmse - error * error) / (count - 1.0)).max(0.0).sqrt();
    let ratio = error.abs() / others;
    let tail = StudentsT::new(0.0, 1.0, count - 1.0).map_or(1.0, |student| student.sf(ratio));
    (ratio, (2.0 * count * tail).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of ten million normal errors the largest is above 6.3 standard deviations with probability 3e-3, above 7 with 2.6e-5 (twice
    /// the normal tail, 1.280e-12, times their number). An error beside zeros only has a probability of zero.
    #[test]
    fn the_largest_of_many_errors() {
        let n = 1e7;
        let (ratio, p) = chance(7.0, 1.0, n);
        assert!((ratio - 7.0).abs() < 1e-4 && (p / (2.0 * n * 1.2798e-12) - 1.0).abs() < 1e-3, "{ratio} {p}");
        assert!(chance(6.3, 1.0, n).1 > 1e-3);
        assert_eq!(chance(2.0, 1.0, 4.0).1, 0.0);
        // Three times the others, of four: beyond 3 and -3 is 2 (1/2 - (sqrt(3)/4 + pi/3) / pi) of Student's t with three degrees.
        let (ratio, p) = chance(-3.0, 3f64.sqrt(), 4.0);
        assert!((ratio - 3.0).abs() < 1e-14 && (p - 4.0 * 0.057_668_9).abs() < 1e-6, "{ratio} {p}");
        let mut largest = Largest::default();
        largest.add(&[0.0, -2.0, 1.0], 0, 10);
        largest.add(&[2.0, 0.5], 1, 0);
        assert_eq!((largest.error, largest.experiment, largest.sample), (-2.0, 0, 11));
        let other = Largest { error: 3.0, experiment: 1, sample: 7 };
        assert_eq!(largest.or(other).sample, 7);
        assert_eq!(other.or(largest).sample, 7);
    }
}
