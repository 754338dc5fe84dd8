//! What the reader of an estimate must know of its data and its method.

use super::objective::Objective;
use crate::estimate::{Direction, Knowledge, Unknown, Warning};
use crate::model::Kind;
use crate::numeral::{counted, exact, number, percent};
use crate::optimize::Severity;

/// A finer step may move a parameter by this part of its standard error without a word.
const STEP_SHIFT: f64 = 0.5;

impl Objective<'_> {
    /// What must be said of what was found about the unknowns. `step_error` bounds, in standard errors, what a finer step
    /// would move.
    pub(super) fn warnings(
        &self,
        coordinates: &[f64],
        rows: &[Unknown],
        directions: &[Direction],
        measured: u64,
        step_error: f64,
    ) -> Vec<Warning> {
        let care = |text: String| Warning { severity: Severity::UsableWithCare, text };
        let mut warnings = vec![];
        let degrees = measured.saturating_sub(rows.len() as u64);
        if degrees == 0 {
            let text = format!(
                "{measured} measurement(s) for {} unknown(s) leave nothing to tell the accuracy by; fix some, or record more",
                rows.len()
            );
            warnings.push(Warning { severity: Severity::NotUsable, text });
        } else if rows.iter().all(|row| row.knowledge == Knowledge::Unidentified) {
            let text = "the data determine none of the unknowns".to_owned();
            warnings.push(Warning { severity: Severity::NotUsable, text });
        }
        for e in (0..self.experiments()).filter(|_| self.source.kind() != Kind::Static) {
            if let Some((count, first)) = self.source.gaps(e) {
                warnings.push(care(format!(
                    "time jumps in experiment `{}` ({}, the first: {first}): the input is taken as held meanwhile, \
                     which is seldom what happened; fit the pieces between (Experiment::without_gaps)",
                    self.unknowns.labels[e],
                    counted(count as u64, "gap")
                )));
            }
        }
        for row in rows {
            if let Knowledge::Held { bound } = row.knowledge {
                let text = format!(
                    "`{}` is held at its bound {} {}: the data want it beyond",
                    row.name,
                    exact(bound),
                    row.unit
                );
                warnings.push(care(text));
            }
        }
        warnings.extend(
            directions.iter().map(|d| care(format!("{d}; fix one, add a prior, or excite the system differently"))),
        );
        // The bound first, which costs little; the shift itself only where the bound is not enough.
        if step_error > STEP_SHIFT
            && let Some((source, finer)) = self.source.refined()
            && let Some((name, shift, part)) = (Objective { source, ..self.clone() }).shift(coordinates, rows)
            && shift > STEP_SHIFT
        {
            warnings.push(care(format!(
                "the step is too coarse: with {finer} `{name}` would move by {} of itself ({} standard errors); use \
                 a finer step",
                percent(part, 2),
                number(shift, 2)
            )));
        }
        warnings
    }

    /// By how many standard errors, and by which part of itself, an unknown would move at most towards the minimum.
    fn shift(&self, coordinates: &[f64], rows: &[Unknown]) -> Option<(String, f64, f64)> {
        let linear = self.evaluate(coordinates).ok()?;
        let held: Vec<bool> = rows.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
        let step = linear.step(&vec![0.0; rows.len()], &held)?;
        let shift = |i: usize| {
            let change = (step[i] * rows[i].transform.slope(rows[i].value)).abs();
            let error = rows[i].knowledge.standard_error().filter(|error| *error > 0.0)?;
            Some((rows[i].name.clone(), change / error, change / rows[i].value.abs()))
        };
        (0..rows.len()).filter_map(shift).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}
