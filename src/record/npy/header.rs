//! The header of a NumPy file: kind of its numbers, order, shape
//! ([NEP 1](https://numpy.org/neps/nep-0001-npy-format.html)).

use std::io::{self, Read};

/// What stands in a file before its numbers.
#[derive(Debug, PartialEq)]
pub(crate) struct Header {
    /// Kind of number, as NumPy writes it: `<f8`; of records, their list of fields.
    pub(crate) kind: String,
    /// Whether columns are stored one after the other, and not rows.
    pub(crate) by_columns: bool,
    pub(crate) shape: Vec<u64>,
    /// Where the numbers begin (bytes).
    pub(crate) begin: usize,
}

impl Header {
    /// Reads the header, up to the first number.
    ///
    /// # Errors
    /// A file that ends too soon, or is no NumPy file.
    pub(crate) fn read(file: &mut impl Read) -> io::Result<Header> {
        let mut begin = [0; 8];
        let cut = |_| unreadable("it ends within its header");
        file.read_exact(&mut begin).map_err(cut)?;
        if !begin.starts_with(b"\x93NUMPY") {
            return Err(unreadable("it does not begin as a NumPy file"));
        }
        // The length has two bytes in the first version and four since.
        let mut length = [0; 4];
        let bytes = if begin[6] == 1 { 2 } else { 4 };
        file.read_exact(&mut length[..bytes]).map_err(cut)?;
        let length = u32::from_le_bytes(length);
        let mut text = String::new();
        file.take(length.into()).read_to_string(&mut text)?;
        if text.len() as u64 != u64::from(length) {
            return Err(unreadable("it ends within its header"));
        }
        let header = Header::parse(&text, 8 + bytes + text.len());
        header.ok_or_else(|| unreadable(&format!("its header is `{}`", text.trim())))
    }

    /// A dictionary of Python with three entries.
    fn parse(text: &str, begin: usize) -> Option<Header> {
        let entry = |name: &str| {
            let after = [format!("'{name}'"), format!("\"{name}\"")].iter().find_map(|key| text.split_once(key))?.1;
            Some(after.trim_start().strip_prefix(':')?.trim_start())
        };
        let kind = entry("descr")?;
        let kind = match kind.chars().next()? {
            quote @ ('\'' | '"') => kind[1..].split_once(quote)?.0,
            '[' => kind.split_once(']')?.0,
            _ => return None,
        };
        let by_columns = entry("fortran_order")?.starts_with("True");
        let (sizes, _) = entry("shape")?.strip_prefix('(')?.split_once(')')?;
        let sizes = sizes.split(',').map(str::trim).filter(|size| !size.is_empty());
        // Python 2 ended long numbers by a letter.
        let shape = sizes.map(|size| size.trim_end_matches('L').parse().ok()).collect::<Option<_>>()?;
        Some(Header { kind: kind.to_owned(), by_columns, shape, begin })
    }
}

fn unreadable(why: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, text: &str) -> Vec<u8> {
        let length = u32::try_from(text.len()).unwrap().to_le_bytes();
        let length = &length[..if version == 1 { 2 } else { 4 }];
        [b"\x93NUMPY", &[version, 0][..], length, text.as_bytes(), &[0; 8]].concat()
    }

    /// Headers as NumPy 1 and 2, Python 2 and other programs write them.
    #[test]
    fn headers_of_every_version_are_read() {
        let plain = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }      \n";
        let header = |version, text: &str| Header::read(&mut &*file(version, text)).unwrap();
        let read = header(1, plain);
        assert_eq!(read, Header { kind: "<f8".into(), by_columns: false, shape: vec![3], begin: 10 + plain.len() });
        assert_eq!(header(2, plain), Header { begin: 12 + plain.len(), ..read });
        let other = header(3, "{\"shape\":(2L, 30L),\"fortran_order\":True,\"descr\":\">i4\"}\n");
        assert_eq!((other.kind.as_str(), other.by_columns, other.shape), (">i4", true, vec![2, 30]));
        let scalar = header(1, "{'descr': '|b1', 'fortran_order': False, 'shape': (), }\n");
        assert_eq!((scalar.kind.as_str(), scalar.shape), ("|b1", vec![]));
        let fields = header(1, "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }\n");
        assert_eq!(fields.kind, "[('a', '<f8')");
    }

    /// A file cut anywhere within its header, and headers of something else, are refused.
    #[test]
    fn what_is_no_header_is_refused() {
        let whole = file(1, "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }\n");
        for end in 0..whole.len() - 8 {
            let refused = Header::read(&mut &whole[..end]).unwrap_err().to_string();
            assert_eq!(refused, "it ends within its header", "{end}");
        }
        for text in ["", "{}", "{'descr': 8}", "{'descr': '<f8', 'fortran_order': False, 'shape': (a,)}", "'descr': '"]
        {
            let refused = Header::read(&mut &*file(1, text)).unwrap_err().to_string();
            assert!(refused.contains("its header is"), "{text}: {refused}");
        }
        assert!(Header::read(&mut &b"t,ud,uq,w,id,iq\n"[..]).unwrap_err().to_string().contains("NumPy"));
    }
}
