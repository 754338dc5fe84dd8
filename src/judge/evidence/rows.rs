//! [`Rows`]: what one pass with slopes sums up for the covariance and several checks.

use crate::covariance::hac::{First, Frame, Sums};
use crate::covariance::leverage::of_experiment;
use crate::covariance::shares::{Largest, Pass, Shares, of_all, sizes_of_all};
use crate::covariance::sizes::Sizes;
use crate::information::{Covariance, Information};
use crate::judge::evidence::sensors::Triangle;
use crate::judge::evidence::spans::{Spans, SumSpans};
use crate::problem::{Objective, Whitening};

/// What is asked of the pass.
#[derive(Clone, Copy, Default)]
pub(crate) struct Asked<'a> {
    /// The inverse of the curvature, where shares of measurements are asked for.
    pub shares: Option<&'a Covariance>,
    /// The same with the unknowns that are held, where scores of colored errors are asked for.
    pub colored: Option<(&'a [bool], &'a Covariance)>,
    /// Whether sensors are tested, and parts of the data compared.
    pub sensors: bool,
    pub parts: bool,
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
    let frames = colored.map(|(held, inverse)| Frame::of_all(objective, held, inverse));
    // The scores have the shares on the way, but where variances are predicted.
    let own = shares.filter(|_| frames.is_none() || objective.sweep.predicts_variance());
    let make = |e: usize| {
        let shares = own.map(|inverse| Pass::new(objective, Shares::new(e, of_experiment(objective, inverse, e))));
        let scores = frames.as_ref().map(|frames| frames[e].first(objective, e));
        let of_outputs = (sensors.then(|| Triangle::new(objective, e)), parts.then(|| SumSpans::new(objective, e)));
        (shares, (scores, of_outputs))
    };
    let Ok(all) = objective.gather(coordinates, true, make) else { return Rows::default() };
    let (passes, others): (Vec<Option<Pass<'_>>>, Vec<_>) = all.into_iter().unzip();
    let (scores, of_outputs): (Vec<Option<First<'_>>>, Vec<_>) = others.into_iter().unzip();
    let (triangles, spans): (Vec<Option<Triangle<'_>>>, Vec<Option<SumSpans<'_>>>) = of_outputs.into_iter().unzip();
    let sums: Vec<Sums> = scores.into_iter().flatten().map(Sums::of).collect();
    let sensors = sensors.then(|| triangles.into_iter().flatten().map(Triangle::of_all_outputs).collect());
    let spans = parts.then(|| spans.into_iter().flatten().map(SumSpans::complete).collect());
    let from_scores = || sums.iter().filter_map(|one| one.errors.as_ref()).map(|errors| &errors.shares);
    let each = || passes.iter().flatten().map(|one| &one.shares).chain(from_scores());
    let shares = (shares.is_some() || from_scores().next().is_some())
        .then(|| (of_all(objective, each()), sizes_of_all(objective, each())));
    Rows { shares, sensors, spans, colored: frames.map(|frames| (frames, sums)) }
}
