//! [`Plot`]: what is drawn, as plain numbers.

use super::{Timeline, identifier};
use serde::{Deserialize, Serialize};

/// A picture of a section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plot {
    /// A name made of letters, digits and `-`, fit for a file; one plot of a report has it.
    pub name: String,
    /// Description in a sentence, for readers who do not see it.
    pub title: String,
    /// The caption above it.
    pub caption: String,
    /// The drawing; `None` in a report read from JSON without drawings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) drawing: Option<Drawing>,
}

/// The kinds of drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Drawing {
    /// Curves, bars and levels over a pair of axes.
    Curves(Curves),
    /// Estimates with their intervals, on one scale.
    Forest(Forest),
    /// A table of colored cells.
    Heat(Heat),
    /// Signals over time.
    Timeline(Timeline),
}

/// Layers over one pair of axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Curves {
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// From the lowest to the topmost.
    pub layers: Vec<Layer>,
}

/// An axis; it shows what its layers span.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Name of the quantity.
    pub name: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// Whether it is logarithmic; what is not above zero is not drawn then.
    pub logarithmic: bool,
    /// A value that is shown besides the layers.
    #[serde(with = "crate::real")]
    pub from: Option<f64>,
    /// Nothing beyond this is shown.
    #[serde(with = "crate::real")]
    pub to: Option<f64>,
}

/// Meaning of a line or bar; it determines the color.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// Measured values.
    Measured,
    /// Values predicted by the model; in a comparison, the first model.
    Predicted,
    /// Measured less predicted.
    Residual,
    /// Where the noise-free output is.
    Confidence,
    /// Where a new measurement is.
    Prediction,
    /// An input of the model.
    Input,
    /// The subject of the plot.
    Main,
    /// The reference for comparison; in a comparison, the second model.
    Reference,
    /// Context that is not judged; in a comparison, further models.
    Quiet,
}

/// One of the things drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// A curve through points.
    Line {
        /// Its meaning.
        style: Style,
        /// `x` and `y`.
        #[serde(with = "crate::real")]
        points: Vec<(f64, f64)>,
    },
    /// Points.
    Dots {
        /// Their meaning.
        style: Style,
        /// `x` and `y`.
        #[serde(with = "crate::real")]
        points: Vec<(f64, f64)>,
    },
    /// Bars of equal width, standing on zero.
    Bars {
        /// Their meaning.
        style: Style,
        /// Left edge of the first.
        #[serde(with = "crate::real")]
        first: f64,
        /// Width of each.
        #[serde(with = "crate::real")]
        width: f64,
        /// Heights.
        #[serde(with = "crate::real")]
        heights: Vec<f64>,
    },
    /// A value of `y` to compare with.
    Level {
        /// The value.
        #[serde(with = "crate::real")]
        value: f64,
        /// Its label; may be empty.
        label: String,
    },
    /// A value of `x` to look at.
    Mark {
        /// The value.
        #[serde(with = "crate::real")]
        value: f64,
        /// Its label; may be empty.
        label: String,
    },
}

/// Intervals relative to their estimates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Forest {
    /// Label of the scale, which is in percent.
    pub scale: String,
    /// One estimate each.
    pub rows: Vec<Interval>,
}

/// One estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Its name.
    pub name: String,
    /// Ends of its interval relative to its size (%).
    #[serde(with = "crate::real")]
    pub ends: Option<(f64, f64)>,
    /// Why there is no interval; else empty.
    pub why: String,
}

/// Cells in rows, all of one width.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Heat {
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Row by row, from -1 to 1; `None` where nothing is known.
    #[serde(with = "crate::real")]
    pub cells: Vec<Vec<Option<f64>>>,
    /// Whether the numbers are parts that are read in percent, and colored by their part of the row's largest.
    pub percent: bool,
}

impl Plot {
    /// Layers over the axes `[x, y]`, the lowest first; in the name, what is no letter or digit becomes `-`.
    pub fn new(
        name: impl AsRef<str>,
        caption: impl Into<String>,
        title: impl Into<String>,
        [x, y]: [Axis; 2],
        layers: Vec<Layer>,
    ) -> Plot {
        Plot::of(name, caption, title, Drawing::Curves(Curves { x, y, layers }))
    }

    /// Its axes `[x, y]` and what is drawn over them, if it has axes.
    pub fn curves(&self) -> Option<([&Axis; 2], &[Layer])> {
        match &self.drawing {
            Some(Drawing::Curves(Curves { x, y, layers })) => Some(([x, y], layers)),
            _ => None,
        }
    }

    /// Its signals over time, for tests.
    #[doc(hidden)]
    pub fn timeline(&self) -> Option<&Timeline> {
        match &self.drawing {
            Some(Drawing::Timeline(timeline)) => Some(timeline),
            _ => None,
        }
    }

    /// A plot of any kind.
    pub(crate) fn of(
        name: impl AsRef<str>,
        caption: impl Into<String>,
        title: impl Into<String>,
        drawing: Drawing,
    ) -> Plot {
        let name = identifier(name.as_ref());
        Plot { name, title: title.into(), caption: caption.into(), drawing: Some(drawing) }
    }
}

impl Axis {
    /// A linear axis.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Axis {
        Axis { name: name.into(), unit: unit.into(), logarithmic: false, from: None, to: None }
    }

    /// A logarithmic axis.
    pub fn logarithmic(self) -> Axis {
        Axis { logarithmic: true, ..self }
    }

    /// Shows this value too.
    pub fn from(self, value: f64) -> Axis {
        Axis { from: Some(value), ..self }
    }

    /// Shows nothing beyond this value.
    pub fn to(self, value: f64) -> Axis {
        Axis { to: Some(value), ..self }
    }
}
