//! The cycles of a motor solved together.

use crate::methods::*;
use greybox::pmsm::offline::{Extended, Spans, extended, search_i0};
use greybox::pmsm::{Compensated, CompensatedSalientWinding, EmfHarmonic, ExactSalient, ExactStep, HeldIn};
use greybox::{Fit, PooledRegression, free};

/// What all cycles of a motor have in common.
const SHARED: Extended<bool> = Extended { r: true, ld: false, lq: false, lq2: false, ke: false, ke6: true, vdt: false };

/// Extended least squares on all cycles together, and the turnover current of the dead time (A).
pub fn pooled(run: &Run) -> Result<(f64, Vec<(f64, Extended)>)> {
    let (filter, cuts) = (low_pass(run.spans.ts)?, cuts(run));
    let together = |i0| {
        let sets = cuts.iter().map(|spans| extended(spans, i0).prefiltered(&filter).regression());
        PooledRegression::new(sets, SHARED)
    };
    let i0 = search_i0(0.03, 1.0, |i0| together(i0).least_squares())?;
    let found = together(i0).solve()?;
    Ok((i0, run.cycles.iter().zip(found).map(|(cycle, found)| (cycle.speed, found.parameters)).collect()))
}

fn cuts(run: &Run) -> Vec<Spans> {
    run.cycles.iter().map(|cycle| run.spans.cut(cycle.samples.clone())).collect()
}

/// The grey box with dead time, saliency and the EMF's harmonic, all cycles together: the resistance in common, and Ke of
/// each cycle.
pub fn compensated_grey_box(run: &Run, i0: f64) -> Result<(f64, Vec<(f64, f64)>)> {
    let axis = &run.axis;
    let step = ExactStep::new(axis.pole_pairs.into(), run.spans.ts, HeldIn::Stationary)?;
    let motor = EmfHarmonic::<_, CompensatedSalientWinding>::new(ExactSalient(step));
    let model = Compensated::<_, CompensatedSalientWinding>::new(motor);
    let records =
        cuts(run).iter().map(|spans| spans.grey_box(&model, i0)).collect::<core::result::Result<Vec<_>, _>>()?;
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
    Ok((estimate.parameters.rs, run.cycles.iter().map(|cycle| cycle.speed).zip(ke).collect()))
}
