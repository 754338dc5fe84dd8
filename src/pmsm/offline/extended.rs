use super::plain::sinc;
use super::{Equations, Spans};
use crate::error::Error;
use crate::pmsm::SQRT_2_3;
use argmin::core::{CostFunction, Executor};
use argmin::solver::brent::BrentOpt;

crate::signals! {
    /// Parameters of the extended least squares.
    pub struct Extended {
        /// Phase resistance, motor and cable.
        r: "ohm",
        /// Inductance along the magnet flux.
        ld: "H",
        /// Inductance 90 electrical degrees ahead of it, at small currents.
        lq: "H",
        /// By how much that changes with the square of iq.
        lq2: "H/A^2",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Amplitude of its sixth harmonic, `cos(6 theta_e)`, the lowest that a symmetric winding has.
        ke6: "V s/rad",
        /// Voltage that dead time takes from each phase.
        vdt: "V",
    }
}

impl Spans {
    /// The voltage equations with unequal inductances, saturation, dead time and a harmonic of the back-EMF, of the voltage
    /// over `sinc(we Ts/2)`.
    ///
    /// The dead time's voltage, the Park transform of `tanh(i_abc/i0)`, is taken at the angle of mid-interval and the mean
    /// current; `i0` (A) enters it nonlinearly, see [`Extended::search_i0`]. The harmonic is that of mid-interval times
    /// `sinc(3 we Ts)`, its mean; the angle must be that of the magnet.
    ///
    /// The resistance and the harmonic are the same in all cycles of a motor: solved together by [`PooledRegression`], with
    /// the other parameters for each cycle, they are determined by the fast cycles, and known in the slow ones, which do not determine them.
    ///
    /// [`PooledRegression`]: crate::regress::PooledRegression
    pub fn extended(&self, i0: f64) -> Equations<Extended> {
        let (q, d): (Vec<_>, Vec<_>) = self
            .spans
            .iter()
            .map(|span| {
                let we = self.pole_pairs.electrical(span.w);
                let i = span.mean();
                let (did, diq) = ((span.i1.id - span.i0.id) / self.ts, (span.i1.iq - span.i0.iq) / self.ts);
                let theta_e = self.pole_pairs.electrical(span.theta);
                let lost = i.dead_time(i0, theta_e);
                let whole = sinc(0.5 * we * self.ts);
                let (lq, square) = (-we * i.iq, i.iq * i.iq);
                let emf = SQRT_2_3 * span.w;
                let ke6 = emf * (6.0 * theta_e).cos() * sinc(3.0 * we * self.ts);
                let q = Extended { r: i.iq, ld: we * i.id, lq: diq, lq2: square * diq, ke: emf, ke6, vdt: lost.1 };
                let d = Extended { r: i.id, ld: did, lq, lq2: square * lq, ke: 0.0, ke6: 0.0, vdt: lost.0 };
                ((q, span.uq / whole), (d, span.ud / whole))
            })
            .unzip();
        Equations::new().stream(q).stream(d)
    }
}

struct OverI0<F>(F);

impl<F: Fn(f64) -> f64> CostFunction for OverI0<F> {
    type Param = f64;
    type Output = f64;
    fn cost(&self, ln_i0: &f64) -> Result<f64, argmin::core::Error> {
        Ok((self.0)(ln_i0.exp()))
    }
}

impl Extended {
    /// The current `i0` (A) within `low..high` at which a cost is least: a continuous one-dimensional search (R. P. Brent,
    /// *Algorithms for Minimization without Derivatives*, 1973, ch. 5) over its logarithm, to 0.1 %. One percent of `i0` is
    /// 0.1 % of Ke at 15 rad/s on a small axis.
    ///
    /// The cost is the least squared residual of the equations for a given `i0`, such as
    /// `|i0| spans.extended(i0).prefiltered(&filter).least_squares()`.
    ///
    /// # Errors
    /// Limits that are not positive or not in order.
    pub fn search_i0(low: f64, high: f64, cost: impl Fn(f64) -> f64) -> Result<f64, Error> {
        if !(low > 0.0 && high > low && high.is_finite()) {
            return Err(Error::Option(format!("the search of i0 needs 0 < low < high; got {low} A and {high} A")));
        }
        let solver = BrentOpt::new(low.ln(), high.ln()).set_tolerance(1e-4, 1e-3);
        let found = Executor::new(OverI0(cost), solver)
            .configure(|state| state.max_iters(60))
            .run()
            .map_err(|e| Error::Optimizer(e.to_string()))?;
        found
            .state
            .best_param
            .map(f64::exp)
            .ok_or_else(|| Error::Optimizer("the search of i0 found nothing".to_owned()))
    }
}
