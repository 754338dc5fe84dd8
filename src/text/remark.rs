//! [`Remark`]: what is wrong with a text, or odd in it, and where; [`Error`]: why a text is no model.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use core::fmt;
use core::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// A text and the name that it has in messages.
#[derive(Debug)]
pub(super) struct Source {
    pub name: String,
    pub text: String,
}

/// Bytes of a text.
pub(super) type Span = Range<usize>;

/// Something said of a place in a text. Its `Display` shows the line with a caret below the place, as a compiler does.
#[derive(Clone)]
pub struct Remark {
    source: Arc<Source>,
    is_error: bool,
    title: String,
    at: Span,
    /// Another place that has to do with it.
    other: Option<(Span, String)>,
    help: Option<String>,
}

impl Remark {
    pub(super) fn error(source: &Arc<Source>, at: Span, title: impl Into<String>) -> Self {
        Remark { source: source.clone(), is_error: true, title: title.into(), at, other: None, help: None }
    }

    pub(super) fn warning(source: &Arc<Source>, at: Span, title: impl Into<String>) -> Self {
        Remark { is_error: false, ..Remark::error(source, at, title) }
    }

    pub(super) fn and_at(self, at: Span, label: impl Into<String>) -> Self {
        Remark { other: Some((at, label.into())), ..self }
    }

    /// The remedy.
    pub(super) fn help(self, help: impl Into<Option<String>>) -> Self {
        Remark { help: help.into(), ..self }
    }

    /// What is said, in a sentence without the place.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The remedy, if one is known.
    pub fn remedy(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// The line, from one.
    pub fn line(&self) -> usize {
        self.before().matches('\n').count() + 1
    }

    /// The column, in characters from one.
    pub fn column(&self) -> usize {
        let before = self.before();
        before[before.rfind('\n').map_or(0, |end| end + 1)..].chars().count() + 1
    }

    fn before(&self) -> &str {
        &self.source.text[..self.within(&self.at).start]
    }

    /// A place between characters of the text, whatever was asked for.
    fn within(&self, at: &Span) -> Span {
        let text = &self.source.text;
        let floor = |mut at: usize| {
            at = at.min(text.len());
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            at
        };
        let start = floor(at.start);
        start..floor(at.end).max(start)
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let level = if self.is_error { Level::ERROR } else { Level::WARNING };
        let primary = AnnotationKind::Primary.span(self.within(&self.at));
        let mut snippet =
            Snippet::source(self.source.text.as_str()).path(self.source.name.as_str()).annotation(primary);
        if let Some((at, label)) = &self.other {
            snippet = snippet.annotation(AnnotationKind::Context.span(self.within(at)).label(label.as_str()));
        }
        let mut group = Group::with_title(level.primary_title(self.title.as_str())).element(snippet);
        if let Some(help) = &self.help {
            group = group.element(Level::HELP.message(help.as_str()));
        }
        f.write_str(&Renderer::plain().term_width(100).render(&[group]))
    }
}

/// The same text: a remark is for readers.
impl fmt::Debug for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Why there is no model.
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read.
    File {
        /// The file.
        path: PathBuf,
        /// The system's word.
        source: std::io::Error,
    },
    /// A text with mistakes, one or more; each says where and what to do.
    Wrong(Vec<Remark>),
    /// A constant, table or model that there is none of by this name.
    Unknown {
        /// What was looked for: "constant", "shipped model".
        what: &'static str,
        /// Its name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A constant that is not a finite number.
    NotFinite {
        /// Its name.
        name: String,
        /// The value.
        value: f64,
    },
    /// A model that cannot be written as a text.
    Unwritable(String),
    /// A unit that is not known, or not one of the dimension that is needed.
    Unit(String),
}

impl Error {
    /// The mistakes in the text, with their places; none for an error of another kind.
    pub fn remarks(&self) -> &[Remark] {
        match self {
            Error::Wrong(remarks) => remarks,
            _ => &[],
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::File { path, source } => write!(f, "{}: {source}", path.display()),
            Error::Wrong(remarks) => {
                for (i, remark) in remarks.iter().enumerate() {
                    write!(f, "{}{remark}", if i > 0 { "\n\n" } else { "" })?;
                }
                Ok(())
            }
            Error::Unknown { what, name, known } => match nearest(name, known.iter().map(String::as_str)) {
                Some(near) => write!(f, "there is no {what} `{name}`; did you mean `{near}`?"),
                None if known.is_empty() => write!(f, "there is no {what} `{name}`; the model has none"),
                None => write!(f, "there is no {what} `{name}`; there is: {}", known.join(", ")),
            },
            Error::NotFinite { name, value } => write!(f, "constant `{name}` is {value}; it must be finite"),
            Error::Unit(sentence) => f.write_str(sentence),
            Error::Unwritable(reason) => write!(f, "the model cannot be written as a text: {reason}"),
        }
    }
}

/// The same sentence: it is what a `main` that returns the error shows.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::File { source, .. } => Some(source),
            _ => None,
        }
    }
}

/// The known name that a mistyped one most resembles.
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let near = |known: &&'a str| {
        let same = known.to_lowercase() == name.to_lowercase();
        if same { 1.0 } else { strsim::normalized_damerau_levenshtein(known, name) }
    };
    let best = known.into_iter().max_by(|a, b| near(a).total_cmp(&near(b)))?;
    // One letter of two, two of five.
    (near(&best) >= 0.5).then_some(best)
}
