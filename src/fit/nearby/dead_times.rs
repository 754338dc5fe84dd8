//! Searches from other dead times than that of an estimate.
//!
//! Where inputs are held, the cost has a kink at each dead time of a whole number of samples, and may have a minimum between any two of these.

use super::{at, led};
use crate::estimate::{About, Minimum, Starts, Summary, Unknown, Warning, WarningCode};
use crate::judge::INDISTINGUISHABLE;
use crate::problem::{Problem, Role};
use crate::severity::Severity;

/// Distances from the dead time of an estimate at which searches begin, in samples: two on each side, between whole numbers of samples if the
/// estimate is at one. Of 40 records of a lag of ten samples with white inputs, 19 ended in a wrong minimum from 1.3 samples away.
const SAMPLES_BESIDE: [f64; 4] = [-1.5, -0.5, 0.5, 1.5];
/// The change of a parameter by which it is seen whether it moves a dead time, as a part of its value or of a sample: small, so that a dead time that is a
/// smooth function changes in proportion, and far above rounding.
const MOVED: f64 = 1e-6;
/// The most parameters that move dead times: each takes four searches.
const MOST: usize = 2;
/// The standard errors from which on another minimum is apart from an estimate: nearer ones are mostly on the two sides of one whole number of samples.
const OUTSIDE: f64 = 3.0;

impl Problem<'_> {
    /// Coordinates of places whose dead times are some samples from those of an estimate; `None` where no parameter moves a dead time, or many do.
    pub(super) fn beside_dead_times(&self, found: &Summary) -> Option<Vec<Vec<f64>>> {
        let here: Vec<f64> =
            found.unknowns.iter().map(|unknown| unknown.transform.to_coordinate(unknown.value)).collect();
        let parameters = |i: &usize| matches!(self.unknowns.row[*i].role, Role::Parameter(_));
        let places =
            (0..here.len()).filter(parameters).filter_map(|i| self.beside_dead_time(&found.unknowns[i], &here, i));
        let places: Vec<Vec<Vec<f64>>> = places.collect();
        (1..=MOST).contains(&places.len()).then(|| places.concat()).filter(|places| !places.is_empty())
    }

    /// The same for the unknown of number `i`; `None` if it moves no dead time.
    fn beside_dead_time(&self, unknown: &Unknown, here: &[f64], i: usize) -> Option<Vec<Vec<f64>>> {
        let e = self.unknowns.row[i].experiment.unwrap_or(0);
        let record = self.records.get(e)?;
        let last = record.len().checked_sub(1).filter(|last| *last > 0)?;
        let step = (record.time(last) - record.time(0)) / last as f64;
        let (lower, upper) = *self.unknowns.bounds().get(i)?;
        let place = |value: f64| {
            let mut place = here.to_vec();
            place[i] = unknown.transform.to_coordinate(value).max(lower).min(upper);
            place
        };
        let late = |place: &[f64]| self.sweep.late(&self.unknowns.of_experiment(e, place).p);
        let far = MOVED * unknown.value.abs().max(step);
        // One of the two stays where the estimate is at a bound.
        let beside = [far, -far].map(|far| late(&place(unknown.value + far)));
        let moved = beside.iter().flat_map(|beside| late(here).into_iter().zip(beside.clone()));
        let moved = moved.filter_map(|(before, after)| Some((after? - before?).abs()));
        let slope = moved.fold(0.0, f64::max) / far;
        if slope == 0.0 {
            return None;
        }
        let is_late = |place: &Vec<f64>| late(place).iter().flatten().all(|time| *time >= 0.0);
        let places = SAMPLES_BESIDE.map(|samples| place(unknown.value + samples * step / slope));
        Some(places.into_iter().filter(is_late).collect())
    }
}

/// Names another minimum that the data do not tell from the best one, and that lies apart from it; else the minimum `before`, if the best one is lower.
pub(super) fn warning(starts: &Starts, before: Option<&Minimum>, best: &Summary, tried: usize) -> Option<Warning> {
    let is_outside = |(unknown, (_, value)): (&Unknown, &(String, f64))| {
        let error = unknown.knowledge.standard_error();
        error.is_some_and(|error| (value - unknown.value).abs() > OUTSIDE * error)
    };
    let is_apart = |minimum: &Minimum| best.unknowns.iter().zip(&minimum.unknowns).any(is_outside);
    let is_as_good = |minimum: &Minimum| best.measurements as f64 * minimum.cost_ratio.ln() < INDISTINGUISHABLE;
    let rival = |minimum: &&Minimum| is_as_good(minimum) && is_apart(minimum);
    if let Some(rival) = starts.minima.iter().skip(1).find(rival) {
        let text = format!(
            "another minimum explains the data as well, with {}, between other whole numbers of samples of a dead time: an interval holds for one of them \
             alone; profile the dead time, or use an input that changes less often",
            at(rival)
        );
        return Some(Warning::new(WarningCode::RivalMinimum, Severity::UsableWithCare, text).about(About::Minimum));
    }
    let text = format!(
        "the search ended first in another minimum, with {}, beside a whole number of samples of a dead time: of {tried} searches from dead times near it {} to \
         this one",
        at(before?),
        led(starts)
    );
    Some(Warning::new(WarningCode::DeclaredStartElsewhere, Severity::Usable, text).about(About::Minimum))
}
