//! `simulate`: what a model does with given parameters and the inputs of a record.

use crate::arguments::{ModelOptions, Simulate};
use crate::fitting::{declared, estimate, model, numbers, same_parameters, same_states};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, convert, output, records};
use greybox::graph::Id;
use greybox::layout::{Layout, Quantity};
use greybox::text::Model;
use greybox::{Fleet, fixed};
use std::path::PathBuf;

pub fn run(one: &Simulate, terminal: &Terminal) -> Result<Verdict, Failure> {
    output::check(one.out.as_deref(), &output::RECORDS)?;
    let model = model(one.model.as_deref(), &one.of_model.constant, terminal)?;
    let layout = model.equations().layout();
    let path = convert::only(&one.records, "file with the inputs")?;
    let read = one.model.iter().map(PathBuf::from).chain([path.clone()]).chain(one.estimate.clone());
    output::apart([&one.out], read)?;
    let stored = one.estimate.as_deref().map(estimate).transpose()?;
    // A record of the fit begins as the fit found it, for which outputs need not be in the file.
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let fitted = stored.iter().flat_map(|found| &found.experiments).find(|record| record.name == name);
    let fitted = fitted.filter(|_| one.of_model.initial.is_empty());
    let read = |measured| records::inputs(&path, &model, &one.of_records, &one.of_model.initial, measured, terminal);
    let inputs = read(fitted.is_none())?;
    // Another part of the file begins elsewhere.
    let as_found = fitted.is_some_and(|record| record.samples == inputs.len() as u64);
    let inputs = if fitted.is_some() && !as_found { read(true)? } else { inputs };
    let options = ModelOptions { values: one.of_model.clone(), ..Default::default() };
    let mut parameters = declared(&model, &options)?;
    // What the command line sets is kept.
    let said = |name: &str| one.of_model.set.iter().chain(&one.of_model.fix).any(|(known, _)| known == name);
    let mut found_state = None;
    if let (Some(found), Some(path)) = (stored, &one.estimate) {
        same_parameters(path, &found, layout)?;
        if as_found {
            same_states(path, &found, layout)?;
        }
        let found = match found.of_record(&inputs) {
            Err(_) if found.own_parameters().iter().all(|j| said(&found.parameters[*j].name)) => found,
            own => own?,
        };
        for (parameter, found) in parameters.iter_mut().zip(&found.parameters) {
            if !said(&found.name) {
                *parameter = fixed(found.value);
            }
        }
        found_state = found.experiments.first().filter(|_| as_found).map(|record| record.initial_state.clone());
    }
    let starts = layout.parameters.iter().zip(&parameters).filter(|(of, one)| one.free && !said(&of.name));
    let starts: Vec<&str> = starts.map(|(of, _)| of.name.as_str()).collect();
    if !starts.is_empty() {
        terminal.remark(format_args!(
            "the values of {} are the starts of a fit; --estimate, --set or --fix gives others",
            starts.join(", ")
        ));
    }
    let equations: &greybox::equations::Equations = model.equations();
    let mut fit = Fleet::new(equations).parameters(parameters);
    if let Some(name) = one.integrator.as_deref().or(model.integrator()) {
        fit = fit.integrator_by_name(name)?;
    }
    let initial = match found_state {
        Some(initial) => initial,
        None => fit.initial_state(&inputs)?,
    };
    if one.of_model.initial.is_empty() && !initial.is_empty() {
        let states = layout.states.iter().zip(&initial);
        let states: Vec<String> = states.map(|(of, value)| format!("{} = {value}", of.name)).collect();
        let origin = match as_found {
            true => format!("record `{name}` of the estimate begins"),
            false => "as the model says, or from zero, the record begins".to_owned(),
        };
        terminal.remark(format_args!("{origin} at {}; --initial gives another state", states.join(", ")));
    }
    let noise = noise(layout, &numbers("--noise", &one.noise)?)?;
    let simulated = if one.noisy {
        if !has_noise(&model, &noise) {
            terminal.remark("--noisy: the model has no noise; it says `noise` of outputs and `diffusion` of states");
        }
        fit.simulate_noisy(&initial, &inputs, &noise, one.seed)?
    } else {
        if let Some(text) = left_out(&model, &noise) {
            terminal.remark(text);
        }
        let simulated = fit.simulate(&initial, &inputs)?;
        let sigma: Vec<f64> = noise.iter().map(|sigma| sigma.unwrap_or(0.0)).collect();
        simulated.with_noise(&sigma, one.seed)
    };
    convert::write(&simulated, one.out.as_deref())?;
    Ok(Verdict::Usable)
}

/// The names of the quantities of a model of which it says a level of noise.
fn with_levels(model: &Model, quantities: &[Quantity], roots: &[Id]) -> Vec<String> {
    let has_level = |root: Id| {
        let (level, roots) = model.equations().graph().pruned(&[root]);
        // What is not declared is a number, zero or none.
        level.len() > 1 || level.evaluate::<f64>(&roots, |_| 1.0).iter().any(|value| *value > 0.0)
    };
    let with = quantities.iter().zip(roots).filter(|(_, root)| has_level(**root));
    with.map(|(quantity, _)| quantity.name.clone()).collect()
}

/// Outputs and states whose noise the model says, but outputs of which the command line says another.
fn of_model(model: &Model, said: &[Option<f64>]) -> [Vec<String>; 2] {
    let (layout, roots) = (model.equations().layout(), model.equations().roots());
    let mut outputs = with_levels(model, &layout.outputs, &roots.noise);
    let is_said = |name: &String| layout.outputs.iter().zip(said).any(|(of, said)| of.name == *name && said.is_some());
    outputs.retain(|output| !is_said(output));
    [outputs, with_levels(model, &layout.states, &roots.diffusion)]
}

fn has_noise(model: &Model, said: &[Option<f64>]) -> bool {
    of_model(model, said).iter().any(|names| !names.is_empty()) || said.iter().any(Option::is_some)
}

/// Says which noise of the model a simulation is without.
fn left_out(model: &Model, said: &[Option<f64>]) -> Option<String> {
    let [outputs, states] = of_model(model, said);
    let parts = [("noise", outputs), ("diffusion", states)].into_iter().filter(|(_, names)| !names.is_empty());
    let parts: Vec<String> = parts.map(|(what, names)| format!("`{what}` of {}", names.join(", "))).collect();
    (!parts.is_empty())
        .then(|| format!("simulated without {} of the model; --noisy simulates with it", parts.join(" and ")))
}

/// The standard deviation of each output that the command line gives.
fn noise(layout: &Layout, given: &[(String, f64)]) -> Result<Vec<Option<f64>>, Failure> {
    let mut sigma = vec![None; layout.outputs.len()];
    for (name, value) in given {
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
        sigma[at] = Some(*value);
    }
    Ok(sigma)
}
