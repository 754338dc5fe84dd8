//! [`Trajectory`]: fills windows with prediction errors and slopes; the hot loop of every fit.

use super::{Predictor, Walk};

use crate::dispatch::{Kernel, run};
use crate::dual::Dual;
use crate::integrate::{Integrator, Stuck};
use crate::interval::Hold;
use crate::lanes::Number;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};

/// Samples per window: short enough for two outputs and eight slopes to stay in the nearest cache.
pub(crate) const WINDOW: usize = 128;

/// Slopes below this are gone for good; squared they are denormal.
const NEGLIGIBLE: f64 = 1e-150;

/// Which quantity a column of slopes belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// Parameter number.
    Parameter(usize),
    /// Initial state number.
    State(usize),
}

/// One column of slopes: the quantity, and how fast it moves with the optimizer's coordinate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seed {
    pub target: Target,
    pub slope: f64,
}

/// Prediction errors and slopes of a run of samples, column by column: the slopes with respect to each seed, then the
/// error. Row `j * WINDOW + k` is output `j` at the window's sample `k`; rows without measurement or beyond the end are zero.
pub(crate) struct Window {
    /// First sample.
    pub begin: usize,
    /// Number of samples.
    pub samples: usize,
    columns: usize,
    rows: usize,
    data: Vec<f64>,
    /// Which rows hold a measurement.
    pub measured: Vec<bool>,
}

impl Window {
    pub fn new(seeds: usize, outputs: usize) -> Self {
        let (columns, rows) = (seeds + 1, outputs * WINDOW);
        let (data, measured) = (vec![0.0; columns * rows], vec![false; rows]);
        Window { begin: 0, samples: 0, columns, rows, data, measured }
    }

    /// The columns of slopes, then the errors, each of one row per output and sample.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.data.chunks_exact_mut(self.rows)
    }

    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// Sets the rows without a measurement to zero, after a filter has run over them.
    pub fn clear_unmeasured(&mut self) {
        for column in self.data.chunks_exact_mut(self.rows) {
            for (value, _) in column.iter_mut().zip(&self.measured).filter(|(_, here)| !**here) {
                *value = 0.0;
            }
        }
    }

    pub fn errors(&self) -> &[f64] {
        &self.data[(self.columns - 1) * self.rows..]
    }
}

/// The states of one experiment with up to `N` slopes, on their way through the record.
struct Lanes<M: Model, I: Integrator, const N: usize, T: Scalar> {
    x: Of<M::State, Dual<N, T>>,
    p: Of<M::Parameters, Dual<N, T>>,
    memory: I::Memory,
    first: usize,
    used: usize,
}

/// A model on its way through a record, with all the slopes asked for: in as many passes of `N` as it takes.
pub(crate) struct Trajectory<'a, M: Model, I: Integrator, P: Predictor<M>, const N: usize, T: Scalar> {
    walk: Walk<'a, M, I>,
    predictor: &'a P,
    prepared: &'a P::Prepared,
    passes: Vec<Lanes<M, I, N, T>>,
    next: usize,
}

impl<'a, M: Model, I: Integrator, P: Predictor<M>, const N: usize, T: Scalar + Number> Trajectory<'a, M, I, P, N, T> {
    pub fn new(
        walk: Walk<'a, M, I>,
        predictor: &'a P,
        prepared: &'a P::Prepared,
        x: Of<M::State, f64>,
        p: Of<M::Parameters, f64>,
        seeds: &[Seed],
    ) -> Self {
        let passes = (0..seeds.len().div_ceil(N.max(1)).max(1))
            .map(|pass| {
                let first = pass * N;
                let mine = &seeds[first..seeds.len().min(first + N)];
                let seeded = |target: Target, value: f64| {
                    let mut dual = Dual::<N, T>::from(value);
                    for (slope, seed) in dual.slopes.iter_mut().zip(mine) {
                        if seed.target == target {
                            *slope = T::from(seed.slope);
                        }
                    }
                    dual
                };
                let (x, p) = (M::State::into_array(x), M::Parameters::into_array(p));
                Lanes {
                    x: M::State::from_fn(|i| seeded(Target::State(i), x.as_ref()[i])),
                    p: M::Parameters::from_fn(|i| seeded(Target::Parameter(i), p.as_ref()[i])),
                    memory: I::Memory::default(),
                    first,
                    used: mine.len(),
                }
            })
            .collect();
        Trajectory { walk, predictor, prepared, passes, next: 0 }
    }

    /// Goes on from where another trajectory stands.
    pub fn restart_at(&mut self, other: &Self) {
        self.next = other.next;
        for (mine, theirs) in self.passes.iter_mut().zip(&other.passes) {
            (mine.x, mine.memory) = (theirs.x, theirs.memory);
        }
    }

    /// The next window of the record; `false` at its end.
    ///
    /// # Errors
    /// The sample that the integrator could not reach.
    pub fn fill(&mut self, window: &mut Window) -> Result<bool, usize> {
        let begin = self.next;
        let samples = WINDOW.min(self.walk.experiment.len() - begin);
        (window.begin, window.samples) = (begin, samples);
        if samples == 0 {
            return Ok(false);
        }
        if samples < WINDOW {
            window.data.fill(0.0);
            window.measured.fill(false);
        }
        for lanes in &mut self.passes {
            run(Fill { lanes, walk: self.walk, predictor: self.predictor, prepared: self.prepared, window })?;
        }
        self.next += samples;
        Ok(true)
    }
}

/// One window of one pass. The only caller of the model in a fit.
struct Fill<'f, 'a, M: Model, I: Integrator, P: Predictor<M>, const N: usize, T: Scalar> {
    lanes: &'f mut Lanes<M, I, N, T>,
    walk: Walk<'a, M, I>,
    predictor: &'a P,
    prepared: &'a P::Prepared,
    window: &'f mut Window,
}

impl<M: Model, I: Integrator, P: Predictor<M>, const N: usize, T: Scalar + Number> Kernel
    for Fill<'_, '_, M, I, P, N, T>
{
    type Number = T;
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run(self) -> Result<(), usize> {
        let Fill { lanes, mut walk, predictor, prepared, window } = self;
        if T::FUSED {
            // Known to the compiler, which then computes once per interval what depends on the input alone.
            walk.hold = Hold::Zero;
        }
        let Window { begin, samples, columns, ref mut data, ref mut measured, .. } = *window;
        let (p, mut x) = (lanes.p, lanes.x);
        let rows = M::Output::LEN * WINDOW;
        let (slopes, errors) = data.split_at_mut((columns - 1) * rows);
        let slopes = &mut slopes[lanes.first * rows..][..lanes.used.min(N) * rows];
        let (errors, measured) = (&mut errors[..rows], &mut measured[..rows]);
        for k in 0..samples {
            let sample = begin + k;
            let state = predictor.state(&walk, prepared, sample, x, &p, &mut lanes.memory).map_err(|Stuck| sample)?;
            let Some(state) = state else {
                for row in (0..M::Output::LEN).map(|j| j * WINDOW + k) {
                    measured[row] = false;
                    errors[row] = 0.0;
                    slopes.chunks_exact_mut(rows).for_each(|column| column[row] = 0.0);
                }
                continue;
            };
            if P::CARRIES {
                x = state;
            }
            let u = M::Input::map(walk.experiment.inputs()[sample], Dual::from);
            let expected =
                M::Output::into_array(walk.model.output(walk.experiment.time(sample).into(), &state, &u, &p));
            let found = M::Output::into_array(walk.experiment.outputs()[sample]);
            for j in 0..M::Output::LEN {
                let (expected, found) = (expected.as_ref()[j], found.as_ref()[j]);
                let row = j * WINDOW + k;
                let here = !found.is_nan();
                measured[row] = here;
                errors[row] = if here { found - expected.value() } else { 0.0 };
                for (column, slope) in slopes.chunks_exact_mut(rows).zip(expected.slopes) {
                    column[row] = if here { slope.value() } else { 0.0 };
                }
            }
        }
        lanes.x = M::State::map(x, |mut dual| {
            for slope in &mut dual.slopes {
                if slope.abs() < NEGLIGIBLE {
                    *slope = T::from(0.0);
                }
            }
            dual
        });
        Ok(())
    }
}
