//! A period in the residuals: the line of the periodogram that stands out most from its neighborhood.
//!
//! Ordinates of a periodogram are exponentially distributed about a smooth spectrum (Brockwell and Davis, *Time Series:
//! Theory and Methods*, 1991, section 10.3). The spectrum is the local median, so that colored residuals do not count as
//! periodic; what does not complete four periods within the record is a trend, not a period.

use super::Series;
use crate::diagnose::Test;
use crate::numeral::{TimeUnit, resolved, unit_after};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A periodic part of the residuals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Period {
    /// Its length (s).
    #[serde(with = "crate::real")]
    pub seconds: f64,
    /// Its length in samples.
    #[serde(with = "crate::real")]
    pub samples: f64,
    /// Its frequency (Hz).
    #[serde(with = "crate::real")]
    pub frequency: f64,
    /// Amplitude of the line, in the output's unit.
    #[serde(with = "crate::real")]
    pub amplitude: f64,
    /// Part of the residuals' variance.
    #[serde(with = "crate::real")]
    pub share: f64,
}

/// Periods within the record that make a line.
const FEWEST: usize = 4;
/// Half of the neighborhood: at most, at least.
const REACH: (usize, usize) = (60, 6);

/// Where the power of the residuals lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spectrum {
    /// Middle of each part of the frequencies up to half the sampling frequency (Hz).
    #[serde(with = "crate::real")]
    pub frequency: Vec<f64>,
    /// Mean power density in it, one-sided, in the square of the output's unit per Hz.
    #[serde(with = "crate::real")]
    pub density: Vec<f64>,
    /// The greatest power density in it.
    #[serde(with = "crate::real")]
    pub greatest: Vec<f64>,
}

/// Parts of the frequencies in a spectrum.
const BANDS: usize = 128;

/// The lines of a periodogram on a grid of this length, gathered.
fn gathered(power: &[f64], grid: usize, samples: usize, step: f64) -> Spectrum {
    let density = |power: f64| 2.0 * step * power / samples as f64;
    let width = (power.len() - 1).div_ceil(BANDS).max(1);
    let mut spectrum = Spectrum::default();
    // Without the mean.
    for (i, lines) in power[1..].chunks(width).enumerate() {
        let middle = 1.0 + (i * width) as f64 + (lines.len() - 1) as f64 / 2.0;
        spectrum.frequency.push(middle / (grid as f64 * step));
        spectrum.density.push(density(lines.iter().sum::<f64>() / lines.len() as f64));
        spectrum.greatest.push(density(lines.iter().copied().fold(0.0, f64::max)));
    }
    spectrum
}

pub(super) fn find(residuals: &Series, step: f64, unit: &TimeUnit) -> (Spectrum, Option<Period>, Test) {
    let n = residuals.values.len();
    let mut spectrum: Vec<Complex<f64>> = residuals.values.iter().map(|&e| Complex::new(e, 0.0)).collect();
    let grid = n.next_power_of_two();
    spectrum.resize(grid, Complex::default());
    transform(&mut spectrum);
    // Less the line at half the sampling frequency, which is distributed otherwise.
    let power: Vec<f64> = spectrum[..grid / 2].iter().map(|z| z.norm_sqr()).collect();
    let fewest = (FEWEST * grid).div_ceil(n);
    let mut best = (0.0, 0);
    let mut neighbors = Vec::with_capacity(2 * REACH.0);
    let mut median = f64::INFINITY;
    for k in fewest..power.len() {
        let reach = (k / 2).clamp(REACH.1, REACH.0);
        // Far from zero frequency the neighborhood moves slowly: one median serves a few lines.
        if reach < REACH.0 || k % 8 == 0 || median.is_infinite() {
            neighbors.clear();
            let (from, to) = (k.saturating_sub(reach).max(1), (k + reach + 1).min(power.len()));
            neighbors.extend_from_slice(&power[from..to]);
            let half = neighbors.len() / 2;
            median = *neighbors.select_nth_unstable_by(half, f64::total_cmp).1;
        }
        let excess = power[k] / (median / std::f64::consts::LN_2).max(f64::MIN_POSITIVE);
        if excess > best.0 {
            best = (excess, k);
        }
    }
    let (excess, k) = best;
    let tried = power.len().saturating_sub(fewest).max(1) as f64;
    // The median of some twenty neighbors is itself uncertain: as F with 2 and 2 * 20 degrees of freedom.
    let neighbors = (2 * (k / 2).clamp(REACH.1, REACH.0)) as f64;
    let single = (1.0 + excess / neighbors).powf(-neighbors);
    let p_value = of_any(single, tried);
    let energy: f64 = residuals.values.iter().map(|e| e * e).sum();
    let frequency = center(&power, k) / (grid as f64 * step);
    let period = Period {
        seconds: frequency.recip(),
        samples: (frequency * step).recip(),
        frequency,
        amplitude: 2.0 * power[k].sqrt() / residuals.count as f64,
        share: (2.0 * power[k] / (energy * residuals.count as f64)).min(1.0),
    };
    // The place of a line is known to the distance between lines, at least: that is the last digit.
    let lines = (n as f64 * step).recip();
    let last_digit = 10.0 * lines;
    let failed = format!(
        "the residuals repeat every {}{} ({} {}): look for what turns or switches at that rate (cogging, eccentricity, \
         sampling, mains) and model it, or leave it out with a pre-filter",
        resolved(unit.convert(period.seconds), unit.convert(last_digit * period.seconds.powi(2))),
        unit_after(unit.name()),
        resolved(period.frequency, last_digit),
        unit.frequency()
    );
    let test = Test::new("periodogram", excess, p_value, "no period stands out", &failed);
    (gathered(&power, grid, n, step), (!test.passed && k > 0).then_some(period), test)
}

/// The probability of any of so many independent events, `1 - (1 - p)^n`, without loss of digits where it is small.
fn of_any(single: f64, tried: f64) -> f64 {
    -(tried * (-single).ln_1p()).exp_m1()
}

/// Where between the lines of the grid the strongest is: the top of the parabola through the logarithms.
fn center(power: &[f64], k: usize) -> f64 {
    let at = |k: usize| power.get(k).copied().unwrap_or(0.0).max(f64::MIN_POSITIVE).ln();
    let (left, middle, right) = (at(k.saturating_sub(1)), at(k), at(k + 1));
    let bend = left - 2.0 * middle + right;
    k as f64 + if bend < 0.0 { (0.5 * (left - right) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Discrete Fourier transform in place, of a length that is a power of two (Cooley and Tukey, Mathematics of Computation
/// 19 (1965) 297).
fn transform(values: &mut [Complex<f64>]) {
    let n = values.len();
    if n < 2 {
        return;
    }
    for k in 0..n {
        let reversed = k.reverse_bits() >> (usize::BITS - n.trailing_zeros());
        if k < reversed {
            values.swap(k, reversed);
        }
    }
    let roots: Vec<Complex<f64>> = (0..n / 2).map(|k| Complex::from_polar(1.0, -TAU * k as f64 / n as f64)).collect();
    let mut half = 1;
    while half < n {
        for part in values.chunks_exact_mut(2 * half) {
            let (even, odd) = part.split_at_mut(half);
            for (k, (a, b)) in even.iter_mut().zip(odd).enumerate() {
                let turned = *b * roots[k * (n / 2 / half)];
                (*a, *b) = (*a + turned, *a - turned);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The densities times the widths of the bands make the variance (Parseval), of white noise alike in all bands.
    #[test]
    fn spectrum_holds_the_variance() {
        let mut state = 1u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let raw: Vec<f64> = (0..4096).map(|_| noise()).collect();
        let series = Series::new("y", "V", &raw);
        let (spectrum, period, _) = find(&series, 0.01, &TimeUnit::default());
        let width = 50.0 / BANDS as f64;
        let power: f64 = spectrum.density.iter().map(|density| density * width).sum();
        // The lines at zero and at 50 Hz are left out: two of 2048.
        assert!((power / series.deviation.powi(2) - 1.0).abs() < 2e-3, "{power}");
        assert!(period.is_none() && spectrum.density.len() == BANDS);
        // Means of 16 exponential numbers, each within a factor of 3 of the whole's mean but with probability 1e-4.
        let mean = power / 50.0;
        assert!(spectrum.density.iter().all(|density| (0.25..3.0).contains(&(density / mean))));
    }

    /// The logarithms of a bell are a parabola: its top is found between the lines, and at most half a line away.
    #[test]
    fn the_top_of_a_bell() {
        let bell =
            |top: f64| -> Vec<f64> { (0..9).map(|k| 3.0 * (-0.2 * (f64::from(k) - top).powi(2)).exp()).collect() };
        for top in [4.0, 4.3, 3.8] {
            assert!((center(&bell(top), 4) - top).abs() < 1e-12, "{top}: {}", center(&bell(top), 4));
        }
        assert_eq!([center(&bell(6.0), 4), center(&[1.0; 9], 4)], [4.5, 4.0]);
    }

    #[test]
    fn any_of_many() {
        for (single, tried, expected) in [(0.5, 2.0, 0.75), (1e-20, 1e3, 1e-17), (1e-3, 1e3, 1.0 - 0.999f64.powi(1000))]
        {
            assert!((of_any(single, tried) / expected - 1.0).abs() < 1e-12, "{single} {tried}");
        }
        assert_eq!([of_any(0.0, 10.0), of_any(1.0, 10.0)], [0.0, 1.0]);
    }

    /// The definition, sum by sum.
    #[test]
    fn transform_is_fourier() {
        let signal = |k: usize| Complex::new((k as f64 * 1.7).sin(), (k * k) as f64 * 0.01);
        let mut fast: Vec<Complex<f64>> = (0..32).map(signal).collect();
        transform(&mut fast);
        for (f, found) in fast.iter().enumerate() {
            let term = |k: usize| signal(k) * Complex::from_polar(1.0, -TAU * (f * k) as f64 / 32.0);
            let expected: Complex<f64> = (0..32).map(term).sum();
            assert!((found - expected).norm() < 1e-12, "{f}: {found} {expected}");
        }
    }

    /// White noise of deviation 1.
    fn noise(samples: usize) -> impl Iterator<Item = f64> {
        let mut random = crate::random::Random::stream(5, 0);
        (0..samples).map(move |_| random.normal())
    }

    /// A line far above the low frequencies, in noise whose spectrum falls by a factor of a thousand before, and one among them: it
    /// is held against its own neighborhood of as many lines to either side as half of its number, 60 at most, and its probability
    /// is that of F with 2 and twice as many degrees of freedom as there are neighbors (the tail is `(1 + x / n)^-n`), the
    /// largest of all lines tried. With 60 lines to either side one neighborhood serves the eight lines from a multiple of eight on.
    #[test]
    fn a_line_is_held_against_its_neighborhood() {
        let samples = 4096;
        for (line, middle, amplitude, reach) in [(1003, 1000, 0.085, 60), (43, 43, 2.5, 21)] {
            let (mut low, mut raw) = (0.0, vec![]);
            for (k, e) in noise(samples).enumerate() {
                low = 0.98 * low + e;
                raw.push(low + amplitude * (TAU * (k * line) as f64 / samples as f64).sin());
            }
            let series = Series::new("y", "V", &raw);
            let (_, period, test) = find(&series, 0.01, &TimeUnit::default());
            let power = |f: usize| {
                let turn = |k: usize| -TAU * (f * k % samples) as f64 / samples as f64;
                let term = |k: usize| Complex::from_polar(series.values[k], turn(k));
                (0..samples).map(term).sum::<Complex<f64>>().norm_sqr()
            };
            let mut neighbors: Vec<f64> = (middle - reach..=middle + reach).map(power).collect();
            neighbors.sort_unstable_by(f64::total_cmp);
            let expected = power(line) / (neighbors[reach] / std::f64::consts::LN_2);
            assert!((test.statistic / expected - 1.0).abs() < 1e-9, "{} {expected}", test.statistic);
            let energy: f64 = series.values.iter().map(|e| e * e).sum();
            let share = 2.0 * power(line) / (energy * samples as f64);
            assert!((period.unwrap().share / share - 1.0).abs() < 1e-9 && share < 0.9, "{period:?} {share}");
            let count = 2.0 * reach as f64;
            let single = (1.0 + expected / count).powf(-count);
            let p_value = 1.0 - (1.0 - single).powf((2048 - 4) as f64);
            assert!(
                (1e-9..0.5).contains(&p_value) && (test.p_value / p_value - 1.0).abs() < 1e-6,
                "{test:?} {p_value}"
            );
        }
    }

    /// A sine between two lines, in no noise to speak of: frequency, period, amplitude and share are its own. The bands stand at
    /// the middles of their lines.
    #[test]
    fn a_sine_is_measured() {
        let (samples, step, frequency) = (1024, 0.01, 12.3);
        let sine = |k: usize| 0.5 * (TAU * frequency * k as f64 * step + 0.4).sin();
        let raw: Vec<f64> = noise(samples).enumerate().map(|(k, e)| sine(k) + 1e-3 * e).collect();
        let (spectrum, period, _) = find(&Series::new("y", "V", &raw), step, &TimeUnit::default());
        let period = period.unwrap();
        // Lines are 0.098 Hz apart; the top of the parabola is within a tenth of that. 12.3 Hz is 0.05 lines off one, which
        // takes sinc(0.05)^2, less than a hundredth.
        assert!((period.frequency - frequency).abs() < 0.01, "{period:?}");
        assert!(
            (period.seconds * frequency - 1.0).abs() < 1e-3 && (period.samples * 0.123 - 1.0).abs() < 1e-3,
            "{period:?}"
        );
        assert!((period.amplitude / 0.5 - 1.0).abs() < 0.01 && (period.share - 1.0).abs() < 0.02, "{period:?}");
        // 512 lines without the mean's are 127 bands of four and one of three.
        assert_eq!(spectrum.frequency.len(), 128);
        let line = |middle: f64| middle / (samples as f64 * step);
        assert!(
            (spectrum.frequency[0] - line(2.5)).abs() < 1e-12 && (spectrum.frequency[127] - line(510.0)).abs() < 1e-12
        );
        let strongest = (0..128).max_by(|&a, &b| spectrum.greatest[a].total_cmp(&spectrum.greatest[b])).unwrap();
        assert!((spectrum.frequency[strongest] - frequency).abs() < 2.0 * line(1.0));
        assert!(spectrum.greatest[strongest] > 3.0 * spectrum.density[strongest]);
    }
}
