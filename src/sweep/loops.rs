//! [`Loops`]: the loop over the samples, compiled for a model and an integrator, in numbers with slopes.
//!
//! Models that cannot be traced run this way. Slopes with respect to the initial state decay like `exp(-t / T)`; after
//! some ten thousand samples they are denormal numbers, on which processors are up to 60 times slower; so slopes below
//! 1e-150 are set to zero between windows.

mod number;
mod rows;

use super::{Piece, Reached, RunError, Seed, Visit, Window};
use crate::dual::Dual;
use crate::fused::{Avx512, Fused};
use crate::integrate::{Integrator, ModelSystem, Stuck};
use crate::interval::{Hold, Interval};
use crate::lanes;
use crate::layout::Kind;
use crate::model::Model;
use crate::signals::{Of, Signals};
use number::Number;
use rows::Rows;
use std::sync::Arc;

/// Samples per window: two outputs with eight slopes fit into the first-level cache.
const WINDOW: usize = 128;
/// Samples per window where a single one may take many steps: after each window a fit looks at its time limit.
const ADAPTIVE_WINDOW: usize = 8;

/// The type of a slope.
trait Slope: lanes::Number {
    /// The instructions that loops over such numbers are compiled for.
    type Unit: Unit;
}

/// The instructions that a loop is compiled for.
trait Unit: Copy {
    fn run<M: Model, I: Integrator, D: Number>(self, fill: Fill<'_, '_, M, I, D>) -> Result<(), RunError>;
}

/// The instructions that every machine has.
#[derive(Clone, Copy)]
struct Portable;

impl Unit for Portable {
    fn run<M: Model, I: Integrator, D: Number>(self, fill: Fill<'_, '_, M, I, D>) -> Result<(), RunError> {
        M::fill(fill)
    }
}

impl Unit for Avx512 {
    fn run<M: Model, I: Integrator, D: Number>(self, fill: Fill<'_, '_, M, I, D>) -> Result<(), RunError> {
        // SAFETY: the features were found on this machine, or there would be no `Avx512`.
        #[cfg(target_arch = "x86_64")]
        return unsafe { M::fill_wide(fill) };
        #[cfg(not(target_arch = "x86_64"))]
        M::fill(fill)
    }
}

impl Slope for f64 {
    type Unit = Portable;
}

impl Slope for Fused {
    type Unit = Avx512;
}

/// The instructions for numbers of a type.
type UnitOf<D> = <<D as Number>::Slope as Slope>::Unit;

/// States and parameters with a part of the slopes.
struct Pass<M: Model, D: Number> {
    unit: UnitOf<D>,
    x: Of<M::State, D>,
    start: Of<M::State, D>,
    p: Of<M::Parameters, D>,
    step: f64,
    first: usize,
    used: usize,
}

impl<M: Model, D: Number> Pass<M, D> {
    fn new(unit: UnitOf<D>, piece: &Piece<'_>, seeds: &[Seed], first: usize) -> Self {
        let used = seeds.len().saturating_sub(first).min(D::SLOPES);
        let slope = |entry: usize, i: usize| {
            if i < used { piece.slopes[entry * seeds.len() + first + i] } else { 0.0 }
        };
        let moves = |j: usize, i: usize| i < used && seeds[first + i] == Seed::Parameter(j);
        let x = M::State::from_fn(|entry| D::with(piece.carry[entry], |i| slope(entry, i)));
        let p = M::Parameters::from_fn(|j| D::with(piece.parameters[j], |i| f64::from(u8::from(moves(j, i)))));
        Pass { unit, x, start: x, p, step: 0.0, first, used }
    }
}

/// A pass with the type of its numbers erased: what is around the loop over the samples is compiled once for all of them.
trait AnyPass<M: Model, I> {
    /// Runs the samples of a window.
    fn fill(&mut self, task: &Task<'_, M, I>, rows: &Rows<'_, M>, window: &mut Window) -> Result<(), RunError>;
    /// Writes the values of the state.
    fn write_carry(&self, to: &mut [f64]);
    /// Writes its slopes into rows of this length.
    fn write_slopes(&self, to: &mut [f64], columns: usize);
}

impl<M: Model, I: Integrator, D: Number> AnyPass<M, I> for Pass<M, D> {
    fn fill(&mut self, task: &Task<'_, M, I>, rows: &Rows<'_, M>, window: &mut Window) -> Result<(), RunError> {
        self.unit.run(Fill { task, pass: self, rows, window })
    }

    fn write_carry(&self, to: &mut [f64]) {
        to.iter_mut().zip(M::State::into_array(self.x)).for_each(|(to, x)| *to = x.value());
    }

    fn write_slopes(&self, to: &mut [f64], columns: usize) {
        for (row, x) in to.chunks_exact_mut(columns).zip(M::State::into_array(self.x)) {
            row[self.first..].iter_mut().take(self.used).enumerate().for_each(|(i, to)| *to = x.slope(i));
        }
    }
}

/// The loop over the samples for a model, with the integrator's type erased.
pub(crate) trait Loops<M: Model>: Send + Sync {
    /// Runs a piece. With `restart`, samples are predicted from the measured states that many samples before.
    fn run(
        &self,
        model: &M,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError>;

    /// These loops with a finer step, if there is one.
    fn refined(&self, kind: Kind) -> Option<Arc<dyn Loops<M>>>;
}

impl<M: Model, I: Integrator> Loops<M> for I {
    fn run(
        &self,
        model: &M,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        let task = Task { model, integrator: self, piece, seeds, restart };
        // The AVX-512 loop is compiled for the zero-order hold only, which nearly all records have.
        let wide = if piece.record.holds.all_zero() { Avx512::detected() } else { None };
        // Debug builds compile fewer variants, to save compile time: same numbers, more passes.
        #[cfg(debug_assertions)]
        let passes = match (seeds.len(), wide) {
            (0, _) => task.passes::<f64>(Portable),
            (_, None) => task.passes::<Dual<4>>(Portable),
            (_, Some(wide)) => task.passes::<Dual<4, Fused>>(wide),
        };
        #[cfg(not(debug_assertions))]
        let passes = match (seeds.len(), wide) {
            (0, None) => task.passes::<f64>(Portable),
            (0, Some(wide)) => task.passes::<Dual<0, Fused>>(wide),
            (1..=4, None) => task.passes::<Dual<4>>(Portable),
            (5 | 6 | 9..=12, None) => task.passes::<Dual<6>>(Portable),
            (_, None) => task.passes::<Dual<8>>(Portable),
            (1..=4, Some(wide)) => task.passes::<Dual<4, Fused>>(wide),
            (5 | 6 | 9..=12, Some(wide)) => task.passes::<Dual<6, Fused>>(wide),
            (_, Some(wide)) => task.passes::<Dual<8, Fused>>(wide),
        };
        task.run_windows(passes, visit)
    }

    fn refined(&self, kind: Kind) -> Option<Arc<dyn Loops<M>>> {
        Some(Arc::new(Integrator::refined(self, kind)?))
    }
}

/// A piece and how it is to be run.
struct Task<'t, M: Model, I> {
    model: &'t M,
    integrator: &'t I,
    piece: &'t Piece<'t>,
    seeds: &'t [Seed],
    restart: Option<usize>,
}

/// The passes of a piece.
type Passes<'p, M, I> = Vec<Box<dyn AnyPass<M, I> + 'p>>;

impl<M: Model, I: Integrator> Task<'_, M, I> {
    fn passes<'p, D: Number + 'p>(&self, unit: UnitOf<D>) -> Passes<'p, M, I>
    where
        M: 'p,
        UnitOf<D>: 'p,
    {
        let count = self.seeds.len().div_ceil(D::SLOPES.max(1)).max(1);
        let pass = |i: usize| Pass::<M, D>::new(unit, self.piece, self.seeds, i * D::SLOPES);
        (0..count).map(|i| Box::new(pass(i)) as Box<dyn AnyPass<M, I> + 'p>).collect()
    }

    fn run_windows(&self, mut passes: Passes<'_, M, I>, visit: Visit<'_>) -> Result<Reached, RunError> {
        let (piece, columns) = (self.piece, self.seeds.len());
        let capacity = if I::FIXED { WINDOW } else { ADAPTIVE_WINDOW };
        let mut window = Window::new(1, M::Output::LEN, columns, capacity, false);
        window.carry = vec![0.0; M::State::LEN];
        let mut rows = Rows::<M>::new(piece.record);
        let mut begin = piece.samples.start;
        while begin < piece.samples.end {
            let samples = capacity.min(piece.samples.end - begin);
            (window.begin[0], window.samples[0]) = (begin, samples);
            rows.read(begin, samples, self.restart.unwrap_or(0));
            match self.restart {
                None => passes[0].write_carry(&mut window.carry),
                // Nothing is carried from window to window: all of them begin with the state at the record's first sample.
                Some(_) => window.carry.copy_from_slice(&piece.carry),
            }
            for pass in &mut passes {
                pass.fill(self, &rows, &mut window)?;
            }
            if !visit(&mut window) {
                return Err(RunError::Stopped);
            }
            begin += samples;
        }
        let mut reached = Reached { carry: vec![0.0; M::State::LEN], slopes: vec![0.0; M::State::LEN * columns] };
        passes[0].write_carry(&mut reached.carry);
        if columns > 0 {
            passes.iter().for_each(|pass| pass.write_slopes(&mut reached.slopes, columns));
        }
        Ok(reached)
    }
}

/// The loop, compiled portably and for AVX-512: the default target of `x86_64` has 16 registers of two lanes, AVX-512 has 32,
/// and no copies between them. Both profit as far as the model is inlined into them:
/// - The compiler surely inlines a large function only where it has one caller. So the numbers of the two loops are of two
///   types, and each has its own copy of the model, with one caller.
/// - As methods of the model the loops are in the codegen unit of its equations, which are then inlined without `#[inline]`
///   (motor, four slopes: 66 ns per sample, else 90).
/// - No wider lanes by explicit instructions: where inlining fails they become calls, twenty times slower.
trait Compiled<I, D: Number>: Model + Sized {
    fn fill(fill: Fill<'_, '_, Self, I, D>) -> Result<(), RunError>;

    /// # Safety
    /// The processor must have AVX-512.
    #[cfg(target_arch = "x86_64")]
    unsafe fn fill_wide(fill: Fill<'_, '_, Self, I, D>) -> Result<(), RunError>;
}

impl<M: Model, I: Integrator, D: Number> Compiled<I, D> for M {
    fn fill(fill: Fill<'_, '_, M, I, D>) -> Result<(), RunError> {
        fill.run()
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq")]
    unsafe fn fill_wide(fill: Fill<'_, '_, M, I, D>) -> Result<(), RunError> {
        fill.run()
    }
}

/// One window of one pass.
struct Fill<'f, 't, M: Model, I, D: Number> {
    task: &'f Task<'t, M, I>,
    pass: &'f mut Pass<M, D>,
    rows: &'f Rows<'f, M>,
    window: &'f mut Window,
}

impl<M: Model, I> Task<'_, M, I> {
    /// The state at the row after `k`.
    #[inline(always)]
    fn advance<D: Number>(
        &self,
        rows: &Rows<'_, M>,
        k: usize,
        x: Of<M::State, D>,
        p: &Of<M::Parameters, D>,
        step: &mut f64,
    ) -> Result<Of<M::State, D>, Stuck>
    where
        I: Integrator,
    {
        // A constant in the AVX-512 loop, so that the compiler moves out of the stages what depends on the input alone.
        let holds = &self.piece.record.holds;
        let moves = !<D::Slope as lanes::Number>::FUSED && !holds.all_zero();
        let u0 = M::Input::from_array(rows.inputs[k]);
        // A straight line from one value to the same is a hold.
        let end = |i: usize| rows.inputs[k + usize::from(holds.of(i) == Hold::First)].as_ref()[i];
        let u1 = if moves { M::Input::from_fn(end) } else { u0 };
        let hold = if moves { Hold::First } else { Hold::Zero };
        let interval = Interval { t0: rows.times[k], t1: rows.times[k + 1], u0, u1, hold };
        ModelSystem { model: self.model, interval: &interval, p }.step(self.integrator, x, step)
    }

    /// The measured state from which a sample is predicted, `restart` samples before; `None` if it was not measured.
    fn restarted<D: Number>(
        &self,
        start: &Of<M::State, D>,
        sample: usize,
        restart: usize,
    ) -> Option<(Of<M::State, D>, usize)> {
        let n = M::State::LEN;
        if sample < restart {
            return Some((*start, sample));
        }
        let x = &self.piece.prepared.restarts[(sample - restart) * n..][..n];
        let measured = x.iter().all(|x| !x.is_nan());
        measured.then(|| (M::State::from_fn(|i| D::from(x[i])), restart))
    }
}

impl<M: Model, I: Integrator, D: Number> Fill<'_, '_, M, I, D> {
    #[inline(always)]
    fn run(self) -> Result<(), RunError> {
        let Fill { task, pass, rows, window } = self;
        let (begin, samples) = (window.begin[0], window.samples[0]);
        let (p, mut x, mut step) = (pass.p, pass.x, pass.step);
        let (first, used, columns) = (pass.first, pass.used, window.columns());
        let (filled, measured) = window.only_lane_mut();
        let mut whole = true;
        for k in 0..=samples {
            let row = rows.before + k;
            // The state from which this sample is predicted, and the number of intervals between.
            let mut intervals = usize::from(k > 0 && row < rows.times.len());
            if let Some(restart) = task.restart {
                if k == samples {
                    break;
                }
                let Some((from, count)) = task.restarted(&pass.start, begin + k, restart) else {
                    for j in k * M::Output::LEN..(k + 1) * M::Output::LEN {
                        measured[j] = 0;
                        filled[j * columns..][..columns].fill(0.0);
                    }
                    whole = false;
                    continue;
                };
                (x, intervals, step) = (from, count, 0.0);
            }
            // The only call of the model's step: with two calls the compiler inlines neither.
            for from in row - intervals..row {
                x = task
                    .advance(rows, from, x, &p, &mut step)
                    .map_err(|Stuck| RunError::Failed { sample: begin + k })?;
            }
            if k == samples {
                break;
            }
            let u = M::Input::map(M::Input::from_array(rows.inputs[row]), D::from);
            let expected = task.model.output(D::from(rows.times[row]), &x, &u, &p);
            let (expected, found) = (M::Output::into_array(expected), rows.outputs[k]);
            for (j, (expected, found)) in expected.into_iter().zip(found).enumerate() {
                let (here, number) = (!found.is_nan(), k * M::Output::LEN + j);
                measured[number] = u32::from(here);
                let row = &mut filled[number * columns..][..columns];
                let error = found - expected.value();
                whole &= error.is_finite();
                let slope = |i: usize| if here { expected.slope(i) } else { 0.0 };
                match row.get_mut(first..first + D::SLOPES) {
                    // A count that the compiler knows; one slope more than used is where the error goes next.
                    Some(row) => row.iter_mut().enumerate().for_each(|(i, to)| *to = slope(i)),
                    None => row[first..first + used].iter_mut().enumerate().for_each(|(i, to)| *to = slope(i)),
                }
                row[columns - 1] = if here { error } else { 0.0 };
            }
        }
        window.whole = whole;
        pass.x = M::State::map(x, Number::flushed);
        pass.step = step;
        Ok(())
    }
}
