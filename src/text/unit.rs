//! [`Unit`]: a unit as powers of base units, with its size.
//!
//! Symbols and prefixes are those of the SI (BIPM, *The International System of Units*, 9th ed., 2019), with what measurement
//! files use besides. An angle in radians and a ratio have no dimension; a degree and a percent differ from them in size only, a
//! degree Celsius is a kelvin.

use super::remark::Error;
use core::f64::consts::PI;
use core::fmt;
use std::collections::BTreeMap;

/// Powers of base units, and how many of their product it is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unit {
    /// By the symbol of the base unit; none is zero.
    powers: BTreeMap<String, f64>,
    /// `None` where a number of unknown unit has entered, such as a factor of conversion.
    pub factor: Option<f64>,
}

/// Powers that differ by less are equal: they are thirds and halves.
const SAME_POWER: f64 = 1e-9;
/// Sizes that differ by less are equal.
const SAME_SIZE: f64 = 1e-9;

/// Symbol, whether prefixes go with it, size, powers of kg, m, s, A, K, mol, cd.
type Known = (&'static str, bool, f64, [i8; 7]);

const BASES: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

#[rustfmt::skip]
const UNITS: &[Known] = &[
    ("m", true, 1.0, [0, 1, 0, 0, 0, 0, 0]), ("g", true, 1e-3, [1, 0, 0, 0, 0, 0, 0]), ("s", true, 1.0, [0, 0, 1, 0, 0, 0, 0]),
    ("A", true, 1.0, [0, 0, 0, 1, 0, 0, 0]), ("K", true, 1.0, [0, 0, 0, 0, 1, 0, 0]), ("mol", true, 1.0, [0, 0, 0, 0, 0, 1, 0]),
    ("cd", true, 1.0, [0, 0, 0, 0, 0, 0, 1]), ("V", true, 1.0, [1, 2, -3, -1, 0, 0, 0]), ("ohm", true, 1.0, [1, 2, -3, -2, 0, 0, 0]),
    ("\u{3a9}", true, 1.0, [1, 2, -3, -2, 0, 0, 0]), ("\u{2126}", true, 1.0, [1, 2, -3, -2, 0, 0, 0]), ("Ohm", true, 1.0, [1, 2, -3, -2, 0, 0, 0]),
    ("S", true, 1.0, [-1, -2, 3, 2, 0, 0, 0]), ("H", true, 1.0, [1, 2, -2, -2, 0, 0, 0]), ("F", true, 1.0, [-1, -2, 4, 2, 0, 0, 0]),
    ("C", true, 1.0, [0, 0, 1, 1, 0, 0, 0]), ("Wb", true, 1.0, [1, 2, -2, -1, 0, 0, 0]), ("T", true, 1.0, [1, 0, -2, -1, 0, 0, 0]),
    ("N", true, 1.0, [1, 1, -2, 0, 0, 0, 0]), ("Nm", true, 1.0, [1, 2, -2, 0, 0, 0, 0]), ("J", true, 1.0, [1, 2, -2, 0, 0, 0, 0]),
    ("W", true, 1.0, [1, 2, -3, 0, 0, 0, 0]), ("VA", true, 1.0, [1, 2, -3, 0, 0, 0, 0]), ("var", true, 1.0, [1, 2, -3, 0, 0, 0, 0]),
    ("Pa", true, 1.0, [1, -1, -2, 0, 0, 0, 0]), ("bar", true, 1e5, [1, -1, -2, 0, 0, 0, 0]), ("atm", false, 101_325.0, [1, -1, -2, 0, 0, 0, 0]),
    ("psi", false, 6_894.757_293_168, [1, -1, -2, 0, 0, 0, 0]), ("Hz", true, 1.0, [0, 0, -1, 0, 0, 0, 0]), ("Bq", true, 1.0, [0, 0, -1, 0, 0, 0, 0]),
    ("Wh", true, 3600.0, [1, 2, -2, 0, 0, 0, 0]), ("Ah", true, 3600.0, [0, 0, 1, 1, 0, 0, 0]), ("eV", true, 1.602_176_634e-19, [1, 2, -2, 0, 0, 0, 0]),
    ("cal", true, 4.184, [1, 2, -2, 0, 0, 0, 0]), ("l", true, 1e-3, [0, 3, 0, 0, 0, 0, 0]), ("L", true, 1e-3, [0, 3, 0, 0, 0, 0, 0]),
    ("M", true, 1e3, [0, -3, 0, 0, 0, 1, 0]), ("t", true, 1e3, [1, 0, 0, 0, 0, 0, 0]), ("min", false, 60.0, [0, 0, 1, 0, 0, 0, 0]),
    ("h", false, 3600.0, [0, 0, 1, 0, 0, 0, 0]), ("hr", false, 3600.0, [0, 0, 1, 0, 0, 0, 0]), ("d", false, 86_400.0, [0, 0, 1, 0, 0, 0, 0]),
    ("day", false, 86_400.0, [0, 0, 1, 0, 0, 0, 0]), ("a", false, 31_557_600.0, [0, 0, 1, 0, 0, 0, 0]), ("lm", true, 1.0, [0, 0, 0, 0, 0, 0, 1]),
    ("lx", true, 1.0, [0, -2, 0, 0, 0, 0, 1]), ("in", false, 0.0254, [0, 1, 0, 0, 0, 0, 0]), ("ft", false, 0.3048, [0, 1, 0, 0, 0, 0, 0]),
    ("lb", false, 0.453_592_37, [1, 0, 0, 0, 0, 0, 0]), ("kph", false, 1.0 / 3.6, [0, 1, -1, 0, 0, 0, 0]), ("degC", false, 1.0, [0, 0, 0, 0, 1, 0, 0]),
    ("°C", false, 1.0, [0, 0, 0, 0, 1, 0, 0]), ("℃", false, 1.0, [0, 0, 0, 0, 1, 0, 0]), ("degF", false, 5.0 / 9.0, [0, 0, 0, 0, 1, 0, 0]),
    ("rad", true, 1.0, [0; 7]), ("sr", false, 1.0, [0; 7]), ("deg", false, PI / 180.0, [0; 7]), ("°", false, PI / 180.0, [0; 7]),
    ("rev", false, 2.0 * PI, [0; 7]), ("turn", false, 2.0 * PI, [0; 7]), ("rpm", false, PI / 30.0, [0, 0, -1, 0, 0, 0, 0]),
    ("%", false, 1e-2, [0; 7]), ("ppm", false, 1e-6, [0; 7]), ("pu", false, 1.0, [0; 7]),
];

const PREFIXES: [(&str, f64); 25] = [
    ("da", 1e1),
    ("Q", 1e30),
    ("R", 1e27),
    ("Y", 1e24),
    ("Z", 1e21),
    ("E", 1e18),
    ("P", 1e15),
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("h", 1e2),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
    ("f", 1e-15),
    ("a", 1e-18),
    ("z", 1e-21),
    ("y", 1e-24),
    ("r", 1e-27),
];

/// Names for what an expression comes to.
const NAMED: [&str; 11] = ["V", "ohm", "H", "Wb", "N", "J", "W", "Pa", "F", "T", "S"];
/// What may stand beside such a name.
const BY: [&str; 9] = ["/s", " s", "/m", " m", "/A", " A", "/K", "^2", "/s^2"];

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

/// How many of the unit `to` one of the unit `from` is: `factor("rpm", "rad/s")` is 0.1047. Of degrees Celsius it is that of
/// their differences.
///
/// # Errors
/// A text that is no unit, units of different dimensions.
///
/// ```
/// use greybox::text::factor;
/// assert!((factor("rpm", "rad/s")? - 0.104_719_755).abs() < 1e-9);
/// assert_eq!(factor("mA", "V").unwrap_err().to_string(), "`mA` is in A, `V` is in V; neither is a multiple of the other");
/// # Ok::<(), greybox::text::Error>(())
/// ```
pub fn factor(from: &str, to: &str) -> Result<f64, Error> {
    let read = |text: &str| {
        Unit::read(text, &BTreeMap::new()).map_err(|no| {
            Error::Unit(match no {
                NoUnit::Unknown(symbol) => format!("unit `{text}`: `{symbol}` is not known"),
                NoUnit::Wrong(wrong) => format!("unit `{text}`: {wrong}"),
            })
        })
    };
    let (a, b) = (read(from)?, read(to)?);
    match a.factor.zip(b.factor) {
        Some((one, other)) if a.same_dimension(&b) => Ok(one / other),
        _ => {
            let [a, b] = [a, b].map(|unit| Unit { factor: Some(1.0), ..unit });
            Err(Error::Unit(format!("`{from}` is in {a}, `{to}` is in {b}; neither is a multiple of the other")))
        }
    }
}

/// Why a text is no unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NoUnit {
    /// A symbol that nobody has declared.
    Unknown(String),
    Wrong(String),
}

struct Reader<'a> {
    rest: &'a str,
    own: &'a BTreeMap<String, Unit>,
    depth: usize,
}

impl Reader<'_> {
    fn sign(&mut self, signs: &[&str]) -> bool {
        let rest = self.rest.trim_start();
        let sign = signs.iter().find(|sign| rest.starts_with(**sign));
        self.rest = sign.map_or(self.rest, |sign| &rest[sign.len()..]);
        sign.is_some()
    }

    fn product(&mut self) -> Result<Unit, NoUnit> {
        let mut unit = self.factor()?;
        loop {
            unit = if self.sign(&["/"]) {
                unit.over(&self.factor()?)
            } else if self.sign(&["*", "·", "⋅", "."]) {
                unit.times(&self.factor()?)
            } else if self.rest.trim_start().is_empty() || self.rest.trim_start().starts_with(')') {
                return Ok(unit);
            } else {
                unit.times(&self.factor()?)
            }
        }
    }

    fn factor(&mut self) -> Result<Unit, NoUnit> {
        let unit = self.atom()?;
        let raised = self.sign(&["**", "^"]);
        let rest = if raised { self.rest.trim_start() } else { self.rest };
        for (superscript, power) in [("²", 2.0), ("³", 3.0), ("⁻¹", -1.0), ("⁻²", -2.0)] {
            if let Some(rest) = rest.strip_prefix(superscript) {
                self.rest = rest;
                return Ok(unit.power(power));
            }
        }
        if !raised {
            return Ok(unit);
        }
        let wrong = NoUnit::Wrong(format!("`^{rest}` is no power"));
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let (power, after) = match rest.strip_prefix('(').map(|inner| inner.split_once(')')) {
            Some(Some((inner, after))) => match inner.split_once('/') {
                Some((a, b)) => (number(a).zip(number(b)).map(|(a, b)| a / b), after),
                None => (number(inner), after),
            },
            Some(None) => return Err(wrong),
            None => {
                let sign = usize::from(rest.starts_with(['-', '+']));
                let digits = rest[sign..].find(|c: char| !c.is_ascii_digit() && c != '.');
                let (power, after) = rest.split_at(digits.map_or(rest.len(), |end| sign + end));
                (number(power), after)
            }
        };
        self.rest = after;
        power.filter(|power| power.abs() <= 100.0).map(|power| unit.power(power)).ok_or(wrong)
    }

    /// A symbol, a number, or a unit in parentheses.
    fn atom(&mut self) -> Result<Unit, NoUnit> {
        let rest = self.rest.trim_start();
        if let Some(inner) = rest.strip_prefix('(') {
            self.depth += 1;
            if self.depth > 20 {
                return Err(NoUnit::Wrong("a unit is nested more than 20 deep".to_owned()));
            }
            self.rest = inner;
            let unit = self.product()?;
            self.depth -= 1;
            return match self.sign(&[")"]) {
                true => Ok(unit),
                false => Err(NoUnit::Wrong("a parenthesis of the unit is not closed".to_owned())),
            };
        }
        let is_number = rest.starts_with(|c: char| c.is_ascii_digit());
        let numeral = |c: char| c.is_ascii_digit() || c == '.' || c == 'e';
        let mut end = match is_number {
            true => rest.find(|c: char| !numeral(c)).unwrap_or(rest.len()),
            false => rest.find(|c: char| !c.is_alphabetic() && !"_%°".contains(c)).unwrap_or(rest.len()),
        };
        if is_number && rest[..end].ends_with('e') && rest[end..].starts_with(['-', '+']) {
            end = rest[end + 1..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |n| end + 1 + n);
        }
        let (symbol, after) = rest.split_at(end);
        if symbol.is_empty() {
            let wrong = if rest.is_empty() {
                "the unit ends where a symbol should follow".to_owned()
            } else {
                format!("`{rest}` has no meaning in a unit")
            };
            return Err(NoUnit::Wrong(wrong));
        }
        self.rest = after;
        if is_number {
            return match symbol.parse::<f64>() {
                Ok(value) if value > 0.0 && value.is_finite() => Ok(Unit { factor: Some(value), ..Unit::one() }),
                _ => Err(NoUnit::Wrong(format!("`{symbol}` is no number"))),
            };
        }
        self.symbol(symbol).ok_or_else(|| NoUnit::Unknown(symbol.to_owned()))
    }

    fn symbol(&self, symbol: &str) -> Option<Unit> {
        if let Some(own) = self.own.get(symbol) {
            return Some(own.clone());
        }
        if let Some(known) = UNITS.iter().find(|known| known.0 == symbol) {
            return Some(known_unit(known, 1.0));
        }
        let with = |(prefix, size): &(&str, f64)| {
            let rest = symbol.strip_prefix(prefix)?;
            let known = UNITS.iter().find(|known| known.1 && known.0 == rest)?;
            Some(known_unit(known, *size))
        };
        PREFIXES.iter().find_map(with)
    }
}

fn known_unit((_, _, factor, powers): &Known, prefix: f64) -> Unit {
    let powers = BASES.iter().zip(powers).filter(|(_, power)| **power != 0);
    let powers = powers.map(|(base, power)| ((*base).to_owned(), f64::from(*power))).collect();
    Unit { powers, factor: Some(factor * prefix) }
}

impl fmt::Display for Unit {
    /// By a name that it has, as `V` or `ohm/s`, else by base units.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let none = BTreeMap::new();
        let is = |text: &str| Unit::read(text, &none).is_ok_and(|unit| unit.same_dimension(self));
        if let Some(factor) = self.factor.filter(|factor| (factor - 1.0).abs() >= SAME_SIZE) {
            write!(f, "{} ", crate::numeral::number(factor, 6))?;
        }
        if self.powers.is_empty() {
            return f.write_str("1");
        }
        let named = NAMED.iter().map(|name| (*name).to_owned()).find(|name| is(name));
        let composed =
            || BY.iter().flat_map(|by| NAMED.iter().map(move |name| format!("{name}{by}"))).find(|text| is(text));
        // Of one or two base units, these say it best.
        let few = self.powers.len() <= 2;
        let text = named.or_else(|| if few { None } else { composed() }).unwrap_or_else(|| self.by_bases());
        f.write_str(&text)
    }
}

impl Unit {
    fn by_bases(&self) -> String {
        let one = |(base, power): (&String, f64)| match power == 1.0 {
            true => base.clone(),
            false => format!("{base}^{}", crate::numeral::number(power, 3)),
        };
        let over: Vec<String> =
            self.powers.iter().filter(|(_, power)| **power > 0.0).map(|(base, power)| one((base, *power))).collect();
        let under: Vec<String> =
            self.powers.iter().filter(|(_, power)| **power < 0.0).map(|(base, power)| one((base, -*power))).collect();
        let over = if over.is_empty() { "1".to_owned() } else { over.join(" ") };
        match under.as_slice() {
            [] => over,
            [single] => format!("{over}/{single}"),
            several => format!("{over}/({})", several.join(" ")),
        }
    }
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
