//! [`Unit`]: a unit as powers of base units, with its size.
//!
//! Symbols and prefixes are those of the SI (BIPM, *The International System of Units*, 9th ed., 2019), with what measurement
//! files use besides. An angle in radians and a ratio have no dimension; a degree and a percent differ from them in size only, a
//! degree Celsius is a kelvin.

mod display;
mod known;
mod read;
mod relation;

pub(crate) use relation::{Relation, relation};

use read::Reader;
use std::collections::BTreeMap;

/// Powers of base units, and how many of their product it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unit {
    /// By the symbol of the base unit; none is zero.
    powers: BTreeMap<String, f64>,
    /// `None` where a number of unknown unit has entered, such as a factor of conversion.
    pub factor: Option<f64>,
}

/// Powers that differ by less are equal: they are thirds and halves.
const SAME_POWER: f64 = 1e-9;
/// Sizes that differ by less are equal.
const SAME_SIZE: f64 = 1e-9;

impl Unit {
    /// A ratio.
    pub fn one() -> Self {
        Unit { powers: BTreeMap::new(), factor: Some(1.0) }
    }

    /// The second.
    pub fn second() -> Self {
        Unit::base("s")
    }

    /// A unit of its own.
    pub fn base(symbol: &str) -> Self {
        Unit { powers: BTreeMap::from([(symbol.to_owned(), 1.0)]), factor: Some(1.0) }
    }

    /// Reads a unit such as `V s/rad`, `kg m^2`, `J/(kg K)`, `1/s` or `""`: a space, `*` or `·` multiplies, `/` divides by what comes
    /// next. The error is the symbol that is not known, or what is wrong.
    pub fn read(text: &str, own: &BTreeMap<String, Unit>) -> Result<Unit, NoUnit> {
        let mut reader = Reader { rest: text, own, depth: 0 };
        let unit = if text.trim().is_empty() { Unit::one() } else { reader.product()? };
        match reader.rest.trim() {
            "" => Ok(unit),
            rest => Err(NoUnit::Wrong(format!("`{rest}` has no meaning in a unit"))),
        }
    }

    pub fn times(&self, other: &Unit) -> Unit {
        self.with(other, 1.0)
    }

    pub fn over(&self, other: &Unit) -> Unit {
        self.with(other, -1.0)
    }

    fn with(&self, other: &Unit, sign: f64) -> Unit {
        let mut powers = self.powers.clone();
        for (base, power) in &other.powers {
            *powers.entry(base.clone()).or_default() += sign * power;
        }
        powers.retain(|_, power| power.abs() > SAME_POWER);
        let factor = self.factor.zip(other.factor).map(|(a, b)| if sign > 0.0 { a * b } else { a / b });
        Unit { powers, factor }
    }

    pub fn power(&self, n: f64) -> Unit {
        let mut powers = self.powers.clone();
        powers.values_mut().for_each(|power| *power *= n);
        powers.retain(|_, power| power.abs() > SAME_POWER);
        Unit { powers, factor: self.factor.map(|factor| factor.powf(n)) }
    }

    /// This dimension in units of its base.
    pub fn of_size_one(self) -> Unit {
        Unit { factor: Some(1.0), ..self }
    }

    /// This dimension in a size that is not known.
    pub fn of_any_size(self) -> Unit {
        Unit { factor: None, ..self }
    }

    pub fn same_dimension(&self, other: &Unit) -> bool {
        self.over(other).powers.is_empty()
    }

    /// Whether it is as large as another of its dimension, as far as that is known.
    pub fn same_size(&self, other: &Unit) -> bool {
        match (self.factor, other.factor) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() < SAME_SIZE,
            _ => true,
        }
    }

    pub fn is_dimensionless(&self) -> bool {
        self.powers.is_empty()
    }
}

/// Why a text is no unit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NoUnit {
    /// A symbol that nobody has declared.
    Unknown(String),
    Wrong(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(text: &str) -> Unit {
        Unit::read(text, &BTreeMap::from([("pulse".to_owned(), Unit::base("pulse"))]))
            .unwrap_or_else(|no| panic!("{text}: {no:?}"))
    }

    #[test]
    fn units_that_are_one() {
        for (a, b) in [
            ("V s/rad", "Wb"),
            ("kg m^2", "N m s^2"),
            ("J/(kg K)", "J kg^-1 K^-1"),
            ("mH", "1e-3 H"),
            ("rpm", "rev/min"),
            ("deg", "°"),
            ("%", "0.01"),
            ("bar", "100 kPa"),
            ("km/h", "kph"),
            ("µs", "us"),
            ("kohm", "1000 V/A"),
            ("", "1"),
            ("m**2", "m²"),
            ("W/m^2", "W / m^2"),
            ("N·m", "Nm"),
            ("V/s^0.5", "V s^(-1/2)"),
            ("pulse/s", "Hz pulse"),
            ("Ah", "3600 C"),
            ("degC", "K"),
            ("dam", "10 m"),
            ("cd", "cd"),
            ("min", "60 s"),
            ("1/s", "s^-1"),
            ("m/s2", "m/s^2"),
            ("m3/h", "m^3/h"),
            ("cm3", "1e-6 m^3"),
            ("min-1", "1/min"),
            ("kg m2", "kg m^2"),
        ] {
            let (a, b) = (unit(a), unit(b));
            assert!(a.same_dimension(&b) && a.same_size(&b), "{a:?} {b:?}");
        }
    }

    #[test]
    fn texts_that_are_no_units() {
        for (text, symbol) in [("V/sqrt", "sqrt"), ("glorp", "glorp"), ("kmin", "kmin")] {
            assert_eq!(Unit::read(text, &BTreeMap::new()), Err(NoUnit::Unknown(symbol.to_owned())));
        }
        for text in ["V/", "m^x", "(m", "m)", "0 V", "m^(1/0)", &"(".repeat(1000)] {
            assert!(matches!(Unit::read(text, &BTreeMap::new()), Err(NoUnit::Wrong(_))), "{text}");
        }
    }

    #[test]
    fn units_by_name() {
        for (text, expected) in [
            ("ohm A", "V"),
            ("V/s", "V/s"),
            ("kg m^2", "kg m^2"),
            ("ohm rad/s", "ohm/s"),
            ("mV", "0.001 V"),
            ("1", "1"),
            ("pulse/s", "pulse/s"),
            ("K^0.5", "K^0.5"),
            ("kg/(m s K)", "kg/(K m s)"),
            ("s^-1", "1/s"),
        ] {
            assert_eq!(unit(text).to_string(), expected);
        }
    }
}
