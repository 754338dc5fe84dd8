//! One pass over the data without slopes: what the model makes of them at the point that was found.

use super::objective::Objective;
use super::source::Halt;
use crate::error::Error;
use crate::estimate::{Quality, Warning};
use crate::numeral::{counted, number, p_value as p_value_in_words};
use crate::optimize::Severity;
use crate::predict::WINDOW;
use crate::whiteness::{Autocorrelation, ljung_box};

/// Lags, and the probability below which errors count as colored.
const COLOR_LAGS: usize = 20;
const COLOR_LEVEL: f64 = 0.01;
/// Colored errors that widen an interval by more than this factor call for care.
const COLOR_MATTERS: f64 = 2.0;
/// One window in so many is simulated once more with a finer step.
const EVERY: usize = 8;

pub(super) struct Reproduced {
    pub quality: Vec<Quality>,
    /// How many measurements count.
    pub measured: u64,
    /// Logarithm of the determinant of the covariance of all measurements.
    pub log_determinant: f64,
    /// A bound on how far (in standard errors) a finer step could move the unknowns: the norm of the change of all
    /// standardized predictions, extrapolated from the windows that were simulated again.
    pub step_error: f64,
    pub color: Option<Color>,
}

impl Objective<'_> {
    pub(super) fn reproduce(&self, coordinates: &[f64]) -> Result<Reproduced, Error> {
        let outputs = self.outputs();
        let (sigma, weighted) = (self.whitening.sigma(), self.source.is_weighted());
        let mut sums = vec![Sums::default(); outputs];
        let (mut measured, mut log_determinant, mut bound) = (0u64, 0.0, 0.0);
        let mut here = Vec::with_capacity(outputs);
        let all: Vec<usize> = (0..outputs).collect();
        let whole = self.whitening.log_determinant(&all);
        let mut found = vec![0.0; outputs * WINDOW];
        let mut autocorrelations = vec![Autocorrelation::new(COLOR_LAGS); outputs];
        for e in 0..self.experiments() {
            let (mut change, mut seen) = (0.0, 0usize);
            autocorrelations.iter_mut().for_each(Autocorrelation::restart);
            let place = self.unknowns.place(e, coordinates);
            let result = self.source.compare(e, &place, EVERY, &mut |window, finer| {
                let range = window.begin..window.begin + window.samples;
                for (j, values) in found.chunks_exact_mut(WINDOW).enumerate() {
                    self.source.measured(e, j, range.clone(), values);
                }
                for k in 0..window.samples {
                    here.clear();
                    here.extend((0..outputs).filter(|j| window.measured[j * WINDOW + k]));
                    let complete = here.len() == outputs;
                    log_determinant += if complete { whole } else { self.whitening.log_determinant(&here) };
                    if !weighted || self.source.weight(e, window.begin + k) > 0.0 {
                        measured += here.len() as u64;
                    }
                }
                for (j, (sums, autocorrelation)) in sums.iter_mut().zip(&mut autocorrelations).enumerate() {
                    let rows = j * WINDOW..j * WINDOW + window.samples;
                    let (errors, here) = (&window.errors()[rows.clone()], &window.measured[rows.clone()]);
                    for ((&y, &error), _) in found[rows].iter().zip(errors).zip(here).filter(|(_, here)| **here) {
                        sums.add(y, error);
                    }
                    autocorrelation.add(errors, here.iter().filter(|here| **here).count() as u64);
                }
                if let Some(finer) = finer {
                    let errors = window.errors().iter().zip(finer.errors()).enumerate();
                    change += errors.map(|(row, (a, b))| ((a - b) / sigma[row / WINDOW]).powi(2)).sum::<f64>();
                    seen += window.samples;
                }
            });
            if let Err(Halt::Failed { sample }) = result {
                return Err(Error::Simulation(self.locate(e, coordinates, sample)));
            }
            bound += if seen > 0 { change * self.source.samples(e) as f64 / seen as f64 } else { 0.0 };
        }
        let quality = sums.iter().map(Sums::quality).collect();
        let color = Color::of(self.source.outputs(), &autocorrelations);
        Ok(Reproduced { quality, measured, log_determinant, step_error: bound.sqrt(), color })
    }
}

/// Errors that are not white.
pub(super) struct Color {
    pub output: &'static str,
    /// Probability that white errors look like this.
    pub p_value: f64,
    /// Correlation of an error with the one before.
    pub first: f64,
}

impl Color {
    /// The output whose errors are least white, if the test of Ljung and Box refuses any.
    fn of(names: &[&'static str], autocorrelations: &[Autocorrelation]) -> Option<Self> {
        let tested = autocorrelations.iter().enumerate().map(|(j, autocorrelation)| {
            let coefficients = autocorrelation.coefficients();
            let (_, p_value) = ljung_box(&coefficients, autocorrelation.count());
            let first = coefficients.first().copied().unwrap_or(0.0);
            Color { output: names[j], p_value: p_value * autocorrelations.len() as f64, first }
        });
        let strongest = |a: &Color, b: &Color| a.p_value.total_cmp(&b.p_value).then(b.first.total_cmp(&a.first));
        tested.min_by(strongest).filter(|color| color.p_value < COLOR_LEVEL)
    }

    /// What it means; `allowed` holds the lags that the covariance allows for, and by which factor that widens intervals.
    pub fn warning(&self, allowed: Option<(usize, f64)>) -> Warning {
        let Color { output, p_value, first } = self;
        let mut text = format!(
            "the errors of `{output}` are not white (Ljung-Box {}, correlation with the error before {}): the model misses a \
             part, or the noise is colored",
            p_value_in_words(p_value.min(1.0)),
            number(*first, 2)
        );
        let Some((lags, widest)) = allowed else {
            text += "; the intervals take them as white and are too narrow if the order of the samples matters";
            return Warning { severity: Severity::UsableWithCare, text };
        };
        text += &format!("; the intervals allow for it (HAC over {}, prewhitened)", counted(lags as u64, "lag"));
        if widest > 1.0 {
            text += &format!(", which makes them up to {} times as wide as for white errors", number(widest, 3));
        }
        let severity = if widest > COLOR_MATTERS { Severity::UsableWithCare } else { Severity::Usable };
        Warning { severity, text }
    }
}

/// Running sums of an output and its error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    count: u64,
    first: f64,
    sum: f64,
    squares: f64,
    errors: f64,
}

impl Sums {
    pub fn add(&mut self, y: f64, error: f64) {
        if self.count == 0 {
            self.first = y;
        }
        // From the first value, so that a large mean costs no digits.
        let y = y - self.first;
        self.count += 1;
        self.sum += y;
        self.squares += y * y;
        self.errors += error * error;
    }

    pub fn quality(&self) -> Quality {
        let n = self.count as f64;
        let spread = self.squares - self.sum * self.sum / n;
        let fit_percent = (spread > 0.0).then(|| 100.0 * (1.0 - (self.errors / spread).sqrt()));
        Quality {
            samples: self.count,
            rmse: if self.count > 0 { (self.errors / n).sqrt() } else { 0.0 },
            fit_percent,
            sigma: 0.0,
        }
    }
}
