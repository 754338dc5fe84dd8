//! What stands on a report's page, row by row of what was once wrong or missing there.

use crate::random::Random;
use greybox::diagnose::residuals::examine;
use greybox::diagnose::{Compared, Convergence, bands, profile};
use greybox::report::{Layer, Plot, Section, Style};
use greybox::{Error, Experiment, ExperimentOf, Fit, Model, Report, Scalar, Severity, Time, free, signals};

signals! { pub struct Drive { u: "V" } }
signals! { pub struct Response { y: "A" } }
signals! { pub struct Branch { gain: "A/V", tau: "s" } }

/// `tau dy/dt = gain u - y`.
#[derive(Clone)]
pub struct Lag;

impl Model for Lag {
    type State = Response;
    type Input = Drive;
    type Output = Response;
    type Parameters = Branch;

    fn derivative<S: Scalar>(&self, _t: S, x: &Response<S>, u: &Drive<S>, p: &Branch<S>) -> Response<S> {
        Response { y: (p.gain * u.u - x.y) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Response<S>, _u: &Drive<S>, _p: &Branch<S>) -> Response<S> {
        *x
    }
}

/// A record of a lag of gain 2 A/V and time constant 0.05 s at these times, with noise.
pub fn record(times: Vec<f64>, noise: f64, seed: u64) -> ExperimentOf<Lag> {
    let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (mut y, mut outputs, mut inputs) = (0.0, vec![], vec![]);
    for (k, t) in times.iter().enumerate() {
        let u = if k / 40 % 2 == 0 { 1.0 } else { -0.5 } + 0.3 * (0.9 * k as f64).sin();
        inputs.push(Drive { u });
        outputs.push(Response { y: y + noise * random.normal() });
        let decay = (-(times.get(k + 1).unwrap_or(t) - t) / 0.05).exp();
        y = 2.0 * u + (y - 2.0 * u) * decay;
    }
    Experiment::new(&Lag, Time::from_stamps(times), inputs, outputs).unwrap()
}

fn even(samples: usize) -> Vec<f64> {
    (0..samples).map(|k| k as f64 * 0.01).collect()
}

fn branch() -> Branch<greybox::Parameter> {
    Branch { gain: free(1.0), tau: free(0.1).within(1e-3, 10.0) }
}

pub fn report(records: &[ExperimentOf<Lag>]) -> Result<Report, Error> {
    let problem = Fit::new(&Lag, records).parameters(branch()).problem()?;
    let estimate = problem.run()?;
    Report::new(&problem, &estimate)
}

fn section<'a>(report: &'a Report, id: &str) -> &'a Section {
    report.sections.iter().find(|section| section.id == id).unwrap()
}

fn plot<'a>(report: &'a Report, begin: &str) -> &'a Plot {
    report.plots().into_iter().find(|plot| plot.name.starts_with(begin)).unwrap()
}

macro_rules! timeline {
    ($plot:expr) => {
        $plot.timeline().expect("a timeline")
    };
}

fn layers(plot: &Plot) -> &[Layer] {
    plot.curves().expect(&plot.name).1
}

/// The `d` of every path of a class.
fn paths<'a>(svg: &'a str, class: &str) -> Vec<&'a str> {
    let begin = format!("<path class=\"{class}\" d=\"");
    svg.split(&begin).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

/// The places that a path goes through.
fn places(d: &str) -> Vec<(f64, f64)> {
    let numbers: Vec<f64> = d.split(['M', 'L', 'Z', ' ']).filter_map(|text| text.parse().ok()).collect();
    numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Where tens of samples share a column of the drawing, the band about the prediction is as wide as it is: the drawn
/// surface has the area of the true one. It was drawn hundreds of times too wide. Means over columns cost a few percent.
#[test]
fn a_band_is_drawn_as_wide_as_it_is() {
    let record = [record(even(20_000), 0.01, 1)];
    let problem = Fit::new(&Lag, &record).parameters(branch()).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = bands(&problem, &estimate, 0, 0.95).unwrap();
    let report = Report::new(&problem, &estimate).unwrap();
    let svg = plot(&report, "record").to_svg();
    let range =
        |values: &mut dyn Iterator<Item = f64>| values.fold((f64::MAX, f64::MIN), |r, v| (r.0.min(v), r.1.max(v)));
    let (low, high) = range(&mut record[0].outputs().map(|y| y.y).chain(found.outputs[0].iter().copied()));
    // The surface is 220 px high, with room of a twentieth above and below.
    let pixels = 220.0 / (1.1 * (high - low));
    for (class, widths) in [("area prediction", &found.prediction[0]), ("area confidence", &found.confidence[0])] {
        let outline = places(paths(&svg, class)[0]);
        let area: f64 = outline.iter().zip(outline.iter().cycle().skip(1)).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
        let length = range(&mut outline.iter().map(|place| place.0));
        let drawn = (area / 2.0).abs() / (length.1 - length.0);
        let mean: f64 = widths.iter().sum::<f64>() / widths.len() as f64;
        // Coordinates have two decimals: up to 0.005 px at either edge.
        assert!(
            (drawn - 2.0 * mean * pixels).abs() < 0.05 * drawn + 0.01,
            "{class}: {drawn} px, {} wide",
            2.0 * mean * pixels
        );
    }
}

/// The band is that of the predictions, whatever the transform of the parameters.
#[test]
fn a_band_does_not_depend_on_logarithms() {
    let record = [record(even(400), 0.01, 1)];
    let widths = |transform: fn(greybox::Parameter) -> greybox::Parameter| {
        let Branch { gain, tau } = branch();
        let parameters = Branch { gain: transform(gain), tau: transform(tau) };
        let problem = Fit::new(&Lag, &record).parameters(parameters).problem().unwrap();
        bands(&problem, &problem.run().unwrap(), 0, 0.95).unwrap().confidence[0].clone()
    };
    let (plain, logarithms) = (widths(|parameter| parameter), widths(greybox::Parameter::log));
    for (a, b) in plain.iter().zip(&logarithms).skip(1) {
        // The search ends within 1e-6 of a standard error or so.
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}

/// Time stamps of a clock that counts from 1970 are drawn over the whole width, count from the start, and name it.
#[test]
fn time_counts_from_the_start() {
    let start = 1_760_000_000.0;
    let report = report(&[record(even(600).iter().map(|t| t + start).collect(), 0.01, 2)]).unwrap();
    let svg = plot(&report, "record").to_svg();
    let across: Vec<f64> = places(paths(&svg, "line measured")[0]).iter().map(|place| place.0).collect();
    // 960 px less the margins of 54 and 14 px.
    assert!(across[0] < 1.0 && across.last().unwrap() > &880.0, "{across:?}");
    assert!(svg.contains("time since t = 1760000000 s (s)"));
    let text = report.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        text.contains(
            "600 samples over 5.99 s from t = 1760000000 s (2025-10-09 08:53:20 UTC, if it counts from 1970)"
        )
    );
}

/// What is shown of a record can be zoomed into down to its samples.
#[test]
fn samples_are_kept_for_zooming() {
    let report = report(&[record(even(5000), 0.01, 3)]).unwrap();
    let timeline = timeline!(plot(&report, "record"));
    assert_eq!((timeline.stretches[0].samples_per_column, timeline.stretches[0].t.len()), (1, 5000));
    // Their drawing before anyone zooms has columns, and the page holds the samples as bytes: 4 for each value.
    let numbers = timeline.stretches[0].traces.len() * 5000;
    let page = report.to_html();
    assert!(page.len() > numbers * 16 / 3 && page.len() < numbers * 16 / 3 + 400_000, "{} bytes", page.len());
}

/// Time without samples is a gap in each line, and is named in numbers that a person would write.
#[test]
fn gaps_in_time_are_gaps_in_lines() {
    let mut times = even(400);
    times.retain(|t| !(1.15..1.85).contains(t) && !(3.0..3.2).contains(t));
    let report = report(&[record(times, 0.01, 4)]).unwrap();
    let svg = plot(&report, "record").to_svg();
    for class in ["line measured", "line predicted", "line residual", "line input"] {
        assert_eq!(paths(&svg, class)[0].matches('M').count(), 3, "{class}");
    }
    let text = report.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("Without samples, from the start: from 1.14 s to 1.85 s; from 2.99 s to 3.2 s."), "{text}");
    assert!(text.contains("no sample from 1.14 s to 1.85 s"), "{text}");
}

/// No number in a sentence or a table has more digits than anyone reads, in any form; times are no multiples of 0.01 to the
/// last bit.
#[test]
fn numbers_are_rounded() {
    let times = even(400).iter().map(|t| 1.1 * t + 0.1).collect();
    let mut problem_record = [record(times, 0.01, 5)];
    problem_record[0] = problem_record[0].clone().named("bench");
    let report = report(&problem_record).unwrap();
    for form in [report.to_string(), report.to_markdown()] {
        for word in form.split(|letter: char| !(letter.is_ascii_digit() || letter == '.')) {
            let digits = word.trim_start_matches(['0', '.']).trim_end_matches('.').replace('.', "");
            assert!(digits.len() <= 10, "{word} in {form}");
        }
    }
}

/// The table of tests and the plot beside it are one test: it fails where, and only where, a tested bar leaves the lines.
#[test]
fn plot_and_table_agree() {
    let mut verdicts = [0, 0];
    for seed in 0..60 {
        // Half of the records have a delayed input in their output.
        let clean = record(even(400), 0.05, 100 + seed);
        let (input, output) = (&clean.record().inputs()[0].values, &clean.record().outputs()[0].values);
        let outputs = (0..clean.len()).map(|k| {
            let late = if k < 3 { 0.0 } else { input[k - 3] };
            Response { y: output[k] + if seed % 2 == 0 { 0.25 * late } else { 0.0 } }
        });
        let record = Experiment::new(&Lag, clean.times().clone(), clean.inputs().collect(), outputs.collect()).unwrap();
        let estimate = Fit::new(&Lag, &record).parameters(branch()).run().unwrap();
        let found = examine(&estimate.predict(&Lag, &record).unwrap().columns, record.record()).unwrap().remove(0);
        for with in &found.correlations {
            let name = format!("cross-correlation with {} `{}`", with.role, with.signal);
            let test = found.tests.iter().find(|test| test.name == name).unwrap();
            let tested = with.values.iter().skip((with.tested_from - with.first_lag) as usize);
            let outside = tested.filter(|value| value.abs() > with.band).count();
            assert_eq!(outside > 0, !test.passed, "{name}: {outside} outside, p = {}", test.p_value);
            verdicts[usize::from(test.passed)] += 1;
        }
    }
    assert!(verdicts[0] > 5 && verdicts[1] > 5, "{verdicts:?}");
}

/// A weighting is advised by what it sees: inputs and time.
#[test]
fn advice_can_be_followed() {
    let quiet = record(even(2000), 0.0, 6);
    let mut random = Random(7);
    let loud = |(y, _): (Response, Drive)| Response { y: y.y + 0.05 * y.y.abs() * random.normal() };
    let outputs = quiet.outputs().zip(quiet.inputs()).map(loud).collect();
    let record = Experiment::new(&Lag, quiet.times().clone(), quiet.inputs().collect(), outputs).unwrap();
    let said = report(&[record]).unwrap().to_markdown();
    assert!(said.contains("changes with predicted output `y`"), "{said}");
    for advice in said.split("a weighting by `").skip(1) {
        assert!(["u`", "t`"].iter().any(|name| advice.starts_with(name)), "{advice}");
    }
}

/// A note is no approval: in front of "the errors are not white" stands no check mark.
#[test]
fn a_note_has_no_check_mark() {
    let report = report(&[record(even(800), 0.01, 8)]).unwrap();
    let noted = report.with(Section::new("note", "A note").says("x").because(Severity::Usable, "a note"));
    for form in [noted.to_string(), noted.to_markdown()] {
        let line = form.lines().find(|line| line.ends_with("a note")).unwrap();
        assert!(line.contains('·') && !line.contains('✓'), "{line}");
    }
}

/// However many records: a page of at most 3 MB, a text and tables of bounded length; all but the worst record are folded.
#[test]
fn many_records_make_a_bounded_page() {
    let mut sizes = vec![];
    for count in [12, 60] {
        let records: Vec<_> = (0..count).map(|k| record(even(1500), 0.01 * (1 + k % 5) as f64, 20 + k)).collect();
        let records: Vec<_> = records.into_iter().enumerate().map(|(k, r)| r.named(format!("run {k}"))).collect();
        let report = report(&records).unwrap();
        let page = report.to_html();
        sizes.push(page.len());
        assert!(page.len() < 3_000_000, "{count} records: {} bytes", page.len());
        let drawn: Vec<_> = report.sections.iter().filter(|section| section.id.starts_with("record-")).collect();
        assert_eq!(drawn.iter().filter(|section| !section.folded).count(), 1);
        // The overview comes before them: the worst record, of the largest noise, leads it.
        let at = |id: &str| report.sections.iter().position(|section| section.id == id).unwrap();
        assert!(at("outputs") < at("record-1"));
        let first = section(&report, "outputs").tables[1].rows[0][0].text();
        assert_eq!(first.trim_start_matches("run ").parse::<u32>().unwrap() % 5, 4, "{first}");
        assert!(report.to_string().lines().count() < 400, "{} lines", report.to_string().lines().count());
        assert!(report.sections.iter().flat_map(|s| &s.tables).all(|table| table.rows.len() <= 60));
    }
    println!("{sizes:?} bytes");
}

/// Both sides of a profile are drawn up to one height, one and a half times the threshold, beside the parabola of the
/// standard error; estimate and threshold are labelled.
#[test]
fn profiles_are_compared_with_their_parabola() {
    let record = [record(even(60), 0.3, 40)];
    let problem = Fit::new(&Lag, &record).parameters(branch()).problem().unwrap();
    let estimate = problem.run().unwrap();
    let tau = estimate.parameters[1].value;
    let found = profile(&problem, &estimate, "tau", 0.95).unwrap();
    let (error, threshold) = (found.standard_error.unwrap(), found.threshold);
    let section = Section::from(found);
    let mut labels = vec![];
    for layer in layers(&section.plots[0]) {
        match layer {
            Layer::Line { style, points } => {
                let (first, last) = (points[0], points[points.len() - 1]);
                for end in [first, last] {
                    assert!((1.3..=1.5).contains(&(end.1 / threshold)), "{style:?} ends at {}", end.1 / threshold);
                }
                if *style == Style::Quiet {
                    let (value, rise) = points[points.len() / 4];
                    let expected = ((value - tau) / error).powi(2);
                    assert!((rise / expected - 1.0).abs() < 1e-9, "{rise} {expected}");
                }
            }
            Layer::Level { label, .. } | Layer::Mark { label, .. } => labels.push(label.as_str()),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(labels, ["95 % threshold", "estimate"]);
}

/// Lags are in seconds; inputs stand below the outputs; initial states apart from the parameters; correlations are numbers.
#[test]
fn what_was_missing_is_there() {
    let fitted = record(even(1000), 0.02, 41);
    let report = report(std::slice::from_ref(&fitted)).unwrap();
    let ([x, _], bars) = plot(&report, "autocorrelation").curves().unwrap();
    let Layer::Bars { first, width, .. } = &bars[0] else { panic!() };
    assert_eq!((x.unit.as_str(), *width), ("s", 0.01));
    assert!((first - 0.005).abs() < 1e-12);
    let spectrum = plot(&report, "spectrum");
    let Layer::Line { points, .. } = &layers(spectrum)[1] else { panic!() };
    assert!(points.len() == 128 && points.iter().all(|(frequency, _)| (0.0..50.0).contains(frequency)));
    let panels: Vec<&str> = timeline!(plot(&report, "record")).panels.iter().map(|panel| panel.name.as_str()).collect();
    assert_eq!(panels, ["y", "residual of y", "u"]);
    let parameters = section(&report, "parameters");
    let names: Vec<&str> = parameters.tables[0].rows.iter().map(|row| row[0].text()).collect();
    let states: Vec<&str> = parameters.parts[0].tables[0].rows.iter().map(|row| row[0].text()).collect();
    assert_eq!((names, states, parameters.parts[0].folded), (vec!["gain", "tau"], vec!["y(0)"], true));
    let numbers = &section(&report, "identifiability").parts[0];
    let covariance = &report.estimate.covariance;
    let correlation = covariance.get(0, 1) / (covariance.get(0, 0) * covariance.get(1, 1)).sqrt();
    assert!((numbers.tables[0].rows[0][2].value().unwrap() - correlation).abs() < 1e-12);
    let page = report.to_html();
    assert!(page.contains("popovertarget=\"term-error-index\"") && page.contains("id=\"term-error-index\""));
    assert!(section(&report, "reproduce").tables.iter().any(|table| {
        table.rows.iter().any(|row| row[0].text() == "model" && row[1].text().ends_with("pages::Lag"))
    }));
}

/// Estimation and validation data side by side, model by model: fits by the definition.
#[test]
fn models_are_compared_on_both_kinds_of_data() {
    let (fitted, other) = (record(even(500), 0.05, 42), record(even(300), 0.05, 43).named("other"));
    let good = Fit::new(&Lag, &fitted).parameters(branch()).run().unwrap();
    let fixed_gain = Branch { gain: greybox::fixed(1.5), ..branch() };
    let poor = Fit::new(&Lag, &fitted).parameters(fixed_gain).run().unwrap();
    let both = |compared: Compared, record: &ExperimentOf<Lag>| {
        let compared = compared.with("good", &good.predict(&Lag, record).unwrap()).unwrap();
        compared.with("poor", &poor.predict(&Lag, record).unwrap()).unwrap()
    };
    let section = Section::from(vec![
        both(Compared::estimation(fitted.record()), &fitted),
        both(Compared::validation(other.record()), &other),
    ]);
    let table = &section.tables[0];
    assert_eq!(table.columns, ["record", "data", "output", "good", "poor"]);
    let kinds: Vec<&str> = table.rows.iter().map(|row| row[1].text()).collect();
    assert_eq!(kinds, ["estimation", "validation"]);
    let expected = good.predict(&Lag, &other).unwrap().quality.y.fit_percent.unwrap();
    assert!((table.rows[1][3].value().unwrap() - expected).abs() < 1e-9);
    assert!(table.rows[1][4].value().unwrap() < expected - 10.0);
    assert_eq!(timeline!(&section.plots[0]).panels[0].lines.len(), 3, "measured and two models");
    let short = Compared::validation(other.record()).with("good", &good.predict(&Lag, &fitted).unwrap());
    assert!(matches!(short, Err(Error::Lengths { found: 500, expected: 300, .. })));
}

/// Searches from elsewhere as steps over their number, and the course of a search on a logarithmic axis.
#[test]
fn starts_and_iterations_are_drawn() {
    let record = [record(even(200), 0.02, 44)];
    let problem = Fit::new(&Lag, &record).parameters(branch()).starts(12).problem().unwrap();
    let estimate = problem.run().unwrap();
    let found = estimate.starts.as_ref().unwrap();
    let ended: u64 = found.minima.iter().map(|minimum| minimum.searches).sum();
    assert_eq!(ended + found.failed.len() as u64, 12);
    let report = Report::new(&problem, &estimate).unwrap();
    let section = report.sections.iter().find(|section| section.id == "starts").unwrap();
    let Layer::Line { points, .. } = &layers(&section.plots[0])[0] else { panic!() };
    assert_eq!(points.last().unwrap().0, ended as f64);
    assert!(points.windows(2).all(|pair| pair[0].1 <= pair[1].1));
    let costs = [100.0, 10.0, 1.5, 1.0];
    let iterations = costs.iter().enumerate().map(|(k, &cost)| (k as u64, cost)).collect();
    let course = Section::from(Convergence::new(iterations));
    let Layer::Line { points, .. } = &layers(&course.plots[0])[0] else { panic!() };
    assert_eq!(points, &[(0.0, 99.0), (1.0, 9.0), (2.0, 0.5)]);
}
