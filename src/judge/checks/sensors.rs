//! Whether a sensor has a gain, an offset or a delay that the model does not have.

mod cut_off;

use super::*;
use crate::judge::evidence::extended::UNTESTED;
use crate::judge::evidence::extended::{Extended, LEVEL, Released};
use crate::judge::evidence::left::Sensor;
use crate::rows::sensors::{KINDS, Kind};

pub(crate) const SENSORS: Check = Check::new(
    "sensors have the model's gain, offset and delay",
    "Does a gain, an offset or a delay of an output, as one more unknown, explain the errors (score test, Rao \
     1948; confirmed by White 1980 and for autocorrelated errors), or may a quantized output have been truncated?",
    &[WarningCode::SensorContradicts, WarningCode::CoarseOutput],
    |evidence, intervals| sensors(evidence, &intervals.unknowns).into(),
)
.unless(UNTESTED)
.costs(&[Pass::Rows, Pass::Left])
.levels(&[
    level("the probability by chance, over all regressors", LEVEL, "one good record in ten thousand"),
    level("the part of a parameter that is a note", NOTHING, "no digit of it changes"),
    level("the part of a parameter that is not usable", FAR, "a quarter"),
]);

/// The estimate is not usable where the fault moves a parameter by more than `FAR` of itself; below `NOTHING` it is a note.
const FAR: f64 = 0.25;
const NOTHING: f64 = 1e-4;
/// Regressors whose sum of squares is within this many variances of the least (a chance of 0.002) explain the errors as well: of the gains of
/// two sensors, often only the ratio is determined. At most so many are said.
const AS_WELL: f64 = 10.0;
const SAID: usize = 3;

/// What is wrong with outputs, or may be.
fn sensors(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let Some(extended) = Extended::new(evidence) else { return vec![] };
    match evidence.left().sensor.as_ref().and_then(|sensor| contradiction(&extended, sensor, unknowns)) {
        Some(warning) => vec![warning],
        None => cut_off::cut_off(&extended, unknowns),
    }
}

/// What most certainly is wrong with an output, and what explains the errors as well.
fn contradiction(extended: &Extended<'_>, sensor: &Sensor, unknowns: &[Unknown]) -> Option<Warning> {
    let Sensor { found, tests, standard_error, chance } = sensor;
    let (first, chance) = (found.first()?, chance * tests);
    let wider = standard_error / first.standard_error;
    let as_well = first.left * (1.0 + AS_WELL * wider * wider / extended.degrees());
    let found = found.iter().filter(|one| one.left <= as_well).take(SAID);
    let said = found.map(|one| said(extended, one, wider, unknowns));
    let (said, severities): (Vec<String>, Vec<Severity>) = said.unzip();
    let severity = severities.into_iter().max().filter(|_| chance < LEVEL)?;
    let text = format!(
        "{} ({}): check unit, gain, zero, filter and dead time of the sensor, and what the model leaves out; no interval allows for it",
        said.join(", or "),
        p_value(chance)
    );
    Some(Warning::new(WarningCode::SensorContradicts, severity, text))
}

/// What is wrong with a sensor, by so many times its standard error, and how far that moves a parameter; and how severe that is.
fn said(extended: &Extended<'_>, found: &Released, wider: f64, unknowns: &[Unknown]) -> (String, Severity) {
    let output = &extended.evidence.point.objective.problem.layout().outputs[found.number / KINDS];
    let furthest = extended.furthest(&found.step, unknowns);
    let (value, error) = (found.value, number(wider * found.standard_error, 2));
    let is = match Kind::ALL[found.number % KINDS] {
        Kind::Gain => format!("is {} +- {error} times what the model predicts", number(1.0 + value, 4)),
        Kind::Offset => {
            format!("lies {} +- {error}{} beside what the model predicts", number(value, 3), unit_after(&output.unit))
        }
        Kind::Delay => {
            let order = if value > 0.0 { "after" } else { "before" };
            format!("comes {} +- {error} samples {order} what the model predicts", number(value.abs(), 3))
        }
    };
    let moved = furthest.map_or(String::new(), |(name, part, errors)| {
        format!(" with `{name}` {} ({} standard errors) away from this estimate", percent(part, 2), number(errors, 2))
    });
    let severity = match furthest {
        Some((_, part, _)) if part > FAR => Severity::NotUsable,
        Some((_, part, _)) if part <= NOTHING => Severity::Usable,
        _ => Severity::UsableWithCare,
    };
    (format!("`{}` {is}{moved}", output.name), severity)
}
