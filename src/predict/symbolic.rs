//! A predictor and the equations that it predicts, traced as one graph.

use super::plant::identity;
use super::{Moments, Plant, Prediction, StartsFrom};
use crate::equations::{AllMoments, Equations, Jacobian, MomentsOf, Slopes};
use crate::functions::Functions;
use crate::graph::{Following, Graph, Id, Leaf, Node, Symbol, Untraceable, narrow};
use crate::integrate::{Method, Stuck};
use crate::layout::{Kind, Layout};
use crate::record::Holds;
use crate::recurrence::{Recurrence, Started, SymbolicInterval};
use crate::scalar::{Comparison, Scalar};
use core::cell::OnceCell;

/// The recurrence of a predictor: one sample and the interval to the next.
///
/// # Errors
/// An integrator or a predictor that cannot be traced.
pub(crate) fn recurrence(
    equations: &Equations,
    method: &dyn Method,
    predictor: &dyn Prediction,
    holds: &Holds,
) -> Result<Recurrence, Untraceable> {
    let linear = method.is_exact().then(|| equations.linear()).flatten();
    let following = linear.map_or(vec![], |linear| linear.following());
    let made = carrying(equations, method, predictor, holds, &[])?;
    let started = started(equations, predictor);
    Ok(made.started(started).with_following(following))
}

/// The recurrence of a filter of linear equations whose covariance has settled: the state alone is carried, and the entries of the covariance follow from the
/// parameters, as do the variances of the outputs. `None` where covariances do not settle whatever the parameters.
pub(crate) fn settled(
    equations: &Equations,
    method: &dyn Method,
    predictor: &dyn Prediction,
    holds: &Holds,
) -> Option<(Recurrence, Vec<Following>)> {
    let linear = method.is_exact().then(|| equations.linear()).flatten().filter(|_| predictor.is_filter())?;
    let covariance = linear.settling()?;
    let made = carrying(equations, method, predictor, holds, &covariance).ok()?;
    let layout = equations.layout();
    // The state that it begins with depends on all states and parameters.
    let states = (0..layout.states.len()).map(|i| Leaf::State(narrow(i)));
    let state = states.chain((0..layout.parameters.len()).map(|j| Leaf::Parameter(narrow(j)))).collect();
    let started = Started { states: layout.states.len(), state, rest: vec![] };
    let following = [linear.following(), covariance.clone()].concat();
    Some((made.started(started).with_following(following), covariance))
}

/// A recurrence in which the last entries of what a predictor carries are not carried, but follow from the parameters.
fn carrying(
    equations: &Equations,
    method: &dyn Method,
    predictor: &dyn Prediction,
    holds: &Holds,
    settled: &[Following],
) -> Result<Recurrence, Untraceable> {
    let layout = equations.layout();
    let (carried, outputs) = (predictor.carry(layout) - settled.len(), layout.outputs.len());
    let slopes = predictor.needs_slopes().then(|| Slopes::of(equations));
    let moments = OnceCell::new();
    let numbers = numbers(equations, predictor).len();
    let mut graph = Graph::default();
    let roots = graph.trace(|| {
        let plant = SymbolicPlant {
            interval: SymbolicInterval::new(equations, method, holds),
            slopes: slopes.as_ref(),
            moments: &moments,
            p: (0..layout.parameters.len() + numbers).map(|j| Symbol::leaf(Leaf::Parameter(narrow(j)))).collect(),
        };
        let steps = predictor.symbols();
        let states = (0..carried).map(|i| Leaf::State(narrow(i)));
        let known = settled.iter().map(|following| Leaf::Parameter(following.number));
        let mut carry: Vec<Symbol> = states.chain(known).map(Symbol::leaf).collect();
        let (mut means, mut variances) = (vec![], vec![]);
        for j in 0..outputs {
            let (mean, variance) = steps.predict(&plant, &carry, j);
            let y = Symbol::leaf(Leaf::Measured(narrow(j)));
            // A missing measurement is NaN, and equals nothing. A covariance settles where none is missing.
            let if_measured = |then: Symbol, or: Symbol| match settled {
                [] => Symbol::select(Comparison::Equal, y, y, then, or),
                _ => then,
            };
            let error = if_measured(y - mean, Symbol::from(0.0));
            let mut corrected = carry.clone();
            steps.correct(&plant, &mut corrected, j, error);
            carry.iter_mut().zip(corrected).for_each(|(carry, corrected)| *carry = if_measured(corrected, *carry));
            means.push(mean);
            variances.push(variance);
        }
        if steps.advance(&plant, &mut carry).is_err() {
            Symbol::fail("its predictor cannot go on to the next sample");
        }
        carry.truncate(carried);
        // Of a settled filter they are known beside the program.
        let predicted = predictor.predicts_variance() && settled.is_empty();
        [carry, means, if predicted { variances } else { vec![] }].concat()
    })?;
    let (next, rest) = roots.split_at(carried.min(roots.len()));
    let (mean, variance) = rest.split_at(outputs.min(rest.len()));
    let made = Recurrence::from_roots(&graph, next, mean, variance);
    made.map_err(|wrong| Untraceable { reason: wrong.to_string() })
}

/// The numbers that follow the parameters in a program; none where those of dead times do, then they are constants.
pub(crate) fn numbers(equations: &Equations, predictor: &dyn Prediction) -> Vec<f64> {
    if equations.late().contains(&true) { vec![] } else { predictor.numbers() }
}

/// The states and parameters on which the start depends.
fn started(equations: &Equations, predictor: &dyn Prediction) -> Started {
    let (layout, roots) = (equations.layout(), equations.roots());
    let states = (0..layout.states.len()).map(|i| Leaf::State(narrow(i)));
    let all: Vec<Leaf> = states.chain((0..layout.parameters.len()).map(|j| Leaf::Parameter(narrow(j)))).collect();
    let of = |graph: &Graph, roots: &[Id]| -> Vec<Leaf> {
        let nodes = graph.nodes().iter().zip(graph.reached(roots));
        let leaf = |(node, reached): (&Node, bool)| match node {
            Node::Leaf(leaf) if reached && all.contains(leaf) => Some(*leaf),
            _ => None,
        };
        nodes.filter_map(leaf).collect()
    };
    let rest = match predictor.starts_from() {
        StartsFrom::InitialNoise => of(equations.graph(), &roots.initial_noise),
        StartsFrom::Slopes if predictor.needs_slopes() => {
            let Slopes { state, jump, .. } = Slopes::of(equations);
            // Inputs may be late.
            let levels = of(equations.graph(), &[&*roots.diffusion, &roots.delay].concat());
            [levels, of(&state.graph, &state.entries), of(&jump.graph, &jump.entries)].concat()
        }
        _ => all.clone(),
    };
    let state = of(equations.graph(), &roots.initial);
    // The other entries depend on the state, and so on the parameters that it depends on.
    Started { states: layout.states.len(), rest: [rest, state.clone()].concat(), state }
}

/// A plant in symbols.
struct SymbolicPlant<'a> {
    interval: SymbolicInterval<'a>,
    /// Of a predictor that asks for them.
    slopes: Option<&'a Slopes>,
    /// Made when a predictor asks for them.
    moments: &'a OnceCell<AllMoments>,
    p: Vec<Symbol>,
}

impl SymbolicPlant<'_> {
    fn jacobian(&self, of: impl Fn(&Slopes) -> &Jacobian, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        let Some(Jacobian { graph, entries }) = self.slopes.map(of) else {
            return Symbol::fail("its predictor asks for slopes and does not say so (`Predictor::needs_slopes`)");
        };
        to.copy_from_slice(&self.interval.at(graph, entries, position, x));
    }

    /// Levels of noise; those that are not written are `unsaid`.
    fn levels(&self, roots: &[Id], unsaid: f64, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        to.fill(Symbol::from(unsaid));
        let found = self.interval.at(self.interval.equations().graph(), roots, position, x);
        to.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }

    fn equations_moments(&self) -> &AllMoments {
        self.moments.get_or_init(|| self.interval.equations().moments())
    }

    fn moments(&self, of: &MomentsOf, position: f64, carry: &[Symbol]) -> Moments<Symbol> {
        of.moments(self.interval.at(&of.graph, &of.roots, position, carry))
    }
}

impl Plant<Symbol> for SymbolicPlant<'_> {
    fn layout(&self) -> &Layout {
        self.interval.equations().layout()
    }

    fn parameters(&self) -> &[Symbol] {
        &self.p
    }

    fn output(&self, x: &[Symbol], y: &mut [Symbol]) {
        y.copy_from_slice(&self.interval.output(x));
    }

    fn next(&self, x: &mut [Symbol]) -> Result<(), Stuck> {
        let (state, _) = x.split_at_mut(self.layout().states.len());
        self.interval.next(state);
        Ok(())
    }

    fn flow(&self, x: &mut [Symbol]) -> Result<(), Stuck> {
        let (state, _) = x.split_at_mut(self.layout().states.len());
        self.interval.flow(state);
        Ok(())
    }

    fn derivative(&self, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        self.interval.rate(position, x, to);
    }

    fn state_slopes(&self, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        self.jacobian(|slopes| &slopes.state, position, x, to);
    }

    fn output_slopes(&self, x: &[Symbol], to: &mut [Symbol]) {
        self.jacobian(|slopes| &slopes.output, 0.0, x, to);
    }

    fn state_moments(&self, position: f64, carry: &[Symbol]) -> Moments<Symbol> {
        self.moments(&self.equations_moments().state, position, carry)
    }

    fn output_moments(&self, carry: &[Symbol]) -> Moments<Symbol> {
        self.moments(&self.equations_moments().output, 0.0, carry)
    }

    fn jumps(&self) -> bool {
        !self.interval.equations().roots().jump.is_empty()
    }

    fn jump(&self, x: &mut [Symbol]) {
        let (state, _) = x.split_at_mut(self.layout().states.len());
        self.interval.jump(state);
    }

    fn jump_slopes(&self, x: &[Symbol], to: &mut [Symbol]) {
        self.jacobian(|slopes| &slopes.jump, 0.0, x, to);
        let unchanged = identity(x.len());
        to.iter_mut().zip(unchanged).for_each(|(to, or)| *to = self.interval.if_time_passes(*to, or));
    }

    fn jump_moments(&self, carry: &[Symbol]) -> Moments<Symbol> {
        let Moments { mean, slopes, spread } = self.moments(&self.equations_moments().jump, 0.0, carry);
        let either = |found: Vec<Symbol>, or: &[Symbol]| {
            found.into_iter().zip(or).map(|(found, or)| self.interval.if_time_passes(found, *or)).collect()
        };
        let (slopes, none) = (either(slopes, &identity(mean.len())), vec![Symbol::default(); spread.len()]);
        Moments { slopes, spread: either(spread, &none), mean: either(mean, carry) }
    }

    fn length(&self) -> Symbol {
        Symbol::leaf(Leaf::Step)
    }

    fn integrate(&self, z: &mut [Symbol], rate: &dyn Fn(f64, &[Symbol], &mut [Symbol])) -> Result<(), Stuck> {
        self.interval.cross(Kind::Continuous, z, rate);
        Ok(())
    }

    fn spread(&self, covariance: &mut [Symbol]) -> bool {
        self.interval.crossing().map(|crossing| crossing.spread(covariance)).is_some()
    }

    fn diffusion(&self, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        self.levels(&self.interval.equations().roots().diffusion, 0.0, position, x, to);
    }

    fn noise(&self, x: &[Symbol], to: &mut [Symbol]) {
        self.levels(&self.interval.equations().roots().noise, f64::NAN, 0.0, x, to);
    }

    fn initial_noise(&self, to: &mut [Symbol]) {
        self.interval.equations().initial_noise(&self.p, to);
    }
}
