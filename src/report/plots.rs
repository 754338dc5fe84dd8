//! [`Plot`]: the pictures of a report, for its page and as files.

#[cfg(feature = "png")]
mod png;
mod records;
mod unknowns;

pub(super) use records::{against_signals, autocorrelation, closeup, histogram, residuals, response};
pub(super) use unknowns::{correlation, excitation, parameters, profile};

use super::chart::{Curves, Forest, Heat, Size};
use super::markup::Markup;
use super::{OutputFit, Record, Report, file};
use crate::error::Error;
use std::path::Path;

/// A picture of a report.
///
/// [`save`](Plot::save) writes it as a file of its own, on white; the page draws it by the same code.
#[derive(Clone, Debug)]
pub struct Plot<'a> {
    name: String,
    title: String,
    drawing: Drawing<'a>,
}

#[derive(Clone, Debug)]
enum Drawing<'a> {
    Curves(Curves<'a>),
    Forest(Forest),
    Heat(Heat),
}

/// Width of a picture in a file of its own (px).
const WIDTH: f64 = 960.0;
/// Height of the small pictures beside each other (px).
const PANEL: f64 = 160.0;

impl Plot<'_> {
    /// A name made of letters, digits and `-`, fit for a file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it shows, in one sentence.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        let mut svg = Markup::default();
        self.draw(&mut svg, Size::Fixed(WIDTH));
        svg.finish()
    }

    /// The picture as pixels, in a PNG file's bytes: two to each of the SVG's, and its letters in a font of the system.
    ///
    /// # Errors
    /// A system without fonts.
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

    pub(super) fn draw(&self, to: &mut Markup, size: Size) {
        match &self.drawing {
            Drawing::Curves(curves) => curves.draw(to, size, &self.title),
            Drawing::Forest(forest) => forest.draw(to, size, &self.title),
            Drawing::Heat(heat) => heat.draw(to, size, &self.title),
        }
    }
}

/// Every picture there is.
pub(super) fn all(report: &Report) -> Vec<Plot<'_>> {
    let of_report = [parameters(report), correlation(report), excitation(report)].into_iter().flatten();
    let fits = report.records.iter().flat_map(|record| record.fits.iter().map(move |fit| of_fit(record, fit)));
    of_report.chain(report.profiles.iter().map(profile)).chain(fits.flatten()).collect()
}

fn of_fit<'a>(record: &Record, fit: &'a OutputFit) -> Vec<Plot<'a>> {
    let drawn = [response(record, fit), residuals(record, fit), histogram(record, fit), autocorrelation(record, fit)];
    drawn.into_iter().chain(closeup(record, fit)).flatten().chain(against_signals(record, fit)).collect()
}

fn plot<'a>(name: &str, title: String, drawing: Drawing<'a>) -> Plot<'a> {
    Plot { name: name.to_owned(), title, drawing }
}

fn file_name(text: &str) -> String {
    text.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '-' }).collect()
}
