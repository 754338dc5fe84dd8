//! [`Left`]: what the errors that remain after other steps say, in one pass for all steps that parts of the data and sensors ask for.
//!
//! At the common estimate, a contradiction between parts makes the errors correlated by itself. How many errors have the information of
//! one is therefore taken from those that remain when each part has taken its own step. A fault of a sensor is tested again for errors of
//! changing variance (White, Econometrica 48 (1980) 817) and autocorrelated ones.

mod of_sensor;

use super::Evidence;
use super::extended::{Extended, Released, UNTESTED};
use super::parts::{Parts, parts};
use crate::problem::Whitening;
use crate::rows::of_pieces::{OfPieces, inflations};
use crate::rows::of_sensor::{OfSensor, SumOfSensor};
use crate::rows::pieces::Piece;
use of_sensor::{confirm, steps};

/// What remains after the steps that are asked for.
#[derive(Default)]
pub(crate) struct Left {
    /// Parts of the data that seem to differ, with the inflation of their errors.
    pub parts: Vec<Parts>,
    pub sensor: Option<Sensor>,
}

/// Faults of sensors.
pub(crate) struct Sensor {
    /// The one that explains most first, with the number of those that were tested.
    pub found: Vec<Released>,
    pub tests: f64,
    /// Its standard error and its probability by chance.
    pub standard_error: f64,
    pub chance: f64,
}

/// By one pass with slopes, if there is anything to be examined; nothing where that fails.
pub(crate) fn left(evidence: &Evidence<'_>) -> Left {
    let point = &evidence.point;
    let single = point.objective.with(Whitening::Diagonal(point.objective.whitening.sigma()));
    let mut parts = parts(evidence);
    let extended = if evidence.ruled_out(UNTESTED).is_none() { Extended::new(evidence) } else { None };
    let suspects = extended.as_ref().and_then(|extended| Some((extended, extended.suspects()?)));
    let steps = suspects.as_ref().and_then(|(extended, (found, _))| steps(extended, found.first()?));
    // Samples of static models have no order.
    let ordered: Vec<&[Piece]> = parts.iter().filter(|_| !point.is_static()).map(|parts| &parts.pieces[..]).collect();
    if ordered.is_empty() && steps.is_none() {
        return Left { parts, sensor: None };
    }
    let make = |e: usize| ordered.iter().map(|pieces| OfPieces::new(&single, pieces, e)).collect::<Vec<OfPieces<'_>>>();
    let beside = |experiments: &[usize]| steps.as_ref().map(|steps| SumOfSensor::new(&single, steps, experiments));
    let Ok(all) = single.gather_beside(&point.end.coordinates, true, make, beside) else { return Left::default() };
    let (of_pieces, of_sensor): (Vec<Vec<OfPieces<'_>>>, Vec<Option<OfSensor>>) = all.into_iter().unzip();
    let inflations: Vec<Vec<f64>> =
        (0..ordered.len()).map(|number| inflations(of_pieces.iter().map(|one| &one[number]))).collect();
    let of_sensor: Option<Vec<OfSensor>> = of_sensor.into_iter().collect();
    let sensor = suspects.zip(of_sensor).and_then(|((extended, (found, tests)), all)| {
        let (standard_error, chance) = confirm(extended, found.first()?, all)?;
        Some(Sensor { found, tests, standard_error, chance })
    });
    for (parts, inflations) in parts.iter_mut().zip(inflations) {
        parts.pieces.iter_mut().zip(inflations).for_each(|(piece, of_errors)| piece.variance_inflation *= of_errors);
    }
    Left { parts, sensor }
}
