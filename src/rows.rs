//! [`Rows`]: what one pass over the data with slopes sums up for the covariance and several checks.

pub(crate) mod of_pieces;
pub(crate) mod of_sensor;
pub(crate) mod pieces;
pub(crate) mod sensors;
pub(crate) mod spans;

use crate::covariance::hac::{First, Frame, Sums};
use crate::covariance::leverage::of_experiment;
use crate::covariance::shares::{Largest, Pass, Shares, of_all, sizes_of_all};
use crate::covariance::sizes::Sizes;
use crate::information::{Covariance, Information};
use crate::problem::{At, Objective, Slopes, Whitening, gather_together_beside};
use crate::rows::sensors::{Extenders, of_all_outputs};
use crate::rows::spans::{Spans, SumSpans};

/// What is asked of the pass.
#[derive(Clone, Copy, Default)]
pub(crate) struct Asked<'a> {
    /// The inverse of the curvature, where shares of measurements are asked for.
    pub shares: Option<&'a Covariance>,
    /// The covariance of unit noise with the unknowns that are held, where scores of colored errors are asked for.
    pub colored: Option<(&'a [bool], &'a Covariance)>,
    /// Whether sensors are tested, and parts of the data compared.
    pub sensors: bool,
    pub parts: bool,
}

impl Asked<'_> {
    pub fn is_empty(&self) -> bool {
        self.shares.is_none() && self.colored.is_none() && !self.sensors && !self.parts
    }
}

/// What is summed up over all measurements with their slopes.
#[derive(Default)]
pub(crate) struct Rows {
    /// The largest shares of measurements in the variances of the unknowns, and the sizes of the errors that have them.
    pub shares: Option<(Vec<Largest>, Sizes)>,
    /// The scores of colored errors.
    pub colored: Option<(Vec<Frame>, Vec<Sums>)>,
    /// Of each experiment the triangle of the unknowns with gain, offset and delay of each output.
    pub sensors: Option<Vec<Information>>,
    /// The rows of each experiment in parts of equal length.
    pub spans: Option<Vec<Spans>>,
}

/// One pass, or two where the noise is correlated between outputs, since sensors and parts take the rows of single outputs. Nothing of a pass that
/// fails.
pub(crate) fn rows(objective: &Objective<'_>, coordinates: &[f64], asked: Asked<'_>) -> Rows {
    let Asked { shares, colored, sensors, parts } = asked;
    let single = objective.with(Whitening::Diagonal(objective.whitening.sigma()));
    let others = shares.is_some() || colored.is_some();
    if matches!(objective.whitening, Whitening::Full { .. }) && others && (sensors || parts) {
        let Rows { sensors, spans, .. } = rows(&single, coordinates, Asked { sensors, parts, ..Asked::default() });
        return Rows {
            sensors,
            spans,
            ..rows(objective, coordinates, Asked { sensors: false, parts: false, ..asked })
        };
    }
    let objective = if sensors || parts { &single } else { objective };
    let summing = Summing::new(objective, asked);
    let extend = |experiments: &[usize]| {
        sensors.then(|| Extenders::new(experiments.iter().map(|experiment| (objective, *experiment)).collect()))
    };
    let Ok(all) = objective.gather_beside(coordinates, true, |e| summing.of(e), extend) else {
        return Rows::default();
    };
    let (rows, sums) = summing.sum(all);
    summing.with_frames(rows, sums)
}

/// [`rows`] of several objectives of one record each, in parallel lanes; `None` where the noise is correlated between outputs, or the pass fails.
pub(crate) fn rows_together(asked: &[(At<'_>, Asked<'_>)]) -> Vec<Option<Rows>> {
    let mut answers: Vec<Option<Rows>> = asked.iter().map(|_| None).collect();
    let independent = |number: &usize| matches!(asked[*number].0.0.whitening, Whitening::Diagonal(_));
    let numbers: Vec<usize> = (0..asked.len()).filter(independent).collect();
    let points: Vec<At<'_>> = numbers.iter().map(|&number| asked[number].0).collect();
    let summing: Vec<Summing<'_>> =
        numbers.iter().map(|&number| Summing::new(asked[number].0.0, asked[number].1)).collect();
    let extend = |members: &[usize]| {
        let any = members.iter().any(|&i| summing[i].asked.sensors);
        any.then(|| Extenders::new(members.iter().map(|&i| (points[i].0, 0)).collect()))
    };
    let found = gather_together_beside(&points, Slopes::OfCoordinates, |i| summing[i].of(0), extend);
    let found: Vec<Option<_>> =
        found.into_iter().zip(&summing).map(|(found, summing)| Some(summing.sum(vec![found?]))).collect();
    for ((number, summing), found) in numbers.into_iter().zip(summing).zip(found) {
        answers[number] = found.map(|(rows, sums)| summing.with_frames(rows, sums));
    }
    answers
}

/// What is summed up over the records of an objective.
struct Summing<'s> {
    objective: &'s Objective<'s>,
    asked: Asked<'s>,
    frames: Option<Vec<Frame>>,
}

/// The accumulators of one experiment: shares, scores and parts.
type OfExperiment<'s> = (Option<Pass<'s>>, (Option<First<'s>>, Option<SumSpans<'s>>));

impl<'s> Summing<'s> {
    fn new(objective: &'s Objective<'s>, asked: Asked<'s>) -> Self {
        let frames = asked.colored.map(|(held, inverse)| Frame::of_all(objective, held, inverse));
        Summing { objective, asked, frames }
    }

    fn of(&self, e: usize) -> OfExperiment<'_> {
        let Summing { objective, asked: Asked { shares, parts, .. }, frames } = self;
        // The scores have the shares on the way, but where variances are predicted.
        let own = shares.filter(|_| frames.is_none() || objective.sweep.predicts_variance());
        let shares = own.map(|inverse| Pass::new(objective, Shares::new(e, of_experiment(objective, inverse, e))));
        let scores = frames.as_ref().map(|frames| frames[e].first(objective, e));
        (shares, (scores, parts.then(|| SumSpans::new(objective, e))))
    }

    /// The sums of all experiments but those of scores, and these.
    fn sum(&self, all: Vec<(OfExperiment<'_>, Option<Vec<Information>>)>) -> (Rows, Vec<Sums>) {
        let Summing { objective, asked: Asked { shares, sensors, parts, .. }, .. } = self;
        let (all, extended): (Vec<_>, Vec<Option<Vec<Information>>>) = all.into_iter().unzip();
        let (passes, others): (Vec<Option<Pass<'_>>>, Vec<_>) = all.into_iter().unzip();
        let (scores, spans): (Vec<Option<First<'_>>>, Vec<Option<SumSpans<'_>>>) = others.into_iter().unzip();
        let sums: Vec<Sums> = scores.into_iter().flatten().map(Sums::of).collect();
        let sensors = sensors.then(|| extended.into_iter().flatten().map(of_all_outputs).collect());
        let spans = parts.then(|| spans.into_iter().flatten().map(SumSpans::complete).collect());
        let from_scores = || sums.iter().filter_map(|one| one.errors.as_ref()).map(|errors| &errors.shares);
        let each = || passes.iter().flatten().map(|one| &one.shares).chain(from_scores());
        let shares = (shares.is_some() || from_scores().next().is_some())
            .then(|| (of_all(objective, each()), sizes_of_all(objective, each())));
        (Rows { shares, sensors, spans, colored: None }, sums)
    }

    fn with_frames(self, rows: Rows, sums: Vec<Sums>) -> Rows {
        Rows { colored: self.frames.map(|frames| (frames, sums)), ..rows }
    }
}

#[cfg(test)]
mod tests;
