//! [`Unless`]: what rules a check out.

use super::Evidence;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Unless {
    RoundOff,
    Prefilter,
    Restarts,
    Variances,
    Weighed,
    Static,
    NoMinimum,
    ManyUnknowns,
    /// No more degrees of freedom than so many.
    NoFreedom(f64),
}

/// More unknowns than these are many.
const MANY: usize = 200;

impl Unless {
    /// In a few words, for a report.
    pub fn reason(self) -> &'static str {
        match self {
            Unless::RoundOff => "the errors are round-off",
            Unless::Prefilter => "a pre-filter",
            Unless::Restarts => "predictions that restart from measurements",
            Unless::Variances => "variances are predicted",
            Unless::Weighed => "a robust loss or weights",
            Unless::Static => "a model without states",
            Unless::NoMinimum => "no minimum",
            Unless::ManyUnknowns => "more than 200 unknowns",
            Unless::NoFreedom(_) => "no degrees of freedom",
        }
    }
}

impl Evidence<'_> {
    /// The reason why a check is not made, if it is one of these.
    pub fn ruled_out(&self, by: &[Unless]) -> Option<&'static str> {
        by.iter().find(|one| self.holds(**one)).map(|one| one.reason())
    }

    fn holds(&self, unless: Unless) -> bool {
        let (point, objective) = (&self.point, self.point.objective);
        match unless {
            Unless::RoundOff => self.rounding || point.is_exact(),
            Unless::Prefilter => objective.problem.settings.prefilter.is_some(),
            Unless::Restarts => objective.sweep.restarts().is_some(),
            Unless::Variances => objective.sweep.predicts_variance(),
            Unless::Weighed => objective.loss().is_some() || objective.is_weighted(),
            Unless::Static => point.is_static(),
            Unless::NoMinimum => !point.end.outcome.converged(),
            Unless::ManyUnknowns => objective.problem.unknowns.row.len() > MANY,
            Unless::NoFreedom(most) => point.degrees <= most,
        }
    }
}
