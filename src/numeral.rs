//! How numbers are written for readers.

mod moment;
#[cfg(test)]
mod tests;

pub use moment::{Moment, TimeUnit};

/// Digits that every `f64` can be trusted with; one more would show the rounding to binary (`1.1500000000000001`).
const EXACT: usize = 15;

/// A number that is exact, such as a time stamp or a bound, with the digits that it has.
pub(crate) fn exact(value: f64) -> String {
    number(value, EXACT)
}

/// A number with at most so many significant digits, without zeros at its end: `0.3`, `1.15`, `2.5e-5`.
///
/// Numbers from a ten-thousandth to ten million are written out, with all digits before the point. What is not finite is
/// said in words.
pub(crate) fn number(value: f64, digits: usize) -> String {
    let written = written(value, digits);
    let Some((mantissa, exponent)) = written.split_once('e') else { return trimmed(&written).to_owned() };
    format!("{}e{exponent}", trimmed(mantissa))
}

/// A number rounded where its error has the second digit; zeros are kept, because they are known: `0.630` for an error of
/// 0.0021. Without a usable error it has six digits.
pub(crate) fn resolved(value: f64, error: f64) -> String {
    if !(error > 0.0 && error.is_finite() && value.is_finite()) {
        return number(value, 6);
    }
    let last = error.log10().floor() as i32 - 1;
    let first = if value == 0.0 { last } else { value.abs().log10().floor() as i32 };
    let digits = (first - last + 1).clamp(1, EXACT as i32) as usize;
    let text = written(value, digits.max(2));
    // A value that rounds to zero at the error's place is written as a zero of that place.
    if first < last && last < 0 { format!("{:.*}", -last as usize, value) } else { text }
}

/// The same without zeros at its end: a number that is not known better than to `step`.
pub(crate) fn rounded(value: f64, step: f64) -> String {
    trimmed(&resolved(value, step)).to_owned()
}

/// A fit (%): four digits, or as many more as tell it from 100 %.
pub(crate) fn fit(percent: f64) -> String {
    if (99.0..100.0).contains(&percent) { resolved(percent, 100.0 - percent) } else { written(percent, 4) }
}

/// A standard error: two digits, zeros kept.
pub(crate) fn error_size(error: f64) -> String {
    written(error, 2)
}

/// A part as a percentage, with so many significant digits.
pub(crate) fn percent(part: f64, digits: usize) -> String {
    format!("{} %", number(100.0 * part, digits))
}

/// A probability in words; below what the tails of distributions are computed to, only that it is.
pub(crate) fn p_value(p: f64) -> String {
    if p < 1e-15 { "p < 1e-15".to_owned() } else { format!("p = {}", number(p, 2)) }
}

/// A unit as it follows a number: after a space, and nothing for a ratio.
pub(crate) fn unit_after(unit: &str) -> String {
    if unit.is_empty() || unit == "1" { String::new() } else { format!(" {unit}") }
}

/// A number of things: `1 gap`, `3 gaps`, `24,841 samples`.
pub(crate) fn counted(count: u64, thing: &str) -> String {
    format!("{} {thing}{}", whole(count), if count == 1 { "" } else { "s" })
}

/// A whole number, from five digits on in groups of three: `9999`, `24,841`.
pub(crate) fn whole(count: u64) -> String {
    grouped(&count.to_string())
}

/// A written number whose digits before the point are in groups of three, if they are five or more: `-12,646.37`.
pub(crate) fn grouped(text: &str) -> String {
    let sign = if text.starts_with('-') { 1 } else { 0 };
    let digits = text[sign..].chars().take_while(char::is_ascii_digit).count();
    if digits < 5 {
        return text.to_owned();
    }
    let (whole, rest) = text.split_at(sign + digits);
    let mut found = String::with_capacity(text.len() + digits / 3);
    for (k, c) in whole.chars().enumerate() {
        if k > sign && (sign + digits - k).is_multiple_of(3) {
            found.push(',');
        }
        found.push(c);
    }
    found + rest
}

fn written(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "not a number".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "infinite" } else { "-infinite" }.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    // The exponent after rounding: 9.99 may have become 10.0.
    let exponent = scientific.split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok()).unwrap_or(0);
    if exponent < -4 || exponent >= 7.max(digits as i32) {
        return scientific;
    }
    format!("{value:.*}", (digits as i32 - 1 - exponent).max(0) as usize)
}

/// Without the zeros that a fraction ends in.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}
