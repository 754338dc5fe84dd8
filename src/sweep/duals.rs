//! [`DualSweep`]: models run in numbers with slopes, one piece at a time.

use super::affine::not_affine;
use super::failure::FailureSearch;
use super::filtered::Filter;
use super::{
    Evaluated, Lacking, ModelCode, NoStart, Piece, Prepared, Reached, RunError, Seed, States, Sweep, Undisturbed,
    Visit, unmoved,
};
use crate::equations::{Equations, WithTerms};
use crate::error::{Error, Failure};
use crate::functions::delays;
use crate::graph::{Choices, choices};
use crate::integrate::{Method, stepped};
use crate::layout::{Kind, Layout};
use crate::predict::{FreeRun, Guess, Place, Prediction};
use crate::record::{Channel, Initial, Record};
use std::sync::Arc;

/// What is known of equations that run in dual numbers.
#[derive(Clone, Default)]
pub(crate) struct Uncompiled {
    /// Why they were not compiled.
    pub reason: String,
    /// What their choices depend on; `None` where they are not read as a graph.
    pub choices: Option<Choices>,
    /// The parameters that stand in their noise alone.
    pub levels: Vec<usize>,
    /// Those of them on whose sign no variance depends.
    pub scales: Vec<usize>,
}

impl Uncompiled {
    /// Equations that are not read as a graph.
    pub fn unread(reason: String) -> Self {
        Uncompiled { reason, ..Uncompiled::default() }
    }

    pub fn of(equations: &Equations, reason: String) -> Self {
        let (choices, levels, scales) = (choices(equations.graph()), equations.levels(), equations.scales());
        Uncompiled { reason, choices: Some(choices), levels, scales }
    }
}

/// A model run in dual numbers.
pub(crate) struct DualSweep<'a> {
    pub layout: Arc<Layout>,
    pub code: Arc<dyn ModelCode + 'a>,
    pub method: Arc<dyn Method>,
    pub predictor: Arc<dyn Prediction>,
    pub uncompiled: Uncompiled,
}

impl DualSweep<'_> {
    fn filter(&self, p: &[f64]) -> Filter<'_> {
        Filter {
            layout: &self.layout,
            values: self.code.values(),
            duals: self.code.duals(),
            method: &*self.method,
            late: self.code.late(p),
            predictor: &*self.predictor,
        }
    }

    /// The inputs that the model has at a sample.
    fn input(&self, record: &Record, sample: usize, p: &[f64]) -> Vec<f64> {
        match delays(self.code.values(), &self.code.late(p), p) {
            none if none.is_empty() => record.input(sample),
            delays => record.late_inputs(sample, &delays),
        }
    }

    /// The model at a sample.
    fn place<'p>(&'p self, t: f64, u: &'p [f64], p: &'p [f64]) -> Place<'p> {
        Place { layout: &self.layout, functions: self.code.duals(), t, u, p }
    }
}

impl Sweep for DualSweep<'_> {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn carry(&self) -> usize {
        self.predictor.carry(&self.layout)
    }

    fn predicts_variance(&self) -> bool {
        self.predictor.predicts_variance()
    }

    fn restarts(&self) -> Option<usize> {
        self.predictor.restarts().map(|horizon| horizon.steps)
    }

    fn choosing(&self) -> Option<&[usize]> {
        self.uncompiled.choices.as_ref().map(|choices| &*choices.parameters)
    }

    fn levels(&self) -> &[usize] {
        &self.uncompiled.levels
    }

    fn scales(&self) -> &[usize] {
        &self.uncompiled.scales
    }

    fn linearizes_choices(&self) -> bool {
        self.predictor.needs_slopes() && self.uncompiled.choices.as_ref().is_some_and(|choices| choices.states)
    }

    fn prepare(&self, record: &Record, parameters: &[f64]) -> Result<Prepared, Error> {
        // Equations that are read as a graph have been examined as such.
        if self.predictor.needs_slopes()
            && self.uncompiled.choices.is_none()
            && let Some(number) = not_affine(&self.layout, self.code.values(), record, parameters)
        {
            return Err(Error::NotAffine { what: self.layout.equation(number), predictor: self.predictor.describe() });
        }
        let restarts = match self.predictor.restarts() {
            Some(horizon) => horizon.states(&self.layout, self.code.duals(), record, parameters)?,
            None => vec![],
        };
        Ok(Prepared { restarts, ..Prepared::default() })
    }

    fn start(&self, record: &Record, state: &[f64], parameters: &[f64]) -> Result<Reached, NoStart> {
        let follows = self.follows(record, parameters);
        match self.predictor.is_simulation() && !follows.contains(&true) {
            true => Ok(unmoved(state, parameters)),
            false => self.filter(parameters).start(record, state, &follows, parameters),
        }
    }

    fn follows(&self, record: &Record, parameters: &[f64]) -> Vec<bool> {
        match record.initial_state() {
            Initial::Steady => vec![true; self.layout.states.len()],
            Initial::Estimated => self.code.begins(parameters),
            Initial::Free | Initial::FirstSample | Initial::Given(_) => vec![false; self.layout.states.len()],
        }
    }

    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let one = |piece: &Piece<'_>| {
            let restart = self.predictor.restarts().map(|horizon| horizon.steps);
            let filter = self.filter(piece.parameters);
            let is_simulated = restart.is_some() || self.predictor.is_simulation();
            match is_simulated && !filter.late.contains(&true) && !self.method.is_exact() {
                true => self.code.run(&filter, piece, seeds, restart, visit),
                false => filter.run(piece, seeds, restart, visit),
            }
        };
        pieces.iter().map(one).collect()
    }

    fn states(
        &self,
        record: &Record,
        carry: &[f64],
        parameters: &[f64],
        smoothed: bool,
    ) -> Option<Result<States, usize>> {
        self.predictor.is_filter().then(|| self.filter(parameters).states(record, carry, parameters, smoothed))
    }

    fn measured_state(&self, record: &Record, sample: usize, p: &[f64]) -> Result<Vec<f64>, String> {
        let u = self.input(record, sample, p);
        let place = self.place(record.time(sample), &u, p);
        let x = place.state(&record.output(sample))?;
        match place.depends_on_parameter(&x) {
            Some(name) => Err(format!("the outputs depend on the parameter `{name}`, too")),
            None => Ok(x),
        }
    }

    fn guessed_state(&self, record: &Record, p: &[f64]) -> Result<Guess, String> {
        let first = |channel: &Channel| channel.values.iter().copied().find(|y| y.is_finite()).unwrap_or(f64::NAN);
        let y: Vec<f64> = record.outputs().iter().map(first).collect();
        let half = |range: (f64, f64)| 0.5 * (range.1 - range.0);
        let moves: Vec<f64> =
            record.inspect_some().outputs.iter().map(|output| output.range.map_or(0.0, half)).collect();
        self.place(record.time(0), &self.input(record, 0, p), p).guess(&y, &moves)
    }

    fn state_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        let (t, u) = (record.time(sample), self.input(record, sample, p));
        (self.layout.kind == Kind::Continuous).then(|| self.place(t, &u, p).state_slopes(state))
    }

    fn jump_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        let (t, u) = (record.time(sample), self.input(record, sample, p));
        self.place(t, &u, p).jump_slopes(state)
    }

    fn late(&self, parameters: &[f64]) -> Vec<Option<f64>> {
        delays(self.code.values(), &self.code.late(parameters), parameters)
    }

    fn locate(
        &self,
        record: &Record,
        state: &[f64],
        parameters: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Option<Result<Failure, Failure>> {
        let (layout, values, duals) = (&*self.layout, self.code.values(), self.code.duals());
        let late = self.code.late(parameters);
        let search = FailureSearch { layout, values, duals, method: &*self.method, late, record };
        Some(search.locate(state, parameters, sample, sigma, stops))
    }

    fn is_adaptive(&self) -> bool {
        !self.method.is_fixed()
    }

    fn refined<'s>(&'s self, _samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let kind = self.layout.kind;
        let (code, method) = (self.code.refined(kind)?, self.method.refined(kind)?);
        let (layout, predictor, uncompiled) = (self.layout.clone(), self.predictor.clone(), self.uncompiled.clone());
        Some(Arc::new(DualSweep { layout, code, method, predictor, uncompiled }))
    }

    fn simulating<'s>(&'s self, _samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        if self.predictor.is_simulation() {
            return None;
        }
        let (layout, code, method) = (self.layout.clone(), self.code.clone(), self.method.clone());
        Some(Arc::new(DualSweep {
            layout,
            code,
            method,
            predictor: Arc::new(FreeRun),
            uncompiled: self.uncompiled.clone(),
        }))
    }

    fn with_terms<'s>(&'s self) -> Option<Lacking<'s>> {
        let equations = self.code.equations()?;
        let WithTerms { equations, terms, left_out } = equations.with_terms(self.predictor.is_simulation());
        let (layout, code) = (Arc::new(equations.layout().clone()), Arc::new(Evaluated::new(Arc::new(equations))));
        let method = stepped(&self.method);
        let predictor = self.predictor.clone();
        let sweep = DualSweep { layout, code, method, predictor, uncompiled: self.uncompiled.clone() };
        Some(Lacking { sweep: Arc::new(sweep), terms, left_out })
    }

    fn undisturbed<'s>(&'s self, parameters: &[f64], free: &[bool]) -> Option<Undisturbed<'s>> {
        let equations = self.code.equations().filter(|_| self.predictor.takes_diffusion())?;
        let code = Arc::new(Evaluated::new(Arc::new(equations.undisturbed())));
        let (layout, method, predictor) = (self.layout.clone(), self.method.clone(), self.predictor.clone());
        let sweep = DualSweep { layout, code, method, predictor, uncompiled: self.uncompiled.clone() };
        Some(Undisturbed { sweep: Arc::new(sweep), diffusion: equations.process_noise(parameters, free) })
    }

    fn second_order<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> {
        let predictor = self.predictor.second_order().filter(|_| !self.code.is_affine())?;
        let (layout, code, method) = (self.layout.clone(), self.code.clone(), self.method.clone());
        Some(Arc::new(DualSweep { layout, code, method, predictor, uncompiled: self.uncompiled.clone() }))
    }

    fn integrator(&self) -> String {
        self.method.describe(self.layout.kind)
    }

    fn predictor(&self) -> String {
        let predictor = self.predictor.describe();
        match self.predictor.second_order().is_some() && !self.code.is_affine() {
            true => format!("{predictor}, extended: by the model's slopes at the state (first order)"),
            false => predictor,
        }
    }

    fn engine(&self) -> String {
        format!("dual numbers ({})", self.uncompiled.reason)
    }

    fn identity(&self) -> String {
        self.code.identity()
    }
}
