//! The residuals: the tests that failed together, and those of each output.

use super::quoted;
use crate::diagnose::residuals::{Correlation, Residuals, SignalRole, Spread};
use crate::diagnose::{self, LEVEL, Test};
use crate::numeral::{self, counted, number, resolved, rounded, unit_after};
use crate::report::facts::{Facts, OutputFit, Record};
use crate::section::{Axis, Curves, Drawing, Layer, Plot, Section, Style};

/// The tests of all residuals, each with whose they are.
fn tests(facts: &Facts) -> impl Iterator<Item = (String, &Test)> {
    let one = facts.single();
    let fits = facts.records.iter().flat_map(|record| record.fits.iter().map(move |fit| (record, fit)));
    fits.flat_map(move |(record, fit)| {
        let of = if one { quoted(&fit.name) } else { format!("{} of {}", quoted(&fit.name), quoted(&record.name)) };
        fit.residuals.tests.iter().map(move |test| (of.clone(), test))
    })
}

/// The failed tests with what each may mean; `None` if none failed. They are no reasons: the verdict is that of the estimate's warnings.
pub(super) fn section(facts: &Facts) -> Option<Section> {
    let failed: Vec<_> = tests(facts).filter(|(_, test)| !test.passed).collect();
    let least = failed.iter().map(|(_, test)| test.p_value).reduce(f64::min)?;
    let (count, all) = (failed.len(), tests(facts).count());
    // Of many tests some fail by chance: one counts that fails at its part of the level (Bonferroni).
    let text = match least * all as f64 >= LEVEL {
        true => format!("{count} of {all} tests failed, none clearly: so many may fail by chance. If it is none:"),
        false => format!(
            "{count} of {all} tests failed. They are no part of the verdict, whose own tests allow for the size of what is found, for \
             feedback, for colored noise and for the loss. What a failed test may mean:"
        ),
    };
    let section = Section::new("residuals", "Tests of the residuals that failed").says(text);
    Some(meanings(&failed).into_iter().fold(section, Section::says))
}

/// Meanings of the failed tests, each once, with the tests that have it.
fn meanings(failed: &[(String, &Test)]) -> Vec<String> {
    const NAMED: usize = 4;
    const SAID: usize = 20;
    let mut groups: Vec<(&str, Vec<String>)> = vec![];
    for (of, test) in failed {
        let what = format!("{of} {} ({})", test.name, test.probability());
        match groups.iter_mut().find(|(meaning, _)| *meaning == test.meaning) {
            Some((_, whats)) => whats.push(what),
            None => groups.push((&test.meaning, vec![what])),
        }
    }
    let left = groups.len().saturating_sub(SAID);
    let said = groups.into_iter().take(SAID).map(|(meaning, whats)| {
        let more = match whats.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; {more} more"),
        };
        format!("{}{more}: {meaning}.", whats[..whats.len().min(NAMED)].join("; "))
    });
    said.chain((left > 0).then(|| format!("{left} more meanings stand with the records."))).collect()
}

/// The residuals of an output of a record; `id` identifies the record. Of the plots against signals so many are
/// shown, those with the least probable tests first.
pub(super) fn of_output(id: &str, record: &Record, fit: &OutputFit, shown: usize) -> Section {
    let of = &fit.residuals;
    let fits = fit.fit_percent.map_or(String::new(), |fit| format!(", reproduced to {} %", numeral::fit(fit)));
    let section = Section::new(format!("{id}-{}", fit.name), format!("Residuals of {}{fits}", fit.name)).folded();
    let at = rounded(fit.largest_at - record.begin, record.sample_time);
    let (unit, time_unit) = (unit_after(&fit.unit), unit_after(record.time_unit.name()));
    let section = section.says(format!(
        "Mean {}{unit}, standard deviation {}{unit}; the largest is {}{unit}, {at}{time_unit} after the start.",
        resolved(of.mean, of.standard_deviation / of.effective_samples.max(1.0).sqrt()),
        number(of.standard_deviation, 3),
        number(fit.largest, 3),
    ));
    let section = match of.tests.is_empty() {
        true => section.says("The residuals are too few, or do not vary: they were not tested."),
        false => section.table(diagnose::results(&format!("Tests of the residuals of {}", fit.name), &of.tests)),
    };
    let section = match outliers(record, of) {
        Some(text) => section.says(text),
        None => section,
    };
    let title = format!("The residuals of {} against each signal", fit.name);
    let against = Section::new(format!("{id}-{}-signals", fit.name), title).folded();
    let against = against_signals(id, record, fit).into_iter().take(shown).fold(against, Section::plot);
    section
        .plot(fit.closeup.clone())
        .plot(histogram(id, record, fit))
        .plot(autocorrelation(id, record, fit))
        .plot(spectrum(id, record, fit))
        .part(Some(against).filter(|part| !part.is_empty()))
}

fn outliers(record: &Record, of: &Residuals) -> Option<String> {
    const NAMED: usize = 5;
    let (unit, time_unit) = (unit_after(&of.unit), unit_after(record.time_unit.name()));
    let named = of.outliers.iter().take(NAMED).map(|outlier| {
        let after = record.time_unit.convert(outlier.time) - record.begin;
        let (residual, time) = (number(outlier.residual, 3), rounded(after, record.sample_time));
        format!("{residual}{unit} at {time}{time_unit} (sample {})", outlier.sample)
    });
    let named: Vec<String> = named.collect();
    let beyond = "further out than a normal distribution allows";
    match of.outlier_count {
        0 => None,
        1 => Some(format!("One residual is {beyond}: {}.", named.join(""))),
        count => Some(format!("{} are {beyond}, furthest {}.", counted(count, "residual"), named.join("; "))),
    }
}

/// How often which residual occurs, beside the normal distribution of the same mean and spread; of a filter, the one that it predicts.
fn histogram(id: &str, record: &Record, fit: &OutputFit) -> Option<Plot> {
    const PARTS: u32 = 120;
    let histogram = &fit.histogram;
    let total = fit.residuals.samples.max(1) as f64;
    let heights: Vec<f64> = histogram.counts.iter().map(|count| 100.0 * *count as f64 / total).collect();
    let to = histogram.from + histogram.width * heights.len() as f64;
    let (name, unit, caption) = match fit.standardized {
        true => ("standardized residual", "", STANDARDIZED),
        false => ("residual", fit.unit.as_str(), HISTOGRAM),
    };
    let (mean, sigma) = match fit.standardized {
        true => (0.0, 1.0),
        false => (fit.residuals.mean, fit.residuals.standard_deviation),
    };
    let normal = |i: u32| {
        let e = histogram.from + (to - histogram.from) * f64::from(i) / f64::from(PARTS);
        let density = (-0.5 * ((e - mean) / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt());
        (e, 100.0 * histogram.width * density)
    };
    let points: Vec<_> = if sigma > 0.0 { (0..=PARTS).map(normal).collect() } else { vec![] };
    let drawing = Curves {
        x: Axis::new(name, unit),
        y: Axis::new("share", "%").from(0.0),
        layers: vec![
            Layer::Bars { style: Style::Main, first: histogram.from, width: histogram.width, heights },
            Layer::Line { style: Style::Reference, points },
        ],
    };
    let title = format!("Histogram of the {name} of {} of {}", fit.name, record.name);
    let plot = Plot::of(format!("histogram-{id}-{}", fit.name), caption, title, Drawing::Curves(drawing));
    (!histogram.counts.is_empty()).then_some(plot)
}

const HISTOGRAM: &str = "Histogram, beside a normal distribution of the same mean and deviation";

const STANDARDIZED: &str =
    "Histogram of the residuals divided by their predicted deviations, beside the standard normal distribution";

/// Autocorrelation of the residuals.
fn autocorrelation(id: &str, record: &Record, fit: &OutputFit) -> Option<Plot> {
    let of = &fit.residuals;
    let verdict = of.white.map_or(String::new(), |white| {
        let result = if white { "passes" } else { "fails" };
        format!("; the test of Ljung and Box judges all lags together, and {result}")
    });
    let caption =
        format!("Autocorrelation; of white residuals, each lag for itself is between the lines in 99 of 100{verdict}");
    let title = format!("Autocorrelation of the residual of {} of {}", fit.name, record.name);
    let drawing = lags("autocorrelation", record, 1, 1, &of.autocorrelation, of.autocorrelation_band)?;
    Some(Plot::of(format!("autocorrelation-{id}-{}", fit.name), caption, title, drawing))
}

/// Correlation of the residual with a signal.
fn cross_correlation(id: &str, record: &Record, fit: &OutputFit, with: &Correlation) -> Option<Plot> {
    let Correlation { signal, role, first_lag, values, tested_from, band, .. } = with;
    let title =
        format!("Correlation of the residual of {} of {} with {role} {signal} before it", fit.name, record.name);
    let caption = format!(
        "Correlation with {role} `{signal}` before it; the test fails where a colored bar leaves the lines, gray ones are not \
         tested"
    );
    let drawing = lags("correlation", record, *first_lag, *tested_from, values, *band)?;
    Some(Plot::of(format!("correlation-{id}-{}-{signal}-{role}", fit.name), caption, title, drawing))
}

/// The plots of the residual against each signal, those with the least probable tests first.
fn against_signals(id: &str, record: &Record, fit: &OutputFit) -> Vec<Plot> {
    let of = &fit.residuals;
    let correlations = of.correlations.iter();
    let correlations = correlations.filter_map(|with| Some((with.p_value, cross_correlation(id, record, fit, with)?)));
    let spreads = of.spreads.iter().map(|over| (over.p_value, spread(id, record, fit, over)));
    let mut plots: Vec<(f64, Plot)> = correlations.chain(spreads).collect();
    plots.sort_by(|a, b| a.0.total_cmp(&b.0));
    plots.into_iter().map(|(_, plot)| plot).collect()
}

/// Bars over lags in seconds; those before `tested_from` (samples) are not tested.
fn lags(name: &str, record: &Record, first: i64, tested_from: i64, values: &[f64], band: f64) -> Option<Drawing> {
    let step = if record.sample_time > 0.0 { record.sample_time } else { 1.0 };
    let untested = (tested_from - first).clamp(0, values.len() as i64) as usize;
    let bars = |style, from: usize, values: &[f64]| Layer::Bars {
        style,
        first: (first as f64 + from as f64 - 0.5) * step,
        width: step,
        heights: values.to_vec(),
    };
    let mut layers = vec![bars(Style::Main, untested, &values[untested..])];
    if untested > 0 {
        layers.push(bars(Style::Quiet, 0, &values[..untested]));
    }
    layers.extend([band, -band].map(|value| Layer::Level { value, label: String::new() }));
    (!values.is_empty()).then(|| {
        let drawing = Curves { x: Axis::new("lag", record.time_unit.name()), y: Axis::new(name, ""), layers };
        Drawing::Curves(drawing)
    })
}

/// Where the power of the residual lies.
fn spectrum(id: &str, record: &Record, fit: &OutputFit) -> Option<Plot> {
    let (of, hertz) = (&fit.residuals.spectrum, record.time_unit.frequency());
    // Over a hertz, or times a minute.
    let over = hertz.strip_prefix("1/").map_or_else(|| format!("/{hertz}"), |time| format!(" {time}"));
    let line = |style, values: &[f64]| Layer::Line {
        style,
        points: of.frequency.iter().copied().zip(values.iter().copied()).collect(),
    };
    let mut layers = vec![line(Style::Quiet, &of.greatest), line(Style::Main, &of.density)];
    layers.extend(fit.residuals.period.map(|period| Layer::Mark {
        value: period.frequency,
        label: format!("{} {hertz}", number(period.frequency, 4)),
    }));
    let unit = match fit.unit.as_str() {
        "" | "1" => format!("1{over}"),
        single if single.chars().all(char::is_alphabetic) => format!("{single}²{over}"),
        several => format!("({several})²{over}"),
    };
    let drawing = Curves {
        x: Axis::new("frequency", hertz).from(0.0),
        y: Axis::new("power density", unit).logarithmic(),
        layers,
    };
    let caption = "Spectrum: mean power density, and (thin) the greatest in each column; flat for white residuals";
    let title = format!("Spectrum of the residual of {} of {}", fit.name, record.name);
    let plot = Plot::of(format!("spectrum-{id}-{}", fit.name), caption, title, Drawing::Curves(drawing));
    (of.frequency.len() > 1).then_some(plot)
}

/// Size of the residual over the range of a signal.
fn spread(id: &str, record: &Record, fit: &OutputFit, over: &Spread) -> Plot {
    let Spread { signal, role, unit, at, deviation, .. } = over;
    let of_time = *role == SignalRole::Time;
    let unit = if of_time { record.time_unit.name() } else { unit };
    let place = |at: &f64| if of_time { record.time_unit.convert(*at) - record.begin } else { *at };
    let points: Vec<(f64, f64)> = at.iter().map(place).zip(deviation.iter().copied()).collect();
    let all = Layer::Level { value: fit.residuals.standard_deviation, label: String::new() };
    let drawing = Curves {
        x: Axis::new(signal, unit),
        y: Axis::new("standard deviation", &fit.unit).from(0.0),
        layers: vec![
            Layer::Line { style: Style::Main, points: points.clone() },
            Layer::Dots { style: Style::Main, points },
            all,
        ],
    };
    let title = format!("Size of the residual of {} of {} over {role} {signal}", fit.name, record.name);
    let caption = format!("Size over {role} `{signal}`; dashed, that of all residuals");
    Plot::of(format!("spread-{id}-{}-{signal}-{role}", fit.name), caption, title, Drawing::Curves(drawing))
}
