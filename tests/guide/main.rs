//! The pictures of the guide are what the library draws: each is drawn again and compared with its files.
//!
//! `GREYBOX_WRITE_PICTURES=1 cargo test --test guide` writes the files: an SVG for readers of `docs/guide`, and the same as
//! a link definition for the documentation.
#![cfg(feature = "csv")]

mod models;

use base64::{Engine, engine::general_purpose::STANDARD};
use greybox::diagnose::{self, Compared};
use greybox::pmsm::{Currents, Drive, Surface, Winding};
use greybox::report::{Axis, Layer, Plot, Section, Style};
use greybox::{Estimate, Experiment, ExperimentOf, Fit, Model, Report, Time, fixed, free, simulate};
use models::{Behind, Coil, Current, Force, Mass, Position, Rotor, Shaft, Speed, Spring, Swing, Torque, Voltage};
use std::path::Path;

type Motor = (Surface, ExperimentOf<Surface>, Winding<greybox::Parameter>);
type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Compares a picture with its files, or writes them.
fn check(name: &str, plot: &Plot) -> Outcome {
    let svg = plot.to_svg();
    let link = format!("[{name}]: data:image/svg+xml;base64,{}\n", STANDARD.encode(&svg));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/guide/pictures");
    let (drawn, embedded) = (folder.join(format!("{name}.svg")), folder.join(format!("{name}.md")));
    if std::env::var_os("GREYBOX_WRITE_PICTURES").is_some() {
        std::fs::write(drawn, &svg)?;
        std::fs::write(embedded, link)?;
        return Ok(());
    }
    let kept = std::fs::read_to_string(drawn)?;
    assert_eq!(
        std::fs::read_to_string(embedded)?,
        format!("[{name}]: data:image/svg+xml;base64,{}\n", STANDARD.encode(&kept))
    );
    let (now, then) = (pieces(&svg), pieces(&kept));
    assert_eq!(now.len(), then.len(), "`{name}` has another number of parts");
    for (now, then) in now.iter().zip(&then) {
        match (now.parse::<f64>(), then.parse::<f64>()) {
            // Another processor rounds differently; a pixel is not seen.
            (Ok(now), Ok(then)) => assert!((now - then).abs() <= 1.0, "`{name}`: {now} was {then}"),
            _ => assert_eq!(now, then, "`{name}`"),
        }
    }
    Ok(())
}

/// The numbers of a text, and what stands between them.
fn pieces(text: &str) -> Vec<&str> {
    let number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let mut found = vec![];
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| number(c) != number(first)).unwrap_or(rest.len());
        found.push(&rest[..end]);
        rest = &rest[end..];
    }
    found
}

/// Measured and predicted values of the first output of a record over a range of samples, every so many of the measured ones.
fn over_time<M: Model>(
    (name, unit): (&str, &str),
    caption: &str,
    estimate: &Estimate<M>,
    model: &M,
    record: &ExperimentOf<M>,
    (samples, every, output): (std::ops::Range<usize>, usize, usize),
) -> Result<Plot, greybox::Error> {
    let prediction = estimate.predict(model, record)?;
    let columns = &prediction.columns.outputs;
    let measured = &record.record().outputs()[output];
    let points = |values: &[f64]| samples.clone().map(|k| (prediction.t[k], values[k])).collect::<Vec<_>>();
    let (predicted, all) = (points(&columns[output]), points(&measured.values));
    let residual = predicted.iter().zip(&all).map(|(p, m)| (p.0, m.1 - p.1)).collect();
    let layers = vec![
        Layer::Line { style: Style::Residual, points: residual },
        Layer::Dots { style: Style::Main, points: all.into_iter().step_by(every).collect() },
        Layer::Line { style: Style::Predicted, points: predicted },
    ];
    Ok(Plot::new(name, caption, caption, [Axis::new("time", "s"), Axis::new(name, unit)], layers))
}

/// The plot of a section whose name begins so.
fn plot<'a>(sections: &'a [Section], name: &str) -> &'a Plot {
    let plots = sections.iter().flat_map(Section::all_plots);
    plots.into_iter().find(|plot| plot.name.starts_with(name)).expect("the section has this plot")
}

#[test]
fn chapter_1_rotor() -> Outcome {
    let truth = Rotor { j: 0.02, b: 0.01, c: 0.15 };
    let torque: Vec<Torque> = (0..1000).map(|k| Torque { m: [0.5, -0.3, 0.2, -0.6, 0.0][k / 100 % 5] }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.01 };
    let run = simulate(&Shaft, &truth, &Speed { w: 0.0 }, time, &torque)?;
    let record = run.with_noise(Speed { w: 0.1 }, 1).experiment(&Shaft)?;
    let start = Rotor { j: free(0.1), b: free(0.02), c: free(0.05) };
    let estimate = Fit::new(&Shaft, &record).parameters(start).run()?;
    let caption = "Speed: measured (dots), predicted, and the residual about zero";
    check("rotor", &over_time(("w", "rad/s"), caption, &estimate, &Shaft, &record, (0..300, 5, 0))?)
}

#[test]
fn chapter_2_half_a_sample() -> Outcome {
    let model = Surface::new(4)?;
    let truth = Winding { rs: 3.6, ls: 1.72e-3, ke: 0.5 };
    let voltage = |k: usize| Drive { ud: if (k / 10).is_multiple_of(2) { 7.2 } else { -7.2 }, uq: 0.0, w: 0.0 };
    let both: Vec<Drive> = (0..800).map(|k| voltage(k / 2)).collect();
    let time = Time::Uniform { start: 0.0, step: 0.125e-3 };
    let still = Currents { id: 0.0, iq: 0.0 };
    let run = simulate(&model, &truth, &still, time, &both)?.with_noise(Currents { id: 0.02, iq: 0.02 }, 1);
    let middle = (0..400).map(|k| run.outputs[2 * k + 1]).collect();
    let time = Time::Uniform { start: 0.0, step: 0.25e-3 };
    let record = Experiment::new(&model, time, (0..400).map(voltage).collect(), middle)?;
    let record = record.initial(Currents { id: fixed(0.0), iq: fixed(0.0) });
    let start = Winding { rs: free(1.0), ls: free(1e-3), ke: fixed(0.5) };
    let estimate = Fit::new(&model, &record).parameters(start).run()?;
    let caption = "Current, half a sample early: measured (dots), predicted, and the residual about zero";
    check("half_sample", &over_time(("id", "A"), caption, &estimate, &model, &record, (0..60, 1, 0))?)
}

/// The small record of a motor, and where its fits start.
fn motor() -> Result<Motor, Box<dyn std::error::Error>> {
    let model = Surface::new(4)?;
    let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
    Ok((model, record, Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) }))
}

#[test]
fn chapter_7_parameters_and_profile() -> Outcome {
    let (model, record, start) = motor()?;
    let problem = Fit::new(&model, &record).parameters(start).problem()?;
    let estimate = problem.run()?;
    check("parameters", plot(&Report::new(&problem, &estimate)?.sections, "parameters"))?;
    let profile = diagnose::profile(&problem, &estimate, "rs", 0.95)?;
    check("profile", plot(&[Section::from(profile)], "profile"))
}

#[test]
fn chapter_8_colored_residuals() -> Outcome {
    let truth = Coil { r: 2.0, l: 4e-3, lost: 2.0 };
    let levels = [3.0, 8.0, -5.0, 2.5, -9.0, 6.0, -3.0];
    let voltage: Vec<Voltage> = (0..2000).map(|k| Voltage { u: levels[k / 40 % 7] }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.2e-3 };
    let run = simulate(&Behind, &truth, &Current { i: 0.0 }, time, &voltage)?;
    let record = run.with_noise(Current { i: 0.02 }, 1).experiment(&Behind)?;
    let start = Coil { r: free(1.0), l: free(1e-3), lost: fixed(0.0) };
    let problem = Fit::new(&Behind, &record).parameters(start).problem()?;
    let estimate = problem.run()?;
    check("colored", plot(&Report::new(&problem, &estimate)?.sections, "autocorrelation"))
}

#[test]
fn chapter_9_validation() -> Outcome {
    let (model, record, start) = motor()?;
    let (estimation, validation) = record.split(0.6)?;
    let estimate = Fit::new(&model, &estimation).parameters(start).run()?;
    let prediction = estimate.predict(&model, &validation)?;
    let compared = Compared::validation(validation.record()).with("fitted", &prediction)?;
    assert!((compared.fit_percent()[1].1[0].ok_or("no fit")? - 96.7).abs() < 0.05, "the number in the chapter");
    let caption =
        "Current iq of the record that was not fitted: measured (dots), predicted, and the residual about zero";
    check("validation", &over_time(("iq", "A"), caption, &estimate, &model, &validation, (0..250, 4, 1))?)
}

#[test]
fn chapter_10_waterfall() -> Outcome {
    let pushes: Vec<Force> = (0..1000).map(|k| Force { f: if k < 20 { 10.0 } else { 0.0 } }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.02 };
    let run = simulate(&Mass, &Spring { k: 40.0, d: 0.1 }, &Swing { x: 0.0, v: 0.0 }, time, &pushes)?;
    let record = run.with_noise(Position { x: 0.02 }, 1).experiment(&Mass)?;
    let record = record.initial(Swing { x: fixed(0.0), v: fixed(0.0) });
    let guess = Spring { k: free(60.0).log().within(10.0, 100.0), d: fixed(0.1) };
    let problem = Fit::new(&Mass, &record).parameters(guess).starts(20).problem()?;
    let estimate = problem.run()?;
    check("waterfall", plot(&Report::new(&problem, &estimate)?.sections, "starts"))
}
