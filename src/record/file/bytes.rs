//! What the bytes of a text mean: runs of spaces, and letters that are no UTF-8.

use std::borrow::Cow;
use std::io::{self, Read};

/// Letters of Windows-1252 from 0x80 to 0x9F; the others stand where Unicode has them. Five bytes have none.
const LETTERS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// Bytes that are read at once.
const CHUNK: usize = 8192;

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
    /// Bytes to be passed on, of which so many were.
    kept: Vec<u8>,
    given: usize,
}

impl<R> Spaces<R> {
    pub(super) fn new(separator: u8, bytes: R) -> Self {
        let (begin, space, quoted) = (true, false, false);
        Spaces { bytes, separate: separator == b' ', begin, space, quoted, kept: vec![], given: 0 }
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

impl<R: Read> Spaces<R> {
    /// Reads some bytes into those that are to be passed on; none at the end of the text.
    fn fill(&mut self) -> io::Result<()> {
        let mut read = [0; CHUNK];
        (self.given, self.kept) = (0, vec![]);
        while self.kept.is_empty() {
            let count = self.bytes.read(&mut read)?;
            if count == 0 {
                return Ok(());
            }
            for &byte in &read[..count] {
                let (out, space) = self.take(byte);
                self.kept.extend(space.then_some(b' '));
                self.kept.extend((!out).then_some(byte));
            }
        }
        Ok(())
    }
}

impl<R: Read> Read for Spaces<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if !self.separate {
            return self.bytes.read(to);
        }
        if self.given == self.kept.len() {
            self.fill()?;
        }
        let count = (&self.kept[self.given..]).read(to)?;
        self.given += count;
        Ok(count)
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
