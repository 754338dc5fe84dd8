//! Whether parameters agree between parts of the data: from each output, from each record, from before and after a time in the records.

use super::*;
use crate::judge::evidence::parts::{APART, Difference, Into, LEVEL, Parts, UNLESS};
use crate::residuals::powers::COMPARED;
use crate::rows::pieces::{Piece, Rows};
use crate::rows::spans::{SPANS, span};

pub(crate) const PARTS: Check = Check::new(
    "parts of the data agree",
    "Where errors are colored or follow from the prediction, where records differ, or where that is not examined: \
     do outputs, records and what lies before and after a time give one set of parameters (Chow 1960, Quandt \
     1960)? Do records scatter more than their errors explain?",
    &[WarningCode::RecordsContradict, WarningCode::OutputsContradict, WarningCode::HalvesContradict],
    |evidence, intervals| {
        let mut found = contradictions(evidence, &intervals.unknowns);
        if found.iter().all(|warning| warning.code != WarningCode::RecordsContradict) {
            found.extend(differing(evidence, &intervals.unknowns, &intervals.covariances));
        }
        Examined::from(found).without(left_out(evidence))
    },
)
.unless(UNLESS)
.costs(&[Pass::Rows, Pass::Left])
.levels(&[
    level("the probability by chance", LEVEL, "one good record in ten thousand"),
    level("the distance of two values of a parameter, in standard errors", APART, "beside the test above"),
    level("the distance, in parts of the value, that is not usable", FAR_APART, "a quarter"),
]);

/// Values that differ by more than this part are not usable.
const FAR_APART: f64 = 0.25;

/// Which parts are not compared though others are.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    if evidence.weighs_variances() {
        return Some("parts of predicted variances with weights");
    }
    let many = evidence.point.objective.experiments() > COMPARED;
    (many && evidence.compare_parts()).then_some("pairs of records, of which there are more than 100")
}

/// Parameters that differ between outputs, records or times.
fn contradictions(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let found = [Into::Records, Into::Outputs, Into::Times].into_iter().filter_map(|into| {
        let mut parts = evidence.left().parts.iter().filter(|parts| parts.into == into);
        parts.find_map(|parts| Some(warning(evidence, parts, unknowns, parts.difference(&evidence.point)?)))
    });
    found.collect()
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
    Some(Warning::new(WarningCode::RecordsContradict, severity, text).about(About::Unknown(differing.unknown)))
}

fn warning(evidence: &Evidence<'_>, parts: &Parts, unknowns: &[Unknown], difference: Difference) -> Warning {
    let problem = evidence.point.objective.problem;
    let Difference { chance, unknown: i, pieces: [a, b], .. } = difference;
    let (unknown, slope) = (&unknowns[i], evidence.point.slopes[i]);
    let value = |piece: &Piece| unknown.value + slope * piece.step[i];
    let error = |piece: &Piece| {
        let unit = piece.linear.covariance(&piece.held).map_or(f64::NAN, |covariance| covariance.standard_error(i));
        (slope * unit).abs() * piece.variance_inflation.sqrt()
    };
    let (one, two) = (&parts.pieces[a], &parts.pieces[b]);
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
    let code = match parts.into {
        Into::Records => WarningCode::RecordsContradict,
        Into::Outputs => WarningCode::OutputsContradict,
        Into::Times => WarningCode::HalvesContradict,
    };
    let severity = if part > FAR_APART { Severity::NotUsable } else { Severity::UsableWithCare };
    Warning::new(code, severity, text).about(About::Unknown(i))
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
