//! One case: a fit with random settings, and all that is made of it.

use crate::models::{Broken, Lag, Line, Oscillator, Pendulum, Regression};
use crate::random::Random;
use crate::values::{Draw, parameter, record};
use greybox::diagnose::{Resampling, bootstrap, profile, validate};
use greybox::estimate::About;
use greybox::optimize::{GaussNewton, LevenbergMarquardt, Outcome, Stop};
use greybox::pmsm::Surface;
use greybox::{
    Automatic, Butterworth, Error, Esdirk, Estimate, ExperimentOf, Fit, Fleet, Horizon, Huber, Kind, Knowledge, Model,
    Parameter, Problem, Report, Rk4, Rk45, Sample, Severity, Signals, Summary, Warning,
    loss::{Cauchy, SoftL1, Tukey},
    optimize::{JacobianColumns, OwnSize},
};
use std::time::Duration;

/// How far cases came.
#[derive(Debug, Default)]
pub struct Tally {
    pub cases: u64,
    pub records: u64,
    pub fits: u64,
    pub converged: u64,
    pub reports: u64,
    pub profiles: u64,
    pub bootstraps: u64,
    pub fleets: u64,
}

impl Tally {
    pub fn add(&mut self, other: &Tally) {
        let Tally { cases: _, records, fits, converged, reports, profiles, bootstraps, fleets } = other;
        self.records += records;
        self.fits += fits;
        self.converged += converged;
        self.reports += reports;
        self.profiles += profiles;
        self.bootstraps += bootstraps;
        self.fleets += fleets;
    }
}

pub fn run(number: u64) -> Result<Tally, String> {
    let mut draw = Draw(Random(number.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
    match draw.below(7) {
        0 => through(&mut draw, &Line),
        1 => through(&mut draw, &Broken),
        2 => through(&mut draw, &Regression),
        3 => through(&mut draw, &Lag),
        4 => through(&mut draw, &Oscillator),
        5 => through(&mut draw, &Pendulum),
        _ => through(&mut draw, &Surface::new(4).map_err(|error| error.to_string())?),
    }
}

fn through<M: Model + Clone + 'static>(draw: &mut Draw, model: &M) -> Result<Tally, String> {
    let mut tally = Tally::default();
    let count = draw.pick(&[1, 1, 1, 2, 3]);
    let records: Vec<ExperimentOf<M>> = (0..count).filter_map(|_| record(draw, model)).collect();
    if records.is_empty() {
        return Ok(tally);
    }
    tally.records = 1;
    let declared = M::Parameters::from_fn(|_| parameter(draw));
    // A value per experiment is refused where there is one.
    let of = M::Parameters::into_array(declared);
    let shared = M::Parameters::from_fn(|i| Parameter { per_experiment: false, ..of.as_ref()[i] });
    let settings = Settings::drawn(draw);
    let together = if records.len() > 1 { declared } else { shared };
    let fit = || settings.applied(Fit::new(model, &records).parameters(together));
    let problem = match fit().problem() {
        Ok(problem) => problem,
        Err(error) => return said(&error).map(|()| tally),
    };
    match problem.run() {
        Ok(summary) => judged(draw, &problem, &summary, &mut tally)?,
        Err(error) => said(&error)?,
    }
    if let Ok(estimate) = fit().run() {
        let again = validate(&estimate, model, &records[0], &[1]);
        again.err().map_or(Ok(()), |error| said(&error))?;
        readable(&estimate)?;
    }
    if draw.chance(0.2) {
        let fleet = settings.applied(Fleet::new(model).parameters(declared)).fleet();
        let fleet = match fleet {
            Ok(fleet) => fleet,
            Err(error) => return said(&error).map(|()| tally),
        };
        for (answer, record) in fleet.run(records.iter().cloned()).zip(&records) {
            agree(&answer, &settings.applied(Fit::new(model, record).parameters(shared)).run())?;
        }
        tally.fleets = 1;
    }
    Ok(tally)
}

/// Settings of a fit, by number where they have types.
struct Settings {
    noise: Option<f64>,
    covariance: bool,
    loss: usize,
    weighting: usize,
    filter: Option<(u32, f64)>,
    optimizer: usize,
    integrator: usize,
    horizon: Option<usize>,
    tuning: f64,
}

impl Settings {
    fn drawn(draw: &mut Draw) -> Self {
        Settings {
            noise: draw.chance(0.3).then(|| draw.number(0.15)),
            covariance: draw.chance(0.1),
            loss: draw.below(12),
            weighting: draw.below(14),
            filter: draw.chance(0.08).then(|| (1 + draw.below(4) as u32, draw.number(0.1))),
            optimizer: draw.below(8),
            integrator: draw.below(12),
            horizon: draw.chance(0.2).then(|| draw.pick(&[0, 1, 2, 10, 5000])),
            tuning: draw.number(0.1),
        }
    }

    fn applied<'a, M: Model + 'static>(&self, mut fit: Fit<'a, M>) -> Fit<'a, M> {
        fit = fit.time_limit(Duration::from_secs(1));
        if let Some(sigma) = self.noise {
            fit = fit.noise(M::Output::splat(sigma));
        }
        if self.covariance {
            fit = fit.noise_covariance();
        }
        fit = match self.loss {
            0 => fit.loss(Huber(self.tuning)),
            1 => fit.loss(Tukey(self.tuning)),
            2 => fit.loss(Cauchy(self.tuning)),
            3 => fit.loss(SoftL1(self.tuning)),
            _ => fit,
        };
        let tuning = self.tuning;
        fit = match self.weighting {
            0 => fit.weighting(|s: &Sample<M>| s.t.abs()),
            1 => fit.weighting(move |_: &Sample<M>| tuning),
            2 => fit.weighting(|s: &Sample<M>| f64::from(u8::from(s.t > 0.5))),
            _ => fit,
        };
        if let Some((order, cutoff)) = self.filter
            && let Ok(filter) = Butterworth::low_pass(order, cutoff, 0.01)
        {
            fit = fit.prefilter(filter);
        }
        let stop = Stop { iterations: 60, ..Stop::default() };
        fit = match self.optimizer {
            0 => fit.optimizer(GaussNewton::new(stop)),
            1 => fit.optimizer(LevenbergMarquardt::new(stop, OwnSize)),
            2 => fit,
            _ => fit.optimizer(LevenbergMarquardt::new(stop, JacobianColumns)),
        };
        // Other kinds of models are refused.
        let integrator = if M::KIND == Kind::Continuous { self.integrator } else { usize::MAX };
        fit = match integrator {
            0 => fit.integrator(Rk4 { substeps: 3 }),
            1 => fit.integrator(Rk45 { relative: 1e-6, absolute: 1e-9 }),
            2 => fit.integrator(Esdirk { relative: 1e-6, absolute: 1e-9 }),
            3 => fit.integrator(Rk45 { relative: self.tuning, absolute: 1e-9 }),
            4 => fit.integrator(Automatic::default()),
            _ => fit,
        };
        match self.horizon {
            Some(steps) => fit.predictor(Horizon::new(steps)),
            None => fit,
        }
    }
}

/// All that is made of an answer.
fn judged(draw: &mut Draw, problem: &Problem<'_>, summary: &Summary, tally: &mut Tally) -> Result<(), String> {
    tally.fits = 1;
    tally.converged = u64::from(summary.outcome.converged());
    known(summary)?;
    named(summary)?;
    in_words("estimate", &summary.to_string())?;
    let text = summary.to_json().map_err(|error| error.to_string())?;
    let again = Summary::from_json(&text).and_then(|read| read.to_json()).map_err(|error| error.to_string())?;
    check(text == again, || "the estimate is read other than it was written".to_owned())?;
    let mut report = match Report::new(problem, summary) {
        Ok(report) => report,
        Err(error) => return said(&error),
    };
    tally.reports = 1;
    let unknown = summary.unknowns[draw.below(summary.unknowns.len())].name.clone();
    if draw.chance(0.15) {
        match profile(problem, summary, &unknown, 0.95) {
            Ok(profile) => {
                report = report.with(profile);
                tally.profiles = 1;
            }
            Err(error) => said(&error)?,
        }
    }
    if draw.chance(0.1) {
        match bootstrap(problem, summary, Resampling::Blocks(draw.below(3)), 20, 1) {
            Ok(bootstrap) => {
                report = report.with(bootstrap);
                tally.bootstraps = 1;
            }
            Err(error) => said(&error)?,
        }
    }
    shown(&report)
}

/// A report is read as it was written, and shows numbers that are none in words.
fn shown(report: &Report) -> Result<(), String> {
    let text = report.to_json_with_drawings().map_err(|error| error.to_string())?;
    let read = Report::from_json(&text).map_err(|error| error.to_string())?;
    let again = read.to_json_with_drawings().map_err(|error| error.to_string())?;
    check(text == again, || "the report is read other than it was written".to_owned())?;
    let page = report.to_html();
    check(page == read.to_html(), || "the page of a report that was read is another".to_owned())?;
    let read = page.split("<script").map(|part| part.split_once("</script>").map_or(part, |(_, after)| after));
    in_words("page", &read.collect::<String>())?;
    in_words("Markdown", &report.to_markdown())?;
    in_words("text", &report.to_string())?;
    for plot in report.plots() {
        in_words(&plot.name, &plot.to_svg())?;
    }
    Ok(())
}

/// What is known has a finite value, a finite standard error and finite ends, about the value unless another
/// unknown at its bound moves them.
fn known(summary: &Summary) -> Result<(), String> {
    let moved = summary.unknowns.iter().any(|u| matches!(u.knowledge, Knowledge::Held { end: Some(_), .. }));
    for unknown in &summary.unknowns {
        let (name, value) = (&unknown.name, unknown.value);
        check(value.is_finite(), || format!("{name} is {value}"))?;
        match unknown.knowledge {
            Knowledge::Known { standard_error, lower, upper } => {
                let sound = standard_error > 0.0 && standard_error.is_finite();
                let about = lower <= value && value <= upper || moved && lower < upper;
                let ends = about && lower.is_finite() && upper.is_finite();
                check(sound && ends, || format!("{name} = {value} is known to {standard_error}, {lower} to {upper}"))?;
            }
            Knowledge::Held { bound, end } => {
                check(bound.is_finite() && end.is_none_or(f64::is_finite), || format!("{name} is held at {bound}"))?;
            }
            Knowledge::Fixed | Knowledge::Unidentified => {}
        }
    }
    Ok(())
}

/// A warning about one of several things has its name in its words.
fn named(summary: &Summary) -> Result<(), String> {
    for Warning { about, text, .. } in &summary.warnings {
        let name = match *about {
            About::Unknown(i) => summary.unknowns.get(i).map(|one| &one.name),
            About::Output(j) => summary.outputs.get(j).map(|one| &one.name),
            About::Input(i) => summary.layout.inputs.get(i).map(|one| &one.name),
            About::Experiment(e) => summary.experiments.get(e).map(|one| &one.name),
            About::Direction(d) => summary.directions.get(d).and_then(|one| Some(&one.moves.first()?.0)),
            _ => continue,
        };
        let said = name.is_some_and(|name| text.contains(&format!("`{name}`")));
        check(said, || format!("{about:?} is {name:?}, but the warning is: {text}"))?;
    }
    Ok(())
}

/// An error says something that can be read.
fn said(error: &Error) -> Result<(), String> {
    let text = error.to_string();
    let long = text.split_whitespace().any(|word| word.len() > 100);
    check(!text.is_empty() && !long, || format!("says \"{text}\""))
}

fn readable<M: Model>(estimate: &Estimate<M>) -> Result<(), String> {
    let text = estimate.to_json().map_err(|error| error.to_string())?;
    let read = Estimate::<M>::from_json(&text).map_err(|error| error.to_string())?;
    check(read.to_json().is_ok_and(|again| again == text), || {
        "the typed estimate is read other than written".to_owned()
    })
}

/// A fleet's answer is that of the single fit.
fn agree<M: Model>(fleet: &Result<Estimate<M>, Error>, single: &Result<Estimate<M>, Error>) -> Result<(), String> {
    match (fleet, single) {
        (Ok(fleet), Ok(single)) => {
            let limited = |one: &Estimate<M>| one.outcome == Outcome::TimeLimit;
            if limited(fleet) || limited(single) {
                return Ok(());
            }
            // Rounding moves what the data do not determine, and by some standard errors what they determine but for rounding.
            let rounding = if single.outcome == Outcome::Exact { 10.0 } else { 1e-6 };
            let known = |one: &Estimate<M>| -> Vec<(f64, f64)> {
                let of = single.unknowns.iter().zip(&one.unknowns);
                of.filter_map(|(single, one)| Some((one.value, single.knowledge.standard_error()?))).collect()
            };
            let (a, b) = (known(fleet), known(single));
            let near = |((a, _), (b, error)): (&(f64, f64), &(f64, f64))| {
                (a - b).abs() <= 1e-6 * a.abs().max(b.abs()) + rounding * error
            };
            let near = a.iter().zip(&b).all(near);
            let both = |holds: &dyn Fn(&Estimate<M>) -> bool| holds(fleet) && holds(single);
            let converged = both(&|one| one.outcome.converged());
            // Rounding decides where the cost is flat in all directions that are left.
            let flat = (fleet.cost - single.cost).abs() <= 1e-9 * single.cost.abs();
            let junk = flat && both(&|one| one.severity() == Severity::NotUsable);
            check(near || junk || !converged, || {
                format!(
                    "the fleet finds {a:?}, {}, the single fit (with standard errors) {b:?}, {}",
                    fleet.outcome, single.outcome
                )
            })
        }
        (Err(fleet), Err(_)) => said(fleet),
        // How far a fit comes within its time is chance.
        (_, Err(single)) if single.to_string().contains("time limit") => Ok(()),
        (Err(fleet), _) if fleet.to_string().contains("time limit") => Ok(()),
        // Rounding decides whether a simulation overflows just where a search ended that did not converge.
        (Ok(fleet), Err(Error::Simulation(_))) if !fleet.outcome.converged() => Ok(()),
        (Ok(fleet), Err(single)) => Err(format!("the fleet finds {}, the single fit says {single}", fleet.outcome)),
        (Err(fleet), Ok(single)) => Err(format!("the fleet says {fleet}, the single fit finds {}", single.outcome)),
    }
}

/// A text for readers has words where there is no number.
fn in_words(what: &str, text: &str) -> Result<(), String> {
    let bare = |word: &str| matches!(word.trim_matches(|c: char| !c.is_alphanumeric()), "NaN" | "inf");
    let wrong = |line: &&str| line.split([' ', '<', '>', '"', '\'', '%', '=', ',', ';']).any(bare);
    let line = text.lines().find(wrong);
    check(line.is_none(), || format!("its {what} has \"{:.400}\"", line.unwrap_or_default().trim()))
}

fn check(sound: bool, wrong: impl FnOnce() -> String) -> Result<(), String> {
    if sound { Ok(()) } else { Err(wrong()) }
}
