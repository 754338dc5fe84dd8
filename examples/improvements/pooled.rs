//! The cycles of a motor solved together.

use crate::methods::*;
use greybox::pmsm::offline::{Extended, Spans};
use greybox::pmsm::program::Cycle;
use greybox::pmsm::robot::RobotAxis;
use greybox::pmsm::{Compensated, EmfHarmonic, ExactSalient, ExactStep, HeldIn};
use greybox::{
    Fit, free,
    regress::{PooledRegression, Regression},
    signals,
};

signals! {
    /// A salient motor with a harmonic in its EMF, its cable, and the size of its inverter's dead time.
    pub struct CompensatedSalientWinding { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", ke6: "V s/rad", vdt: "V" }
}

/// What all cycles of a motor have in common: what belongs to the motor. How dead time acts on the mean voltage depends on how
/// fast the currents pass through zero.
const SHARED: Extended<bool> = Extended { r: true, ld: true, lq: true, lq2: true, ke: false, ke6: true, vdt: false };

/// A cycle, and the current (A) at which its dead time turns over.
pub struct CycleSpans {
    speed: f64,
    spans: Spans,
    i0: f64,
}

/// The cycles of a record.
pub fn cycles(run: &Run) -> Result<Vec<CycleSpans>> {
    let filter = low_pass(run.spans.ts)?;
    let cycle = |cycle: &Cycle| {
        let spans = run.spans.cut(cycle.samples.clone()).bent(run.axis.ke, run.axis.ls)?;
        let i0 = Extended::search_i0(0.03, 1.0, |i0| spans.extended(i0).prefiltered(&filter).least_squares())?;
        Ok(CycleSpans { speed: cycle.speed, spans, i0 })
    };
    run.cycles.iter().map(cycle).collect()
}

/// Extended least squares on each cycle alone.
pub fn one_by_one(cycles: &[CycleSpans]) -> Result<Vec<(f64, Extended)>> {
    let solve = |cycle: &CycleSpans| Ok((cycle.speed, cycle.regression()?.solve()?.parameters));
    cycles.iter().map(solve).collect()
}

/// Extended least squares on all cycles together.
pub fn pooled(cycles: &[CycleSpans]) -> Result<Vec<(f64, Extended)>> {
    let sets = cycles.iter().map(CycleSpans::regression).collect::<Result<Vec<_>>>()?;
    let found = PooledRegression::new(sets, SHARED).solve()?;
    Ok(cycles.iter().zip(found).map(|(cycle, found)| (cycle.speed, found.parameters)).collect())
}

impl CycleSpans {
    fn regression(&self) -> Result<Regression<Extended>> {
        Ok(self.spans.extended(self.i0).prefiltered(&low_pass(self.spans.ts)?).regression())
    }
}

/// The grey box with dead time, saliency and the EMF's harmonic, all cycles together: the resistance in common, and Ke of
/// each cycle.
pub fn compensated_grey_box(axis: &RobotAxis, cycles: &[CycleSpans]) -> Result<(f64, Vec<(f64, f64)>)> {
    let ts = cycles.first().map_or(axis.ts, |cycle| cycle.spans.ts);
    let step = ExactStep::new(axis.pole_pairs.into(), ts, HeldIn::Stationary)?;
    let motor = EmfHarmonic::<_, CompensatedSalientWinding>::new(ExactSalient(step));
    let model = Compensated::<_, CompensatedSalientWinding>::new(motor);
    let record = |cycle: &CycleSpans| cycle.spans.grey_box(&model, cycle.i0);
    let records = cycles.iter().map(record).collect::<core::result::Result<Vec<_>, _>>()?;
    let start = CompensatedSalientWinding {
        rs: free(1.5 * axis.rs),
        ld: free(1.2 * axis.ls),
        lq: free(1.2 * axis.ls).per_experiment(),
        ke: free(0.9 * axis.ke).per_experiment(),
        ke6: free(0.0),
        vdt: free(0.0).per_experiment(),
    };
    let estimate = Fit::new(&model, &records).parameters(start).run()?;
    let ke = estimate.unknowns.iter().filter(|unknown| unknown.name.starts_with("ke [")).map(|unknown| unknown.value);
    Ok((estimate.parameters.rs, cycles.iter().map(|cycle| cycle.speed).zip(ke).collect()))
}
