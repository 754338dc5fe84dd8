//! [`UdFactors`]: a covariance of `N` quantities, kept as `P = U D U^T` with `U` unit upper triangular.
//!
//! In this form (G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977) variances cannot turn
//! negative by rounding: a measurement multiplies each entry of `D` by a factor between 0 and 1, a prediction sums
//! squares. Neither takes a square root or allocates.

use nalgebra::SMatrix;

/// The factors of the covariance of `N` quantities. A quantity whose variance is zero is known exactly and is left alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UdFactors<const N: usize> {
    u: [[f64; N]; N],
    d: [f64; N],
}

/// Gain of one scalar measurement: see [`UdFactors::absorb`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeasurementGain<const N: usize> {
    /// Correction of each quantity per unit of innovation.
    pub gain: [f64; N],
    /// Variance of the innovation, `h P h^T + r`.
    pub variance: f64,
}

#[expect(clippy::needless_range_loop, reason = "matrix algebra is written in indices")]
impl<const N: usize> UdFactors<N> {
    /// Independent quantities with these variances (negative ones count as zero).
    pub fn diagonal(variances: [f64; N]) -> Self {
        let mut u = [[0.0; N]; N];
        for (i, row) in u.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        UdFactors { u, d: variances.map(|v| if v > 0.0 { v } else { 0.0 }) }
    }

    /// Variance of quantity `i`; zero for `i >= N`.
    #[inline]
    pub fn variance(&self, i: usize) -> f64 {
        let Some(row) = self.u.get(i) else { return 0.0 };
        let mut sum = 0.0;
        for k in 0..N {
            sum += row[k] * row[k] * self.d[k];
        }
        sum
    }

    /// The matrix itself.
    pub fn matrix(&self) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|i, j| (0..N).map(|k| self.u[i][k] * self.d[k] * self.u[j][k]).sum())
    }

    /// Absorbs one measurement `y = h z + noise` of variance `r > 0` (Bierman 1977, ch. V.3); the estimate is then
    /// corrected by the gain times `y - h z`.
    #[inline]
    pub fn absorb(&mut self, h: &[f64; N], r: f64) -> MeasurementGain<N> {
        let mut gain = [0.0; N];
        let mut alpha = r;
        for j in 0..N {
            let mut f = h[j];
            for i in 0..j {
                f += self.u[i][j] * h[i];
            }
            let v = self.d[j] * f;
            let before = alpha;
            alpha += f * v;
            self.d[j] *= before / alpha;
            let lambda = -f / before;
            for i in 0..j {
                let u = self.u[i][j];
                self.u[i][j] = u + lambda * gain[i];
                gain[i] += u * v;
            }
            gain[j] = v;
        }
        let scale = 1.0 / alpha;
        MeasurementGain { gain: gain.map(|g| g * scale), variance: alpha }
    }

    /// Predicts: `P <- F P F^T + diag(q)`, where `f` holds the first rows of `F` and the others are those of the
    /// identity (weighted Gram-Schmidt; Thornton and Bierman 1977).
    #[inline]
    pub fn predict(&mut self, f: &[[f64; N]], q: &[f64; N]) {
        // P = [F U | I] diag(D, q) [F U | I]^T; its rows are made orthogonal from the last to the first.
        let mut w = self.u;
        for (row, f) in w.iter_mut().zip(f) {
            for j in 0..N {
                let mut sum = f[j];
                for k in 0..j {
                    sum += f[k] * self.u[k][j];
                }
                row[j] = sum;
            }
        }
        let mut v = Self::diagonal([0.0; N]).u;
        let mut d = [0.0; N];
        for j in (0..N).rev() {
            let (wj, vj) = (w[j], v[j]);
            let (mut dw, mut qv) = ([0.0; N], [0.0; N]);
            for k in 0..N {
                dw[k] = wj[k] * self.d[k];
                qv[k] = vj[k] * q[k];
                d[j] += wj[k] * dw[k] + vj[k] * qv[k];
            }
            let scale = if d[j] > 0.0 { 1.0 / d[j] } else { 0.0 };
            for i in 0..j {
                let mut sum = 0.0;
                for k in 0..N {
                    sum += w[i][k] * dw[k] + v[i][k] * qv[k];
                }
                let u = sum * scale;
                for k in 0..N {
                    w[i][k] -= u * wj[k];
                    v[i][k] -= u * vj[k];
                }
                self.u[i][j] = u;
            }
        }
        self.d = d;
    }

    /// Multiplies `P` by a factor above zero.
    #[inline]
    pub fn scale(&mut self, factor: f64) {
        for d in &mut self.d {
            *d *= factor;
        }
    }

    /// Forgets what was known of the first quantities and of their correlation with all others; they get these
    /// variances, and the others keep theirs.
    pub fn renew(&mut self, variances: &[f64]) {
        let fresh = Self::diagonal([0.0; N]).u;
        for (i, variance) in variances.iter().enumerate().take(N) {
            // The lower right block of U D U^T does not depend on the rows above it.
            self.u[i] = fresh[i];
            self.d[i] = *variance;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::SVector;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn covariance_measures_and_predicts_as_the_dense_formulas(
            d in prop::array::uniform4(0.01..10.0), f in prop::array::uniform8(-2.0..2.0), h in prop::array::uniform4(-2.0..2.0),
            q in prop::array::uniform4(0.0..1.0), r in 0.01..5.0,
        ) {
            let mut factored = UdFactors::diagonal(d);
            let mut p = SMatrix::<f64, 4, 4>::from_diagonal(&SVector::from(d));
            let rows = [[f[0], f[1], f[2], f[3]], [f[4], f[5], f[6], f[7]]];
            let mut big_f = SMatrix::<f64, 4, 4>::identity();
            for i in 0..2 { for j in 0..4 { big_f[(i, j)] = rows[i][j]; } }
            let hv = SVector::from(h);
            for _ in 0..3 {
                factored.predict(&rows, &q);
                p = big_f * p * big_f.transpose() + SMatrix::from_diagonal(&SVector::from(q));
                let gain = factored.absorb(&h, r);
                let s = (hv.transpose() * p * hv)[0] + r;
                let k = p * hv / s;
                p -= k * k.transpose() * s;
                assert_relative_eq!(gain.variance, s, max_relative = 1e-9);
                assert_relative_eq!(SVector::from(gain.gain), k, epsilon = 1e-9, max_relative = 1e-9);
                // Rounding of the dense form, which cancels, grows with the size of P.
                assert_relative_eq!(factored.matrix(), p, epsilon = 1e-10 * (1.0 + p.norm()), max_relative = 1e-9);
                for i in 0..4 {
                    assert_relative_eq!(factored.variance(i), factored.matrix()[(i, i)], max_relative = 1e-12);
                }
            }
        }

        #[test]
        fn renewed_quantities_leave_the_others_alone(d in prop::array::uniform4(0.01..10.0), h in prop::array::uniform4(-2.0..2.0)) {
            let mut p = UdFactors::diagonal(d);
            p.absorb(&h, 0.1);
            let before = p.matrix();
            p.renew(&[7.0, 9.0]);
            let after = p.matrix();
            let expected = SMatrix::<f64, 2, 2>::from_diagonal(&SVector::from([7.0, 9.0]));
            assert_relative_eq!(after.fixed_view::<2, 2>(0, 0).into_owned(), expected, epsilon = 1e-14);
            assert_eq!(after.fixed_view::<2, 2>(2, 2), before.fixed_view::<2, 2>(2, 2));
            assert_eq!(after.fixed_view::<2, 2>(0, 2).norm(), 0.0);
        }
    }

    // A million exact measurements of one direction: the dense form P - K h^T P turns indefinite here.
    #[test]
    fn covariance_never_turns_negative() {
        let mut p = UdFactors::diagonal([1e12, 1.0, 1e-12]);
        for k in 0..1_000_000 {
            let x = (k % 10) as f64 * 1e-7;
            p.absorb(&[1.0, 1.0 + x, 1.0], 1e-10);
            p.predict(&[], &[0.0, 1e-14, 0.0]);
        }
        for i in 0..3 {
            let variance = p.variance(i);
            assert!(variance > 0.0 && variance.is_finite(), "{variance}");
        }
    }

    #[test]
    fn what_is_known_exactly_stays() {
        let mut p = UdFactors::diagonal([4.0, 0.0]);
        let gain = p.absorb(&[1.0, 1.0], 1.0);
        assert_eq!((gain.gain, gain.variance), ([0.8, 0.0], 5.0));
        p.predict(&[[1.0, 0.5]], &[0.0, 0.0]);
        assert_eq!((p.variance(1), p.variance(2)), (0.0, 0.0));
    }
}
