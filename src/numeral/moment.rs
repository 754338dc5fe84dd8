//! [`TimeUnit`] and [`Moment`]: times in the unit in which their record was taken.

use super::{EXACT, number, unit_after};
use core::fmt;
use serde::{Deserialize, Serialize};

/// The unit in which the times of a record are shown. They are kept in the time of the model's equations, mostly seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeUnit {
    name: Box<str>,
    size: f64,
}

impl Default for TimeUnit {
    /// Seconds, as those of the model.
    fn default() -> Self {
        TimeUnit { name: "s".into(), size: 1.0 }
    }
}

#[cfg_attr(not(feature = "csv"), allow(dead_code, reason = "files have units"))]
impl TimeUnit {
    /// The unit of the model's time itself, where that is not the second: minutes of a model whose rates are per minute.
    pub fn of_model(name: impl Into<String>) -> Self {
        let name: String = name.into();
        TimeUnit { name: name.into(), size: 1.0 }
    }

    /// A unit by its name, of so many seconds of the model's time.
    pub(crate) fn of_seconds(name: &'static str, size: f64) -> Self {
        TimeUnit { name: name.into(), size }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its size in the model's time.
    pub(crate) fn seconds(&self) -> f64 {
        self.size
    }

    /// A time, or a length of time, in this unit.
    pub fn convert(&self, time: f64) -> f64 {
        time / self.size
    }

    /// A time, or a length of time, with so many digits and the unit behind it.
    pub(crate) fn say(&self, time: f64, digits: usize) -> String {
        format!("{}{}", number(self.convert(time), digits), unit_after(&self.name))
    }

    /// The name of the model's own unit of time.
    pub(crate) fn base(&self) -> &str {
        if self.size == 1.0 { &self.name } else { "s" }
    }

    /// The unit of frequencies, which are those of the model's time.
    pub(crate) fn frequency(&self) -> String {
        if self.base() == "s" { "Hz".to_owned() } else { format!("1/{}", self.base()) }
    }

    /// The unit of angular frequencies, which are those of the model's time.
    pub(crate) fn angular_frequency(&self) -> String {
        format!("rad/{}", self.base())
    }
}

/// A time of a record, as it is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// In the time of the model's equations.
    pub time: f64,
    /// How it is shown.
    pub unit: TimeUnit,
}

impl From<f64> for Moment {
    /// A time in seconds.
    fn from(time: f64) -> Self {
        Moment { time, unit: TimeUnit::default() }
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.unit.say(self.time, EXACT))
    }
}

#[cfg(test)]
mod tests {
    use super::{Moment, TimeUnit};

    /// Two hours are 120 min of 60 s; 7 ms are 7, without the rounding of a division.
    #[test]
    fn times_in_their_unit() {
        let (minutes, milliseconds) = (TimeUnit::of_seconds("min", 60.0), TimeUnit::of_seconds("ms", 1e-3));
        assert_eq!([minutes.say(7200.0, 15), milliseconds.say(7e-3, 15)], ["120 min", "7 ms"]);
        assert_eq!(Moment::from(0.5).to_string(), "0.5 s");
        assert_eq!(TimeUnit::of_model("1").say(3.0, 2), "3");
    }

    /// Frequencies are those of the model's time: seconds where a file's minutes were converted, else its own.
    #[test]
    fn frequencies_are_of_the_models_time() {
        let units = [TimeUnit::default(), TimeUnit::of_seconds("min", 60.0), TimeUnit::of_model("min")];
        assert_eq!(units.each_ref().map(TimeUnit::frequency), ["Hz", "Hz", "1/min"]);
        assert_eq!(units.each_ref().map(TimeUnit::angular_frequency), ["rad/s", "rad/s", "rad/min"]);
    }
}
