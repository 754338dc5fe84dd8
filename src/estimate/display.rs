//! The report of an estimate as plain text.

use super::{Estimate, Knowledge};
use crate::model::Model;
use crate::optimize::Severity;
use crate::signals::Signals;
use core::fmt;

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Severity::Usable => "usable",
            Severity::UsableWithCare => "usable with care",
            Severity::NotUsable => "not usable",
        })
    }
}

impl<M: Model, I, P> fmt::Display for Estimate<M, I, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Verdict: {}. Search: {}.", self.severity(), self.outcome)?;
        if !self.outcome.converged() {
            writeln!(f, "  {}", self.outcome.advice())?;
        }
        for warning in &self.warnings {
            writeln!(
                f,
                "  {}: {}",
                if warning.severity == Severity::Usable { "note" } else { "warning" },
                warning.text
            )?;
        }
        writeln!(f)?;
        let width = self.unknowns.iter().map(|u| u.name.len()).max().unwrap_or(0);
        let width = M::Parameters::NAMES.iter().map(|name| name.len()).max().unwrap_or(0).max(width).max(9);
        let title = ["value", "unit", "std. error", "95 % interval", "index"];
        writeln!(
            f,
            "{:<width$} {:>14} {:<9} {:>11} {:^29} {:>8}",
            "parameter", title[0], title[1], title[2], title[3], title[4]
        )?;
        for unknown in &self.unknowns {
            write!(f, "{:<width$} {:>14} {:<9} ", unknown.name, number(unknown.value, 7), unknown.unit)?;
            match unknown.knowledge {
                Knowledge::Known { standard_error, lower, upper } => {
                    let interval = format!("[{:>13}, {:>13}]", number(lower, 6), number(upper, 6));
                    write!(f, "{:>11} {interval} ", number(standard_error, 3))?;
                    match unknown.error_index {
                        Some(index) => writeln!(f, "{:>6} %", number(index, 3))?,
                        None => writeln!(f, "{:>8}", "-")?,
                    }
                }
                Knowledge::Held { bound } => writeln!(f, "held at its bound {}", number(bound, 6))?,
                Knowledge::Unidentified => writeln!(f, "not determined by the data")?,
                Knowledge::Fixed => writeln!(f, "fixed")?,
            }
        }
        let (values, knowledge) =
            (M::Parameters::into_array(self.parameters), M::Parameters::into_array(self.knowledge));
        for (i, value) in values.as_ref().iter().enumerate() {
            if knowledge.as_ref()[i] == Knowledge::Fixed {
                let (name, unit) = (M::Parameters::NAMES[i], M::Parameters::UNITS[i]);
                writeln!(f, "{name:<width$} {:>14} {unit:<9} fixed", number(*value, 7))?;
            }
        }
        writeln!(f)?;
        writeln!(f, "{:<width$} {:>14} {:<9} {:>11} {:>9}", "output", "rmse", "unit", "noise", "fit")?;
        for (j, quality) in M::Output::into_array(self.quality).into_iter().enumerate() {
            let (name, unit) = (M::Output::NAMES[j], M::Output::UNITS[j]);
            let fit = quality.fit_percent.map_or("-".to_owned(), |fit| format!("{fit:.3} %"));
            let (rmse, sigma) = (number(quality.rmse, 4), number(quality.sigma, 4));
            writeln!(f, "{name:<width$} {rmse:>14} {unit:<9} {sigma:>11} {fit:>9}")?;
        }
        writeln!(f)?;
        write!(f, "{} measurements, {} unknowns", self.measurements, self.unknowns.len())?;
        for (name, value) in [("FPE", self.fpe()), ("AIC", self.aic()), ("AICc", self.aicc()), ("BIC", self.bic())] {
            if let Some(value) = value {
                write!(f, ", {name} {}", number(value, 6))?;
            }
        }
        writeln!(f)?;
        let m = &self.method;
        writeln!(
            f,
            "{}: {} iterations, {} evaluations, {:.3} s",
            m.optimizer, self.iterations, self.evaluations, self.seconds
        )?;
        writeln!(
            f,
            "{}; {}; loss {}; weighting {}; pre-filter {}",
            m.predictor, m.integrator, m.loss, m.weighting, m.prefilter
        )?;
        write!(f, "noise {}; covariance {}", m.noise, m.covariance)
    }
}

/// A number with so many significant digits, in the form that is read more easily.
pub(crate) fn number(value: f64, digits: usize) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-4..1e7).contains(&size) {
        return format!("{value:.*e}", digits - 1);
    }
    let before = size.log10().floor() as i32;
    format!("{value:.*}", (digits as i32 - 1 - before).max(0) as usize)
}
