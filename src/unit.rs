//! [`Unit`]: a unit as powers of base units, with its size.
//!
//! Symbols and prefixes are those of the SI (BIPM, *The International System of Units*, 9th ed., 2019), with what measurement
//! files use besides. An angle in radians and a ratio have no dimension; a degree and a percent differ from them in size only, a
//! degree Celsius is a kelvin.

mod display;
mod known;
mod read;

use read::Reader;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

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

/// How a column's unit stands to that of the signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Relation {
    /// Both are as large.
    Same,
    /// So many of the signal's is one of the column's.
    Factor(f64),
    /// Scales of temperature with other zeros: a number of the signal is `factor` times that of the column, plus `shift`.
    OtherZero { factor: f64, shift: f64 },
    /// Both are known, and neither is a multiple of the other.
    Other,
    /// One of them is not known, or says too little: no unit, a ratio, a number, a word such as `in`.
    Unknown,
}

/// How files write some units, in small letters.
const WRITTEN: [(&str, &str); 12] = [
    ("hz", "Hz"),
    ("rpm", "rpm"),
    ("u/min", "rpm"),
    ("r/min", "rpm"),
    ("rev/min", "rpm"),
    ("rps", "rev/s"),
    ("pa", "Pa"),
    ("bar", "bar"),
    ("deg", "deg"),
    ("deg/s", "deg/s"),
    ("km/h", "km/h"),
    ("l/min", "l/min"),
];

/// Units that stand in brackets as words, too: `u(t)`, `p (in)`, `T (min)`. They count as units where the dimension is right.
const WORDS: [&str; 6] = ["a", "d", "h", "in", "min", "t"];

/// Scales of temperature: where they begin and the size of their degree, both in kelvins.
const TEMPERATURES: [(&[&str], f64, f64); 4] = [
    (&["K"], 0.0, 1.0),
    (&["mK"], 0.0, 1e-3),
    (&["degC", "°C", "℃"], 273.15, 1.0),
    (&["degF", "°F", "℉"], 459.67 / 1.8, 1.0 / 1.8),
];

/// How the unit `from` of a column stands to the unit `to` of a signal. Between a frequency (Hz, 1/min) and an angular velocity one revolution is
/// 2 pi rad, both ways; but a column in `rad/s` has the numbers of a signal in `1/s`.
pub(crate) fn relation(from: &str, to: &str) -> Relation {
    let (from, to) = (from.trim(), to.trim());
    // A number is an index: `AI[2]`.
    if from.is_empty() || to.is_empty() || (from != to && from.parse::<f64>().is_ok()) {
        return Relation::Unknown;
    }
    let written = WRITTEN.iter().find(|(file, _)| *file == from.to_lowercase());
    let temperature = |text: &str| TEMPERATURES.iter().find(|(names, ..)| names.contains(&text));
    let from = match written {
        Some((_, unit)) => unit,
        // A coulomb is no temperature.
        None if from == "C" && temperature(to).is_some() => "degC",
        None => from,
    };
    if from == to {
        return Relation::Same;
    }
    if let Some(((_, zero, degree), (_, zero_of_signal, of_signal))) = temperature(from).zip(temperature(to))
        && zero != zero_of_signal
    {
        return Relation::OtherZero { factor: degree / of_signal, shift: (zero - zero_of_signal) / of_signal };
    }
    let read = |text: &str| Unit::read(text, &BTreeMap::new()).ok();
    let Some((one, other)) = read(from).zip(read(to)) else { return Relation::Unknown };
    let Some((a, b)) = one.factor.zip(other.factor) else { return Relation::Unknown };
    if !one.same_dimension(&other) {
        // In letters of another size, such as `a` for amperes.
        let says_little = other.is_dimensionless() || from.eq_ignore_ascii_case(to) || WORDS.contains(&from);
        return if says_little { Relation::Unknown } else { Relation::Other };
    }
    let radians = from.contains("rad") && !to.contains("Hz") && one.same_size(&other);
    let turns = match (counts(from, &one), counts(to, &other)) {
        (true, false) if names_angle(to) => TAU,
        (false, true) if names_angle(from) && !radians => 1.0 / TAU,
        _ => 1.0,
    };
    let factor = a / b * turns;
    if (factor - 1.0).abs() < SAME_SIZE { Relation::Same } else { Relation::Factor(factor) }
}

/// Whether a text names the angle that its unit has.
fn names_angle(text: &str) -> bool {
    ["rad", "deg", "°", "rev", "turn", "rpm"].iter().any(|angle| text.contains(angle))
}

/// Whether a unit is a frequency or, in `Hz`, the rate of one, and its text names no angle. `1/s^2` is not asked: it is written for `rad/s^2`, too.
fn counts(text: &str, unit: &Unit) -> bool {
    let per_second = Unit::one().over(&Unit::second());
    let rate = unit.same_dimension(&per_second) || text.contains("Hz") && unit.same_dimension(&per_second.power(2.0));
    rate && !names_angle(text)
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

    /// A column of volts is no speed, in whatever unit the speed is; a ratio may stand for anything.
    #[test]
    fn units_of_columns() {
        for (from, to, expected) in [
            ("V", "V", Relation::Same),
            ("Nm", "N m", Relation::Same),
            ("C", "degC", Relation::Same),
            ("°C", "degC", Relation::Same),
            ("rad/s", "1/s", Relation::Same),
            ("mA", "A", Relation::Factor(1e-3)),
            ("RPM", "rad/s", Relation::Factor(TAU / 60.0)),
            ("Hz", "rad/s", Relation::Factor(TAU)),
            ("kHz", "rad/s", Relation::Factor(1e3 * TAU)),
            ("1/min", "rad/s", Relation::Factor(TAU / 60.0)),
            ("min-1", "rad/s", Relation::Factor(TAU / 60.0)),
            ("s^-1", "rad/s", Relation::Factor(TAU)),
            ("rev/s", "rad/s", Relation::Factor(TAU)),
            ("1/min", "rpm", Relation::Same),
            ("rpm", "1/min", Relation::Same),
            ("Hz", "rev/s", Relation::Same),
            ("rpm", "Hz", Relation::Factor(1.0 / 60.0)),
            ("Hz", "rpm", Relation::Factor(60.0)),
            ("Hz", "deg/s", Relation::Factor(360.0)),
            ("rad/s", "Hz", Relation::Factor(1.0 / TAU)),
            ("Hz/s", "rad/s^2", Relation::Factor(TAU)),
            ("rpm/s", "rad/s^2", Relation::Factor(TAU / 60.0)),
            ("1/s^2", "rad/s^2", Relation::Same),
            ("Deg/s", "rad/s", Relation::Factor(TAU / 360.0)),
            ("Bar", "Pa", Relation::Factor(1e5)),
            ("KM/H", "m/s", Relation::Factor(1.0 / 3.6)),
            ("deg/s", "rad/s", Relation::Factor(TAU / 360.0)),
            ("rad/min", "rad/s", Relation::Factor(1.0 / 60.0)),
            ("1/min", "Hz", Relation::Factor(1.0 / 60.0)),
            ("%", "1", Relation::Factor(1e-2)),
            ("m3/h", "m^3/s", Relation::Factor(1.0 / 3600.0)),
            ("mK", "K", Relation::Factor(1e-3)),
            ("K", "degC", Relation::OtherZero { factor: 1.0, shift: -273.15 }),
            ("mK", "degC", Relation::OtherZero { factor: 1e-3, shift: -273.15 }),
            ("°C", "K", Relation::OtherZero { factor: 1.0, shift: 273.15 }),
            ("V", "rad/s", Relation::Other),
            ("Nm", "rad/s", Relation::Other),
            ("V", "degC", Relation::Other),
            ("ticks", "rad/s", Relation::Unknown),
            ("V", "pulse", Relation::Unknown),
            ("V", "1", Relation::Unknown),
            ("", "V", Relation::Unknown),
            ("a", "A", Relation::Unknown),
            ("1", "V", Relation::Unknown),
            ("2", "1", Relation::Unknown),
            ("t", "V", Relation::Unknown),
            ("t", "kg", Relation::Factor(1e3)),
            ("in", "Pa", Relation::Unknown),
            ("%", "", Relation::Unknown),
        ] {
            match (relation(from, to), expected) {
                (Relation::Factor(found), Relation::Factor(expected)) => {
                    assert!((found / expected - 1.0).abs() < 1e-14, "{from} {to}: {found}");
                }
                (found, expected) => assert_eq!(found, expected, "{from} {to}"),
            }
        }
    }

    /// Water freezes at 32 and boils at 212 degrees Fahrenheit.
    #[test]
    fn scales_of_temperature() {
        for (from, to, pairs) in
            [("degF", "degC", [(32.0, 0.0), (212.0, 100.0)]), ("°C", "°F", [(0.0, 32.0), (-40.0, -40.0)])]
        {
            let Relation::OtherZero { factor, shift } = relation(from, to) else { panic!("{from} {to}") };
            // Differences of hundreds of kelvins, in double precision.
            assert!(pairs.iter().all(|(a, b)| (factor * a + shift - b).abs() < 1e-12), "{from} {to}");
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
