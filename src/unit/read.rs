//! Reading a unit: symbols with powers, products and quotients, numbers, parentheses.

use super::known::known;
use super::{NoUnit, Unit};
use std::collections::BTreeMap;

/// Reads a unit; what it cannot read stays in `rest`.
pub(super) struct Reader<'a> {
    pub(super) rest: &'a str,
    pub(super) own: &'a BTreeMap<String, Unit>,
    pub(super) depth: usize,
}

impl Reader<'_> {
    fn sign(&mut self, signs: &[&str]) -> bool {
        let rest = self.rest.trim_start();
        let sign = signs.iter().find(|sign| rest.starts_with(**sign));
        self.rest = sign.map_or(self.rest, |sign| &rest[sign.len()..]);
        sign.is_some()
    }

    /// All up to the end or a parenthesis that closes.
    pub(super) fn product(&mut self) -> Result<Unit, NoUnit> {
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
        let before = self.rest;
        let unit = self.atom()?;
        let before = &before[..before.len() - self.rest.len()];
        let raised = self.sign(&["**", "^"]);
        let rest = if raised { self.rest.trim_start() } else { self.rest };
        for (superscript, power) in [("²", 2.0), ("³", 3.0), ("⁻¹", -1.0), ("⁻²", -2.0)] {
            if let Some(rest) = rest.strip_prefix(superscript) {
                self.rest = rest;
                return Ok(unit.power(power));
            }
        }
        // `s2` and `min-1`, as files write powers: a number at once behind a symbol.
        let digits = rest.strip_prefix('-').unwrap_or(rest);
        let follows = before.ends_with(char::is_alphabetic) && digits.starts_with(|c: char| c.is_ascii_digit());
        if !raised && !follows {
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
        let found = self.own.get(symbol).cloned().or_else(|| known(symbol));
        found.ok_or_else(|| NoUnit::Unknown(symbol.to_owned()))
    }
}
