//! Whether records show process noise: the likelihood ratio of a filter with and without.

use super::{check_complete, minimize_within};
use crate::error::Error;
use crate::estimate::Summary;
use crate::numeral::{number, p_value};
use crate::optimize::Stop;
use crate::parameter::fixed;
use crate::problem::{Control, Free, Noise, Objective, Problem, Role, Unknowns};
use crate::section::Section;
use crate::sweep::{Sweep, Undisturbed};
use crate::whiteness::chi_squared_tail;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, Discrete};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

/// A likelihood-ratio test of the hypothesis that nothing disturbs the plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessNoise {
    /// Names of the unknowns that are levels of process noise, and zero without it.
    pub levels: Vec<String>,
    /// Twice the difference of the log-likelihoods with process noise and without; not negative.
    #[serde(with = "crate::real")]
    pub likelihood_ratio: f64,
    /// The number of levels.
    pub degrees_of_freedom: u64,
    /// Probability of such a ratio, or a larger one, without process noise.
    #[serde(with = "crate::real")]
    pub p_value: f64,
}

/// A likelihood that is higher by less without process noise is rounding, and what a search leaves.
const ROUNDING: f64 = 1e-3;

/// Tests whether the plant is disturbed: fits again with all diffusion zero, from the estimate, and compares the likelihoods. Unknowns on which
/// nothing but diffusion depends, the levels, have no influence then.
///
/// A level cannot be negative, so that zero is on the boundary, and the ratio is not distributed as chi squared: of one level, half of the
/// records give zero, and the others chi squared with one degree of freedom (H. Chernoff, Annals of Mathematical Statistics 25 (1954) 573-578). Of
/// `k` levels the p-value is by the mixture of chi squared with `j = 0..k` degrees of freedom with binomial weights `k! / (j! (k - j)! 2^k)` (S. G.
/// Self and K.-Y. Liang, Journal of the American Statistical Association 82 (1987) 605-610), which holds for levels whose estimates are not
/// correlated; for others it is an approximation. In records that are short against the time over which the state remembers, zero is more frequent
/// than that, and the test conservative (C. M. Crainiceanu and D. Ruppert, Journal of the Royal Statistical Society B 66 (2004) 165-185). So it
/// is where several parameters make up one level, each of which counts.
///
/// # Errors
/// [`Error::NotDisturbed`] of a predictor that does not take the process noise of the model, of a model without diffusion or that is not read as a
/// graph, and where diffusion is not zero with its levels: it is given, or depends on what other equations depend on. [`Error::Undisturbed`] where
/// the fit without process noise fails. Weighted and robust fits, which have no likelihood; an estimate that is no maximum of it, or of another
/// problem; a time limit or a flag that stops it.
///
/// ```
/// use greybox::{Experiment, Fit, Kalman, Kind, Model, Nothing, Scalar, Time, diagnose, fixed, free, signals};
/// signals! {
///     pub struct Level { x: "m" }
///     pub struct Levels { q: "m", r: "m" }
/// }
/// /// A level that walks at random, and is measured with noise.
/// #[derive(Clone)]
/// struct Walk;
/// impl Model for Walk {
///     type State = Level; type Input = Nothing; type Output = Level; type Parameters = Levels;
///     const KIND: Kind = Kind::Discrete;
///     fn next<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Levels<S>) -> Level<S> { *x }
///     fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Levels<S>) -> Level<S> { *x }
///     fn diffusion<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> { Level { x: p.q } }
///     fn noise<S: Scalar>(&self, _t: S, _x: &Level<S>, _u: &Nothing, p: &Levels<S>) -> Level<S> { Level { x: p.r } }
/// }
/// # fn main() -> Result<(), greybox::Error> {
/// let slow = |k: usize| Level { x: (0.05 * k as f64).sin() + 0.1 * (2.4 * k as f64).sin() };
/// let time = Time::Uniform { start: 0.0, step: 1.0 };
/// let record = Experiment::new(&Walk, time, vec![Nothing; 200], (0..200).map(slow).collect())?.initial(Level { x: fixed(0.0) });
/// let levels = Levels { q: free(0.5).log(), r: free(0.5).log() };
/// let problem = Fit::new(&Walk, &record).parameters(levels).predictor(Kalman).problem()?;
/// let test = diagnose::process_noise(&problem, &problem.run()?)?;
/// assert!(test.p_value < 1e-6 && test.levels == ["q"]); // it does not stand still
/// # Ok(())
/// # }
/// ```
pub fn process_noise(problem: &Problem<'_>, estimate: &Summary) -> Result<ProcessNoise, Error> {
    let control = problem.control(Instant::now());
    let found = tested(problem, estimate, &control, Stop::default().iterations);
    check_complete(problem, &control, "the test of process noise")?;
    found
}

/// The test, if it takes no more trial steps than the estimate did.
pub(crate) fn cheap_process_noise(problem: &Problem<'_>, estimate: &Summary) -> Option<ProcessNoise> {
    tested(problem, estimate, &Control::NEVER, estimate.iterations).ok()
}

fn tested(problem: &Problem<'_>, estimate: &Summary, control: &Control, trials: u64) -> Result<ProcessNoise, Error> {
    let (objective, best) = problem.at_within(estimate, control)?;
    let of = objective.problem;
    let parameters = of.parameters();
    let values: Vec<f64> = estimate.parameters.iter().map(|parameter| parameter.value).collect();
    let free: Vec<bool> = parameters.iter().map(|parameter| parameter.free).collect();
    let (sweep, levels) = without(&objective, &values, &free)?;
    let declared: Vec<_> = parameters
        .iter()
        .enumerate()
        .map(|(i, parameter)| if levels.contains(&i) { fixed(parameter.start) } else { *parameter })
        .collect();
    let row = &of.unknowns.row;
    let is_level = |free: &Free| matches!(free.role, Role::Parameter(i) if levels.contains(&i));
    let names: Vec<String> = row.iter().filter(|free| is_level(free)).map(|free| free.name.clone()).collect();
    let again = Problem::unchecked(sweep, of.records.clone(), &declared, of.settings.beside(Noise::Predicted))?;
    let key = |free: &Free| (free.role, free.experiment);
    let known: HashMap<_, f64> = row.iter().zip(&best).map(|(free, coordinate)| (key(free), *coordinate)).collect();
    let start = again.unknowns.row.iter().map(|free| known.get(&key(free)).copied());
    let start: Vec<f64> =
        start.zip(again.unknowns.start()).map(|(known, declared)| known.unwrap_or(declared)).collect();
    let fails = |reason: &str| Error::Undisturbed { reason: reason.to_owned() };
    let reduced = again.in_units(control);
    let (place, cost) = match start.is_empty() {
        true => (vec![], reduced.cost_at(&[]).map_err(|error| fails(&error.to_string()))?),
        false => minimize_within(&reduced, start, trials).ok_or_else(|| fails("its search does not converge"))?,
    };
    let full = objective.cost_at(&best).map_err(|error| Error::Optimizer(error.to_string()))?;
    let deviance = |cost: f64, of: &Unknowns, at: &[f64]| {
        // Without what priors add.
        2.0 * cost - of.priors(at).map(|(_, _, error)| error * error).sum::<f64>()
    };
    let ratio = deviance(cost, &again.unknowns, &place) - deviance(full, &of.unknowns, &best);
    if !ratio.is_finite() {
        return Err(fails("its likelihood is no number"));
    }
    if ratio < -ROUNDING {
        return Err(Error::Option(format!(
            "the estimate is no maximum of the likelihood: without process noise, -2 ln of it is lower by {}; fit again with smaller levels at the \
             start, or from several starts",
            number(-ratio, 3)
        )));
    }
    let likelihood_ratio = ratio.max(0.0);
    let count = names.len() as u64;
    Ok(ProcessNoise {
        levels: names,
        likelihood_ratio,
        degrees_of_freedom: count,
        p_value: tail(likelihood_ratio, count),
    })
}

/// The fit's sweep without process noise, and which parameters are its levels.
fn without<'o>(
    objective: &Objective<'o>,
    values: &[f64],
    free: &[bool],
) -> Result<(Arc<dyn Sweep + 'o>, Vec<usize>), Error> {
    let none = |reason: String| Err(Error::NotDisturbed { reason });
    let sweep = objective.sweep;
    if !sweep.predicts_variance() {
        let predictor = sweep.predictor();
        return none(format!(
            "the predictor is {predictor}; take the predictor Kalman, with Model::diffusion and Model::noise"
        ));
    }
    if objective.loss().is_some() || objective.is_weighted() {
        return Err(Error::Option("weighted and robust fits have no likelihood to compare".to_owned()));
    }
    let name = |i: &usize| objective.problem.layout().states.get(*i).map_or("", |state| state.name.as_str());
    let Some(Undisturbed { sweep: made, diffusion }) = sweep.undisturbed(values, free) else {
        return none("the model is not read as a graph, or the predictor does not take its diffusion".to_owned());
    };
    if diffusion.states.is_empty() {
        return none("the model has none (Model::diffusion)".to_owned());
    }
    match diffusion.remaining.first() {
        Some(state) => none(format!(
            "the diffusion of `{}` is not zero where the unknowns are zero on which nothing else depends; declare its level free, as a factor of \
             its own",
            name(state)
        )),
        None if diffusion.levels.is_empty() => none("its levels are given as zero; declare one free".to_owned()),
        None => Ok((made, diffusion.levels)),
    }
}

/// Probability that the mixture of chi squared of so many levels is as large.
fn tail(ratio: f64, levels: u64) -> f64 {
    if ratio <= 0.0 {
        return 1.0;
    }
    // Chi squared without a degree of freedom is zero.
    let part =
        |j: u64| Binomial::new(0.5, levels).map_or(0.0, |weights| weights.pmf(j)) * chi_squared_tail(ratio, j as f64);
    (1..=levels).map(part).sum()
}

/// One sentence: the numbers, and what they say.
impl From<&ProcessNoise> for Section {
    fn from(found: &ProcessNoise) -> Section {
        let levels: Vec<String> = found.levels.iter().map(|name| format!("`{}`", name.replace('`', "'"))).collect();
        let meaning = match found.p_value < super::LEVEL {
            true => "the plant is disturbed",
            false => {
                "the records do not show that the plant is disturbed; a simulation, the default predictor, may say as much"
            }
        };
        let text = format!(
            "Without process noise ({} zero), -2 ln of the likelihood is higher by {} (likelihood ratio, {}): {meaning}.",
            levels.join(", "),
            number(found.likelihood_ratio, 3),
            p_value(found.p_value)
        );
        Section::new("process-noise", "Process noise").says(text)
    }
}

impl From<ProcessNoise> for Section {
    fn from(found: ProcessNoise) -> Section {
        Section::from(&found)
    }
}

#[cfg(test)]
mod tests {
    use super::tail;

    /// Of one level half of chi squared with one degree of freedom, whose 0.9 quantile is 2.7055; of two, a half and a quarter:
    /// 1/2 P(chi2_1 > 4.2306) + 1/4 exp(-4.2306 / 2) = 0.05.
    #[test]
    fn tails_of_the_mixture() {
        assert!((tail(2.705543, 1) - 0.05).abs() < 1e-6);
        assert!((tail(4.2306, 2) - 0.05).abs() < 1e-4, "{}", tail(4.2306, 2));
        assert_eq!((tail(0.0, 1), tail(0.0, 3)), (1.0, 1.0));
        assert!((tail(1e-12, 1) - 0.5).abs() < 1e-5);
        // Of a thousand levels the ratio is about 500.
        assert!(tail(300.0, 1000) > 0.999 && tail(900.0, 1000) < 1e-3);
    }
}
