use super::units::Constant;
use super::{Currents, Drive, MotorError, MotorModel, PolePairs};
use crate::{Model, Scalar, Table, scalar::Grid};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Parameters of a motor with a measured flux map.
    pub struct MappedWinding {
        /// Phase resistance; must be positive.
        rs: "ohm",
        /// Line-to-line rms back-EMF per mechanical speed, of the magnets alone.
        ke: "V s/rad",
        /// By which the flux linkages of the map are multiplied; one, if the map is right.
        flux: "1",
    }
}

/// Currents of a motor whose flux linkages are tables over both currents, from a finite element program or a test bench:
///
/// ```text
/// psi_d = psi_m + flux map_d(id, iq)         psi_q = flux map_q(id, iq)         psi_m = sqrt(2/3) ke / np
/// dpsi_d/dt = ud - rs id + we psi_q          dpsi_q/dt = uq - rs iq - we psi_d
/// ```
///
/// `map_d` and `map_q` are in Wb over `id` and `iq` in A (phase peak), the first argument being `id`. They hold what the
/// currents add to the magnets' flux, so `map_d` is zero at zero current: of a map that includes the magnets, subtract
/// `psi_d(0, 0)`, and start `ke` from it ([`Constant::FluxLinkage`]). The incremental inductances are the slopes of the
/// tables; take [`Interpolation::Smooth`](crate::scalar::Interpolation::Smooth), by which they do not jump, and
/// [`Extrapolation::Linear`](crate::scalar::Extrapolation::Linear). A map of a lossless motor is reciprocal
/// (`dpsi_d/diq = dpsi_q/did`), which is not examined: measured ones are not quite.
///
/// ```
/// use greybox::pmsm::FluxMapped;
/// use greybox::{Table, scalar::{Extrapolation::Linear, Interpolation::Smooth}};
/// let (id, iq) = ([-40.0, 0.0, 40.0], [-40.0, -20.0, 0.0, 20.0, 40.0]);
/// let over = |psi: fn(f64, f64) -> f64| -> Vec<f64> {
///     id.iter().flat_map(|d| iq.iter().map(move |q| psi(*d, *q))).collect()
/// };
/// let map_d = Table::surface(&id, &iq, &over(|d, _| 4e-3 * d), Smooth, Linear)?;
/// let map_q = Table::surface(&id, &iq, &over(|_, q| 0.1 * (q / 25.0).atan()), Smooth, Linear)?;
/// let motor = FluxMapped::new(4, map_d, map_q)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct FluxMapped {
    pole_pairs: PolePairs,
    map_d: Table,
    map_q: Table,
}

/// The serialized form.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    pole_pairs: PolePairs,
    map_d: Table,
    map_q: Table,
}

/// The part of the map's range below which what it is at zero current is an error of its measurement.
const WITHOUT_MAGNETS: f64 = 0.01;

/// Whether the points of a surface surround zero current, so that its value there is not extrapolated.
fn includes_zero(table: Grid<'_>) -> bool {
    table.axes().iter().all(|axis| axis[0] <= 0.0 && axis[axis.len() - 1] >= 0.0)
}

/// The largest value of a table less its smallest.
fn range(table: Grid<'_>) -> f64 {
    let [x, y] = table.axes();
    let values = x.iter().flat_map(|x| y.iter().map(|y| table.at2(*x, *y)));
    let ends = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    high - low
}

impl FluxMapped {
    /// A motor with this many pole pairs and these maps (Wb over `id`, `iq` in A).
    ///
    /// # Errors
    /// Zero pole pairs; a table of one argument; a `map_d` that is not zero at zero current, by more than a hundredth of its
    /// range; incremental inductances that are not positive definite at a point of the tables, between two or beyond the last.
    pub fn new(pole_pairs: u32, map_d: Table, map_q: Table) -> Result<Self, MotorError> {
        FluxMapped { pole_pairs: PolePairs::new(pole_pairs)?, map_d, map_q }.checked()
    }

    fn checked(self) -> Result<Self, MotorError> {
        let tables = [self.map_d.grid(), self.map_q.grid()];
        if tables.iter().any(|table| !table.is_surface()) {
            let (quantity, unit, must) =
                ("number of arguments of a flux map", "", "be two, id and iq (Table::surface)");
            return Err(MotorError::OutOfRange { quantity, value: 1.0, unit, must });
        }
        let magnets = self.map_d.grid().at2(0.0, 0.0);
        if includes_zero(self.map_d.grid()) && magnets.abs() > WITHOUT_MAGNETS * range(self.map_d.grid()) {
            let (quantity, unit) = ("map_d at zero current", "Wb");
            let must = "be zero: subtract the flux of the magnets from the map, and give it as ke (units::Constant::FluxLinkage)";
            return Err(MotorError::OutOfRange { quantity, value: magnets, unit, must });
        }
        let places = |axis: usize| -> Vec<f64> {
            let mut all: Vec<f64> = tables.iter().flat_map(|table| table.axes()[axis].iter().copied()).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            let between: Vec<f64> = all.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
            let beyond = [2.0 * all[0] - all[1], 2.0 * all[all.len() - 1] - all[all.len() - 2]];
            all.into_iter().chain(between).chain(beyond).collect()
        };
        let (unit, must) = ("H", "be positive between and beyond the points (Extrapolation::Linear)");
        let positive = |quantity, value: f64| match value > 0.0 {
            true => Ok(()),
            false => Err(MotorError::OutOfRange { quantity, value, unit, must }),
        };
        let iq = places(1);
        for id in places(0) {
            for &iq in &iq {
                let [[dd, dq], [qd, qq]] = self.slopes(&Currents { id, iq });
                positive("incremental inductance dmap_d/did", dd)?;
                positive("incremental inductance dmap_q/diq", qq)?;
                positive("determinant of the incremental inductances over dmap_d/did", qq - dq * qd / dd)?;
            }
        }
        Ok(self)
    }

    /// Flux linkages `(psi_d, psi_q)` (Wb).
    #[inline]
    pub fn flux<S: Scalar>(&self, x: &Currents<S>, p: &MappedWinding<S>) -> (S, S) {
        let map = |table: Grid<'_>| p.flux * table.at2(x.id, x.iq);
        (Constant::FluxLinkage(self.pole_pairs).from_ke(p.ke) + map(self.map_d.grid()), map(self.map_q.grid()))
    }

    /// Slopes of the tables (H): of `map_d` over `id` and `iq`, and of `map_q`.
    fn slopes<S: Scalar>(&self, x: &Currents<S>) -> [[S; 2]; 2] {
        [self.map_d.grid(), self.map_q.grid()]
            .map(|table| [[1, 0], [0, 1]].map(|order| S::look_up(&table, [x.id, x.iq], order)))
    }
}

impl TryFrom<Parts> for FluxMapped {
    type Error = MotorError;
    fn try_from(Parts { pole_pairs, map_d, map_q }: Parts) -> Result<Self, MotorError> {
        FluxMapped { pole_pairs, map_d, map_q }.checked()
    }
}

impl From<FluxMapped> for Parts {
    fn from(FluxMapped { pole_pairs, map_d, map_q }: FluxMapped) -> Self {
        Parts { pole_pairs, map_d, map_q }
    }
}

impl MotorModel for FluxMapped {
    fn pole_pairs(&self) -> PolePairs {
        self.pole_pairs
    }

    /// `3/2 np (psi_d iq - psi_q id)` (N m).
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, _theta: S, p: &MappedWinding<S>) -> S {
        let (psi_d, psi_q) = self.flux(x, p);
        (psi_d * x.iq - psi_q * x.id) * (1.5 * self.pole_pairs.get())
    }
}

impl Model for FluxMapped {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = MappedWinding;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &MappedWinding<S>) -> Currents<S> {
        let we = self.pole_pairs.electrical(u.w);
        let (psi_d, psi_q) = self.flux(x, p);
        let [[dd, dq], [qd, qq]] = self.slopes(x);
        let (vd, vq) = (u.ud - p.rs * x.id + we * psi_q, u.uq - p.rs * x.iq - we * psi_d);
        let determinant = (dd * qq - dq * qd) * p.flux;
        Currents { id: (qq * vd - dq * vq) / determinant, iq: (dd * vq - qd * vd) / determinant }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &MappedWinding<S>) -> Currents<S> {
        *x
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AngledDrive, InverterFed, Salient, SalientWinding, Saturated, SaturatedWinding};
    use super::*;
    use crate::{
        Dual, Fit, Time, fixed, free,
        scalar::{Extrapolation, Interpolation},
        simulate,
    };

    const Q: SalientWinding = SalientWinding { rs: 0.4, ld: 3.8e-3, lq: 5.2e-3, ke: 0.95 };
    const SATURATED: SaturatedWinding = SaturatedWinding {
        rs: 0.4,
        ld: 3.84e-3,
        lq: 6e-3,
        lq_saturated: 2e-3,
        lq_cross: -8e-6,
        i_saturation: 30.0,
        ke: 0.95,
    };

    fn table(points: i32, psi: impl Fn(f64, f64) -> f64, extrapolation: Extrapolation) -> Table {
        let axis: Vec<f64> = (-points..=points).map(|k| 60.0 * f64::from(k) / f64::from(points)).collect();
        let values: Vec<f64> = axis.iter().flat_map(|id| axis.iter().map(|iq| psi(*id, *iq))).collect();
        Table::surface(&axis, &axis, &values, Interpolation::Smooth, extrapolation).unwrap()
    }

    fn linear() -> FluxMapped {
        let map = |psi: fn(f64, f64) -> f64| table(4, psi, Extrapolation::Linear);
        FluxMapped::new(4, map(|id, _| Q.ld * id), map(|_, iq| Q.lq * iq)).unwrap()
    }

    /// The map of a motor of which the equations are known.
    fn saturated() -> FluxMapped {
        let motor = Saturated::new(4).unwrap();
        let flux = |id: f64, iq: f64| motor.flux(&Currents { id, iq }, &SaturatedWinding { ke: 0.0, ..SATURATED });
        let map = |psi: &dyn Fn(f64, f64) -> f64| table(12, psi, Extrapolation::Linear);
        FluxMapped::new(4, map(&|id, iq| flux(id, iq).0), map(&|id, iq| flux(id, iq).1)).unwrap()
    }

    fn places() -> impl Iterator<Item = (Currents, Drive)> {
        let mut random = crate::random::Random::stream(5, 1);
        (0..200).map(move |_| {
            let mut next = |size: f64| size * random.normal();
            let x = Currents { id: next(30.0), iq: next(30.0) };
            (x, Drive { ud: next(100.0), uq: next(100.0), w: next(100.0) })
        })
    }

    /// With a linear map it is the salient motor, inside the table and beyond it, by itself and behind an inverter.
    #[test]
    fn a_linear_map_is_the_salient_motor() {
        crate::signals! {
            struct Mapped { rs: "ohm", ke: "V s/rad", flux: "1", vdt: "V", i0: "A" }
            struct Line { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A" }
        }
        let (mapped, salient) = (linear(), Salient::new(4).unwrap());
        let p = MappedWinding { rs: Q.rs, ke: Q.ke, flux: 1.0 };
        let same = |a: f64, b: f64, size: f64| assert!((a - b).abs() <= 1e-12 * size, "{a} {b}");
        for (x, u) in places() {
            let (a, b) = (mapped.derivative(0.0, &x, &u, &p), salient.derivative(0.0, &x, &u, &Q));
            // Voltages of some 1,000 V over an inductance of 4 mH.
            same(a.id, b.id, 2.5e5);
            same(a.iq, b.iq, 2.5e5);
            same(mapped.torque(&x, 0.0, &p), salient.torque(&x, 0.0, &Q), 100.0);
            let u = AngledDrive { ud: u.ud, uq: u.uq, w: u.w, theta: 0.7 };
            let (vdt, i0) = (2.0, 0.15);
            let fed = InverterFed::<_, Mapped>::new(mapped.clone());
            let a = fed.derivative(0.0, &x, &u, &Mapped { rs: Q.rs, ke: Q.ke, flux: 1.0, vdt, i0 });
            let fed = InverterFed::<_, Line>::new(salient);
            let b = fed.derivative(0.0, &x, &u, &Line { rs: Q.rs, ld: Q.ld, lq: Q.lq, ke: Q.ke, vdt, i0 });
            same(a.id, b.id, 2.5e5);
            same(a.iq, b.iq, 2.5e5);
        }
    }

    /// The voltage that is left drives the flux linkages, whose slopes by duals these are.
    #[test]
    fn flux_moves_by_the_voltage_that_is_left() {
        let (motor, p) = (saturated(), MappedWinding { rs: 0.4, ke: 0.95, flux: 1.1 });
        for (x, u) in places() {
            let dx = motor.derivative(0.0, &x, &u, &p);
            let along =
                Currents { id: Dual::<1> { value: x.id, slopes: [dx.id] }, iq: Dual { value: x.iq, slopes: [dx.iq] } };
            let (psi_d, psi_q) = motor.flux(&along, &<MappedWinding as crate::Signals>::map(p, Dual::constant));
            let we = 4.0 * u.w;
            let expected = [u.ud - p.rs * x.id + we * psi_q.value, u.uq - p.rs * x.iq - we * psi_d.value];
            // A dozen roundings on voltages of some 1,000 V.
            for (found, expected) in [psi_d.slopes[0], psi_q.slopes[0]].into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-10, "{found} {expected}");
            }
        }
    }

    /// From a record with noise of 0.05 A: a map that is 8 % too large, resistance and back-EMF within four standard errors,
    /// each known to 0.5 %; as a compiled program.
    #[test]
    fn a_wrong_scale_is_found() {
        let (motor, truth) = (saturated(), MappedWinding { rs: 0.4, ke: 0.95, flux: 0.92 });
        let levels = |k: usize, hold: usize| ((k / hold) as f64 * 2.4).sin();
        let drive = |k: usize| {
            let w = 30.0 + 20.0 * levels(k, 150);
            Drive { ud: 8.0 * levels(k, 17) - 10.0, uq: 0.776 * w + 30.0 * levels(k, 40), w }
        };
        let inputs: Vec<Drive> = (0..1500).map(drive).collect();
        let time = Time::Uniform { start: 0.0, step: 2e-4 };
        let start = Currents { id: 0.0, iq: 0.0 };
        let run = simulate(&motor, &truth, &start, time, &inputs).unwrap();
        assert!(run.outputs.iter().any(|y| y.iq.abs() > 20.0), "the record does not saturate the motor");
        let record = run.with_noise(Currents { id: 0.05, iq: 0.05 }, 7).experiment(&motor).unwrap();
        let record = record.initial(Currents { id: fixed(0.0), iq: fixed(0.0) });
        let parameters = MappedWinding { rs: free(0.5), ke: free(0.8), flux: free(1.0) };
        let estimate = Fit::new(&motor, &record).parameters(parameters).run().unwrap();
        assert!(estimate.method.engine.contains("graph"), "{}", estimate.method.engine);
        for (unknown, truth) in estimate.unknowns.iter().zip([0.4, 0.95, 0.92]) {
            let error = unknown.knowledge.standard_error().unwrap();
            assert!((unknown.value - truth).abs() < 4.0 * error && error < 5e-3 * truth, "{estimate}");
        }
    }

    #[test]
    fn maps_that_are_none_are_refused() {
        let d = || table(4, |id, _| 4e-3 * id, Extrapolation::Linear);
        let falling = table(4, |_, iq| -4e-3 * iq, Extrapolation::Linear);
        let held = table(4, |_, iq| 4e-3 * iq, Extrapolation::Hold);
        let crossed = table(4, |id, iq| 4e-3 * iq + 5e-3 * id, Extrapolation::Linear);
        let curve = Table::curve(&[0.0, 1.0], &[0.0, 1.0], Interpolation::Linear, Extrapolation::Linear).unwrap();
        let refused = |q: Table| FluxMapped::new(4, d(), q).unwrap_err().to_string();
        assert!(refused(falling).starts_with("incremental inductance dmap_q/diq is -0.004 H"));
        assert!(refused(held).starts_with("incremental inductance dmap_q/diq is 0 H"));
        assert!(refused(curve).starts_with("number of arguments of a flux map is 1"));
        // A map that includes the magnets; of one that does not reach zero current the flux there is not known.
        let shifted = |from: f64, more: f64| {
            let axis = [from, from + 20.0, from + 40.0];
            let values: Vec<f64> = axis.iter().flat_map(|id| [4e-3 * id + more; 3]).collect();
            Table::surface(&axis, &[-20.0, 0.0, 20.0], &values, Interpolation::Smooth, Extrapolation::Linear).unwrap()
        };
        let q = || table(4, |_, iq| 4e-3 * iq, Extrapolation::Linear);
        let error = FluxMapped::new(4, shifted(-20.0, 0.194), q()).unwrap_err().to_string();
        assert!(error.starts_with("map_d at zero current is 0.194 Wb"), "{error}");
        assert!(FluxMapped::new(4, shifted(-20.0, 1e-3), q()).is_ok());
        assert!(FluxMapped::new(4, shifted(10.0, 0.194), q()).is_ok());
        assert_eq!(FluxMapped::new(0, d(), d()).unwrap_err(), MotorError::NoPolePairs);
        // Both depend on the sum of the currents: a determinant of zero or less.
        let both = table(4, |id, iq| 4e-3 * id + 5e-3 * iq, Extrapolation::Linear);
        let error = FluxMapped::new(4, both, crossed).unwrap_err().to_string();
        assert!(error.starts_with("determinant of the incremental inductances"), "{error}");
        let motor = saturated();
        let text = serde_json::to_string(&motor).unwrap();
        assert_eq!(serde_json::from_str::<FluxMapped>(&text).unwrap(), motor);
        assert!(serde_json::from_str::<FluxMapped>(&text.replace("\"pole_pairs\":4", "\"pole_pairs\":0")).is_err());
    }
}
