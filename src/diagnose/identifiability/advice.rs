//! What the findings mean and what would help, a sentence each.

use super::together::together;
use super::{Excitation, Identifiability};
use crate::estimate::Unknown;
use crate::numeral::{counted, exact, number, percent};
use crate::problem::Role;
use crate::record::Record;

/// An output that holds so much of an unknown's information is the only one that determines it.
const ONLY: f64 = 0.99;
/// More than this is not told from all.
const ALL: f64 = 0.999;
/// So much of an unknown's information from one tenth of a record leaves little to the others.
const ONCE: f64 = 0.9;

/// Sets that are put into words; the strongest come first.
const MENTIONED: usize = 3;

pub(super) fn advice(found: &Identifiability, unknowns: &[Unknown], records: &[Record]) -> Vec<String> {
    let mut advice = vec![];
    let n = unknowns.len() as u64;
    if found.generic_rank < n {
        advice.push(format!(
            "wherever the parameters lie, the sensitivities to the {n} unknowns have rank {}: with these inputs and outputs no \
             record tells all of them apart; fix {} of them, or measure a further signal",
            found.generic_rank,
            n - found.generic_rank
        ));
    } else if found.rank < n {
        advice.push(format!(
            "at the estimate the sensitivities to the {n} unknowns have rank {}, elsewhere full rank: the estimate lies where \
             some of them lose their influence; start elsewhere",
            found.rank
        ));
    }
    for set in found.collinear.iter().take(MENTIONED) {
        let left = set.index.map_or(0.0, f64::recip);
        advice.extend(together(&set.moves, left, unknowns).map(|text| text + "; fix one, or excite them apart"));
    }
    if let Some(more @ 1..) = found.collinear.len().checked_sub(MENTIONED) {
        advice.push(format!("{} of unknowns are hardly known but together", counted(more as u64, "more set")));
    }
    for excited in &found.excitation {
        if excited.segments.iter().all(|segment| segment.share == 0.0) {
            advice.push(format!("`{}` moves no output at all: fix it", excited.name));
        }
    }
    // The beginning of a record is where initial states are seen, and nothing helps that.
    let of_parameters = found.excitation.iter().zip(unknowns);
    let of_parameters = of_parameters.filter(|(_, unknown)| matches!(unknown.role, Role::Parameter(_)));
    let of_parameters: Vec<&Excitation> = of_parameters.map(|(excited, _)| excited).collect();
    advice.extend(one_output(&of_parameters));
    advice.extend(of_parameters.iter().filter_map(|excited| one_moment(excited)));
    let inputs = records.first().map_or(&[][..], |record| record.inputs());
    for (i, input) in inputs.iter().enumerate() {
        let Some(&first) = input.values.first() else { continue };
        if records.iter().all(|record| record.inputs()[i].values.iter().all(|value| *value == first)) {
            advice.push(format!(
                "the input `{}` is {} throughout: what it drives cannot be told from an offset; vary it",
                input.name,
                exact(first)
            ));
        }
    }
    advice
}

/// Which parameters only one of several outputs determines, output by output.
fn one_output(parameters: &[&Excitation]) -> Vec<String> {
    let outputs = parameters.first().map_or(&[][..], |excited| &excited.outputs);
    let sentence = |j: usize| {
        let output = &outputs[j].0;
        let only: Vec<&&Excitation> = parameters.iter().filter(|excited| excited.outputs[j].1 > ONLY).collect();
        let least = only.iter().map(|excited| excited.outputs[j].1).reduce(f64::min)?;
        let names: Vec<String> = only.iter().map(|excited| format!("`{}`", excited.name)).collect();
        let others = outputs.iter().filter(|(name, _)| name != output);
        let others: Vec<String> = others.map(|(name, _)| format!("`{name}`")).collect();
        let (verb, them) = if names.len() == 1 { ("is", "it") } else { ("are", "them") };
        let part = match names.len() {
            _ if least > ALL => format!("more than {}", percent(ALL, 4)),
            1 => percent(least, 4),
            _ => format!("at least {}", percent(least, 4)),
        };
        let depend = if others.len() == 1 { "depends" } else { "depend" };
        Some(format!(
            "{} {verb} seen only through `{output}` ({part} of the information): {} hardly {depend} on {them}, and \
             cannot confirm {them}",
            names.join(", "),
            others.join(", ")
        ))
    };
    if outputs.len() < 2 { vec![] } else { (0..outputs.len()).filter_map(sentence).collect() }
}

fn one_moment(excited: &Excitation) -> Option<String> {
    let segment = excited.segments.iter().find(|segment| segment.share > ONCE)?;
    let begin = excited.segments.iter().find(|first| first.experiment == segment.experiment)?.from;
    (excited.segments.len() > 1).then(|| {
        format!(
            "`{}` is known from one tenth of `{}` alone, {} s after its start ({})",
            excited.name,
            segment.experiment,
            number(segment.from - begin, 3),
            percent(segment.share, 3)
        )
    })
}
