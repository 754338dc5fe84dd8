//! What the bytes of a text mean: runs of spaces, and letters that are no UTF-8.

use std::borrow::Cow;
use std::io::{self, Read};

/// Letters of Windows-1252 from 0x80 to 0x9F; the others stand where Unicode has them. Five bytes have none.
const LETTERS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// A text, in Windows-1252 (of which Latin-1 is a part) where it is no UTF-8.
pub(super) fn decoded(bytes: &[u8]) -> Cow<'_, str> {
    let letter = |byte: &u8| match byte {
        0x80..=0x9f => LETTERS[usize::from(byte - 0x80)],
        _ => char::from(*byte),
    };
    std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().map(letter).collect(), Cow::Borrowed)
}

/// Bytes in which a run of spaces between cells is one space, and none stands at an end of a line, where spaces separate cells. Other bytes
/// are as they were, so that lines can be counted.
pub(super) struct Spaces<R> {
    bytes: R,
    separate: bool,
    /// No byte of the line was passed on yet.
    begin: bool,
    /// Spaces were passed over.
    space: bool,
    /// Within a cell in quotes.
    quoted: bool,
}

impl<R> Spaces<R> {
    pub(super) fn new(separator: u8, bytes: R) -> Self {
        Spaces { bytes, separate: separator == b' ', begin: true, space: false, quoted: false }
    }

    /// Whether a byte is left out, and one space stands before it.
    fn take(&mut self, byte: u8) -> (bool, bool) {
        match byte {
            b'\n' => {
                (self.begin, self.space, self.quoted) = (true, false, false);
                (false, false)
            }
            // The end of a line may be \r\n.
            b' ' | b'\r' if !self.quoted => {
                self.space = !self.begin;
                (true, false)
            }
            _ => {
                let opens = self.begin || self.space;
                self.quoted = if byte == b'"' { opens && !self.quoted } else { self.quoted };
                let space = std::mem::take(&mut self.space);
                self.begin = false;
                (false, space)
            }
        }
    }
}

impl<R: Read> Read for Spaces<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if !self.separate || to.len() < 2 {
            return self.bytes.read(to);
        }
        let mut read = vec![0; to.len() / 2];
        loop {
            let count = self.bytes.read(&mut read)?;
            let mut end = 0;
            for &byte in &read[..count] {
                let (out, space) = self.take(byte);
                if space {
                    to[end] = b' ';
                    end += 1;
                }
                if !out {
                    to[end] = byte;
                    end += 1;
                }
            }
            if end > 0 || count == 0 {
                return Ok(end);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells in quotes keep their spaces; an inch mark behind a number opens none.
    #[test]
    fn runs_of_spaces() {
        for (text, expected) in [
            ("  t   u \n 0.0   1 \r\n\n  2  3", "t u\n0.0 1\n\n2 3"),
            ("\"a  b\"   c\n5\"   6  \n", "\"a  b\" c\n5\" 6\n"),
        ] {
            let mut found = String::new();
            Spaces::new(b' ', text.as_bytes()).read_to_string(&mut found).unwrap();
            assert_eq!(found, expected);
            found.clear();
            Spaces::new(b';', text.as_bytes()).read_to_string(&mut found).unwrap();
            assert_eq!(found, text);
        }
    }

    /// The first column is UTF-8, the others are Latin-1 and Windows-1252.
    #[test]
    fn letters() {
        for (bytes, expected) in
            [(&b"\xc2\xb0F"[..], "°F"), (b"\xb0F", "°F"), (b"\xb5s", "µs"), (b"m/s\xb2", "m/s²"), (b"\x80", "€")]
        {
            assert_eq!(decoded(bytes), expected);
        }
    }
}
