//! Times the fit of a motor record: `speed N REPS` reads `data_N.bin` (or `fleet.bin`) from the folder `$PEERDATA`, fits it
//! REPS times and prints the process CPU time of one fit as a line of JSON: `cpu_med` the median, `cpu_first` that of the
//! first one, which compiles the model.
//!
//! It shows no progress, which would take time of the process that is measured.
//!
//! The files hold little-endian `f64` rows `[ud, uq, w, id, iq]`; row k was measured at `k * 0.126 ms`.

use greybox::optimize::{LevenbergMarquardt, Stop};
use greybox::pmsm::{Currents, Drive, SQRT_2_3, Winding};
use greybox::{Estimate, Experiment, ExperimentOf, Fit, Fleet, Model, Records, Scalar, Time, free, optimize::OwnSize};
use std::error::Error;

struct Pmsm {
    pole_pairs: f64,
}

impl Model for Pmsm {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = u.w * self.pole_pairs;
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * SQRT_2_3) / p.ls - we * x.id,
        }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

const SAMPLE_TIME: f64 = 0.126e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, size, repetitions] = arguments.as_slice() else { return Err("usage: speed N|fleet REPS".into()) };
    let folder = std::env::var("PEERDATA").unwrap_or_else(|_| "data".to_owned());
    let many = size == "fleet";
    let path = if many { format!("{folder}/fleet.bin") } else { format!("{folder}/data_{size}.bin") };
    let model = Pmsm { pole_pairs: 4.0 };
    let records = read(&model, &path, if many { 2000 } else { usize::MAX })?;
    let mut times = vec![];
    let (mut cost, mut passes) = (0.0, 0);
    let fleet = fit(Fleet::new(&model)).fleet()?;
    for _ in 0..repetitions.parse()? {
        let begin = cpu_time();
        let fits: Vec<Estimate<Pmsm>> = match records.as_slice() {
            [record] => vec![fleet.fit(record)?],
            _ => fleet.run(records.iter().cloned()).collect::<Result<_, _>>()?,
        };
        times.push(cpu_time() - begin);
        cost = fits.iter().map(|fit| fit.cost).sum();
        passes = fits.iter().map(|fit| fit.evaluations).sum::<u64>() / fits.len() as u64;
    }
    let first = *times.first().ok_or("REPS must be at least 1")?;
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    let size = if many { "\"fleet\"".to_owned() } else { size.clone() };
    println!(
        "{{\"peer\": \"greybox\", \"N\": {size}, \"cpu_med\": {median:e}, \"cpu_first\": {first:e}, \"iters\": {passes}, \"jevals\": {passes}, \
         \"cost\": {cost:.12e}, \"rss_mb\": {:.1}}}",
        peak_memory()
    );
    Ok(())
}

fn fit<'a>(records: Records<'a, Pmsm>) -> Fit<'a, Pmsm> {
    let stop = Stop { cost: 1e-10, ..Stop::default() };
    records
        .parameters(Winding { rs: free(1.2), ls: free(1.75e-3), ke: free(0.63) })
        .noise(Currents { id: 1.0, iq: 1.0 })
        .optimizer(LevenbergMarquardt::new(stop, OwnSize))
}

fn read(model: &Pmsm, path: &str, samples: usize) -> Result<Vec<ExperimentOf<Pmsm>>, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let numbers: Vec<f64> =
        bytes.chunks_exact(8).map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])).collect();
    drop(bytes);
    let record = |rows: &[f64]| {
        let column = |i: usize| rows.chunks_exact(5).map(|row| row[i]).collect::<Vec<f64>>();
        let (inputs, outputs) = (vec![column(0), column(1), column(2)], vec![column(3), column(4)]);
        Experiment::from_columns(model, Time::Uniform { start: 0.0, step: SAMPLE_TIME }, inputs, outputs)
    };
    Ok(numbers.chunks(samples.saturating_mul(5)).map(record).collect::<Result<_, _>>()?)
}

/// CPU time of all threads of this process (s), from the system's own account.
fn cpu_time() -> f64 {
    let time = cpu_time::ProcessTime::now().as_duration();
    time.as_secs_f64()
}

/// Largest memory of this process so far (MB); zero where the system does not tell.
fn peak_memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}
