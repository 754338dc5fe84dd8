//! Pictures as pixels.

use crate::error::Error;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Pixels of the picture to each one of the drawing, along each side.
const SCALE: f32 = 2.0;

/// An SVG document as the bytes of a PNG file.
pub(super) fn rendered(svg: &str) -> Result<Vec<u8>, Error> {
    let failed = |why: String| Error::Option(format!("the picture as PNG: {why}"));
    let mut options = Options::default();
    options.fontdb_mut().load_system_fonts();
    if options.fontdb.is_empty() {
        return Err(failed(
            "the system has no font for its letters; install one, or keep the picture as SVG".to_owned(),
        ));
    }
    let tree = Tree::from_str(svg, &options).map_err(|error| failed(error.to_string()))?;
    let (width, height) = (tree.size().width() * SCALE, tree.size().height() * SCALE);
    let mut pixels = Pixmap::new(width.ceil() as u32, height.ceil() as u32)
        .ok_or_else(|| failed(format!("{width} x {height} pixels are too many")))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| failed(error.to_string()))
}
