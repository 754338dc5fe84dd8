//! Delta method: how well a function of the parameters is known, by its exact slopes.

use crate::dual::Dual;
use crate::estimate::{Derived, Estimate, Knowledge, Summary, Unknown, student};
use crate::graph::{Graph, Id, Leaf};
use crate::model::Model;
use crate::parameter::Transform;
use crate::problem::Role;
use crate::signals::{Of, Signals};

/// Slopes taken at once.
const LANES: usize = 8;
/// Up to so many parameters without slope are moved in pairs, too; of more each alone, since the pairs grow with the square.
const PAIRED: usize = 32;

/// A function of the parameters with its interval: `derived(&estimate, "kt", |p| p.ke * 1.5)`. Parameters that each
/// experiment has for itself are those of the first; fixed ones count as exact. There is no interval where it depends on a parameter that has none, nor where it
/// changes within the intervals of parameters in which it has no slope: by an `if`, a limit, a rounding.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let estimate = Fit::new(&model, &record).parameters(start).run()?;
/// // The electrical time constant, with the correlation of both parameters.
/// let tau = greybox::diagnose::derived(&estimate, "tau", |p| p.ls / p.rs);
/// assert!((tau.value - 6.347e-3).abs() < 1e-5 && tau.standard_error.unwrap() < 1e-5);
/// # Ok(())
/// # }
/// ```
pub fn derived<M: Model>(
    estimate: &Estimate<M>,
    name: &str,
    f: impl Fn(&Of<M::Parameters, Dual<LANES>>) -> Dual<LANES>,
) -> Derived {
    of(estimate, 0, name, &|p| f(&M::Parameters::from_fn(|j| p[j])))
}

/// The derived quantity at the root of a graph of parameters: `tau` of [`Leaf::Parameter`] one over zero. Other leaves are not numbers. Parameters that each
/// experiment has for itself are those of `experiment`, by its place.
///
/// ```
/// # use greybox::{Experiment, Fit, diagnose, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::graph::{Graph, Leaf};
/// let estimate = Fit::new(&model, &record).parameters(start).run()?;
/// let mut graph = Graph::default();
/// let [rs, ls] = [0, 1].map(|j| graph.leaf(Leaf::Parameter(j)));
/// let tau = graph.div(ls, rs);
/// let tau = diagnose::derived_by(&estimate, 0, "tau", &graph, tau);
/// assert_eq!(tau, diagnose::derived(&estimate, "tau", |p| p.ls / p.rs));
/// # Ok(())
/// # }
/// ```
pub fn derived_by(estimate: &Summary, experiment: usize, name: &str, graph: &Graph, root: Id) -> Derived {
    let unknown = Dual::from(f64::NAN);
    of(estimate, experiment, name, &|p| {
        let leaf = |leaf| match leaf {
            Leaf::Parameter(j) => p.get(j as usize).copied().unwrap_or(unknown),
            _ => unknown,
        };
        graph.evaluate(&[root], leaf).first().copied().unwrap_or(unknown)
    })
}

fn of(estimate: &Summary, experiment: usize, name: &str, f: &dyn Fn(&[Dual<LANES>]) -> Dual<LANES>) -> Derived {
    let own = estimate.of_experiment(experiment);
    // Without an experiment of this place, parameters that each experiment has for itself have no value.
    let missing = if own.is_none() { estimate.own_parameters() } else { vec![] };
    let of = own.as_ref().unwrap_or(estimate).parameters.iter().enumerate();
    let values: Vec<f64> = of.map(|(j, of)| if missing.contains(&j) { f64::NAN } else { of.value }).collect();
    let unknown = |j: usize| {
        let own = |u: &Unknown| u.role == Role::Parameter(j) && u.experiment.is_none_or(|e| e == experiment);
        estimate.unknowns.iter().position(own)
    };
    let parameters = values.len();
    let mut gradient = vec![0.0; estimate.unknowns.len()];
    let (mut value, mut known) = (f64::NAN, true);
    for first in (0..parameters.max(1)).step_by(LANES) {
        let seeded: Vec<Dual<LANES>> =
            values.iter().enumerate().map(|(j, &value)| Dual::variable(value, j.wrapping_sub(first))).collect();
        let result = f(&seeded);
        value = result.value;
        for lane in 0..LANES.min(parameters - first.min(parameters)) {
            let slope = result.slopes[lane];
            if let Some(i) = unknown(first + lane).filter(|_| slope != 0.0) {
                gradient[i] = slope;
                known &= estimate.unknowns[i].knowledge.standard_error().is_some();
            }
        }
    }
    let moved: Vec<usize> = (0..gradient.len()).filter(|&i| gradient[i] != 0.0).collect();
    let c = estimate.covariance.dense(&moved);
    let pairs = (0..moved.len()).flat_map(|a| (0..moved.len()).map(move |b| (a, b)));
    let variance: f64 = pairs.map(|(a, b)| gradient[moved[a]] * c[(a, b)] * gradient[moved[b]]).sum();
    let flat = |j: &usize| unknown(*j).is_some_and(|i| gradient[i] == 0.0);
    let flat: Vec<(usize, [f64; 2])> =
        (0..parameters).filter(flat).filter_map(|j| Some((j, ends(&estimate.unknowns[unknown(j)?])))).collect();
    let known = known && !steps(&values, value, &flat, f);
    let standard_error = Some(variance.max(0.0).sqrt()).filter(|error| known && error.is_finite() && value.is_finite());
    let degrees = moved.iter().map(|&i| estimate.unknowns[i].degrees_of_freedom);
    let degrees = degrees.fold(estimate.degrees_of_freedom(), f64::min);
    let interval = standard_error
        .map(|standard_error| student::Spread { standard_error, degrees }.interval(value, Transform::Identity, 0.95));
    Derived { name: name.to_owned(), value, standard_error, interval }
}

/// Whether the quantity is another one where one or two parameters without slope are at the ends of what they may be.
fn steps(values: &[f64], here: f64, flat: &[(usize, [f64; 2])], f: &dyn Fn(&[Dual<LANES>]) -> Dual<LANES>) -> bool {
    let changes = |moved: &[(usize, f64)]| {
        let mut there: Vec<Dual<LANES>> = values.iter().map(|value| Dual::constant(*value)).collect();
        moved.iter().for_each(|(j, end)| there[*j] = Dual::constant(*end));
        f(&there).value != here
    };
    let of = |(j, ends): &(usize, [f64; 2])| ends.map(|end| (*j, end));
    let alone = flat.iter().flat_map(of).any(|one| changes(&[one]));
    let pairs = || flat.iter().enumerate().flat_map(|(n, one)| flat[..n].iter().map(move |other| (one, other)));
    let together =
        |(one, other)| of(one).into_iter().any(|one| of(other).into_iter().any(|other| changes(&[one, other])));
    here.is_finite() && (alone || flat.len() <= PAIRED && pairs().any(together))
}

/// The ends of what an unknown may be: its 95 % interval, or its bounds where it has none.
fn ends(one: &Unknown) -> [f64; 2] {
    match one.knowledge {
        Knowledge::Known { lower, upper, .. } => [lower, upper],
        Knowledge::Held { bound, end } => [bound, end.unwrap_or(bound)],
        Knowledge::Fixed => [one.value; 2],
        Knowledge::Unidentified => [one.bounds.0, one.bounds.1],
    }
}
