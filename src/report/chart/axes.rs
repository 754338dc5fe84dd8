//! Axes: a range, round numbers in it, and how they are written.

/// A linear axis.
#[derive(Clone, Debug)]
pub(in crate::report) struct Axis {
    /// What it shows.
    pub name: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// Least value shown.
    pub from: f64,
    /// Greatest value shown.
    pub to: f64,
}

/// A marked value of an axis.
pub(super) struct Tick {
    /// Its place, from 0 to 1.
    pub at: f64,
    /// How it is written, in units of the axis' [`factor`](Axis::factor).
    pub label: String,
}

impl Axis {
    /// An axis that shows the whole range, and something at all if that is empty.
    pub(in crate::report) fn new(name: &str, unit: &str, range: Option<(f64, f64)>) -> Axis {
        let (from, to) = range.filter(|(from, to)| from.is_finite() && to.is_finite()).unwrap_or((0.0, 1.0));
        let least = f64::EPSILON.sqrt() * from.abs().max(to.abs());
        let (from, to) = match to - from > least.max(f64::MIN_POSITIVE) {
            true => (from, to),
            false if from == 0.0 => (-1.0, 1.0),
            false => (from - 0.1 * from.abs(), to + 0.1 * to.abs()),
        };
        Axis { name: name.to_owned(), unit: unit.to_owned(), from, to }
    }

    /// The same with some room at both ends.
    pub(in crate::report) fn with_room(self) -> Axis {
        let room = 0.05 * (self.to - self.from);
        Axis { from: self.from - room, to: self.to + room, ..self }
    }

    /// The place of a value, from 0 to 1 on the axis.
    pub(super) fn at(&self, value: f64) -> f64 {
        (value - self.from) / (self.to - self.from)
    }

    /// The power of ten, a multiple of three, that labels are written in.
    pub(super) fn factor(&self) -> f64 {
        10f64.powi(self.exponent())
    }

    fn exponent(&self) -> i32 {
        let size = self.from.abs().max(self.to.abs());
        match (1e-2..1e5).contains(&size) {
            true => 0,
            false => (size.log10() / 3.0).floor() as i32 * 3,
        }
    }

    /// Name and unit, as written beside the axis.
    pub(super) fn title(&self) -> String {
        let factor = match self.exponent() {
            0 => String::new(),
            exponent => format!("1e{exponent} "),
        };
        match factor.len() + self.unit.len() {
            0 => self.name.clone(),
            _ => format!("{} ({})", self.name, format!("{factor}{}", self.unit).trim_end()),
        }
    }

    /// Some five round values.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        let (from, to) = (self.from / self.factor(), self.to / self.factor());
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
        let axis = Axis::new("y", "m", Some((from, to)));
        (axis.title(), axis.ticks().into_iter().map(|tick| tick.label).collect())
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
        for (from, to) in [(0.0, 0.0), (3.0, 3.0), (-1e300, 1e300), (1e9, 1e9 + 5.0), (f64::NAN, 1.0)] {
            let axis = Axis::new("t", "s", Some((from, to)));
            let ticks = axis.ticks();
            assert!(ticks.len() >= 2 && ticks.iter().all(|tick| (-1e-9..=1.0 + 1e-9).contains(&tick.at)), "{axis:?}");
        }
    }
}
