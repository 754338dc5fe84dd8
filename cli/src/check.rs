//! `check`: a model and records without a fit.

use crate::arguments::Check;
use crate::fitting::{declared, model};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fitting, output, records};
use greybox::diagnose::identifiability;
use greybox::record::{ChannelInspection, Record};
use greybox::{Parameter, text::Model};

pub fn run(one: &Check, terminal: &Terminal) -> Result<Verdict, Failure> {
    let model = model(one.model.as_deref(), &one.of_model.values.constant, terminal)?;
    let parameters = declared(&model, &one.of_model)?;
    output::line(described(&model, &parameters))?;
    let mut verdict = if model.warnings().is_empty() { Verdict::Usable } else { Verdict::WithCare };
    if one.records.is_empty() {
        return Ok(verdict);
    }
    let records = records::all(&one.records, &model, &one.of_records, &one.of_model.values.initial, terminal)?;
    for record in &records {
        let (text, remarks) = looked_at(record);
        output::line(text)?;
        if remarks {
            verdict = verdict.max(Verdict::WithCare);
        }
    }
    if parameters.iter().any(|parameter| parameter.free) {
        verdict = verdict.max(told_apart(&model, &records, &parameters)?);
    }
    Ok(verdict)
}

/// The model in a few lines.
fn described(model: &Model, parameters: &[Parameter]) -> String {
    let layout = model.equations().layout();
    let list = |of: &[greybox::layout::Quantity]| {
        let one = |quantity: &greybox::layout::Quantity| match quantity.unit.as_str() {
            "" | "1" => quantity.name.clone(),
            unit => format!("{} ({unit})", quantity.name),
        };
        let all: Vec<String> = of.iter().map(one).collect();
        if all.is_empty() { "none".to_owned() } else { all.join(", ") }
    };
    let name = if model.name().is_empty() { "model" } else { model.name() };
    let free = parameters.iter().filter(|parameter| parameter.free).count();
    format!(
        "{name}: {:?}\nstates: {}\ninputs: {}\noutputs: {}\nparameters: {} ({free} free)",
        layout.kind,
        list(&layout.states),
        list(&layout.inputs),
        list(&layout.outputs),
        list(&layout.parameters)
    )
}

/// A record in a few lines, and whether something about it is odd.
fn looked_at(record: &Record) -> (String, bool) {
    let (unit, last) = (record.time_unit(), record.moment(record.len() - 1));
    let mut text = format!(
        "\nrecord {}: {} samples, {} to {last}, {:.4e} {} from sample to sample",
        record.name(),
        record.len(),
        unit.convert(record.time(0)),
        unit.convert(record.sample_time()),
        unit.name()
    );
    let gaps = record.gaps();
    for gap in gaps.iter().take(5) {
        text += &format!("\n  gap: from {} to {} nothing was recorded", gap.from, gap.to);
    }
    if gaps.len() > 5 {
        text += &format!("\n  and {} gaps more", gaps.len() - 5);
    }
    let inspection = record.inspect();
    let mut odd = !gaps.is_empty();
    let inputs = record.inputs().iter().zip(&inspection.inputs).map(|one| (one, true));
    let outputs = record.outputs().iter().zip(&inspection.outputs).map(|one| (one, false));
    for ((channel, found), is_input) in inputs.chain(outputs) {
        let found: &ChannelInspection = found;
        // An input may well have few values, a square wave for one.
        odd |= !found.suspicions.is_empty() || !is_input && !found.remarks().is_empty();
        let range = found.range.map_or("nothing".to_owned(), |(least, greatest)| format!("{least} to {greatest}"));
        let unit = if channel.unit == "1" { "" } else { &channel.unit };
        text += format!("\n  {}: {range} {unit}", channel.name).trim_end();
        for remark in found.remarks() {
            text += &format!("\n    {remark}");
        }
    }
    (text, odd)
}

/// What the data can tell apart, where the parameters are as declared.
fn told_apart(model: &Model, records: &[Record], parameters: &[Parameter]) -> Result<Verdict, Failure> {
    let problem = fitting::fit(model, records, parameters, &Default::default())?.problem()?;
    let start: Vec<f64> = problem.start();
    let estimate = problem.estimate(&start)?;
    let found = identifiability(&problem, &estimate)?;
    let unknowns = estimate.unknowns.len();
    let condition = found.condition.map_or(String::new(), |condition| format!(", condition number {condition:.3}"));
    output::line(format!(
        "\nat the declared values {} of {unknowns} unknowns are told apart by the data{condition}",
        found.rank
    ))?;
    for advice in &found.advice {
        output::line(format!("  {advice}"))?;
    }
    Ok(if found.advice.is_empty() { Verdict::Usable } else { Verdict::WithCare })
}
