//! The report of an estimate as plain text.

use super::{Knowledge, Summary};
use crate::optimize::Severity;
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

impl fmt::Display for Summary {
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
        let width = self.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0).max(width).max(9);
        let declared = self.parameters.iter().map(|p| &p.unit).chain(self.outputs.iter().map(|output| &output.unit));
        let units = self.unknowns.iter().map(|u| &u.unit).chain(declared).map(|unit| unit.chars().count());
        let units = units.max().unwrap_or(0).max(4);
        let title = ["value", "unit", "std. error", "95 % interval", "index"];
        writeln!(
            f,
            "{:<width$} {:>14} {:<units$} {:>11} {:^29} {:>8}",
            "parameter", title[0], title[1], title[2], title[3], title[4]
        )?;
        for unknown in &self.unknowns {
            let known = unknown.knowledge.standard_error();
            let value = known.map_or_else(|| number(unknown.value, 7), |error| resolved(unknown.value, error));
            write!(f, "{:<width$} {value:>14} {:<units$} ", unknown.name, unknown.unit)?;
            match unknown.knowledge {
                Knowledge::Known { standard_error, lower, upper } => {
                    let (lower, upper) = (resolved(lower, standard_error), resolved(upper, standard_error));
                    let index = match unknown.error_index {
                        Some(index) if index >= 1e4 => "> 9999 %".to_owned(),
                        Some(index) => format!("{} %", number(index, 3)),
                        None => "-".to_owned(),
                    };
                    writeln!(f, "{:>11} [{lower:>13}, {upper:>13}] {index:>8}", number(standard_error, 3))?;
                }
                Knowledge::Held { bound } => writeln!(f, "held at its bound {}", number(bound, 6))?,
                Knowledge::Unidentified => writeln!(f, "not determined by the data")?,
                Knowledge::Fixed => writeln!(f, "fixed")?,
            }
        }
        for parameter in self.parameters.iter().filter(|parameter| parameter.knowledge == Knowledge::Fixed) {
            let (name, unit) = (&parameter.name, &parameter.unit);
            writeln!(f, "{name:<width$} {:>14} {unit:<units$} fixed", number(parameter.value, 7))?;
        }
        writeln!(f)?;
        writeln!(f, "{:<width$} {:>14} {:<units$} {:>11} {:>9}", "output", "rmse", "unit", "noise", "fit")?;
        for output in &self.outputs {
            let (name, unit) = (&output.name, &output.unit);
            let fit = output.fit.fit_percent.map_or("-".to_owned(), |fit| format!("{fit:.3} %"));
            let (rmse, sigma) = (number(output.fit.rmse, 4), number(output.fit.sigma, 4));
            writeln!(f, "{name:<width$} {rmse:>14} {unit:<units$} {sigma:>11} {fit:>9}")?;
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

/// A number with the digits that its standard error leaves: to a thousandth of it, nine at most.
fn resolved(value: f64, error: f64) -> String {
    let digits = (value.abs() / error).log10().floor() + 4.0;
    number(value, if digits.is_nan() { 6 } else { digits.clamp(3.0, 9.0) as usize })
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

/// A probability in words; below what the tails of distributions are computed to, only that it is.
pub(crate) fn p_value(p: f64) -> String {
    if p < 1e-15 { "p < 1e-15".to_owned() } else { format!("p = {}", number(p, 2)) }
}
