//! The units that are known, and their prefixes.

use super::Unit;
use core::f64::consts::PI;

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

/// A unit by its symbol, which may have a prefix.
pub(super) fn known(symbol: &str) -> Option<Unit> {
    if let Some(known) = UNITS.iter().find(|known| known.0 == symbol) {
        return Some(unit(known, 1.0));
    }
    let with = |(prefix, size): &(&str, f64)| {
        let rest = symbol.strip_prefix(prefix)?;
        let known = UNITS.iter().find(|known| known.1 && known.0 == rest)?;
        Some(unit(known, *size))
    };
    PREFIXES.iter().find_map(with)
}

/// A symbol and, where prefixes go with it, each with a prefix, and its size in units of the symbol.
pub(super) fn with_prefixes(symbol: &str) -> impl Iterator<Item = (String, f64)> {
    let takes = UNITS.iter().any(|known| known.1 && known.0 == symbol);
    let prefixes = PREFIXES.iter().filter(move |_| takes);
    [("", 1.0)].iter().chain(prefixes).map(move |(prefix, size)| (format!("{prefix}{symbol}"), *size))
}

fn unit((_, _, factor, powers): &Known, prefix: f64) -> Unit {
    let powers = BASES.iter().zip(powers).filter(|(_, power)| **power != 0);
    let powers = powers.map(|(base, power)| ((*base).to_owned(), f64::from(*power))).collect();
    Unit { powers, factor: Some(factor * prefix) }
}
