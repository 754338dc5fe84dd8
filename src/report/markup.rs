//! [`Markup`]: HTML and SVG that is well formed and escaped, because nothing else can be written with it.

use core::fmt::{Display, Write};

/// A growing document.
#[derive(Debug, Default)]
pub(super) struct Markup(String);

/// Names and values of attributes; values are escaped.
pub(super) type Attributes<'a> = &'a [(&'a str, &'a dyn Display)];

impl Markup {
    /// An element with content.
    pub(super) fn node(&mut self, tag: &str, attributes: Attributes<'_>, content: impl FnOnce(&mut Markup)) {
        self.begin(tag, attributes);
        self.0.push('>');
        content(self);
        self.0.push_str("</");
        self.0.push_str(tag);
        self.0.push('>');
    }

    /// An element with nothing but text in it.
    pub(super) fn words(&mut self, tag: &str, attributes: Attributes<'_>, text: impl Display) {
        self.node(tag, attributes, |node| node.text(text));
    }

    /// An element that has no content.
    pub(super) fn leaf(&mut self, tag: &str, attributes: Attributes<'_>) {
        self.begin(tag, attributes);
        self.0.push_str("/>");
    }

    /// Text, escaped.
    pub(super) fn text(&mut self, text: impl Display) {
        // Writing to a string does not fail.
        let _ = write!(Escaped(&mut self.0), "{text}");
    }

    /// This library's own style sheets and scripts, as they stand.
    pub(super) fn verbatim(&mut self, text: &str) {
        self.0.push_str(text);
    }

    pub(super) fn finish(self) -> String {
        self.0
    }

    fn begin(&mut self, tag: &str, attributes: Attributes<'_>) {
        self.0.push('<');
        self.0.push_str(tag);
        for (name, value) in attributes {
            self.0.push(' ');
            self.0.push_str(name);
            self.0.push_str("=\"");
            self.text(value);
            self.0.push('"');
        }
    }
}

/// Escapes what is written through it, for text and for quoted attributes.
struct Escaped<'a>(&'a mut String);

impl Write for Escaped<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for letter in text.chars() {
            match letter {
                '&' => self.0.push_str("&amp;"),
                '<' => self.0.push_str("&lt;"),
                '>' => self.0.push_str("&gt;"),
                '"' => self.0.push_str("&quot;"),
                '\'' => self.0.push_str("&#39;"),
                '\n' | '\t' => self.0.push(letter),
                // Other control characters, and two code points, are allowed neither in XML nor in HTML.
                letter if letter.is_control() || matches!(letter, '\u{FFFE}' | '\u{FFFF}') => self.0.push('\u{FFFD}'),
                letter => self.0.push(letter),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_attributes_are_escaped() {
        let mut page = Markup::default();
        page.node("p", &[("title", &"a\"b'<c>&")], |p| {
            p.text("</p><script>1 & 2\u{0}ψ</script>");
            p.leaf("br", &[]);
        });
        assert_eq!(
            page.finish(),
            "<p title=\"a&quot;b&#39;&lt;c&gt;&amp;\">&lt;/p&gt;&lt;script&gt;1 &amp; 2\u{FFFD}ψ&lt;/script&gt;<br/></p>"
        );
    }
}
