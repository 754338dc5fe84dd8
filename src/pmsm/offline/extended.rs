use super::plain::sinc;
use super::{Equations, Span, Spans};
use crate::dual::Dual;
use crate::error::Error;
use crate::pmsm::{Currents, SQRT_2_3};
use crate::scalar::Scalar;
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

crate::signals! {
    /// The same with the current at which the dead time turns over: standard errors that count that it was searched.
    pub struct ExtendedWithI0 {
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
        /// Amplitude of its sixth harmonic.
        ke6: "V s/rad",
        /// Voltage that dead time takes from each phase.
        vdt: "V",
        /// The correction to the `i0` of the equations: zero, but for the search's tolerance, where that was searched.
        i0: "A",
    }
}

/// The rows of the q axis and of the d axis of an interval: what multiplies each parameter, and the voltage.
type Rows = [(Extended, f64); 2];

impl Spans {
    /// The voltage equations with unequal inductances, saturation, dead time and a harmonic of the back-EMF.
    ///
    /// The voltage `u` is held in the stator's frame. There, in axes that stand where the rotor's are at mid-interval, an interval's
    /// mean is exactly `u = R mean(i) + (psi1 - psi0)/Ts`, and the flux linkages at its ends stand at the angles `-x` and `x`,
    /// `x = we Ts/2`. Of one that is `psi` at both ends, as the magnet's, the difference is `2 j sin(x) psi / Ts = j we psi
    /// sinc(x)`; of one that grows by `d`, `cos(x) d / Ts` beyond that. The mean of currents on straight lines between `i0` and
    /// `i1` is `cos(x) (i0 + i1)/2`, less the bend of [`Spans::bent`]. (Terms of `R Ts (i1 - i0) x` are left out.) Divided by
    /// `sinc(x)`, which leaves the EMF as it is, resistance and slopes of the currents have the factor `cos(x)/sinc(x)`: 0.9957 on
    /// axis 5 of the reference robot at 450 rad/s.
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
        let rows = self.spans.iter().map(|span| self.rows(span, self.lost(span, i0)));
        let (q, d): (Vec<_>, Vec<_>) = rows.map(|[q, d]| (q, d)).unzip();
        Equations::new().stream(q).stream(d)
    }

    /// The same with `i0` among the parameters, to the first order about `i0` (A) and the dead time's voltage `vdt` (V) that
    /// [`Spans::extended`] has found with it: resistance and `i0` are correlated, and the standard errors of the former are too
    /// small where that of the latter is not counted.
    pub fn extended_with_i0(&self, i0: f64, vdt: f64) -> Equations<ExtendedWithI0> {
        let rows = self.spans.iter().map(|span| {
            let (d, q) = self.lost(span, Dual::<1>::variable(i0, 0));
            let rows = self.rows(span, (d.value, q.value));
            let with = |(phi, y): (Extended, f64), slope: f64| {
                let Extended { r, ld, lq, lq2, ke, ke6, vdt: lost } = phi;
                (ExtendedWithI0 { r, ld, lq, lq2, ke, ke6, vdt: lost, i0: vdt * slope }, y)
            };
            (with(rows[0], q.slopes[0]), with(rows[1], d.slopes[0]))
        });
        let (q, d): (Vec<_>, Vec<_>) = rows.unzip();
        Equations::new().stream(q).stream(d)
    }

    /// The dead time's voltage along the flux and 90 degrees ahead of it, per volt.
    fn lost<S: Scalar>(&self, span: &Span, i0: S) -> (S, S) {
        let i = span.mean();
        let i = Currents { id: S::from(i.id - span.bend), iq: S::from(i.iq) };
        i.dead_time(i0, S::from(self.pole_pairs.electrical(span.theta)))
    }

    fn rows(&self, span: &Span, lost: (f64, f64)) -> Rows {
        let we = self.pole_pairs.electrical(span.w);
        let (i, x) = (span.mean(), 0.5 * we * self.ts);
        let whole = sinc(x);
        let straight = x.cos() / whole;
        let slope = |from: f64, to: f64| straight * (to - from) / self.ts;
        let (did, diq) = (slope(span.i0.id, span.i1.id), slope(span.i0.iq, span.i1.iq));
        let (rd, rq) = (straight * i.id - span.bend / whole, straight * i.iq);
        let theta_e = self.pole_pairs.electrical(span.theta);
        let (lq, square) = (-we * i.iq, i.iq * i.iq);
        let emf = SQRT_2_3 * span.w;
        let ke6 = emf * (6.0 * theta_e).cos() * sinc(3.0 * we * self.ts);
        let q = Extended { r: rq, ld: we * i.id, lq: diq, lq2: square * diq, ke: emf, ke6, vdt: lost.1 };
        let d = Extended { r: rd, ld: did, lq, lq2: square * lq, ke: 0.0, ke6: 0.0, vdt: lost.0 };
        [(q, span.uq / whole), (d, span.ud / whole)]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pmsm::{ExactStep, HeldIn, PolePairs, Winding};
    use approx::assert_relative_eq;

    const TRUTH: Winding = Winding { rs: 1.3, ls: 6e-3, ke: 0.6 };

    /// A motor in exact steps under voltages that stand still in the stator's frame, between speeds of 450 rad/s both ways.
    fn spans() -> Spans {
        let (ts, pole_pairs) = (0.126e-3, PolePairs::new(4).unwrap());
        let step = ExactStep::new(4, ts, HeldIn::Stationary).unwrap();
        let (mut from, mut theta) = (Currents { id: 0.0, iq: 0.0 }, 0.0);
        let spans = (0..8000).map(|k| {
            let t = f64::from(k) * ts;
            let (w, wanted) = (450.0 * (7.0 * t).sin(), 2.0 * (31.0 * t).cos() + (3.0 * t).sin());
            let we = pole_pairs.electrical(w);
            let uq = SQRT_2_3 * TRUTH.ke * w + TRUTH.rs * wanted + 5.0 * (wanted - from.iq);
            let ud = -we * TRUTH.ls * from.iq - 5.0 * from.id;
            let to = step.advance(&from, &crate::pmsm::Drive { ud, uq, w }, &TRUTH);
            let span = Span { i0: from, i1: to, ud, uq, w, theta: theta + 0.5 * w * ts, bend: 0.0 };
            (from, theta) = (to, theta + w * ts);
            span
        });
        Spans { ts, pole_pairs, spans: spans.collect() }
    }

    fn found(spans: &Spans) -> Extended {
        spans.extended(0.15).solve().unwrap().parameters
    }

    // The neglected term is of the order of R Ts x / L, the angle by which the voltage of the resistance turns on, squared: 1e-5. Found:
    // R 1.3e-6 off, lq 6.5e-5; without the bend R is off by 6e-4, without the factor as well by 1.5e-3.
    #[test]
    fn a_held_voltage_and_the_bend_between_samples_are_allowed_for() {
        let spans = spans();
        let bent = found(&spans.clone().bent(TRUTH.ke, TRUTH.ls).unwrap());
        assert_relative_eq!(bent.r, TRUTH.rs, max_relative = 1e-5);
        assert_relative_eq!(bent.lq, TRUTH.ls, max_relative = 2e-4);
        assert_relative_eq!(bent.ke, TRUTH.ke, max_relative = 1e-6);
        assert!(bent.vdt.abs() < 1e-4, "{}", bent.vdt);
        assert!(spans.clone().bent(0.6, 0.0).is_err() && spans.bent(f64::NAN, 6e-3).is_err());
    }

    // The dead time of currents with a bend is that of currents lower by as much along the flux.
    #[test]
    fn dead_time_is_that_of_the_mean_current() {
        let mut bent = Spans { spans: spans().spans[100..200].to_vec(), ..spans() };
        let mut lower = bent.clone();
        for (bent, lower) in bent.spans.iter_mut().zip(&mut lower.spans) {
            bent.bend = 0.05;
            lower.i0.id -= 0.05;
            lower.i1.id -= 0.05;
        }
        let volt = Extended { vdt: 1.0, ..Extended::default() };
        let [bent, lower] = [bent, lower].map(|spans| spans.extended(0.15).predictions(&volt));
        for (bent, lower) in bent.iter().flatten().zip(lower.iter().flatten()) {
            assert_relative_eq!(bent.1, lower.1, epsilon = 1e-12);
        }
    }

    // Against equations about another i0: what is left is of the second order, (0.001/0.15)^2 of 2 V.
    #[test]
    fn i0_is_a_parameter_to_the_first_order() {
        let (spans, vdt) = (Spans { spans: spans().spans[100..400].to_vec(), ..spans() }, 2.0);
        let p = Extended { r: 1.0, ld: 5e-3, lq: 6e-3, lq2: 1e-5, ke: 0.5, ke6: 0.01, vdt };
        let with = ExtendedWithI0 { r: 1.0, ld: 5e-3, lq: 6e-3, lq2: 1e-5, ke: 0.5, ke6: 0.01, vdt, i0: 1e-3 };
        let (about, beyond) =
            (spans.extended_with_i0(0.15, vdt).predictions(&with), spans.extended(0.151).predictions(&p));
        let at = spans.extended(0.15).predictions(&p);
        let mut moved = 0f64;
        for ((about, beyond), at) in about.iter().flatten().zip(beyond.iter().flatten()).zip(at.iter().flatten()) {
            assert!((about.1 - beyond.1).abs() < 1e-4, "{} {}", about.1, beyond.1);
            moved = moved.max((beyond.1 - at.1).abs());
        }
        assert!(moved > 3e-3, "{moved}");
    }
}
