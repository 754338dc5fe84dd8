//! [`Numbers`]: numbers in the cells of a text, with a decimal point or a decimal comma.

use super::is_missing;

/// Reads numbers; whether they have a comma is decided by the first that has one or a point.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    comma: Option<bool>,
    /// Cells are separated by commas, so that one with a comma in it was quoted.
    quoted: bool,
}

impl Numbers {
    pub(super) fn new(comma: Option<bool>, separator: u8) -> Numbers {
        Numbers { comma, quoted: separator == b',' }
    }

    /// Whether numbers have a decimal comma, as far as is known.
    pub(super) fn comma(&self) -> bool {
        self.comma == Some(true)
    }

    /// The number in a cell: NaN where it says that nothing was measured, none where it says something else.
    #[inline]
    pub(super) fn read(&mut self, cell: &[u8]) -> Option<f64> {
        if self.comma() {
            return with_comma(cell);
        }
        let number = std::str::from_utf8(cell).ok()?.parse::<f64>().ok();
        if self.comma.is_none() {
            if number.is_some() && cell.contains(&b'.') {
                self.comma = Some(false);
            } else if number.is_none() && self.may_have_comma(cell) && with_comma(cell).is_some() {
                self.comma = Some(true);
                return with_comma(cell);
            }
        }
        number.or_else(|| is_missing(cell).then_some(f64::NAN))
    }

    /// A quoted 1,234 among cells between commas may as well be a thousand.
    fn may_have_comma(&self, cell: &[u8]) -> bool {
        let decimals = cell.split(|byte| *byte == b',').nth(1).map(<[u8]>::len);
        decimals.is_some_and(|decimals| !self.quoted || decimals != 3)
    }
}

/// A number whose comma is the decimal sign; a point in it would separate thousands.
fn with_comma(cell: &[u8]) -> Option<f64> {
    let mut text = [0; 64];
    let text = text.get_mut(..cell.len()).filter(|_| !cell.contains(&b'.'))?;
    for (to, &from) in text.iter_mut().zip(cell) {
        *to = if from == b',' { b'.' } else { from };
    }
    let number = std::str::from_utf8(text).ok()?.parse().ok();
    number.or_else(|| is_missing(cell).then_some(f64::NAN))
}
