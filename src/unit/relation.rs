//! How the unit of a column stands to that of a signal, with what files leave open: the zero of a temperature, the angle of a rate.

use super::known::with_prefixes;
use super::{SAME_SIZE, Unit};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// How a column's unit stands to that of the signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Relation {
    /// Both are as large.
    Same,
    /// So many of the signal's is one of the column's.
    Factor(f64),
    /// Scales of temperature with other zeros: a number of the signal is `factor` times that of the column, plus `shift`.
    OtherZero { factor: f64, shift: f64 },
    /// A plain rate, such as 1/min, may count revolutions or radians: so many of the signal's is one of the column's.
    Ambiguous { revolutions: f64, radians: f64 },
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

/// Scales of temperature besides kelvins: where they begin and the size of their degree, both in kelvins.
const TEMPERATURES: [(&[&str], f64, f64); 2] =
    [(&["degC", "°C", "℃"], 273.15, 1.0), (&["degF", "°F", "℉"], 459.67 / 1.8, 1.0 / 1.8)];

/// Units of angle that count revolutions, how many rad they are, and powers of the second.
const REVOLUTIONS: [(&str, f64, f64); 4] =
    [("rev", TAU, 0.0), ("turn", TAU, 0.0), ("rpm", TAU / 60.0, -1.0), ("Hz", TAU, -1.0)];
/// Those that do not.
const ANGLES: [(&str, f64); 3] = [("rad", 1.0), ("deg", TAU / 360.0), ("\u{b0}", TAU / 360.0)];

/// How the unit `from` of a column stands to the unit `to` of a signal. Where both name an angle or a rate of turning (Hz, rpm), a revolution is
/// 2 pi rad. In the plain `1/s` or `1/min` of a signal a radian counts as 1, as in the SI, and so does a revolution of `rev`, `rpm` or `Hz`.
pub(crate) fn relation(from: &str, to: &str) -> Relation {
    let (from, to) = (from.trim(), to.trim());
    // A number is an index: `AI[2]`.
    if from.is_empty() || to.is_empty() || (from != to && from.parse::<f64>().is_ok()) {
        return Relation::Unknown;
    }
    // A letter was lost.
    if from.contains('\u{fffd}') || to.contains('\u{fffd}') {
        return Relation::Unknown;
    }
    let written = WRITTEN.iter().find(|(file, _)| *file == from.to_lowercase());
    let from = match written {
        Some((_, unit)) => unit,
        // A coulomb is no temperature.
        None if from == "C" && temperature(to).is_some() => "degC",
        None => from,
    };
    if from == to {
        return Relation::Same;
    }
    if let Some(((zero, degree), (zero_of_signal, of_signal))) = temperature(from).zip(temperature(to)) {
        let factor = degree / of_signal;
        return match zero == zero_of_signal {
            true => multiple(factor),
            false => Relation::OtherZero { factor, shift: (zero - zero_of_signal) / of_signal },
        };
    }
    let Some((one, other)) = plain(from).zip(plain(to)) else { return Relation::Unknown };
    let Some((a, b)) = one.factor.zip(other.factor) else { return Relation::Unknown };
    if !one.same_dimension(&other) {
        // In letters of another size, such as `a` for amperes.
        let says_little = other.is_dimensionless() || from.eq_ignore_ascii_case(to) || WORDS.contains(&from);
        return if says_little { Relation::Unknown } else { Relation::Other };
    }
    turning(from, to).unwrap_or_else(|| multiple(a / b))
}

fn multiple(factor: f64) -> Relation {
    if (factor - 1.0).abs() < SAME_SIZE { Relation::Same } else { Relation::Factor(factor) }
}

/// Where a scale of temperature begins and the size of its degree, both in kelvins.
fn temperature(text: &str) -> Option<(f64, f64)> {
    if let Some((_, zero, degree)) = TEMPERATURES.iter().find(|(names, ..)| names.contains(&text)) {
        return Some((*zero, *degree));
    }
    let kelvins = plain(text).filter(|unit| text.ends_with('K') && unit.same_dimension(&Unit::base("K")));
    Some((0.0, kelvins?.factor?))
}

fn plain(text: &str) -> Option<Unit> {
    Unit::read(text, &BTreeMap::new()).ok()
}

/// A unit with the angle as a dimension, and one whose revolutions count as 1, as radians do.
fn angular(text: &str) -> Option<[Unit; 2]> {
    let rate = |size: f64, angle: &str, power: f64| {
        let angle = if angle.is_empty() { Unit::one() } else { Unit::base(angle) };
        Unit { factor: Some(size), ..angle.times(&Unit::second().power(power)) }
    };
    let [mut angles, mut counts] = [BTreeMap::new(), BTreeMap::new()];
    for (symbol, size, power) in REVOLUTIONS {
        for (symbol, prefix) in with_prefixes(symbol) {
            angles.insert(symbol.clone(), rate(prefix * size, ANGLE, power));
            counts.insert(symbol, rate(prefix * size / TAU, "", power));
        }
    }
    for (symbol, size) in ANGLES {
        for (symbol, prefix) in with_prefixes(symbol) {
            angles.insert(symbol, rate(prefix * size, ANGLE, 0.0));
        }
    }
    let read = |own: &BTreeMap<String, Unit>| Unit::read(text, own).ok();
    Some([read(&angles)?, read(&counts)?])
}

/// The dimension of angles.
const ANGLE: &str = "rad";

/// How units of one dimension stand to each other of which one or both name an angle; none where that tells nothing.
fn turning(from: &str, to: &str) -> Option<Relation> {
    let ([one, one_counts], [other, other_counts]) = angular(from).zip(angular(to))?;
    let factor = |one: &Unit, other: &Unit| Some(one.factor? / other.factor?);
    if one.same_dimension(&other) {
        return Some(multiple(factor(&one, &other)?));
    }
    let is_plain = |unit: &Unit| !unit.powers.contains_key(ANGLE);
    let rate = |power: f64| Unit::second().power(-power);
    let power = [0.0, 1.0, 2.0].into_iter().find(|power| one_counts.same_dimension(&rate(*power)))?;
    let counted = factor(&one_counts, &other_counts)?;
    // How many rad the signal's unit is where it counts 1.
    let angle = other.factor? / other_counts.factor?;
    match (is_plain(&one), is_plain(&other)) {
        (false, true) => Some(multiple(counted)),
        (true, false) if (angle - TAU).abs() < SAME_SIZE => Some(multiple(counted)),
        // 1/s^2 is written for rad/s^2.
        (true, false) if power == 1.0 || power == 2.0 && (counted - 1.0).abs() >= SAME_SIZE => {
            Some(Relation::Ambiguous { revolutions: factor(&one, &other)? * TAU, radians: factor(&one, &other)? })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            ("1/min", "rad/s", Relation::Ambiguous { revolutions: TAU / 60.0, radians: 1.0 / 60.0 }),
            ("min-1", "rad/s", Relation::Ambiguous { revolutions: TAU / 60.0, radians: 1.0 / 60.0 }),
            ("s^-1", "rad/s", Relation::Ambiguous { revolutions: TAU, radians: 1.0 }),
            ("1/s", "deg/s", Relation::Ambiguous { revolutions: 360.0, radians: 360.0 / TAU }),
            ("1/min/s", "rad/s^2", Relation::Ambiguous { revolutions: TAU / 60.0, radians: 1.0 / 60.0 }),
            // A radian is 1, with any prefix and unit of time.
            ("mrad/s", "1/s", Relation::Factor(1e-3)),
            ("rad/min", "1/s", Relation::Factor(1.0 / 60.0)),
            ("rad/s", "1/min", Relation::Factor(60.0)),
            ("deg/s", "1/s", Relation::Factor(TAU / 360.0)),
            ("mrad/s", "rad/s", Relation::Factor(1e-3)),
            ("rad", "1", Relation::Same),
            ("deg", "1", Relation::Factor(TAU / 360.0)),
            // What counts revolutions keeps its numbers in a plain unit.
            ("rev", "1", Relation::Same),
            ("rev/s", "1/s", Relation::Same),
            ("rpm", "1/s", Relation::Factor(1.0 / 60.0)),
            ("kHz", "1/s", Relation::Factor(1e3)),
            ("Hz", "1/min", Relation::Factor(60.0)),
            ("1/s", "rev/s", Relation::Same),
            // One volt per revolution a second.
            ("V/Hz", "V s/rad", Relation::Factor(1.0 / TAU)),
            ("V/rpm", "V/Hz", Relation::Factor(60.0)),
            ("V/rpm", "V s/rad", Relation::Factor(60.0 / TAU)),
            ("V s/rad", "Wb", Relation::Same),
            ("V^2/Hz", "V^2 s", Relation::Same),
            ("N m/rad", "N m", Relation::Same),
            ("kK", "degC", Relation::OtherZero { factor: 1e3, shift: -273.15 }),
            ("uK", "degC", Relation::OtherZero { factor: 1e-6, shift: -273.15 }),
            ("kK", "K", Relation::Factor(1e3)),
            ("°F", "degF", Relation::Same),
            ("\u{fffd}C", "\u{fffd}C", Relation::Unknown),
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
                (
                    Relation::Ambiguous { revolutions, radians },
                    Relation::Ambiguous { revolutions: expected, radians: of_radians },
                ) => {
                    let errors = [revolutions / expected - 1.0, radians / of_radians - 1.0];
                    assert!(errors.iter().all(|error| error.abs() < 1e-14), "{from} {to}: {revolutions} {radians}");
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
}
