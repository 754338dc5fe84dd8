//! Drawings as SVG, for the page and for files, by one code.
//!
//! A page is read at 375 and at 1440 pixels, and its letters must not shrink with the screen. So a *fluid* drawing places its
//! letters by percentages in pixels of the screen and stretches only its curves; a *fixed* one, for files, is in pixels
//! throughout. Colors are names in the style sheet: the page gives them by theme, a file by value.

mod curves;
mod forest;
mod heat;
mod scale;
mod timeline;

pub(super) use timeline::{COLUMNS, keys, time_axis};

use super::markup::Markup;
use crate::section::{Drawing, Plot, Style};

/// How wide a drawing is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Size {
    /// As wide as the page leaves it; signals over time in so many columns at most.
    Fluid(usize),
    /// Width in pixels, margins included.
    Fixed(f64),
}

/// Room for letters about a drawing (px).
#[derive(Clone, Copy, Debug)]
struct Margins {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

/// A drawing surface inside its margins: `x` from 0 to 1, `y` in pixels from above.
struct Frame {
    size: Size,
    margins: Margins,
    height: f64,
}

/// Width of the letters of the drawings (px): an estimate from above.
const LETTER: f64 = 7.0;
/// Coordinates across a fluid drawing.
const FLUID: f64 = 1000.0;

/// Names of colors with their values on light and on dark ground.
pub(super) const PALETTE: [(&str, &str, &str); 16] = [
    ("paper", "#ffffff", "#0d1117"),
    ("card", "#f6f8fa", "#161b22"),
    ("ink", "#1b1f24", "#e6edf3"),
    ("muted", "#57606a", "#9da7b3"),
    ("grid", "#d8dee4", "#30363d"),
    ("measured", "#6e86a8", "#7d96bd"),
    ("predicted", "#c2410c", "#ff9d57"),
    ("residual", "#4f46e5", "#a5b4fc"),
    ("input", "#0f766e", "#4fd1c5"),
    ("quiet", "#8c959f", "#768390"),
    ("bar", "#4f6db8", "#7c9cf0"),
    ("level", "#b42318", "#ff7b72"),
    ("good", "#1a7f37", "#3fb950"),
    ("care", "#8a5a00", "#d9a02a"),
    ("bad", "#c11f2b", "#ff7b72"),
    ("link", "#0b5cad", "#6cb6ff"),
];

/// The style of all drawings, its colors by name.
pub(super) const STYLE: &str = include_str!("chart/chart.css");

/// Draws a plot; nothing, if its drawing was not kept.
pub(super) fn draw(plot: &Plot, to: &mut Markup, size: Size) {
    match &plot.drawing {
        Some(Drawing::Curves(drawn)) => curves::draw(drawn, to, size, &plot.title),
        Some(Drawing::Forest(drawn)) => forest::draw(drawn, to, size, &plot.title),
        Some(Drawing::Heat(drawn)) => heat::draw(drawn, to, size, &plot.title),
        Some(Drawing::Timeline(drawn)) => timeline::draw(drawn, to, size, &plot.title),
        None => {}
    }
}

/// The class of a style in the style sheet.
pub(super) fn class(style: Style) -> &'static str {
    match style {
        Style::Measured => "measured",
        Style::Predicted => "predicted",
        Style::Residual => "residual",
        Style::Confidence => "confidence",
        Style::Prediction => "prediction",
        Style::Input => "input",
        Style::Main => "main",
        Style::Reference => "reference",
        Style::Quiet => "quiet",
    }
}

impl Frame {
    /// Draws within the margins what `content` draws, under a name for those who cannot see it.
    fn draw(&self, to: &mut Markup, name: &str, content: impl FnOnce(&Frame, &mut Markup)) {
        let Margins { left, right, top, bottom } = self.margins;
        let height = self.height + top + bottom;
        match self.size {
            Size::Fluid(_) => {
                let style = format!("height:{height}px;padding:{top}px {right}px {bottom}px {left}px");
                let attributes: [(&str, &dyn core::fmt::Display); 4] =
                    [("class", &"chart"), ("role", &"img"), ("aria-label", &name), ("style", &style)];
                to.node("svg", &attributes, |svg| content(self, svg));
            }
            Size::Fixed(width) => {
                let view = format!("0 0 {width} {height}");
                let attributes: [(&str, &dyn core::fmt::Display); 7] = [
                    ("xmlns", &"http://www.w3.org/2000/svg"),
                    ("class", &"chart"),
                    ("width", &width),
                    ("height", &height),
                    ("viewBox", &view),
                    ("role", &"img"),
                    ("aria-label", &name),
                ];
                to.node("svg", &attributes, |svg| {
                    svg.words("title", &[], name);
                    let light = |style: String, (name, light, _): &(&str, &str, &str)| {
                        style.replace(&format!("var(--{name})"), light)
                    };
                    let style = PALETTE.iter().fold(STYLE.to_owned(), light);
                    svg.node("style", &[], |node| node.verbatim(&style));
                    svg.leaf("rect", &[("class", &"paper"), ("width", &width), ("height", &height)]);
                    let shift = format!("translate({left},{top})");
                    svg.node("g", &[("transform", &shift)], |group| content(self, group));
                });
            }
        }
    }

    /// The place of a fraction of the width, as an attribute.
    fn x(&self, fraction: f64) -> String {
        match self.size {
            Size::Fluid(_) => format!("{}%", Short(100.0 * fraction)),
            Size::Fixed(_) => Short(fraction * self.width()).to_string(),
        }
    }

    /// Width of the surface in the coordinates of its curves.
    fn width(&self) -> f64 {
        match self.size {
            Size::Fluid(_) => FLUID,
            Size::Fixed(width) => (width - self.margins.left - self.margins.right).max(1.0),
        }
    }
}

/// A coordinate with two decimals at most.
struct Short(f64);

impl core::fmt::Display for Short {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let text = format!("{:.2}", self.0);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}

/// At most so many letters.
fn cut(text: &str, letters: usize) -> String {
    match text.chars().count() <= letters {
        true => text.to_owned(),
        false => text.chars().take(letters.saturating_sub(1)).chain(['…']).collect(),
    }
}
