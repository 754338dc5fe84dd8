//! The same parameters from parts of the data: from each output, from each record, from before and after a time in the records.
//!
//! At the minimum each part has a triangle of its own, and with it a step to the minimum that it would have by itself. If
//! all parts follow one model, what they gain by steps of their own over the common one is noise: Fisher's F with as many
//! degrees of freedom as they have steps more (Chow, Econometrica 28 (1960) 591), and those of the noise of the shortest part. Errors
//! that are correlated over time, also without what contradicts the common step, count for fewer. The time at which a plant may have changed,
//! or one run may have been joined to another, is not known: of several that gain most (Quandt, J. American Statistical Association 55
//! (1960) 324) is tested, at a level divided by their number.

mod left;
mod pieces;

use crate::estimate::{Unknown, Warning, WarningCode};
use crate::information::Information;
use crate::judge::check::{Check, Examined, Level, Pass};
use crate::judge::covariances::Covariances;
use crate::judge::evidence::Evidence;
use crate::judge::evidence::powers::COMPARED;
use crate::judge::evidence::spans::{LEVEL, SPANS, Spans, span};
use crate::numeral::{number, p_value, percent, unit_after};
use crate::optimize::{Linearization, Severity};
use crate::problem::{Objective, Role};
use crate::whiteness::chi_squared_tail;
use pieces::{Piece, Rows, pieces};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

pub(crate) const PARTS: Check = Check {
    name: "parts of the data agree",
    asks: "Where errors are colored or follow from the prediction, where records differ, or where that is not examined: do outputs, records and what lies before and after a time give one set of parameters (Chow 1960, Quandt 1960)? Do records scatter more than their errors explain?",
    codes: &[WarningCode::RecordsContradict, WarningCode::OutputsContradict, WarningCode::HalvesContradict],
    costs: &[Pass::Rows, Pass::Slopes(4)],
    levels: &[
        Level { of: "the probability by chance", value: LEVEL, source: "one good record in ten thousand" },
        Level {
            of: "the distance of two values of a parameter, in standard errors",
            value: APART,
            source: "beside the test above",
        },
        Level { of: "the distance, in parts of the value, that is not usable", value: FAR_APART, source: "a quarter" },
    ],
    examine: |evidence, intervals| {
        Examined::unless(evidence.without_parts(), || {
            let mut found = contradictions(evidence, &intervals.unknowns);
            if found.iter().all(|warning| warning.code != WarningCode::RecordsContradict) {
                found.extend(differing(evidence, &intervals.unknowns, &intervals.covariances));
            }
            found
        })
        .without(left_out(evidence))
    },
};

/// A parameter is named if its values from two parts of the data differ by more than this many standard errors, where the test above
/// has found a difference. If they differ by more than the second (relative), the estimate is not usable.
const APART: f64 = 3.0;
const FAR_APART: f64 = 0.25;
/// The fewest of the parts of a record before and after a time at which all may have changed.
const FEWEST: usize = 2;
/// From so many degrees of freedom of the noise on, Fisher's F is chi squared.
const MANY: f64 = 1e5;

/// Which parts are not compared though others are.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    let many = evidence.point.objective.experiments() > COMPARED;
    (many && evidence.compare_parts()).then_some("pairs of records, of which there are more than 100")
}

/// Parameters that differ between outputs, records or times.
fn contradictions(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let objective = evidence.point.objective;
    if !evidence.compare_parts() {
        return vec![];
    }
    let diagonal = objective.with(crate::problem::Whitening::Diagonal(objective.whitening.sigma()));
    let Some(all) = &evidence.rows().spans else { return vec![] };
    // Of each kind the ways in which the data may be taken apart. Where one run was joined to another, the part behind may be of neither: it
    // is left out in a second group of ways.
    let mut kinds: Vec<(WarningCode, Vec<Vec<Vec<Rows>>>)> = vec![];
    if (2..=COMPARED).contains(&all.len()) {
        kinds.push((WarningCode::RecordsContradict, vec![vec![(0..all.len()).map(Rows::Record).collect()]]));
    }
    if objective.outputs() > 1 {
        kinds.push((WarningCode::OutputsContradict, vec![vec![(0..objective.outputs()).map(Rows::Output).collect()]]));
    }
    if !evidence.point.is_static() {
        let group = |without: usize| {
            let at = |parts: usize| vec![Rows::Before(parts), Rows::After(parts + without)];
            (FEWEST..=SPANS - FEWEST - without).map(at).collect()
        };
        kinds.push((WarningCode::HalvesContradict, vec![group(0), group(1)]));
    }
    let of = |(code, groups): (WarningCode, Vec<Vec<Vec<Rows>>>)| {
        let tests = groups.iter().map(Vec::len).sum::<usize>() as f64;
        groups.into_iter().find_map(|ways| contradiction(evidence, (&diagonal, all), unknowns, code, (ways, tests)))
    };
    kinds.into_iter().filter_map(of).collect()
}

/// What differs between pieces, by the way of these that gains most; of so many that are tested.
fn contradiction(
    evidence: &Evidence<'_>,
    (diagonal, all): (&Objective<'_>, &[Spans]),
    unknowns: &[Unknown],
    code: WarningCode,
    (ways, tests): (Vec<Vec<Rows>>, f64),
) -> Option<Warning> {
    let ways = ways.into_iter().filter_map(|rows| {
        let pieces = pieces(evidence, all, &rows);
        let difference = compared(evidence, &pieces, unknowns, tests)?;
        Some((pieces, difference))
    });
    let (mut pieces, _) = ways.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))?;
    // Only now, since it takes another pass. Samples of static models have no order.
    if !evidence.point.is_static() {
        let dependences = left::dependences(diagonal, &evidence.point.end.coordinates, &pieces)?;
        pieces.iter_mut().zip(dependences).for_each(|(piece, of_errors)| piece.dependence *= of_errors);
    }
    Some(warning(evidence, &pieces, unknowns, code, compared(evidence, &pieces, unknowns, tests)?))
}

/// The unknown that records say different things of, by records as clusters: of more records than are compared one by one.
fn differing(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let differing = covariances.differing.as_ref()?;
    let unknown = &unknowns[differing.unknown];
    let error =
        unknown.knowledge.standard_error().filter(|_| differing.chance < LEVEL && evidence.point.degrees > 0.0)?;
    // The variance by the records is that by their errors and that of a mean of records which differ.
    let apart = error * (differing.equal * (1.0 - differing.ratio.recip())).sqrt();
    let part = apart / unknown.value.abs().max(f64::MIN_POSITIVE);
    let text = format!(
        "`{}` differs from record to record by more than the errors do ({} records, {}): by about {}{} ({} of itself, one standard \
         deviation); its interval is that of a mean over such records; give each record its own (Parameter::per_experiment), check whether all \
         are of one plant, and what the model leaves out",
        unknown.name,
        differing.records,
        p_value(differing.chance),
        number(apart, 2),
        unit_after(&unknown.unit),
        percent(part, 2)
    );
    let severity = if part > FAR_APART { Severity::NotUsable } else { Severity::UsableWithCare };
    Some(Warning { code: WarningCode::RecordsContradict, severity, text })
}

/// A difference between pieces that is no chance: its probability, over all ways of taking the data apart, what the pieces gain by steps of
/// their own, the parameter that differs most, and the two pieces.
struct Difference {
    chance: f64,
    gain: f64,
    unknown: usize,
    pieces: [usize; 2],
}

/// Whether pieces follow one set of parameters, of so many ways that are tested.
fn compared(evidence: &Evidence<'_>, pieces: &[Piece], unknowns: &[Unknown], tests: f64) -> Option<Difference> {
    let first = pieces.first().filter(|_| pieces.len() > 1)?;
    let dependence = pieces.iter().map(|piece| piece.dependence).fold(1.0, f64::max);
    let shared = evidence.point.objective.problem.unknowns.shared();
    let mut whole: Vec<Information> = first.linear.columns().map(|(triangle, _)| triangle.clone()).collect();
    for piece in &pieces[1..] {
        whole.iter_mut().zip(piece.linear.columns()).for_each(|(all, (one, _))| all.merge(one));
    }
    let whole = Piece::new(first.rows, Linearization::new(0.0, shared, whole), &evidence.point.undetermined.held)?;
    let free = |piece: &Piece| piece.held.iter().filter(|held| !**held).count() as f64;
    let degrees = pieces.iter().map(free).sum::<f64>() - free(&whole);
    let gain = pieces.iter().map(|piece| piece.gain).sum::<f64>() - whole.gain;
    let of_noise = pieces.iter().map(|piece| piece.degrees).fold(f64::INFINITY, f64::min) / dependence;
    let chance = significant(gain / dependence, degrees, of_noise, tests)?;
    let (unknown, a, b, _) = furthest(pieces, unknowns)?;
    Some(Difference { chance, gain, unknown, pieces: [a, b] })
}

fn warning(
    evidence: &Evidence<'_>,
    pieces: &[Piece],
    unknowns: &[Unknown],
    code: WarningCode,
    difference: Difference,
) -> Warning {
    let problem = evidence.point.objective.problem;
    let Difference { chance, unknown: i, pieces: [a, b], .. } = difference;
    let (unknown, slope) = (&unknowns[i], evidence.point.slopes[i]);
    let value = |piece: &Piece| unknown.value + slope * piece.step[i];
    let error = |piece: &Piece| {
        let unit = piece.linear.covariance(&piece.held).map_or(f64::NAN, |covariance| covariance.standard_error(i));
        (slope * unit).abs() * piece.dependence.sqrt()
    };
    let (one, two) = (&pieces[a], &pieces[b]);
    let part = (value(one) - value(two)).abs() / unknown.value.abs().max(f64::MIN_POSITIVE);
    let name = |piece: &Piece| match piece.rows {
        Rows::Record(e) => format!("`{}` alone", problem.unknowns.labels[e]),
        Rows::Output(j) => format!("`{}` alone", problem.layout().outputs[j].name),
        Rows::Before(parts) => time(evidence, parts, ["first", "before"]),
        Rows::After(parts) => time(evidence, parts, ["second", "from"]),
    };
    let said = |piece: &Piece| format!("{} +- {} by {}", number(value(piece), 4), number(error(piece), 2), name(piece));
    let text = format!(
        "`{}` is {} and {} ({} apart; Chow's test {}): check gains, signs and delays of the sensors, whether all data are of \
         one plant, and what the model leaves out",
        unknown.name,
        said(one),
        said(two),
        percent(part, 2),
        p_value(chance)
    );
    let severity = if part > FAR_APART { Severity::NotUsable } else { Severity::UsableWithCare };
    Warning { code, severity, text }
}

/// What lies before or after a time in each record.
fn time(evidence: &Evidence<'_>, parts: usize, [half, side]: [&str; 2]) -> String {
    match evidence.point.objective.problem.records.as_slice() {
        _ if 2 * parts == SPANS => format!("the {half} half of the data"),
        [record] => {
            let sample = (0..record.len()).find(|&sample| span(sample, record.len()) >= parts).unwrap_or(0);
            format!("the data {side} t = {}", record.time_unit().say(record.time(sample), 4))
        }
        _ => format!("the data {side} {} of each record", percent(parts as f64 / SPANS as f64, 2)),
    }
}

/// The parameter that differs most between two pieces, in standard errors: its number, and those of the pieces.
fn furthest(pieces: &[Piece], unknowns: &[Unknown]) -> Option<(usize, usize, usize, f64)> {
    let mut found: Option<(usize, usize, usize, f64)> = None;
    let covariances: Vec<_> = pieces.iter().map(|piece| piece.linear.covariance(&piece.held)).collect();
    for (i, unknown) in unknowns.iter().enumerate().filter(|(_, u)| matches!(u.role, Role::Parameter(_))) {
        for (a, b) in (0..pieces.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
            let (Some(first), Some(second)) = (&covariances[a], &covariances[b]) else { continue };
            if pieces[a].held[i] || pieces[b].held[i] {
                continue;
            }
            let error = |covariance: &crate::information::Covariance, piece: usize| {
                covariance.standard_error(i) * pieces[piece].dependence.sqrt()
            };
            let apart = (pieces[a].step[i] - pieces[b].step[i]).abs() / error(first, a).hypot(error(second, b));
            if apart > found.map_or(APART, |(_, _, _, most)| most) && unknown.value != 0.0 {
                found = Some((i, a, b, apart));
            }
        }
    }
    found
}

/// Probability that pieces of one plant gain as much by steps of their own in one of so many ways, if it is below the level: by Fisher's F with
/// the degrees of freedom of the steps and of the noise.
fn significant(gain: f64, degrees: f64, of_noise: f64, tests: f64) -> Option<f64> {
    if degrees < 1.0 || of_noise.is_nan() || of_noise < 1.0 {
        return None;
    }
    let fisher = FisherSnedecor::new(degrees, of_noise).ok().filter(|_| of_noise < MANY);
    let chance = fisher.map_or_else(|| chi_squared_tail(gain, degrees), |fisher| fisher.sf((gain / degrees).max(0.0)));
    (tests * chance <= LEVEL).then_some(tests * chance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 0.01 % points of chi-squared with 1 and 2 degrees of freedom are 15.137 and `-2 ln 1e-4 = 18.421`; of two ways the level of each is
    /// half of that: `-2 ln 5e-5 = 19.807`. With 2 and `n` degrees of freedom Fisher's F is beyond `f` with probability
    /// `(1 + 2 f / n)^(-n / 2)`: 1e-4 at `f = 6 (1e4^(1/6) - 1)` for `n = 12`.
    #[test]
    fn contradictions_begin_at_their_level() {
        let said =
            |gain: f64, degrees: f64, of_noise: f64, tests: f64| significant(gain, degrees, of_noise, tests).is_some();
        let all = f64::INFINITY;
        assert!(said(15.14, 1.0, all, 1.0) && !said(15.13, 1.0, all, 1.0));
        assert!(said(18.43, 2.0, all, 1.0) && !said(18.41, 2.0, all, 1.0) && !said(99.0, 0.0, all, 1.0));
        assert!(said(19.81, 2.0, all, 2.0) && !said(19.80, 2.0, all, 2.0));
        let f = 6.0 * (1e4f64.powf(1.0 / 6.0) - 1.0);
        assert!(said(2.0 * f * 1.001, 2.0, 12.0, 1.0) && !said(2.0 * f * 0.999, 2.0, 12.0, 1.0));
        assert!(!said(1e9, 2.0, 0.5, 1.0) && !said(1e9, 2.0, f64::NAN, 1.0));
    }
}
