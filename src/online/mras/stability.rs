//! Stability of the sampled loop: the spectral radius of its error system, linearized where the estimates are right.

use super::{AdaptationLaw, Moment, Mras, Order, Rate};
use crate::dual::Dual;
use crate::model::Model;
use crate::online::ObserverError;
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use nalgebra::SMatrix;

impl<M: Model, L: AdaptationLaw<M>> Mras<M, L> {
    /// By what factor the errors of states and parameters grow or shrink from sample to sample, in the long run, near an
    /// operating point (states and inputs there, with the present parameters): above one the observer is unstable.
    ///
    /// Parameters that do not adapt there are left out. `N` is the number of states plus that of parameters. The number
    /// is not one (NaN) where the model itself is not.
    pub fn radius<const N: usize>(&self, x: &Of<M::State, f64>, u: &Of<M::Input, f64>) -> f64 {
        const { assert!(N == M::State::LEN + M::Parameters::LEN, "N is the number of states plus that of parameters") };
        let (n, ts) = (M::State::LEN, self.clock.ts);
        let (values, p) = (M::State::into_array(*x), M::Parameters::into_array(self.p));
        let x_dual = M::State::from_fn(|i| Dual::<N>::variable(values.as_ref()[i], i));
        let p_dual = M::Parameters::from_fn(|i| Dual::<N>::variable(p.as_ref()[i], n + i));
        // The error is e = x_true - x.
        let e_dual = M::State::from_fn(|i| -Dual::<N>::variable(0.0, i));
        let Ok(next) = self.predict(0.0, u, x_dual, e_dual, &p_dual) else { return f64::NAN };
        let next = M::State::into_array(next);

        let mut old = SMatrix::<f64, N, N>::zeros();
        let mut update = SMatrix::<f64, N, N>::identity();
        for i in 0..n {
            for j in 0..N {
                old[(i, j)] = next.as_ref()[i].slopes[j];
            }
        }
        let adapting = M::Parameters::into_array(self.adapting);
        for i in 0..n {
            // Central differences are exact here: laws are at most quadratic in the errors.
            let h = 1e-3 * (1.0 + values.as_ref()[i].abs());
            let rates = |h: f64| {
                let e = M::State::from_fn(|k| if k == i { h } else { 0.0 });
                let off = M::State::from_fn(|k| values.as_ref()[k] - if k == i { h } else { 0.0 });
                let now = Moment { model: &self.model, ts, t: 0.0, x: &off, e: &e, u, p: &self.p };
                M::Parameters::into_array(M::Parameters::map(self.law.rates(&now), |rate| match rate {
                    Rate::Adapt(rate) => rate,
                    Rate::Hold { .. } => 0.0,
                }))
            };
            let (up, down) = (rates(h), rates(-h));
            for (j, adapts) in adapting.as_ref().iter().enumerate() {
                if *adapts {
                    update[(n + j, i)] = -ts * (up.as_ref()[j] - down.as_ref()[j]) / (2.0 * h);
                }
            }
        }
        for j in n..N {
            if (0..n).all(|i| update[(j, i)] == 0.0) {
                update[(j, j)] = 0.0;
                old.column_mut(j).fill(0.0);
            }
        }
        // With the prediction on the updated parameters the two steps follow one another; else they are side by side.
        let mut map = match self.start.order {
            Order::UpdateThenPredict => old * update,
            Order::Thesis => old,
        };
        for j in n..N {
            map.set_row(j, &update.row(j));
        }
        spectral_radius(map)
    }

    /// Whether the sampled observer is stable at all these operating points (states and inputs), as a range of speeds.
    ///
    /// # Errors
    /// [`ObserverError::Unstable`], with the first point where it is not.
    pub fn check<const N: usize>(
        &self,
        points: impl IntoIterator<Item = (Of<M::State, f64>, Of<M::Input, f64>)>,
    ) -> Result<(), ObserverError> {
        for (point, (x, u)) in points.into_iter().enumerate() {
            let radius = self.radius::<N>(&x, &u);
            // An estimate that nothing moves has the radius 1, give or take the rounding.
            if radius > 1.0 + 1e-9 || radius.is_nan() {
                return Err(ObserverError::Unstable { point, radius });
            }
        }
        Ok(())
    }
}

/// The greatest modulus of an eigenvalue, by Gelfand's formula `|A^k|^(1/k)` with `k = 2^50`: no iteration that may fail,
/// no allocation.
fn spectral_radius<const N: usize>(mut a: SMatrix<f64, N, N>) -> f64 {
    let (mut log, mut weight) = (0.0, 1.0);
    for _ in 0..50 {
        let norm = a.iter().fold(0.0, |max: f64, x| if x.abs() > max || x.is_nan() { x.abs() } else { max });
        if norm == 0.0 || !norm.is_finite() {
            return norm;
        }
        log += Scalar::ln(norm) * weight;
        weight *= 0.5;
        a /= norm;
        a *= a;
    }
    Scalar::exp(log)
}
