//! Plots as files of their own.

#[cfg(feature = "png")]
mod png;

use super::chart::{self, Size};
use super::file;
use super::markup::Markup;
use crate::error::Error;
use crate::section::Plot;
use std::path::Path;

/// Width of a picture in a file of its own (px).
const WIDTH: f64 = 960.0;

impl Plot {
    /// The picture as an SVG document, on white; empty, if the drawing was not kept.
    pub fn to_svg(&self) -> String {
        let mut svg = Markup::default();
        chart::draw(self, &mut svg, Size::Fixed(WIDTH));
        svg.finish()
    }

    /// The picture as pixels, in a PNG file's bytes: two to each of the SVG's, and its letters in a font of the system.
    ///
    /// # Errors
    /// A system without fonts; a drawing that was not kept.
    #[cfg(feature = "png")]
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        png::rendered(&self.to_svg())
    }

    /// Writes the picture to a file that ends in `.svg` (or `.png`, with the feature of that name); beside first and then
    /// renamed, so that there is never half a file.
    ///
    /// # Errors
    /// Another ending, or a path that cannot be written to; nothing is left behind.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("svg") => file::write(path, self.to_svg().as_bytes()),
            #[cfg(feature = "png")]
            Some("png") => file::write(path, &self.to_png()?),
            _ => {
                let (path, endings) = (path.display(), if cfg!(feature = "png") { ".svg or .png" } else { ".svg" });
                Err(Error::Option(format!("{path}: a picture is written as {endings}; give the path that ending")))
            }
        }
    }
}
