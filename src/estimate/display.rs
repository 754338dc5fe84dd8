//! An estimate as plain text, within the 80 columns of a terminal.

use super::examination::described;
use super::{Knowledge, ParameterEstimate, Summary, Unknown};
use crate::numeral::{counted, error_size, exact, number, resolved};
use crate::section::{Cell, Table, wrapped};
use crate::severity::Severity;
use core::fmt;

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = |f: &mut fmt::Formatter<'_>, text: &str, indent: usize| {
            writeln!(f, "{:indent$}{}", "", wrapped(text, indent, indent + 2))
        };
        line(f, &format!("Verdict: {}. Search: {}; {}.", self.severity(), self.outcome, self.searches()), 0)?;
        if !self.outcome.converged() {
            line(f, self.outcome.advice(), 2)?;
        }
        for warning in &self.warnings {
            let kind = if warning.severity == Severity::Usable { "note" } else { "warning" };
            line(f, &format!("{kind}: {}", warning.text), 2)?;
        }
        let fixed = self.parameters.iter().filter(|parameter| parameter.knowledge == Knowledge::Fixed);
        let rows: Vec<Vec<Cell>> = self.unknowns.iter().map(row).chain(fixed.map(fixed_row)).collect();
        let columns = ["parameter", "value", "unit", "std. error", "95 % interval", "index"];
        writeln!(f, "\n{}\n", Table::new("", columns).rows(rows))?;
        let outputs = self.outputs.iter().map(|output| {
            let fit = Cell::fit(output.fit.fit_percent);
            let (rmse, sigma) = (Cell::number(output.fit.rmse, 4), Cell::number(output.fit.sigma, 4));
            [output.name.as_str().into(), rmse, output.unit.as_str().into(), sigma, fit]
        });
        writeln!(f, "{}\n", Table::new("", ["output", "rmse", "unit", "noise", "fit"]).rows(outputs))?;
        let mut figures = format!(
            "{}, {}",
            counted(self.measurements, "measurement"),
            counted(self.unknowns.len() as u64, "unknown")
        );
        for (name, value) in [("FPE", self.fpe()), ("AIC", self.aic()), ("AICc", self.aicc()), ("BIC", self.bic())] {
            figures += &value.map_or(String::new(), |value| format!(", {name} {}", number(value, 6)));
        }
        line(f, &figures, 0)?;
        line(f, &described(&self.examined), 0)?;
        let m = &self.method;
        let seconds = number(self.seconds, 2);
        let search = format!(
            "{}: {}, {}, {seconds} s",
            m.optimizer,
            counted(self.iterations, "iteration"),
            counted(self.evaluations, "evaluation")
        );
        line(f, &search, 0)?;
        let said = ["loss", "weighting", "pre-filter"].into_iter().zip([&m.loss, &m.weighting, &m.prefilter]);
        let said: Vec<String> = said.map(|(name, value)| format!("{name} {value}")).collect();
        line(f, &format!("{}; {}; model {}; {}", m.predictor, m.integrator, m.engine, said.join("; ")), 0)?;
        write!(f, "{}", wrapped(&format!("noise {}; covariance {}", m.noise, m.covariance), 0, 2))
    }
}

/// A row of the table of parameters.
fn row(unknown: &Unknown) -> Vec<Cell> {
    let Unknown { name, value, unit, .. } = unknown;
    let head = |value: Cell| [name.as_str().into(), value, unit.as_str().into()].into_iter();
    let said = |text: String| head(Cell::number(*value, 7)).chain([Cell::Empty, text.into()]).collect();
    match unknown.knowledge {
        Knowledge::Known { standard_error, lower, upper } => {
            let (lower, upper) = (resolved(lower, standard_error), resolved(upper, standard_error));
            let index = match unknown.error_index {
                Some(index) if index >= 1e4 => "> 9999 %".to_owned(),
                Some(index) => format!("{} %", number(index, 3)),
                None => "-".to_owned(),
            };
            let known = [error_size(standard_error).into(), format!("{lower} … {upper}").into(), index.into()];
            head(Cell::resolved(*value, standard_error)).chain(known).collect()
        }
        Knowledge::Held { bound, end } => said(held(bound, end)),
        Knowledge::Unidentified => said("not determined by the data".to_owned()),
        Knowledge::Fixed => said("fixed".to_owned()),
    }
}

/// Description of an unknown at its bound.
pub(crate) fn held(bound: f64, end: Option<f64>) -> String {
    let held = format!("held at its bound {}", exact(bound));
    end.map_or(held.clone(), |end| format!("{held}; 95 % to {}", number(end, 3)))
}

fn fixed_row(parameter: &ParameterEstimate) -> Vec<Cell> {
    let ParameterEstimate { name, unit, value, .. } = parameter;
    [name.as_str().into(), Cell::number(*value, 7), unit.as_str().into(), Cell::Empty, "fixed".into()].into()
}
