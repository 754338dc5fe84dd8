//! Information criteria, by which models of the same record are compared.

use super::{NoiseModel, Summary};

impl Summary {
    /// Akaike's information criterion; smaller is better. `None` for weighted or robust fits. The standard deviations of
    /// the noise count as parameters where they were estimated.
    pub fn aic(&self) -> Option<f64> {
        self.deviance.map(|deviance| deviance + 2.0 * self.likelihood_parameters())
    }

    /// Akaike's criterion corrected for short records (Hurvich and Tsai 1989); `None` too where it is not defined.
    pub fn aicc(&self) -> Option<f64> {
        let (n, k) = (self.measurements as f64, self.likelihood_parameters());
        self.aic().filter(|_| n - k > 1.0).map(|aic| aic + 2.0 * k * (k + 1.0) / (n - k - 1.0))
    }

    /// Bayes' information criterion (Schwarz 1978).
    pub fn bic(&self) -> Option<f64> {
        let n = self.measurements as f64;
        self.deviance.map(|deviance| deviance + self.likelihood_parameters() * n.ln())
    }

    /// Akaike's final prediction error (Ljung 1999, eq. 16.56): the expected product over the outputs of the error
    /// variances on new data. `None` if there are not more samples than unknowns.
    pub fn fpe(&self) -> Option<f64> {
        let samples = self.outputs.iter().map(|output| output.fit.samples).max().unwrap_or(0) as f64;
        let d = self.unknowns.len() as f64;
        let determinant: f64 = self.outputs.iter().map(|output| output.fit.rmse * output.fit.rmse).product();
        (samples > d).then(|| determinant * (1.0 + d / samples) / (1.0 - d / samples))
    }

    /// Parameters of the likelihood: unknowns, and estimated standard deviations of the noise.
    pub(crate) fn likelihood_parameters(&self) -> f64 {
        let outputs = self.outputs.len();
        let noise = match self.method.noise {
            NoiseModel::Covariance if self.noise_covariance.is_some() => outputs * (outputs + 1) / 2,
            NoiseModel::PerOutput | NoiseModel::Covariance => outputs,
            NoiseModel::SomeGiven(given) => outputs.saturating_sub(given),
            NoiseModel::Given | NoiseModel::Predicted => 0,
        };
        (self.unknowns.len() + noise) as f64
    }
}
