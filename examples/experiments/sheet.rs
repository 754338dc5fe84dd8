//! The contact sheet: one HTML page with all figures and their captions.

use crate::figure::Figure;
use std::path::Path;

const STYLE: &str = "body{font:16px/1.5 sans-serif;max-width:1120px;margin:1em auto;padding:0 1em;color:#222;background:#fff}\
figure{margin:2em 0;border:1px solid #ccc;padding:8px}img{width:100%;height:auto}figcaption{padding:4px 8px}";

/// Draws the figures into a folder, and writes `index.html` that shows them all.
pub fn write(folder: &Path, title: &str, figures: &[Figure]) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{0}</title><style>{STYLE}</style><main><h1>{0}</h1>\n",
        escaped(title)
    );
    for figure in figures {
        figure.draw(folder)?;
        let (alt, caption) = (escaped(&figure.title), escaped(&figure.caption));
        page += &format!(
            "<figure id=\"{0}\"><img src=\"{0}.svg\" alt=\"{alt}\"><figcaption>{caption}</figcaption></figure>\n",
            figure.name
        );
    }
    std::fs::write(folder.join("index.html"), page + "</main></html>\n")?;
    Ok(())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
