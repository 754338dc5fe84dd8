//! [`factor`]: from one unit to another.

use super::remark::Error;
use crate::unit::{NoUnit, Relation, Unit, relation};
use std::collections::BTreeMap;

/// How many of the unit `to` one of the unit `from` is: `factor("rpm", "rad/s")` is 0.1047. Of degrees Celsius it is that of
/// their differences; a frequency in `Hz` that stands for an angular velocity counts revolutions.
///
/// # Errors
/// A text that is no unit, units of different dimensions, a plain rate such as `1/min` for an angular velocity.
///
/// ```
/// use greybox::text::factor;
/// assert!((factor("rpm", "rad/s")? - 0.104_719_755).abs() < 1e-9);
/// assert!((factor("Hz", "rad/s")? - 6.283_185_307).abs() < 1e-9);
/// assert_eq!(factor("mA", "V").unwrap_err().to_string(), "`mA` is in A, `V` is in V; neither is a multiple of the other");
/// # Ok::<(), greybox::text::Error>(())
/// ```
pub fn factor(from: &str, to: &str) -> Result<f64, Error> {
    match relation(from, to) {
        Relation::Factor(factor) | Relation::OtherZero { factor, .. } => return Ok(factor),
        Relation::Same => return Ok(1.0),
        Relation::Ambiguous { .. } => {
            return Err(Error::Unit(format!(
                "`{from}` may count revolutions or radians of `{to}`: write the unit with `rev` or `rad`, as `rev/min`"
            )));
        }
        _ => {}
    }
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
            let [a, b] = [a, b].map(Unit::of_size_one);
            Err(Error::Unit(format!("`{from}` is in {a}, `{to}` is in {b}; neither is a multiple of the other")))
        }
    }
}
