//! [`Scale`]: an axis with its range, round numbers in it, and how they are written.

use super::cut;
use crate::numeral::{exact, unit_after};
use crate::section::Axis;

/// An axis and what it shows.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    pub name: String,
    pub unit: String,
    pub logarithmic: bool,
    /// Least and greatest value shown; of a logarithmic axis, their decimal logarithms.
    pub from: f64,
    pub to: f64,
}

/// A marked value of an axis.
pub(super) struct Tick {
    /// Its place, from 0 to 1.
    pub at: f64,
    /// How it is written, as a multiple of the axis' factor above its base.
    pub label: String,
}

/// Number of letters of a name that fit the narrowest screen beside a unit.
const LETTERS: usize = 36;
/// A range this much smaller than its distance from zero is written as what is above a round number.
const NARROW: f64 = 1e-4;
/// A logarithmic range of fewer decades is one value.
const DECADES: f64 = 1e-4;
/// A range smaller than this part of its distance from zero is rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Smaller numbers are drawn as zero and larger ones lie off the axis: powers of ten for their labels would under- or
/// overflow.
const SMALLEST: f64 = 1e-290;
const LARGEST: f64 = 1e290;

impl Scale {
    /// An axis that shows the whole range, and something at all if that is empty.
    pub fn new(axis: &Axis, range: Option<(f64, f64)>) -> Scale {
        let shown = |value: f64| if axis.logarithmic { value.log10() } else { value };
        let range = range.map(|(from, to)| (shown(from), shown(to)));
        let (from, to) = range.filter(|(from, to)| from.is_finite() && to.is_finite()).unwrap_or((0.0, 1.0));
        let (from, to) = (from.clamp(-LARGEST, LARGEST), to.clamp(-LARGEST, LARGEST));
        let size = from.abs().max(to.abs());
        let least = if axis.logarithmic { DECADES } else { (ROUNDING * size).max(SMALLEST) };
        let (from, to) = match to - from > least {
            true => (from, to),
            false if axis.logarithmic => (from - 0.5, to + 0.5),
            false if size <= SMALLEST => (-1.0, 1.0),
            false => (from - 0.1 * from.abs(), to + 0.1 * to.abs()),
        };
        let unit = unit_after(&axis.unit).trim_start().to_owned();
        Scale { name: axis.name.clone(), unit, logarithmic: axis.logarithmic, from, to }
    }

    /// The same with some room at both ends.
    pub fn with_room(self) -> Scale {
        let room = 0.05 * (self.to - self.from);
        Scale { from: self.from - room, to: self.to + room, ..self }
    }

    /// The place of a value, from 0 to 1 on the axis; not a number, if it cannot be shown.
    pub fn at(&self, value: f64) -> f64 {
        let shown = if self.logarithmic { value.log10() } else { value };
        (shown - self.from) / (self.to - self.from)
    }

    /// Exponent of the power of ten that labels are multiples of; it is a multiple of three.
    fn exponent(&self) -> i32 {
        let base = self.base();
        let size = (self.from - base).abs().max((self.to - base).abs());
        match (1e-2..1e5).contains(&size) {
            true => 0,
            false => (size.log10() / 3.0).floor() as i32 * 3,
        }
    }

    /// The round number that labels count from; zero, unless the range is far from there.
    fn base(&self) -> f64 {
        let (span, size) = (self.to - self.from, self.from.abs().max(self.to.abs()));
        if self.logarithmic || span > NARROW * size {
            return 0.0;
        }
        let power = 10f64.powf(span.log10().floor() + 1.0);
        (self.from / power).floor() * power
    }

    /// Name, base and unit, as written beside the axis.
    pub fn title(&self) -> String {
        let factor = match self.exponent() {
            _ if self.logarithmic => String::new(),
            0 => String::new(),
            exponent => format!("1e{exponent} "),
        };
        let base = match self.base() {
            0.0 => String::new(),
            base => format!(", above {}", exact(base)),
        };
        let name = cut(&self.name, LETTERS);
        match factor.len() + self.unit.len() {
            0 => format!("{name}{base}"),
            _ => format!("{name}{base} ({})", format!("{factor}{}", self.unit).trim_end()),
        }
    }

    /// Some five round values.
    pub fn ticks(&self) -> Vec<Tick> {
        if self.logarithmic {
            return self.powers();
        }
        let (factor, base) = (10f64.powi(self.exponent()), self.base());
        let (from, to) = ((self.from - base) / factor, (self.to - base) / factor);
        let step = round_step((to - from) / 5.0);
        let decimals = (-step.log10().floor()).max(0.0) as usize;
        let first = (from / step).ceil();
        let count = ((to / step).floor() - first).max(0.0) as usize + 1;
        let value = |i: usize| (first + i as f64) * step;
        let label = |value: f64| {
            let label = format!("{value:.decimals$}");
            // The sign of a typographer; a zero has none.
            if label.trim_matches(['-', '0', '.']).is_empty() { "0".to_owned() } else { label.replace('-', "−") }
        };
        (0..count.min(12)).map(|i| Tick { at: (value(i) - from) / (to - from), label: label(value(i)) }).collect()
    }

    /// Powers of ten, and 2 and 5 times them where there are few.
    fn powers(&self) -> Vec<Tick> {
        let decades = self.to - self.from;
        let step = round_step(decades / 6.0).max(1.0);
        let parts: &[f64] = if decades < 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let mut ticks = vec![];
        let mut power = (self.from / step).floor() * step;
        while power <= self.to && ticks.len() < 20 {
            for part in parts {
                let shown = power + part.log10();
                if (self.from..=self.to).contains(&shown) {
                    let at = (shown - self.from) / decades;
                    ticks.push(Tick { at, label: power_label(*part, power as i32) });
                }
            }
            power += step;
        }
        ticks
    }
}

fn power_label(part: f64, power: i32) -> String {
    match power {
        -3..=3 => format!("{}", part * 10f64.powi(power)).chars().take(6).collect(),
        _ => format!("{part}e{power}").replace('-', "−"),
    }
}

/// The next of 1, 2, 5, 10, ... that is not smaller.
pub(super) fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let part = step / power;
    let round = [1.0, 2.0, 5.0].into_iter().find(|round| part <= *round * (1.0 + 1e-9)).unwrap_or(10.0);
    round * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(from: f64, to: f64) -> (String, Vec<String>) {
        let scale = Scale::new(&Axis::new("y", "m"), Some((from, to)));
        (scale.title(), scale.ticks().into_iter().map(|tick| tick.label).collect())
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(
            labels(0.0, 0.24),
            ("y (m)".into(), vec!["0".into(), "0.05".into(), "0.10".into(), "0.15".into(), "0.20".into()])
        );
        assert_eq!(labels(-1.0, 1.0).1, ["−1.0", "−0.5", "0", "0.5", "1.0"]);
        assert_eq!(
            labels(-2e-4, 3e-4),
            ("y (1e-6 m)".into(), ["−200", "−100", "0", "100", "200", "300"].map(String::from).into())
        );
        // A ratio has no unit.
        let ratio = |to: f64| Scale::new(&Axis::new("gain", "1"), Some((0.0, to))).title();
        assert_eq!([ratio(2.0), ratio(2e6)], ["gain", "gain (1e6)"]);
        for (from, to) in [
            (0.0, 0.0),
            (3.0, 3.0),
            (-1e300, 1e300),
            (1e9, 1e9 + 5.0),
            (f64::NAN, 1.0),
            (1e-312, 3e-310),
            (f64::MIN, f64::MAX),
        ] {
            let scale = Scale::new(&Axis::new("t", "s"), Some((from, to)));
            let ticks = scale.ticks();
            assert!(
                !scale.title().contains("not a number") && ticks.iter().all(|tick| tick.label.len() < 12),
                "{scale:?}"
            );
            assert!(ticks.len() >= 2 && ticks.iter().all(|tick| (-1e-9..=1.0 + 1e-9).contains(&tick.at)), "{scale:?}");
        }
    }

    /// A range far from zero is written as what is above a round number; its values are told apart.
    #[test]
    fn a_range_far_from_zero_is_no_point() {
        let (title, ticks) = labels(1.76e9, 1.76e9 + 4.0);
        assert_eq!((title.as_str(), ticks.join(" ").as_str()), ("y, above 1760000000 (m)", "0 1 2 3 4"));
        let (title, ticks) = labels(-7.000_03e6, -7e6);
        assert_eq!((title.as_str(), ticks.len()), ("y, above -7000100 (m)", 4), "{ticks:?}");
        assert!(ticks.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn powers_of_ten_are_marked() {
        let scale = |from, to| Scale::new(&Axis::new("y", "").logarithmic(), Some((from, to)));
        let label = |from, to| scale(from, to).ticks().into_iter().map(|tick| tick.label).collect::<Vec<_>>().join(" ");
        assert_eq!(label(1e-6, 1e2), "1e−6 1e−4 0.01 1 100");
        assert_eq!(label(0.9, 6.0), "1 2 5");
        assert_eq!(label(3e-3, 3e-2), "0.005 0.01 0.02");
        assert!((scale(1e-2, 1e2).at(1.0) - 0.5).abs() < 1e-12 && scale(1e-2, 1e2).at(0.0) == f64::NEG_INFINITY);
    }
}
