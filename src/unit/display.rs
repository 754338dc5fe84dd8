//! A unit as text.

use super::{SAME_SIZE, Unit};
use core::fmt;
use std::collections::BTreeMap;

/// Names for what an expression comes to.
const NAMED: [&str; 11] = ["V", "ohm", "H", "Wb", "N", "J", "W", "Pa", "F", "T", "S"];
/// What may stand beside such a name.
const BY: [&str; 9] = ["/s", " s", "/m", " m", "/A", " A", "/K", "^2", "/s^2"];

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
