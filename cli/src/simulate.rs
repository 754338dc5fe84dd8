//! `simulate`: what a model does with given parameters and the inputs of a record.

use crate::arguments::{ModelOptions, Simulate};
use crate::fitting::{declared, estimate, model, numbers};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, convert, output, records};
use greybox::layout::Layout;
use greybox::record::Record;
use greybox::{Fleet, fixed};

pub fn run(one: &Simulate, terminal: &Terminal) -> Result<Verdict, Failure> {
    output::check(one.out.as_deref(), &output::RECORDS)?;
    let model = model(one.model.as_deref(), &one.of_model.constant, terminal)?;
    let layout = model.equations().layout();
    let path = convert::only(&one.records, "file with the inputs")?;
    // Outputs need not be in the file; an estimate has an initial state.
    let measured = one.estimate.is_none() || !one.of_model.initial.is_empty();
    let inputs = records::inputs(&path, &model, &one.of_records, &one.of_model.initial, measured, terminal)?;
    let options = ModelOptions { values: one.of_model.clone(), ..Default::default() };
    let mut parameters = declared(&model, &options)?;
    let mut initial = None;
    if let Some(path) = &one.estimate {
        let found = estimate(path)?;
        if found.layout.parameters != layout.parameters {
            return Err(format!("{}: the estimate is of a model with other parameters", path.display()).into());
        }
        // What the command line sets is kept.
        let said = |name: &str| one.of_model.set.iter().chain(&one.of_model.fix).any(|(known, _)| known == name);
        let found = match found.of_record(&inputs) {
            Err(_) if found.own_parameters().iter().all(|j| said(&found.parameters[*j].name)) => found,
            own => own?,
        };
        for (parameter, found) in parameters.iter_mut().zip(&found.parameters) {
            if !said(&found.name) {
                *parameter = fixed(found.value);
            }
        }
        if let (Some(first), true) = (found.experiments.first(), one.of_model.initial.is_empty()) {
            initial = Some(first.initial_state.clone());
        }
    }
    let equations: &greybox::equations::Equations = model.equations();
    let mut fit = Fleet::new(equations).parameters(parameters);
    if let Some(name) = one.integrator.as_deref().or(model.integrator()) {
        fit = fit.integrator_by_name(name)?;
    }
    let initial = match initial {
        Some(initial) => initial,
        None => fit.initial_state(&inputs)?,
    };
    let simulated = fit.simulate(&initial, &inputs)?;
    let noise = numbers("--noise", &one.noise)?;
    let simulated = if noise.is_empty() { simulated } else { noisy(&simulated, layout, &noise, one.seed)? };
    convert::write(&simulated, one.out.as_deref())?;
    Ok(Verdict::Usable)
}

fn noisy(record: &Record, layout: &Layout, noise: &[(String, f64)], seed: u64) -> Result<Record, Failure> {
    let mut sigma = vec![0.0; layout.outputs.len()];
    for (name, value) in noise {
        let at = layout.outputs.iter().position(|output| output.name == *name);
        let available = || layout.outputs.iter().map(|output| output.name.clone()).collect();
        let unknown = || greybox::Error::Unknown { what: "output".into(), name: name.clone(), available: available() };
        let at = at.ok_or_else(unknown)?;
        if *value < 0.0 {
            return Err(format!(
                "--noise {name}: {value} is no standard deviation; give a positive number, or 0 for none"
            )
            .into());
        }
        sigma[at] = *value;
    }
    Ok(record.with_noise(&sigma, seed))
}
