use super::Spans;
use super::plain::{Axes, Form};
use crate::pmsm::Winding;

/// How well a model's prediction meets what was measured, per axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validation {
    /// Root of the mean squared error, in the unit of the signal.
    pub rmse: [f64; 2],
    /// `100 (1 - |error| / |measured - mean|)` %: 100 is perfect, 0 no better than a constant.
    pub fit: [f64; 2],
}

impl Validation {
    /// Of pairs `(measured, predicted)`, each `[d, q]`.
    pub fn of(pairs: impl Iterator<Item = ([f64; 2], [f64; 2])> + Clone) -> Validation {
        let count = pairs.clone().count().max(1) as f64;
        let each = |axis: usize| {
            let mean = pairs.clone().map(|(measured, _)| measured[axis]).sum::<f64>() / count;
            let spread: f64 = pairs.clone().map(|(measured, _)| (measured[axis] - mean).powi(2)).sum();
            let error: f64 =
                pairs.clone().map(|(measured, predicted)| (measured[axis] - predicted[axis]).powi(2)).sum();
            ((error / count).sqrt(), 100.0 * (1.0 - (error / spread).sqrt()))
        };
        let [d, q] = [each(0), each(1)];
        Validation { rmse: [d.0, q.0], fit: [d.1, q.1] }
    }
}

impl Spans {
    /// Voltages `[ud, uq]` (V) that a motor with these parameters needs for the measured currents, interval by interval
    /// (thesis 7.1), each with the commanded one before it. The other way, currents from voltages, is a simulation of
    /// [`Surface`](crate::pmsm::Surface).
    pub fn voltages(&self, winding: &Winding, form: Form) -> Vec<([f64; 2], [f64; 2])> {
        let predicted = self.plain(Axes::Both, form).predictions(winding);
        let [Some(q), Some(d)] = [predicted.first(), predicted.get(1)] else { return Vec::new() };
        d.iter().zip(q).map(|(&(ud, ud_hat), &(uq, uq_hat))| ([ud, uq], [ud_hat, uq_hat])).collect()
    }
}
