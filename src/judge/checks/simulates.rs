//! Whether the parameters that a filter found serve a simulation, too.

use super::*;
use crate::problem::{Control, Noise, Problem, noise};

pub(crate) const SIMULATES: Check = Check::new(
    "a simulation predicts as well",
    "Of a filter: how far off are the outputs in a simulation from the first sample, with the parameters and the initial state of the estimate?",
    &[WarningCode::SimulatesWorse],
    simulates,
)
.costs(&[Pass::Values(1)])
.levels(&[level("times the error of the predictions", WORSE, "below, one error says as much as the other")]);

const WORSE: f64 = 1.5;

fn simulates(evidence: &Evidence<'_>, _intervals: &Intervals) -> Examined {
    let objective = evidence.point.objective;
    if !objective.sweep.predicts_variance() || objective.problem.layout().states.is_empty() {
        return Examined::from(None);
    }
    let Some(sweep) = objective.sweep.simulating(objective.problem.samples()) else {
        return Examined::from(None).without(Some("predictors that have no simulation"));
    };
    let of = objective.problem;
    let settings = of.settings.beside(Noise::PerOutput);
    let Ok(problem) = Problem::new(sweep, of.records.clone(), &of.unknowns.parameters, settings) else {
        return Examined::from(None).without(Some("a simulation, which cannot be made"));
    };
    let serves = "the estimate serves what corrects the state by measurements (control, monitoring), not a simulation of as long a record";
    let outputs = &of.layout().outputs;
    let text = match noise::errors(&problem.in_units(&Control::NEVER), &evidence.point.end.coordinates) {
        Err(_) => Some(format!("a simulation from the first sample with these parameters fails: {serves}")),
        Ok(simulated) => {
            let times = |(j, error): (usize, &f64)| (j, error / evidence.residuals.outputs[j].rmse);
            let worst = simulated.iter().enumerate().map(times).filter(|(_, times)| times.is_finite());
            let worst = worst.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, times)| *times > WORSE);
            worst.map(|(j, _)| {
                let off = |error: f64| format!("{}{}", number(error, 3), unit_after(&outputs[j].unit));
                // Outputs are taken in one after the other.
                let before = if j > 0 { " and from the outputs before it" } else { "" };
                format!(
                    "predicted one sample ahead{before}, `{}` is off by {} (rms); simulated from the first sample with these parameters, by {}: {serves}",
                    outputs[j].name,
                    off(evidence.residuals.outputs[j].rmse),
                    off(simulated[j])
                )
            })
        }
    };
    Examined::from(text.map(|text| note(WarningCode::SimulatesWorse, text)))
}
