//! Sentences of a page: names as code, terms with their explanation.

use super::terms::{self, TERMS};
use crate::report::chart::Size;
use crate::report::markup::Markup;
use crate::report::words;
use core::fmt::Display;

/// Letters after a term that stay with it: `),`.
const CLOSE: usize = 2;

/// Which terms have been met, and how plots are drawn: where they are open at first, and where they are closed.
pub(super) struct Prose {
    sizes: [Size; 2],
    /// How many closed sections this stands in.
    pub closed: u64,
    /// In this section, where a term is explained once.
    here: Vec<&'static str>,
    /// On the page.
    met: Vec<&'static str>,
}

impl Prose {
    /// Nothing has been met.
    pub fn new(sizes: [Size; 2]) -> Prose {
        Prose { sizes, closed: 0, here: vec![], met: vec![] }
    }

    /// How plots are drawn here.
    pub fn size(&self) -> Size {
        self.sizes[usize::from(self.closed > 0)]
    }

    /// A new section begins.
    pub fn begin(&mut self) {
        self.here.clear();
    }

    /// A sentence with names as code.
    pub fn sentence(&mut self, to: &mut Markup, text: &str) {
        for (name, piece) in words::pieces(text) {
            if name { to.words("code", &[], piece) } else { self.text(to, &typeset(piece)) }
        }
    }

    /// Text with its terms as buttons that open their explanation.
    pub fn text(&mut self, to: &mut Markup, text: &str) {
        let mut rest = text;
        while let Some((at, words, term)) = terms::first(rest, &self.here) {
            // A bracket before a term, or a comma after, is not parted from it at the end of a line.
            let before = rest[..at].rfind(char::is_whitespace).map_or(0, |space| space + 1);
            let after = at + words.len();
            let after = after + rest[after..].find(char::is_whitespace).unwrap_or(rest.len() - after).min(CLOSE);
            let after = (after..rest.len()).find(|end| rest.is_char_boundary(*end)).unwrap_or(rest.len());
            to.text(&rest[..before]);
            let target = format!("term-{}", term.id);
            let attributes: [(&str, &dyn Display); 3] =
                [("type", &"button"), ("class", &"term"), ("popovertarget", &target)];
            to.node("span", &[("class", &"keep")], |span| {
                span.text(&rest[before..at]);
                span.words("button", &attributes, words);
                span.text(&rest[at + words.len()..after]);
            });
            self.here.push(term.id);
            if !self.met.contains(&term.id) {
                self.met.push(term.id);
            }
            rest = &rest[after..];
        }
        to.text(rest);
    }

    /// The explanations of the terms that were met, to be opened and, on paper, to be read below.
    pub fn explanations(&self, body: &mut Markup) {
        if self.met.is_empty() {
            return;
        }
        body.node("section", &[("class", &"terms"), ("aria-label", &"Terms")], |section| {
            for term in TERMS.iter().filter(|term| self.met.contains(&term.id)) {
                let attributes: [(&str, &dyn Display); 2] =
                    [("id", &format_args!("term-{}", term.id)), ("popover", &"")];
                section.node("div", &attributes, |node| {
                    node.words("b", &[], format_args!("{}: ", term.name()));
                    node.text(term.meaning);
                });
            }
        });
    }
}

/// A minus that does not part from its number at the end of a line. Tables keep the plain one, for those who copy numbers.
fn typeset(text: &str) -> String {
    let mut typeset = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    let mut before = (' ', ' ');
    while let Some(letter) = letters.next() {
        let exponent = before.1 == 'e' && before.0.is_ascii_digit();
        let number = letters.peek().is_some_and(char::is_ascii_digit) && (exponent || !before.1.is_alphanumeric());
        typeset.push(if letter == '-' && number { '−' } else { letter });
        before = (before.1, letter);
    }
    typeset
}

#[cfg(test)]
mod tests {
    use super::typeset;

    #[test]
    fn only_numbers_have_a_minus() {
        assert_eq!(typeset("p < 1e-15, by -3: pre-filter, phase-2"), "p < 1e−15, by −3: pre-filter, phase-2");
    }
}
