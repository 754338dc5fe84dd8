//! The signs, names and numbers that an expression is made of.

use super::remark::Span;

/// A piece of an expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Number(f64),
    Name(String),
    /// A word with a meaning of its own, a sign or a bracket.
    Sign(&'static str),
    End,
}

/// What is wrong with an expression, within it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wrong {
    pub at: Span,
    pub title: String,
    pub help: Option<String>,
}

impl Wrong {
    pub fn new(at: Span, title: impl Into<String>) -> Self {
        Wrong { at, title: title.into(), help: None }
    }

    pub fn help(self, help: impl Into<String>) -> Self {
        Wrong { help: Some(help.into()), ..self }
    }
}

/// Longer signs first.
const SIGNS: [&str; 13] = ["**", "<=", ">=", "+", "-", "*", "/", "^", "(", ")", ",", "<", ">"];
pub(super) const WORDS: [&str; 6] = ["if", "then", "else", "and", "or", "not"];

/// Signs of other languages, and what stands for them here.
const FOREIGN: [(&str, &str); 17] = [
    ("==", "numbers are not compared for equality; write `a <= b and b <= a`, or choose a band"),
    ("!=", "numbers are not compared for equality; write `a < b or b < a`, or choose a band"),
    ("~=", "numbers are not compared for equality; write `a < b or b < a`, or choose a band"),
    ("&&", "write `and`"),
    ("||", "write `or`"),
    ("!", "write `not`"),
    ("~", "write `not`"),
    ("&", "write `and`"),
    ("|", "write `or`, or `abs(x)` for a magnitude"),
    ("=", "an expression has no equals sign: what is defined stands left of the TOML equals sign"),
    ("?", "write `if a < b then c else d`"),
    ("%", "write `rem_euclid(x, period)` for a remainder, and a percentage as its part of one"),
    ("[", "there are no lists; a table of numbers stands in `[tables]` and is called by its name"),
    ("{", "there are no braces; use parentheses"),
    (".*", "write `*`; every quantity is a number"),
    ("./", "write `/`; every quantity is a number"),
    (";", "one expression has one value; name what is shared in `[let]`"),
];

/// Whether a text can stand for a quantity as it is.
pub(super) fn is_name(text: &str) -> bool {
    let mut letters = text.chars();
    letters.next().is_some_and(|c| c.is_alphabetic() || c == '_')
        && letters.all(|c| c.is_alphanumeric() || c == '_')
        && !WORDS.contains(&text)
}

/// The pieces with their places; the last is the end.
pub(super) fn tokens(text: &str) -> Result<Vec<(Token, Span)>, Wrong> {
    let mut found = vec![];
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let (token, length) = match c {
            _ if c.is_whitespace() => {
                at += c.len_utf8();
                continue;
            }
            '#' => {
                at += rest.find('\n').unwrap_or(rest.len());
                continue;
            }
            _ if c.is_ascii_digit() || c == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit()) => {
                number(rest, at)?
            }
            _ if c.is_alphabetic() || c == '_' => {
                let length = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
                match WORDS.iter().find(|word| **word == &rest[..length]) {
                    Some(word) => (Token::Sign(word), length),
                    None => (Token::Name(rest[..length].to_owned()), length),
                }
            }
            '`' => match rest[1..].find('`') {
                Some(length) => (Token::Name(rest[1..1 + length].to_owned()), length + 2),
                None => return Err(Wrong::new(at..at + 1, "a name in backticks has no end").help("close it by `")),
            },
            '.' if rest[1..].starts_with(|c: char| c.is_alphabetic())
                && matches!(found.last(), Some((Token::Name(_), _))) =>
            {
                (Token::Sign("."), 1)
            }
            _ => match SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
                Some(sign) => (Token::Sign(sign), sign.len()),
                None => return Err(stranger(rest, at, c)),
            },
        };
        found.push((token, at..at + length));
        at += length;
    }
    found.push((Token::End, text.len()..text.len()));
    Ok(found)
}

fn stranger(rest: &str, at: usize, c: char) -> Wrong {
    match FOREIGN.iter().find(|(sign, _)| rest.starts_with(sign)) {
        Some((sign, help)) => Wrong::new(at..at + sign.len(), format!("`{sign}` has no meaning here")).help(*help),
        None => match c {
            '\u{2212}' | '\u{2013}' => {
                Wrong::new(at..at + c.len_utf8(), format!("`{c}` is a dash")).help("write the minus sign `-`")
            }
            '·' | '×' => Wrong::new(at..at + c.len_utf8(), format!("`{c}` has no meaning here")).help("write `*`"),
            _ => Wrong::new(at..at + c.len_utf8(), format!("`{}` has no meaning here", c.escape_debug())),
        },
    }
}

/// A number and its length.
fn number(rest: &str, at: usize) -> Result<(Token, usize), Wrong> {
    let digits =
        |from: usize| rest[from..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |length| from + length);
    let mut end = digits(0);
    if rest[end..].starts_with('.') {
        end = digits(end + 1);
    }
    if rest[end..].starts_with(['e', 'E']) {
        let sign = usize::from(rest[end + 1..].starts_with(['+', '-']));
        let exponent = digits(end + 1 + sign);
        if exponent > end + 1 + sign {
            end = exponent;
        }
    }
    if rest[end..].starts_with(|c: char| c.is_alphanumeric() || c == '_' || c == '.') {
        let stop =
            rest[end..].find(|c: char| !c.is_alphanumeric() && c != '_' && c != '.').map_or(rest.len(), |n| end + n);
        let wrong = Wrong::new(at..at + stop, format!("`{}` is neither a number nor a name", &rest[..stop]));
        let (number, name) = rest[..stop].split_at(end);
        return Err(match name.starts_with(|c: char| c.is_alphabetic()) {
            true => wrong.help(format!("for a product write `{number}*{name}`")),
            false => wrong.help("numbers are written as 1, 0.5, 2e-3"),
        });
    }
    match rest[..end].parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((Token::Number(value), end)),
        _ => Err(Wrong::new(at..at + end, format!("`{}` is beyond the largest number, 1.8e308", &rest[..end]))),
    }
}
