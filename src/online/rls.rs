//! Recursive least squares in factored form (Bierman 1977), with forgetting that cannot wind up.

use super::{
    Divergence, ObserverError, UdFactors, Update, UpdateOutcome, check_identity, check_positive, check_starts,
    in_bounds,
};
use crate::parameter::Parameter;
use crate::signals::{Of, Signals};
use nalgebra::SMatrix;

/// Recursive least squares with forgetting: follows the `N` parameters `P` of equations `y = phi p + noise`.
///
/// The covariance is kept as factors `U D U^T` (Bierman 1977), so that it stays positive however long it runs. A parameter is
/// known to its prior's mean and standard deviation at the start; one that is fixed stays.
///
/// ```
/// use greybox::online::{Forgetting, Rls};
/// use greybox::{free, signals};
/// signals! { pub struct Line { slope: "V/A", offset: "V" } }
/// let start = Line { slope: free(0.0).prior(0.0, 10.0), offset: free(0.0).prior(0.0, 10.0) };
/// let mut line = Rls::<Line, 2>::new(start, 0.1, Forgetting::none())?;
/// for k in 0..100 {
///     let i = (k % 7) as f64;
///     let update = line.update(&[(Line { slope: i, offset: 1.0 }, 0.4 * i - 2.0)]);
///     assert!(update.innovation[0].is_finite());
/// }
/// assert!((line.parameters().slope - 0.4).abs() < 1e-4);
/// # Ok::<(), greybox::online::ObserverError>(())
/// ```
#[derive(Clone, Copy)]
pub struct Rls<P: Signals, const N: usize> {
    known: Of<P, Parameter>,
    p: Of<P, f64>,
    covariance: UdFactors<N>,
    noise: f64,
    forgetting: Forgetting<N>,
    stopped: Option<Divergence>,
}

/// How fast the past is forgotten, between limits of what is then not known.
///
/// Before each sample the covariance grows by one factor: `1 / factor`, but no further than to the point where a
/// parameter would be less certain than its ceiling (nothing new is told of it: without a limit its covariance would
/// grow without end, and the next excitation throw it off), and no less than to where all are as uncertain as their
/// floor (so that they stay able to move).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forgetting<const N: usize> {
    /// Forgetting factor per sample, in (0, 1]: the memory is `1 / (1 - factor)` samples.
    pub factor: f64,
    /// Least standard deviation of each parameter, in its unit; zero for none.
    pub floor: [f64; N],
    /// Greatest standard deviation of each parameter, in its unit; infinity for none.
    pub ceiling: [f64; N],
}

impl<const N: usize> Forgetting<N> {
    /// Remembers everything.
    pub const fn none() -> Self {
        Self::factor(1.0)
    }

    /// Forgets by this factor per sample, without limits.
    pub const fn factor(factor: f64) -> Self {
        Forgetting { factor, floor: [0.0; N], ceiling: [f64::INFINITY; N] }
    }

    #[inline]
    fn growth(&self, covariance: &UdFactors<N>) -> f64 {
        if self.factor == 1.0 && self.floor == [0.0; N] {
            return 1.0;
        }
        let (mut least, mut most) = (1.0 / self.factor, f64::INFINITY);
        for i in 0..N {
            let variance = covariance.variance(i);
            if variance > 0.0 {
                least = f64::max(least, self.floor[i] * self.floor[i] / variance);
                most = f64::min(most, self.ceiling[i] * self.ceiling[i] / variance);
            }
        }
        f64::max(f64::min(least, most), 1.0)
    }
}

impl<P: Signals, const N: usize> Rls<P, N> {
    /// An estimator that starts from these parameters, for equations with noise of this standard deviation (unit of y).
    ///
    /// # Errors
    /// A start outside its bounds, a free parameter without prior, a noise, prior or factor that is not positive (or
    /// above one), a parameter estimated as a logarithm.
    pub fn new(parameters: Of<P, Parameter>, noise: f64, forgetting: Forgetting<N>) -> Result<Self, ObserverError> {
        const { assert!(N == P::LEN, "the second parameter of Rls is the number of its first one's signals") };
        check_starts::<P>(&parameters)?;
        check_identity::<P>(&parameters)?;
        check_positive("the noise", "y", noise)?;
        check_positive("the forgetting factor", "y", forgetting.factor)?;
        if forgetting.factor > 1.0 {
            return Err(ObserverError::Forgetting { factor: forgetting.factor });
        }
        let known = P::into_array(parameters);
        let mut variances = [0.0; N];
        for (i, variance) in variances.iter_mut().enumerate() {
            let std = super::prior_std(P::NAMES[i], &known.as_ref()[i])?;
            *variance = std * std;
        }
        Ok(Rls {
            known: parameters,
            p: P::map(parameters, |known| known.start),
            covariance: UdFactors::diagonal(variances),
            noise: noise * noise,
            forgetting,
            stopped: None,
        })
    }

    /// Takes one sample: `R` equations (regressor, y) that hold at once. The innovation is `y - phi p` of each before
    /// any of them is used; an equation with a number missing is left out.
    #[inline]
    pub fn update<const R: usize>(&mut self, equations: &[(Of<P, f64>, f64); R]) -> Update<[f64; R]> {
        let mut innovation = [0.0; R];
        if let Some(divergence) = self.stopped {
            return Update { innovation, outcome: UpdateOutcome::Diverged(divergence) };
        }
        let before = (self.p, self.covariance);
        let mut p = [0.0; N];
        p.copy_from_slice(P::into_array(self.p).as_ref());
        let start = p;
        self.covariance.scale(self.forgetting.growth(&self.covariance));
        let mut outcome = UpdateOutcome::Corrected;
        for ((regressor, y), innovation) in equations.iter().zip(&mut innovation) {
            let mut h = [0.0; N];
            h.copy_from_slice(P::into_array(*regressor).as_ref());
            let (mut prior, mut now) = (*y, *y);
            for i in 0..N {
                prior -= h[i] * start[i];
                now -= h[i] * p[i];
            }
            if !prior.is_finite() {
                outcome = UpdateOutcome::Missing { signal: super::not_finite::<P>(regressor).unwrap_or("y") };
                continue;
            }
            *innovation = prior;
            let gain = self.covariance.absorb(&h, self.noise).gain;
            for i in 0..N {
                p[i] += gain[i] * now;
            }
        }
        self.p = P::from_fn(|i| p[i]);
        if let Err(divergence) = in_bounds::<P>(&self.p, &self.known) {
            (self.p, self.covariance) = before;
            self.stopped = Some(divergence);
            outcome = UpdateOutcome::Diverged(divergence);
        }
        Update { innovation, outcome }
    }

    /// The estimates.
    pub fn parameters(&self) -> Of<P, f64> {
        self.p
    }

    /// Their covariance.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        self.covariance.matrix()
    }

    /// Their standard deviations.
    pub fn deviations(&self) -> Of<P, f64> {
        P::from_fn(|i| crate::scalar::Scalar::sqrt(self.covariance.variance(i)))
    }
}
