//! Meaning of the findings and remedies, a sentence each.

use super::together::together;
use super::{Collinear, Excitation, Identifiability};
use crate::estimate::{Direction, Unknown};
use crate::numeral::{TimeUnit, counted, percent};
use crate::problem::Role;
use std::collections::BTreeSet;

/// An output that holds so much of an unknown's information is the only one that determines it.
const ONLY: f64 = 0.99;
/// More than this is not told from all.
const ALL: f64 = 0.999;
/// Part of an unknown's information from one tenth of a record, from which on the advice names it.
const ONCE: f64 = 0.9;

/// Sets that are put into words; the strongest come first.
const MENTIONED: usize = 3;

/// The sets of unknowns of the directions `warned` are left out; `levels` are parameters that stand in the noise of the model alone, which the
/// predictions do not use.
pub(super) fn advice(
    found: &Identifiability,
    (warned, levels): (&[Direction], &[usize]),
    unknowns: &[Unknown],
    time_unit: &TimeUnit,
) -> Vec<String> {
    let mut advice = vec![];
    let is_level = |excited: &Excitation, unknown: &Unknown| {
        excited.strength == 0.0 && matches!(unknown.role, Role::Parameter(p) if levels.contains(&p))
    };
    let all = found.excitation.iter().zip(unknowns);
    let n = unknowns.len() as u64 - all.filter(|(excited, unknown)| is_level(excited, unknown)).count() as u64;
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
    let is_warned = |set: &Collinear| warned.iter().any(|direction| names(&direction.moves) == names(&set.moves));
    for set in found.collinear.iter().take(MENTIONED).filter(|set| !is_warned(set)) {
        let left = set.index.map_or(0.0, f64::recip);
        advice.extend(together(&set.moves, left, unknowns).map(|text| text + "; fix one, or excite them apart"));
    }
    if let Some(more @ 1..) = found.collinear.len().checked_sub(MENTIONED) {
        advice.push(format!("{} of unknowns are hardly known but together", counted(more as u64, "more set")));
    }
    for (excited, unknown) in found.excitation.iter().zip(unknowns) {
        let name = &excited.name;
        if is_level(excited, unknown) {
            advice.push(format!(
                "`{name}` stands in the noise of the model alone (Model::noise, Model::diffusion), which this prediction does not use: take \
                 the predictor Kalman, which does, or fix it"
            ));
        } else if excited.segments.iter().all(|segment| segment.share == 0.0) {
            advice.push(format!("`{name}` moves no output by a slope: fix it, unless it stands in conditions"));
        }
    }
    // The beginning of a record is where initial states are seen, and nothing helps that.
    let of_parameters = found.excitation.iter().zip(unknowns);
    let of_parameters = of_parameters.filter(|(_, unknown)| matches!(unknown.role, Role::Parameter(_)));
    let of_parameters: Vec<&Excitation> = of_parameters.map(|(excited, _)| excited).collect();
    advice.extend(one_output(&of_parameters));
    advice.extend(of_parameters.iter().filter_map(|excited| one_moment(excited, time_unit)));
    advice
}

/// The names of unknowns that change together.
fn names(moves: &[(String, f64)]) -> BTreeSet<&str> {
    moves.iter().map(|(name, _)| name.as_str()).collect()
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

fn one_moment(excited: &Excitation, time_unit: &TimeUnit) -> Option<String> {
    let segment = excited.segments.iter().find(|segment| segment.share > ONCE)?;
    let begin = excited.segments.iter().find(|first| first.experiment == segment.experiment)?.from;
    (excited.segments.len() > 1).then(|| {
        format!(
            "`{}` is known from one tenth of `{}` alone, {} after its start ({})",
            excited.name,
            segment.experiment,
            time_unit.say(segment.from - begin, 3),
            percent(segment.share, 3)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::Segment;
    use super::*;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// An unknown that is seen by these parts through `y` and the rest through `z`, and so in the tenths of two records.
    fn excited(name: &str, through: f64, shares: [f64; 4]) -> Excitation {
        let segment = |(i, share): (usize, f64)| Segment {
            experiment: if i < 2 { "one" } else { "two" }.to_owned(),
            from: 10.0 + 5.0 * i as f64,
            share,
        };
        Excitation {
            name: name.to_owned(),
            strength: 1.0,
            outputs: vec![("y".to_owned(), through), ("z".to_owned(), 1.0 - through)],
            segments: shares.into_iter().enumerate().map(segment).collect(),
        }
    }

    /// Advice on these, at full rank or another one there and elsewhere, with so many collinear sets of `a`.
    fn advised(ranks: (u64, u64), sets: usize, excitation: &[Excitation]) -> Vec<String> {
        let inputs = [1.0, 2.0].map(|u| Voltage { u }).to_vec();
        let outputs = (0..2).map(|k| Current { i: f64::from(k) }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let estimate = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).run().unwrap();
        let unknown = |excited: &Excitation| Unknown { name: excited.name.clone(), ..estimate.unknowns[0].clone() };
        let unknowns: Vec<Unknown> = excitation.iter().map(unknown).collect();
        let set = Collinear { index: None, moves: vec![("a".to_owned(), 1.0), ("b".to_owned(), 1.0)] };
        let found = Identifiability {
            unknowns: vec![],
            rank: ranks.0,
            condition: None,
            generic_rank: ranks.1,
            collinear: vec![set; sets],
            excitation: excitation.to_vec(),
            advice: vec![],
        };
        // A direction of the same unknowns, in any order, takes the sets' place; one of others does not.
        let direction =
            |names: &[&str]| Direction { moves: names.iter().map(|name| ((*name).to_owned(), 1.0)).collect() };
        let left = |names: &[&str]| advice(&found, (&[direction(names)], &[]), &unknowns, &TimeUnit::default()).len();
        let all = advice(&found, (&[], &[]), &unknowns, &TimeUnit::default()).len();
        assert_eq!([left(&["a"]), left(&["a", "c"]), left(&["b", "a"])], [all, all, all - sets.min(MENTIONED)]);
        advice(&found, (&[], &[]), &unknowns, &TimeUnit::default())
    }

    const EVEN: [f64; 4] = [0.25; 4];

    #[test]
    fn ranks_and_sets_are_advised_on() {
        let two = [excited("a", 0.5, EVEN), excited("b", 0.5, EVEN)];
        assert_eq!(advised((2, 2), 0, &two), Vec::<String>::new());
        let said = advised((0, 1), 0, &two);
        assert!(
            said.len() == 1 && said[0].contains("to the 2 unknowns have rank 1: ") && said[0].contains("fix 1 of them")
        );
        let said = advised((1, 2), 0, &two);
        assert!(
            said.len() == 1 && said[0].starts_with("at the estimate") && said[0].contains("have rank 1, elsewhere")
        );
        // Three sets are named and the others counted.
        for (sets, last) in [(3, "`a` and `b`"), (4, "1 more set of unknowns"), (6, "3 more sets of unknowns")] {
            let said = advised((2, 2), sets, &two);
            assert_eq!(said.len(), sets.min(4));
            assert!(said[said.len() - 1].starts_with(last), "{said:?}");
            assert!(said[..3].iter().all(|one| one.ends_with("; fix one, or excite them apart")), "{said:?}");
        }
    }

    #[test]
    fn excitation_is_advised_on() {
        let said = advised((2, 2), 0, &[excited("a", 0.989, EVEN), excited("b", 0.011, EVEN)]);
        assert_eq!(said, Vec::<String>::new());
        let said = advised((2, 2), 0, &[excited("a", 0.992, EVEN), excited("b", 0.5, EVEN)]);
        assert_eq!(
            said,
            [
                "`a` is seen only through `y` (99.2 % of the information): `z` hardly depends on it, and cannot confirm it"
            ]
        );
        let said = advised((2, 2), 0, &[excited("a", 0.993, EVEN), excited("b", 0.9995, EVEN)]);
        assert!(
            said.len() == 1 && said[0].starts_with("`a`, `b` are seen only through `y` (at least 99.3 % of"),
            "{said:?}"
        );
        let said = advised((2, 2), 0, &[excited("a", 0.9992, EVEN), excited("b", 1.0, EVEN)]);
        assert!(said.len() == 1 && said[0].contains("`y` (more than 99.9 % of the information)"), "{said:?}");
        let said = advised((1, 1), 0, &[excited("a", 0.5, [0.02, 0.04, 0.03, 0.91])]);
        assert_eq!(said, ["`a` is known from one tenth of `two` alone, 5 s after its start (91 %)"]);
        assert!(advised((1, 1), 0, &[excited("a", 0.5, [0.04, 0.04, 0.03, 0.89])]).is_empty());
        let said = advised((1, 1), 0, &[excited("a", 0.5, [0.0; 4])]);
        assert_eq!(said, ["`a` moves no output by a slope: fix it, unless it stands in conditions"]);
        assert!(advised((1, 1), 0, &[excited("a", 0.5, [0.0, 0.0, 0.0, 0.5])]).is_empty());
    }
}
