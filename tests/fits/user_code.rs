//! The code that a user writes, as the design has it: it must compile and run as it stands.

use greybox::{Experiment, Fit, Huber, Model, Sample, Scalar, free, signals};

const SQRT_2_3: f64 = 0.816_496_580_927_726;

signals! { /// Stator currents in the rotor frame, phase peak.
pub struct Currents { id: "A", iq: "A" } }
signals! { pub struct Drive    { ud: "V", uq: "V", w: "rad/s" } }
signals! { pub struct Winding  { rs: "ohm", ls: "H", ke: "V s/rad" } }

struct Pmsm {
    pole_pairs: f64,
}

#[rustfmt::skip]
impl Model for Pmsm {
    type State = Currents;  type Input = Drive;  type Output = Currents;  type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = u.w * self.pole_pairs;
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * SQRT_2_3) / p.ls - we * x.id,
        }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> { *x }
}

/// A record with nothing random in it: half a second of a motor that is turned up and down.
fn record(model: &Pmsm, path: &std::path::Path) {
    use greybox::{Time, simulate};
    let samples = 4000;
    let time = Time::Uniform { start: 0.0, step: 0.126e-3 };
    let inputs: Vec<Drive> = (0..samples)
        .map(|k| {
            let t = k as f64 * 0.126e-3;
            let w = 200.0 * (12.0 * t).sin();
            Drive { ud: 20.0 * (40.0 * t).cos() - 0.3 * w, uq: 0.8 * w + 15.0 * (25.0 * t).sin(), w }
        })
        .collect();
    let truth = Winding { rs: 0.6, ls: 3.5e-3, ke: 0.9 };
    let simulated = simulate(model, &truth, &Currents { id: 0.0, iq: 0.0 }, time.clone(), &inputs).unwrap();
    // A deterministic stand-in for noise, small against the currents.
    let outputs = simulated
        .outputs
        .iter()
        .enumerate()
        .map(|(k, i)| Currents {
            id: i.id + 0.05 * (k as f64 * 2.399).sin(),
            iq: i.iq + 0.05 * (k as f64 * 1.618).cos(),
        })
        .collect();
    Experiment::new(model, time, inputs, outputs).unwrap().to_csv(path).unwrap();
}

#[test]
fn the_design_runs_as_written() -> Result<(), greybox::Error> {
    let folder = std::env::temp_dir().join(format!("greybox-user-code-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("record.csv");

    let model = Pmsm { pole_pairs: 4.0 };
    record(&model, &path);
    let record = Experiment::from_file(&model, &path)?;
    let estimate = Fit::new(&model, &record)
        .parameters(Winding { rs: free(1.0).within(0.01, 10.0), ls: free(2e-3), ke: free(0.7) })
        .noise(Currents { id: 0.05, iq: 0.05 })
        .weighting(|s: &Sample<Pmsm>| s.u.w.abs())
        .loss(Huber(1.345))
        .run()?;
    println!("{estimate}");
    let rs: f64 = estimate.parameters.rs;
    let next = estimate.predict(&model, &record)?;

    let two = [record.clone(), record];
    let both = Fit::new(&model, &two).parameters(Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) }).run()?;
    std::fs::remove_dir_all(&folder).unwrap();

    // The stand-in for noise is 0.05 A on currents of tens of amperes over 4000 samples: parts of a percent.
    assert!(estimate.outcome.converged(), "{}", estimate.outcome);
    assert!((rs / 0.6 - 1.0).abs() < 5e-3, "rs {rs}");
    assert!((both.parameters.ke / 0.9 - 1.0).abs() < 1e-3, "ke {}", both.parameters.ke);
    assert_eq!(next.outputs.len(), 4000);
    Ok(())
}
