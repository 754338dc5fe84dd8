//! The elements of a MATLAB file: a tag with kind and size, then data, compressed or not. They are read one after the other, and what
//! nobody wants is passed over.

use super::super::{numbers, vector};
use flate2::read::ZlibDecoder;
use std::io::{self, Read};

/// Structures within structures that are looked into.
const DEPTH: usize = 8;

/// Why a file or a variable cannot be read.
pub(super) enum Fault {
    /// A variable that is something else.
    Kind { name: String, kind: String, wanted: &'static str },
    /// The file ends too soon or contradicts itself.
    Damaged(String),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        Fault::Damaged(match error.kind() {
            io::ErrorKind::UnexpectedEof => "it ends within a variable".to_owned(),
            _ => error.to_string(),
        })
    }
}

fn damaged<T>(why: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Damaged(why.into()))
}

/// A variable, up to its values.
pub(super) struct Variable<'a> {
    /// What it is, if not numbers.
    kind: Option<String>,
    sizes: Vec<u64>,
    big: bool,
    body: &'a mut dyn Read,
}

impl Variable<'_> {
    /// Its values.
    ///
    /// # Errors
    /// A variable that is no column of numbers.
    pub(super) fn numbers(&mut self, name: &str) -> Result<Vec<f64>, Fault> {
        let other = |kind| Fault::Kind { name: name.to_owned(), kind, wanted: "columns of numbers" };
        if let Some(kind) = self.kind.take() {
            return Err(other(kind));
        }
        let length = vector(&self.sizes).map_err(other)?;
        let (kind, data) = element(self.body, self.big)?;
        // Numbers are stored in the smallest kind that holds them all.
        let kind = match kind {
            1 => "i1",
            2 => "u1",
            3 => "i2",
            4 => "u2",
            5 => "i4",
            6 => "u4",
            7 => "f4",
            9 => "f8",
            12 => "i8",
            13 => "u8",
            _ => return damaged(format!("variable `{name}` has values of kind {kind}")),
        };
        match numbers(kind, self.big, &data) {
            Some(numbers) if numbers.len() as u64 == length => Ok(numbers),
            _ => damaged(format!("variable `{name}` does not have the {length} values that it says")),
        }
    }
}

type Visit<'a> = dyn FnMut(&str, &mut Variable) -> Result<(), Fault> + 'a;

/// Visits the variables of a file.
pub(super) fn each(file: &mut dyn Read, visit: &mut Visit) -> Result<(), Fault> {
    let mut header = [0; 128];
    file.read_exact(&mut header)?;
    let big = match &header[124..] {
        [0, 1, b'I', b'M'] => false,
        [1, 0, b'M', b'I'] => true,
        _ => return damaged("its header has no version and byte order"),
    };
    loop {
        let mut tag = [0; 8];
        match file.read(&mut tag)? {
            0 => return Ok(()),
            read => file.read_exact(&mut tag[read..])?,
        }
        let (kind, size) = (word(&tag[..4], big), word(&tag[4..], big));
        let mut body = file.take(size.into());
        match kind {
            14 => matrix(&mut body, big, "", 0, visit)?,
            15 => {
                let mut plain = ZlibDecoder::new(&mut body);
                let mut tag = [0; 8];
                plain.read_exact(&mut tag)?;
                if word(&tag[..4], big) == 14 {
                    matrix(&mut plain, big, "", 0, visit)?;
                }
                // To its checksum.
                io::copy(&mut plain, &mut io::sink())?;
            }
            _ => {}
        }
        io::copy(&mut body, &mut io::sink())?;
        if body.limit() > 0 {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
    }
}

/// A variable or a field, named after what it is in.
fn matrix(body: &mut dyn Read, big: bool, within: &str, depth: usize, visit: &mut Visit) -> Result<(), Fault> {
    let (_, flags) = element(body, big)?;
    if flags.len() != 8 {
        // A field that was never set has nothing.
        return if flags.is_empty() { Ok(()) } else { damaged("a variable without a class") };
    }
    let flags = word(&flags[..4], big);
    let (class, complex) = (flags & 0xff, flags & 0x800 != 0);
    let mut sizes = vec![];
    // An object has no sizes but the name of its class.
    if class != 17 {
        let (_, data) = element(body, big)?;
        sizes = data.as_chunks::<4>().0.iter().map(|size| u64::from(word(size, big))).collect();
    }
    let own = text(&element(body, big)?.1);
    let name = if within.is_empty() { own } else { within.to_owned() };
    let kind = match class {
        6..=15 if complex => Some("complex numbers".to_owned()),
        6..=15 => None,
        2 if sizes.iter().product::<u64>() == 1 && depth < DEPTH => return fields(body, big, &name, depth, visit),
        1 => Some("a cell array".to_owned()),
        2 => Some("a structure".to_owned()),
        4 => Some("text".to_owned()),
        5 => Some("a sparse matrix".to_owned()),
        17 => {
            element(body, big)?;
            Some(format!("an object of class {}", text(&element(body, big)?.1)))
        }
        _ => Some(format!("a variable of class {class}")),
    };
    // Objects have a part of their own without a name.
    if name.is_empty() {
        return Ok(());
    }
    visit(&name, &mut Variable { kind, sizes, big, body })
}

/// The fields of a structure.
fn fields(body: &mut dyn Read, big: bool, name: &str, depth: usize, visit: &mut Visit) -> Result<(), Fault> {
    let (_, length) = element(body, big)?;
    let length = if length.len() == 4 { word(&length, big) as usize } else { 0 };
    let (_, names) = element(body, big)?;
    if length == 0 {
        return if names.is_empty() { Ok(()) } else { damaged(format!("structure `{name}` has fields without names")) };
    }
    for field in names.chunks_exact(length) {
        let mut tag = [0; 8];
        body.read_exact(&mut tag)?;
        let mut inner = body.take(word(&tag[4..], big).into());
        if inner.limit() > 0 {
            matrix(&mut inner, big, &format!("{name}.{}", text(field)), depth + 1, visit)?;
        }
        io::copy(&mut inner, &mut io::sink())?;
        if inner.limit() > 0 {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
    }
    Ok(())
}

/// Kind and data of the next element; its end stands at a multiple of eight bytes.
fn element(body: &mut dyn Read, big: bool) -> Result<(u32, Vec<u8>), Fault> {
    let mut tag = [0; 8];
    match body.read(&mut tag)? {
        // The end of an empty variable.
        0 => return Ok((0, vec![])),
        read => body.read_exact(&mut tag[read..])?,
    }
    let kind = word(&tag[..4], big);
    // Up to four bytes stand in the tag itself.
    if kind >> 16 != 0 {
        let data = tag[4..].get(..(kind >> 16) as usize);
        return match data {
            Some(data) => Ok((kind & 0xffff, data.to_vec())),
            None => damaged("an element is larger than it can be"),
        };
    }
    let size = word(&tag[4..], big);
    let mut data = vec![];
    if Read::take(&mut *body, size.into()).read_to_end(&mut data)? as u64 != u64::from(size) {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
    }
    let padding = u64::from(size.wrapping_neg() % 8);
    io::copy(&mut body.take(padding), &mut io::sink())?;
    Ok((kind, data))
}

fn word(bytes: &[u8], big: bool) -> u32 {
    let bytes = bytes.try_into().unwrap_or_default();
    if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
}

/// A text that may be filled up by zeros.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
