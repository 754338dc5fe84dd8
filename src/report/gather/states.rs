//! The states of a record by a filter, as a report shows them.

use super::{BAND, about, jumps, times};
use crate::problem::Objective;
use crate::report::facts::{State, States};
use crate::section::{Drawing, Keep, Line, Panel, PanelKind, Plot, Samples, Style, Timeline};
use statrs::distribution::{ContinuousCDF, Normal};

/// The states of record number `e` of this name, smoothed with their band and filtered, sample by sample about the largest residuals `worst` where not
/// all samples are kept; or why they are not known.
pub(super) fn gathered(
    objective: &Objective<'_>,
    best: &[f64],
    (e, name): (usize, &str),
    worst: &[Option<usize>],
    numbers: usize,
) -> Result<States, String> {
    let (record, layout) = (&objective.problem.records[e], objective.problem.layout());
    if let Some(most) = too_long(record.len(), layout.states.len()) {
        return Err(format!(
            "of records of more than {most} samples a report has none; ask for them by `smoothed` of the fit"
        ));
    }
    let states = |smoothed| objective.states(e, best, smoothed).map_err(|error| error.to_string());
    let (smoothed, filtered) = (states(true)?, states(false)?);
    let quantile = Normal::standard().inverse_cdf(0.5 + BAND / 2.0);
    let halves: Vec<Vec<f64>> = smoothed
        .deviations
        .iter()
        .map(|column| column.iter().map(|deviation| quantile * deviation).collect())
        .collect();
    let line = |style, name: &str| Line { style, name: name.to_owned(), held: false };
    let band = format!("holds the state with {} %", 100.0 * BAND);
    let panel = |name: &str, unit: &str| Panel {
        name: name.to_owned(),
        unit: unit.to_owned(),
        kind: PanelKind::State,
        lines: vec![line(Style::Confidence, &band), line(Style::Quiet, "filtered"), line(Style::Predicted, "smoothed")],
    };
    let panels = layout.states.iter().map(|state| panel(&state.name, &state.unit)).collect();
    let lines = (0..layout.states.len()).flat_map(|i| {
        [
            (Keep::Median, halves[i].as_slice()),
            (Keep::Extremes, filtered.means[i].as_slice()),
            (Keep::ExtremesAndMean, smoothed.means[i].as_slice()),
        ]
    });
    let (t, gaps) = (times(record), jumps(record));
    let samples = Samples { t: &t, time_unit: record.time_unit().name(), gaps: &gaps, lines: lines.collect() };
    let pieces: Vec<_> = worst.iter().flatten().map(|&k| about(k, t.len())).collect();
    let timeline = Timeline::new(panels, &samples, numbers, &pieces);
    let all = layout.states.iter().enumerate().map(|(i, state)| State {
        name: state.name.clone(),
        unit: state.unit.clone(),
        range: range(&smoothed.means[i]),
        deviations: [&smoothed, &filtered].map(|of| root_mean_square(&of.deviations[i])),
    });
    let drawing = Drawing::Timeline(timeline);
    let timeline = Plot::of(format!("states-{name}"), "", format!("States of {name} over time"), drawing);
    Ok(States { all: all.collect(), timeline })
}

/// Numbers of covariances of all samples, some 100 bytes of memory each while they are smoothed.
const MOST: usize = 4_000_000;

/// Of a record that is too long for a report of its states, how many samples are not.
fn too_long(samples: usize, states: usize) -> Option<usize> {
    let most = MOST / (states * (states + 1)).max(1);
    (samples > most).then_some(most)
}

/// Least and greatest value, if there is one.
fn range(values: &[f64]) -> Option<(f64, f64)> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    finite().reduce(f64::min).zip(finite().reduce(f64::max))
}

/// Zero where no value is a number.
fn root_mean_square(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|value| value.is_finite());
    (finite().map(|value| value * value).sum::<f64>() / finite().count().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded() {
        assert_eq!([too_long(2_000_000, 1), too_long(2_000_001, 1)], [None, Some(2_000_000)]);
        assert_eq!([too_long(50_000, 8), too_long(60_000, 8)], [None, Some(55_555)]);
    }
}
