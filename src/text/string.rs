//! [`Place`]: where the characters of a TOML string stand in its file.

use super::remark::Span;

/// A value of a file whose text is an expression or a unit.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The value with its quotes.
    pub token: Span,
    /// Whether it has none: the text stands as it is.
    is_plain: bool,
}

impl Place {
    /// A value of a TOML file.
    pub fn quoted(token: Span) -> Self {
        Place { token, is_plain: false }
    }

    /// A text that is no TOML.
    pub fn plain(token: Span) -> Self {
        Place { token, is_plain: true }
    }

    /// The bytes of the file that a range of the string's own bytes was read from.
    pub fn span(&self, file: &str, within: Span) -> Span {
        if self.is_plain {
            return self.token.start + within.start..self.token.start + within.end;
        }
        let Some(token) = file.get(self.token.clone()) else { return self.token.clone() };
        let offsets = offsets(token);
        let at = |i: usize| offsets.get(i).or(offsets.last()).copied().unwrap_or(0);
        let start = self.token.start + at(within.start);
        // The end of the last character, not the begin of the next: an escape may stand between them.
        let end = match within.end.checked_sub(1) {
            Some(last) if last >= within.start => at(last).max(at(within.end)),
            _ => at(within.start),
        };
        start..(self.token.start + end).max(start)
    }
}

/// Where in a TOML string, quotes and escapes included, each byte of its value begins; and where the last ends.
fn offsets(token: &str) -> Vec<usize> {
    let quotes = ["\"\"\"", "'''", "\"", "'"].into_iter().find(|quotes| token.starts_with(quotes)).unwrap_or("");
    let escapes = quotes.starts_with('"');
    let end = token.len() - if token.len() >= 2 * quotes.len() { quotes.len() } else { 0 };
    let mut at = quotes.len().min(end);
    if quotes.len() == 3 {
        // A line break right after the quotes is no part of the string.
        at += ["\r\n", "\n"].into_iter().find(|line| token[at..].starts_with(line)).map_or(0, str::len);
    }
    let mut found = vec![];
    let mut rest = token[at..end.max(at)].char_indices().map(|(i, c)| (at + i, c)).peekable();
    while let Some((i, c)) = rest.next() {
        if c != '\\' || !escapes {
            found.extend((0..c.len_utf8()).map(|byte| i + byte));
            continue;
        }
        let Some((_, kind)) = rest.next() else { break };
        let digits = match kind {
            'x' => 2,
            'u' => 4,
            'U' => 8,
            _ if kind.is_whitespace() => {
                // A line that goes on: white space up to the next character is left out.
                while rest.next_if(|(_, c)| c.is_whitespace()).is_some() {}
                continue;
            }
            _ => 0,
        };
        let code: String =
            (0..digits).filter_map(|_| rest.next_if(|(_, c)| c.is_ascii_hexdigit())).map(|(_, c)| c).collect();
        let decoded = u32::from_str_radix(&code, 16).ok().and_then(char::from_u32);
        found.extend(std::iter::repeat_n(i, decoded.map_or(1, char::len_utf8)));
    }
    found.push(end);
    found
}

#[cfg(test)]
mod tests {
    use super::Place;

    /// The character `x` is found behind every kind of quote and escape.
    #[test]
    fn characters_behind_escapes_are_found() {
        let files = [
            "a = \"1 + x\"",
            "a = '1 + x'",
            "a = \"\"\"\n  1 +\n  x\"\"\"",
            "a = '''\r\n1 +\r\nx'''",
            "a = \"1\\t+\\u0020x\"",
            "a = \"\"\"1 + \\\n      x\"\"\"",
            "a = \"\\U000000b5 + x\"",
            "b = \"µ\"\na = \"µ\\\\ + x\"",
        ];
        for file in files {
            let table = toml::de::DeTable::parse(file).unwrap().into_inner();
            let value = &table["a"];
            let text = value.get_ref().as_str().unwrap();
            let x = text.find('x').unwrap();
            let place = Place::quoted(value.span());
            assert_eq!(&file[place.span(file, x..x + 1)], "x", "{file}");
            assert_eq!(
                place.span(file, 0..text.len()).end,
                value.span().end - if file.contains("\"\"\"") || file.contains("'''") { 3 } else { 1 }
            );
        }
    }
}
