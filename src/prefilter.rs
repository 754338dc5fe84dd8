//! [`Butterworth`]: the pre-filter `L(q)` of prediction errors (L. Ljung, *System Identification*, 2nd ed., 1999, 7.2),
//! and zero-phase filtering of records.
//!
//! The analog prototype (S. Butterworth, "On the theory of filter amplifiers", Wireless Engineer 7, 1930, 536-541)
//! becomes digital by the bilinear transform, prewarped so that the gain at the cut-off is exactly `1/sqrt(2)`. Each pair
//! of poles is a state-variable section (A. Simper, "Linear trapezoidal integrated state variable filter", Cytomic, 2013):
//! the same transfer function as a direct-form section, but its gain at zero frequency is one by structure and its poles
//! do not move with rounding, where a direct form loses digits as the square of cut-off over sampling rate.

mod linear;
mod zero_phase;

pub(crate) use zero_phase::filtered;

use crate::error::Error;
use linear::{Lanes, Linear};
use serde::{Deserialize, Serialize};

/// Sections of the highest order, 20.
const SECTIONS: usize = 10;

/// Rows filtered between two looks for states that have decayed.
const TILE: usize = 16;

/// Columns filtered side by side.
const LANES: usize = 4;

/// Which frequencies pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pass {
    /// Those below the cut-off; the gain at zero frequency is one.
    Low,
    /// Those above the cut-off; the gain at half the sampling rate is one.
    High,
}

/// A Butterworth filter: flat in its pass band, `1/sqrt(2)` (-3 dB) at the cut-off, falling with `order * 20` dB per decade.
///
/// ```
/// use greybox::{Butterworth, prefilter::FilterState};
/// let filter = Butterworth::low_pass(4, 100.0, 0.126e-3)?; // 100 Hz, sampled every 0.126 ms
/// let mut state = FilterState::default(); // at rest
/// let y = filter.step(&mut state, 1.0);
/// assert!(y > 0.0 && y < 1e-5);
/// # Ok::<(), greybox::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Design", into = "Design")]
pub struct Butterworth {
    design: Design,
    sections: [Section; SECTIONS],
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Design {
    pass: Pass,
    order: u32,
    /// Hz.
    cutoff: f64,
    /// s.
    sample_time: f64,
}

/// Two poles, or (with `c1 = c2 = 0`) one. In Simper's letters `c1 = 2 a1 - 1`, `c2 = 2 a2`, `c3 = 2 a3`: the shortest
/// chain of operations from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Section {
    c1: f64,
    c2: f64,
    c3: f64,
    k: f64,
}

/// The state of a filter between two samples; zero by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilterState<V = f64>([[V; 2]; SECTIONS]);

impl Section {
    #[inline(always)]
    fn step<V: Linear>(&self, high: bool, [s1, s2]: &mut [V; 2], x: V) -> V {
        let v = x - *s2;
        let next = [*s1 * self.c1 + v * self.c2, *s2 + (*s1 * self.c2 + v * self.c3)];
        let (band, low) = ((*s1 + next[0]) * 0.5, (*s2 + next[1]) * 0.5);
        [*s1, *s2] = next;
        if high { x - band * self.k - low } else { low }
    }
}

impl Butterworth {
    /// A low-pass of `order` 1 to 20 with the cut-off `cutoff` (Hz), for samples every `sample_time` (s).
    ///
    /// # Errors
    /// An order outside 1 to 20, a sample time that is not positive, a cut-off that is not between zero and half the
    /// sampling rate.
    pub fn low_pass(order: u32, cutoff: f64, sample_time: f64) -> Result<Self, Error> {
        Design { pass: Pass::Low, order, cutoff, sample_time }.try_into()
    }

    /// A high-pass, as [`low_pass`](Self::low_pass).
    ///
    /// # Errors
    /// As [`low_pass`](Self::low_pass).
    pub fn high_pass(order: u32, cutoff: f64, sample_time: f64) -> Result<Self, Error> {
        Design { pass: Pass::High, order, cutoff, sample_time }.try_into()
    }

    /// Which frequencies pass.
    pub fn pass(&self) -> Pass {
        self.design.pass
    }

    /// The order.
    pub fn order(&self) -> u32 {
        self.design.order
    }

    /// The cut-off (Hz).
    pub fn cutoff(&self) -> f64 {
        self.design.cutoff
    }

    /// The sample time it was made for (s).
    pub fn sample_time(&self) -> f64 {
        self.design.sample_time
    }

    /// Kind and numbers in a few words, for reports.
    pub fn describe(&self) -> String {
        let Design { pass, order, cutoff, .. } = self.design;
        let pass = if pass == Pass::Low { "low" } else { "high" };
        format!("Butterworth {pass}-pass, order {order}, {cutoff} Hz")
    }

    fn sections(&self) -> &[Section] {
        self.sections.get(..self.design.order.div_ceil(2) as usize).unwrap_or(&self.sections)
    }

    /// The state in which the filter stays if its input stays at `x`.
    pub fn settled<V: Linear>(&self, x: V) -> FilterState<V> {
        let mut state = FilterState::default();
        let low = self.design.pass == Pass::Low;
        for (i, section) in state.0.iter_mut().enumerate() {
            if low || i == 0 {
                section[1] = x;
            }
        }
        state
    }

    /// The next output. What is not a number stays in the state.
    #[inline]
    pub fn step<V: Linear>(&self, state: &mut FilterState<V>, mut x: V) -> V {
        let high = self.design.pass == Pass::High;
        for (section, state) in self.sections().iter().zip(&mut state.0) {
            x = section.step(high, state, x);
            *state = state.map(V::flushed);
        }
        x
    }

    /// Filters the first `rows` rows of a column-major block in place, each column from its own state, which moves on to
    /// the next block. A column starts every `stride` numbers; there are as many as there are states (or as fit into the
    /// block). Does not allocate.
    pub fn filter(&self, block: &mut [f64], stride: usize, rows: usize, states: &mut [FilterState]) {
        let rows = rows.min(stride);
        if rows == 0 {
            return;
        }
        let columns = states.len().min(block.len().saturating_add(stride - rows) / stride);
        let (mut block, mut states) = (block, states.get_mut(..columns).unwrap_or_default());
        while states.len() >= LANES {
            let (first, rest) = states.split_at_mut(LANES);
            self.lanes::<LANES>(block, stride, rows, first);
            (block, states) = (block.get_mut(LANES * stride..).unwrap_or_default(), rest);
        }
        for (column, state) in block.chunks_mut(stride).zip(states.chunks_mut(1)) {
            self.lanes::<1>(column, stride, rows, state);
        }
    }

    /// Filters rows of `width` numbers in place, sample by sample and each place in the row from its own state, which moves
    /// on to the next rows. The state is at rest where `states` is empty.
    pub(crate) fn filter_rows(&self, rows: &mut [f64], width: usize, states: &mut Vec<f64>) {
        let (high, sections) = (self.design.pass == Pass::High, self.sections());
        if width == 0 {
            return;
        }
        states.resize(2 * width * sections.len(), 0.0);
        for row in rows.chunks_exact_mut(width) {
            for (section, states) in sections.iter().zip(states.chunks_exact_mut(2 * width)) {
                let (first, second) = states.split_at_mut(width);
                for ((x, s1), s2) in row.iter_mut().zip(first).zip(second) {
                    let mut state = [*s1, *s2];
                    *x = section.step(high, &mut state, *x);
                    [*s1, *s2] = state;
                }
            }
        }
        states.iter_mut().for_each(|state| *state = state.flushed());
    }

    /// Filters `L` columns side by side: one alone would wait for its own last sample most of the time.
    fn lanes<const L: usize>(&self, block: &mut [f64], stride: usize, rows: usize, states: &mut [FilterState]) {
        let high = self.design.pass == Pass::High;
        let mut memory = FilterState::<Lanes<L>>::default();
        for (i, section) in memory.0.iter_mut().enumerate() {
            *section = [0, 1].map(|j| Lanes(core::array::from_fn(|l| states[l].0[i][j])));
        }
        let mut tile = [Lanes::<L>::default(); TILE];
        for from in (0..rows).step_by(TILE) {
            let height = TILE.min(rows - from);
            let tile = &mut tile[..height];
            for (l, column) in block.chunks(stride).take(L).enumerate() {
                for (lanes, x) in tile.iter_mut().zip(&column[from..]) {
                    lanes.0[l] = *x;
                }
            }
            for (section, state) in self.sections().iter().zip(&mut memory.0) {
                let mut local = *state;
                for x in tile.iter_mut() {
                    *x = section.step(high, &mut local, *x);
                }
                *state = local.map(Lanes::flushed);
            }
            for (l, column) in block.chunks_mut(stride).take(L).enumerate() {
                for (lanes, x) in tile.iter().zip(&mut column[from..]) {
                    *x = lanes.0[l];
                }
            }
        }
        for (l, state) in states.iter_mut().enumerate() {
            state.0 = memory.0.map(|section| section.map(|s| s.0[l]));
        }
    }
}

/// `tan(pi f T)`: where the bilinear transform takes the cut-off from.
fn warped(cutoff: f64, sample_time: f64) -> f64 {
    (core::f64::consts::PI * cutoff * sample_time).tan()
}

impl TryFrom<Design> for Butterworth {
    type Error = Error;

    fn try_from(design: Design) -> Result<Self, Error> {
        let Design { order, cutoff, sample_time, .. } = design;
        if !(1..=20).contains(&order) {
            return Err(Error::Filter(format!("the order is {order}; it must be 1 to 20")));
        }
        if !(sample_time > 0.0 && sample_time.is_finite()) {
            return Err(Error::NotPositive { what: "the sample time of the filter".to_owned(), value: sample_time });
        }
        let nyquist = 0.5 / sample_time;
        if !(cutoff > 0.0 && cutoff < nyquist) {
            return Err(Error::Filter(format!(
                "the cut-off is {cutoff} Hz; it must lie between zero and half the sampling rate, {nyquist} Hz"
            )));
        }
        let g = warped(cutoff, sample_time);
        let mut sections = [Section::default(); SECTIONS];
        for (i, section) in sections.iter_mut().take(order.div_ceil(2) as usize).enumerate() {
            let pair = 2 * i as u32 + 1;
            *section = if pair == order {
                Section { c3: 2.0 * g / (1.0 + g), ..Section::default() }
            } else {
                // Pole pairs at the angles (2 i + 1) pi / (2 n) from the imaginary axis: 2 zeta = 2 sin.
                let k = 2.0 * (core::f64::consts::FRAC_PI_2 * f64::from(pair) / f64::from(order)).sin();
                let d = 1.0 + g * (g + k);
                Section { c1: (1.0 - g * (g + k)) / d, c2: 2.0 * g / d, c3: 2.0 * g * g / d, k }
            };
        }
        Ok(Butterworth { design, sections })
    }
}

impl From<Butterworth> for Design {
    fn from(filter: Butterworth) -> Design {
        filter.design
    }
}
