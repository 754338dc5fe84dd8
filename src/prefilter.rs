//! [`Butterworth`]: the pre-filter `L(q)` of prediction errors (L. Ljung, *System Identification*, 2nd ed., 1999, 7.2),
//! and zero-phase filtering of records.
//!
//! The analog prototype (S. Butterworth, "On the theory of filter amplifiers", Wireless Engineer 7, 1930, 536-541)
//! becomes digital by the bilinear transform, prewarped so that the gain at the cut-off is exactly `1/sqrt(2)`. Each pair
//! of poles is a state-variable section (A. Simper, "Linear trapezoidal integrated state variable filter", Cytomic, 2013):
//! the same transfer function as a direct-form section, but its gain at zero frequency is one by structure and its poles
//! do not move with rounding, where a direct form loses digits as the square of cut-off over sampling rate.

#[cfg(test)]
mod tests;
mod zero_phase;

pub(crate) use zero_phase::filtered;

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Sections of the highest order, 20.
const SECTIONS: usize = 10;

/// Below this a decaying state is set to zero; left alone it would reach numbers that the hardware handles 100 times slower.
const NEGLIGIBLE: f64 = 1e-290;

/// Rows filtered between two looks for states that have decayed.
const PART: usize = 128;

/// Which frequencies pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Pass {
    /// Frequencies below the cut-off pass; the gain at zero frequency is one.
    Low,
    /// Frequencies above the cut-off pass; the gain at half the sampling rate is one.
    High,
}

/// A Butterworth filter: flat in its pass band, `1/sqrt(2)` (-3 dB) at the cut-off, falling with `order * 20` dB per decade.
///
/// ```
/// let filter = greybox::Butterworth::low_pass(4, 100.0, 0.126e-3)?; // 100 Hz, sampled every 0.126 ms
/// let mut values = vec![1.0; 50];
/// filter.zero_phase(&mut values); // what does not change passes
/// assert!(values.iter().all(|y| (y - 1.0).abs() < 1e-12));
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

impl Section {
    #[inline(always)]
    fn step(&self, high: bool, [s1, s2]: &mut [f64; 2], x: f64) -> f64 {
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

    /// The state, of rows of one number, in which the filter stays if its input stays at `x`.
    fn settled(&self, x: f64) -> Vec<f64> {
        let low = self.design.pass == Pass::Low;
        (0..self.sections().len()).flat_map(|i| [0.0, if low || i == 0 { x } else { 0.0 }]).collect()
    }

    /// Filters rows of `width` numbers in place, sample by sample and each place in the row from its own state, which moves
    /// on to the next rows. The state is at rest where `states` is empty.
    pub(crate) fn filter_rows(&self, rows: &mut [f64], width: usize, states: &mut Vec<f64>) {
        let (high, sections) = (self.design.pass == Pass::High, self.sections());
        if width == 0 {
            return;
        }
        states.resize(2 * width * sections.len(), 0.0);
        for part in rows.chunks_mut(PART * width) {
            for row in part.chunks_exact_mut(width) {
                for (section, states) in sections.iter().zip(states.chunks_exact_mut(2 * width)) {
                    let (first, second) = states.split_at_mut(width);
                    for ((x, s1), s2) in row.iter_mut().zip(first).zip(second) {
                        let mut state = [*s1, *s2];
                        *x = section.step(high, &mut state, *x);
                        [*s1, *s2] = state;
                    }
                }
            }
            states.iter_mut().filter(|state| state.abs() < NEGLIGIBLE).for_each(|state| *state = 0.0);
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
