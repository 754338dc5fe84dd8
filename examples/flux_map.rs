//! A motor with a measured flux map: by how much the map is wrong, with resistance and back-EMF, from one record.
//!
//! `cargo run --release --example flux_map`

use greybox::pmsm::{Currents, Drive, FluxMapped, MappedWinding};
use greybox::{
    Fit, Rk45, Simulator, Table, Time, fixed, free,
    scalar::{Extrapolation, Interpolation},
};

/// A flux linkage (Wb) at points of `id` and `iq` (A), as a test bench or a finite element program gives it.
fn map(psi: impl Fn(f64, f64) -> f64) -> Result<Table, greybox::scalar::TableError> {
    let axis: Vec<f64> = (-12..=12).map(|k| 5.0 * f64::from(k)).collect();
    let values: Vec<f64> = axis.iter().flat_map(|id| axis.iter().map(|iq| psi(*id, *iq))).collect();
    Table::surface(&axis, &axis, &values, Interpolation::Smooth, Extrapolation::Linear)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The q axis saturates at some 30 A. What the magnets add follows from ke.
    let motor = FluxMapped::new(4, map(|id, _| 3.8e-3 * id)?, map(|_, iq| 2e-3 * iq + 0.12 * (iq / 30.0).atan())?)?;

    // The record of a motor with a core that is 8 % shorter than the map's.
    let truth = MappedWinding { rs: 0.4, ke: 0.95, flux: 0.92 };
    let level = |k: usize, hold: usize| ((k / hold) as f64 * 2.4).sin();
    let drive = |k: usize| {
        let w = 30.0 + 20.0 * level(k, 150);
        Drive { ud: 8.0 * level(k, 17) - 10.0, uq: 0.776 * w + 30.0 * level(k, 40), w }
    };
    let inputs: Vec<Drive> = (0..1500).map(drive).collect();
    let (rest, time) = (Currents { id: 0.0, iq: 0.0 }, Time::Uniform { start: 0.0, step: 2e-4 });
    let plant = Simulator::new(&motor).integrator(Rk45 { relative: 1e-10, absolute: 1e-12 });
    let run = plant.run(&truth, &rest, time, &inputs)?;
    let record = run.with_noise(Currents { id: 0.05, iq: 0.05 }, 7).experiment(&motor)?;

    let estimate = Fit::new(&motor, &record.initial(Currents { id: fixed(0.0), iq: fixed(0.0) }))
        .parameters(MappedWinding { rs: free(0.5).positive(), ke: free(0.8).positive(), flux: free(1.0).positive() })
        .run()?;
    println!("{estimate}");
    Ok(())
}
