use super::Spans;
use super::plain::sinc;
use crate::error::Error;
use crate::pmsm::{SQRT_2_3, dead_time};
use crate::regress::{Equations, Regression};
use argmin::core::{CostFunction, Executor};
use argmin::solver::brent::BrentOpt;

crate::signals! {
    /// What the extended least squares tells apart.
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
        /// Voltage that dead time takes from each phase.
        vdt: "V",
    }
}

/// The voltage equations with unequal inductances, saturation and dead time, of the voltage over `sinc(we Ts/2)`.
///
/// The dead time's voltage, the Park transform of `tanh(i_abc/i0)`, is taken at the angle of mid-interval and the mean
/// current; `i0` (A) enters it nonlinearly, see [`search_i0`].
pub fn extended(spans: &Spans, i0: f64) -> Equations<Extended> {
    let rows = |d_axis: bool| {
        spans.spans.iter().map(move |span| {
            let we = spans.pole_pairs.electrical(span.w);
            let i = span.mean();
            let (did, diq) = ((span.i1.id - span.i0.id) / spans.ts, (span.i1.iq - span.i0.iq) / spans.ts);
            let lost = dead_time(&i, i0, spans.pole_pairs.electrical(span.theta));
            let whole = sinc(0.5 * we * spans.ts);
            let square = i.iq * i.iq;
            if d_axis {
                let lq = -we * i.iq;
                (Extended { r: i.id, ld: did, lq, lq2: square * lq, ke: 0.0, vdt: lost.0 }, span.ud / whole)
            } else {
                let ke = SQRT_2_3 * span.w;
                (Extended { r: i.iq, ld: we * i.id, lq: diq, lq2: square * diq, ke, vdt: lost.1 }, span.uq / whole)
            }
        })
    };
    Equations::new().stream(rows(false)).stream(rows(true))
}

struct OverI0<F>(F);

impl<F: Fn(f64) -> Result<f64, Error>> CostFunction for OverI0<F> {
    type Param = f64;
    type Output = f64;
    fn cost(&self, ln_i0: &f64) -> Result<f64, argmin::core::Error> {
        Ok((self.0)(ln_i0.exp())?)
    }
}

/// The current `i0` (A) within `low..high` that leaves the least residual, and the regression there: a continuous
/// one-dimensional search (R. P. Brent, *Algorithms for Minimization without Derivatives*, 1973, ch. 5) over its logarithm.
///
/// `equations` makes the regression for a given `i0`, such as
/// `|i0| extended(&spans, i0).prefiltered(&filter).solve(all_free::<Extended>())`.
pub fn search_i0<P: crate::Signals>(
    low: f64,
    high: f64,
    regression: impl Fn(f64) -> Result<Regression<P>, Error>,
) -> Result<(f64, Regression<P>), Error> {
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Err(Error::Option(format!("the search of i0 needs 0 < low < high; got {low} A and {high} A")));
    }
    let solver = BrentOpt::new(low.ln(), high.ln()).set_tolerance(1e-2, 1e-2);
    let found = Executor::new(OverI0(|i0| Ok(regression(i0)?.residual)), solver)
        .configure(|state| state.max_iters(60))
        .run()
        .map_err(|e| Error::Optimizer(e.to_string()))?;
    let i0 = found.state.best_param.map_or(f64::NAN, f64::exp);
    Ok((i0, regression(i0)?))
}
