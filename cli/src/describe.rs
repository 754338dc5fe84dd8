//! A fit or a stored estimate, from which commands that examine it go on.

use crate::arguments::Refit;
use crate::fitting::{Loaded, estimate, load, read, watched};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, fit, output};
use greybox::problem::Problem;
use greybox::report::Section;
use greybox::{Report, Severity, Summary, Warning};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// A problem and its estimate.
pub struct Examined {
    pub loaded: Loaded,
    pub problem: Problem<'static>,
    pub estimate: Summary,
    /// Counts refits.
    pub counter: Arc<AtomicU64>,
}

/// Fits, or takes the estimate that is named.
pub fn examined(refit: &Refit, terminal: &Terminal) -> Result<Examined, Failure> {
    output::check(refit.report.as_deref(), &output::REPORTS)?;
    output::apart([&refit.report], read(&refit.fitting)?.into_iter().chain(refit.estimate.clone()))?;
    let loaded = load(&refit.fitting, terminal)?;
    let counter = Arc::new(AtomicU64::new(0));
    let problem = watched(&loaded, &refit.fitting.of_fit, terminal)?.counter(counter.clone()).problem()?;
    let estimate = match &refit.estimate {
        Some(path) => {
            let found = estimate(path)?;
            if !problem.reproduces(&found)? {
                return Err(format!(
                    "{}: with this model, these records and these options its errors are others than those with which it was found; name those of its \
                     fit, or leave the estimate out",
                    path.display()
                )
                .into());
            }
            found
        }
        None => problem.run()?,
    };
    Ok(Examined { loaded, problem, estimate, counter })
}

/// Prints sections, and writes the report that is asked for with them.
pub fn said(
    refit: &Refit,
    examined: &Examined,
    sections: Vec<Section>,
    terminal: &Terminal,
) -> Result<Verdict, Failure> {
    let Examined { loaded, problem, estimate, .. } = examined;
    let report = fit::report(problem, estimate, loaded, &[])?;
    let severity = sections.iter().map(|section| section.severity).fold(estimate.severity(), Ord::max);
    // What is said of the sections alone, without the rest of the report.
    let mut short = Report { sections: vec![], severity, ..report.clone() };
    let mut whole = report;
    // Why the estimate is not simply usable stands in a section that is left out here.
    let mut reasons = estimate.warnings.iter().filter(|warning| warning.severity > Severity::Usable);
    for section in sections {
        let with = |section: Section, reason: &Warning| section.because(reason.severity, reason.text.clone());
        short = short.with(reasons.by_ref().fold(section.clone(), with));
        whole = whole.with(section);
    }
    output::line(if terminal.colored() { short.to_colored_text() } else { short.to_string() })?;
    if let Some(path) = &refit.report {
        output::report(path, &whole)?;
        terminal.remark(format_args!("report: {}", path.display()));
    }
    Ok(severity.into())
}
